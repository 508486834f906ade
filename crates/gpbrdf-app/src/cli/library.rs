//! Libraries of materials that are named on the command line.

use std::path::PathBuf;

use anyhow::Result;
use gpbrdf_core::formats::{is_neural_csv, read_neural_csv};
use gpbrdf_core::{Brdf, Content, FitOptions, fit};

use super::input::open;
use super::reading::Reading;
use super::terminal::Terminal;

/// Hands the materials of files to `add`, one by one, without those whose names `leave` picks: first those of tables of
/// Neural BRDF weights, then all others, which are to replace weights of the same name. Scattered measurements are
/// fitted.
pub(super) fn read_materials(
    inputs: &[PathBuf],
    reading: Reading,
    leave: impl Fn(&str) -> bool,
    terminal: &Terminal,
    mut add: impl FnMut(&str, &dyn Brdf) -> Result<()>,
) -> Result<()> {
    let (weights, others): (Vec<_>, Vec<_>) = inputs.iter().partition(|path| is_neural_csv(path));
    for path in weights {
        let fits = terminal.stage("Loading", || anyhow::Ok(read_neural_csv(path)?))?;
        for (name, network) in fits.iter().filter(|(name, _)| !leave(name)) {
            add(name, network)?;
        }
    }
    for path in others {
        let source = terminal.stage("Loading", || open(path, reading, terminal))?;
        if leave(&source.name) {
            continue;
        }
        match &source.content {
            Content::Samples(samples) => {
                let fitted =
                    terminal.stage("Fitting", || anyhow::Ok(fit(samples, &FitOptions::default())?))?;
                add(&source.name, &fitted.model)?;
            }
            _ => add(&source.name, source.brdf()?)?,
        }
    }
    Ok(())
}
