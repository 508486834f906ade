//! Cholesky factors of covariance matrices, with a jitter ladder.
//!
//! Matrices are column-major and `n x n`; only the lower triangle is written or read.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::kernel::{Kernel, Points, RowScratch};

/// Jitters tried in turn, relative to the mean of the diagonal.
pub(super) const JITTERS: [f64; 8] = [0.0, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6];

/// Columns a task assembles at a time.
pub(super) const COLUMNS: usize = 16;

/// Writes the lower triangle of `K + diagonal I` into `out`, column-major.
///
/// Cost: one kernel evaluation a pair, in parallel.
pub(super) fn assemble(kernel: &Kernel, points: &Points, diagonal: f64, out: &mut [f64]) {
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

/// Replaces the lower triangle by the Cholesky factor; false where a pivot is not positive.
pub(super) fn factorize(mut matrix: MatMut<'_, f64>) -> bool {
    let n = matrix.nrows();
    let par = Par::rayon(0);
    let mut buffer = MemBuffer::new(cholesky_in_place_scratch::<f64>(n, par, faer::Spec::default()));
    let stack = MemStack::new(&mut buffer);
    let done = cholesky_in_place(matrix.as_mut(), Default::default(), par, stack, faer::Spec::default());
    done.is_ok() && (0..n).all(|i| matrix[(i, i)] > 0.0 && matrix[(i, i)].is_finite())
}

/// Writes the Cholesky factor of `K + (noise_variance + jitter) I` into `out` and returns the jitter, the smallest
/// of the ladder that makes the matrix positive definite.
pub(super) fn assemble_and_factorize(
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
        if factorize(MatMut::from_column_major_slice_mut(out, n, n)) {
            return Ok(jitter);
        }
    }
    Err(Error::NotPositiveDefinite { size: n, largest_jitter: JITTERS[JITTERS.len() - 1] })
}

/// `sum_i ln L_ii`, half the log-determinant.
pub(super) fn half_log_det(factor: &[f64], n: usize) -> f64 {
    factor.iter().step_by(n + 1).map(|l| l.ln()).sum()
}

/// `(L L^T)^-1 y` for every column of `y`, in place.
pub(super) fn solve(factor: &[f64], n: usize, y: &mut [f64]) {
    let factor = MatRef::from_column_major_slice(factor, n, n);
    let columns = y.len() / n;
    let mut y = MatMut::from_column_major_slice_mut(y, n, columns);
    solve_lower_triangular_in_place(factor, y.as_mut(), Par::Seq);
    solve_upper_triangular_in_place(factor.transpose(), y, Par::Seq);
}

/// `L^-1 y` for every column of `y`, in place, in the calling thread.
pub(super) fn solve_lower(factor: &[f64], n: usize, y: &mut [f64]) {
    let columns = y.len() / n;
    let y = MatMut::from_column_major_slice_mut(y, n, columns);
    solve_lower_triangular_in_place(MatRef::from_column_major_slice(factor, n, n), y, Par::Seq);
}

/// Writes `L^-1` into the lower triangle of `out`.
pub(super) fn invert_factor(factor: &[f64], n: usize, out: &mut [f64]) {
    let factor = MatRef::from_column_major_slice(factor, n, n);
    invert_lower_triangular(MatMut::from_column_major_slice_mut(out, n, n), factor, Par::rayon(0));
}

/// Writes the lower triangle of `(L L^T)^-1 = L^-T L^-1` into `out`, given `L^-1`.
pub(super) fn inverse_from_inverse_factor(inverse_factor: &[f64], n: usize, out: &mut [f64]) {
    let inverse_factor = MatRef::from_column_major_slice(inverse_factor, n, n);
    matmul(
        MatMut::from_column_major_slice_mut(out, n, n),
        BlockStructure::TriangularLower,
        Accum::Replace,
        inverse_factor.transpose(),
        BlockStructure::TriangularUpper,
        inverse_factor,
        BlockStructure::TriangularLower,
        1.0,
        Par::rayon(0),
    );
}
