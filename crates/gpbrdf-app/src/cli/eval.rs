//! `gpbrdf-cli eval`: metrics of a prediction against a truth.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use gpbrdf_core::base::number::significant;
use gpbrdf_core::judge::SampleMetrics;
use gpbrdf_core::{Content, IntervalOf, Metrics, Model, SampleSet, Source, bake_mean, bake_sigma};
use serde::Serialize;
use serde_json::Value;

use super::input::{environment, open};
use super::json::to_json;
use super::reading::Reading;
use super::terminal::Terminal;
use crate::job::{judge, metric_lines};

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli eval model.safetensors satin_purple.bsdf",
    "\n  gpbrdf-cli eval out/table.binary measured.binary --json",
))]
pub(crate) struct Eval {
    /// Model, table or measurement to judge, or a built-in material.
    prediction: PathBuf,
    /// Truth: a table or measurement file, or a built-in material.
    truth: PathBuf,
    #[command(flatten)]
    reading: Reading,
    /// Environment map of the image metrics instead of the built-in one.
    #[arg(long, value_name = "FILE")]
    env: Option<PathBuf>,
    /// Print JSON on standard output, and nothing else there.
    #[arg(help_heading = "Output", long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Evaluation {
    prediction: String,
    truth: String,
    metrics: Value,
}

impl Eval {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        // The prediction can be evaluated anywhere, so it is no set of samples, which the options are for.
        let prediction = open(&self.prediction, Reading::default(), terminal)?;
        let truth = open(&self.truth, self.reading, terminal)?;
        let environment = environment(self.env.as_deref())?;
        if let (Content::Model(model), Content::Samples(samples)) = (&prediction.content, &truth.content) {
            return self.against_samples(terminal, &prediction, &truth, model, samples);
        }
        let truth_table = terminal.stage("Tabulating the truth", || truth.table())?;
        let metrics = if let Content::Model(model) = &prediction.content {
            let (mean, sigma) = terminal.stage("Baking", || (bake_mean(model), bake_sigma(model)));
            let sigma = sigma?;
            terminal.stage("Comparing", || judge(&truth_table, model, &mean, Some(&sigma), &environment))?
        } else {
            let predicted = terminal.stage("Tabulating", || prediction.table())?;
            terminal.stage("Comparing", || Metrics::new(&truth_table, &predicted, &environment, None))?
        };
        if self.json {
            let metrics = serde_json::to_value(&metrics)?;
            return self.print(terminal, &prediction, &truth, metrics);
        }
        terminal.summary(&format!("{} against {}", prediction.origin(), truth.origin()))?;
        terminal.summary(&metric_lines(&metrics).join("\n"))
    }

    /// A model against scattered measurements: errors and coverage at their directions.
    fn against_samples(
        &self,
        terminal: &Terminal,
        prediction: &Source,
        truth: &Source,
        model: &Model,
        samples: &SampleSet,
    ) -> Result<()> {
        let predicted =
            terminal.stage("Predicting", || model.predict(&samples.angles, IntervalOf::Observation))?;
        let metrics = SampleMetrics::new(&samples.values, &predicted)?;
        if self.json {
            return self.print(terminal, prediction, truth, serde_json::to_value(&metrics)?);
        }
        terminal.summary(&format!(
            "{} against {} samples of {}",
            prediction.origin(),
            metrics.samples,
            truth.origin()
        ))?;
        terminal.summary(&format!(
            "  median |ln error| {:.4}, rms ln error {:.4}, MAE {} /sr, MSE {} /sr^2",
            metrics.median_abs_log,
            metrics.log_rmse,
            significant(metrics.mae, 4),
            significant(metrics.mse, 4),
        ))?;
        terminal
            .summary(&format!("  95 % interval covers {:.1} % of the samples", 100.0 * metrics.coverage_95))
    }

    fn print(&self, terminal: &Terminal, prediction: &Source, truth: &Source, metrics: Value) -> Result<()> {
        let evaluation = Evaluation { prediction: prediction.origin(), truth: truth.origin(), metrics };
        terminal.print(&to_json(&evaluation)?)
    }
}
