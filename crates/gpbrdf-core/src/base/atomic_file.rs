//! Files that appear whole or not at all.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::base::error::{Error, Result};

/// Paths of the temporary files that exist now.
static PENDING: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// How the name of a temporary file begins.
const PREFIX: &str = ".gpbrdf-";

/// How the name of a temporary file ends.
const SUFFIX: &str = ".tmp";

/// Size of a file's buffer: large enough that a table's many small writes cost few system calls.
const BUFFER_BYTES: usize = 1 << 18;

fn pending() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A panic elsewhere leaves the set usable: every change to it is a single insertion or removal.
    PENDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A buffered file that takes its name only when it is complete.
///
/// The content goes to a temporary file in the folder of the target; [`AtomicFile::commit`] renames it. If
/// the value is dropped before that, the temporary file is removed and an existing target stays as it was.
/// The result has the permissions of a normally created file. If the target is a symbolic link, the link
/// stays and the file that it points to is replaced.
///
/// The temporary file is locked while it is written. One whose lock is free belongs to a killed process; the next
/// file of the same target removes it.
///
/// The data is not forced to the disk: a crash of the process leaves no partial file, but a power cut may.
#[derive(Debug)]
pub struct AtomicFile {
    target: PathBuf,
    temporary: PathBuf,
    file: BufWriter<File>,
    committed: bool,
}

impl AtomicFile {
    /// Starts a file that will be called `path` once it is committed.
    ///
    /// # Errors
    /// [`Error::Io`] when `path` is a directory or a device, or its folder does not exist or cannot be
    /// written to.
    pub fn create(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let failed = |source| Error::write(path, source);
        let target = resolve(path).map_err(failed)?;
        let folder = match target.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
            _ => PathBuf::from("."),
        };
        // The lock is held during the creation, so that no temporary file exists without being registered.
        let mut pending = pending();
        let mut places = (0u64..).map(|number| folder.join(temporary_name(&target, number)));
        let mut started = None;
        for place in places.by_ref() {
            if let Some(file) = start(&place).map_err(failed)? {
                started = Some((place, file));
                break;
            }
        }
        let (temporary, file) = started.ok_or_else(|| failed(io::ErrorKind::AlreadyExists.into()))?;
        pending.insert(temporary.clone());
        // What other killed processes have left of this target.
        while places.next().is_some_and(|place| remove_if_abandoned(&place)) {}
        let file = BufWriter::with_capacity(BUFFER_BYTES, file);
        Ok(Self { target, temporary, file, committed: false })
    }

    /// The name the file will have.
    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Writes `bytes` to `path`, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be written; no part of it is left then.
    pub fn write(path: impl AsRef<Path>, bytes: &[u8]) -> Result<()> {
        let mut file = Self::create(path.as_ref())?;
        file.write_all(bytes).map_err(|source| Error::write(path.as_ref(), source))?;
        file.commit()
    }

    /// Removes the temporary files that killed processes have left in a folder. No other process may be writing to it;
    /// the files of this one are kept. A folder that does not exist holds none.
    ///
    /// # Errors
    /// [`Error::Io`] when the folder cannot be listed or a file cannot be removed.
    pub fn remove_abandoned(folder: impl AsRef<Path>) -> Result<()> {
        let folder = folder.as_ref();
        let entries = match fs::read_dir(folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(Error::read(folder, error)),
        };
        let pending = pending();
        for entry in entries {
            let path = entry.map_err(|source| Error::read(folder, source))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name.starts_with(PREFIX) && name.ends_with(SUFFIX) && !pending.contains(&path) {
                fs::remove_file(&path).map_err(|source| Error::write(&path, source))?;
            }
        }
        Ok(())
    }

    /// Flushes the file and gives it its name.
    ///
    /// # Errors
    /// [`Error::Io`] when the last bytes cannot be written or the file cannot be renamed; no part of it is
    /// left then.
    pub fn commit(self) -> Result<()> {
        Self::commit_all(vec![self])
    }

    /// Flushes all files, then renames all of them. If one cannot be flushed, none is renamed.
    ///
    /// # Errors
    /// [`Error::Io`] as for [`AtomicFile::commit`]. When a rename fails, the files before it in the list
    /// already have their names.
    pub fn commit_all(mut files: Vec<Self>) -> Result<()> {
        for file in &mut files {
            file.file.flush().map_err(|source| Error::write(&file.target, source))?;
            // A folder may have taken the name in the meantime. Its rename would fail, but only after others
            // were done.
            if file.target.is_dir() {
                return Err(Error::write(&file.target, io::ErrorKind::IsADirectory.into()));
            }
        }
        // The lock is held over all renames, so that an interruption finds either none or all of them done.
        let mut pending = pending();
        let outcome = files.iter_mut().try_for_each(|file| {
            fs::rename(&file.temporary, &file.target).map_err(|source| Error::write(&file.target, source))?;
            pending.remove(&file.temporary);
            file.committed = true;
            Ok(())
        });
        drop(pending);
        outcome
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.file.seek(position)
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.committed {
            let mut pending = pending();
            // A failure cannot be reported from here.
            let _ = fs::remove_file(&self.temporary);
            pending.remove(&self.temporary);
        }
    }
}

