//! Cholesky factors of covariance matrices, with a jitter ladder.
//!
//! Matrices are column-major and `n x n`; only the lower triangle is written or read.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltParams, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

use crate::base::error::{Error, Result};
use crate::kernel::{Kernel, Points, RowScratch};

/// Jitters tried in turn, relative to the mean of the diagonal.
pub(crate) const JITTERS: [f64; 8] = [0.0, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, LARGEST_JITTER];

/// The largest jitter that is tried, as a share of the mean of the diagonal.
pub(crate) const LARGEST_JITTER: f64 = 1e-6;

/// Columns a task assembles at a time.
const COLUMNS: usize = 16;

/// Writes the lower triangle of `K + diagonal I` into `out`, column-major.
///
/// Cost: one kernel evaluation a pair, in parallel.
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

/// Replaces the lower triangle by the Cholesky factor; false where a pivot is not positive.
pub(crate) fn factorize(mut matrix: MatMut<'_, f64>) -> bool {
    let n = matrix.nrows();
    let par = Par::rayon(0);
    // A fifth faster at n = 4096 than faer's own choice of 256.
    let mut params: LltParams = faer::Auto::<f64>::auto();
    params.block_size = 128;
    let params = faer::Spec::new(params);
    let mut buffer = MemBuffer::new(cholesky_in_place_scratch::<f64>(n, par, params));
    let stack = MemStack::new(&mut buffer);
    let done = cholesky_in_place(matrix.as_mut(), Default::default(), par, stack, params);
    done.is_ok() && (0..n).all(|i| matrix[(i, i)] > 0.0 && matrix[(i, i)].is_finite())
}

/// Writes the Cholesky factor of `K + (noise_variance + jitter) I` into `out` and returns the jitter, the smallest
/// of the ladder that makes the matrix positive definite.
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
        if factorize(MatMut::from_column_major_slice_mut(out, n, n)) {
            return Ok(jitter);
        }
    }
    Err(Error::NotPositiveDefinite { size: n, largest_jitter: LARGEST_JITTER })
}

/// `sum_i ln L_ii`, half the log-determinant.
pub(crate) fn half_log_det(factor: &[f64], n: usize) -> f64 {
    factor.iter().step_by(n + 1).map(|l| l.ln()).sum()
}

/// Rows eliminated at a time by [`solve`], and rows a task of it updates.
const SOLVE_ROWS: usize = 256;

/// `(L L^T)^-1 y` for every column of `y`, in place.
///
/// For few columns this is bound by reading the factor, so each panel's update is shared among the threads; the sums
/// run in one order whatever their number.
pub(crate) fn solve(factor: &[f64], n: usize, y: &mut [f64]) {
    let factor = MatRef::from_column_major_slice(factor, n, n);
    let columns = y.len() / n;
    let mut y = MatMut::from_column_major_slice_mut(y, n, columns);
    let starts: Vec<usize> = (0..n).step_by(SOLVE_ROWS).collect();
    for &first in &starts {
        let width = SOLVE_ROWS.min(n - first);
        let panel = factor.submatrix(first, first, n - first, width);
        let (mut own, below) = y.as_mut().subrows_mut(first, n - first).split_at_row_mut(width);
        solve_lower_triangular_in_place(panel.subrows(0, width), own.as_mut(), Par::Seq);
        let own = own.as_ref();
        let parts = below.nrows().div_ceil(SOLVE_ROWS).max(1);
        let rows = panel.subrows(width, n - first - width);
        below.par_row_partition_mut(parts).zip(rows.par_row_partition(parts)).for_each(|(below, rows)| {
            matmul(below, Accum::Add, rows, own, -1.0, Par::Seq);
        });
    }
    for &first in starts.iter().rev() {
        let width = SOLVE_ROWS.min(n - first);
        let panel = factor.submatrix(first, first, n - first, width);
        let (own, below) = y.as_mut().subrows_mut(first, n - first).split_at_row_mut(width);
        let mut own = own;
        let (below, rows) = (below.as_ref(), panel.subrows(width, n - first - width));
        // Columns of the panel are rows of its transpose.
        let parts = width.div_ceil(32);
        own.as_mut()
            .par_row_partition_mut(parts)
            .zip(rows.transpose().par_row_partition(parts))
            .for_each(|(own, rows)| matmul(own, Accum::Add, rows, below, -1.0, Par::Seq));
        solve_upper_triangular_in_place(panel.subrows(0, width).transpose(), own, Par::Seq);
    }
}

/// `L^-1 y` for every column of `y`, in place, in the calling thread.
pub(crate) fn solve_lower(factor: &[f64], n: usize, y: &mut [f64]) {
    let columns = y.len() / n;
    let y = MatMut::from_column_major_slice_mut(y, n, columns);
    solve_lower_triangular_in_place(MatRef::from_column_major_slice(factor, n, n), y, Par::Seq);
}

/// Columns of the inverse a task forms at a time.
pub(crate) const INVERSE_COLUMNS: usize = 128;

/// Writes columns `first..first + width` of `L^-1`, from row `first` on, into `out`: column-major,
/// `(n - first) x width`. What stands above is zero.
///
/// Cost: `(n - first)^2 width / 2` multiply-adds, in the calling thread.
pub(crate) fn inverse_factor_columns(factor: &[f64], n: usize, first: usize, width: usize, out: &mut [f64]) {
    let rows = n - first;
    let factor = MatRef::from_column_major_slice(factor, n, n).submatrix(first, first, rows, rows);
    let (corner, _, left, rest) = factor.split_at(width, width);
    out.fill(0.0);
    let (mut top, mut bottom) = MatMut::from_column_major_slice_mut(out, rows, width).split_at_row_mut(width);
    invert_lower_triangular(top.as_mut(), corner, Par::Seq);
    // [A 0; B C]^-1 = [A^-1 0; -C^-1 B A^-1 C^-1].
    matmul(bottom.as_mut(), Accum::Replace, left, top.as_ref(), -1.0, Par::Seq);
    solve_lower_triangular_in_place(rest, bottom, Par::Seq);
}

/// Writes columns `first..first + width` of `(L L^T)^-1`, from row `first` on, into `out`, shaped as in
/// [`inverse_factor_columns`].
///
/// Solving with `L^T` upwards, the rows from `first` on need no row above. Cost: `(n - first)^2 width` multiply-adds,
/// in the calling thread; `n^3 / 3` over all columns, as by way of the whole `L^-1`, but without a second matrix and
/// with nothing to wait for between the blocks.
pub(crate) fn inverse_columns(factor: &[f64], n: usize, first: usize, width: usize, out: &mut [f64]) {
    inverse_factor_columns(factor, n, first, width, out);
    let rows = n - first;
    let factor = MatRef::from_column_major_slice(factor, n, n).submatrix(first, first, rows, rows);
    let out = MatMut::from_column_major_slice_mut(out, rows, width);
    solve_upper_triangular_in_place(factor.transpose(), out, Par::Seq);
}

/// The blocks of [`INVERSE_COLUMNS`] columns of `n`: first column and width.
pub(crate) fn inverse_blocks(n: usize) -> impl IndexedParallelIterator<Item = (usize, usize)> {
    let block = move |b| (b * INVERSE_COLUMNS, INVERSE_COLUMNS.min(n - b * INVERSE_COLUMNS));
    (0..n.div_ceil(INVERSE_COLUMNS)).into_par_iter().with_max_len(1).map(block)
}
