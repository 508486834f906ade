//! The exact likelihood of few samples, and their exact leave-one-out predictions.

use super::conditional::Process;
use super::vecchia::Targets;
use crate::base::error::{Error, Result};
use crate::base::linalg::{factorize, half_log_det, solve};
use rayon::prelude::*;

/// The largest number of samples whose covariance is factorised as a whole in a search.
pub(super) const MOST_SAMPLES: usize = 512;

/// Number of rows of a parallel task.
const BLOCK: usize = 16;

/// The log marginal likelihood over all channels, and its derivatives with respect to the log-parameters of the process
/// and, last, the logarithm of the noise variance that all samples share: with `G = sum_c a_c a_c^T - C K^-1`, weights
/// `a_c = K^-1 y_c` and `C` channels, half the sum of `G` times the derivative of `K`. Source: C. E. Rasmussen and
/// C. K. I. Williams, "Gaussian Processes for Machine Learning" (2006), eqs. 2.30 and 5.9. Cost: `O(n^3)`.
///
/// # Errors
/// A covariance that is not positive definite.
pub(super) fn log_likelihood(process: &Process<'_>, targets: &Targets<'_>) -> Result<(f64, Vec<f64>)> {
    let n = process.noise.len();
    let channels = targets.y.len();
    let parameters = process.n_parameters();
    let factor = factor(process)?;
    let y = targets.y.concat();
    let mut weights = y.clone();
    solve(&factor, n, &mut weights);
    let square: f64 = y.iter().zip(&weights).map(|(y, w)| y * w).sum();
    let log_det = 2.0 * half_log_det(&factor, n);
    let value = -0.5 * (square + channels as f64 * (log_det + n as f64 * std::f64::consts::TAU.ln()));
    let inverse = inverse(&factor, n);
    let of = |i: usize, j: usize| {
        let outer: f64 = weights.chunks(n).map(|w| w[i] * w[j]).sum();
        outer - channels as f64 * inverse[i * n + j]
    };
    let blocks: Vec<usize> = (0..n).step_by(BLOCK).collect();
    let parts: Vec<Vec<f64>> = blocks
        .into_par_iter()
        .map(|first| {
            let mut sum = vec![0.0; parameters + 1];
            let mut derivatives = vec![0.0; parameters];
            for i in first..n.min(first + BLOCK) {
                for j in 0..=i {
                    process.gradient(i, j, &mut derivatives);
                    let weight = if i == j { 0.5 } else { 1.0 } * of(i, j);
                    sum.iter_mut().zip(&derivatives).for_each(|(sum, d)| *sum += weight * d);
                }
                sum[parameters] += 0.5 * of(i, i) * targets.shared_noise[i];
            }
            sum
        })
        .collect();
    let mut gradient = vec![0.0; parameters + 1];
    for part in parts {
        gradient.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
    }
    Ok((value, gradient))
}

/// Every sample as it is predicted from all others: residuals `a_i / (K^-1)_ii`, rows with one value per channel, and
/// variances `1 / (K^-1)_ii`, noise of the sample included (Rasmussen and Williams, eqs. 5.12).
///
/// # Errors
/// A covariance that is not positive definite.
pub(super) fn leave_one_out(process: &Process<'_>, y: &[Vec<f64>]) -> Result<(Vec<f64>, Vec<f64>)> {
    let n = process.noise.len();
    let factor = factor(process)?;
    let mut weights = y.concat();
    solve(&factor, n, &mut weights);
    let inverse = inverse(&factor, n);
    let variances: Vec<f64> = (0..n).map(|i| inverse[i * n + i].recip()).collect();
    let residuals =
        (0..n).flat_map(|i| weights.chunks(n).map(move |w| (i, w))).map(|(i, w)| w[i] * variances[i]);
    Ok((residuals.collect(), variances))
}

/// `K^-1 y` of every channel, one after the other.
///
/// # Errors
/// A covariance that is not positive definite.
pub(super) fn weights(process: &Process<'_>, y: &[Vec<f64>]) -> Result<Vec<f64>> {
    let mut weights = y.concat();
    solve(&factor(process)?, process.noise.len(), &mut weights);
    Ok(weights)
}

/// The Cholesky factor of the covariance of all measurements.
fn factor(process: &Process<'_>) -> Result<Vec<f64>> {
    let n = process.noise.len();
    let mut matrix = vec![0.0; n * n];
    matrix.par_chunks_mut(n.max(1)).enumerate().for_each(|(j, column)| {
        for (i, value) in column.iter_mut().enumerate().skip(j) {
            *value = if i == j { process.diagonal(i) } else { process.covariance(i, j) };
        }
    });
    if factorize(&mut matrix, n) {
        Ok(matrix)
    } else {
        Err(Error::NotPositiveDefinite { size: n, largest_jitter: super::conditional::JITTER })
    }
}

fn inverse(factor: &[f64], n: usize) -> Vec<f64> {
    let mut inverse = vec![0.0; n * n];
    inverse.iter_mut().step_by(n + 1).for_each(|diagonal| *diagonal = 1.0);
    solve(factor, n, &mut inverse);
    inverse
}
