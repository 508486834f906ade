//! `gpbrdf-cli eval`: metrics of a prediction against a truth.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use gpbrdf_core::base::number::significant;
use gpbrdf_core::{Content, IntervalOf, Metrics, Model, SampleSet, Source, bake_mean, bake_sigma};
use serde::Serialize;
use serde_json::Value;

use super::input::{environment, open};
use super::terminal::Terminal;
use crate::job::{judge, metric_lines};

#[derive(Args, Debug)]
pub(crate) struct Eval {
    /// Model, table or measurement to judge, or a built-in material.
    prediction: PathBuf,
    /// Truth: a table or measurement file, or a built-in material.
    truth: PathBuf,
    /// Environment map of the image metrics instead of the built-in one.
    #[arg(long, value_name = "FILE")]
    env: Option<PathBuf>,
    /// Print JSON on standard output, and nothing else there.
    #[arg(long)]
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
        let (prediction, truth) = (open(&self.prediction)?, open(&self.truth)?);
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
        model: &gpbrdf_core::Model,
        samples: &gpbrdf_core::Samples,
    ) -> Result<()> {
        let angles: Vec<_> = samples.samples.iter().map(gpbrdf_core::Sample::half_diff).collect();
        let predicted = terminal.stage("Predicting", || model.predict(&angles, IntervalOf::Observation));
        let (mut absolute, mut square, mut covered) = (0.0, 0.0, 0usize);
        let mut logs = Vec::with_capacity(3 * samples.samples.len());
        for (sample, p) in samples.samples.iter().zip(&predicted) {
            for c in 0..3 {
                let (f, g) = (sample.value[c], p.mean[c]);
                absolute += (f - g).abs();
                square += (f - g).powi(2);
                covered += usize::from(p.lower[c] <= f && f <= p.upper[c]);
                logs.push(((g + 1e-3).ln() - (f + 1e-3).ln()).abs());
            }
        }
        logs.sort_unstable_by(f64::total_cmp);
        let n = logs.len() as f64;
        let rmse = (logs.iter().map(|x| x * x).sum::<f64>() / n).sqrt();
        let metrics = serde_json::json!({
            "samples": samples.samples.len(),
            "mae": absolute / n,
            "mse": square / n,
            "log_rmse": rmse,
            "median_abs_log": logs[logs.len() / 2],
            "coverage_95": covered as f64 / n,
        });
        if self.json {
            return self.print(terminal, prediction, truth, metrics);
        }
        terminal.summary(&format!(
            "{} against {} samples of {}",
            prediction.origin(),
            angles.len(),
            truth.origin()
        ))?;
        terminal.summary(&format!(
            "  median |ln error| {:.4}, rms ln error {rmse:.4}, MAE {} /sr, MSE {} /sr^2\n  95 % interval covers {:.1} % of the samples",
            logs[logs.len() / 2],
            significant(absolute / n),
            significant(square / n),
            100.0 * covered as f64 / n
        ))
    }

    fn print(&self, terminal: &Terminal, prediction: &Source, truth: &Source, metrics: Value) -> Result<()> {
        let evaluation = Evaluation { prediction: prediction.origin(), truth: truth.origin(), metrics };
        terminal.print(&format!("{}\n", serde_json::to_string_pretty(&evaluation)?))
    }
}
