//! `gpbrdf-cli fit`: the model only.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;
use gpbrdf_core::AtomicFile;

use super::input::open;
use super::model_args::ModelArgs;
use super::report::{Report, Seconds};
use super::terminal::Terminal;

#[derive(Args, Debug)]
pub(crate) struct Fit {
    /// A measurement or table file, or the name of a built-in material.
    input: PathBuf,
    /// Model file to write.
    #[arg(short, long, value_name = "FILE", default_value = "model.safetensors")]
    output: PathBuf,
    #[command(flatten)]
    model: ModelArgs,
    /// Print the report as JSON on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
}

impl Fit {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let start = Instant::now();
        let mut seconds = Seconds::default();
        let source = seconds.measure("load", || terminal.stage("reading", || open(&self.input)))?;
        // Before the fit: a model that cannot be written is not worth the wait.
        let mut file = AtomicFile::create(&self.output)?;
        let (model, fits) = self.model.sample_and_fit(&source, &mut seconds, terminal)?;
        let mut report = Report::new(&model, &fits, seconds, "cpu".to_owned());
        report.outputs.push(self.output.display().to_string());
        let begin = Instant::now();
        file.write_all(&model.to_bytes()?)
            .with_context(|| format!("cannot write \"{}\"", self.output.display()))?;
        file.commit()?;
        report.seconds.add("write", begin);
        report.seconds.add("total", start);
        report.show(self.json, terminal)
    }
}
