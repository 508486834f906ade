//! Inputs and outputs named on the command line.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use gpbrdf_core::{Environment, Source, materials};

/// Opens `input`: a file if there is one of that name, else a built-in material.
pub(crate) fn open(input: &Path) -> Result<Source> {
    if let Ok(metadata) = input.metadata()
        && !metadata.is_file()
        && !metadata.is_dir()
    {
        // Its kind is found before it is read: a pipe would be drained by then.
        bail!("\"{}\": expected a regular file, found a pipe or a device", input.display());
    }
    if input.exists() || input.is_symlink() {
        return Ok(Source::open(input)?);
    }
    if let Some(material) = materials().iter().find(|m| input.as_os_str() == m.name) {
        return Ok(Source::built_in(material.name)?);
    }
    bail!(
        "\"{}\": expected a file or a built-in material (`gpbrdf-cli materials` lists them), found neither",
        input.display()
    );
}

/// The environment of the image metrics: a file, or the built-in studio.
pub(crate) fn environment(path: Option<&Path>) -> Result<Environment> {
    Ok(match path {
        Some(path) => Environment::read(path)?,
        None => Environment::studio(),
    })
}

/// A folder for outputs, removed again if it was made here and stays empty.
#[derive(Debug)]
pub(crate) struct OutputFolder {
    path: PathBuf,
    created: Vec<PathBuf>,
}

impl OutputFolder {
    /// Refuses, before the work that leads up to it, a path that can be no folder.
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
        Ok(Self { path: path.to_owned(), created })
    }

    pub(crate) fn join(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        // Fails, as it should, for folders that hold something.
        self.created.iter().for_each(|p| drop(std::fs::remove_dir(p)));
    }
}
