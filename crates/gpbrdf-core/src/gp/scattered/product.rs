//! Products of the covariance matrix with vectors, without storing the matrix.

use std::ops::Range;

use rayon::prelude::*;

use super::conditional::Basis;
use crate::base::error::Result;
use crate::base::simd::{add_scaled, dot, dots_and_updates};
use crate::base::watch::Watch;
use crate::kernel::{Kernel, Points, RowScratch};

/// Number of rows and columns of a tile. What a tile needs of nine columns of `x` and `out` stays in the first cache.
const TILE: usize = 256;

/// Number of columns of `x` that take part in one pass over a row.
const TOGETHER: usize = 3;

/// Number of partial sums. It does not depend on the number of threads, so neither do the results.
const PARTS: usize = 16;

/// The covariance of `n` samples: `k(X, X) + v b(X) b(X)^T + diag(noise)`.
#[derive(Debug)]
pub(super) struct Covariance<'a> {
    pub(super) kernel: &'a Kernel,
    pub(super) points: &'a Points,
    /// What is added to the diagonal.
    pub(super) diagonal: &'a [f64],
    /// The basis `b`, and `v`.
    pub(super) basis: &'a Basis,
    pub(super) basis_variance: f64,
}

impl Covariance<'_> {
    /// `out = K x` for several columns of length `n`, one after the other. Cost: `n^2 / 2` kernel evaluations
    /// and `n^2` multiply-adds per column; memory: 16 copies of `x`.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled) where the observer stops the work.
    pub(super) fn apply(&self, x: &[f64], out: &mut [f64], watch: &Watch) -> Result<()> {
        let n = self.points.len();
        let tiles = n.div_ceil(TILE);
        let steps = watch.steps(tiles * (tiles + 1) / 2);
        let parts: Vec<Vec<f64>> = (0..PARTS.min(tiles))
            .into_par_iter()
            .map(|part| {
                let mut sum = vec![0.0; x.len()];
                let mut scratch = RowScratch::new(self.kernel.dimension());
                let mut row = vec![0.0; TILE];
                for tile in (part..tiles).step_by(PARTS) {
                    let rows = tile * TILE..n.min((tile + 1) * TILE);
                    for other in 0..=tile {
                        steps.take()?;
                        for i in rows.clone() {
                            // On the diagonal tile only what is left of the diagonal is taken.
                            let columns = other * TILE..((other + 1) * TILE).min(i);
                            let row = &mut row[..columns.len()];
                            self.kernel.row(self.points, columns.clone(), self.points, i, &mut scratch, row);
                            for (x, sum) in x.chunks(TOGETHER * n).zip(sum.chunks_mut(TOGETHER * n)) {
                                add_row(row, i, &columns, n, x, sum);
                            }
                        }
                    }
                }
                Ok(sum)
            })
            .collect::<Result<_>>()?;
        let prior = self.kernel.prior_variance();
        for (x, out) in x.chunks(n).zip(out.chunks_mut(n)) {
            for ((out, x), noise) in out.iter_mut().zip(x).zip(self.diagonal) {
                *out = (prior + noise) * x;
            }
        }
        for part in parts {
            add_scaled(1.0, &part, out);
        }
        if self.basis.count > 0 {
            for (x, out) in x.chunks(n).zip(out.chunks_mut(n)) {
                let sum = self.basis.weighted_sum(self.basis_variance, x);
                out.iter_mut().enumerate().for_each(|(i, out)| *out += dot(self.basis.row(i), &sum));
            }
        }
        Ok(())
    }
}

/// Adds what the values `row` of row `i` in the columns `at`, all of them before `i`, contribute to the products with
/// up to three columns of length `n`: they are those of column `i` as well.
fn add_row(row: &[f64], i: usize, at: &Range<usize>, n: usize, x: &[f64], sum: &mut [f64]) {
    let mut sums = sum.chunks_mut(n).map(|sum| sum.split_at_mut(i));
    if x.len() == TOGETHER * n
        && let (Some((a, a_rest)), Some((b, b_rest)), Some((c, c_rest))) =
            (sums.next(), sums.next(), sums.next())
    {
        let x = [&x[..n], &x[n..2 * n], &x[2 * n..]];
        let before = [&mut a[at.clone()], &mut b[at.clone()], &mut c[at.clone()]];
        let dots = dots_and_updates(row, x.map(|x| &x[at.clone()]), x.map(|x| x[i]), before);
        a_rest[0] += dots[0];
        b_rest[0] += dots[1];
        c_rest[0] += dots[2];
        return;
    }
    for (x, (before, rest)) in x.chunks(n).zip(sums) {
        rest[0] += dot(row, &x[at.clone()]);
        add_scaled(x[i], row, &mut before[at.clone()]);
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use crate::base::error::Error;
    use crate::base::random::SplitMix64;
    use crate::base::watch::Observer;
    use crate::kernel::Shape;

    #[test]
    fn products_are_those_of_the_matrix_and_stop_in_the_middle() {
        let (n, columns) = (2 * TILE + 77, 4);
        let kernel = Kernel::ard(0.7, Shape::Matern52, &[0.3, 0.5, 0.8]);
        let mut random = SplitMix64::new(1);
        let mut numbers = |count: usize| -> Vec<f64> { (0..count).map(|_| random.next_unit()).collect() };
        let (x, diagonal, y) = (numbers(3 * n), numbers(n), numbers(columns * n));
        let points = Points::new(&x, &kernel.metric);
        let basis = Basis { count: 2, rows: numbers(2 * n) };
        let covariance = Covariance {
            kernel: &kernel,
            points: &points,
            diagonal: &diagonal,
            basis: &basis,
            basis_variance: 0.3,
        };
        let mut out = vec![0.0; columns * n];
        covariance.apply(&y, &mut out, &Watch::default()).unwrap();
        for i in (0..n).step_by(97) {
            let row = |j: usize| {
                let value = kernel.value(&x[3 * i..3 * i + 3], &x[3 * j..3 * j + 3]);
                let in_basis = 0.3 * dot(basis.row(i), basis.row(j));
                value + in_basis + if i == j { diagonal[i] } else { 0.0 }
            };
            for (y, out) in y.chunks(n).zip(out.chunks(n)) {
                let expected: f64 = (0..n).map(|j| row(j) * y[j]).sum();
                assert!((out[i] - expected).abs() < 1e-12 * expected, "{i}: {} {expected}", out[i]);
            }
        }
        let calls = Arc::new(AtomicUsize::new(0));
        let counter = Arc::clone(&calls);
        let observer = Observer::new(move |progress| {
            counter.fetch_add(1, Ordering::Relaxed);
            if progress.share < Some(0.5) { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        let stopped = covariance.apply(&y, &mut out, &Watch::new(&observer));
        assert!(matches!(stopped, Err(Error::Cancelled)));
        assert!((1..=6).contains(&calls.load(Ordering::Relaxed)));
    }
}
