//! How much wider intervals must be than a process with a learned prior says by itself.

use crate::base::error::{Error, Result};
use crate::brdf::angles::HalfDiff;
use crate::sample::InputSpace;

/// The polar angles of half vectors at which factors are known, in degrees: the middles of the four bands that end at
/// 10, 30, 60 and 90 degrees.
const MIDDLES: [f64; 4] = [5.0, 20.0, 45.0, 75.0];

/// The ends of the bands, in degrees.
#[cfg(feature = "fit")]
const ENDS: [f64; 3] = [10.0, 30.0, 60.0];

/// Half the width of a 90 % interval of a normal distribution, in standard deviations.
#[cfg(feature = "fit")]
const Z_90: f64 = 1.644_853_626_951_472_2;

/// Factors of the standard deviation by `theta_h`, linear between the middles of four bands and constant beyond: those
/// of scattered samples, and those of samples in the plane of incidence, which leave open how a material looks outside
/// of it.
///
/// A process takes its hyper-parameters and the likeness to other materials as known, and the materials of a library as
/// a sample of a normal distribution, so that its intervals are too narrow for few samples. The factors are those with
/// which 90 % intervals would have held 90 % of the values of materials that were left out. Those of the other 10 % are
/// mostly of a few materials like no other, after which intervals of all materials would be several times as wide.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Calibration {
    scattered: [f64; 4],
    in_plane: [f64; 4],
}

impl Calibration {
    /// No change.
    #[cfg(feature = "fit")]
    pub(super) const NONE: Self = Self { scattered: [1.0; 4], in_plane: [1.0; 4] };

    /// # Errors
    /// Factors that are not finite numbers of at least 1.
    pub(super) fn new([scattered, in_plane]: [[f64; 4]; 2]) -> Result<Self> {
        let mut factors = scattered.iter().chain(&in_plane);
        match factors.find(|factor| !(**factor >= 1.0 && factor.is_finite())) {
            None => Ok(Self { scattered, in_plane }),
            Some(bad) => Err(Error::argument("calibration of a prior", "factors of at least 1", bad)),
        }
    }

    /// Those of scattered samples, and those of samples in the plane of incidence.
    pub(super) fn factors(&self) -> [[f64; 4]; 2] {
        [self.scattered, self.in_plane]
    }

    /// The factor of the variance at a pair of directions. The space of a process tells how its samples lie.
    pub(crate) fn of_variance(&self, space: InputSpace, at: &HalfDiff) -> f64 {
        let factors = match space {
            InputSpace::PlaneOfIncidence => &self.in_plane,
            _ => &self.scattered,
        };
        of_variance_by_bands(factors, at)
    }

    /// The factors for errors in standard deviations, each with its direction: in each band the 90 % quantile of their
    /// magnitudes over that of a normal distribution, at least 1. First those of scattered samples, then those of
    /// samples in the plane of incidence.
    #[cfg(feature = "fit")]
    pub(super) fn measured([scattered, in_plane]: [&[(HalfDiff, f64)]; 2]) -> Self {
        Self { scattered: measured_factors(scattered), in_plane: measured_factors(in_plane) }
    }
}

/// The square of a factor by `theta_h` that is known in the middles of four bands, those that end at 10, 30, 60 and 90
/// degrees: linear between them and constant beyond.
pub(crate) fn of_variance_by_bands(factors: &[f64; 4], at: &HalfDiff) -> f64 {
    let theta_h = at.theta_h.to_degrees();
    let above = MIDDLES.partition_point(|middle| *middle < theta_h).clamp(1, MIDDLES.len() - 1);
    let (low, high) = (MIDDLES[above - 1], MIDDLES[above]);
    let t = ((theta_h - low) / (high - low)).clamp(0.0, 1.0);
    let factor = (1.0 - t) * factors[above - 1] + t * factors[above];
    factor * factor
}

#[cfg(feature = "fit")]
fn measured_factors(errors: &[(HalfDiff, f64)]) -> [f64; 4] {
    let mut bands: [Vec<f64>; 4] = Default::default();
    for (at, error) in errors {
        let theta_h = at.theta_h.to_degrees();
        bands[ENDS.partition_point(|end| *end <= theta_h)].push(error.abs());
    }
    bands.map(|mut band| {
        band.sort_by(f64::total_cmp);
        let quantile = band.get(9 * band.len() / 10).copied().unwrap_or(0.0);
        // Single precision, as in files.
        f64::from(crate::gp::table::to_f32((quantile / Z_90).max(1.0)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(degrees: f64) -> HalfDiff {
        HalfDiff { theta_h: degrees.to_radians(), theta_d: 0.3, phi_d: 0.2 }
    }

    #[test]
    fn factors_are_linear_between_bands_and_constant_beyond() {
        let calibration = Calibration::new([[3.0, 1.0, 1.5, 2.0], [4.0; 4]]).unwrap();
        for (degrees, factor) in
            [(0.0, 3.0), (5.0, 3.0), (12.5, 2.0), (20.0, 1.0), (60.0, 1.75), (75.0, 2.0), (90.0, 2.0)]
        {
            let found = calibration.of_variance(InputSpace::PolarAngles, &at(degrees)).sqrt();
            assert!((found - factor).abs() < 1e-9, "{degrees}: {found}");
            assert_eq!(calibration.of_variance(InputSpace::PlaneOfIncidence, &at(degrees)), 16.0);
        }
        for bad in [0.9, f64::NAN, f64::INFINITY] {
            assert!(Calibration::new([[1.0, 1.0, bad, 1.0], [1.0; 4]]).is_err());
        }
    }

    /// Errors of twice the standard deviation expected: intervals must be twice as wide.
    #[cfg(feature = "fit")]
    #[test]
    fn factors_are_those_that_cover_90_of_100() {
        let mut random = crate::base::random::SplitMix64::new(5);
        let errors: Vec<(HalfDiff, f64)> =
            (0..40_000).map(|i| (at([3.0, 15.0][i % 2]), [2.0, 0.5][i % 2] * random.next_normal())).collect();
        let [[near, far, none, _], in_plane] = Calibration::measured([&errors, &[]]).factors();
        assert!((near - 2.0).abs() < 0.05 && far == 1.0 && none == 1.0, "{near} {far} {none}");
        assert_eq!(in_plane, [1.0; 4]);
    }
}
