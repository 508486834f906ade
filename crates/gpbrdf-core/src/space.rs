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
    /// The warped box, stretched where nodes crowd: `(u^(1/density), min(v, 1), phi)`. Directions below the
    /// horizon stand for the horizon.
    WarpedBox {
        /// Exponent of the warp along `u`.
        density: f64,
        /// Symmetry in `phi_d`; [`Symmetry::Bilateral`] folds `phi` to `[0, pi/2]`.
        symmetry: Symmetry,
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
                [self.warp_u(point.u), point.v.min(1.0), point.phi]
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
            Self::WarpedBox { density, .. } if !(density > 0.0 && density.is_finite()) => {
                Err(Error::argument("node density", "a positive number", density))
            }
            _ => Ok(()),
        }
    }

    /// The first coordinate at `u = sqrt(theta_h / (pi/2))`.
    #[must_use]
    pub fn warp_u(self, u: f64) -> f64 {
        match self {
            Self::WarpedBox { density, .. } => u.powf(1.0 / density),
            Self::HalfDiff => u * u * FRAC_PI_2,
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn warped_box_folds_and_stops_at_the_horizon() {
        let folded = InputSpace::WarpedBox { density: 1.5, symmetry: Symmetry::Bilateral };
        let circle = InputSpace::WarpedBox { density: 1.5, symmetry: Symmetry::Reciprocal };
        let angles = HalfDiff { theta_h: 0.4, theta_d: 0.3, phi_d: 2.0 };
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
