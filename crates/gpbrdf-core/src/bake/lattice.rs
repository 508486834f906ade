//! Predictive mean and sigma of a lattice process on the whole table.

use std::f64::consts::FRAC_PI_2;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

use crate::angles::theta_d_max;
use crate::gp::lattice::{LatticeGp, square};
use crate::layout::Symmetry;
use crate::space::InputSpace;
use crate::table::{N_PHI_D, N_THETA_D, N_THETA_H, cell_center};

/// Distinct `|cos phi_d|` of the table's cells: `phi_d` and `pi - phi_d` share `theta_d_max`.
const N_COLUMNS: usize = N_PHI_D / 2;

/// What to evaluate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wanted {
    pub(crate) mean: bool,
    pub(crate) sigma: bool,
}

/// Evaluates a process in the warped box on all cells of the table and hands every column to `emit`.
///
/// A column is the 90 cells along `theta_d` of one `(i_theta_h, i_phi_d)`; `emit` gets the slab of its
/// `i_theta_h` out of `slabs`, `i_phi_d`, the means `[channel][i_theta_d]` and the latent variances
/// `[i_theta_d]` (empty where not wanted). Slabs run in parallel; each is written by one task.
///
/// `u` and `phi` are contracted first, for all cells at once; then each column sums over the `B` nodes along
/// `v`, as `v = theta_d / theta_d_max(theta_h, phi_d)` depends on both. Per table: `90 A B C + 90 180 B C` multiply-adds,
/// `0.55 M B` kernel values, and for the variance `0.55 M B^2` multiply-adds.
pub(crate) fn bake_lattice<S: Send>(
    gp: &LatticeGp,
    space: InputSpace,
    symmetry: Symmetry,
    wanted: Wanted,
    slabs: impl IndexedParallelIterator<Item = S>,
    emit: impl Fn(&mut S, usize, &mut [f64], &[f64]) + Sync,
) {
    let [a, b, c] = gp.data().shape();
    let channels = gp.data().channels;
    // A bilateral process is the same on both halves of phi_d.
    let rows = if symmetry == Symmetry::Bilateral { N_COLUMNS } else { N_PHI_D };
    let u: Vec<f64> = (0..N_THETA_H).map(|i| space.warp_u((i as f64 + 0.5) / N_THETA_H as f64)).collect();
    let phi: Vec<f64> = (0..rows).map(|i| cell_center(0, 0, i).phi_d).collect();
    let (cross_u, cross_phi) = (gp.cross(0, &u), gp.cross(2, &phi));
    let along_u = |weights: &[f64], cross: &Mat<f64>| {
        MatRef::from_column_major_slice(weights, b * c, a) * cross.transpose()
    };
    let means: Vec<Mat<f64>> = if wanted.mean {
        gp.weights().chunks(a * b * c).map(|weights| along_u(weights, &cross_u)).collect()
    } else {
        Vec::new()
    };
    let variance = wanted.sigma.then(|| {
        let mut squares = [&cross_u * &gp.eigen[0].vectors, &cross_phi * &gp.eigen[2].vectors];
        squares.iter_mut().for_each(square);
        let [u, phi] = squares;
        (along_u(&gp.precision, &u), phi)
    });
    let prior = gp.prior_variance();
    let signal_variance = gp.hyper().signal_variance;

    slabs.enumerate().for_each_init(Scratch::default, |scratch, (i, mut slab)| {
        // phi contracted: rows x B matrices, one a channel.
        let contract_phi = |contracted: &Mat<f64>, cross: &Mat<f64>| {
            let slice: Vec<f64> = contracted.col(i).iter().copied().collect();
            cross * MatRef::from_column_major_slice(&slice, c, b)
        };
        let means: Vec<Mat<f64>> = means.iter().map(|m| contract_phi(m, &cross_phi)).collect();
        let variance = variance.as_ref().map(|(contracted, squares)| contract_phi(contracted, squares));
        for column in 0..N_COLUMNS {
            let centre = cell_center(i, 0, column);
            let count = scratch.place(theta_d_max(centre.theta_h, centre.phi_d));
            scratch.fill_kernels(gp, count);
            if wanted.sigma {
                scratch.project(&gp.eigen[1].vectors, count);
            }
            for row in [column, N_PHI_D - 1 - column] {
                let source = if rows == N_PHI_D { row } else { column };
                scratch.sum_means(&means, source, count);
                if let Some(weights) = &variance {
                    scratch.sum_variances(weights, source, count, prior, signal_variance);
                }
                emit(&mut slab, row, &mut scratch.means, &scratch.variances);
            }
        }
        debug_assert_eq!(means.len(), if wanted.mean { channels } else { 0 });
    });
}

