//! The exact Gaussian process on a product lattice.
//!
//! A product kernel `s^2 k_u k_v k_phi` on `A x B x C` nodes has the covariance `s^2 K_u (x) K_v (x) K_phi`.
//! With `K_x = Q_x diag(lambda_x) Q_x^T` and `rho = noise / s^2`, every step for which the dense process
//! factorises an `n x n` matrix (`n = A B C`) becomes a contraction with three small matrices, which costs
//! `O(n (A + B + C))`; see Y. Saatci, "Scalable Inference for Structured Gaussian Process Models" (2011),
//! chapter 5.

mod data;
#[cfg(feature = "fit")]
pub(crate) mod fit;
#[cfg(feature = "fit")]
mod grams;
pub(crate) mod kronecker;
#[cfg(feature = "fit")]
mod likelihood;
pub(crate) mod posterior;
mod separable;
#[cfg(feature = "fit")]
pub(crate) mod solve;
pub(crate) mod table;

pub use data::LatticeData;
#[cfg(feature = "fit")]
pub use likelihood::LatticeLikelihood;
pub use separable::{AxisBasis, SeparableForm};

use std::sync::OnceLock;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::data::AxisEigen;
use self::kronecker::apply;
use crate::base::error::{Error, Result};
use crate::base::linalg::{Matrix, View, product, product_into, squared, view, view_slice};
use crate::kernel::Kernel1d;

/// Hyper-parameters of a lattice process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LatticeHyper {
    /// Signal variance `s^2`, in squared target units.
    pub signal_variance: f64,
    /// Noise variance, in squared target units.
    pub noise_variance: f64,
    /// The kernel of each axis.
    pub kernels: [Kernel1d; 3],
}

/// A lattice process conditioned on its targets.
#[derive(Clone, Debug)]
pub struct LatticeGp {
    data: LatticeData,
    hyper: LatticeHyper,
    /// The weights `(K + rho I)^-1 y`, laid out like the targets.
    weights: Vec<f64>,
    /// The eigendecomposition that variances need. A process that was loaded from a file computes it when the
    /// first variance is predicted.
    spectrum: OnceLock<Spectrum>,
    /// The weights in the eigenbasis, `(Q_u (x) Q_v (x) Q_phi)^T weights`, laid out like the weights.
    spectral_weights: OnceLock<Vec<f64>>,
}

/// The covariance in its eigenbasis.
#[derive(Clone, Debug)]
pub(crate) struct Spectrum {
    /// The eigendecomposition of the covariance along each axis.
    pub(crate) eigen: [AxisEigen; 3],
    /// `1 / (lambda_u lambda_v lambda_phi + rho)`, laid out like one channel.
    pub(crate) precision: Vec<f64>,
}

/// Computes [`Spectrum::precision`], with `ratio` for `rho`.
fn precision(eigen: &[AxisEigen; 3], ratio: f64) -> Vec<f64> {
    let mut out = Vec::with_capacity(eigen.iter().map(|e| e.values.len()).product());
    for &u in &eigen[0].values {
        for &v in &eigen[1].values {
            out.extend(eigen[2].values.iter().map(|&phi| 1.0 / (u * v * phi + ratio)));
        }
    }
    out
}

impl Spectrum {
    fn new(data: &LatticeData, hyper: &LatticeHyper) -> Result<Self> {
        let (eigen, _) = data.eigen(&hyper.kernels, false)?;
        let precision = precision(&eigen, hyper.noise_variance / hyper.signal_variance);
        Ok(Self { eigen, precision })
    }
}

impl LatticeGp {
    /// Conditions the process on `data` (paper eqs. 12 and 13). Takes `O(n (A + B + C))` time per channel.
    ///
    /// # Errors
    /// Data of the wrong size, data that are not finite, or hyper-parameters out of range.
    pub fn new(data: LatticeData, hyper: LatticeHyper) -> Result<Self> {
        data.validate()?;
        hyper.validate()?;
        let spectrum = Spectrum::new(&data, &hyper)?;
        let vectors = spectrum.eigen.each_ref().map(|e| view(&e.vectors));
        let mut z = apply(vectors.map(View::transpose), &data.targets, data.channels);
        for tensor in z.chunks_mut(spectrum.precision.len()) {
            tensor.iter_mut().zip(&spectrum.precision).for_each(|(z, d)| *z *= d);
        }
        let weights = apply(vectors, &z, data.channels);
        let (spectrum, spectral_weights) = (OnceLock::from(spectrum), OnceLock::from(z));
        Ok(Self { data, hyper, weights, spectrum, spectral_weights })
    }

