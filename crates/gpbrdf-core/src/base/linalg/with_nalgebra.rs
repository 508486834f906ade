//! By nalgebra, in the calling thread.

use nalgebra::{Cholesky, DMatrix, DMatrixView, DMatrixViewMut, Dyn, SymmetricEigen};

/// A matrix.
pub(crate) type Matrix = DMatrix<f64>;

/// A matrix, or the transpose of one, that is a factor of a product: entry `(i, j)` stands at `i strides[0] + j strides[1]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View<'a> {
    values: &'a [f64],
    shape: [usize; 2],
    strides: [usize; 2],
}

impl View<'_> {
    pub(crate) fn nrows(self) -> usize {
        self.shape[0]
    }

    pub(crate) fn ncols(self) -> usize {
        self.shape[1]
    }

    pub(crate) fn transpose(self) -> Self {
        let ([rows, columns], [down, right]) = (self.shape, self.strides);
        Self { shape: [columns, rows], strides: [right, down], ..self }
    }

    pub(crate) fn subrows(self, first: usize, rows: usize) -> Self {
        let values = &self.values[first * self.strides[0]..];
        Self { values, shape: [rows, self.shape[1]], ..self }
    }
}

impl<'a> From<View<'a>> for DMatrixView<'a, f64, Dyn, Dyn> {
    fn from(View { values, shape, strides }: View<'a>) -> Self {
        Self::from_slice_with_strides(values, shape[0], shape[1], strides[0], strides[1])
    }
}

/// The whole of a matrix.
pub(crate) fn view(matrix: &Matrix) -> View<'_> {
    view_slice(matrix.as_slice(), matrix.nrows(), matrix.ncols())
}

/// A matrix in a slice.
pub(crate) fn view_slice(values: &[f64], rows: usize, columns: usize) -> View<'_> {
    View { values, shape: [rows, columns], strides: [1, rows] }
}

/// `a b`.
pub(crate) fn product(a: View<'_>, b: View<'_>) -> Matrix {
    let mut out = Matrix::zeros(a.nrows(), b.ncols());
    product_into(&mut out, a, b);
    out
}

/// Writes `a b` into `out`.
pub(crate) fn product_into(out: &mut Matrix, a: View<'_>, b: View<'_>) {
    product_into_slice(out.as_mut_slice(), a, b);
}

/// Writes `a b` into `out`, column-major.
pub(crate) fn product_into_slice(out: &mut [f64], a: View<'_>, b: View<'_>) {
    let mut out = DMatrixViewMut::from_slice(out, a.nrows(), b.ncols());
    out.gemm(1.0, &DMatrixView::from(a), &DMatrixView::from(b), 0.0);
}

/// Iterations for each eigenvalue after which there is none to be found; a handful is usual.
const MAX_ITERATIONS: usize = 100;

/// Eigenvalues of a symmetric matrix, and its eigenvectors as columns; `None` where there are none.
pub(crate) fn symmetric_eigen(matrix: &Matrix) -> Option<(Vec<f64>, Matrix)> {
    let limit = MAX_ITERATIONS * matrix.nrows();
    let eigen = SymmetricEigen::try_new(matrix.clone(), f64::EPSILON, limit)?;
    let values = eigen.eigenvalues.as_slice().to_vec();
    values.iter().all(|x| x.is_finite()).then_some((values, eigen.eigenvectors))
}

/// Replaces the lower triangle of an `n x n` matrix by its Cholesky factor; false where a pivot is not positive. Takes a
/// second matrix while it runs.
pub(crate) fn factorize(matrix: &mut [f64], n: usize) -> bool {
    let Some(factor) = Cholesky::new(DMatrix::from_column_slice(n, n, matrix)) else { return false };
    matrix.copy_from_slice(factor.unpack_dirty().as_slice());
    matrix.iter().step_by(n + 1).all(|pivot| pivot.is_finite())
}

/// `(L L^T)^-1 y` for every column of `y`, in place.
pub(crate) fn solve(factor: &[f64], n: usize, y: &mut [f64]) {
    solve_lower(factor, n, y);
    let columns = y.len() / n;
    // The diagonal is positive, so there is always a solution.
    let _ = DMatrixView::from_slice(factor, n, n)
        .tr_solve_lower_triangular_mut(&mut DMatrixViewMut::from_slice(y, n, columns));
}

/// `L^-1 y` for every column of `y`, in place.
pub(crate) fn solve_lower(factor: &[f64], n: usize, y: &mut [f64]) {
    let columns = y.len() / n;
    let _ = DMatrixView::from_slice(factor, n, n)
        .solve_lower_triangular_mut(&mut DMatrixViewMut::from_slice(y, n, columns));
}