/// Buffers of one task, along `theta_d`.
#[derive(Default)]
struct Scratch {
    /// `v` of the cells above the horizon, then 1 for all the others.
    v: Vec<f64>,
    /// Kernel values `[node][cell]`.
    kernels: Vec<f64>,
    /// `kernels` in the eigenbasis of `v`.
    projected: Vec<f64>,
    means: Vec<f64>,
    variances: Vec<f64>,
}

impl Scratch {
    /// Sets `v` and returns how many cells differ: below the horizon all are alike.
    fn place(&mut self, theta_d_max: f64) -> usize {
        self.v.clear();
        for l in 0..N_THETA_D {
            let theta_d = (l as f64 + 0.5) / N_THETA_D as f64 * FRAC_PI_2;
            if theta_d >= theta_d_max {
                self.v.push(1.0);
                break;
            }
            self.v.push(theta_d / theta_d_max);
        }
        self.v.len()
    }

    fn fill_kernels(&mut self, gp: &LatticeGp, count: usize) {
        let (nodes, metric) = (&gp.data().coordinates[1], gp.data().metrics[1]);
        self.kernels.resize(nodes.len() * count, 0.0);
        for (out, &node) in self.kernels.chunks_mut(count).zip(nodes) {
            for (out, &v) in out.iter_mut().zip(&self.v) {
                *out = metric.distance(v, node);
            }
        }
        gp.hyper().kernels[1].values_in_place(&mut self.kernels);
    }

    fn project(&mut self, vectors: &Mat<f64>, count: usize) {
        let nodes = vectors.nrows();
        self.projected.resize(nodes * count, 0.0);
        let kernels = MatRef::from_column_major_slice(&self.kernels, count, nodes);
        let out = MatMut::from_column_major_slice_mut(&mut self.projected, count, nodes);
        matmul(out, Accum::Replace, kernels, vectors.as_ref(), 1.0, Par::Seq);
    }

    fn sum_means(&mut self, weights: &[Mat<f64>], row: usize, count: usize) {
        self.means.clear();
        self.means.resize(weights.len() * N_THETA_D, 0.0);
        for (weights, means) in weights.iter().zip(self.means.chunks_mut(N_THETA_D)) {
            let (sums, below) = means.split_at_mut(count);
            for (kernels, weight) in self.kernels.chunks(count).zip(weights.row(row).iter()) {
                for (sum, kernel) in sums.iter_mut().zip(kernels) {
                    *sum += weight * kernel;
                }
            }
            below.fill(sums[count - 1]);
        }
    }

    fn sum_variances(&mut self, weights: &Mat<f64>, row: usize, count: usize, prior: f64, scale: f64) {
        self.variances.clear();
        self.variances.resize(N_THETA_D, prior);
        let (sums, below) = self.variances.split_at_mut(count);
        for (projected, weight) in self.projected.chunks(count).zip(weights.row(row).iter()) {
            for (sum, p) in sums.iter_mut().zip(projected) {
                *sum -= weight * p * p;
            }
        }
        sums.iter_mut().for_each(|x| *x = (scale * *x).max(0.0));
        below.fill(sums[count - 1]);
    }
}
