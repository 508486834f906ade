//! The exact Gaussian process with a dense covariance matrix, for any points and any kernel.

pub(crate) mod cost;
pub(crate) mod factor;
#[cfg(feature = "fit")]
pub(crate) mod fit;
#[cfg(feature = "fit")]
pub(crate) mod inverse;
#[cfg(feature = "fit")]
mod leave_one_out;
#[cfg(feature = "fit")]
mod likelihood;
pub(crate) mod posterior;
#[cfg(feature = "fit")]
pub(crate) mod solve;

#[cfg(feature = "fit")]
pub use leave_one_out::LeaveOneOut;
#[cfg(feature = "fit")]
pub use likelihood::{DenseEvaluator, DenseLikelihood};

use std::f64::consts::TAU;
use std::sync::OnceLock;

use rayon::prelude::*;

use self::cost::check_memory;
use crate::base::error::{Error, Result};
use crate::base::linalg::{half_log_det, solve, solve_lower};
use crate::base::simd::dot;
use crate::kernel::{Kernel, Points, RowScratch};

/// Number of test points that one parallel task predicts.
const TEST_BLOCK: usize = 128;

/// A Gaussian process conditioned on samples. The channels share kernel and noise variance; their targets
/// have zero mean.
///
/// Memory: `8 n^2` bytes for the Cholesky factor.
#[derive(Clone, Debug)]
pub struct DenseGp {
    kernel: Kernel,
    noise_variance: f64,
    jitter: f64,
    /// The coordinates of the samples, row-major, as they were given.
    inputs: Vec<f64>,
    points: Points,
    channels: usize,
    /// The targets, column-major with one column per channel. The weights `alpha = K^-1 y` have the same
    /// layout.
    y: Vec<f64>,
    alpha: Vec<f64>,
    /// The Cholesky factor, or `None` where no jitter makes the covariance positive definite. A process that
    /// was loaded from a file computes it when it is first needed.
    factor: OnceLock<Option<Vec<f64>>>,
}

impl DenseGp {
    /// Conditions the process on samples at the given hyper-parameters. `x` has `n` rows of
    /// [`Kernel::dimension`] coordinates, and `y` has `n` rows of `channels` targets.
    ///
    /// The covariance is `K = k(X, X) + noise_variance I = L L^T`, and the weights are `alpha = K^-1 y`.
    /// Where `K` is not positive definite in floating point, a jitter is added to its diagonal: the smallest
    /// of 1e-12, 1e-11, ... 1e-6 times the mean of the diagonal that helps ([`DenseGp::jitter`]). Cost:
    /// `n^3 / 6` multiply-adds.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for sizes that do not agree, no samples, values that are not finite, or an
    /// invalid kernel or noise variance; [`Error::TooLarge`] where the covariance does not fit in memory;
    /// [`Error::NotPositiveDefinite`] where no jitter helps.
    pub fn fit_at(
        x: &[f64],
        y: &[f64],
        channels: usize,
        kernel: Kernel,
        noise_variance: f64,
    ) -> Result<Self> {
        check_kernel(&kernel, kernel.dimension(), noise_variance)?;
        let y = check_samples(x, kernel.dimension(), y, channels)?;
        let n = y.len() / channels;
        check_memory(n, channels, 0)?;
        let points = Points::new(x, &kernel.metric);
        let mut matrix = vec![0.0; n * n];
        let jitter = factor::assemble_and_factorize(&kernel, &points, noise_variance, &mut matrix)?;
        let mut alpha = y.clone();
        solve(&matrix, n, &mut alpha);
        Ok(Self {
            kernel,
            noise_variance,
            jitter,
            inputs: x.to_vec(),
            points,
            channels,
            y,
            alpha,
            factor: OnceLock::from(Some(matrix)),
        })
    }

