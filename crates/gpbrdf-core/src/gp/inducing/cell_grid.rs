//! All valid cells of a table, resampled on a full grid in the warped box.
//!
//! A column of a table, the cells along `theta_d` of one `(i_theta_h, i_phi_d)`, ends at its own
//! `theta_d_max`. Each column is therefore resampled at evenly spaced `v = theta_d / theta_d_max`, by linear
//! interpolation of its targets and with at least one point per cell. On the resulting full grid, a product
//! of functions of `u`, `v` and `phi` is a product as well. Other things being equal, a point's weight is
//! proportional to the number of valid cells of its column, so resampling does not favour short columns.

use std::f64::consts::FRAC_PI_2;

use rayon::prelude::*;

use crate::base::error::{Error, Result};
use crate::brdf::Rgb;
use crate::brdf::angles::GRAZING_COSINE;
use crate::brdf::angles::{HalfDiff, theta_d_max};
use crate::brdf::table::{BrdfTable, N_PHI_D, N_THETA_D, N_THETA_H, cell_center, cell_index};
use crate::sample::symmetry::Symmetry;
use crate::sample::target::Transform;

/// Weights of directions whose cosine is below [`GRAZING_COSINE`], which are black in pictures, fall off to
/// this share towards the horizon.
const GRAZING_SHARE: f64 = 0.02;

/// Targets and weights of a table on the grid `[u][v][phi]`.
#[derive(Clone, Debug)]
pub(crate) struct CellGrid {
    /// `sqrt(theta_h / (pi/2))` of the slabs.
    pub(crate) u: Vec<f64>,
    /// `theta_d / theta_d_max` of the rows.
    pub(crate) v: Vec<f64>,
    /// `phi_d` of the points of a row.
    pub(crate) phi: Vec<f64>,
    /// Targets of each channel, prior mean included.
    pub(crate) targets: [Vec<f64>; 3],
    /// Weight of each point; the weights add up to `cells`.
    pub(crate) weights: Vec<f64>,
    /// The part of each weight that measures how much the point shows in pictures.
    pub(crate) shown: Vec<f64>,
    /// Number of valid cells of the table.
    pub(crate) cells: usize,
}

/// One point of a column.
struct Point {
    target: Rgb,
    even: f64,
    picture: f64,
}

impl CellGrid {
    /// Resamples a table. The share `picture` of the total weight is distributed by how much each point shows
    /// in a picture, the rest evenly over all cells except grazing ones, which get less.
    ///
    /// # Errors
    /// A table without data above the horizon, or with values that are not finite.
    pub(crate) fn new(
        table: &BrdfTable,
        symmetry: Symmetry,
        transform: Transform,
        picture: f64,
    ) -> Result<Self> {
        let rows = if symmetry == Symmetry::Bilateral { N_PHI_D / 2 } else { N_PHI_D };
        let columns: Vec<(Vec<Point>, usize)> = (0..N_THETA_H * rows)
            .into_par_iter()
            .map(|k| column(table, symmetry, transform, k / rows, k % rows))
            .collect::<Result<_>>()?;
        let cells = columns.iter().map(|(_, cells)| cells).sum();
        if cells == 0 {
            return Err(Error::argument("table", "data in at least one cell above the horizon", "none"));
        }
        let total = |weight: fn(&Point) -> f64| -> f64 {
            columns.iter().map(|(points, _)| points.iter().map(weight).sum::<f64>()).sum()
        };
        let (even, shown) = (total(|p| p.even), total(|p| p.picture));
        let picture = if shown > 0.0 { picture } else { 0.0 };
        let scale = cells as f64;
        let size = N_THETA_H * N_THETA_D * rows;
        let mut grid = Self {
            u: (0..N_THETA_H).map(|i| (i as f64 + 0.5) / N_THETA_H as f64).collect(),
            v: (0..N_THETA_D).map(|l| (l as f64 + 0.5) / N_THETA_D as f64).collect(),
            phi: (0..rows).map(|j| cell_center(0, 0, j).phi_d).collect(),
            targets: std::array::from_fn(|_| vec![0.0; size]),
            weights: vec![0.0; size],
            shown: vec![0.0; size],
            cells,
        };
        for (k, (points, _)) in columns.iter().enumerate() {
            for (l, point) in points.iter().enumerate() {
                let at = (k / rows * N_THETA_D + l) * rows + k % rows;
                if shown > 0.0 {
                    grid.shown[at] = scale * picture * point.picture / shown;
                }
                grid.weights[at] = scale * (1.0 - picture) * point.even / even + grid.shown[at];
                (0..3).for_each(|c| grid.targets[c][at] = point.target[c]);
            }
        }
        Ok(grid)
    }

