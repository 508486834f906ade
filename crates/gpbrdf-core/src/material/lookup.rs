//! The trilinear lookup of a table in single precision, for one pair of directions or for many.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::base::simd::{cell, index};
use crate::base::trigonometry::atan2_upper;
use crate::brdf::{N_PHI_D, N_THETA_D, N_THETA_H};

/// Pairs of directions whose cells are found together.
pub(crate) const LANES: usize = 64;

/// `N` directions, component by component.
pub(crate) type Lanes<const N: usize> = [[f32; N]; 3];

/// Numbers between neighbours along `theta_d` and along `theta_h`.
const ROW: usize = 3 * N_PHI_D;
const PLANE: usize = N_THETA_D * ROW;

/// The last azimuth from which two cells, and the two numbers that fill a vector register behind them, are inside the
/// row.
const LAST_IN_ROW: usize = N_PHI_D - 3;

/// Numbers that are read at once: two cells of three channels, and two numbers more.
const READ: usize = 8;

/// The eight cells about each of `N` pairs of directions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cells<const N: usize> {
    /// Index of the first number of the first cell along `theta_h` and `theta_d`, at the azimuth `column` or at
    /// [`LAST_IN_ROW`], whichever is smaller.
    first: [u32; N],
    column: [u32; N],
    /// How far the pair is from the first cells to the second ones, along `theta_h`, `theta_d` and `phi_d`.
    weights: Lanes<N>,
}

impl<const N: usize> Cells<N> {
    /// The cells of `N` pairs of unit directions above the horizon. Positions in units of cells from the centre of the
    /// first one are `90 sqrt(theta_h / (pi/2)) - 1/2` and `90 theta_d / (pi/2) - 1/2` within `[0, 89]`, and
    /// `180 phi_d / pi - 1/2`, which has the period 180.
    ///
    /// With `s = wi + wo` and `d = wi - wo`: `theta_h = atan2(|s_xy|, s_z)`, `theta_d = atan2(|d|, |s|)` and
    /// `phi_d = atan2(s_x d_y - s_y d_x, -|s| d_z)`. The last one is `Ry(-theta_h) Rz(-phi_h) d`, whose `x` component
    /// is `-d_z / sin theta_h` since `d` is perpendicular to `s`; so nothing cancels where the directions are close.
    #[inline(always)]
    pub(crate) fn new(wi: &Lanes<N>, wo: &Lanes<N>) -> Self {
        let mut out = Self { first: [0; N], column: [0; N], weights: [[0.0; N]; 3] };
        for k in 0..N {
            let (sx, sy, sz) = (wi[0][k] + wo[0][k], wi[1][k] + wo[1][k], wi[2][k] + wo[2][k]);
            let (dx, dy, dz) = (wi[0][k] - wo[0][k], wi[1][k] - wo[1][k], wi[2][k] - wo[2][k]);
            let across = sx * sx + sy * sy;
            let length = (across + sz * sz).sqrt();
            let theta_h = atan2_upper(across.sqrt(), sz);
            let theta_d = atan2_upper((dx * dx + dy * dy + dz * dz).sqrt(), length);
            let (y, x) = (sx * dy - sy * dx, -length * dz);
            // By reciprocity an azimuth and its opposite are the same.
            let phi_d = atan2_upper(y.abs(), if y < 0.0 { -x } else { x });
            let h = (theta_h * (1.0 / FRAC_PI_2)).sqrt() * N_THETA_H as f32 - 0.5;
            let d = theta_d * (N_THETA_D as f32 / FRAC_PI_2) - 0.5;
            let p = phi_d * (N_PHI_D as f32 / PI) - 0.5;
            let (h, along_h) = between_centres(h, N_THETA_H);
            let (d, along_d) = between_centres(d, N_THETA_D);
            let (p, along_p) = cell(if p < 0.0 { p + N_PHI_D as f32 } else { p }, index(N_PHI_D) - 1);
            let column = p.min(index(LAST_IN_ROW));
            out.first[k] = h * index(PLANE) + d * index(ROW) + 3 * column;
            out.column[k] = p;
            (out.weights[0][k], out.weights[1][k], out.weights[2][k]) = (along_h, along_d, along_p);
        }
        out
    }
}

/// The first of two of `count` cells whose centres are about a position, and how far from one centre to the other it
/// is. Positions beyond the outermost centres become these.
#[inline(always)]
fn between_centres(position: f32, count: usize) -> (u32, f32) {
    let last = count as f32 - 1.0;
    let position = if position > 0.0 { position } else { 0.0 };
    cell(if position < last { position } else { last }, index(count) - 2)
}

/// The values of a table without gaps, sr^-1.
///
/// The first loop does nothing but read and mix four rows of the table for each pair, so that the processor waits for
/// several pairs at a time.
#[inline(always)]
pub(crate) fn interpolate<const N: usize>(values: &[[f32; 3]], cells: &Cells<N>) -> [[f32; 3]; N] {
    let values = values.as_flattened();
    let [along_h, along_d, along_p] = &cells.weights;
    let mut rows = [[0.0; READ]; N];
    for k in 0..N {
        rows[k] = mix_of_rows(values, cells.first[k], along_h[k], along_d[k]);
    }
    let mut out = [[0.0; 3]; N];
    for k in 0..N {
        out[k] = if cells.column[k] <= index(LAST_IN_ROW) {
            let [r, g, b, ..] = rows[k];
            let [_, _, _, next @ .., _, _] = rows[k];
            mix([r, g, b], next, along_p[k])
        } else {
            // The last cells of a row, beyond which the first one follows.
            let start = cells.first[k] - 3 * index(LAST_IN_ROW);
            let cell_at = |p: u32| {
                let first = if p < index(N_PHI_D) { start + 3 * p } else { start };
                single(values, first, along_h[k], along_d[k])
            };
            mix(cell_at(cells.column[k]), cell_at(cells.column[k] + 1), along_p[k])
        };
    }
    out
}

/// [`READ`] numbers from an index on, mixed between two places along `theta_h` and two along `theta_d`.
#[inline(always)]
fn mix_of_rows(values: &[f32], first: u32, along_h: f32, along_d: f32) -> [f32; READ] {
    let near = &values[first as usize..first as usize + PLANE + ROW + READ];
    let at = |offset: usize| -> [f32; READ] { std::array::from_fn(|i| near[offset + i]) };
    mix(mix(at(0), at(ROW), along_d), mix(at(PLANE), at(PLANE + ROW), along_d), along_h)
}

/// One cell, mixed like [`mix_of_rows`].
#[cold]
fn single(values: &[f32], first: u32, along_h: f32, along_d: f32) -> [f32; 3] {
    let near = &values[first as usize..first as usize + PLANE + ROW + 3];
    let at = |offset: usize| -> [f32; 3] { std::array::from_fn(|i| near[offset + i]) };
    mix(mix(at(0), at(ROW), along_d), mix(at(PLANE), at(PLANE + ROW), along_d), along_h)
}

#[inline(always)]
fn mix<const M: usize>(a: [f32; M], b: [f32; M], t: f32) -> [f32; M] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
}
