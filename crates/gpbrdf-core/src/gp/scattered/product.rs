//! Products of the covariance matrix with vectors, without storing the matrix.

use rayon::prelude::*;

use super::conditional::Basis;
use crate::base::simd::{add_scaled, dot};
use crate::kernel::{Kernel, Points, RowScratch};

/// Number of rows and columns of a tile. The values of one row of a tile stay in the first cache.
const TILE: usize = 512;

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
    pub(super) fn apply(&self, x: &[f64], out: &mut [f64]) {
        let n = self.points.len();
        let tiles = n.div_ceil(TILE);
        let parts: Vec<Vec<f64>> = (0..PARTS.min(tiles))
            .into_par_iter()
            .map(|part| {
                let mut sum = vec![0.0; x.len()];
                let mut scratch = RowScratch::new(self.kernel.dimension());
                let mut row = vec![0.0; TILE];
                for tile in (part..tiles).step_by(PARTS) {
                    let rows = tile * TILE..n.min((tile + 1) * TILE);
                    for other in 0..=tile {
                        for i in rows.clone() {
                            // On the diagonal tile only what is left of the diagonal is taken.
                            let columns = other * TILE..((other + 1) * TILE).min(i);
                            let row = &mut row[..columns.len()];
                            self.kernel.row(self.points, columns.clone(), self.points, i, &mut scratch, row);
                            for (x, sum) in x.chunks(n).zip(sum.chunks_mut(n)) {
                                sum[i] += dot(row, &x[columns.clone()]);
                                add_scaled(x[i], row, &mut sum[columns.clone()]);
                            }
                        }
                    }
                }
                sum
            })
            .collect();
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
                let mut sum = vec![0.0; self.basis.count];
                x.iter()
                    .enumerate()
                    .for_each(|(i, &x)| add_scaled(self.basis_variance * x, self.basis.row(i), &mut sum));
                out.iter_mut().enumerate().for_each(|(i, out)| *out += dot(self.basis.row(i), &sum));
            }
        }
    }
}
