//! The dense exact Gaussian process: any points, any kernel.

pub(crate) mod cost;
pub(crate) mod factor;
pub(crate) mod fit;
pub(crate) mod posterior;

use std::f64::consts::TAU;
use std::sync::OnceLock;

use rayon::prelude::*;

use self::cost::dense_cost;
use crate::base::error::{Error, Result};
use crate::base::simd::{add_scaled, dot};
use crate::kernel::{Kernel, Points, RowScratch};

/// Test points a task predicts at a time.
const TEST_BLOCK: usize = 128;

/// A log marginal likelihood of the targets, summed over the channels.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseLikelihood {
    /// `ln p(y | x)` in nats; the paper's eq. 16.
    pub log_marginal_likelihood: f64,
    /// Its derivatives by the kernel's log-parameters ([`Kernel::log_parameters`]) and, last, by
    /// `ln noise_variance`; the paper's eq. 17. Empty where it was not asked for. The jitter counts as constant.
    pub gradient: Vec<f64>,
    /// Added to the diagonal to make the matrix positive definite, in the unit of the variances; 0 where none was
    /// needed.
    pub jitter: f64,
}

/// Samples with the working matrix of the likelihood, for many evaluations at changing hyper-parameters.
///
/// Memory: `8 n^2` bytes, and `1024 n` a thread for a gradient.
#[derive(Debug)]
pub struct DenseEvaluator {
    x: Vec<f64>,
    dimension: usize,
    /// Column-major, one column a channel.
    y: Vec<f64>,
    matrix: Vec<f64>,
}

impl DenseEvaluator {
    /// Takes `x`, `n` rows of `dimension` coordinates, and `y`, `n` rows of `channels` targets of zero mean.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for sizes that do not agree, no samples, or values that are not finite;
    /// [`Error::TooLarge`] where the matrix does not fit in memory.
    pub fn new(x: &[f64], dimension: usize, y: &[f64], channels: usize) -> Result<Self> {
        let y = check_samples(x, dimension, y, channels)?;
        let n = y.len() / channels;
        dense_cost(n, channels, 1).check()?;
        Ok(Self { x: x.to_vec(), dimension, y, matrix: vec![0.0; n * n] })
    }

    /// The lower triangle of `K + noise_variance I`, column-major, `n x n`; what stands above the diagonal means
    /// nothing.
    ///
    /// Cost: `n^2 / 2` kernel evaluations, in parallel.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for an invalid kernel or noise.
    pub fn covariance(&mut self, kernel: &Kernel, noise_variance: f64) -> Result<&[f64]> {
        check_kernel(kernel, self.dimension, noise_variance)?;
        let points = Points::new(&self.x, &kernel.metric);
        factor::assemble(kernel, &points, noise_variance, &mut self.matrix);
        Ok(&self.matrix)
    }

    /// The log marginal likelihood at the kernel's hyper-parameters, without gradient.
    ///
    /// Cost: `n^3 / 6` multiply-adds.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for an invalid kernel or noise, [`Error::NotPositiveDefinite`] where no jitter
    /// helps.
    pub fn evaluate(&mut self, kernel: &Kernel, noise_variance: f64) -> Result<DenseLikelihood> {
        self.factorized(kernel, noise_variance).map(|factorized| factorized.likelihood)
    }

    /// The log marginal likelihood and its gradient,
    /// `1/2 sum_c tr((alpha_c alpha_c^T - K^-1) dK/dp)` with `alpha_c = K^-1 y_c`.
    ///
    /// Neither the inverse nor the derivatives of the matrix are ever kept whole. Cost: `n^3 / 2` multiply-adds.
    ///
    /// # Errors
    /// As [`DenseEvaluator::evaluate`].
    pub fn evaluate_with_gradient(
        &mut self,
        kernel: &Kernel,
        noise_variance: f64,
    ) -> Result<DenseLikelihood> {
        let Factorized { mut likelihood, points, alpha } = self.factorized(kernel, noise_variance)?;
        let n = points.len();
        let channels = self.y.len() / n;
        // Column by column of the lower triangle; each pair off the diagonal stands for two, so the factor 1/2
        // applies to the diagonal only. The partial sums are added up in the order of the columns.
        let n_parameters = kernel.n_parameters();
        let (factor, dimension) = (&self.matrix, self.dimension);
        let partial: Vec<Vec<f64>> = factor::inverse_blocks(n)
            .map_init(
                || (RowScratch::new(dimension), vec![0.0; n * factor::INVERSE_COLUMNS]),
                |(scratch, block), (first, width)| {
                    let rows = n - first;
                    let block = &mut block[..rows * width];
                    factor::inverse_columns(factor, n, first, width, block);
                    let mut sums = vec![0.0; n_parameters + 1];
                    for (column, j) in block.chunks_mut(rows).zip(first..) {
                        let weights = &mut column[j - first..];
                        weights.iter_mut().for_each(|w| *w *= -(channels as f64));
                        for alpha in alpha.chunks(n) {
                            add_scaled(alpha[j], &alpha[j..], weights);
                        }
                        weights[0] *= 0.5;
                        sums[n_parameters] += noise_variance * weights[0];
                        kernel.add_row_gradient(&points, j..n, j, weights, scratch, &mut sums);
                    }
                    sums
                },
            )
            .collect();
        likelihood.gradient = vec![0.0; n_parameters + 1];
        for sums in partial {
            likelihood.gradient.iter_mut().zip(sums).for_each(|(g, s)| *g += s);
        }
        Ok(likelihood)
    }

