//! Directions, half-difference angles and the warped box.
//!
//! In the local frame the normal is `n = +z`; `wi` points to the light and `wo` to the viewer, both of unit
//! length and away from the surface. Half-difference angles are those of S. Rusinkiewicz, "A New Change of
//! Variables for Efficient BRDF Representation" (1998), with `phi_h` dropped (isotropy) and `phi_d` folded to
//! `[0, pi)` (reciprocity).

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;

use crate::base::error::{Error, Result};

/// Lower bound of cosines in denominators: smaller ones are replaced by it, so that quotients stay bounded.
pub const HORIZON_COSINE: f64 = 1e-6;

/// Metrics and their pictures leave out directions whose cosine is smaller, since measurements are
/// extrapolated there.
pub const GRAZING_COSINE: f64 = 0.08;

/// Half-difference angles in radians: `theta_h` and `theta_d` in `[0, pi/2]`, `phi_d` in `[0, pi)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HalfDiff {
    /// Angle between the normal and the half vector `h = (wi + wo) / |wi + wo|`.
    pub theta_h: f64,
    /// Angle between `h` and either direction.
    pub theta_d: f64,
    /// Azimuth of `wi` about `h`; zero in the plane of `n` and `h`.
    pub phi_d: f64,
}

impl HalfDiff {
    /// Whether all three angles are finite numbers.
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.theta_h.is_finite() && self.theta_d.is_finite() && self.phi_d.is_finite()
    }

    /// The angles of a pair of unit directions.
    ///
    /// `theta_h = atan2(|h_xy|, h_z)`, `theta_d = atan2(|wi - wo|, |wi + wo|)`, and `phi_d` is the azimuth of
    /// `Ry(-theta_h) Rz(-phi_h) wi`. This is stable where `acos` is not.
    ///
    /// Degenerate directions: for `wi = wo`, `theta_d = 0` and `phi_d = 0`; for `h = n` the azimuth of `h` is
    /// taken as 0, so that `phi_d` is the azimuth of `wi`; for opposite directions (`wi = -wo`, both at the
    /// horizon) `h` is taken as `n`.
    #[must_use]
    pub fn from_directions(wi: &Vector3<f64>, wo: &Vector3<f64>) -> Self {
        let sum = wi + wo;
        let theta_d = (wi - wo).norm().atan2(sum.norm());
        let horizontal = sum.x.hypot(sum.y);
        // Below this the half vector equals the normal to rounding, and its azimuth is noise.
        let (theta_h, cos_phi_h, sin_phi_h) = if horizontal <= 1e-15 {
            (0.0, 1.0, 0.0)
        } else {
            (horizontal.atan2(sum.z), sum.x / horizontal, sum.y / horizontal)
        };
        let (sin_theta_h, cos_theta_h) = theta_h.sin_cos();
        let x = cos_theta_h * (cos_phi_h * wi.x + sin_phi_h * wi.y) - sin_theta_h * wi.z;
        let y = cos_phi_h * wi.y - sin_phi_h * wi.x;
        let phi_d = if theta_d < 1e-12 { 0.0 } else { fold_phi_d(y.atan2(x)) };
        Self { theta_h: theta_h.min(FRAC_PI_2), theta_d: theta_d.min(FRAC_PI_2), phi_d }
    }

    /// A pair of unit directions with these angles and `phi_h = 0`:
    /// `d = (sin theta_d cos phi_d, sin theta_d sin phi_d, cos theta_d)`, `wi = Ry(theta_h) d`,
    /// `wo = 2 (wi . h) h - wi`.
    #[must_use]
    pub fn to_directions(self) -> (Vector3<f64>, Vector3<f64>) {
        let (sh, ch) = self.theta_h.sin_cos();
        let (sd, cd) = self.theta_d.sin_cos();
        let (sp, cp) = self.phi_d.sin_cos();
        let (dx, dy) = (sd * cp, sd * sp);
        let wi = Vector3::new(ch * dx + sh * cd, dy, ch * cd - sh * dx);
        let wo = Vector3::new(sh * cd - ch * dx, -dy, ch * cd + sh * dx);
        (wi, wo)
    }

    /// The cosines `(wi . n, wo . n)`: `cos theta_h cos theta_d -+ sin theta_h sin theta_d cos phi_d`.
    #[must_use]
    pub fn cosines(self) -> (f64, f64) {
        let (sh, ch) = self.theta_h.sin_cos();
        let (sd, cd) = self.theta_d.sin_cos();
        let skew = sh * sd * self.phi_d.cos();
        (ch * cd - skew, ch * cd + skew)
    }

    /// Whether both directions are above the horizon: `tan theta_h tan theta_d |cos phi_d| < 1`.
    #[must_use]
    pub fn is_above_horizon(self) -> bool {
        let (a, b) = self.cosines();
        a.min(b) > 0.0
    }
}

