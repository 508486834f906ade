//! The table in the shape of the MERL database: 90 x 90 x 180 cells of RGB in half-difference angles.

use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::base::error::{Error, Result};
use crate::brdf::angles::{HalfDiff, fold_phi_d};
use crate::brdf::{Brdf, Rgb};

/// Cells along `theta_h`.
pub const N_THETA_H: usize = 90;
/// Cells along `theta_d`.
pub const N_THETA_D: usize = 90;
/// Cells along `phi_d`.
pub const N_PHI_D: usize = 180;
/// Cells of a table: 1,458,000.
pub const N_CELLS: usize = N_THETA_H * N_THETA_D * N_PHI_D;

/// Number of cells with the same `i_theta_h`; they are contiguous.
pub const SLAB: usize = N_THETA_D * N_PHI_D;

/// Position of a cell: `i_phi_d + 180 (i_theta_d + 90 i_theta_h)`.
#[must_use]
pub const fn cell_index(i_theta_h: usize, i_theta_d: usize, i_phi_d: usize) -> usize {
    i_phi_d + N_PHI_D * (i_theta_d + N_THETA_D * i_theta_h)
}

/// The three indices `(i_theta_h, i_theta_d, i_phi_d)` of a cell.
#[must_use]
pub const fn cell_indices(index: usize) -> (usize, usize, usize) {
    (index / (N_THETA_D * N_PHI_D), index / N_PHI_D % N_THETA_D, index % N_PHI_D)
}

/// The column in `0..90` that holds the same values as the column `i_phi_d` in a bilateral material: the
/// centres of the two columns are at `phi_d` and `pi - phi_d`.
#[must_use]
pub const fn mirrored_column(i_phi_d: usize) -> usize {
    let mirror = N_PHI_D - 1 - i_phi_d;
    if i_phi_d < mirror { i_phi_d } else { mirror }
}

/// The angles of a cell's centre: `theta_h = ((i + 1/2) / 90)^2 pi/2`, `theta_d = (i + 1/2) / 90 pi/2`,
/// `phi_d = (i + 1/2) / 180 pi`.
#[must_use]
pub fn cell_center(i_theta_h: usize, i_theta_d: usize, i_phi_d: usize) -> HalfDiff {
    let u = (i_theta_h as f64 + 0.5) / N_THETA_H as f64;
    HalfDiff {
        theta_h: u * u * FRAC_PI_2,
        theta_d: (i_theta_d as f64 + 0.5) / N_THETA_D as f64 * FRAC_PI_2,
        phi_d: (i_phi_d as f64 + 0.5) / N_PHI_D as f64 * PI,
    }
}

/// A BRDF tabulated like the MERL database (W. Matusik et al. 2003), with a value in sr^-1 for the centre of
/// each of 90 x 90 x 180 cells over (square-root warped `theta_h`, `theta_d`, `phi_d`).
///
/// A negative channel means that the cell has no data. The table takes 17.5 MB.
#[derive(Clone, Debug, PartialEq)]
pub struct BrdfTable {
    values: Vec<[f32; 3]>,
}

/// The eight cells and weights of one trilinear lookup.
///
/// It is computed once and then used for every table and channel.
#[derive(Clone, Copy, Debug)]
pub struct Trilinear {
    cells: [u32; 8],
    weights: [f32; 8],
}

impl Trilinear {
    /// The lookup at `angles`: linear in `(sqrt(theta_h / (pi/2)), theta_d, phi_d)` between cell centres,
    /// clamped in the first two coordinates, periodic in the third.
    #[must_use]
    pub fn new(angles: HalfDiff) -> Self {
        let (h0, h1, wh) = clamped((angles.theta_h.max(0.0) / FRAC_PI_2).sqrt(), N_THETA_H);
        let (d0, d1, wd) = clamped(angles.theta_d / FRAC_PI_2, N_THETA_D);
        let (p0, p1, wp) = periodic(fold_phi_d(angles.phi_d) / PI, N_PHI_D);
        let mut cells = [0; 8];
        let mut weights = [0.0; 8];
        let corners = trilinear_corners([(h0, h1, wh), (d0, d1, wd), (p0, p1, wp)]);
        for ((cell, weight), ([h, d, p], w)) in cells.iter_mut().zip(&mut weights).zip(corners) {
            #[expect(clippy::cast_possible_truncation, reason = "a table has 1,458,000 cells")]
            {
                *cell = cell_index(h, d, p) as u32;
                *weight = w as f32;
            }
        }
        Self { cells, weights }
    }

    /// The eight cells and their weights, which add up to 1.
    pub fn corners(&self) -> impl Iterator<Item = (usize, f32)> + '_ {
        self.cells.iter().zip(&self.weights).map(|(&cell, &weight)| (cell as usize, weight))
    }
}

