//! Predictive mean and variance of a lattice process on the whole table.
//!
//! The contractions along `u` and `phi` come first, for all cells at once. Each column (the 90 cells along
//! `theta_d` of one `(i_theta_h, i_phi_d)`) is then summed over the `B` nodes along `v`, because
//! `v = theta_d / theta_d_max(theta_h, phi_d)` depends on all three indices. A table takes
//! `90 A B C + 90 180 B C` multiply-adds and `0.55e6 B` kernel values, and the variance takes `0.55e6 B^2`
//! more multiply-adds.

use rayon::prelude::*;

use crate::base::error::Result;
use crate::base::linalg::{Matrix, product, product_into, product_into_slice, squared, view, view_slice};
use crate::base::simd::vectorized;
use crate::brdf::table::{N_PHI_D, N_THETA_D};
use crate::gp::lattice::LatticeGp;
use crate::gp::table::TableGeometry;
use crate::kernel::GridScratch;
use crate::sample::space::WarpedBox;
use crate::sample::symmetry::Symmetry;

/// Number of distinct `|cos phi_d|` among the table's cells: `phi_d` and `pi - phi_d` share `theta_d_max`.
const N_COLUMNS: usize = N_PHI_D / 2;

/// Computes the means of every column and passes them to `emit`, whose arguments are the slab of the column's
/// `i_theta_h` out of `slabs`, every `i_phi_d` that the means are for, and the means `[channel][i_theta_d]`.
/// Slabs are computed in parallel, each by one task.
pub(crate) fn bake_means<S: Send>(
    gp: &LatticeGp,
    space: WarpedBox,
    slabs: impl IndexedParallelIterator<Item = S>,
    emit: impl Fn(&mut S, &[usize], &mut [f64]) + Sync,
) {
    let nodes: usize = gp.data().len();
    let geometry = TableGeometry::new(space.into());
    let along_u = gp.cross(0, geometry.first());
    let along_phi = gp.cross(2, geometry.third());
    let contracted: Vec<Matrix> =
        gp.weights().chunks(nodes).map(|weights| contract_u(gp, weights, &along_u)).collect();
    slabs.enumerate().for_each_init(Column::default, |column, (i, mut slab)| {
        let weights: Vec<Matrix> = contracted.iter().map(|m| contract_phi(gp, m, i, &along_phi)).collect();
        let mut means = vec![0.0; weights.len() * N_THETA_D];
        for j in 0..N_COLUMNS {
            column.fill(gp, &geometry, i, j);
            for (row, targets) in mirrored_rows(space.symmetry, j) {
                column.sum_means(&weights, row, &mut means);
                emit(&mut slab, &targets, &mut means);
            }
        }
    });
}

/// Computes the latent variances `[i_theta_d]` of every column and passes them to `emit`, like
/// [`bake_means`].
pub(crate) fn bake_variances<S: Send>(
    gp: &LatticeGp,
    space: WarpedBox,
    slabs: impl IndexedParallelIterator<Item = S>,
    emit: impl Fn(&mut S, &[usize], &[f64]) + Sync,
) -> Result<()> {
    let spectrum = gp.spectrum()?;
    let geometry = TableGeometry::new(space.into());
    let [along_u, along_phi] = [(0, geometry.first()), (2, geometry.third())]
        .map(|(k, points)| squared(&product(view(&gp.cross(k, points)), view(&spectrum.eigen[k].vectors))));
    let contracted = contract_u(gp, &spectrum.precision, &along_u);
    // The prior variance is constant along u and v.
    let priors: Vec<f64> = geometry.third().iter().map(|&phi| gp.prior_variance([0.0, 0.0, phi])).collect();
    let scale = gp.hyper().signal_variance;
    slabs.enumerate().for_each_init(Column::default, |column, (i, mut slab)| {
        let weights = contract_phi(gp, &contracted, i, &along_phi);
        let mut variances = vec![0.0; N_THETA_D];
        for j in 0..N_COLUMNS {
            column.fill(gp, &geometry, i, j);
            column.project(&spectrum.eigen[1].vectors);
            for (row, targets) in mirrored_rows(space.symmetry, j) {
                column.sum_variances(&weights, row, priors[row], scale, &mut variances);
                emit(&mut slab, &targets, &variances);
            }
        }
    });
    Ok(())
}

