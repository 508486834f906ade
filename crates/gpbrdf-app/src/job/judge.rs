//! Comparing what was baked with the truth.

use anyhow::Result;
use gpbrdf_core::{BrdfTable, Environment, Interval, Metrics, Model, Rgb, SigmaTable, interval_95};

/// The 95 % interval of a measurement in one cell: its lower and upper end in each channel, sr^-1.
pub(super) fn cell_interval<'a>(
    model: &'a Model,
    mean: &'a BrdfTable,
    sigma: &'a SigmaTable,
) -> impl Fn(usize) -> (Rgb, Rgb) + Sync + 'a {
    let noise = model.noise_variances();
    move |cell| {
        let ends: [(f64, f64); 3] = std::array::from_fn(|c| {
            let latent = f64::from(sigma.value(cell, c));
            let mean = f64::from(mean.values()[cell][c]);
            interval_95(model.transform, mean, (latent * latent + noise[c]).sqrt())
        });
        (ends.map(|e| e.0), ends.map(|e| e.1))
    }
}

/// All metrics of a model's tables; with sigma, the coverage of the interval of a measurement too.
///
/// # Errors
/// A truth without data, or a prediction that is not finite.
pub(crate) fn judge(
    truth: &BrdfTable,
    model: &Model,
    mean: &BrdfTable,
    sigma: Option<&SigmaTable>,
    environment: &Environment,
) -> Result<Metrics> {
    let interval = sigma.map(|sigma| cell_interval(model, mean, sigma));
    let interval = interval.as_ref().map(|interval| interval as &Interval<'_>);
    Ok(Metrics::new(truth, mean, environment, interval)?)
}