/// Refuses angles that are not finite.
pub(crate) fn check_finite(angles: &[HalfDiff]) -> Result<()> {
    match angles.iter().find(|angles| !angles.is_finite()) {
        None => Ok(()),
        Some(bad) => Err(Error::argument("angles", "finite numbers", format!("{bad:?}"))),
    }
}

/// The largest `theta_d` at which both directions are at or above the horizon:
/// `atan2(1, tan theta_h |cos phi_d|)`, in `[0, pi/2]`.
#[must_use]
pub fn theta_d_max(theta_h: f64, phi_d: f64) -> f64 {
    let (sin_h, cos_h) = theta_h.sin_cos();
    horizon_theta_d(sin_h, cos_h, phi_d.cos().abs())
}

/// [`theta_d_max`] from sine and cosine of `theta_h` and `|cos phi_d|`.
pub(crate) fn horizon_theta_d(sin_h: f64, cos_h: f64, cos_phi: f64) -> f64 {
    // Multiplied by cos(theta_h) so that theta_h = pi/2 needs no infinity.
    cos_h.max(0.0).atan2(sin_h * cos_phi)
}

/// `phi_d` folded into `[0, pi)`: by reciprocity `phi_d` and `phi_d + pi` are the same pair of directions.
#[must_use]
pub fn fold_phi_d(phi_d: f64) -> f64 {
    // The usual case first: a remainder takes longer than the rest of a lookup.
    if (0.0..PI).contains(&phi_d) {
        return phi_d;
    }
    let folded = phi_d.rem_euclid(PI);
    // rem_euclid of a tiny negative number rounds up to pi itself.
    if folded >= PI { 0.0 } else { folded }
}

/// A point of the warped box, in which the directions above the horizon fill a whole product domain:
/// `u = sqrt(theta_h / (pi/2))` in `[0, 1]`, `v = theta_d / theta_d_max(theta_h, phi_d)` in `[0, 1]` and
/// `phi = phi_d` in `[0, pi)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoxPoint {
    /// Square-root warped `theta_h`.
    pub u: f64,
    /// `theta_d` in units of its largest value above the horizon; greater than 1 below the horizon.
    pub v: f64,
    /// `phi_d`, radians.
    pub phi: f64,
}

impl BoxPoint {
    /// Warps half-difference angles. Where `theta_d_max` is 0 (`theta_h = pi/2`, `phi_d != pi/2`), `v` is 0
    /// for `theta_d = 0` and 1 otherwise.
    #[must_use]
    pub fn from_half_diff(angles: HalfDiff) -> Self {
        let limit = theta_d_max(angles.theta_h, angles.phi_d);
        let v = if limit > 0.0 {
            angles.theta_d / limit
        } else if angles.theta_d > 0.0 {
            1.0
        } else {
            0.0
        };
        Self { u: (angles.theta_h.max(0.0) / FRAC_PI_2).sqrt(), v, phi: angles.phi_d }
    }

    /// The inverse of [`BoxPoint::from_half_diff`].
    #[must_use]
    pub fn to_half_diff(self) -> HalfDiff {
        let theta_h = self.u * self.u * FRAC_PI_2;
        HalfDiff { theta_h, theta_d: self.v * theta_d_max(theta_h, self.phi), phi_d: self.phi }
    }

    /// `phi` folded to `[0, pi/2]` by bilateral symmetry (`phi_d -> pi - phi_d`).
    #[must_use]
    pub fn folded_bilateral(self) -> Self {
        Self { phi: if self.phi > FRAC_PI_2 { PI - self.phi } else { self.phi }, ..self }
    }
}

