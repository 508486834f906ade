//! The exact likelihood of few samples, and their exact leave-one-out predictions.

use rayon::prelude::*;

use super::conditional::{Basis, JITTER, Process};
use super::vecchia::Targets;
use crate::base::error::{Error, Result};
use crate::base::linalg::{factorize, half_log_det, product, solve, view_slice};
use crate::base::simd::{add_scaled, dot};
use crate::gp::dense::factor::{INVERSE_COLUMNS, assemble};
use crate::gp::dense::inverse::{inverse_blocks, inverse_columns, left_out_variances};
use crate::kernel::{AxisMetric, GradientScratch, Points};

/// The largest number of samples whose covariance is factorised as a whole in a search.
pub(super) const MOST_SAMPLES: usize = 512;

/// Samples and a matrix to work in, for many factorisations of their covariance at different hyper-parameters.
///
/// Memory: `16 n^2` bytes, and `1024 n` bytes per thread.
#[derive(Debug)]
pub(super) struct Exact {
    points: Points,
    /// `b(x_i)^T b(x_j)`, column-major; empty where there are no functions.
    gram: Vec<f64>,
    matrix: Vec<f64>,
}

impl Exact {
    /// Prepares the samples at `x`, rows of as many coordinates as there are metrics.
    pub(super) fn new(x: &[f64], metric: &[AxisMetric], basis: &Basis) -> Self {
        let points = Points::new(x, metric);
        let n = points.len();
        let gram = if basis.count > 0 {
            let rows = view_slice(&basis.rows, basis.count, n);
            let gram = product(rows.transpose(), rows);
            (0..n).flat_map(|j| (0..n).map(move |i| (i, j))).map(|at| gram[at]).collect()
        } else {
            Vec::new()
        };
        Self { points, gram, matrix: vec![0.0; n * n] }
    }

