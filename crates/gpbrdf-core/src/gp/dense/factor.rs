//! Cholesky factors of covariance matrices, with a ladder of jitters for those that are not positive
//! definite.
//!
//! Matrices are column-major and `n x n`; only the lower triangle is written or read.

use rayon::prelude::*;

use crate::base::error::{Error, Result};
use crate::base::linalg::factorize;
use crate::kernel::{Kernel, Points, RowScratch};

/// Jitters tried in turn, relative to the mean of the diagonal.
pub(crate) const JITTERS: [f64; 8] = [0.0, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, LARGEST_JITTER];

/// The largest jitter that is tried, relative to the mean of the diagonal.
pub(crate) const LARGEST_JITTER: f64 = 1e-6;

/// Number of columns of the inverse that one parallel task computes.
pub(crate) const INVERSE_COLUMNS: usize = 128;

/// Number of columns that one parallel task assembles.
const COLUMNS: usize = 16;

/// Writes the lower triangle of `K + diagonal I` into `out`, column-major.
///
/// Cost: one kernel evaluation per pair of points, in parallel.
pub(crate) fn assemble(kernel: &Kernel, points: &Points, diagonal: f64, out: &mut [f64]) {
    let n = points.len();
    out.par_chunks_mut(n * COLUMNS).enumerate().for_each_init(
        || RowScratch::new(kernel.dimension()),
        |scratch, (block, columns)| {
            for (column, j) in columns.chunks_mut(n).zip(block * COLUMNS..) {
                kernel.row(points, j..n, points, j, scratch, &mut column[j..]);
                column[j] += diagonal;
            }
        },
    );
}

/// Writes the Cholesky factor of `K + (noise_variance + jitter) I` into `out` and returns the jitter: the
/// smallest one of the ladder that makes the matrix positive definite.
pub(crate) fn assemble_and_factorize(
    kernel: &Kernel,
    points: &Points,
    noise_variance: f64,
    out: &mut [f64],
) -> Result<f64> {
    let n = points.len();
    let mean_diagonal = kernel.prior_variance() + noise_variance;
    for relative in JITTERS {
        let jitter = relative * mean_diagonal;
        assemble(kernel, points, noise_variance + jitter, out);
        if factorize(out, n) {
            return Ok(jitter);
        }
    }
    Err(Error::NotPositiveDefinite { size: n, largest_jitter: LARGEST_JITTER })
}