/// The eight corners of a trilinear interpolation and their weights, from the lower node, the upper node and the weight
/// of the upper node along each axis.
pub(crate) fn trilinear_corners(axes: [(usize, usize, f64); 3]) -> [([usize; 3], f64); 8] {
    let ends = axes.map(|(low, high, weight)| [(low, 1.0 - weight), (high, weight)]);
    std::array::from_fn(|corner| {
        let [(h, a), (d, b), (p, c)] = [ends[0][corner >> 2], ends[1][corner >> 1 & 1], ends[2][corner & 1]];
        ([h, d, p], a * b * c)
    })
}

/// The lower node, the upper node and the weight of the upper one at `t`, for `n` cell centres over `[0, 1]`.
/// Beyond the outermost centres `t` is clamped.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "x lies within [0, n - 1]")]
fn clamped(t: f64, n: usize) -> (usize, usize, f64) {
    // max comes before min, so that NaN becomes 0.
    let x = (t * n as f64 - 0.5).max(0.0).min((n - 1) as f64);
    let low = x as usize;
    (low, (low + 1).min(n - 1), x - low as f64)
}

/// Like [`clamped`], but periodic: the last centre is followed by the first.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "x lies within [0, n)")]
fn periodic(t: f64, n: usize) -> (usize, usize, f64) {
    let x = (t * n as f64 - 0.5).rem_euclid(n as f64);
    let low = (x as usize).min(n - 1);
    (low, (low + 1) % n, x - low as f64)
}

impl BrdfTable {
    /// A table of `values` in MERL order ([`cell_index`]).
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] unless there are [`N_CELLS`] values.
    pub fn from_values(values: Vec<[f32; 3]>) -> Result<Self> {
        if values.len() == N_CELLS {
            Ok(Self { values })
        } else {
            Err(Error::argument("cells of a table", N_CELLS.to_string(), values.len()))
        }
    }

    /// A table of values in MERL order; the caller makes sure that there are [`N_CELLS`] of them.
    pub(crate) fn from_cells(values: Vec<[f32; 3]>) -> Self {
        debug_assert_eq!(values.len(), N_CELLS);
        Self { values }
    }

    /// Tabulates `f` at every cell's centre, in parallel.
    pub fn from_fn(f: impl Fn(HalfDiff) -> Rgb + Sync) -> Self {
        let values = (0..N_CELLS)
            .into_par_iter()
            .map(|index| {
                let (h, d, p) = cell_indices(index);
                to_f32(f(cell_center(h, d, p)))
            })
            .collect();
        Self { values }
    }

    /// The values in MERL order, sr^-1.
    #[must_use]
    pub fn values(&self) -> &[[f32; 3]] {
        &self.values
    }

    /// The values in MERL order, sr^-1, for code that keeps them.
    #[must_use]
    pub fn into_values(self) -> Vec<[f32; 3]> {
        self.values
    }

    /// The value of one cell, sr^-1.
    #[must_use]
    pub fn cell(&self, i_theta_h: usize, i_theta_d: usize, i_phi_d: usize) -> [f32; 3] {
        self.values[cell_index(i_theta_h, i_theta_d, i_phi_d)]
    }

    /// The table without gaps: a cell without data takes the value of the nearest smaller `theta_d` that has
    /// data, else of the nearest larger one. Where a whole column has no data, it becomes zero.
    #[must_use]
    pub fn filled(&self) -> Cow<'_, Self> {
        let missing = |value: &[f32; 3]| !value.iter().all(|&x| x >= 0.0);
        if !self.values.iter().any(missing) {
            return Cow::Borrowed(self);
        }
        let mut values = self.values.clone();
        for h in 0..N_THETA_H {
            for p in 0..N_PHI_D {
                let along = |d: usize| cell_index(h, d, p);
                for d in 1..N_THETA_D {
                    if missing(&values[along(d)]) {
                        values[along(d)] = values[along(d - 1)];
                    }
                }
                for d in (0..N_THETA_D - 1).rev() {
                    if missing(&values[along(d)]) {
                        values[along(d)] = values[along(d + 1)];
                    }
                }
                // The cell is still missing only if its whole column is.
                if missing(&values[along(0)]) {
                    (0..N_THETA_D).for_each(|d| values[along(d)] = [0.0; 3]);
                }
            }
        }
        Cow::Owned(Self { values })
    }

    /// Whether any cell with a positive weight in the lookup has data.
    fn has_data(&self, at: &Trilinear) -> bool {
        let data = |cell: usize| self.values[cell].iter().all(|&x| x >= 0.0);
        at.corners().any(|(cell, weight)| weight > 0.0 && data(cell))
    }

    /// Trilinear interpolation, sr^-1. Cells without data (a negative channel) are left out, and the weights
    /// of the others are scaled up to a sum of 1. Zero where none of the eight cells has data.
    #[must_use]
    pub fn lookup(&self, at: &Trilinear) -> [f32; 3] {
        let mut sum = [0.0f32; 3];
        let mut total = 0.0;
        for (cell, weight) in at.corners() {
            let value = self.values[cell];
            if value.iter().all(|&x| x >= 0.0) {
                total += weight;
                for c in 0..3 {
                    sum[c] += weight * value[c];
                }
            }
        }
        if total > 0.0 { sum.map(|x| x / total) } else { [0.0; 3] }
    }
}

