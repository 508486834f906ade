//! The unit of angles whose file does not say it.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::base::error::Result;
use crate::formats::measured::input::Input;
use crate::formats::measured::options::AngleUnit;

/// Angles that are rounded to six digits exceed their limit by less, in radians.
pub(crate) const ROUNDING: f64 = 1e-3;

/// What the angles of a file say about their unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    /// Whether all could be in radians.
    could_be_radians: bool,
    /// Whether one is a multiple of a quarter turn in radians, to the five digits at least that it has.
    has_pi: bool,
    /// Whether all are whole numbers.
    whole: bool,
}

impl Default for Evidence {
    fn default() -> Self {
        Self { could_be_radians: true, has_pi: false, whole: true }
    }
}

impl Evidence {
    /// Takes in an angle from the normal.
    pub(crate) fn zenith(&mut self, angle: f64) {
        self.could_be_radians &= angle.abs() <= FRAC_PI_2 + ROUNDING;
        self.whole &= angle.fract() == 0.0;
    }

    /// Takes in an azimuth.
    pub(crate) fn azimuth(&mut self, angle: f64) {
        self.could_be_radians &= angle.abs() <= 2.0 * PI + ROUNDING;
        self.whole &= angle.fract() == 0.0;
        let quarters = (angle.abs() / FRAC_PI_2).round();
        self.has_pi |= (1.0..=4.0).contains(&quarters) && (angle.abs() - quarters * FRAC_PI_2).abs() < 6e-6;
    }

    /// The unit, where neither the names nor the options say it. `whole_degrees` says whether whole numbers
    /// are degrees.
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format), which names the option, if both are possible.
    pub(crate) fn unit(self, input: &Input<'_>, whole_degrees: bool) -> Result<AngleUnit> {
        if !self.could_be_radians || (self.whole && whole_degrees) {
            Ok(AngleUnit::Degrees)
        } else if self.has_pi {
            Ok(AngleUnit::Radians)
        } else {
            Err(input.wrong(
                "a unit of the angles, as in `theta_i_deg` or `theta_i_rad`, or the option --angles",
                "angles without a unit that are possible in degrees and in radians",
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::formats::measured::ReadOptions;

    #[test]
    fn only_certain_units_are_accepted() {
        let unit = |zeniths: &[f64], azimuths: &[f64]| {
            let mut evidence = Evidence::default();
            zeniths.iter().for_each(|&angle| evidence.zenith(angle));
            azimuths.iter().for_each(|&angle| evidence.azimuth(angle));
            let options = ReadOptions::default();
            evidence
                .unit(&Input { format: "x", path: Path::new("x"), bytes: b"", options: &options }, true)
                .ok()
        };
        let round = |x: f64, digits: i32| (x * 10f64.powi(digits)).round() / 10f64.powi(digits);
        assert_eq!(unit(&[10.5, 0.3], &[0.0]), Some(AngleUnit::Degrees));
        assert_eq!(unit(&[1.0, 0.0], &[0.0]), Some(AngleUnit::Degrees));
        assert_eq!(unit(&[0.5], &[180.0]), Some(AngleUnit::Degrees));
        assert_eq!(unit(&[0.5], &[round(PI, 5)]), Some(AngleUnit::Radians));
        assert_eq!(unit(&[0.5], &[-round(2.0 * PI, 6)]), Some(AngleUnit::Radians));
        assert_eq!(unit(&[0.5], &[round(PI, 2)]), None);
        assert_eq!(unit(&[0.5, 1.5], &[0.0]), None);
    }
}
