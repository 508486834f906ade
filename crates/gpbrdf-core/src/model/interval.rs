//! 95 % intervals of predictions, and of tables of mean and sigma.

use serde::{Deserialize, Serialize};

use crate::brdf::Rgb;
use crate::brdf::sigma::SigmaTable;
use crate::brdf::table::{BrdfTable, Trilinear};
use crate::sample::Transform;

/// Half width of a 95 % interval in standard deviations.
const Z_95: f64 = 1.959_963_984_540_054;

/// The quantity that an interval covers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IntervalOf {
    /// The value of a new measurement: latent variance plus noise variance.
    #[default]
    Observation,
    /// The noise-free function.
    Latent,
}

/// Both ends of the 95 % interval about the target `g`, transformed back to sr^-1: `f(g -+ 1.96 sd)`.
#[must_use]
pub(crate) fn interval_about(transform: Transform, g: f64, standard_deviation: f64) -> (f64, f64) {
    let half = Z_95 * standard_deviation;
    (transform.inverse(g - half), transform.inverse(g + half))
}

/// The 95 % intervals of new measurements, from a table of means, a table of sigma and the noise variances:
/// `f(g(mean) -+ 1.96 sqrt(sigma^2 + noise))`.
#[derive(Clone, Copy, Debug)]
pub struct Intervals<'a> {
    /// Predictive mean, sr^-1.
    pub mean: &'a BrdfTable,
    /// Standard deviation of the latent target.
    pub sigma: &'a SigmaTable,
    /// Noise variance of each channel, in squared target units.
    pub noise_variances: Rgb,
    /// The map from BRDF values to targets.
    pub transform: Transform,
}

impl Intervals<'_> {
    /// Lower and upper ends in one cell, for each channel, sr^-1.
    #[must_use]
    pub fn cell(&self, cell: usize) -> (Rgb, Rgb) {
        let mean = self.mean.values()[cell].map(f64::from);
        self.about(mean, std::array::from_fn(|c| f64::from(self.sigma.value(cell, c))))
    }

    /// Lower and upper ends at a lookup between cells, for each channel, sr^-1.
    #[must_use]
    pub fn at(&self, at: &Trilinear) -> (Rgb, Rgb) {
        self.about(self.mean.lookup(at).map(f64::from), self.sigma.lookup(at).map(f64::from))
    }

    fn about(&self, mean: Rgb, sigma: Rgb) -> (Rgb, Rgb) {
        measurement_interval(self.transform, self.noise_variances, mean, sigma)
    }
}

/// Both ends of the 95 % interval of a new measurement about a mean in sr^-1. `sigma` is the latent standard
/// deviation of each channel in target units.
pub(crate) fn measurement_interval(
    transform: Transform,
    noise_variances: Rgb,
    mean: Rgb,
    sigma: Rgb,
) -> (Rgb, Rgb) {
    let ends: [(f64, f64); 3] = std::array::from_fn(|c| {
        let standard_deviation = (sigma[c] * sigma[c] + noise_variances[c]).sqrt();
        interval_about(transform, transform.forward(mean[c]), standard_deviation)
    });
    (ends.map(|e| e.0), ends.map(|e| e.1))
}