    /// Leaves the Cholesky factor in `self.matrix`.
    fn factorized(&mut self, kernel: &Kernel, noise_variance: f64) -> Result<Factorized> {
        check_kernel(kernel, self.dimension, noise_variance)?;
        let points = Points::new(&self.x, &kernel.metric);
        let jitter = factor::assemble_and_factorize(kernel, &points, noise_variance, &mut self.matrix)?;
        let mut alpha = self.y.clone();
        factor::solve(&self.matrix, points.len(), &mut alpha);
        let log_marginal_likelihood = log_marginal_likelihood(&self.y, &alpha, &self.matrix, points.len());
        let likelihood = DenseLikelihood { log_marginal_likelihood, gradient: Vec::new(), jitter };
        Ok(Factorized { likelihood, points, alpha })
    }
}

/// What stands beside the Cholesky factor once it is made.
struct Factorized {
    likelihood: DenseLikelihood,
    points: Points,
    /// `K^-1 y`, column-major.
    alpha: Vec<f64>,
}

/// What the samples say about each other.
#[derive(Clone, Debug, PartialEq)]
pub struct LeaveOneOut {
    /// `y_i - mu_i`, the target less its mean predicted from all other samples; `n` rows of one value a channel.
    pub residuals: Vec<f64>,
    /// Variance of that prediction, noise included; one a sample, shared by the channels.
    pub variances: Vec<f64>,
    /// `sum_i ln p(y_i | all others)` in nats, over samples and channels.
    pub log_predictive_density: f64,
}

/// A Gaussian process conditioned on samples. Channels share kernel and noise; targets have zero mean.
///
/// Memory: `8 n^2` bytes for the Cholesky factor.
#[derive(Clone, Debug)]
pub struct DenseGp {
    kernel: Kernel,
    noise_variance: f64,
    jitter: f64,
    /// The inputs, row-major, as they were given.
    inputs: Vec<f64>,
    points: Points,
    channels: usize,
    /// Column-major, one column a channel; so is `alpha = K^-1 y`.
    y: Vec<f64>,
    alpha: Vec<f64>,
    /// The Cholesky factor, or `None` where no jitter helps; a process that was loaded makes it when it is first needed.
    factor: OnceLock<Option<Vec<f64>>>,
}

impl DenseGp {
    /// Conditions on `x`, `n` rows of [`Kernel::dimension`] coordinates, and `y`, `n` rows of `channels` targets, at
    /// the given hyper-parameters.
    ///
    /// `K + noise_variance I = L L^T`, `alpha = K^-1 y`; where the matrix is not positive definite in floating
    /// point, the smallest jitter of 1e-12, 1e-11, ... 1e-6 times the mean of its diagonal that helps is added
    /// ([`DenseGp::jitter`]). Cost: `n^3 / 6` multiply-adds.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for sizes that do not agree, no samples, values that are not finite, or an invalid
    /// kernel or noise; [`Error::TooLarge`]; [`Error::NotPositiveDefinite`].
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
        dense_cost(n, channels, 0).check()?;
        let points = Points::new(x, &kernel.metric);
        let mut matrix = vec![0.0; n * n];
        let jitter = factor::assemble_and_factorize(&kernel, &points, noise_variance, &mut matrix)?;
        let mut alpha = y.clone();
        factor::solve(&matrix, n, &mut alpha);
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

    /// A process whose weights and jitter are known already, from a file: predictions of the mean use the weights as they
    /// are, and nothing is factorised before the first variance.
    ///
    /// # Errors
    /// As [`DenseGp::fit_at`], save those of the factorisation; weights of the wrong number.
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