    /// The log marginal likelihood over all channels, and its derivatives with respect to the log-parameters of the
    /// process and, last, the logarithm of the noise variance that all samples share: with
    /// `G = sum_c a_c a_c^T - C K^-1`, weights `a_c = K^-1 y_c` and `C` channels, half the sum of `G` times the
    /// derivative of `K`. Source: C. E. Rasmussen and C. K. I. Williams, "Gaussian Processes for Machine Learning"
    /// (2006), eqs. 2.30 and 5.9. Cost: `n^3 / 2` multiply-adds.
    ///
    /// # Errors
    /// A covariance that is not positive definite.
    pub(super) fn log_likelihood(
        &mut self,
        process: &Process<'_>,
        targets: &Targets<'_>,
    ) -> Result<(f64, Vec<f64>)> {
        let (n, channels) = (self.points.len(), targets.y.len() as f64);
        let (of_kernel, parameters) = (process.kernel.n_parameters(), process.n_parameters());
        let weights = self.weights(process, targets.y)?;
        let square: f64 = targets.y.iter().zip(weights.chunks(n)).map(|(y, w)| dot(y, w)).sum();
        let log_det = 2.0 * half_log_det(&self.matrix, n);
        let value = -0.5 * (square + channels * (log_det + n as f64 * std::f64::consts::TAU.ln()));
        // The sum runs over the columns of the lower triangle, whose entries stand for two each but for the diagonal.
        let parts: Vec<Vec<f64>> = inverse_blocks(n)
            .map_init(
                || (GradientScratch::new(process.kernel.dimension()), vec![0.0; n * INVERSE_COLUMNS]),
                |(scratch, block), (first, width)| {
                    let rows = n - first;
                    let block = &mut block[..rows * width];
                    inverse_columns(&self.matrix, n, first, width, block);
                    let mut sums = vec![0.0; parameters + 1];
                    for (column, j) in block.chunks_mut(rows).zip(first..) {
                        let of_pairs = &mut column[j - first..];
                        of_pairs.iter_mut().for_each(|w| *w *= -channels);
                        for weights in weights.chunks(n) {
                            add_scaled(weights[j], &weights[j..], of_pairs);
                        }
                        of_pairs[0] *= 0.5;
                        process.kernel.add_row_gradient(&self.points, j..n, j, of_pairs, scratch, &mut sums);
                        if !self.gram.is_empty() {
                            let gram = &self.gram[j * n + j..(j + 1) * n];
                            sums[of_kernel] += process.basis_variance * dot(of_pairs, gram);
                        }
                        sums[parameters] += targets.shared_noise[j] * of_pairs[0];
                    }
                    sums
                },
            )
            .collect();
        // Summed in order, so that the number of threads changes nothing.
        let mut gradient = vec![0.0; parameters + 1];
        for part in parts {
            gradient.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
        Ok((value, gradient))
    }

    /// Every sample as it is predicted from all others: residuals `a_i / (K^-1)_ii`, rows with one value per channel,
    /// and variances `1 / (K^-1)_ii`, noise of the sample included (Rasmussen and Williams, eqs. 5.12). Cost: `n^3 / 3`
    /// multiply-adds.
    ///
    /// # Errors
    /// A covariance that is not positive definite.
    pub(super) fn leave_one_out(
        &mut self,
        process: &Process<'_>,
        y: &[Vec<f64>],
    ) -> Result<(Vec<f64>, Vec<f64>)> {
        let n = self.points.len();
        let weights = self.weights(process, y)?;
        let variances = left_out_variances(&self.matrix, n);
        let residuals = variances
            .iter()
            .enumerate()
            .flat_map(|(i, variance)| weights.chunks(n).map(move |w| w[i] * variance));
        Ok((residuals.collect(), variances))
    }

    /// `K^-1 y` of every channel, one after the other. The Cholesky factor of `K` stays in `self.matrix`.
    ///
    /// # Errors
    /// A covariance that is not positive definite.
    pub(super) fn weights(&mut self, process: &Process<'_>, y: &[Vec<f64>]) -> Result<Vec<f64>> {
        let n = self.points.len();
        assemble(process.kernel, &self.points, 0.0, &mut self.matrix);
        for (j, column) in self.matrix.chunks_mut(n).enumerate() {
            if !self.gram.is_empty() {
                add_scaled(process.basis_variance, &self.gram[j * n + j..(j + 1) * n], &mut column[j..]);
            }
            column[j] = process.diagonal(j);
        }
        if !factorize(&mut self.matrix, n) {
            return Err(Error::NotPositiveDefinite { size: n, largest_jitter: JITTER });
        }
        let mut weights = y.concat();
        solve(&self.matrix, n, &mut weights);
        Ok(weights)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::base::random::SplitMix64;
    use crate::kernel::{Kernel, Shape, test_kernels};

    /// More samples than columns of a task, and functions.
    const N: usize = INVERSE_COLUMNS + 9;
    const COUNT: usize = 4;
    /// Logarithms of the variances of the functions and of the noise.
    const OTHERS: [f64; 2] = [0.5, -3.5];

    /// Coordinates, targets, functions, and what makes the noise of each sample its own.
    struct Samples {
        x: Vec<f64>,
        y: Vec<Vec<f64>>,
        basis: Basis,
        weights: Vec<f64>,
        known: Vec<f64>,
    }

    impl Samples {
        fn new() -> Self {
            let mut random = SplitMix64::new(3);
            let mut numbers = |n: usize| (0..n).map(|_| random.next_unit()).collect::<Vec<f64>>();
            Self {
                x: numbers(3 * N),
                y: vec![numbers(N), numbers(N)],
                basis: Basis { count: COUNT, rows: numbers(N * COUNT) },
                weights: numbers(N).iter().map(|u| 0.5 + 0.5 * u).collect(),
                known: numbers(N).iter().map(|u| 0.01 * u).collect(),
            }
        }

        /// Calls `run` with the process at log-parameters of a kernel, a basis and a shared noise variance.
        fn at<R>(&self, kernel: &Kernel, others: [f64; 2], run: impl FnOnce(&Process<'_>, &[f64]) -> R) -> R {
            let [basis_variance, noise_variance] = others.map(f64::exp);
            let shared: Vec<f64> = self.weights.iter().map(|w| noise_variance / w).collect();
            let noise: Vec<f64> = shared.iter().zip(&self.known).map(|(a, b)| a + b).collect();
            run(&Process { kernel, x: &self.x, noise: &noise, basis: &self.basis, basis_variance }, &shared)
        }

        fn log_likelihood(&self, kernel: &Kernel, others: [f64; 2]) -> (f64, Vec<f64>) {
            self.at(kernel, others, |process, shared_noise| {
                let mut exact = Exact::new(&self.x, &kernel.metric, &self.basis);
                exact.log_likelihood(process, &Targets { y: &self.y, shared_noise }).unwrap()
            })
        }

        /// `k(x, x') + v b(x)^T b(x') + noise`, written out.
        fn covariance(&self, process: &Process<'_>) -> DMatrix<f64> {
            DMatrix::from_fn(N, N, |i, j| {
                let functions = |k| self.basis.row(i)[k] * self.basis.row(j)[k];
                let own = if i == j { process.noise[i] } else { 0.0 };
                let of_basis = process.basis_variance * (0..COUNT).map(functions).sum::<f64>();
                process.kernel.value(process.point(i), process.point(j)) + of_basis + own
            })
        }
    }

    #[test]
    fn the_likelihood_is_that_of_the_covariance_written_out() {
        let samples = Samples::new();
        for kernel in test_kernels() {
            let expected = samples.at(&kernel, OTHERS, |process, _| {
                let factor = samples.covariance(process).cholesky().unwrap();
                let log_det = 2.0 * factor.l().diagonal().map(f64::ln).sum();
                let of_channel = |y: &Vec<f64>| {
                    let y = DVector::from_column_slice(y);
                    y.dot(&factor.solve(&y)) + log_det + N as f64 * std::f64::consts::TAU.ln()
                };
                -0.5 * samples.y.iter().map(of_channel).sum::<f64>()
            });
            let (found, _) = samples.log_likelihood(&kernel, OTHERS);
            assert!(
                (found - expected).abs() < 1e-8 * expected.abs(),
                "{}: {found} {expected}",
                kernel.name()
            );
        }
    }

    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        const STEP: f64 = 1e-5;
        let samples = Samples::new();
        for kernel in test_kernels() {
            let (_, gradient) = samples.log_likelihood(&kernel, OTHERS);
            let start = kernel.log_parameters();
            assert_eq!(gradient.len(), start.len() + 2);
            for (k, found) in gradient.iter().enumerate() {
                let shifted = |by: f64| {
                    let (mut kernel, mut parameters, mut others) = (kernel.clone(), start.clone(), OTHERS);
                    match k.checked_sub(start.len()) {
                        None => parameters[k] += by,
                        Some(k) => others[k] += by,
                    }
                    kernel.set_log_parameters(&parameters).unwrap();
                    samples.log_likelihood(&kernel, others).0
                };
                let slope = (shifted(STEP) - shifted(-STEP)) / (2.0 * STEP);
                assert!((found - slope).abs() < 1e-4 * (1.0 + slope.abs()), "{k}: {found} {slope}");
            }
        }
    }

    #[test]
    fn samples_are_left_out_as_if_they_had_never_been_there() {
        let samples = Samples::new();
        let kernel = Kernel::ard(1.1, Shape::Matern52, &[0.7, 0.9, 1.3]);
        samples.at(&kernel, OTHERS, |process, _| {
            let mut exact = Exact::new(&samples.x, &kernel.metric, &samples.basis);
            let (residuals, variances) = exact.leave_one_out(process, &samples.y).unwrap();
            let whole = samples.covariance(process);
            for i in [0, 1, INVERSE_COLUMNS, N - 1] {
                let others = whole.clone().remove_row(i).remove_column(i).cholesky().unwrap();
                let to_others = whole.column(i).into_owned().remove_row(i);
                let b = others.solve(&to_others);
                let variance = whole[(i, i)] - b.dot(&to_others);
                assert!((variances[i] / variance - 1.0).abs() < 1e-8, "{i}: {} {variance}", variances[i]);
                for (c, y) in samples.y.iter().enumerate() {
                    let others = DVector::from_column_slice(y).remove_row(i);
                    let expected = y[i] - b.dot(&others);
                    let found = residuals[i * samples.y.len() + c];
                    assert!((found - expected).abs() < 1e-8, "{i}: {found} {expected}");
                }
            }
        });
    }

    #[test]
    fn a_covariance_that_is_not_positive_definite_is_refused() {
        let samples = Samples::new();
        let kernel = Kernel::ard(-1.0, Shape::Matern52, &[0.7, 0.9, 1.3]);
        samples.at(&kernel, OTHERS, |process, _| {
            let found = Exact::new(&samples.x, &kernel.metric, &samples.basis).weights(process, &samples.y);
            assert!(matches!(found, Err(Error::NotPositiveDefinite { size: N, .. })), "{found:?}");
        });
    }
}
