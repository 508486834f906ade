//! By faer: blocked, vectorised, and where it says so parallel.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltParams, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

/// A matrix.
pub(crate) type Matrix = Mat<f64>;

/// A matrix, or the transpose of one, that is a factor of a product.
pub(crate) type View<'a> = MatRef<'a, f64>;

/// The whole of a matrix.
pub(crate) fn view(matrix: &Matrix) -> View<'_> {
    matrix.as_ref()
}

/// A matrix in a slice.
pub(crate) fn view_slice(values: &[f64], rows: usize, columns: usize) -> View<'_> {
    MatRef::from_column_major_slice(values, rows, columns)
}

/// `a b`, in parallel where that pays.
pub(crate) fn product(a: View<'_>, b: View<'_>) -> Matrix {
    a * b
}

/// Writes `a b` into `out`, in the calling thread.
pub(crate) fn product_into(out: &mut Matrix, a: View<'_>, b: View<'_>) {
    matmul(out.as_mut(), Accum::Replace, a, b, 1.0, Par::Seq);
}

/// Writes `a b` into `out`, column-major, in the calling thread.
pub(crate) fn product_into_slice(out: &mut [f64], a: View<'_>, b: View<'_>) {
    let out = MatMut::from_column_major_slice_mut(out, a.nrows(), b.ncols());
    matmul(out, Accum::Replace, a, b, 1.0, Par::Seq);
}

/// Eigenvalues of a symmetric matrix, and its eigenvectors as columns, in the calling thread; `None` where there
/// are none.
pub(crate) fn symmetric_eigen(matrix: &Matrix) -> Option<(Vec<f64>, Matrix)> {
    let n = matrix.nrows();
    let mut vectors = Mat::zeros(n, n);
    let mut values = faer::diag::Diag::zeros(n);
    let scratch = self_adjoint_evd_scratch::<f64>(n, ComputeEigenvectors::Yes, Par::Seq, Default::default());
    self_adjoint_evd(
        matrix.as_ref(),
        values.as_mut(),
        Some(vectors.as_mut()),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .ok()?;
    Some((values.column_vector().iter().copied().collect(), vectors))
}

/// Replaces the lower triangle of an `n x n` matrix by its Cholesky factor, in parallel; false where a pivot is not
/// positive.
pub(crate) fn factorize(matrix: &mut [f64], n: usize) -> bool {
    let par = Par::rayon(0);
    // A fifth faster at n = 4096 than faer's own choice of 256.
    let mut params: LltParams = faer::Auto::<f64>::auto();
    params.block_size = 128;
    let params = faer::Spec::new(params);
    let mut buffer = MemBuffer::new(cholesky_in_place_scratch::<f64>(n, par, params));
    let stack = MemStack::new(&mut buffer);
    let whole = MatMut::from_column_major_slice_mut(matrix, n, n);
    let done = cholesky_in_place(whole, Default::default(), par, stack, params);
    done.is_ok() && matrix.iter().step_by(n + 1).all(|&pivot| pivot > 0.0 && pivot.is_finite())
}

/// Rows eliminated at a time by [`solve`], and rows a task of it updates.
const SOLVE_ROWS: usize = 256;

/// `(L L^T)^-1 y` for every column of `y`, in place.
///
/// For few columns this is bound by reading the factor, so each panel's update is shared among the threads; the
/// sums run in one order whatever their number.
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
