//! Folders for outputs, which are removed again if they stay empty.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use anyhow::{Result, bail};

/// A folder for outputs, removed again if it was made here and stays empty.
#[derive(Debug)]
pub(crate) struct OutputFolder {
    path: PathBuf,
    created: Vec<PathBuf>,
}

/// Folders that were created and may still be empty.
static CREATED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn created_folders() -> MutexGuard<'static, Vec<PathBuf>> {
    CREATED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the folders that were created for outputs and hold none yet, for a handler of Ctrl-C. No folder
/// can be created while the result is held.
pub(crate) fn remove_empty_folders() -> MutexGuard<'static, Vec<PathBuf>> {
    let mut created = created_folders();
    // This fails, as it should, for folders that hold something.
    created.drain(..).for_each(|p| drop(std::fs::remove_dir(p)));
    created
}

impl OutputFolder {
    /// Refuses a path that cannot be a folder, before the work whose results it is to hold.
    pub(crate) fn check(path: &Path) -> Result<()> {
        match path.ancestors().find(|p| p.exists()) {
            Some(existing) if !existing.is_dir() => {
                bail!(
                    "cannot create folder \"{}\": expected a folder, found the file \"{}\"",
                    path.display(),
                    existing.display()
                )
            }
            _ => Ok(()),
        }
    }

    pub(crate) fn create(path: &Path) -> Result<Self> {
        let mut all = created_folders();
        let mut created: Vec<PathBuf> = path
            .ancestors()
            .take_while(|p| !p.as_os_str().is_empty() && !p.exists())
            .map(Path::to_owned)
            .collect();
        if let Err(source) = std::fs::create_dir_all(path) {
            created.iter().for_each(|p| drop(std::fs::remove_dir(p)));
            return Err(
                anyhow::Error::new(source).context(format!("cannot create folder \"{}\"", path.display()))
            );
        }
        created.retain(|p| p.exists());
        all.extend(created.iter().cloned());
        Ok(Self { path: path.to_owned(), created })
    }

    pub(crate) fn join(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        let mut all = created_folders();
        all.retain(|p| !self.created.contains(p));
        // This fails, as it should, for folders that hold something.
        self.created.iter().for_each(|p| drop(std::fs::remove_dir(p)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interruption_removes_folders_that_hold_nothing() {
        let base = tempfile::tempdir().unwrap();
        let (empty, full) = (base.path().join("a/b"), base.path().join("c"));
        let folders = [OutputFolder::create(&empty).unwrap(), OutputFolder::create(&full).unwrap()];
        std::fs::write(folders[1].join("kept"), "x").unwrap();
        drop(remove_empty_folders());
        assert!(!base.path().join("a").exists() && full.join("kept").is_file());
        drop(folders);
        assert!(full.join("kept").is_file());
    }
}
