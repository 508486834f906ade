//! Files that appear whole or not at all.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::base::error::{Error, Result};

/// The temporary files that exist now.
static PENDING: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Tells apart the temporary files of one process.
static COUNTER: AtomicU64 = AtomicU64::new(0);

/// Large enough that a table's worth of small writes costs few system calls.
const BUFFER_BYTES: usize = 1 << 18;

fn pending() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A panic elsewhere leaves the set usable: every change to it is one insertion or removal.
    PENDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A buffered file that takes its name only when it is complete.
///
/// What is written goes to a temporary file in the folder of the target; [`AtomicFile::commit`] renames it.
/// Dropped before that, the temporary file is removed and an existing target stays as it was. The result has
/// the permissions of a normally created file; a target that is a symbolic link stays one, and the file it
/// points to is replaced.
///
/// Nothing is forced to the disk: a crash of the process leaves no partial file, a power cut may.
#[derive(Debug)]
pub struct AtomicFile {
    target: PathBuf,
    temporary: PathBuf,
    file: BufWriter<File>,
    committed: bool,
}

impl AtomicFile {
    /// Starts a file that will be called `path`.
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
        // Held over the creation, so that no temporary file exists unregistered.
        let mut pending = pending();
        loop {
            let number = COUNTER.fetch_add(1, Ordering::Relaxed);
            let temporary = folder.join(format!(".gpbrdf-{}-{number}.tmp", std::process::id()));
            match OpenOptions::new().write(true).create_new(true).open(&temporary) {
                Ok(file) => {
                    pending.insert(temporary.clone());
                    let file = BufWriter::with_capacity(BUFFER_BYTES, file);
                    return Ok(Self { target, temporary, file, committed: false });
                }
                // Left over by a killed process with the same id.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(failed(error)),
            }
        }
    }

    /// The name the file will have.
    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Writes `bytes` to `path`, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be written; nothing is left then.
    pub fn write(path: impl AsRef<Path>, bytes: &[u8]) -> Result<()> {
        let mut file = Self::create(path.as_ref())?;
        file.write_all(bytes).map_err(|source| Error::write(path.as_ref(), source))?;
        file.commit()
    }

    /// Flushes the file and gives it its name.
    ///
    /// # Errors
    /// [`Error::Io`] when the last bytes cannot be written or the file cannot be renamed; nothing is left then.
    pub fn commit(self) -> Result<()> {
        Self::commit_all(vec![self])
    }

    /// Flushes all files, then gives all of them their names: an error while writing leaves none of them.
    ///
    /// # Errors
    /// [`Error::Io`] as for [`AtomicFile::commit`]. When a rename fails, files before it in the list have
    /// their names already.
    pub fn commit_all(mut files: Vec<Self>) -> Result<()> {
        for file in &mut files {
            file.file.flush().map_err(|source| Error::write(&file.target, source))?;
            // The folder may have appeared in the meantime; a rename would replace an empty one on no system.
            if file.target.is_dir() {
                return Err(Error::write(&file.target, io::ErrorKind::IsADirectory.into()));
            }
        }
        // Held over all renames: an interruption finds none or all of them done.
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
            // Nothing can be done about a failure here.
            let _ = fs::remove_file(&self.temporary);
            pending.remove(&self.temporary);
        }
    }
}

/// Holds back every [`AtomicFile`] of the process; see [`remove_pending`].
#[derive(Debug)]
#[must_use = "files can be created and committed again once this is dropped"]
pub struct PendingRemoved {
    _guard: MutexGuard<'static, BTreeSet<PathBuf>>,
}

/// Removes the temporary files of all uncommitted [`AtomicFile`]s, for a handler of Ctrl-C to call before it
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

/// `path` with a final symbolic link followed; an error unless a regular file can stand there.
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
            // A link to nothing yet.
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

    // One test, since `remove_pending` reaches every file of the process.
    #[test]
    fn files_appear_whole_or_not_at_all() {
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

        // A target that turns into a folder stops all of them.
        let third = folder.path().join("c");
        let both = vec![
            AtomicFile::create(folder.path().join("d.txt")).unwrap(),
            AtomicFile::create(&third).unwrap(),
        ];
        fs::create_dir(&third).unwrap();
        assert!(AtomicFile::commit_all(both).is_err());
        assert_eq!(names(folder.path()), ["a.txt", "b.txt", "c"]);

        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"never seen").unwrap();
        drop(remove_pending());
        assert_eq!(names(folder.path()), ["a.txt", "b.txt", "c"]);
        assert!(file.commit().is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "both");
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