    /// The Cholesky factor, made when it is first needed. `n^3 / 6` multiply-adds, `8 n^2` bytes.
    fn factor(&self) -> Result<&[f64]> {
        let n = self.points.len();
        if self.factor.get().is_none() {
            dense_cost(n, self.channels, 0).check()?;
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

    /// Targets: `n` rows of one value a channel.
    #[must_use]
    pub fn targets(&self) -> Vec<f64> {
        row_major(&self.y, self.channels)
    }

    /// `K^-1 y`: `n` rows of one value a channel.
    #[must_use]
    pub fn weights(&self) -> Vec<f64> {
        row_major(&self.alpha, self.channels)
    }

    /// The kernel, at the hyper-parameters of the fit.
    #[must_use]
    pub fn kernel(&self) -> &Kernel {
        &self.kernel
    }

    /// Variance of the noise of one target.
    #[must_use]
    pub fn noise_variance(&self) -> f64 {
        self.noise_variance
    }

    /// What was added to the diagonal beside the noise; 0 where nothing was needed.
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
    /// A process from a file whose covariance cannot be factorised.
    pub fn log_marginal_likelihood(&self) -> Result<f64> {
        Ok(log_marginal_likelihood(&self.y, &self.alpha, self.factor()?, self.points.len()))
    }

    /// Posterior mean at `x`, `m` rows of coordinates: `m` rows of one value a channel.
    ///
    /// `sum_i k(x, x_i) alpha_i`; the paper's eq. 12. Cost: `n` kernel evaluations a point.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for incomplete rows or values that are not finite.
    pub fn predict_mean(&self, x: &[f64]) -> Result<Vec<f64>> {
        check_points(x, self.kernel.dimension())?;
        Ok(self.mean_at(x))
    }

    /// [`DenseGp::predict_mean`] at whole rows; values that are not finite give NaN.
    pub(crate) fn mean_at(&self, x: &[f64]) -> Vec<f64> {
        let test = Points::new(x, &self.kernel.metric);
        let n = self.points.len();
        let mut out = vec![0.0; test.len() * self.channels];
        out.par_chunks_mut(TEST_BLOCK * self.channels).enumerate().for_each_init(
            || (RowScratch::new(self.kernel.dimension()), vec![0.0; n]),
            |(scratch, row), (block, out)| {
                for (out, j) in out.chunks_mut(self.channels).zip(block * TEST_BLOCK..) {
                    self.kernel.row(&self.points, 0..n, &test, j, scratch, row);
                    for (out, alpha) in out.iter_mut().zip(self.alpha.chunks(n)) {
                        *out = dot(row, alpha);
                    }
                }
            },
        );
        out
    }

    /// Posterior variance of the noise-free function at `x`, `m` rows of coordinates: one value a row, the same for
    /// every channel.
    ///
    /// `k(x, x) - |L^-1 k(X, x)|^2`, at least 0; the paper's eq. 13. Cost: `n^2 / 2` multiply-adds a point.
    ///
    /// # Errors
    /// As [`DenseGp::predict_mean`].
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
                factor::solve_lower(factor, n, rows);
                for (out, row) in out.iter_mut().zip(rows.chunks(n)) {
                    *out = (prior - dot(row, row)).max(0.0);
                }
            },
        );
        Ok(out)
    }

    /// Posterior variance of a new measurement at `x`: [`DenseGp::predict_variance_latent`] plus the noise.
    ///
    /// # Errors
    /// As [`DenseGp::predict_mean`].
    pub fn predict_variance_observed(&self, x: &[f64]) -> Result<Vec<f64>> {
        let mut variance = self.predict_variance_latent(x)?;
        variance.iter_mut().for_each(|v| *v += self.noise_variance);
        Ok(variance)
    }

    /// Every sample predicted from all others, without refitting.
    ///
    /// `sigma_i^2 = 1 / [K^-1]_ii`, `mu_i = y_i - alpha_i sigma_i^2`. Source: C. E. Rasmussen and C. K. I. Williams,
    /// "Gaussian Processes for Machine Learning" (2006), eqs. 5.10 to 5.12. Cost: `n^3 / 6` multiply-adds.
    ///
    /// # Errors
    /// A process from a file whose covariance cannot be factorised.
    pub fn leave_one_out(&self) -> Result<LeaveOneOut> {
        let n = self.points.len();
        let factor = self.factor()?;
        // [K^-1]_ii is the squared norm of column i of L^-1.
        let variances: Vec<Vec<f64>> = factor::inverse_blocks(n)
            .map_init(
                || vec![0.0; n * factor::INVERSE_COLUMNS],
                |block, (first, width)| {
                    let block = &mut block[..(n - first) * width];
                    factor::inverse_factor_columns(factor, n, first, width, block);
                    block.chunks(n - first).map(|column| dot(column, column).recip()).collect()
                },
            )
            .collect();
        let variances = variances.concat();
        let mut residuals = vec![0.0; n * self.channels];
        let mut log_predictive_density = 0.0;
        for (c, alpha) in self.alpha.chunks(n).enumerate() {
            for (i, (alpha, variance)) in alpha.iter().zip(&variances).enumerate() {
                let residual = alpha * variance;
                residuals[i * self.channels + c] = residual;
                log_predictive_density -= 0.5 * ((TAU * variance).ln() + residual * residual / variance);
            }
        }
        Ok(LeaveOneOut { residuals, variances, log_predictive_density })
    }
}

/// `sum_c (-1/2 y_c^T alpha_c - 1/2 ln det K - n/2 ln 2 pi)`.
fn log_marginal_likelihood(y: &[f64], alpha: &[f64], matrix: &[f64], n: usize) -> f64 {
    let channels = (y.len() / n) as f64;
    -0.5 * dot(y, alpha) - channels * (factor::half_log_det(matrix, n) + 0.5 * n as f64 * TAU.ln())
}

/// The targets, column-major, of samples whose sizes agree.
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

/// Rows of `channels` values as one column a channel.
fn column_major(rows: &[f64], channels: usize) -> Vec<f64> {
    (0..channels).flat_map(|c| rows.iter().skip(c).step_by(channels).copied()).collect()
}

/// The inverse of [`column_major`].
fn row_major(columns: &[f64], channels: usize) -> Vec<f64> {
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
