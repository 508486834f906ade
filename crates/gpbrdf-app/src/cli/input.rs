//! Inputs named on the command line.

use std::io::Read;
use std::path::Path;

use anyhow::{Context, Result, bail};
use gpbrdf_core::brdf::materials;
use gpbrdf_core::formats::{ReadOptions, read_environment};
use gpbrdf_core::{Environment, Source};

use super::reading::Reading;
use super::terminal::Terminal;
use crate::job::Observer;

/// What `-` is called in messages and in what is made of it.
pub(crate) const STANDARD_INPUT: &str = "standard input";

/// The largest standard input that is read.
const LIMIT_BYTES: u64 = 1 << 30;

/// Opens the file of this name, or else the built-in material; `-` is standard input. Says what the user should
/// know about how it was read.
pub(crate) fn open(input: &Path, reading: Reading, terminal: &Terminal) -> Result<Source> {
    let source = open_quietly(input, reading)?;
    source.notices().iter().for_each(|notice| terminal.note(&format!("{}: {notice}", source.origin())));
    Ok(source)
}

/// Like [`open`], for commands that show what there is to say themselves.
pub(crate) fn open_quietly(input: &Path, reading: Reading) -> Result<Source> {
    if is_standard_input(input) {
        return Ok(Source::parse(&standard_input()?, STANDARD_INPUT, &reading.options())?);
    }
    if let Ok(metadata) = input.metadata()
        && !metadata.is_file()
        && !metadata.is_dir()
    {
        // A pipe without a writer is waited for without end.
        bail!(
            "\"{}\": expected a regular file, or - for standard input, found a pipe or a device",
            input.display()
        );
    }
    if input.exists() || input.is_symlink() {
        return Ok(Source::open_with(input, &reading.options())?);
    }
    if let Some(material) = materials().iter().find(|m| input.as_os_str() == m.name) {
        if reading.options() != ReadOptions::default() {
            bail!(
                "{}: expected a file of measured samples for --values, --angles and --zenith",
                material.name
            );
        }
        return Ok(Source::built_in(material.name)?);
    }
    bail!(
        "\"{}\": expected a file or a built-in material (`gpbrdf-cli materials` lists them), found neither",
        input.display()
    );
}

/// Whether a name stands for standard input.
pub(crate) fn is_standard_input(input: &Path) -> bool {
    input.as_os_str() == "-"
}

/// The whole of standard input.
pub(crate) fn standard_input() -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let input = std::io::stdin().lock();
    input.take(LIMIT_BYTES + 1).read_to_end(&mut bytes).context("cannot read standard input")?;
    if bytes.len() as u64 > LIMIT_BYTES {
        bail!("standard input: expected at most {LIMIT_BYTES} bytes, found more");
    }
    Ok(bytes)
}

/// The environment of the image metrics: a file, or the built-in studio.
pub(crate) fn environment(path: Option<&Path>) -> Result<Environment> {
    Ok(match path {
        Some(path) => read_environment(path)?,
        None => Environment::studio(),
    })
}