    /// A process whose weights and jitter were read from a file. Predicted means use the weights as they are,
    /// and nothing is factorised before the first variance is predicted.
    ///
    /// # Errors
    /// Those of [`DenseGp::fit_at`] except for the ones of the factorisation, and a number of weights that
    /// differs from that of the targets.
    pub(crate) fn from_weights(
        x: &[f64],
        y: &[f64],
        weights: &[f64],
        channels: usize,
        kernel: Kernel,
        noise_variance: f64,
        jitter: f64,
    ) -> Result<Self> {
        check_kernel(&kernel, kernel.dimension(), noise_variance)?;
        let y = check_samples(x, kernel.dimension(), y, channels)?;
        if weights.len() != y.len() {
            return Err(Error::argument("number of weights", y.len().to_string(), weights.len()));
        }
        let points = Points::new(x, &kernel.metric);
        let alpha = column_major(weights, channels);
        let factor = OnceLock::new();
        Ok(Self { kernel, noise_variance, jitter, inputs: x.to_vec(), points, channels, y, alpha, factor })
    }

    /// The Cholesky factor, computed when it is first needed. Cost: `n^3 / 6` multiply-adds and `8 n^2`
    /// bytes.
    fn factor(&self) -> Result<&[f64]> {
        let n = self.points.len();
        if self.factor.get().is_none() {
            check_memory(n, self.channels, 0)?;
        }
        let factor = self.factor.get_or_init(|| {
            let mut matrix = vec![0.0; n * n];
            let noise = self.noise_variance;
            factor::assemble_and_factorize(&self.kernel, &self.points, noise, &mut matrix).ok()?;
            Some(matrix)
        });
        factor
            .as_deref()
            .ok_or(Error::NotPositiveDefinite { size: n, largest_jitter: factor::LARGEST_JITTER })
    }

    /// Number of channels.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Coordinates of the samples, `n` rows.
    #[must_use]
    pub fn inputs(&self) -> &[f64] {
        &self.inputs
    }

    /// The targets, `n` rows with one value per channel.
    #[must_use]
    pub fn targets(&self) -> Vec<f64> {
        row_major(&self.y, self.channels)
    }

    /// The weights `K^-1 y`, `n` rows with one value per channel.
    #[must_use]
    pub fn weights(&self) -> Vec<f64> {
        row_major(&self.alpha, self.channels)
    }

    /// The kernel, at the hyper-parameters of the fit.
    #[must_use]
    pub fn kernel(&self) -> &Kernel {
        &self.kernel
    }

    /// Noise variance, in squared target units.
    #[must_use]
    pub fn noise_variance(&self) -> f64 {
        self.noise_variance
    }

    /// The number that was added to the diagonal in addition to the noise variance; 0 where none was needed.
    #[must_use]
    pub fn jitter(&self) -> f64 {
        self.jitter
    }

    /// The number of samples.
    #[must_use]
    pub fn n_samples(&self) -> usize {
        self.points.len()
    }

    /// The log marginal likelihood, summed over the channels; the paper's eq. 16.
    ///
    /// # Errors
    /// A process that was loaded from a file and whose covariance cannot be factorised or does not fit in
    /// memory.
    pub fn log_marginal_likelihood(&self) -> Result<f64> {
        Ok(log_marginal_likelihood(&self.y, &self.alpha, self.factor()?, self.points.len()))
    }

    /// Posterior mean at `x`, which has `m` rows of coordinates. The result has `m` rows with one value per
    /// channel.
    ///
    /// Formula: `sum_i k(x, x_i) alpha_i`; the paper's eq. 12. Cost: `n` kernel evaluations per point.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for incomplete rows or values that are not finite.
    pub fn predict_mean(&self, x: &[f64]) -> Result<Vec<f64>> {
        check_points(x, self.kernel.dimension())?;
        Ok(self.mean_at(x))
    }

    /// [`DenseGp::predict_mean`] without its checks: `x` must hold whole rows, and coordinates that are not
    /// finite give NaN.
    pub(crate) fn mean_at(&self, x: &[f64]) -> Vec<f64> {
        self.kernel.weighted_sums(&self.points, &self.alpha, &Points::new(x, &self.kernel.metric))
    }

