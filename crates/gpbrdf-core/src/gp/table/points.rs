//! Predictive mean and sigma of any posterior on the whole table, evaluated direction by direction.

use rayon::prelude::*;

use crate::base::error::Result;
use crate::base::watch::Watch;
use crate::brdf::angles::HalfDiff;
use crate::brdf::table::{
    N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H, SLAB, cell_center, cell_index, cell_indices, mirrored_column,
    trilinear_corners,
};
use crate::gp::posterior::Posterior;
use crate::gp::table::{MeanTable, to_f32};

/// Sigma is computed in every `STEP`-th cell along each axis and interpolated between them, because it costs
/// `n^2` per point and varies slowly.
const STEP: usize = 3;

/// The number of means and of variances per thread that are predicted before somebody may stop the work: 0.1 s for
/// 40,000 samples. Predictions do not depend on it.
const MEANS: usize = 512;
const VARIANCES: usize = 128;

/// The fewest values of the BRDF that a parallel task computes.
const MANY_VALUES: usize = 1024;

fn at_a_time(per_thread: usize) -> usize {
    per_thread * rayon::current_num_threads()
}

/// Writes the predictive mean of every cell. In the warped box all cells of a column that are below the
/// horizon have the same mean, and in a bilateral one both halves of `phi_d` do: this takes 0.56 million
/// predictions instead of 1.46 million.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled) where the observer stops the work.
pub(crate) fn bake_mean(
    posterior: &(impl Posterior + ?Sized),
    table: &mut MeanTable<'_>,
    watch: &Watch,
) -> Result<()> {
    let space = posterior.space();
    let columns = if space.is_bilateral() { N_PHI_D / 2 } else { N_PHI_D };
    let channels = posterior.n_channels();
    // One slab at a time, which limits the memory for points.
    for (i, slab) in table.cells.chunks_mut(SLAB).enumerate() {
        let mut angles: Vec<HalfDiff> = Vec::with_capacity(SLAB);
        // Index of the first prediction of each column.
        let mut starts = Vec::with_capacity(columns + 1);
        for p in 0..columns {
            starts.push(angles.len());
            for d in 0..N_THETA_D {
                let center = cell_center(i, d, p);
                angles.push(center);
                if space.stops_at_horizon() && !center.is_above_horizon() {
                    break;
                }
            }
        }
        starts.push(angles.len());
        let mut means = Vec::with_capacity(angles.len() * channels);
        for some in angles.chunks(at_a_time(MEANS)) {
            let share = means.len() as f64 / (angles.len() * channels) as f64;
            watch.reach((i as f64 + share) / N_THETA_H as f64)?;
            means.extend(posterior.predict_mean(some));
        }
        let value = |(at, mean): (usize, f64)| {
            to_f32(table.transform.inverse(table.offsets[table.first_channel + at % channels] + mean))
        };
        let values: Vec<f32> =
            means.into_par_iter().enumerate().with_min_len(MANY_VALUES).map(value).collect();
        for p in 0..N_PHI_D {
            let column = if columns == N_PHI_D { p } else { mirrored_column(p) };
            let values = &values[starts[column] * channels..starts[column + 1] * channels];
            let cells = values.len() / channels;
            for d in 0..N_THETA_D {
                let at = d.min(cells - 1) * channels;
                let cell = &mut slab[cell_index(0, d, p)];
                cell[table.first_channel..table.first_channel + channels]
                    .copy_from_slice(&values[at..at + channels]);
            }
        }
    }
    Ok(())
}

/// Latent standard deviation of every cell, by trilinear interpolation between the middles of blocks of
/// `STEP^3` cells: `30 x 30 x 60` points, or half as many in a bilateral space. Returns one plane per
/// variance.
///
/// # Errors
/// Those of [`Posterior::predict_variance`], and [`Error::Cancelled`](crate::Error::Cancelled) where the observer
/// stops the work.
pub(crate) fn bake_sigma(posterior: &(impl Posterior + ?Sized), watch: &Watch) -> Result<Vec<Vec<f32>>> {
    let bilateral = posterior.space().is_bilateral();
    let shape = [N_THETA_H / STEP, N_THETA_D / STEP, N_PHI_D / STEP / if bilateral { 2 } else { 1 }];
    let middle = |knot: usize| knot * STEP + STEP / 2;
    let knots: Vec<HalfDiff> = (0..shape.iter().product())
        .map(|i| {
            let (h, d, p) = (i / (shape[1] * shape[2]), i / shape[2] % shape[1], i % shape[2]);
            cell_center(middle(h), middle(d), middle(p))
        })
        .collect();
    let mut variances = Vec::with_capacity(knots.len() * posterior.n_variances());
    for some in knots.chunks(at_a_time(VARIANCES)) {
        watch.reach(variances.len() as f64 / (knots.len() * posterior.n_variances()) as f64)?;
        variances.extend(posterior.predict_variance(some)?);
    }
    let count = posterior.n_variances();
    let planes = (0..count).map(|variance| {
        let sigma: Vec<f64> = variances.iter().skip(variance).step_by(count).map(|v| v.sqrt()).collect();
        (0..N_CELLS)
            .into_par_iter()
            .map(|cell| {
                let (h, d, mut p) = cell_indices(cell);
                if bilateral {
                    p = mirrored_column(p);
                }
                let axes = [between(h, shape[0]), between(d, shape[1]), between(p, shape[2])];
                let at = |[h, d, p]: [usize; 3]| sigma[(h * shape[1] + d) * shape[2] + p];
                let sum = trilinear_corners(axes).iter().map(|&(knot, weight)| weight * at(knot)).sum();
                to_f32(sum)
            })
            .collect()
    });
    Ok(planes.collect())
}

/// Indices of the knots below and above a cell, and the weight of the knot above it. Beyond the outermost knots
/// the value is constant.
fn between(cell: usize, knots: usize) -> (usize, usize, f64) {
    let x = (cell as f64 - (STEP / 2) as f64) / STEP as f64;
    let x = x.clamp(0.0, (knots - 1) as f64);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "x lies within [0, knots - 1]"
    )]
    let low = x as usize;
    (low, (low + 1).min(knots - 1), x - low as f64)
}
