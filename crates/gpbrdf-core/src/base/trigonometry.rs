//! Inverse trigonometric functions by polynomials, faster than the machine's library and the same on every machine.
//!
//! Source of the polynomials: M. Abramowitz and I. A. Stegun, "Handbook of Mathematical Functions" (1964). The
//! functions in f32 have no branch that depends on data, so loops over them become vector instructions.

use std::f32::consts::{FRAC_PI_2, PI};

/// 4.4.49: `arctan(t) / t - 1` as a polynomial in `t^2` without constant term, highest power first, to a relative
/// error of at most 2e-8 for `t` in `[0, 1]`.
const ARCTANGENT: [f64; 8] = [
    0.002_866_225_7,
    -0.016_165_736_7,
    0.042_909_613_8,
    -0.075_289_640_0,
    0.106_562_639_3,
    -0.142_088_994_4,
    0.199_935_508_5,
    -0.333_331_452_8,
];

/// [`ARCTANGENT`] in single precision.
const ARCTANGENT_F32: [f32; 8] = narrow(ARCTANGENT);

/// 4.4.46: `arccos(x) / sqrt(1 - x)` as a polynomial in `x`, highest power first, to an absolute error of `arccos` of
/// at most 2e-8 for `x` in `[0, 1]`.
const ARCCOSINE: [f32; 8] = narrow([
    -0.001_262_491_1,
    0.006_670_090_1,
    -0.017_088_125_6,
    0.030_891_881_0,
    -0.050_174_304_6,
    0.088_978_987_4,
    -0.214_598_801_6,
    1.570_796_305_0,
]);

/// Coefficients in single precision.
const fn narrow(coefficients: [f64; 8]) -> [f32; 8] {
    let mut out = [0.0; 8];
    let mut i = 0;
    while i < 8 {
        #[expect(clippy::cast_possible_truncation, reason = "the precision of the functions that use them")]
        {
            out[i] = coefficients[i] as f32;
        }
        i += 1;
    }
    out
}

/// `atan2` with an error of at most 5e-8; 0 where both arguments are 0.
pub(crate) fn atan2(y: f64, x: f64) -> f64 {
    use std::f64::consts::{FRAC_PI_2, PI};
    let (ax, ay) = (x.abs(), y.abs());
    let large = ax.max(ay);
    if !(large > 0.0) {
        return 0.0;
    }
    let t = ax.min(ay) / large;
    let s = t * t;
    let poly = ARCTANGENT.iter().fold(0.0, |sum, c| (sum + c) * s);
    let octant = t + t * poly;
    let quadrant = if ay > ax { FRAC_PI_2 - octant } else { octant };
    let half = if x < 0.0 { PI - quadrant } else { quadrant };
    half.copysign(y)
}

/// `atan2(y, x)` in `[0, pi]` for `y >= 0`, with an error of at most 5e-7 and, for `x >= 0`, a relative one of as much;
/// 0 where both arguments are 0.
#[inline(always)]
pub(crate) fn atan2_upper(y: f32, x: f32) -> f32 {
    let ax = x.abs();
    let large = if ax > y { ax } else { y };
    let small = if ax > y { y } else { ax };
    // The smallest normal number keeps 0 / 0 away.
    let t = small / if large > f32::MIN_POSITIVE { large } else { f32::MIN_POSITIVE };
    let s = t * t;
    let mut poly = ARCTANGENT_F32[0] * s;
    for c in &ARCTANGENT_F32[1..] {
        poly = (poly + c) * s;
    }
    // Differences from one of two constants need no branch in loops without vector instructions, either.
    let quadrant = ((if y > ax { FRAC_PI_2 } else { 0.0 }) - (t + t * poly)).abs();
    ((if x < 0.0 { PI } else { 0.0 }) - quadrant).abs()
}

/// `acos(x)` for `x` in `[-1, 1]`, with an error of at most 5e-7, two units in the last place of `pi`.
#[inline(always)]
pub(crate) fn acos(x: f32) -> f32 {
    let a = x.abs();
    let mut poly = ARCCOSINE[0];
    for c in &ARCCOSINE[1..] {
        poly = poly * a + c;
    }
    ((if x < 0.0 { PI } else { 0.0 }) - (1.0 - a).sqrt() * poly).abs()
}

/// `(sin(x), cos(x))` for `x` in `[0, pi]`, with an error of at most 3e-7.
///
/// Taylor's polynomials of degrees 11 and 12 about `pi/2`; what they leave out is at most 6e-8.
#[inline(always)]
pub(crate) fn sin_cos_upper(x: f32) -> (f32, f32) {
    let t = x - FRAC_PI_2;
    let s = t * t;
    let sine = t
        * (1.0
            + s * (-1.0 / 6.0
                + s * (1.0 / 120.0
                    + s * (-1.0 / 5_040.0 + s * (1.0 / 362_880.0 - s * (1.0 / 39_916_800.0))))));
    let cosine = 1.0
        + s * (-0.5
            + s * (1.0 / 24.0
                + s * (-1.0 / 720.0
                    + s * (1.0 / 40_320.0 + s * (-1.0 / 3_628_800.0 + s * (1.0 / 479_001_600.0))))));
    (cosine, -sine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_agree_with_the_library() {
        for i in 0..=200_000 {
            let x = -1.0 + i as f32 / 100_000.0;
            let exact = f64::from(x).acos();
            assert!((f64::from(acos(x)) - exact).abs() < 5e-7, "acos {x}");
            let angle = i as f32 / 200_000.0 * PI;
            let (sine, cosine) = sin_cos_upper(angle);
            let exact = f64::from(angle).sin_cos();
            assert!((f64::from(sine) - exact.0).abs() < 3e-7, "sin {angle}");
            assert!((f64::from(cosine) - exact.1).abs() < 3e-7, "cos {angle}");
            for radius in [1e-6, 0.3, 2.0] {
                let (y, x) = (radius * angle.sin().max(0.0), radius * angle.cos());
                let exact = f64::from(y).atan2(f64::from(x));
                let error = (f64::from(atan2_upper(y, x)) - exact).abs();
                assert!(error < 5e-7 && (x < 0.0 || error < 5e-7 * exact.max(1e-30)), "atan2 {y} {x}");
                assert!((atan2(f64::from(y), f64::from(x)) - exact).abs() < 5e-8);
                assert!((atan2(f64::from(-y), f64::from(x)) + exact).abs() < 5e-8);
            }
        }
        assert_eq!(atan2_upper(0.0, 0.0), 0.0);
        assert_eq!(atan2(0.0, 0.0), 0.0);
    }
}