/// The rows of the contracted weights that share the kernel values of column `j`, each with every `i_phi_d`
/// that it is for. A bilateral process has one row for both halves of `phi_d`.
fn mirrored_rows(symmetry: Symmetry, j: usize) -> Vec<(usize, Vec<usize>)> {
    let mirror = N_PHI_D - 1 - j;
    match symmetry {
        Symmetry::Bilateral => vec![(j, vec![j, mirror])],
        Symmetry::Reciprocal => vec![(j, vec![j]), (mirror, vec![mirror])],
    }
}

/// Contracts `A x B x C` weights along `u`. The result is `(B C) x 90`.
fn contract_u(gp: &LatticeGp, weights: &[f64], along_u: &Matrix) -> Matrix {
    let [a, b, c] = gp.data().shape();
    product(view_slice(weights, b * c, a), view(along_u).transpose())
}

/// Contracts along `phi` for one `i_theta_h`. The result is `rows x B`.
fn contract_phi(gp: &LatticeGp, contracted: &Matrix, i: usize, along_phi: &Matrix) -> Matrix {
    let [_, b, c] = gp.data().shape();
    let slice: Vec<f64> = (0..b * c).map(|row| contracted[(row, i)]).collect();
    let mut out = Matrix::zeros(along_phi.nrows(), b);
    product_into(&mut out, view(along_phi), view_slice(&slice, c, b));
    out
}

/// Kernel values along one column.
#[derive(Default)]
struct Column {
    /// Warped `v` of the cells above the horizon, followed by a single 1 for all cells below it.
    v: Vec<f64>,
    /// `[node][cell]`.
    kernels: Vec<f64>,
    /// `kernels` in the eigenbasis of `v`.
    projected: Vec<f64>,
    scratch: GridScratch,
}

impl Column {
    /// Computes the kernel values of the column with `i_theta_h = i` and `i_phi_d = j`.
    fn fill(&mut self, gp: &LatticeGp, geometry: &TableGeometry, i: usize, j: usize) {
        self.v.clear();
        self.v.extend(geometry.column(i, j));
        let nodes = &gp.data().coordinates[1];
        self.kernels.resize(nodes.len() * self.v.len(), 0.0);
        // The metric along v is the plain distance in every space.
        gp.hyper().kernels[1].fill_grid(&self.v, nodes, &mut self.scratch, &mut self.kernels);
    }

    fn project(&mut self, vectors: &Matrix) {
        let (count, nodes) = (self.v.len(), vectors.nrows());
        self.projected.resize(nodes * count, 0.0);
        product_into_slice(&mut self.projected, view_slice(&self.kernels, count, nodes), view(vectors));
    }

    /// Computes the means `[channel][cell]` from one row of the contracted weights of each channel.
    fn sum_means(&self, weights: &[Matrix], row: usize, means: &mut [f64]) {
        let count = self.v.len();
        for (weights, means) in weights.iter().zip(means.chunks_exact_mut(N_THETA_D)) {
            let (sums, below) = means.split_at_mut(count);
            let weights: Vec<f64> = weights.row(row).iter().copied().collect();
            vectorized(
                #[inline(always)]
                || weighted_sum(&weights, &self.kernels, sums),
            );
            below.fill(sums[count - 1]);
        }
    }

    /// Computes the latent variances `[cell]` from one row of the contracted precisions.
    fn sum_variances(&self, weights: &Matrix, row: usize, prior: f64, scale: f64, variances: &mut [f64]) {
        let count = self.v.len();
        let (sums, below) = variances.split_at_mut(count);
        let weights: Vec<f64> = weights.row(row).iter().copied().collect();
        vectorized(
            #[inline(always)]
            || weighted_sum_of_squares(&weights, &self.projected, sums),
        );
        sums.iter_mut().for_each(|x| *x = (scale * (prior - *x)).max(0.0));
        below.fill(sums[count - 1]);
    }
}

/// `sums[i] = sum_j weights[j] values[j][i]`.
#[inline(always)]
fn weighted_sum(weights: &[f64], values: &[f64], sums: &mut [f64]) {
    sums.fill(0.0);
    for (values, weight) in values.chunks_exact(sums.len()).zip(weights) {
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += weight * value;
        }
    }
}

/// `sums[i] = sum_j weights[j] values[j][i]^2`.
#[inline(always)]
fn weighted_sum_of_squares(weights: &[f64], values: &[f64], sums: &mut [f64]) {
    sums.fill(0.0);
    for (values, weight) in values.chunks_exact(sums.len()).zip(weights) {
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += weight * (value * value);
        }
    }
}