    /// Posterior variance of the noise-free function at `x`, which has `m` rows of coordinates. The result
    /// has one value per row, which all channels share.
    ///
    /// Formula: `k(x, x) - |L^-1 k(X, x)|^2`, at least 0; the paper's eq. 13. Cost: `n^2 / 2` multiply-adds
    /// per point.
    ///
    /// # Errors
    /// Those of [`DenseGp::predict_mean`] and of [`DenseGp::log_marginal_likelihood`].
    pub fn predict_variance_latent(&self, x: &[f64]) -> Result<Vec<f64>> {
        check_points(x, self.kernel.dimension())?;
        let factor = self.factor()?;
        let test = Points::new(x, &self.kernel.metric);
        let n = self.points.len();
        let prior = self.kernel.prior_variance();
        let mut out = vec![0.0; test.len()];
        out.par_chunks_mut(TEST_BLOCK).enumerate().for_each_init(
            || (RowScratch::new(self.kernel.dimension()), vec![0.0; n * TEST_BLOCK]),
            |(scratch, rows), (block, out)| {
                let rows = &mut rows[..n * out.len()];
                for (row, j) in rows.chunks_mut(n).zip(block * TEST_BLOCK..) {
                    self.kernel.row(&self.points, 0..n, &test, j, scratch, row);
                }
                solve_lower(factor, n, rows);
                for (out, row) in out.iter_mut().zip(rows.chunks(n)) {
                    *out = (prior - dot(row, row)).max(0.0);
                }
            },
        );
        Ok(out)
    }

    /// Posterior variance of a new measurement at `x`: [`DenseGp::predict_variance_latent`] plus the noise
    /// variance.
    ///
    /// # Errors
    /// Those of [`DenseGp::predict_variance_latent`].
    pub fn predict_variance_observed(&self, x: &[f64]) -> Result<Vec<f64>> {
        let mut variance = self.predict_variance_latent(x)?;
        variance.iter_mut().for_each(|v| *v += self.noise_variance);
        Ok(variance)
    }
}

/// `sum_c (-1/2 y_c^T alpha_c - 1/2 ln det K - n/2 ln 2 pi)`.
fn log_marginal_likelihood(y: &[f64], alpha: &[f64], matrix: &[f64], n: usize) -> f64 {
    let channels = (y.len() / n) as f64;
    -0.5 * dot(y, alpha) - channels * (half_log_det(matrix, n) + 0.5 * n as f64 * TAU.ln())
}

/// Checks the samples and returns their targets column-major.
fn check_samples(x: &[f64], dimension: usize, y: &[f64], channels: usize) -> Result<Vec<f64>> {
    check_points(x, dimension)?;
    let n = x.len() / dimension;
    if n == 0 || channels == 0 {
        return Err(Error::argument(
            "samples",
            "at least one, of at least one channel",
            format!("{n} of {channels}"),
        ));
    }
    if n.checked_mul(channels) != Some(y.len()) {
        let expected = format!("{n} samples times {channels} channels");
        return Err(Error::argument("number of targets", expected, y.len()));
    }
    if let Some(value) = y.iter().find(|y| !y.is_finite()) {
        return Err(Error::argument("target", "a finite number", value));
    }
    Ok(column_major(y, channels))
}

/// Turns rows of `channels` values into one column per channel.
fn column_major(rows: &[f64], channels: usize) -> Vec<f64> {
    (0..channels).flat_map(|c| rows.iter().skip(c).step_by(channels).copied()).collect()
}

/// The inverse of [`column_major`].
pub(crate) fn row_major(columns: &[f64], channels: usize) -> Vec<f64> {
    column_major(columns, columns.len() / channels)
}

fn check_points(x: &[f64], dimension: usize) -> Result<()> {
    if dimension == 0 || !x.len().is_multiple_of(dimension) {
        let expected = format!("a multiple of the dimension {dimension}");
        return Err(Error::argument("number of coordinates", expected, x.len()));
    }
    match x.iter().find(|x| !x.is_finite()) {
        Some(value) => Err(Error::argument("coordinate", "a finite number", value)),
        None => Ok(()),
    }
}

fn check_kernel(kernel: &Kernel, dimension: usize, noise_variance: f64) -> Result<()> {
    kernel.validate()?;
    if kernel.dimension() != dimension {
        return Err(Error::argument("dimension of the kernel", dimension.to_string(), kernel.dimension()));
    }
    if !(noise_variance >= 0.0 && noise_variance.is_finite()) {
        return Err(Error::argument("noise variance", "a number of at least 0", noise_variance));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
