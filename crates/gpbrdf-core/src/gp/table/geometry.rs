//! Kernel coordinates of a table's cells.

use std::f64::consts::FRAC_PI_2;

use rayon::prelude::*;

use crate::brdf::angles::horizon_theta_d;
use crate::brdf::table::{N_PHI_D, N_THETA_D, N_THETA_H, cell_center};
use crate::sample::space::{InputSpace, WarpedBox};
use crate::sample::symmetry::Symmetry;

/// The kernel coordinates of every cell's centre, stored as the factors from which they are computed. There
/// are no such factors in an isotropic space ([`InputSpace::ISOTROPIC`]), where only the number of distinct
/// cells is of use.
///
/// Cell `(i, l, p)` along `(theta_h, theta_d, phi_d)` has the coordinates `first[i]`,
/// `min(second[l] scale(i, p), limit)` and `third[row(p)]`. In the warped box all cells of a column `(i, p)`
/// that are below the horizon have the same coordinates, and where `phi_d` is folded its two halves have the
/// same ones: there are 0.56 million distinct points instead of 1.46 million.
#[derive(Clone, Debug, PartialEq)]
pub struct TableGeometry {
    first: Vec<f64>,
    second: Vec<f64>,
    third: Vec<f64>,
    /// `[i_theta_h][column]`.
    scale: Vec<f64>,
    /// Number of cells with coordinates of their own in each column, laid out like `scale`.
    distinct: Vec<usize>,
    limit: f64,
}

/// Number of distinct `|cos phi_d|` among the table's cells: `phi_d` and `pi - phi_d` share `theta_d_max`.
const COLUMNS: usize = N_PHI_D / 2;

/// A function of the `theta_d` of the horizon for each `(i_theta_h, column)`.
fn horizon(of: impl Fn(f64) -> f64 + Sync) -> Vec<f64> {
    let cosines: Vec<f64> = (0..COLUMNS).map(|p| cell_center(0, 0, p).phi_d.cos().abs()).collect();
    let row = |i: usize| {
        let (sin_h, cos_h) = cell_center(i, 0, 0).theta_h.sin_cos();
        cosines.iter().map(|cos_phi| of(horizon_theta_d(sin_h, cos_h, *cos_phi))).collect::<Vec<f64>>()
    };
    (0..N_THETA_H).into_par_iter().flat_map_iter(row).collect()
}

impl TableGeometry {
    /// The geometry of a process in `space`.
    #[must_use]
    pub fn new(space: InputSpace) -> Self {
        let theta_d = (0..N_THETA_D).map(|l| (l as f64 + 0.5) / N_THETA_D as f64 * FRAC_PI_2);
        let (second, scale, rows): (Vec<f64>, Vec<f64>, usize) = match space {
            InputSpace::WarpedBox(WarpedBox { v_density, symmetry, .. }) => {
                // v^(1/density) = theta_d^(1/density) theta_d_max^(-1/density).
                let exponent = v_density.recip();
                let rows = if symmetry == Symmetry::Bilateral { COLUMNS } else { N_PHI_D };
                let limits = horizon(|theta_d_max| theta_d_max.powf(-exponent));
                (theta_d.map(|t| t.powf(exponent)).collect(), limits, rows)
            }
            // v without a density says which cells are above the horizon.
            InputSpace::PolarAngles | InputSpace::DifferenceAngle | InputSpace::PlaneOfIncidence => {
                (theta_d.collect(), horizon(f64::recip), COLUMNS)
            }
            InputSpace::HalfDiff => (theta_d.collect(), vec![1.0; N_THETA_H * COLUMNS], N_PHI_D),
        };
        let limit = if space.stops_at_horizon() { 1.0 } else { f64::INFINITY };
        let above = |scale: &f64| second.iter().take_while(|x| **x * scale < limit).count();
        let distinct = scale.iter().map(|scale| (above(scale) + 1).min(N_THETA_D)).collect();
        let (first, third) = match space {
            InputSpace::WarpedBox(warped) => {
                let u = (0..N_THETA_H).map(|i| warped.warp_u((i as f64 + 0.5) / N_THETA_H as f64));
                let phi = (0..rows).map(|p| warped.warp_phi(cell_center(0, 0, p).phi_d));
                (u.collect(), phi.collect())
            }
            InputSpace::PolarAngles
            | InputSpace::DifferenceAngle
            | InputSpace::PlaneOfIncidence
            | InputSpace::HalfDiff => (
                (0..N_THETA_H).map(|i| cell_center(i, 0, 0).theta_h).collect(),
                (0..rows).map(|p| cell_center(0, 0, p).phi_d).collect(),
            ),
        };
        Self { first, second, third, scale, distinct, limit }
    }

    /// First coordinate of each `i_theta_h`.
    #[must_use]
    pub fn first(&self) -> &[f64] {
        &self.first
    }

    /// The factor of the second coordinate that depends on `i_theta_d`.
    #[must_use]
    pub fn second(&self) -> &[f64] {
        &self.second
    }

    /// Third coordinate of each row: there are 90 rows where `phi_d` is folded, else 180.
    #[must_use]
    pub fn third(&self) -> &[f64] {
        &self.third
    }

    /// The factor of the second coordinate that depends on `(i_theta_h, column)`: `[i_theta_h][90]`. `phi_d`
    /// and `pi - phi_d` belong to the same column.
    #[must_use]
    pub fn scale(&self) -> &[f64] {
        &self.scale
    }

    /// Number of cells of `(i_theta_h, column)` with coordinates of their own. The cells that follow along
    /// `theta_d` share the coordinates of the last of these. Laid out like [`TableGeometry::scale`].
    #[must_use]
    pub fn distinct(&self) -> &[usize] {
        &self.distinct
    }

    /// The largest value of the second coordinate: 1, the horizon, in the warped box; else infinity.
    #[must_use]
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// Second coordinates of the distinct cells of one column.
    pub(crate) fn column(&self, i_theta_h: usize, column: usize) -> impl Iterator<Item = f64> {
        let k = i_theta_h * COLUMNS + column;
        self.second[..self.distinct[k]].iter().map(move |x| (x * self.scale[k]).min(self.limit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::table::{N_CELLS, cell_indices};

    #[test]
    fn cells_stand_where_the_space_says() {
        for space in [
            InputSpace::WarpedBox(WarpedBox {
                density: 1.3,
                v_density: 0.65,
                symmetry: Symmetry::Bilateral,
                tail: 1.7,
                phi_density: 1.4,
            }),
            InputSpace::WarpedBox(WarpedBox {
                density: 1.0,
                v_density: 1.0,
                symmetry: Symmetry::Reciprocal,
                tail: 1.0,
                phi_density: 1.4,
            }),
            InputSpace::HalfDiff,
        ] {
            let geometry = TableGeometry::new(space);
            let rows = geometry.third().len();
            for cell in (0..N_CELLS).step_by(43) {
                let (i, l, p) = cell_indices(cell);
                let expected = space.coordinates(cell_center(i, l, p));
                let (column, row) =
                    (p.min(N_PHI_D - 1 - p), if rows == COLUMNS { p.min(N_PHI_D - 1 - p) } else { p });
                let along: Vec<f64> = geometry.column(i, column).collect();
                let found = [geometry.first()[i], along[l.min(along.len() - 1)], geometry.third()[row]];
                for k in 0..3 {
                    assert!(
                        (found[k] - expected[k]).abs() < 1e-13,
                        "{space:?} {cell} {found:?} {expected:?}"
                    );
                }
            }
        }
    }
}
