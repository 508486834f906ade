//! The linear algebra of small dense matrices that predictions need: products, eigenvectors, Cholesky factors.
//!
//! With the feature `fit` faer computes it, whose blocked and parallel algorithms pay where a search for
//! hyper-parameters repeats them hundreds of times. Without it nalgebra does, which is in the tree for its vectors
//! anyway; only the first variance of a large dense model is slower for it. Both backends offer the same names.
//!
//! Matrices in slices are column-major. Cholesky factors are `n x n`, and only their lower triangle is written or
//! read.

#[cfg(feature = "fit")]
mod with_faer;
#[cfg(not(feature = "fit"))]
mod with_nalgebra;

#[cfg(feature = "fit")]
use with_faer as backend;
#[cfg(not(feature = "fit"))]
use with_nalgebra as backend;

pub(crate) use backend::{
    Matrix, View, factorize, product, product_into, product_into_slice, solve, solve_lower, symmetric_eigen,
    view, view_slice,
};

/// `sum_i ln L_ii` of a Cholesky factor, half the log-determinant.
pub(crate) fn half_log_det(factor: &[f64], n: usize) -> f64 {
    factor.iter().step_by(n + 1).map(|l| l.ln()).sum()
}

/// The squares of all entries.
pub(crate) fn squared(m: &Matrix) -> Matrix {
    Matrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * m[(i, j)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::SplitMix64;

    fn random(rows: usize, columns: usize, random: &mut SplitMix64) -> Matrix {
        Matrix::from_fn(rows, columns, |_, _| random.next_unit() - 0.5)
    }

    /// Entries column by column.
    fn entries(m: &Matrix) -> Vec<f64> {
        (0..m.ncols()).flat_map(|j| (0..m.nrows()).map(move |i| m[(i, j)])).collect()
    }

    #[test]
    fn products_of_matrices_slices_and_transposes_are_the_sums_written_out() {
        let mut seed = SplitMix64::new(1);
        let (a, b) = (random(5, 4, &mut seed), random(4, 7, &mut seed));
        let a_transposed = Matrix::from_fn(4, 5, |i, j| a[(j, i)]);
        let expected: Vec<f64> =
            (0..35).map(|at| (0..4).map(|k| a[(at % 5, k)] * b[(k, at / 5)]).sum()).collect();
        let close = |found: &[f64], expected: &[f64]| {
            assert_eq!(found.len(), expected.len());
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?} {expected:?}");
        };
        let slice = entries(&b);
        let right = view_slice(&slice, 4, 7);
        close(&entries(&product(view(&a), view(&b))), &expected);
        close(&entries(&product(view(&a_transposed).transpose(), right)), &expected);
        let mut out = random(5, 7, &mut seed);
        product_into(&mut out, view(&a), right);
        close(&entries(&out), &expected);
        // The transpose of the last three columns times some rows.
        let rows = view(&b).transpose().subrows(4, 3);
        assert_eq!((rows.nrows(), rows.ncols()), (3, 4));
        let mut out = vec![f64::NAN; 15];
        product_into_slice(&mut out, view(&a), rows.transpose());
        close(&out, &expected[20..]);
    }

    #[test]
    fn eigenvectors_diagonalise_an_ill_conditioned_covariance() {
        let n = 40;
        let gram = Matrix::from_fn(n, n, |i, j| (-((i as f64 - j as f64) / 12.0).powi(2)).exp());
        let (values, vectors) = symmetric_eigen(&gram).unwrap();
        for i in 0..n {
            for j in 0..n {
                let sum: f64 = (0..n).map(|k| vectors[(i, k)] * values[k] * vectors[(j, k)]).sum();
                assert!((sum - gram[(i, j)]).abs() < 1e-13, "{i} {j} {sum}");
                let dot: f64 = (0..n).map(|k| vectors[(k, i)] * vectors[(k, j)]).sum();
                assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-13, "{i} {j} {dot}");
            }
        }
        let broken = Matrix::from_fn(n, n, |i, _| if i == 3 { f64::NAN } else { 1.0 });
        assert!(symmetric_eigen(&broken).is_none());
    }

    #[test]
    fn factors_solve_and_indefinite_matrices_have_none() {
        let n = 300;
        let matrix =
            |i: usize, j: usize| (-(i as f64 - j as f64).abs() / 20.0).exp() + if i == j { 0.1 } else { 0.0 };
        // What stands above the diagonal means nothing.
        let mut factor: Vec<f64> =
            (0..n * n).map(|at| if at % n < at / n { f64::NAN } else { matrix(at % n, at / n) }).collect();
        assert!(factorize(&mut factor, n));
        let mut seed = SplitMix64::new(2);
        let y: Vec<f64> = (0..2 * n).map(|_| seed.next_unit() - 0.5).collect();
        let (mut x, mut z) = (y.clone(), y.clone());
        solve(&factor, n, &mut x);
        solve_lower(&factor, n, &mut z);
        for (at, y) in y.iter().enumerate() {
            let (column, i) = (at / n * n, at % n);
            let sum: f64 = (0..n).map(|j| matrix(i, j) * x[column + j]).sum();
            assert!((sum - y).abs() < 1e-12, "{sum} {y}");
            let sum: f64 = (0..=i).map(|j| factor[j * n + i] * z[column + j]).sum();
            assert!((sum - y).abs() < 1e-12, "{sum} {y}");
        }
        let two = half_log_det(&[2.0, 1.0, f64::NAN, 3.0], 2);
        assert!((two - 6f64.ln()).abs() < 1e-15, "{two}");
        for broken in [[1.0, 2.0, 0.0, 1.0], [0.0; 4], [1.0, 0.0, 0.0, f64::NAN]] {
            assert!(!factorize(&mut broken.clone(), 2), "{broken:?}");
        }
    }
}