/// Blocks every [`AtomicFile`] of the process while it exists; see [`remove_pending`].
#[derive(Debug)]
#[must_use = "files can be created and committed again once this is dropped"]
pub struct PendingRemoved {
    _guard: MutexGuard<'static, BTreeSet<PathBuf>>,
}

/// Removes the temporary files of all uncommitted [`AtomicFile`]s. A handler of Ctrl-C calls this before it
/// ends the process.
///
/// Until the returned value is dropped, other threads that create, commit or drop an [`AtomicFile`] wait, so
/// that no new temporary file appears between this call and the end of the process.
pub fn remove_pending() -> PendingRemoved {
    let mut pending = pending();
    for path in std::mem::take(&mut *pending) {
        let _ = fs::remove_file(path);
    }
    PendingRemoved { _guard: pending }
}

/// The name of the `number`th temporary file of a target: any length and any characters of the target's name will do.
fn temporary_name(target: &Path, number: u64) -> String {
    let name = target.file_name().unwrap_or_default().as_encoded_bytes();
    // FNV-1a, with 64 bits.
    let hash = name.iter().fold(0xcbf2_9ce4_8422_2325u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    format!("{PREFIX}{hash:016x}-{number}{SUFFIX}")
}

/// Creates a temporary file and locks it. What a killed process has left in its place is removed; `None` where a living
/// one has a file.
fn start(place: &Path) -> io::Result<Option<File>> {
    loop {
        match OpenOptions::new().write(true).create_new(true).open(place) {
            // Whoever holds the lock of the new file takes it for abandoned and removes it. A file system without locks
            // gives another error; there no file is ever taken for abandoned.
            Ok(file) => {
                let is_mine =
                    !matches!(file.try_lock(), Err(TryLockError::WouldBlock)) && is_at(&file, place);
                return Ok(is_mine.then_some(file));
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                if !remove_if_abandoned(place) {
                    return Ok(None);
                }
            }
            Err(error) => return Err(error),
        }
    }
}

/// Removes a temporary file that nobody has locked. Returns whether it did.
fn remove_if_abandoned(place: &Path) -> bool {
    let Ok(file) = OpenOptions::new().write(true).open(place) else { return false };
    file.try_lock().is_ok() && is_at(&file, place) && fs::remove_file(place).is_ok()
}

/// Whether an open file still has this name: it may have been renamed or removed since it was opened.
#[cfg(unix)]
fn is_at(file: &File, place: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let same = |a: fs::Metadata, b: fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    file.metadata().is_ok_and(|open| fs::symlink_metadata(place).is_ok_and(|named| same(open, named)))
}

/// Whether a file still has this name.
#[cfg(not(unix))]
fn is_at(_file: &File, place: &Path) -> bool {
    place.exists()
}

/// Follows a final symbolic link of `path`. Fails if something other than a regular file has that name.
fn resolve(path: &Path) -> io::Result<PathBuf> {
    let Ok(metadata) = fs::symlink_metadata(path) else {
        if path.file_name().is_none() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"));
        }
        return Ok(path.to_owned());
    };
    let target = if metadata.is_symlink() {
        match fs::canonicalize(path) {
            Ok(target) => target,
            // The link points to a file that does not exist yet.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                let link = fs::read_link(path)?;
                return Ok(path.parent().map_or(link.clone(), |folder| folder.join(&link)));
            }
            Err(error) => return Err(error),
        }
    } else {
        path.to_owned()
    };
    let kind = fs::metadata(&target)?.file_type();
    if kind.is_dir() {
        Err(io::ErrorKind::IsADirectory.into())
    } else if !kind.is_file() {
        Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"))
    } else {
        Ok(target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    // This is one test, since `remove_pending` acts on every file of the process.
    #[test]
    fn files_appear_whole_or_not_at_all() {
        check_temporary_files_of_others();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();

        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"new text").unwrap();
        file.flush().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(folder.path()).len(), 2);
        drop(file);
        assert_eq!(names(folder.path()), ["a.txt"]);
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");

        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"new text").unwrap();
        file.seek(SeekFrom::Start(0)).unwrap();
        file.write_all(b"N").unwrap();
        file.commit().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "New text");
        assert_eq!(names(folder.path()), ["a.txt"]);

        let other = folder.path().join("b.txt");
        let mut both = vec![AtomicFile::create(&path).unwrap(), AtomicFile::create(&other).unwrap()];
        for file in &mut both {
            file.write_all(b"both").unwrap();
        }
        AtomicFile::commit_all(both).unwrap();
        assert_eq!(names(folder.path()), ["a.txt", "b.txt"]);
        assert_eq!(fs::read_to_string(&path).unwrap(), "both");

        // If one target has become a folder, none of the files is committed.
        let third = folder.path().join("c");
        let both = vec![
            AtomicFile::create(folder.path().join("d.txt")).unwrap(),
            AtomicFile::create(&third).unwrap(),
        ];
        fs::create_dir(&third).unwrap();
        assert!(AtomicFile::commit_all(both).is_err());
        assert_eq!(names(folder.path()), ["a.txt", "b.txt", "c"]);

        let abandoned = folder.path().join(".gpbrdf-1-7.tmp");
        fs::write(&abandoned, "half").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"never seen").unwrap();
        AtomicFile::remove_abandoned(folder.path()).unwrap();
        assert!(!abandoned.exists() && names(folder.path()).len() == 4);
        AtomicFile::remove_abandoned(folder.path().join("absent")).unwrap();
        drop(remove_pending());
        assert_eq!(names(folder.path()), ["a.txt", "b.txt", "c"]);
        assert!(file.commit().is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "both");
    }

    /// What a killed process has left is removed, what a living one writes is not.
    fn check_temporary_files_of_others() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let mut first = AtomicFile::create(&path).unwrap();
        let mut second = AtomicFile::create(&path).unwrap();
        assert_ne!(first.temporary, second.temporary);
        first.write_all(b"first").unwrap();
        second.write_all(b"second").unwrap();
        // Three processes were killed: nobody holds a lock on what they wrote.
        for number in 2..5 {
            fs::write(folder.path().join(temporary_name(&path, number)), "half").unwrap();
        }
        let other = folder.path().join(temporary_name(Path::new("b.txt"), 0));
        fs::write(&other, "of another target").unwrap();
        let third = AtomicFile::create(&path).unwrap();
        assert_eq!(names(folder.path()).len(), 4, "{:?}", names(folder.path()));
        assert!(other.exists());
        third.commit().unwrap();
        first.commit().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "first");
        second.commit().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "second");
        AtomicFile::write(folder.path().join("b.txt"), b"b").unwrap();
        assert_eq!(names(folder.path()), ["a.txt", "b.txt"]);
    }

    #[test]
    fn impossible_targets_are_refused_with_their_name() {
        let folder = tempfile::tempdir().unwrap();
        let found = AtomicFile::create(folder.path()).unwrap_err().to_string();
        assert!(
            found.contains("is a directory") && found.contains(folder.path().to_str().unwrap()),
            "{found}"
        );
        let missing = folder.path().join("no/such/file");
        let found = AtomicFile::create(&missing).unwrap_err().to_string();
        assert!(found.starts_with("cannot write") && found.contains("no/such/file"), "{found}");
        assert!(AtomicFile::create("").is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_devices_refused_and_permissions_normal() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        symlink("real", &link).unwrap();
        for text in ["first", "second"] {
            let mut file = AtomicFile::create(&link).unwrap();
            file.write_all(text.as_bytes()).unwrap();
            file.commit().unwrap();
            assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
            assert_eq!(fs::read_to_string(&real).unwrap(), text);
        }
        let plain = folder.path().join("plain");
        fs::write(&plain, "").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&plain), mode(&real));
        assert!(AtomicFile::create("/dev/null").unwrap_err().to_string().contains("not a regular file"));
    }
}
