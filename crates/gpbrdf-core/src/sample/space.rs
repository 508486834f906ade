//! From directions to the coordinates in which kernels measure distance.

use std::f64::consts::FRAC_PI_2;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::base::error::{Error, Result};
use crate::brdf::angles::{BoxPoint, HalfDiff, fold_phi_d, theta_d_max};
use crate::kernel::AxisMetric;
use crate::sample::symmetry::Symmetry;

/// The warped box, stretched where nodes are dense, so that they are nearly even in its coordinates:
/// `u' = 1 - (1 - u^(1/density))^tail`, `v' = min(v, 1)^(1/v_density)`, `phi' = warp_phi(phi)`.
///
/// `u'` is the distribution function of P. Kumaraswamy (1980), as in J. Snoek et al., "Input Warping for
/// Bayesian Optimization" (2014); with a `tail` of 1 it is a power of `u`. Directions below the horizon have
/// the coordinates of the horizon, `v' = 1`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WarpedBox {
    /// Exponent of the warp along `u`.
    pub density: f64,
    /// Exponent of the warp along `v`.
    pub v_density: f64,
    /// Symmetry in `phi_d`; [`Symmetry::Bilateral`] folds `phi` to `[0, pi/2]`.
    pub symmetry: Symmetry,
    /// Second exponent of the warp along `u`: below 1 it suits nodes that crowd towards `theta_h = pi/2`,
    /// above 1 nodes that thin out there.
    #[serde(default = "one")]
    pub tail: f64,
    /// Exponent of the warp along a folded `phi`: above 1 it suits nodes that crowd towards `phi = pi/2`.
    #[serde(default = "one")]
    pub phi_density: f64,
}

impl WarpedBox {
    /// Coordinates of a pair of directions.
    #[must_use]
    pub fn coordinates(self, angles: HalfDiff) -> [f64; 3] {
        let mut point = BoxPoint::from_half_diff(angles);
        point.phi = fold_phi_d(point.phi);
        if self.symmetry == Symmetry::Bilateral {
            point = point.folded_bilateral();
        }
        [self.warp_u(point.u), self.warp_v(point.v), self.warp_phi(point.phi)]
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for an exponent that is not positive and finite.
    pub fn validate(self) -> Result<()> {
        let densities = [self.density, self.v_density, self.tail, self.phi_density];
        match densities.into_iter().find(|x| !(*x > 0.0 && x.is_finite())) {
            None => Ok(()),
            Some(x) => Err(Error::argument("node density", "a positive number", x)),
        }
    }

    /// The first coordinate at `u = sqrt(theta_h / (pi/2))`.
    #[must_use]
    pub fn warp_u(self, u: f64) -> f64 {
        let power = u.powf(1.0 / self.density);
        // With an exponent of 1 nothing may change, not even the last bit.
        if self.tail == 1.0 { power } else { 1.0 - (1.0 - power.min(1.0)).powf(self.tail) }
    }

    /// The second coordinate at `v`. It is 1, the value at the horizon, for all directions below the horizon.
    #[must_use]
    pub fn warp_v(self, v: f64) -> f64 {
        v.min(1.0).powf(1.0 / self.v_density)
    }

    /// The third coordinate at `phi`. A bilateral box has folded `phi` to `[0, pi/2]`, and the coordinate is
    /// `pi/2 (1 - (1 - phi / (pi/2))^(1/p))` with `p = phi_density`; otherwise it is `phi` itself.
    ///
    /// `theta_d_max` has a kink in `phi` at `pi/2`, since it depends on `|cos phi_d|`. Every function that is
    /// smooth in `theta_d` therefore has a kink there as a function of `v` and `phi`. In this coordinate the
    /// kink becomes a power with exponent `p`, nearly the even function that the mirrored kernel expects.
    #[must_use]
    pub fn warp_phi(self, phi: f64) -> f64 {
        // With an exponent of 1 nothing may change, not even the last bit.
        if self.symmetry == Symmetry::Bilateral && self.phi_density != 1.0 {
            FRAC_PI_2 * (1.0 - (1.0 - phi / FRAC_PI_2).max(0.0).powf(self.phi_density.recip()))
        } else {
            phi
        }
    }

    /// For each coordinate, whether functions of it are even about 0 and have the period of a chord. This is
    /// so for a folded `phi`.
    #[must_use]
    pub fn mirrored(self) -> [bool; 3] {
        [false, false, self.symmetry == Symmetry::Bilateral]
    }

    /// The metrics of a lattice. There `phi` is always an angle of period `pi`; a folded one is
    /// [`WarpedBox::mirrored`] as well.
    #[must_use]
    pub fn lattice_metrics(self) -> [AxisMetric; 3] {
        [AxisMetric::Linear, AxisMetric::Linear, AxisMetric::Chord]
    }
}

/// The input space of a process: three coordinates for each pair of directions, and the metric of each
/// coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum InputSpace {
    /// The warped box.
    WarpedBox(WarpedBox),
    /// `((theta_h / (pi/2))^0.7, a(theta_i) + a(theta_o), |a(theta_i) - a(theta_o)|)` with the polar angles of
    /// both directions and `a(theta) = theta / (pi/2) + ln(1.05 / (cos theta + 0.05)) / 4`, which stretches
    /// grazing directions.
    ///
    /// Every function of these coordinates is reciprocal, bilateral and isotropic: they do not change when
    /// the directions are swapped, mirrored, or turned about the normal. In particular they do not depend on
    /// `phi_d` where it has no meaning, at `theta_h = 0` and at `theta_d = 0`. Directions below the horizon
    /// have the coordinates of the horizon.
    PolarAngles,
    /// `((theta_h / (pi/2))^0.7, theta_d / (pi/2), |a(theta_i) - a(theta_o)|)`: like [`InputSpace::PolarAngles`],
    /// but with the angle between light and half vector for itself, which suits materials that send light back
    /// to where it came from.
    DifferenceAngle,
    /// `((theta_h / (pi/2))^0.7, v, 0)` with `v = min(theta_d / theta_d_max, 1)`: functions that do not depend on
    /// `phi_d` between the horizons. Samples that all lie in the plane of incidence say nothing about `phi_d`;
    /// intervals out of that plane are wider for it.
    PlaneOfIncidence,
    /// `(theta_h, theta_d, phi_d)` in radians, without a warp. This is the paper's own setting.
    HalfDiff,
}

