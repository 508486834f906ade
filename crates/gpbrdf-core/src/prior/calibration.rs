//! How much wider intervals must be than a process with a learned prior says by itself.

use crate::base::error::{Error, Result};
use crate::brdf::angles::HalfDiff;

/// The polar angles of half vectors at which factors are known, in degrees: the middles of the four bands that end at
/// 10, 30, 60 and 90 degrees.
const MIDDLES: [f64; 4] = [5.0, 20.0, 45.0, 75.0];

/// The ends of the bands, in degrees.
#[cfg(feature = "fit")]
const ENDS: [f64; 3] = [10.0, 30.0, 60.0];

/// Half the width of a 90 % interval of a normal distribution, in standard deviations.
#[cfg(feature = "fit")]
const Z_90: f64 = 1.644_853_626_951_472_2;

/// Factors of the standard deviation by `theta_h`, linear between the middles of four bands and constant beyond.
///
/// A process takes its hyper-parameters and the likeness to other materials as known, and the materials of a library as
/// a sample of a normal distribution, so that its intervals are too narrow for few samples. The factors are those with
/// which 90 % intervals would have held 90 % of the values of materials that were left out. Those of the other 10 % are
/// mostly of a few materials like no other, after which intervals of all materials would be several times as wide.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Calibration {
    factors: [f64; 4],
}

impl Calibration {
    /// No change.
    #[cfg(feature = "fit")]
    pub(super) const NONE: Self = Self { factors: [1.0; 4] };

    /// # Errors
    /// Factors that are not finite numbers of at least 1.
    pub(super) fn new(factors: [f64; 4]) -> Result<Self> {
        match factors.iter().find(|factor| !(**factor >= 1.0 && factor.is_finite())) {
            None => Ok(Self { factors }),
            Some(bad) => Err(Error::argument("calibration of a prior", "factors of at least 1", bad)),
        }
    }

    pub(super) fn factors(&self) -> [f64; 4] {
        self.factors
    }

    /// The factor of the variance at a pair of directions.
    pub(crate) fn of_variance(&self, at: &HalfDiff) -> f64 {
        let theta_h = at.theta_h.to_degrees();
        let above = MIDDLES.partition_point(|middle| *middle < theta_h).clamp(1, MIDDLES.len() - 1);
        let (low, high) = (MIDDLES[above - 1], MIDDLES[above]);
        let t = ((theta_h - low) / (high - low)).clamp(0.0, 1.0);
        let factor = (1.0 - t) * self.factors[above - 1] + t * self.factors[above];
        factor * factor
    }

    /// The factors for errors in standard deviations, each with its direction: in each band the 90 % quantile of their
    /// magnitudes over that of a normal distribution, at least 1.
    #[cfg(feature = "fit")]
    pub(super) fn measured(errors: &[(HalfDiff, f64)]) -> Self {
        let mut bands: [Vec<f64>; 4] = Default::default();
        for (at, error) in errors {
            let theta_h = at.theta_h.to_degrees();
            bands[ENDS.partition_point(|end| *end <= theta_h)].push(error.abs());
        }
        let factors = bands.map(|mut band| {
            band.sort_by(f64::total_cmp);
            let quantile = band.get(9 * band.len() / 10).copied().unwrap_or(0.0);
            // Single precision, as in files.
            f64::from(crate::gp::table::to_f32((quantile / Z_90).max(1.0)))
        });
        Self { factors }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(degrees: f64) -> HalfDiff {
        HalfDiff { theta_h: degrees.to_radians(), theta_d: 0.3, phi_d: 0.2 }
    }

    #[test]
    fn factors_are_linear_between_bands_and_constant_beyond() {
        let calibration = Calibration::new([3.0, 1.0, 1.5, 2.0]).unwrap();
        for (degrees, factor) in
            [(0.0, 3.0), (5.0, 3.0), (12.5, 2.0), (20.0, 1.0), (60.0, 1.75), (75.0, 2.0), (90.0, 2.0)]
        {
            let found = calibration.of_variance(&at(degrees)).sqrt();
            assert!((found - factor).abs() < 1e-9, "{degrees}: {found}");
        }
        for bad in [0.9, f64::NAN, f64::INFINITY] {
            assert!(Calibration::new([1.0, 1.0, bad, 1.0]).is_err());
        }
    }

    /// Errors of twice the standard deviation expected: intervals must be twice as wide.
    #[cfg(feature = "fit")]
    #[test]
    fn factors_are_those_that_cover_90_of_100() {
        let mut random = crate::base::random::SplitMix64::new(5);
        let errors: Vec<(HalfDiff, f64)> =
            (0..40_000).map(|i| (at([3.0, 15.0][i % 2]), [2.0, 0.5][i % 2] * random.next_normal())).collect();
        let [near, far, none, _] = Calibration::measured(&errors).factors();
        assert!((near - 2.0).abs() < 0.05 && far == 1.0 && none == 1.0, "{near} {far} {none}");
    }
}
