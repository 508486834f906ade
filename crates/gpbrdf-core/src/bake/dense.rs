//! Predictive mean and sigma of a dense process on the whole table.

use rayon::prelude::*;

use crate::angles::HalfDiff;
use crate::bake::{SLAB, SigmaTable, to_f32};
use crate::layout::Symmetry;
use crate::model::{IntervalOf, Model};
use crate::space::InputSpace;
use crate::table::{
    BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H, cell_center, cell_index, cell_indices,
};

/// Sigma is computed at every `STEP`-th cell along each axis and interpolated between: it costs `n^2` a point and
/// varies slowly.
const STEP: usize = 3;

/// The predictive mean of every cell. In the warped box all cells of a column that are below the horizon are alike, and
/// of a bilateral model both halves of `phi_d`: 0.56 M predictions instead of 1.46 M.
pub(super) fn bake_mean(model: &Model) -> BrdfTable {
    let warped = matches!(model.space, InputSpace::WarpedBox { .. });
    let columns = if is_bilateral(model) { N_PHI_D / 2 } else { N_PHI_D };
    let mut mean = vec![[0.0f32; 3]; N_CELLS];
    // A slab at a time, so that the points stay few.
    for (i, slab) in mean.chunks_mut(SLAB).enumerate() {
        let mut angles: Vec<HalfDiff> = Vec::with_capacity(SLAB);
        // For each column, where its predictions start.
        let mut starts = Vec::with_capacity(columns + 1);
        for p in 0..columns {
            starts.push(angles.len());
            for d in 0..N_THETA_D {
                let center = cell_center(i, d, p);
                angles.push(center);
                if warped && !center.is_above_horizon() {
                    break;
                }
            }
        }
        starts.push(angles.len());
        let values = model.predict_mean(&angles);
        for p in 0..N_PHI_D {
            let column = if columns == N_PHI_D { p } else { p.min(N_PHI_D - 1 - p) };
            let values = &values[starts[column]..starts[column + 1]];
            for d in 0..N_THETA_D {
                slab[cell_index(0, d, p)] = values[d.min(values.len() - 1)].map(to_f32);
            }
        }
    }
    BrdfTable::from_cells(mean)
}

/// Whether `phi_d` and `pi - phi_d` are alike.
fn is_bilateral(model: &Model) -> bool {
    matches!(model.space, InputSpace::WarpedBox { symmetry: Symmetry::Bilateral, .. })
}

/// Latent standard deviation of every cell, by trilinear interpolation between the middles of blocks of
/// `STEP^3` cells: `30 x 30 x 60` points, or half as many for a bilateral model. One plane a process of the model.
pub(super) fn bake_sigma(model: &Model) -> SigmaTable {
    let bilateral = is_bilateral(model);
    let shape = [N_THETA_H / STEP, N_THETA_D / STEP, N_PHI_D / STEP / if bilateral { 2 } else { 1 }];
    let middle = |knot: usize| knot * STEP + STEP / 2;
    let knots: Vec<HalfDiff> = (0..shape.iter().product())
        .map(|i| {
            let (h, d, p) = (i / (shape[1] * shape[2]), i / shape[2] % shape[1], i % shape[2]);
            cell_center(middle(h), middle(d), middle(p))
        })
        .collect();
    let variances = model.predict_variance(&knots, IntervalOf::Latent);
    let planes = model.first_channels().into_iter().map(|channel| {
        let sigma: Vec<f64> = variances.iter().map(|v| v[channel].sqrt()).collect();
        (0..N_CELLS)
            .into_par_iter()
            .map(|cell| {
                let (h, d, mut p) = cell_indices(cell);
                if bilateral {
                    p = p.min(N_PHI_D - 1 - p);
                }
                let axes = [between(h, shape[0]), between(d, shape[1]), between(p, shape[2])];
                let mut sum = 0.0;
                for corner in 0..8usize {
                    let pick = |k: usize| {
                        let (low, weight) = axes[k];
                        if corner >> k & 1 == 0 {
                            (low, 1.0 - weight)
                        } else {
                            ((low + 1).min(shape[k] - 1), weight)
                        }
                    };
                    let ((h, a), (d, b), (p, c)) = (pick(0), pick(1), pick(2));
                    sum += a * b * c * sigma[(h * shape[1] + d) * shape[2] + p];
                }
                to_f32(sum)
            })
            .collect()
    });
    SigmaTable { planes: planes.collect() }
}

/// The knot below a cell and the weight of the one above; the ends are held.
fn between(cell: usize, knots: usize) -> (usize, f64) {
    let x = (cell as f64 - (STEP / 2) as f64) / STEP as f64;
    let x = x.clamp(0.0, (knots - 1) as f64);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "x lies within [0, knots - 1]"
    )]
    let low = x as usize;
    (low, x - low as f64)
}
