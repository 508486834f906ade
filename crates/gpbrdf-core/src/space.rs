//! From directions to the coordinates that kernels see.

use std::f64::consts::FRAC_PI_2;

use serde::{Deserialize, Serialize};

use crate::angles::{BoxPoint, HalfDiff, fold_phi_d};
use crate::error::{Error, Result};
use crate::kernel::AxisMetric;
use crate::layout::Symmetry;

/// The input space of a process: three coordinates a pair of directions, and how distance is measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum InputSpace {
    /// The warped box, stretched where nodes crowd: `(1 - (1 - u^(1/density))^tail, min(v, 1)^(1/v_density), phi)`, with
    /// a folded `phi` as in [`InputSpace::warp_phi`]. Directions below the horizon stand for the horizon. The first is the distribution function of P. Kumaraswamy
    /// (1980), as in J. Snoek et al., "Input Warping for Bayesian Optimization" (2014); a power where `tail` is 1.
    WarpedBox {
        /// Exponent of the warp along `u`.
        density: f64,
        /// Exponent of the warp along `v`.
        v_density: f64,
        /// Symmetry in `phi_d`; [`Symmetry::Bilateral`] folds `phi` to `[0, pi/2]`.
        symmetry: Symmetry,
        /// Second exponent of the warp along `u`: below 1 nodes crowd towards `theta_h = pi/2`, above 1 they thin out.
        #[serde(default = "one")]
        tail: f64,
        /// Exponent of the warp along a folded `phi`; above 1 nodes crowd towards `phi = pi/2`.
        #[serde(default = "one")]
        phi_density: f64,
    },
    /// `(theta_h, theta_d, phi_d)` in radians, as they are: the paper's own setting.
    HalfDiff,
}

impl InputSpace {
    /// Coordinates of a pair of directions.
    #[must_use]
    pub fn coordinates(self, angles: HalfDiff) -> [f64; 3] {
        match self {
            Self::WarpedBox { symmetry, .. } => {
                let mut point = BoxPoint::from_half_diff(angles);
                point.phi = fold_phi_d(point.phi);
                if symmetry == Symmetry::Bilateral {
                    point = point.folded_bilateral();
                }
                [self.warp_u(point.u), self.warp_v(point.v), self.warp_phi(point.phi)]
            }
            Self::HalfDiff => [angles.theta_h, angles.theta_d, fold_phi_d(angles.phi_d)],
        }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// A density that is not positive and finite.
    pub fn validate(self) -> Result<()> {
        match self {
            Self::WarpedBox { density, v_density, tail, phi_density, .. } => {
                let bad = [density, v_density, tail, phi_density]
                    .into_iter()
                    .find(|x| !(*x > 0.0 && x.is_finite()));
                bad.map_or(Ok(()), |x| Err(Error::argument("node density", "a positive number", x)))
            }
            Self::HalfDiff => Ok(()),
        }
    }

    /// The first coordinate at `u = sqrt(theta_h / (pi/2))`.
    #[must_use]
    pub fn warp_u(self, u: f64) -> f64 {
        match self {
            Self::WarpedBox { density, tail, .. } => {
                let power = u.powf(1.0 / density);
                // Left as it is where there is nothing to do, to the last bit.
                if tail == 1.0 { power } else { 1.0 - (1.0 - power.min(1.0)).powf(tail) }
            }
            Self::HalfDiff => u * u * FRAC_PI_2,
        }
    }

    /// The second coordinate at `v`, in the warped box; above the horizon's 1 it stays there.
    #[must_use]
    pub fn warp_v(self, v: f64) -> f64 {
        match self {
            Self::WarpedBox { v_density, .. } => v.min(1.0).powf(1.0 / v_density),
            Self::HalfDiff => v,
        }
    }

    /// The third coordinate at `phi`, folded to `[0, pi/2]` in a bilateral box: `pi/2 (1 - (1 - phi / (pi/2))^(1/p))` there
    /// with `p = phi_density`, else `phi` itself.
    ///
    /// `theta_d_max` has a kink in `phi` at `pi/2`, where it goes with `|cos phi_d|`, and so has everything that is smooth
    /// in `theta_d` when it is seen along `v`. In this coordinate the kink is a power of `p`: nearly the even function that
    /// the mirrored kernel expects.
    #[must_use]
    pub fn warp_phi(self, phi: f64) -> f64 {
        match self {
            // Left as it is where there is nothing to do, to the last bit.
            Self::WarpedBox { symmetry: Symmetry::Bilateral, phi_density, .. } if phi_density != 1.0 => {
                FRAC_PI_2 * (1.0 - (1.0 - phi / FRAC_PI_2).max(0.0).powf(phi_density.recip()))
            }
            _ => phi,
        }
    }

    /// Whether functions of each coordinate are even, about 0 and with the period of a chord: on a folded `phi` they
    /// are.
    #[must_use]
    pub fn mirrored(self) -> [bool; 3] {
        [false, false, matches!(self, Self::WarpedBox { symmetry: Symmetry::Bilateral, .. })]
    }

    /// Metrics of a lattice: `phi` is always an angle of period `pi` there, and a folded one is
    /// [`InputSpace::mirrored`] as well.
    #[must_use]
    pub fn lattice_metrics(self) -> [AxisMetric; 3] {
        [AxisMetric::Linear, AxisMetric::Linear, AxisMetric::Chord]
    }

    /// How distance is measured along each coordinate.
    #[must_use]
    pub fn metrics(self) -> [AxisMetric; 3] {
        let phi = match self {
            Self::WarpedBox { symmetry: Symmetry::Reciprocal, .. } => AxisMetric::Chord,
            _ => AxisMetric::Linear,
        };
        [AxisMetric::Linear, AxisMetric::Linear, phi]
    }
}

/// The tail and the density along `phi` of files that have none.
fn one() -> f64 {
    1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn warped_box_folds_and_stops_at_the_horizon() {
        let folded = InputSpace::WarpedBox {
            density: 1.5,
            v_density: 0.8,
            symmetry: Symmetry::Bilateral,
            tail: 1.0,
            phi_density: 1.0,
        };
        let circle = InputSpace::WarpedBox {
            density: 1.5,
            v_density: 0.8,
            symmetry: Symmetry::Reciprocal,
            tail: 1.0,
            phi_density: 1.0,
        };
        let angles = HalfDiff { theta_h: 0.4, theta_d: 0.3, phi_d: 2.0 };
        let tailed = InputSpace::WarpedBox {
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
