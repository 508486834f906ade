//! Evaluation, sampling and density of `N` pairs of directions at a time: one for a single call, [`LANES`] for many.
//!
//! Loops over the lanes of a block become vector instructions where they are compiled for a processor that has them,
//! and round like single calls.

use super::density::Views;
use super::half_vector::HalfVectorSquare;
use super::lookup::{Cells, LANES, Lanes, interpolate};
use super::{COSINE_SHARE, Material};
use crate::base::trigonometry::sin_cos_upper;

/// What [`Material::sample`] draws, for `N` outgoing directions. Rounding can leave a direction at or below the
/// horizon.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawn<const N: usize> {
    pub(crate) wi: Lanes<N>,
    pub(crate) weight: [[f32; 3]; N],
    pub(crate) pdf: [f32; N],
}

/// The components of up to [`LANES`] directions. Lanes that no direction fills hold the normal.
#[inline(always)]
pub(crate) fn lanes(directions: &[[f32; 3]]) -> Lanes<LANES> {
    let mut out = [[0.0; LANES], [0.0; LANES], [1.0; LANES]];
    for (k, direction) in directions.iter().enumerate() {
        out.iter_mut().zip(direction).for_each(|(lane, &x)| lane[k] = x);
    }
    out
}

/// One lane.
#[inline(always)]
fn lane<const N: usize>(lanes: &Lanes<N>, k: usize) -> [f32; 3] {
    [lanes[0][k], lanes[1][k], lanes[2][k]]
}

impl Material {
    /// `f` of pairs above the horizon; anything for others.
    #[inline(always)]
    pub(crate) fn eval_block<const N: usize>(&self, wi: &Lanes<N>, wo: &Lanes<N>) -> [[f32; 3]; N] {
        let mut f = interpolate(self.table.values(), &Cells::new(wi, wo));
        for k in 0..N {
            f[k] = self.reflected.conserve(f[k], wi[2][k], wo[2][k]);
        }
        f
    }

    /// The density at pairs above the horizon; anything for others.
    #[inline(always)]
    pub(crate) fn pdf_block<const N: usize>(&self, wi: &Lanes<N>, wo: &Lanes<N>) -> [f32; N] {
        let [mut rows, mut columns, mut per_steradian] = [[0.0; N]; 3];
        for k in 0..N {
            let wo = lane(wo, k);
            let point = HalfVectorSquare::new(wo).point(lane(wi, k), wo);
            (rows[k], columns[k], per_steradian[k]) = (point.row, point.column, point.per_steradian);
        }
        let mut pdf = self.densities.at(&Views::new(&wo[2]), &rows, &columns);
        for k in 0..N {
            pdf[k] = mixed(pdf[k] * per_steradian[k], wi[2][k]);
        }
        pdf
    }

    /// Directions to the light for outgoing directions above the horizon, each drawn by two numbers.
    #[inline(always)]
    pub(crate) fn sample_block<const N: usize>(&self, wo: &Lanes<N>, u: &[[f32; N]; 2]) -> Drawn<N> {
        let views = Views::new(&wo[2]);
        let [mut of_cosine, mut of_table, mut v, mut side] = [[0.0; N]; 4];
        for k in 0..N {
            let (first, second) = (unit(u[0][k]), unit(u[1][k]));
            // Numbers from 1 on belong to the table.
            of_cosine[k] = first / COSINE_SHARE;
            of_table[k] = ((first - COSINE_SHARE) / (1.0 - COSINE_SHARE)).max(0.0);
            // The second number also chooses the side of the plane of incidence.
            (side[k], v[k]) = if second < 0.5 { (1.0, 2.0 * second) } else { (-1.0, 2.0 * second - 1.0) };
        }
        let (mut rows, mut columns) = self.densities.draw(&views, &of_table, &v);
        let [mut x, mut y, mut z, mut per_steradian] = [[0.0; N]; 4];
        for k in 0..N {
            let square = HalfVectorSquare::new(lane(wo, k));
            ([x[k], y[k], z[k]], per_steradian[k]) = square.direction(rows[k], columns[k], side[k]);
        }
        // In a block of many there are always some that are drawn by the cosine.
        if of_cosine.iter().any(|u| *u < 1.0) {
            for k in 0..N {
                let chosen = of_cosine[k] < 1.0;
                let u = if chosen { of_cosine[k] } else { 0.0 };
                let (wo, wi) = (lane(wo, k), cosine_direction(u, v[k], side[k]));
                let point = HalfVectorSquare::new(wo).point(wi, wo);
                let or = |cosine: f32, table: f32| if chosen { cosine } else { table };
                (x[k], y[k], z[k]) = (or(wi[0], x[k]), or(wi[1], y[k]), or(wi[2], z[k]));
                (rows[k], columns[k]) = (or(point.row, rows[k]), or(point.column, columns[k]));
                per_steradian[k] = or(point.per_steradian, per_steradian[k]);
            }
        }
        let wi = [x, y, z];
        let mut pdf = self.densities.at(&views, &rows, &columns);
        let mut weight = self.eval_block(&wi, wo);
        for k in 0..N {
            pdf[k] = mixed(pdf[k] * per_steradian[k], wi[2][k]);
            let scale = wi[2][k] / pdf[k];
            weight[k] = weight[k].map(|f| f * scale);
        }
        Drawn { wi, weight, pdf }
    }
}

/// The density of a mixture with [`COSINE_SHARE`].
#[inline(always)]
fn mixed(of_table: f32, cosine: f32) -> f32 {
    (1.0 - COSINE_SHARE) * of_table + (COSINE_SHARE / std::f32::consts::PI) * cosine
}

/// A direction with the density `cos theta / pi`, by two uniform numbers, on one side of the plane of `x` and `z`.
#[inline(always)]
fn cosine_direction(u: f32, v: f32, side: f32) -> [f32; 3] {
    let (sine, cosine) = sin_cos_upper(v * std::f32::consts::PI);
    let radius = u.sqrt();
    [radius * cosine, side * radius * sine, (1.0 - u).sqrt()]
}

/// A number within `[0, 1)`; NaN becomes 0.
#[inline(always)]
fn unit(u: f32) -> f32 {
    if u > 0.0 { u.min(1.0 - f32::EPSILON / 2.0) } else { 0.0 }
}