    /// A process whose weights were read from a file or computed elsewhere. Predicted means use the weights
    /// as they are, and nothing is factorised before the first variance is predicted.
    ///
    /// # Errors
    /// Those of [`LatticeGp::new`], and a number of weights that differs from that of the targets.
    pub(crate) fn from_weights(data: LatticeData, hyper: LatticeHyper, weights: Vec<f64>) -> Result<Self> {
        data.validate()?;
        hyper.validate()?;
        if weights.len() != data.targets.len() {
            return Err(Error::argument("lattice weights", data.targets.len().to_string(), weights.len()));
        }
        Ok(Self { data, hyper, weights, spectrum: OnceLock::new(), spectral_weights: OnceLock::new() })
    }

    /// The eigendecomposition that variances need, computed when it is first needed in `O(A^3 + B^3 + C^3)`.
    pub(crate) fn spectrum(&self) -> Result<&Spectrum> {
        if let Some(spectrum) = self.spectrum.get() {
            return Ok(spectrum);
        }
        let made = Spectrum::new(&self.data, &self.hyper)?;
        Ok(self.spectrum.get_or_init(|| made))
    }

    /// The weights in the eigenbasis. A process that was loaded from a file computes them when they are first needed,
    /// in `O(n (A + B + C))` per channel.
    pub(crate) fn spectral_weights(&self) -> Result<&[f64]> {
        if let Some(known) = self.spectral_weights.get() {
            return Ok(known);
        }
        let transposed = self.spectrum()?.eigen.each_ref().map(|e| view(&e.vectors).transpose());
        let made = apply(transposed, &self.weights, self.data.channels);
        Ok(self.spectral_weights.get_or_init(|| made))
    }

    /// Coordinates and targets.
    #[must_use]
    pub fn data(&self) -> &LatticeData {
        &self.data
    }

    /// Hyper-parameters.
    #[must_use]
    pub fn hyper(&self) -> &LatticeHyper {
        &self.hyper
    }

    /// The weights `(K + rho I)^-1 y`, laid out like the targets: the predictive mean is `k(x, X) . weights`.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Kernel values between `points`, which are coordinates along axis `k`, and the nodes: `points x nodes`,
    /// stored column by column.
    #[must_use]
    pub(crate) fn cross(&self, k: usize, points: &[f64]) -> Matrix {
        let mut out = Matrix::zeros(points.len(), self.data.coordinates[k].len());
        let (kernel, metric) = (&self.hyper.kernels[k], self.data.metrics[k]);
        let (mut sums, mut values) = (vec![0.0; points.len()], vec![0.0; points.len()]);
        for (j, &node) in self.data.coordinates[k].iter().enumerate() {
            sums.fill(0.0);
            for other in std::iter::once(node).chain(self.data.image(k, node)) {
                values.iter_mut().zip(points).for_each(|(d, &x)| *d = metric.distance(x, other).powi(2));
                kernel.fill(&mut values);
                sums.iter_mut().zip(&values).for_each(|(sum, value)| *sum += value);
            }
            sums.iter().enumerate().for_each(|(i, sum)| out[(i, j)] = *sum);
        }
        out
    }

    /// Predictive mean (paper eq. 12) at points given by their three kernel coordinates: `[point][channel]`.
    /// Costs `O(n)` per point, in parallel.
    #[must_use]
    pub fn predict_mean(&self, points: &[[f64; 3]]) -> Vec<f64> {
        let channels = self.data.channels;
        let [a, b, c] = self.data.shape();
        points
            .par_chunks(64)
            .flat_map_iter(|points| {
                let [ku, kv, kp] = self.cross_rows(points);
                // For each channel, one matrix product contracts along u for all points of the block.
                let mut out = Vec::with_capacity(points.len() * channels);
                let mut contracted = Matrix::zeros(b * c, points.len());
                let mut sums = vec![0.0; points.len() * channels];
                for (ch, weights) in self.weights.chunks(a * b * c).enumerate() {
                    product_into(&mut contracted, view_slice(weights, b * c, a), view(&ku).transpose());
                    for p in 0..points.len() {
                        let mut sum = 0.0;
                        for j in 0..b {
                            let mut row = 0.0;
                            for k in 0..c {
                                row += contracted[(j * c + k, p)] * kp[(p, k)];
                            }
                            sum += row * kv[(p, j)];
                        }
                        sums[p * channels + ch] = sum;
                    }
                }
                out.append(&mut sums);
                out
            })
            .collect()
    }