impl Brdf for BrdfTable {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return [0.0; 3];
        }
        self.eval_half_diff(HalfDiff::from_directions(wi, wo))
    }

    /// Trilinear interpolation. Measured tables have gaps near the horizon: where none of the eight cells has
    /// data, the value at the nearest smaller `theta_d` that has data is used, or zero if there is none.
    /// Angles below the horizon are looked up like any others.
    fn eval_half_diff(&self, angles: HalfDiff) -> Rgb {
        let step = FRAC_PI_2 / N_THETA_D as f64;
        let mut at = angles;
        loop {
            let lookup = Trilinear::new(at);
            if self.has_data(&lookup) || !(at.theta_d > 0.0) {
                return self.lookup(&lookup).map(f64::from);
            }
            at.theta_d = (at.theta_d - step).max(0.0);
        }
    }
}

/// Rounds to the table's precision.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the table's precision")]
fn to_f32(rgb: Rgb) -> [f32; 3] {
    rgb.map(|x| x as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_round_trip_and_the_valid_count_is_the_published_one() {
        let mut valid = 0;
        for index in 0..N_CELLS {
            let (h, d, p) = cell_indices(index);
            assert_eq!(cell_index(h, d, p), index);
            valid += usize::from(cell_center(h, d, p).is_above_horizon());
        }
        assert_eq!(valid, 1_096_216);
    }

    #[test]
    fn lookup_returns_cells_at_their_centres_and_linear_functions_between() {
        let linear = |a: HalfDiff| {
            let u = (a.theta_h / FRAC_PI_2).sqrt();
            [1.0 + 2.0 * u, 1.0 + a.theta_d, 3.0 - u * a.theta_d]
        };
        let table = BrdfTable::from_fn(linear);
        for index in (0..N_CELLS).step_by(7919) {
            let (h, d, p) = cell_indices(index);
            let found = table.eval_half_diff(cell_center(h, d, p));
            for c in 0..3 {
                assert!((found[c] - f64::from(table.cell(h, d, p)[c])).abs() < 1e-6);
            }
        }
        for i in 1..500 {
            let t = i as f64 * 0.001_9;
            let angles = HalfDiff { theta_h: t, theta_d: 1.5 - t, phi_d: 3.3 * t };
            let expected = linear(angles);
            let found = table.eval_half_diff(angles);
            for c in 0..3 {
                assert!((found[c] - expected[c]).abs() < 2e-4, "{angles:?} {found:?} {expected:?}");
            }
        }
    }

    #[test]
    fn lookup_wraps_phi_d_skips_missing_cells_and_survives_nan() {
        let mut table = BrdfTable::from_fn(|a| [a.phi_d.sin(), 1.0, 2.0]);
        let near_zero = table.eval_half_diff(HalfDiff { theta_h: 0.1, theta_d: 0.1, phi_d: 1e-9 });
        assert!((near_zero[0] - (PI / 360.0).sin()).abs() < 1e-6);
        for value in &mut table.values[..N_CELLS / 2] {
            *value = [-1.0; 3];
        }
        assert_eq!(table.eval_half_diff(HalfDiff::default()), [0.0; 3]);
        let gap = HalfDiff { theta_h: 0.5, theta_d: 1.0, phi_d: 1.0 };
        let mut torn = BrdfTable::from_fn(|a| [a.theta_d, 1.0, 2.0]);
        for index in 0..N_CELLS {
            if cell_indices(index).1 >= 45 {
                torn.values[index] = [-1.0; 3];
            }
        }
        assert_eq!(torn.lookup(&Trilinear::new(gap)), [0.0; 3]);
        let filled = torn.eval_half_diff(gap)[0];
        assert!((filled - cell_center(0, 44, 0).theta_d).abs() < 1e-6, "{filled}");
        let whole = torn.filled();
        assert_eq!(whole.cell(7, 89, 3), torn.cell(7, 44, 3));
        assert_eq!(whole.cell(7, 10, 3), torn.cell(7, 10, 3));
        assert!(matches!(whole.filled(), Cow::Borrowed(_)));
        let empty = BrdfTable::from_fn(|_| [-1.0; 3]);
        assert_eq!(empty.filled().cell(5, 5, 5), [0.0; 3]);
        let edge = cell_center(44, 10, 10);
        let half = HalfDiff { theta_h: edge.theta_h * 1.01, ..edge };
        assert!((table.eval_half_diff(half)[1] - 1.0).abs() < 1e-6);
        let nan = HalfDiff { theta_h: f64::NAN, theta_d: f64::NAN, phi_d: f64::NAN };
        assert!(table.eval_half_diff(nan).iter().all(|x| !x.is_infinite()));
    }
}
