//! `gpbrdf-cli fit`: fits a model and writes nothing else.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use gpbrdf_core::base::AtomicFile;

use super::input::open;
use super::reading::Reading;
use super::terminal::Terminal;
use crate::job::{Job, ModelSpec, Report, Run, Stage};

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli fit measured.csv -o material.safetensors",
    "\n  gpbrdf-cli fit red-plastic --lattice 24x16x12 --kernel matern52",
))]
pub(crate) struct Fit {
    /// A measurement or table file, the name of a built-in material, or - for measured samples from standard
    /// input.
    input: PathBuf,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    model: ModelSpec,
    /// Model file to write.
    #[arg(help_heading = "Output", short, long, value_name = "FILE", default_value = "model.safetensors")]
    output: PathBuf,
    /// Print the report as JSON on standard output, and nothing else there.
    #[arg(help_heading = "Output", long)]
    json: bool,
}

impl Fit {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let mut run = Run::new(terminal.clone());
        let source = run.stage(Stage::Load, || open(&self.input, self.reading, terminal))?;
        self.model.check(&source)?;
        // Created before the fit, so that nobody waits for a model that cannot be written.
        let mut file = AtomicFile::create(&self.output)?;
        let outcome = run.job(&Job::new(&source, &self.model))?;
        run.stage(Stage::Write, || {
            file.write_all(&outcome.fitted.model.to_bytes()?)
                .with_context(|| format!("cannot write \"{}\"", self.output.display()))?;
            Ok(file.commit()?)
        })?;
        let mut report = Report::new(&outcome, run.seconds());
        report.outputs.push(self.output.display().to_string());
        terminal.report(&report, self.json)
    }
}