    /// Latent predictive variance (paper eq. 13) at points given by their three kernel coordinates, the same
    /// for every channel: `s^2 (k(x, x) - sum D (k Q)^2)`. Costs `O(n)` per point, in parallel. For the
    /// variance of a new observation, add the noise variance.
    ///
    /// # Errors
    /// A covariance along an axis that has no eigendecomposition.
    pub fn predict_variance_latent(&self, points: &[[f64; 3]]) -> Result<Vec<f64>> {
        let [a, b, c] = self.data.shape();
        let spectrum = self.spectrum()?;
        let variances = points.par_chunks(64).flat_map_iter(|points| {
            let crosses = self.cross_rows(points);
            let [su, sv, sp]: [Matrix; 3] = std::array::from_fn(|k| {
                squared(&product(view(&crosses[k]), view(&spectrum.eigen[k].vectors)))
            });
            let precision = view_slice(&spectrum.precision, b * c, a);
            let contracted = product(precision, view(&su).transpose());
            (0..points.len())
                .map(|p| {
                    let mut explained = 0.0;
                    for j in 0..b {
                        let row: f64 = (0..c).map(|k| contracted[(j * c + k, p)] * sp[(p, k)]).sum();
                        explained += row * sv[(p, j)];
                    }
                    (self.hyper.signal_variance * (self.prior_variance(points[p]) - explained)).max(0.0)
                })
                .collect::<Vec<_>>()
        });
        Ok(variances.collect())
    }

    /// Prior variance `k(x, x)` without the signal variance, at kernel coordinates `x`.
    #[must_use]
    pub(crate) fn prior_variance(&self, x: [f64; 3]) -> f64 {
        (0..3).map(|k| self.axis_variance(k, x[k])).product()
    }

    /// Prior variance `k(x, x)` along axis `k` at its coordinate `x`.
    pub(crate) fn axis_variance(&self, k: usize, x: f64) -> f64 {
        self.data.axis_variance(k, &self.hyper.kernels[k], x)
    }

    /// Prior variance along axis `k`, without the signal variance, at each point.
    pub(crate) fn axis_variances(&self, k: usize, points: &[f64]) -> Vec<f64> {
        let (kernel, metric) = (&self.hyper.kernels[k], self.data.metrics[k]);
        let own = kernel.value(0.0);
        let squared = |&x: &f64| self.data.image(k, x).map(|image| metric.distance(x, image).powi(2));
        // Every point has an image or none has one.
        let mut images: Vec<f64> = points.iter().filter_map(squared).collect();
        kernel.fill(&mut images);
        images.resize(points.len(), 0.0);
        images.iter_mut().for_each(|variance| *variance += own);
        images
    }

    fn cross_rows(&self, points: &[[f64; 3]]) -> [Matrix; 3] {
        std::array::from_fn(|k| self.cross(k, &points.iter().map(|p| p[k]).collect::<Vec<_>>()))
    }

    /// Leave-one-out residuals `y_i - mean_-i(x_i)`, laid out like the targets: `w_i / [(K + rho I)^-1]_ii`
    /// (Rasmussen and Williams 2006, eq. 5.12). Costs `O(n (A + B + C))`.
    ///
    /// # Errors
    /// Those of [`LatticeGp::predict_variance_latent`].
    pub fn leave_one_out_residuals(&self) -> Result<Vec<f64>> {
        let Spectrum { eigen, precision } = self.spectrum()?;
        let squares = eigen.each_ref().map(|e| squared(&e.vectors));
        let diagonal = apply(squares.each_ref().map(view), precision, 1);
        let per_channel = self.weights.chunks(diagonal.len());
        Ok(per_channel.flat_map(|w| w.iter().zip(&diagonal).map(|(w, d)| w / d)).collect())
    }
}

impl LatticeHyper {
    /// Checks every value.
    ///
    /// # Errors
    /// A variance that is not positive and finite, or an invalid kernel.
    pub fn validate(&self) -> Result<()> {
        for (what, value) in
            [("signal variance", self.signal_variance), ("noise variance", self.noise_variance)]
        {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::argument(what, "a positive number", value));
            }
        }
        self.kernels.iter().try_for_each(Kernel1d::validate)
    }
}

#[cfg(test)]
mod tests;
