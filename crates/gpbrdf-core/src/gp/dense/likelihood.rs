//! The log marginal likelihood of the dense process and its gradient.

use rayon::prelude::*;

use super::cost::check_memory;
use super::factor::{INVERSE_COLUMNS, assemble, assemble_and_factorize};
use super::inverse::{inverse_blocks, inverse_columns};
use super::{check_kernel, check_samples, log_marginal_likelihood};
use crate::base::error::Result;
use crate::base::linalg::solve;
use crate::base::simd::add_scaled;
use crate::kernel::{GradientScratch, Kernel, Points};

/// A log marginal likelihood of the targets, summed over the channels.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseLikelihood {
    /// `ln p(y | x)` in nats; the paper's eq. 16.
    pub log_marginal_likelihood: f64,
    /// Its derivatives with respect to the kernel's log-parameters ([`Kernel::log_parameters`]) and, last, to
    /// `ln noise_variance`; the paper's eq. 17. Empty where only the value was computed. The jitter is
    /// treated as a constant.
    pub gradient: Vec<f64>,
    /// The jitter that was added to the diagonal to make the matrix positive definite, in the unit of the
    /// variances; 0 where none was needed.
    pub jitter: f64,
}

/// Samples and a matrix to work in, for many evaluations of the likelihood at different hyper-parameters.
///
/// Memory: `8 n^2` bytes, and for a gradient `1024 n` bytes per thread.
#[derive(Debug)]
pub struct DenseEvaluator {
    x: Vec<f64>,
    dimension: usize,
    /// The targets, column-major with one column per channel.
    y: Vec<f64>,
    matrix: Vec<f64>,
}

impl DenseEvaluator {
    /// Prepares evaluations for samples: `x` has `n` rows of `dimension` coordinates, and `y` has `n` rows of
    /// `channels` targets of zero mean.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`](crate::Error::InvalidArgument) for sizes that do not agree, no samples, or
    /// values that are not finite; [`Error::TooLarge`](crate::Error::TooLarge) where the matrix does not fit
    /// in memory.
    pub fn new(x: &[f64], dimension: usize, y: &[f64], channels: usize) -> Result<Self> {
        let y = check_samples(x, dimension, y, channels)?;
        let n = y.len() / channels;
        check_memory(n, channels, 1)?;
        Ok(Self { x: x.to_vec(), dimension, y, matrix: vec![0.0; n * n] })
    }

    /// The lower triangle of `K + noise_variance I`, column-major, `n x n`. Entries above the diagonal have
    /// no meaning.
    ///
    /// Cost: `n^2 / 2` kernel evaluations, in parallel.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`](crate::Error::InvalidArgument) for an invalid kernel or noise.
    pub fn covariance(&mut self, kernel: &Kernel, noise_variance: f64) -> Result<&[f64]> {
        check_kernel(kernel, self.dimension, noise_variance)?;
        let points = Points::new(&self.x, &kernel.metric);
        assemble(kernel, &points, noise_variance, &mut self.matrix);
        Ok(&self.matrix)
    }

    /// Evaluates the log marginal likelihood at the kernel's hyper-parameters, without its gradient.
    ///
    /// Cost: `n^3 / 6` multiply-adds.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`](crate::Error::InvalidArgument) for an invalid kernel or noise,
    /// [`Error::NotPositiveDefinite`](crate::Error::NotPositiveDefinite) where no jitter helps.
    pub fn evaluate(&mut self, kernel: &Kernel, noise_variance: f64) -> Result<DenseLikelihood> {
        self.factorized(kernel, noise_variance).map(|factorized| factorized.likelihood)
    }

    /// Evaluates the log marginal likelihood and its gradient,
    /// `1/2 sum_c tr((alpha_c alpha_c^T - K^-1) dK/dp)` with `alpha_c = K^-1 y_c`.
    ///
    /// Neither the inverse nor the derivatives of the matrix are ever stored as a whole. Cost: `n^3 / 2`
    /// multiply-adds.
    ///
    /// # Errors
    /// Those of [`DenseEvaluator::evaluate`].
    pub fn evaluate_with_gradient(
        &mut self,
        kernel: &Kernel,
        noise_variance: f64,
    ) -> Result<DenseLikelihood> {
        let Factorized { mut likelihood, points, alpha } = self.factorized(kernel, noise_variance)?;
        let n = points.len();
        let channels = self.y.len() / n;
        // The sum runs over the columns of the lower triangle. Each entry off the diagonal stands for two, so
        // the factor 1/2 applies to the diagonal only. Partial sums are added in the order of the columns, so
        // the result does not depend on the number of threads.
        let n_parameters = kernel.n_parameters();
        let (factor, dimension) = (&self.matrix, self.dimension);
        let partial: Vec<Vec<f64>> = inverse_blocks(n)
            .map_init(
                || (GradientScratch::new(dimension), vec![0.0; n * INVERSE_COLUMNS]),
                |(scratch, block), (first, width)| {
                    let rows = n - first;
                    let block = &mut block[..rows * width];
                    inverse_columns(factor, n, first, width, block);
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

    /// Evaluates the likelihood without its gradient, and leaves the Cholesky factor in `self.matrix`.
    fn factorized(&mut self, kernel: &Kernel, noise_variance: f64) -> Result<Factorized> {
        check_kernel(kernel, self.dimension, noise_variance)?;
        let points = Points::new(&self.x, &kernel.metric);
        let jitter = assemble_and_factorize(kernel, &points, noise_variance, &mut self.matrix)?;
        let mut alpha = self.y.clone();
        solve(&self.matrix, points.len(), &mut alpha);
        let log_marginal_likelihood = log_marginal_likelihood(&self.y, &alpha, &self.matrix, points.len());
        let likelihood = DenseLikelihood { log_marginal_likelihood, gradient: Vec::new(), jitter };
        Ok(Factorized { likelihood, points, alpha })
    }
}

/// The results of a factorisation besides the Cholesky factor itself.
struct Factorized {
    likelihood: DenseLikelihood,
    points: Points,
    /// `K^-1 y`, column-major.
    alpha: Vec<f64>,
}
