//! Shapes evaluated over whole slices, in vector instructions where there is a closed form.

use super::shape::Shape;
use crate::base::simd::{exp, exp_slice, vectorized};

/// Above this `exp(-s)` is zero. Factors of it are bounded by this, so that infinity is not multiplied by
/// zero.
const LARGEST: f64 = 800.0;

#[inline(always)]
fn bounded_sqrt(s2: f64) -> f64 {
    let s = s2.sqrt();
    if s > LARGEST { LARGEST } else { s }
}

#[inline(always)]
fn map(values: &mut [f64], f: impl Fn(f64) -> f64) {
    vectorized(|| {
        for v in values.iter_mut() {
            *v = f(*v);
        }
    });
}

#[inline(always)]
fn map_pair(r2: &[f64], value: &mut [f64], slope: &mut [f64], f: impl Fn(f64) -> (f64, f64)) {
    vectorized(|| {
        for ((r2, value), slope) in r2.iter().zip(value).zip(slope) {
            (*value, *slope) = f(*r2);
        }
    });
}

impl Shape {
    /// Replaces every squared scaled distance by its [`Shape::value`], with an error of 1e-15.
    pub(crate) fn fill(self, r2: &mut [f64]) {
        match self {
            Self::SquaredExponential => map(r2, |r2| exp(-0.5 * r2)),
            Self::Matern12 => map(r2, |r2| exp(-r2.sqrt())),
            Self::Matern32 => map(r2, |r2| {
                let s = bounded_sqrt(3.0 * r2);
                (1.0 + s) * exp(-s)
            }),
            Self::Matern52 => map(r2, |r2| {
                let s = bounded_sqrt(5.0 * r2);
                (1.0 + s + s * s * (1.0 / 3.0)) * exp(-s)
            }),
            Self::RationalQuadratic { alpha } => {
                for v in r2.iter_mut() {
                    *v = -alpha * (*v / (2.0 * alpha)).ln_1p();
                }
                exp_slice(r2);
            }
            Self::Matern { .. } => {
                for v in r2 {
                    *v = self.value(*v);
                }
            }
        }
    }

    /// [`Shape::value_and_slope`] of every squared scaled distance. The three slices have the same length.
    pub(crate) fn fill_with_slope(self, r2: &[f64], value: &mut [f64], slope: &mut [f64]) {
        match self {
            Self::SquaredExponential => map_pair(r2, value, slope, |r2| {
                let k = exp(-0.5 * r2);
                (k, k)
            }),
            Self::Matern12 => map_pair(r2, value, slope, |r2| {
                let r = r2.sqrt();
                let k = exp(-r);
                (k, if r > 0.0 { k / r } else { 0.0 })
            }),
            Self::Matern32 => map_pair(r2, value, slope, |r2| {
                let s = bounded_sqrt(3.0 * r2);
                let e = exp(-s);
                ((1.0 + s) * e, 3.0 * e)
            }),
            Self::Matern52 => map_pair(r2, value, slope, |r2| {
                let s = bounded_sqrt(5.0 * r2);
                let e = exp(-s);
                ((1.0 + s + s * s * (1.0 / 3.0)) * e, 5.0 / 3.0 * (1.0 + s) * e)
            }),
            Self::RationalQuadratic { alpha } => {
                value.copy_from_slice(r2);
                self.fill(value);
                for ((r2, value), slope) in r2.iter().zip(value).zip(slope) {
                    *slope = *value / (1.0 + r2 / (2.0 * alpha));
                }
            }
            Self::Matern { .. } => {
                for ((r2, value), slope) in r2.iter().zip(value).zip(slope) {
                    (*value, *slope) = self.value_and_slope(*r2);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_match_the_scalar_functions() {
        let r2: Vec<f64> = [0.0, 1e-320, 1e-200, 3e5, 1e7, 1e300, f64::INFINITY]
            .into_iter()
            .chain((0..500).map(|i| 1e-12 * 1.08f64.powi(i)))
            .collect();
        for shape in [
            Shape::SquaredExponential,
            Shape::RationalQuadratic { alpha: 1.7 },
            Shape::Matern12,
            Shape::Matern32,
            Shape::Matern52,
            Shape::Matern { nu: 0.8 },
        ] {
            let mut values = r2.clone();
            shape.fill(&mut values);
            let mut pair = (vec![0.0; r2.len()], vec![0.0; r2.len()]);
            shape.fill_with_slope(&r2, &mut pair.0, &mut pair.1);
            for (i, &r2) in r2.iter().enumerate() {
                let (k, slope) = shape.value_and_slope(r2);
                assert!((values[i] - k).abs() <= 2e-15 * k, "{shape:?} {r2:e}: {} {k}", values[i]);
                assert_eq!(values[i], pair.0[i]);
                if r2.is_finite() {
                    assert!(
                        (pair.1[i] - slope).abs() <= 2e-15 * slope,
                        "{shape:?} {r2:e}: {} {slope}",
                        pair.1[i]
                    );
                }
            }
        }
    }
}