    /// The grid with every third `v` and every fifth `phi`: a search on it costs a fifteenth.
    pub(crate) fn decimated(&self) -> Self {
        let (step_v, step_phi) = (3, 5);
        let thin =
            |x: &[f64], step: usize| x.iter().copied().skip(step / 2).step_by(step).collect::<Vec<_>>();
        let (rows, plane) = (self.phi.len(), self.v.len() * self.phi.len());
        let pick = |x: &[f64]| {
            let mut out = Vec::with_capacity(x.len() / (step_v * step_phi) + 1);
            for slab in x.chunks(plane) {
                for row in slab.chunks(rows).skip(step_v / 2).step_by(step_v) {
                    out.extend(row.iter().skip(step_phi / 2).step_by(step_phi));
                }
            }
            out
        };
        Self {
            u: self.u.clone(),
            v: thin(&self.v, step_v),
            phi: thin(&self.phi, step_phi),
            targets: self.targets.each_ref().map(|t| pick(t)),
            weights: pick(&self.weights),
            shown: pick(&self.shown),
            cells: self.cells,
        }
    }
}

/// The points of one column, and its number of valid cells. A column without valid cells has no points.
fn column(
    table: &BrdfTable,
    symmetry: Symmetry,
    transform: Transform,
    i: usize,
    j: usize,
) -> Result<(Vec<Point>, usize)> {
    let mirror = N_PHI_D - 1 - j;
    let sides = if symmetry == Symmetry::Bilateral { vec![j, mirror] } else { vec![j] };
    // Position along theta_d in units of cells, and the target averaged over the mirrored cells.
    let mut known: Vec<(f64, Rgb)> = Vec::with_capacity(N_THETA_D);
    let mut cells = 0;
    for l in 0..N_THETA_D {
        if !cell_center(i, l, j).is_above_horizon() {
            continue;
        }
        let mut sum = [0.0; 3];
        let mut count = 0usize;
        for &side in &sides {
            let value = table.values()[cell_index(i, l, side)];
            if let Some(bad) = value.iter().find(|x| !x.is_finite()) {
                let found = format!("{bad} in cell ({i}, {l}, {side})");
                return Err(Error::argument("table", "finite values", found));
            }
            if value.iter().all(|&x| x >= 0.0) {
                (0..3).for_each(|c| sum[c] += transform.forward(f64::from(value[c])));
                count += 1;
            }
        }
        if count > 0 {
            known.push((l as f64, sum.map(|s| s / count as f64)));
            cells += count;
        }
    }
    if known.is_empty() {
        return Ok((Vec::new(), 0));
    }
    let center = cell_center(i, 0, j);
    let limit = theta_d_max(center.theta_h, center.phi_d);
    let mut upper = 0;
    let points = (0..N_THETA_D).map(|l| {
        let theta_d = (l as f64 + 0.5) / N_THETA_D as f64 * limit;
        let at = theta_d / FRAC_PI_2 * N_THETA_D as f64 - 0.5;
        while upper < known.len() && known[upper].0 < at {
            upper += 1;
        }
        let (low, high) = (known[upper.saturating_sub(1)], known[upper.min(known.len() - 1)]);
        let t = if high.0 > low.0 { ((at - low.0) / (high.0 - low.0)).clamp(0.0, 1.0) } else { 0.0 };
        let target = std::array::from_fn(|c| low.1[c] + t * (high.1[c] - low.1[c]));
        let angles = HalfDiff { theta_d, ..center };
        let share = cells as f64 / sides.len() as f64;
        Point {
            target,
            even: share * even_weight(angles),
            picture: share * picture_weight(angles, target, transform),
        }
    });
    Ok((points.collect(), cells))
}

