//! From a model to a whole table of mean and sigma.

mod dense;
mod lattice;

use rayon::prelude::*;

use crate::model::{Model, Process};
use crate::space::InputSpace;
use crate::table::{BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, cell_index};

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

/// Evaluates the predictive mean of a model at the centre of all 1,458,000 cells, in parallel, and carries it back to
/// sr^-1. Cells below the horizon hold the value at the horizon, so that texture filtering shows no dark fringe.
///
/// A lattice model takes tens of milliseconds; a dense one sums `n` kernel values a cell.
#[must_use]
pub fn bake_mean(model: &Model) -> BrdfTable {
    let (Process::Lattice(groups), InputSpace::WarpedBox { symmetry, .. }) = (&model.process, model.space) else {
        return dense::bake_mean(model);
    };
    let mut mean = vec![[0.0f32; 3]; N_CELLS];
    let mut first = 0;
    for gp in groups {
        let slabs = mean.par_chunks_mut(SLAB);
        lattice::bake_means(gp, model.space, symmetry, slabs, |slab, row, means| {
            for (channel, means) in means.chunks_mut(N_THETA_D).enumerate() {
                means.iter_mut().for_each(|m| *m += model.offsets[first + channel]);
                model.transform.inverse_in_place(means);
                for (l, &value) in means.iter().enumerate() {
                    slab[cell_index(0, l, row)][first + channel] = to_f32(value);
                }
            }
        });
        first += gp.data().channels;
    }
    BrdfTable::from_cells(mean)
}

/// Evaluates the latent standard deviation of a model's target at the centre of every cell, in parallel.
///
/// The variance of a dense model costs `n^2` a point: it is computed in the middle of every block of 3 x 3 x 3 cells and
/// interpolated between.
#[must_use]
pub fn bake_sigma(model: &Model) -> SigmaTable {
    let (Process::Lattice(groups), InputSpace::WarpedBox { symmetry, .. }) = (&model.process, model.space) else {
        return dense::bake_sigma(model);
    };
    let planes = groups.iter().map(|gp| {
        let mut plane = vec![0.0f32; N_CELLS];
        let slabs = plane.par_chunks_mut(SLAB);
        lattice::bake_variances(gp, model.space, symmetry, slabs, |slab, row, variances| {
            for (l, &variance) in variances.iter().enumerate() {
                slab[cell_index(0, l, row)] = to_f32(variance.sqrt());
            }
        });
        plane
    });
    SigmaTable { planes: planes.collect() }
}

/// Cells of one `i_theta_h`.
const SLAB: usize = N_THETA_D * N_PHI_D;

/// Rounds to the table's precision.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the table's precision")]
fn to_f32(x: f64) -> f32 {
    x as f32
}
