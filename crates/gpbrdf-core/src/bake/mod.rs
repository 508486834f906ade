//! From a model to a whole table of mean and sigma.

mod lattice;

use rayon::prelude::*;

use crate::error::Result;
use crate::model::{Model, Process};
use crate::space::InputSpace;
use crate::table::{BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, cell_index};

/// Whether to bake sigma beside the mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BakeSigma {
    /// Mean only.
    Skip,
    /// Latent standard deviation too.
    Latent,
}

/// Posterior standard deviation of the latent target at the centre of every cell, in target units: with the
/// logarithmic transform 0.05 reads as five per cent. Cells below the horizon hold the value at the horizon.
#[derive(Clone, Debug, PartialEq)]
pub struct SigmaTable {
    planes: Vec<Vec<f32>>,
}

impl SigmaTable {
    /// One plane in MERL order where the channels share hyper-parameters, else one a channel.
    #[must_use]
    pub fn planes(&self) -> &[Vec<f32>] {
        &self.planes
    }

    /// Sigma of one cell and channel.
    #[must_use]
    pub fn value(&self, cell: usize, channel: usize) -> f32 {
        self.planes[channel.min(self.planes.len() - 1)][cell]
    }
}

/// A baked model.
#[derive(Clone, Debug, PartialEq)]
pub struct Baked {
    /// Predictive mean of the target, carried back to sr^-1 (the median of the BRDF value), in every cell.
    pub mean: BrdfTable,
    /// Latent standard deviation in target units.
    pub sigma: Option<SigmaTable>,
}

/// Evaluates a model at the centre of all 1,458,000 cells, in parallel. Cells below the horizon hold the value at
/// the horizon, so that texture filtering shows no dark fringe.
///
/// A lattice model takes tens of milliseconds. A dense one sums `n` kernel values a cell, and its variance costs
/// `n^2` a point, so sigma is computed on every third cell along each axis and interpolated between.
///
/// # Errors
/// Cancellation, or a dense factorisation that fails.
pub fn bake(model: &Model, sigma: BakeSigma) -> Result<Baked> {
    let wanted = lattice::Wanted { mean: true, sigma: sigma == BakeSigma::Latent };
    match (&model.process, model.space) {
        (Process::Lattice(groups), InputSpace::WarpedBox { symmetry, .. }) => {
            let mut mean = vec![[0.0f32; 3]; N_CELLS];
            let mut planes = Vec::new();
            let mut first = 0;
            for gp in groups {
                // The sigma slabs of a bake without sigma are empty.
                let mut plane = vec![0.0f32; if wanted.sigma { N_CELLS } else { 0 }];
                let mut sigmas = plane.chunks_mut(SLAB).collect::<Vec<_>>();
                sigmas.resize_with(N_CELLS / SLAB, Default::default);
                let slabs = mean.par_chunks_mut(SLAB).zip(sigmas);
                let write = |slab: &mut (&mut [[f32; 3]], &mut [f32]), row: usize, means: &mut [f64], variances: &[f64]| {
                    for (channel, means) in means.chunks_mut(N_THETA_D).enumerate() {
                        means.iter_mut().for_each(|m| *m += model.offsets[first + channel]);
                        model.transform.inverse_in_place(means);
                        for (l, &value) in means.iter().enumerate() {
                            slab.0[cell_index(0, l, row)][first + channel] = to_f32(value);
                        }
                    }
                    for (l, &variance) in variances.iter().enumerate() {
                        slab.1[cell_index(0, l, row)] = to_f32(variance.sqrt());
                    }
                };
                lattice::bake_lattice(gp, model.space, symmetry, wanted, slabs, write);
                first += gp.data().channels;
                if wanted.sigma {
                    planes.push(plane);
                }
            }
            Ok(Baked { mean: BrdfTable::from_cells(mean), sigma: wanted.sigma.then_some(SigmaTable { planes }) })
        }
        _ => dense::bake_dense(model, wanted),
    }
}

/// Cells of one `i_theta_h`.
const SLAB: usize = N_THETA_D * N_PHI_D;

/// Rounds to the table's precision.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the table's precision")]
fn to_f32(x: f64) -> f32 {
    x as f32
}
