//! By nalgebra, in the calling thread.

use nalgebra::{Cholesky, Const, DMatrix, DMatrixView, DMatrixViewMut, Dyn, SymmetricEigen};

/// A matrix.
pub(crate) type Matrix = DMatrix<f64>;

/// A matrix, or the transpose of one, that is a factor of a product.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View<'a> {
    stored: &'a [f64],
    rows: usize,
    columns: usize,
    stride: usize,
    transposed: bool,
}

impl<'a> View<'a> {
    pub(crate) fn nrows(self) -> usize {
        if self.transposed { self.columns } else { self.rows }
    }

    pub(crate) fn ncols(self) -> usize {
        self.transpose().nrows()
    }

    pub(crate) fn transpose(self) -> Self {
        Self { transposed: !self.transposed, ..self }
    }

    pub(crate) fn subrows(self, first: usize, rows: usize) -> Self {
        if self.transposed {
            Self { stored: &self.stored[first * self.stride..], columns: rows, ..self }
        } else {
            Self { stored: &self.stored[first..], rows, ..self }
        }
    }

    /// The matrix as it is stored.
    fn stored(self) -> DMatrixView<'a, f64> {
        let (rows, columns) = (Dyn(self.rows), Dyn(self.columns));
        DMatrixView::from_slice_with_strides_generic(self.stored, rows, columns, Const::<1>, Dyn(self.stride))
    }
}

/// The whole of a matrix.
pub(crate) fn view(matrix: &Matrix) -> View<'_> {
    view_slice(matrix.as_slice(), matrix.nrows(), matrix.ncols())
}

/// A matrix in a slice.
pub(crate) fn view_slice(values: &[f64], rows: usize, columns: usize) -> View<'_> {
    View { stored: values, rows, columns, stride: rows, transposed: false }
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
    // Small products of nalgebra want columns without gaps between their entries.
    let (a_copy, b_copy);
    let (mut left, mut right) = (a, b);
    if a.transposed {
        a_copy = a.stored().transpose();
        left = view(&a_copy);
    }
    if b.transposed {
        b_copy = b.stored().transpose();
        right = view(&b_copy);
    }
    let mut out = DMatrixViewMut::from_slice(out, a.nrows(), b.ncols());
    out.gemm(1.0, &left.stored(), &right.stored(), 0.0);
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

/// Replaces the lower triangle of an `n x n` matrix by its Cholesky factor; false where a pivot is not positive.
/// It takes the memory of a second matrix while it runs.
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
