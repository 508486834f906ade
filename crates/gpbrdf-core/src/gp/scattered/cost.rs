//! A forecast of the memory and the time of a fit to scattered samples.

use std::sync::OnceLock;
use std::time::Instant;

use super::conditional::Basis;
use super::product::Covariance;
use crate::base::watch::Watch;
use crate::gp::cost::FitCost;
use crate::kernel::{Kernel, Points, Shape};

/// Time of conditioning in products with three columns; the products that it takes have nine.
const PRODUCTS: f64 = 23.0;

/// Time of everything that grows in proportion to the number of samples, relative to that of a kernel value: the
/// search, whose likelihood has a fixed number of terms for many samples, leave-one-out predictions, the
/// preconditioner.
const PER_SAMPLE: f64 = 9e4;

/// Memory of a sample: 200 inducing points twice, 48 neighbours, nine columns and their partial sums.
const BYTES: f64 = 8.0 * (2.0 * 200.0 + 1.5 * 48.0 + 9.0 * (5.0 + 16.0));

/// Time of the search itself, relative to that of a kernel value.
const SEARCH: f64 = 6e8;

/// Evaluations of the likelihood that a search usually takes, both spaces and all renewed weights together.
pub(crate) const EVALUATIONS: usize = 110;

/// The share of the time of a fit that its search takes.
pub(super) fn search_share(samples: usize) -> f64 {
    let n = samples as f64;
    let search = SEARCH * (n / 1000.0).min(1.0) + 0.5 * PER_SAMPLE * n;
    search / (search + 0.5 * PER_SAMPLE * n + PRODUCTS * 0.5 * n * n)
}

/// Memory and time of one fit to `samples` scattered samples. The time is usually right to within a factor of 1.5;
/// without noise more products are needed.
#[must_use]
pub fn scattered_cost(samples: usize) -> FitCost {
    let n = samples as f64;
    let values = PRODUCTS * 0.5 * n * n + PER_SAMPLE * n + SEARCH * (n / 1000.0).min(1.0);
    FitCost { solver: "scattered", samples, bytes: BYTES * n, seconds: values * seconds_per_value() }
}

/// Wall-clock time of one value of a Matern 5/2 kernel in a product with a covariance, measured with 2,048
/// samples. The first call takes some ten milliseconds; later calls return the same figure.
fn seconds_per_value() -> f64 {
    static SPEED: OnceLock<f64> = OnceLock::new();
    *SPEED.get_or_init(|| {
        const N: usize = 2048;
        let kernel = Kernel::ard(1.0, Shape::Matern52, &[0.3; 3]);
        let x: Vec<f64> = (0..3 * N).map(|i| (0.618_033_988_749_895 * i as f64).fract()).collect();
        let (points, diagonal) = (Points::new(&x, &kernel.metric), vec![0.1; N]);
        let basis = Basis::default();
        let covariance = Covariance {
            kernel: &kernel,
            points: &points,
            diagonal: &diagonal,
            basis: &basis,
            basis_variance: 0.0,
        };
        let (y, mut out) = (vec![1.0; 3 * N], vec![0.0; 3 * N]);
        let time = |_| {
            let start = Instant::now();
            // Without an observer, nothing ends this early.
            let _ = covariance.apply(&y, &mut out, &Watch::default());
            start.elapsed().as_secs_f64()
        };
        let seconds = (0..3).map(time).fold(f64::INFINITY, f64::min);
        seconds.max(1e-7) / (0.5 * (N * N) as f64)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_forecast_grows_with_the_square_in_the_end() {
        let ratio = scattered_cost(2_000_000).seconds / scattered_cost(1_000_000).seconds;
        assert!((3.5..=4.0).contains(&ratio), "{ratio}");
        assert!(scattered_cost(100_000_000).check().is_err() && scattered_cost(40_000).bytes < 1e9);
        assert!(scattered_cost(100).seconds < scattered_cost(1000).seconds);
    }
}
