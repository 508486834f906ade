//! Inputs named on the command line.

use std::path::Path;

use anyhow::{Result, bail};
use gpbrdf_core::brdf::materials;
use gpbrdf_core::formats::read_environment;
use gpbrdf_core::{Environment, Source};

/// Opens the file of this name, or else the built-in material.
pub(crate) fn open(input: &Path) -> Result<Source> {
    if let Ok(metadata) = input.metadata()
        && !metadata.is_file()
        && !metadata.is_dir()
    {
        // A file is opened once to recognise its kind and once more to read it, which drains a pipe too
        // early.
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
        Some(path) => read_environment(path)?,
        None => Environment::studio(),
    })
}
