//! The trilinear lookup of a table in single precision, for one pair of directions or for many.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::base::trigonometry::atan2_upper;
use crate::brdf::{N_PHI_D, N_THETA_D, N_THETA_H};

/// Pairs of directions whose coordinates are computed together.
pub(crate) const LANES: usize = 32;

/// `N` directions, component by component.
pub(crate) type Lanes<const N: usize> = [[f32; N]; 3];

const LAST_H: f32 = N_THETA_H as f32 - 1.0;
const LAST_D: f32 = N_THETA_D as f32 - 1.0;

/// Positions in the table of `N` pairs of unit directions above the horizon, in units of cells from the centre of the
/// first one: `90 sqrt(theta_h / (pi/2)) - 1/2` and `90 theta_d / (pi/2) - 1/2` within `[0, 89]`, and
/// `180 phi_d / pi - 1/2` within `[-1/2, 179.5]`.
///
/// With `s = wi + wo` and `d = wi - wo`: `theta_h = atan2(|s_xy|, s_z)`, `theta_d = atan2(|d|, |s|)` and
/// `phi_d = atan2(s_x d_y - s_y d_x, -|s| d_z)`. The last one is `Ry(-theta_h) Rz(-phi_h) d`, whose `x` component is
/// `-d_z / sin theta_h` since `d` is perpendicular to `s`; so nothing cancels where the directions are close.
#[inline(always)]
pub(crate) fn positions<const N: usize>(wi: &Lanes<N>, wo: &Lanes<N>) -> Lanes<N> {
    let mut out = [[0.0; N]; 3];
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
        let h = if h > 0.0 { h } else { 0.0 };
        let d = if d > 0.0 { d } else { 0.0 };
        out[0][k] = if h < LAST_H { h } else { LAST_H };
        out[1][k] = if d < LAST_D { d } else { LAST_D };
        out[2][k] = phi_d * (N_PHI_D as f32 / PI) - 0.5;
    }
    out
}

/// The integer part of a position and the rest.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "positions are small and not negative"
)]
fn split(position: f32) -> (usize, f32) {
    let low = position as u32;
    (low as usize, position - low as f32)
}

/// The value of a table without gaps at a position of [`positions`], sr^-1.
#[inline(always)]
pub(crate) fn interpolate(values: &[[f32; 3]], h: f32, d: f32, p: f32) -> [f32; 3] {
    let (h0, wh) = split(h);
    let (d0, wd) = split(d);
    let (p0, wp) = split(if p < 0.0 { p + N_PHI_D as f32 } else { p });
    let (h0, d0, p0) = (h0.min(N_THETA_H - 1), d0.min(N_THETA_D - 1), p0.min(N_PHI_D - 1));
    let h1 = (h0 + 1).min(N_THETA_H - 1);
    let d1 = (d0 + 1).min(N_THETA_D - 1);
    let p1 = if p0 == N_PHI_D - 1 { 0 } else { p0 + 1 };
    let row = |h: usize, d: usize| {
        let (a, b) = (values[(h * N_THETA_D + d) * N_PHI_D + p0], values[(h * N_THETA_D + d) * N_PHI_D + p1]);
        mix(a, b, wp)
    };
    mix(mix(row(h0, d0), row(h0, d1), wd), mix(row(h1, d0), row(h1, d1), wd), wh)
}

#[inline(always)]
fn mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t]
}