/// The weight of a point regardless of its brightness: 1, and less near the horizon, where pictures are black
/// and metrics leave cells out.
fn even_weight(angles: HalfDiff) -> f64 {
    let (cos_i, cos_o) = angles.cosines();
    (cos_i.min(cos_o) / GRAZING_COSINE).clamp(GRAZING_SHARE, 1.0)
}

/// How much an error of the target shows in a picture: the measure of the pairs of light and view directions,
/// `cos_i cos_o sin(theta_h) sin(theta_d) cos(theta_d) u` (W. Matusik et al. 2003 for the measure of
/// half-difference angles, with `d theta_h = pi u du`), times `df / dg`, which is larger where the material
/// is brighter.
fn picture_weight(angles: HalfDiff, target: Rgb, transform: Transform) -> f64 {
    let (cos_i, cos_o) = angles.cosines();
    let u = (angles.theta_h / FRAC_PI_2).sqrt();
    let measure = cos_i.max(0.0)
        * cos_o.max(0.0)
        * angles.theta_h.sin()
        * u
        * angles.theta_d.sin()
        * angles.theta_d.cos();
    measure * target.map(|g| transform.slope_of_inverse(g)).iter().sum::<f64>() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_hold_the_targets_and_weights_add_up() {
        // The table is linear in theta_d, so resampling is exact between the outermost cells of a column.
        let table = BrdfTable::from_fn(|a| [1.0 + a.theta_d, 2.0 + a.theta_h, 3.0 + a.phi_d]);
        for symmetry in [Symmetry::Bilateral, Symmetry::Reciprocal] {
            let grid = CellGrid::new(&table, symmetry, Transform::Identity, 0.5).unwrap();
            assert_eq!(grid.cells, 1_096_216);
            assert!((grid.weights.iter().sum::<f64>() / grid.cells as f64 - 1.0).abs() < 1e-9);
            let rows = grid.phi.len();
            for (at, &weight) in grid.weights.iter().enumerate().step_by(1013) {
                let (i, l, j) = (at / (N_THETA_D * rows), at / rows % N_THETA_D, at % rows);
                let theta_h = grid.u[i].powi(2) * FRAC_PI_2;
                let limit = theta_d_max(theta_h, grid.phi[j]);
                let mid = FRAC_PI_2 / N_THETA_D as f64;
                if weight > 0.0 && grid.v[l] * limit > mid && grid.v[l] * limit < limit - mid {
                    assert!((grid.targets[0][at] - 1.0 - grid.v[l] * limit).abs() < 1e-6);
                    assert!((grid.targets[1][at] - 2.0 - theta_h).abs() < 1e-6);
                }
            }
            let thin = grid.decimated();
            assert_eq!(thin.weights.len(), thin.u.len() * thin.v.len() * thin.phi.len());
            assert_eq!(thin.v[0], grid.v[1]);
        }
    }

    #[test]
    fn gaps_are_bridged_and_broken_tables_refused() {
        let whole = BrdfTable::from_fn(|a| [1.0 + a.theta_d; 3]);
        let mut values = whole.values().to_vec();
        for value in values.iter_mut().step_by(7) {
            value[1] = -1.0;
        }
        let gaps = BrdfTable::from_values(values.clone()).unwrap();
        let grid = CellGrid::new(&gaps, Symmetry::Reciprocal, Transform::Identity, 0.0).unwrap();
        assert!(grid.cells < 1_000_000 && grid.weights.iter().all(|w| w.is_finite()));
        values[cell_index(3, 4, 5)] = [f32::NAN; 3];
        let broken = BrdfTable::from_values(values).unwrap();
        let refused = CellGrid::new(&broken, Symmetry::Reciprocal, Transform::Identity, 0.0);
        assert!(refused.unwrap_err().to_string().contains("(3, 4, 5)"));
        let empty = BrdfTable::from_fn(|_| [-1.0; 3]);
        assert!(CellGrid::new(&empty, Symmetry::Bilateral, Transform::default(), 0.5).is_err());
    }
}
