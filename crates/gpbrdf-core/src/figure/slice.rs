//! Image slices: a BRDF at one `phi_d`, as in Disney's BRDF Explorer.

use std::f64::consts::FRAC_PI_2;

use crate::base::error::{Error, Result};
use crate::brdf::angles::{HalfDiff, fold_phi_d};
use crate::brdf::{Brdf, Rgb};
use crate::figure::picture::{Picture, Rgb8, tone_map};
use crate::sample::log_value;

/// The colour where a direction is below the horizon.
const BELOW_HORIZON: Rgb8 = [58, 58, 64];

/// How an image slice is taken and shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SliceOptions {
    /// The slice's `phi_d`, radians. At the default, pi/2, all pixels are above the horizon.
    pub phi_d: f64,
    /// Exposure in stops: values are multiplied by `2^exposure`.
    pub exposure: f64,
    /// Exposed values are raised to `1 / gamma`.
    pub gamma: f64,
    /// Whether `x` is `sqrt(theta_h / (pi/2))`, the warp of the table, instead of `theta_h / (pi/2)`.
    pub square_theta_h: bool,
    /// Number of rows and of columns.
    pub size: usize,
}

impl Default for SliceOptions {
    fn default() -> Self {
        Self { phi_d: FRAC_PI_2, exposure: 0.0, gamma: 2.2, square_theta_h: false, size: 256 }
    }
}

/// A BRDF at one `phi_d`, with one value at the centre of each pixel. `theta_h` increases from 0 to 90
/// degrees left to right, `theta_d` from 0 to 90 degrees bottom to top.
#[derive(Clone, Debug, PartialEq)]
pub struct Slice {
    size: usize,
    values: Vec<Rgb>,
    above_horizon: Vec<bool>,
}

impl Slice {
    /// Takes a slice.
    pub fn new(brdf: &(impl Brdf + ?Sized), options: &SliceOptions) -> Self {
        let size = options.size;
        let phi_d = fold_phi_d(options.phi_d);
        let angles = |i: usize| {
            let x = ((i % size) as f64 + 0.5) / size as f64;
            let y = 1.0 - ((i / size) as f64 + 0.5) / size as f64;
            let theta_h = if options.square_theta_h { x * x } else { x } * FRAC_PI_2;
            HalfDiff { theta_h, theta_d: y * FRAC_PI_2, phi_d }
        };
        Self {
            size,
            values: (0..size * size).map(|i| brdf.eval_half_diff(angles(i))).collect(),
            above_horizon: (0..size * size).map(|i| angles(i).is_above_horizon()).collect(),
        }
    }

    /// Number of rows and of columns.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// The values in sr^-1, rows from top to bottom. Where a direction is below the horizon, the value is
    /// whatever the BRDF returns there.
    #[must_use]
    pub fn values(&self) -> &[Rgb] {
        &self.values
    }

    /// For each pixel, whether both directions are above the horizon.
    #[must_use]
    pub fn above_horizon(&self) -> &[bool] {
        &self.above_horizon
    }

    /// The slice as it is shown: times `2^exposure`, clipped to `[0, 1]`, raised to `1 / gamma`. Dark grey
    /// below the horizon.
    #[must_use]
    pub fn tone_mapped(&self, options: &SliceOptions) -> Picture {
        let scale = options.exposure.exp2();
        self.picture(|i| tone_map(self.values[i], scale, options.gamma))
    }

    /// A picture of `colour(pixel)` above the horizon, and of dark grey below it.
    pub(crate) fn picture(&self, colour: impl Fn(usize) -> Rgb8) -> Picture {
        Picture::from_fn(self.size, self.size, |x, y| {
            let i = y * self.size + x;
            if self.above_horizon[i] { colour(i) } else { BELOW_HORIZON }
        })
    }

    /// `ln(f^ + 1e-3) - ln(f + 1e-3)` of this slice against `truth`, averaged over R, G and B. Negative
    /// values are taken as 0; a difference of 0.01 is one percent.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] when the slices differ in size.
    pub fn log_difference(&self, truth: &Self) -> Result<Vec<f64>> {
        if self.size != truth.size {
            let expected = format!("{0} x {0} pixels like the truth", truth.size);
            return Err(Error::argument("predicted slice", expected, format!("{0} x {0}", self.size)));
        }
        let gap = |a: &Rgb, b: &Rgb| (0..3).map(|c| log_value(a[c]) - log_value(b[c])).sum::<f64>() / 3.0;
        Ok(self.values.iter().zip(&truth.values).map(|(a, b)| gap(a, b)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::table::BrdfTable;

    #[test]
    fn theta_h_runs_right_and_theta_d_up() {
        let corner =
            BrdfTable::from_fn(|a| if a.theta_h < 0.2 && a.theta_d > 1.4 { [1.0; 3] } else { [0.0; 3] });
        let options = SliceOptions { size: 64, ..SliceOptions::default() };
        let shown = Slice::new(&corner, &options).tone_mapped(&options);
        assert_eq!(shown.pixels()[0], [255; 3]);
        for other in [63, 63 * 64, 63 * 64 + 63] {
            assert_eq!(shown.pixels()[other], [0; 3], "{other}");
        }
    }

    #[test]
    fn columns_follow_the_chosen_warp_and_exposure_doubles() {
        let ramp = BrdfTable::from_fn(|a| [a.theta_h * 0.1, a.theta_d * 0.1, 0.05]);
        for square_theta_h in [false, true] {
            let options = SliceOptions { size: 50, square_theta_h, ..SliceOptions::default() };
            let slice = Slice::new(&ramp, &options);
            let x: f64 = 30.5 / 50.0;
            let expected = if square_theta_h { x * x } else { x } * FRAC_PI_2 * 0.1;
            assert!((slice.values()[10 * 50 + 30][0] / expected - 1.0).abs() < 1e-3);
            assert!((slice.values()[10 * 50 + 30][1] / (39.5 / 50.0 * FRAC_PI_2 * 0.1) - 1.0).abs() < 1e-3);
        }
        let options = SliceOptions { size: 4, gamma: 1.0, exposure: 2.0, ..SliceOptions::default() };
        assert_eq!(Slice::new(&ramp, &options).tone_mapped(&options).pixels()[0][2], 51);
    }

    #[test]
    fn below_the_horizon_is_grey_and_differences_are_relative() {
        let one = BrdfTable::from_fn(|_| [1.0; 3]);
        let more = BrdfTable::from_fn(|_| [1.001_f64 * 1.02 - 0.001; 3]);
        let options = SliceOptions { phi_d: 0.0, size: 32, ..SliceOptions::default() };
        let slice = Slice::new(&one, &options);
        assert_eq!(slice.tone_mapped(&options).pixels()[31], BELOW_HORIZON);
        assert!(slice.above_horizon()[31 * 32]);
        let gap = Slice::new(&more, &options).log_difference(&slice).unwrap();
        assert!(gap.iter().all(|x| (x - 1.02f64.ln()).abs() < 1e-6));
        let small = Slice::new(&one, &SliceOptions { size: 8, ..options });
        assert!(small.log_difference(&slice).is_err());
    }
}
