//! The inverse of a covariance matrix, one block of columns at a time.
//!
//! Matrices are column-major and `n x n`; only the lower triangle is read.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

use super::factor::INVERSE_COLUMNS;
use crate::base::simd::dot;

/// Writes columns `first..first + width` of `L^-1`, from row `first` on, into `out`: column-major,
/// `(n - first) x width`. The rows above are zero and are not written.
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
/// Back substitution with `L^T` proceeds upwards, so the rows from `first` on do not need any row above.
/// Cost: `(n - first)^2 width` multiply-adds, in the calling thread. Over all columns this is `n^3 / 3`, as
/// much as by way of the whole `L^-1`, but it needs no second matrix, and no block has to wait for another.
pub(crate) fn inverse_columns(factor: &[f64], n: usize, first: usize, width: usize, out: &mut [f64]) {
    inverse_factor_columns(factor, n, first, width, out);
    let rows = n - first;
    let factor = MatRef::from_column_major_slice(factor, n, n).submatrix(first, first, rows, rows);
    let out = MatMut::from_column_major_slice_mut(out, rows, width);
    solve_upper_triangular_in_place(factor.transpose(), out, Par::Seq);
}

/// `1 / [(L L^T)^-1]_ii`, the variance of each sample given all others: the reciprocal of the squared norm of column
/// `i` of `L^-1`. Cost: `n^3 / 6` multiply-adds.
pub(crate) fn left_out_variances(factor: &[f64], n: usize) -> Vec<f64> {
    let blocks: Vec<Vec<f64>> = inverse_blocks(n)
        .map_init(
            || vec![0.0; n * INVERSE_COLUMNS],
            |block, (first, width)| {
                let block = &mut block[..(n - first) * width];
                inverse_factor_columns(factor, n, first, width, block);
                block.chunks(n - first).map(|column| dot(column, column).recip()).collect()
            },
        )
        .collect();
    blocks.concat()
}

/// Splits `n` columns into blocks of [`INVERSE_COLUMNS`]. Each item is the first column and the width of a
/// block.
pub(crate) fn inverse_blocks(n: usize) -> impl IndexedParallelIterator<Item = (usize, usize)> {
    let block = move |b| (b * INVERSE_COLUMNS, INVERSE_COLUMNS.min(n - b * INVERSE_COLUMNS));
    (0..n.div_ceil(INVERSE_COLUMNS)).into_par_iter().with_max_len(1).map(block)
}