impl InputSpace {
    /// The spaces among which the likelihood of scattered samples chooses.
    pub const ISOTROPIC: [Self; 2] = [Self::PolarAngles, Self::DifferenceAngle];

    /// Coordinates of a pair of directions.
    #[must_use]
    pub fn coordinates(self, angles: HalfDiff) -> [f64; 3] {
        match self {
            Self::WarpedBox(warped) => warped.coordinates(angles),
            Self::PolarAngles => {
                let (half, [light, viewer]) = polar_coordinates(angles);
                [half, light + viewer, (light - viewer).abs()]
            }
            Self::DifferenceAngle => {
                let (half, [light, viewer]) = polar_coordinates(angles);
                [half, above_horizon(angles) / FRAC_PI_2, (light - viewer).abs()]
            }
            Self::PlaneOfIncidence => {
                let [u, v, _] = about_plane(angles);
                [u, v, 0.0]
            }
            Self::HalfDiff => [angles.theta_h, angles.theta_d, fold_phi_d(angles.phi_d)],
        }
    }

    /// Coordinates of many pairs of directions, rows of three, computed in parallel.
    #[must_use]
    pub fn points(self, angles: &[HalfDiff]) -> Vec<f64> {
        angles.par_iter().flat_map_iter(|&at| self.coordinates(at)).collect()
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for an exponent that is not positive and finite.
    pub fn validate(self) -> Result<()> {
        match self {
            Self::WarpedBox(warped) => warped.validate(),
            Self::PolarAngles | Self::DifferenceAngle | Self::PlaneOfIncidence | Self::HalfDiff => Ok(()),
        }
    }

    /// Whether `phi_d` and `pi - phi_d` have the same coordinates.
    #[must_use]
    pub fn is_bilateral(self) -> bool {
        let Self::WarpedBox(warped) = self else { return self.is_isotropic() };
        warped.symmetry == Symmetry::Bilateral
    }

    /// Whether all directions below the horizon that share `theta_h` and `phi_d` have the same coordinates.
    #[must_use]
    pub fn stops_at_horizon(self) -> bool {
        self.is_isotropic() || matches!(self, Self::WarpedBox(_))
    }

    /// Whether every function of the coordinates is reciprocal, bilateral and isotropic, also where `phi_d` has no
    /// meaning.
    #[must_use]
    pub fn is_isotropic(self) -> bool {
        matches!(self, Self::PolarAngles | Self::DifferenceAngle | Self::PlaneOfIncidence)
    }

    /// The length scales that reflectances usually have along each coordinate: the median, and the standard
    /// deviation of the logarithm.
    ///
    /// In [`InputSpace::PolarAngles`] they are those that 1,000 random directions of 17 measured materials lead
    /// to (RGL material database; J. Dupuy and W. Jakob 2018): 0.05 to 0.34, 0.66 to 2.5 and 0.9 to 3.4. The
    /// deviation of the first is larger, since with more samples it becomes shorter.
    #[must_use]
    pub fn usual_lengths(self) -> [(f64, f64); 3] {
        match self {
            Self::WarpedBox(_) => [(0.3, 0.8), (0.6, 0.8), (1.0, 0.8)],
            Self::PolarAngles => [(0.2, 0.8), (1.05, 0.5), (1.6, 0.4)],
            Self::DifferenceAngle => [(0.2, 0.8), (0.35, 0.6), (1.6, 0.5)],
            // The last coordinate is the same everywhere.
            Self::PlaneOfIncidence => [(0.2, 0.8), (0.35, 0.6), (0.01, 0.2)],
            Self::HalfDiff => [(0.4, 0.8), (0.8, 0.8), (1.5, 0.8)],
        }
    }

    /// The metric of each coordinate.
    #[must_use]
    pub fn metrics(self) -> [AxisMetric; 3] {
        let phi = match self {
            Self::WarpedBox(WarpedBox { symmetry: Symmetry::Reciprocal, .. }) => AxisMetric::Chord,
            _ => AxisMetric::Linear,
        };
        [AxisMetric::Linear, AxisMetric::Linear, phi]
    }
}

/// The exponent of `theta_h` in [`InputSpace::PolarAngles`].
const HALF_ANGLE_EXPONENT: f64 = 0.7;

/// How strongly grazing directions are stretched in [`InputSpace::PolarAngles`], and the cosine at which the
/// stretching sets in.
const STRETCH: (f64, f64) = (0.25, 0.05);

/// The first two coordinates of [`InputSpace::PlaneOfIncidence`], `(u, v)`, and the distance from the plane of
/// incidence in the unit of `u`: `u v |sin(phi_d)|`, which is 0 in the plane and where `phi_d` has no meaning.
pub(crate) fn about_plane(angles: HalfDiff) -> [f64; 3] {
    let u = (angles.theta_h / FRAC_PI_2).powf(HALF_ANGLE_EXPONENT);
    let v = BoxPoint::from_half_diff(angles).v.min(1.0);
    [u, v, u * v * angles.phi_d.sin().abs()]
}

/// `theta_d`, or that of the horizon for directions below it.
fn above_horizon(angles: HalfDiff) -> f64 {
    if angles.is_above_horizon() { angles.theta_d } else { theta_d_max(angles.theta_h, angles.phi_d) }
}

/// The coordinate of the half vector and those of both directions.
fn polar_coordinates(angles: HalfDiff) -> (f64, [f64; 2]) {
    let HalfDiff { theta_h, phi_d, .. } = angles;
    let theta_d = above_horizon(angles);
    let ((sin_h, cos_h), (sin_d, cos_d)) = (theta_h.sin_cos(), theta_d.sin_cos());
    let (sin_phi, cos_phi) = phi_d.sin_cos();
    // The polar angle from both sine and cosine is exact near the normal, too.
    let polar = |side: f64| {
        let x = sin_h * cos_d + side * cos_h * sin_d * cos_phi;
        let z = cos_h * cos_d - side * sin_h * sin_d * cos_phi;
        let y = sin_d * sin_phi;
        stretched(z.max(0.0), (x * x + y * y).sqrt().atan2(z.max(0.0)))
    };
    ((theta_h / FRAC_PI_2).powf(HALF_ANGLE_EXPONENT), [polar(1.0), polar(-1.0)])
}

/// `a(theta)` of [`InputSpace::PolarAngles`].
fn stretched(cosine: f64, theta: f64) -> f64 {
    let (strength, onset) = STRETCH;
    theta / FRAC_PI_2 + strength * ((1.0 + onset) / (cosine + onset)).ln()
}

impl From<WarpedBox> for InputSpace {
    fn from(warped: WarpedBox) -> Self {
        Self::WarpedBox(warped)
    }
}

/// The `tail` and the `phi_density` of files that do not have them.
fn one() -> f64 {
    1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn polar_angles_have_every_symmetry_of_an_isotropic_reflectance() {
        for space in InputSpace::ISOTROPIC {
            let near = |a: HalfDiff, b: HalfDiff| {
                let (a, b) = (space.coordinates(a), space.coordinates(b));
                assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-14), "{a:?} {b:?}");
            };
            for (theta_h, theta_d) in [(0.0, 0.7), (0.4, 0.0), (0.3, 0.9), (1.2, 0.2), (0.0, 0.0)] {
                for phi_d in [0.0, 0.3, 1.5, 2.9] {
                    let at = HalfDiff { theta_h, theta_d, phi_d };
                    near(at, HalfDiff { phi_d: phi_d + PI, ..at });
                    near(at, HalfDiff { phi_d: PI - phi_d, ..at });
                    if theta_h == 0.0 || theta_d == 0.0 {
                        near(at, HalfDiff { phi_d: 0.0, ..at });
                    }
                    // The polar angles of both directions, computed from the directions.
                    let (wi, wo) = at.to_directions();
                    if at.is_above_horizon() {
                        let [light, viewer] = [wi, wo].map(|w| stretched(w.z, w.z.clamp(-1.0, 1.0).acos()));
                        let [_, sum, difference] = InputSpace::PolarAngles.coordinates(at);
                        assert!(
                            (sum - light - viewer).abs() < 1e-7
                                && (difference - (light - viewer).abs()).abs() < 1e-7
                        );
                    }
                }
            }
            let below = HalfDiff { theta_h: 1.0, theta_d: 1.3, phi_d: 0.2 };
            near(below, HalfDiff { theta_d: 1.4, ..below });
        }
    }

    #[test]
    fn the_distance_from_the_plane_is_0_in_it_and_where_it_has_no_meaning() {
        let at = |theta_h, theta_d, phi_d| HalfDiff { theta_h, theta_d, phi_d };
        for in_plane in [at(0.3, 0.5, 0.0), at(0.3, 0.5, PI), at(0.0, 0.5, 1.0), at(0.3, 0.0, 1.0)] {
            assert!(about_plane(in_plane)[2] < 1e-15, "{in_plane:?}");
        }
        let [u, v, beside] = about_plane(at(0.3, 0.5, 0.8));
        assert_eq!(InputSpace::PlaneOfIncidence.coordinates(at(0.3, 0.5, 0.8)), [u, v, 0.0]);
        assert!((beside - u * v * 0.8f64.sin()).abs() < 1e-15);
        assert!((about_plane(at(0.3, 0.5, PI - 0.8))[2] - beside).abs() < 1e-15);
        assert!((about_plane(at(0.3, 0.5, -0.8))[2] - beside).abs() < 1e-15);
    }

    #[test]
    fn warped_box_folds_and_stops_at_the_horizon() {
        let folded = WarpedBox {
            density: 1.5,
            v_density: 0.8,
            symmetry: Symmetry::Bilateral,
            tail: 1.0,
            phi_density: 1.0,
        };
        let circle = WarpedBox {
            density: 1.5,
            v_density: 0.8,
            symmetry: Symmetry::Reciprocal,
            tail: 1.0,
            phi_density: 1.0,
        };
        let angles = HalfDiff { theta_h: 0.4, theta_d: 0.3, phi_d: 2.0 };
        let tailed = WarpedBox {
            density: 1.0,
            v_density: 1.0,
            symmetry: Symmetry::Bilateral,
            tail: 2.0,
            phi_density: 1.0,
        };
        assert!(
            (tailed.warp_u(0.3) - 0.51).abs() < 1e-15
                && tailed.warp_u(1.0) == 1.0
                && tailed.warp_u(0.0) == 0.0
        );
        let mirrored = HalfDiff { phi_d: PI - 2.0, ..angles };
        let (a, b) = (folded.coordinates(angles), folded.coordinates(mirrored));
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15), "{a:?} {b:?}");
        assert_ne!(circle.coordinates(angles), circle.coordinates(mirrored));
        let below = HalfDiff { theta_h: 1.5, theta_d: 1.5, phi_d: 0.0 };
        assert_eq!(folded.coordinates(below)[1], 1.0);
        assert!((folded.coordinates(angles)[0].powf(1.5).powi(2) * FRAC_PI_2 - 0.4).abs() < 1e-14);
        assert_eq!(InputSpace::HalfDiff.coordinates(angles), [0.4, 0.3, 2.0]);
    }
}
