//! What a run has to say, for machines and for people.

use gpbrdf_core::{KernelBody, LatticeLayout, Metrics, Model, Process};
use serde::Serialize;
use serde_json::{Value, json};

use super::backend::CPU;
use super::number::significant;
use super::run::Outcome;
use super::stage::Seconds;

/// `report.json`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Report {
    pub(crate) material: String,
    pub(crate) source: String,
    pub(crate) layout: String,
    pub(crate) lattice: Option<LatticeLayout>,
    /// Measurements that were taken, or cells of a table that was compressed.
    pub(crate) samples: usize,
    /// Numbers that the model stores.
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

impl Report {
    /// The report of a run that has led to this, so far.
    pub(crate) fn new(outcome: &Outcome, seconds: Seconds) -> Self {
        let (model, reports) = (&outcome.fitted.model, &outcome.fitted.reports);
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
            log_marginal_likelihood: outcome.fitted.log_marginal_likelihood.unwrap_or(f64::NAN),
            evaluations: reports.iter().map(|report| report.evaluations).sum(),
            converged: reports.iter().all(|report| report.converged),
            at_bound: reports.iter().flat_map(|report| report.at_bound.iter().cloned()).collect(),
            seconds,
            backend: outcome.baked.as_ref().map_or_else(|| CPU.to_owned(), |baked| baked.backend.clone()),
            metrics: outcome.metrics.clone(),
            outputs: Vec::new(),
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
        if self.backend != CPU {
            lines.push(format!("  baked on {}", self.backend));
        }
        lines.push(format!("  {}", self.seconds.summary()));
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
