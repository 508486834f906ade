//! What a run has to say, for machines and for people.

use std::collections::BTreeMap;
use std::time::Instant;

use anyhow::Result;
use gpbrdf_core::{
    BrdfTable, FitReport, KernelBody, LatticeLayout, Metrics, Model, Process, Rgb, SigmaTable, interval_95,
};
use serde::Serialize;
use serde_json::{Value, json};

use super::terminal::Terminal;

/// `report.json`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Report {
    pub(crate) material: String,
    pub(crate) source: String,
    pub(crate) layout: String,
    pub(crate) lattice: Option<LatticeLayout>,
    /// Measurements taken, or cells of a table that was compressed.
    pub(crate) samples: usize,
    /// Numbers that the model stores: another size.
    pub(crate) floats: usize,
    pub(crate) solver: &'static str,
    pub(crate) kernel: String,
    pub(crate) transform: Value,
    pub(crate) hyperparameters: Value,
    pub(crate) log_marginal_likelihood: f64,
    pub(crate) evaluations: usize,
    pub(crate) converged: bool,
    pub(crate) at_bound: Vec<String>,
    pub(crate) seconds: Seconds,
    pub(crate) backend: String,
    pub(crate) metrics: Option<Metrics>,
    pub(crate) outputs: Vec<String>,
}

/// Stages of a run, in order.
const STAGES: [&str; 8] = ["load", "sample", "fit", "bake_mean", "bake_sigma", "metrics", "write", "total"];

/// Wall-clock seconds of each stage; 0 for those that did not run.
#[derive(Clone, Debug, Serialize)]
#[serde(transparent)]
pub(crate) struct Seconds(BTreeMap<&'static str, f64>);

impl Default for Seconds {
    fn default() -> Self {
        Self(STAGES.into_iter().map(|stage| (stage, 0.0)).collect())
    }
}

impl Seconds {
    /// Adds the time that `work` takes to `stage`.
    pub(crate) fn measure<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.add(stage, start);
        result
    }

    pub(crate) fn add(&mut self, stage: &'static str, start: Instant) {
        *self.0.entry(stage).or_default() += start.elapsed().as_secs_f64();
    }

    pub(crate) fn get(&self, stage: &str) -> f64 {
        self.0.get(stage).copied().unwrap_or(0.0)
    }
}

impl Report {
    pub(crate) fn new(model: &Model, fits: &[FitReport], seconds: Seconds, backend: String) -> Self {
        let provenance = &model.provenance;
        let (solver, kernel, hyper) = describe(model);
        Self {
            material: provenance.material.clone(),
            source: provenance.source.clone(),
            layout: provenance.layout.clone(),
            lattice: provenance.lattice.clone(),
            samples: model.samples(),
            floats: model.floats(),
            solver,
            kernel,
            transform: serde_json::to_value(model.transform).unwrap_or_default(),
            hyperparameters: hyper,
            log_marginal_likelihood: fits.iter().map(|f| f.log_marginal_likelihood).sum(),
            evaluations: fits.iter().map(|f| f.evaluations).sum(),
            converged: fits.iter().all(|f| f.converged),
            at_bound: fits.iter().flat_map(|f| f.at_bound.iter().cloned()).collect(),
            seconds,
            backend,
            metrics: None,
            outputs: Vec::new(),
        }
    }

    /// Prints the report: JSON, or a summary for people.
    pub(crate) fn show(&self, json: bool, terminal: &Terminal) -> Result<()> {
        if !self.converged {
            terminal.warn("the search for hyper-parameters did not converge");
        }
        if json {
            terminal.print(&format!("{}\n", serde_json::to_string_pretty(self)?))
        } else {
            terminal.summary(&self.summary())
        }
    }

    /// A few lines for people.
    pub(crate) fn summary(&self) -> String {
        let mut lines = vec![format!("{} from {}", self.material, self.source)];
        let grid = self.lattice.as_ref().map_or_else(String::new, |l| {
            let [a, b, c] = l.shape;
            format!(" ({a}x{b}x{c})")
        });
        let what = if self.layout == "table" { "cells" } else { "samples" };
        lines.push(format!(
            "  {} {}, {}{grid}, {} solver, kernel {}; {} floats stored",
            self.samples, what, self.layout, self.solver, self.kernel, self.floats
        ));
        let bound = if self.solver == "inducing" { "bound on the " } else { "" };
        lines.push(format!(
            "  {bound}log marginal likelihood {:.1} after {} evaluations{}",
            self.log_marginal_likelihood,
            self.evaluations,
            if self.converged { "" } else { ", NOT converged" }
        ));
        if !self.at_bound.is_empty() {
            lines.push(format!("  at a bound of its range: {}", self.at_bound.join(", ")));
        }
        if let Some(m) = &self.metrics {
            lines.extend(metric_lines(m));
        }
        if self.backend != "cpu" {
            lines.push(format!("  baked on {}", self.backend));
        }
        let run = STAGES.iter().filter(|stage| self.seconds.get(stage) > 0.0);
        let times: Vec<String> =
            run.map(|stage| format!("{stage} {:.0} ms", 1e3 * self.seconds.get(stage))).collect();
        lines.push(format!("  {}", times.join(", ")));
        for output in &self.outputs {
            lines.push(format!("  wrote {output}"));
        }
        lines.join("\n")
    }
}

