//! A forecast of the memory and the time of a dense fit.

use std::sync::OnceLock;
use std::time::Instant;

use super::factor::INVERSE_COLUMNS;
use crate::base::error::Result;
use crate::base::linalg::factorize;
use crate::gp::cost::{FitCost, available_bytes};

/// Memory and time of one fit to `samples` samples with `channels` channels after `gradient_evaluations`
/// evaluations of the log marginal likelihood and its gradient.
///
/// Conditioning takes `n^3 / 6` multiply-adds and `8 n^2` bytes; each evaluation with its gradient takes
/// `n^3 / 2` multiply-adds.
#[must_use]
pub fn dense_cost(samples: usize, channels: usize, gradient_evaluations: usize) -> FitCost {
    let n = samples as f64;
    let evaluations = gradient_evaluations as f64;
    let cubic = n.powi(3) * (1.0 / 6.0 + 0.5 * evaluations) / multiply_adds_per_second();
    // Assembly, contractions and solves take a few hundred instructions per pair of samples.
    let square = n * n * (20e-9 + 1e-9 * channels as f64) * (1.0 + evaluations);
    FitCost { solver: "dense", samples, bytes: bytes(samples), seconds: cubic + square }
}

/// Memory of one fit to `samples` samples, in bytes.
fn bytes(samples: usize) -> f64 {
    let n = samples as f64;
    8.0 * n * (n + (rayon::current_num_threads() * INVERSE_COLUMNS) as f64)
}

/// Refuses a fit that needs more memory than is available, as [`FitCost::check`] does. The speed of the
/// machine, which the error message needs, is measured only in that case.
pub(super) fn check_memory(samples: usize, channels: usize, gradient_evaluations: usize) -> Result<()> {
    if bytes(samples) <= available_bytes() {
        return Ok(());
    }
    dense_cost(samples, channels, gradient_evaluations).check()
}

/// Speed of the Cholesky factorisation on this machine, measured with a matrix of 1024 rows. The first call
/// takes some twenty milliseconds; later calls return the same figure.
fn multiply_adds_per_second() -> f64 {
    static SPEED: OnceLock<f64> = OnceLock::new();
    *SPEED.get_or_init(|| {
        const N: usize = 1024;
        let entry = |at: usize| if at.is_multiple_of(N + 1) { 2.0 } else { 1.0 / (N as f64) };
        let matrix: Vec<f64> = (0..N * N).map(entry).collect();
        let time = |_| {
            let mut work = matrix.clone();
            let start = Instant::now();
            factorize(&mut work, N);
            start.elapsed().as_secs_f64()
        };
        let seconds = (0..3).map(time).fold(f64::INFINITY, f64::min);
        (N as f64).powi(3) / 6.0 / seconds.max(1e-6)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_quadratic_and_time_cubic() {
        let cost = dense_cost(4096, 3, 0);
        assert!(cost.bytes >= 8.0 * 4096.0 * 4096.0);
        let ratio = dense_cost(1_000_000, 3, 0).bytes / dense_cost(500_000, 3, 0).bytes;
        assert!((ratio - 4.0).abs() < 0.1, "{ratio}");
        assert!(cost.seconds > 0.01 && cost.seconds < 600.0, "{}", cost.seconds);
        let ratio = dense_cost(100_000, 3, 1).seconds / dense_cost(50_000, 3, 1).seconds;
        assert!(ratio > 6.0 && ratio <= 8.0, "{ratio}");
    }
}
