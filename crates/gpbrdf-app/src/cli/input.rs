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
    let near = near_name(&input.to_string_lossy())
        .map_or_else(String::new, |name| format!("; did you mean the built-in material {name}?"));
    bail!(
        "\"{}\": expected a file or a built-in material (`gpbrdf-cli materials` lists them), found neither{near}",
        input.display()
    );
}

/// The built-in material whose name is most like this one, if any is much like it.
pub(crate) fn near_name(name: &str) -> Option<&'static str> {
    const ALIKE: f64 = 0.8;
    let wanted = name.to_lowercase().replace(['_', ' '], "-");
    let alike =
        materials().iter().map(|material| (strsim::jaro_winkler(&wanted, material.name), material.name));
    let nearest = alike.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (nearest.0 >= ALIKE).then_some(nearest.1)
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

#[cfg(test)]
mod tests {
    use super::near_name;

    #[test]
    fn a_mistyped_name_is_found_and_a_file_is_not() {
        for (typed, meant) in [
            ("cherry", Some("cherry-235")),
            ("red_plastic", Some("red-plastic")),
            ("Blue Ruber", Some("blue-rubber")),
            ("cook-torance", Some("cook-torrance")),
            ("measured/2026-03.csv", None),
            ("", None),
        ] {
            assert_eq!(near_name(typed), meant, "{typed}");
        }
    }
}