/// The metrics that people look at first.
pub(crate) fn metric_lines(m: &Metrics) -> Vec<String> {
    let (cells, images) = (&m.cells, &m.images);
    let mut lines = vec![
        format!(
            "  sphere: PSNR {:.1} dB under the environment, {:.1} dB under a point light, SSIM {:.4}",
            images.psnr_env, images.psnr_point, images.ssim_env
        ),
        format!(
            "  cells: median |ln error| {:.4}, rms ln error {:.4}, MAE {} /sr, MSE {} /sr^2",
            cells.median_abs_log,
            cells.log_rmse,
            significant(cells.mae),
            significant(cells.mse)
        ),
    ];
    if let Some(coverage) = cells.coverage_95 {
        lines.push(format!("  95 % interval covers {:.1} % of the cells", 100.0 * coverage));
    }
    lines
}

/// The 95 % interval of a measurement in one cell of a baked table: lower and upper ends of each channel. `noise` is
/// [`Model::noise_variances`].
pub(crate) fn cell_interval(
    model: &Model,
    noise: Rgb,
    mean: &BrdfTable,
    sigma: &SigmaTable,
    cell: usize,
) -> (Rgb, Rgb) {
    let ends: [(f64, f64); 3] = std::array::from_fn(|c| {
        let latent = f64::from(sigma.value(cell, c));
        let mean = f64::from(mean.values()[cell][c]);
        interval_95(model.transform, mean, (latent * latent + noise[c]).sqrt())
    });
    (ends.map(|e| e.0), ends.map(|e| e.1))
}

/// Four significant digits.
pub(crate) fn significant(x: f64) -> String {
    if x != 0.0 && !(1e-3..1e5).contains(&x.abs()) {
        return format!("{x:.3e}");
    }
    let digits = if x == 0.0 { 0.0 } else { (3.0 - x.abs().log10().floor()).max(0.0) };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 6")]
    let digits = digits as usize;
    format!("{x:.digits$}")
}

/// Solver, kernel and hyper-parameters of a model.
pub(crate) fn describe(model: &Model) -> (&'static str, String, Value) {
    let (solver, mut all) = match &model.process {
        Process::Lattice(groups) => {
            let each = groups.iter().map(|gp| {
                let hyper = gp.hyper();
                let names = |k: &gpbrdf_core::Kernel1d| {
                    k.terms.iter().map(|t| t.shape.name()).collect::<Vec<_>>().join(" + ")
                };
                let single = hyper.kernels.iter().all(|k| k.terms.len() == 1);
                let lengths: Vec<Value> = hyper
                    .kernels
                    .iter()
                    .map(|k| match k.terms.as_slice() {
                        [term] if single => json!(term.length_scale),
                        terms => terms.iter().map(|t| t.length_scale).collect(),
                    })
                    .collect();
                let value = json!({
                    "length_scale": lengths,
                    "signal_variance": hyper.signal_variance,
                    "noise_variance": hyper.noise_variance,
                    "axes": hyper.kernels,
                });
                (format!("product of {} along u, v, phi", names(&hyper.kernels[0])), value)
            });
            ("lattice", each.collect::<Vec<_>>())
        }
        Process::Dense(groups) => {
            let each = groups.iter().map(|gp| {
                let lengths = gp.kernel().terms.iter().map(|term| match &term.body {
                    KernelBody::Ard { length_scale, .. } => json!(length_scale),
                    KernelBody::Product(axes) => json!(axes),
                });
                let mut lengths: Vec<Value> = lengths.collect();
                let value = json!({
                    "length_scale": if lengths.len() == 1 { lengths.remove(0) } else { Value::Array(lengths) },
                    "signal_variance": gp.kernel().prior_variance(),
                    "noise_variance": gp.noise_variance(),
                    "jitter": gp.jitter(),
                    "terms": gp.kernel(),
                });
                (gp.kernel().name(), value)
            });
            ("dense", each.collect())
        }
        Process::Inducing(gp) => {
            let each = gp.components.iter().map(|component| {
                let lattice = component.lattice();
                let lengths: Vec<Value> =
                    lattice.kernels.iter().map(|k| json!(k.terms.first().map(|t| t.length_scale))).collect();
                let value = json!({
                    "shape": lattice.shape,
                    "length_scale": lengths,
                    "signal_variance": lattice.signal_variance,
                    "noise_variance": lattice.noise_variance,
                    "space": lattice.space,
                });
                let name = lattice.kernels[0].terms.first().map_or("", |t| t.shape.name());
                (format!("product of {name} along u, v, phi"), value)
            });
            let all: Vec<(String, Value)> = each.collect();
            let kernel = all.first().map_or_else(String::new, |(name, _)| name.clone());
            let components: Vec<Value> = all.into_iter().map(|(_, value)| value).collect();
            return ("inducing", kernel, json!({ "mix": gp.mix, "components": components }));
        }
        _ => ("unknown", vec![(String::new(), Value::Null)]),
    };
    let kernel = all.first().map_or_else(String::new, |(name, _)| name.clone());
    let hyper = if all.len() == 1 {
        all.swap_remove(0).1
    } else {
        json!({ "channels": all.into_iter().map(|(_, value)| value).collect::<Vec<_>>() })
    };
    (solver, kernel, hyper)
}
