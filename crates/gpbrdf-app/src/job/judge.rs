//! Comparing what was baked with the truth.

use gpbrdf_core::judge::Interval;
use gpbrdf_core::{BrdfTable, Environment, Intervals, Metrics, Model, Result, SigmaTable};

/// The 95 % intervals of measurements, by the tables of a model.
pub(super) fn intervals<'a>(model: &Model, mean: &'a BrdfTable, sigma: &'a SigmaTable) -> Intervals<'a> {
    Intervals { mean, sigma, noise_variances: model.noise_variances(), transform: model.transform }
}

/// All metrics of a model's tables; with sigma, the coverage of the interval of a measurement too.
///
/// # Errors
/// If the truth has no data, or the prediction is not finite.
pub(crate) fn judge(
    truth: &BrdfTable,
    model: &Model,
    mean: &BrdfTable,
    sigma: Option<&SigmaTable>,
    environment: &Environment,
) -> Result<Metrics> {
    let intervals = sigma.map(|sigma| intervals(model, mean, sigma));
    let cell = intervals.as_ref().map(|intervals| |cell| intervals.cell(cell));
    Metrics::new(truth, mean, environment, cell.as_ref().map(|cell| cell as &Interval<'_>))
}