/// The unit direction with polar angle `theta` and azimuth `phi`, radians.
#[must_use]
pub fn direction(theta: f64, phi: f64) -> Vector3<f64> {
    let (s, c) = theta.sin_cos();
    Vector3::new(s * phi.cos(), s * phi.sin(), c)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seeded points of the unit cube, enough for loops over properties.
    fn points(count: usize) -> impl Iterator<Item = [f64; 3]> {
        (1..=count).map(|i| {
            let i = i as f64;
            [(i * 0.819_172_513).fract(), (i * 0.671_043_606).fract(), (i * 0.549_700_477).fract()]
        })
    }

    #[test]
    fn half_diff_round_trips_through_directions() {
        for [a, b, c] in points(2000) {
            let angles = HalfDiff { theta_h: a * FRAC_PI_2, theta_d: b * FRAC_PI_2, phi_d: c * PI };
            let (wi, wo) = angles.to_directions();
            assert!((wi.norm() - 1.0).abs() < 1e-14 && (wo.norm() - 1.0).abs() < 1e-14);
            let (cos_i, cos_o) = angles.cosines();
            assert!((wi.z - cos_i).abs() < 1e-14 && (wo.z - cos_o).abs() < 1e-14);
            let back = HalfDiff::from_directions(&wi, &wo);
            assert!((back.theta_h - angles.theta_h).abs() < 1e-12, "{angles:?} {back:?}");
            assert!((back.theta_d - angles.theta_d).abs() < 1e-12, "{angles:?} {back:?}");
            let scale = angles.theta_d.sin() * angles.theta_h.sin();
            let gap = (back.phi_d - angles.phi_d).abs();
            assert!(gap.min(PI - gap) * scale < 1e-12, "{angles:?} {back:?}");
        }
    }

    #[test]
    fn rotation_and_reciprocity_leave_the_angles_alone() {
        for [a, b, c] in points(500) {
            let wi = direction(a * 1.5, c * 6.0);
            let wo = direction(b * 1.5, c * 2.0 + 1.0);
            let angles = HalfDiff::from_directions(&wi, &wo);
            let swapped = HalfDiff::from_directions(&wo, &wi);
            let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), 5.0 * a);
            let turned = HalfDiff::from_directions(&(turn * wi), &(turn * wo));
            for other in [swapped, turned] {
                let gap = (other.phi_d - angles.phi_d).abs();
                assert!((other.theta_h - angles.theta_h).abs() < 1e-12);
                assert!((other.theta_d - angles.theta_d).abs() < 1e-12);
                assert!(gap.min(PI - gap) < 1e-9, "{angles:?} {other:?}");
            }
        }
    }

    #[test]
    fn horizon_agrees_with_theta_d_max_and_the_box_round_trips() {
        for [a, b, c] in points(2000) {
            let angles = HalfDiff { theta_h: a * FRAC_PI_2, theta_d: b * FRAC_PI_2, phi_d: c * PI };
            let point = BoxPoint::from_half_diff(angles);
            assert_eq!(angles.is_above_horizon(), point.v < 1.0, "{angles:?} {point:?}");
            let back = point.to_half_diff();
            assert!((back.theta_h - angles.theta_h).abs() < 1e-13);
            // An error in theta_d_max is multiplied by v on the way back.
            assert!((back.theta_d - angles.theta_d).abs() < 1e-13 * point.v.max(1.0));
        }
    }

    #[test]
    fn degenerate_directions_have_defined_angles() {
        let n = Vector3::z();
        assert_eq!(HalfDiff::from_directions(&n, &n), HalfDiff::default());
        let tilted = direction(0.7, 2.0);
        let retro = HalfDiff::from_directions(&tilted, &tilted);
        assert!((retro.theta_h - 0.7).abs() < 1e-14 && retro.theta_d == 0.0 && retro.phi_d == 0.0);
        let mirror = HalfDiff::from_directions(&direction(0.7, 0.5), &direction(0.7, 0.5 + PI));
        assert!(mirror.theta_h < 1e-14 && (mirror.theta_d - 0.7).abs() < 1e-14);
        assert!((mirror.phi_d - 0.5).abs() < 1e-12);
        let opposite = HalfDiff::from_directions(&Vector3::x(), &-Vector3::x());
        assert_eq!(opposite, HalfDiff { theta_h: 0.0, theta_d: FRAC_PI_2, phi_d: 0.0 });
        let grazing = HalfDiff::from_directions(&Vector3::x(), &Vector3::y());
        assert!((grazing.theta_h - FRAC_PI_2).abs() < 1e-15 && (grazing.theta_d - PI / 4.0).abs() < 1e-15);
        assert_eq!(theta_d_max(FRAC_PI_2, FRAC_PI_2).round(), 1.0);
        let flat = BoxPoint::from_half_diff(HalfDiff { theta_h: FRAC_PI_2, theta_d: 0.3, phi_d: 0.0 });
        assert!(flat.v.is_finite() && flat.v >= 1.0);
        assert_eq!(fold_phi_d(-1e-300), 0.0);
    }
}
