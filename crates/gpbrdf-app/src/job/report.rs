//! What a run has to say, for machines and for people.

use gpbrdf_core::base::number::significant;
use gpbrdf_core::judge::LeftOut;
use gpbrdf_core::sample::SampleLayout;
use gpbrdf_core::{LatticeLayout, Metrics};
use serde::Serialize;
use serde_json::Value;

use super::backend::CPU;
use super::run::Outcome;
use super::stage::Seconds;

/// `report.json`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Report {
    pub(crate) material: String,
    pub(crate) source: String,
    pub(crate) layout: SampleLayout,
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
    /// Every sample as it is predicted from all others, and the suspected outliers.
    pub(crate) leave_one_out: Option<LeftOut>,
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
        Self {
            material: provenance.material.clone(),
            source: provenance.source.clone(),
            layout: provenance.layout,
            lattice: provenance.lattice.clone(),
            samples: model.n_samples(),
            floats: model.n_floats(),
            solver: model.solver(),
            kernel: model.kernel_name(),
            transform: serde_json::to_value(model.transform).unwrap_or_default(),
            hyperparameters: model.hyper_report(),
            log_marginal_likelihood: outcome.fitted.log_marginal_likelihood.unwrap_or(f64::NAN),
            evaluations: reports.iter().map(|report| report.evaluations).sum(),
            converged: reports.iter().all(|report| report.converged),
            at_bound: reports.iter().flat_map(|report| report.at_bound.iter().cloned()).collect(),
            leave_one_out: outcome.fitted.left_out.clone(),
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
        let (what, bound) = match self.layout {
            SampleLayout::Table => ("cells", "bound on the "),
            _ => ("samples", ""),
        };
        lines.push(format!(
            "  {} {}, {}{grid}, {} solver, kernel {}; {} floats stored",
            self.samples,
            what,
            self.layout.name(),
            self.solver,
            self.kernel,
            self.floats
        ));
        lines.push(format!(
            "  {bound}log marginal likelihood {:.1} after {} evaluations{}",
            self.log_marginal_likelihood,
            self.evaluations,
            if self.converged { "" } else { ", NOT converged" }
        ));
        if !self.at_bound.is_empty() {
            lines.push(format!("  at a bound of its range: {}", self.at_bound.join(", ")));
        }
        lines.extend(self.prior_line());
        if let Some(left_out) = &self.leave_one_out {
            lines.extend(left_out_lines(left_out));
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

impl Report {
    /// Which prior was used, and how much of the prediction it explains.
    fn prior_line(&self) -> Option<String> {
        let of = &self.hyperparameters;
        let (name, share) = (of.get("prior")?.as_str()?, of.get("share_of_prior")?.as_f64()?);
        let materials = of.get("prior_materials")?.as_u64()?;
        Some(format!(
            "  prior \"{name}\", learned from {materials} materials: {:.0} % of the variance of the prediction \
             (--prior none does without)",
            100.0 * share
        ))
    }
}

/// The largest number of outliers that a summary lists; the report in JSON has all of them.
const LISTED: usize = 10;

/// What a fit says about its own samples.
fn left_out_lines(left_out: &LeftOut) -> Vec<String> {
    let m = &left_out.metrics;
    let mut lines = vec![format!(
        "  left out one by one: median |ln error| {:.4}; 95 % interval covers {:.1} % of the samples",
        m.median_abs_log,
        100.0 * m.coverage_95
    )];
    let outliers = &left_out.outliers;
    if !outliers.is_empty() {
        lines.push(format!(
            "  {} suspected outlier{} given a larger noise (--outliers keep takes them like all others):",
            outliers.len(),
            if outliers.len() == 1 { " was" } else { "s were" }
        ));
        lines.extend(outliers.iter().take(LISTED).map(|outlier| {
            let list = |rgb: [f64; 3]| rgb.map(|v| significant(v, 4)).join(" ");
            let [lower, upper] = outlier.expected;
            format!(
                "    {}: {}, expected {} to {}",
                outlier.place(),
                list(outlier.value),
                list(lower),
                list(upper)
            )
        }));
        if outliers.len() > LISTED {
            lines.push(format!("    and {} more (--json lists all)", outliers.len() - LISTED));
        }
    }
    lines
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
            significant(cells.mae, 4),
            significant(cells.mse, 4)
        ),
    ];
    if let Some(coverage) = cells.coverage_95 {
        lines.push(format!("  95 % interval covers {:.1} % of the cells", 100.0 * coverage));
    }
    lines
}
