//! Shapes and their slopes over whole slices, in vector instructions where the form is closed.

use super::shape::Shape;
use super::slices::{bounded, matern12, matern32, matern52, squared_exponential};
use crate::base::simd::{exp_negative, vectorized};

#[inline(always)]
fn map_pair(r2: &[f64], value: &mut [f64], slope: &mut [f64], f: impl Fn(f64) -> (f64, f64)) {
    vectorized(
        #[inline(always)]
        || {
            for ((r2, value), slope) in r2.iter().zip(value).zip(slope) {
                (*value, *slope) = f(*r2);
            }
        },
    );
}

impl Shape {
    /// [`Shape::value_and_slope`] of every squared scaled distance; three slices of one length.
    pub(crate) fn fill_with_slope(self, r2: &[f64], value: &mut [f64], slope: &mut [f64]) {
        match self {
            Self::SquaredExponential => map_pair(r2, value, slope, |r2| {
                let k = squared_exponential(1.0, 0.5 * r2);
                (k, k)
            }),
            Self::Matern12 => map_pair(r2, value, slope, |r2| {
                let r = r2.sqrt();
                let k = matern12(1.0, r2);
                (k, if r > 0.0 { k / r } else { 0.0 })
            }),
            Self::Matern32 => map_pair(r2, value, slope, |r2| {
                let e = exp_negative(bounded((3.0 * r2).sqrt()));
                (matern32(1.0, 3.0 * r2), 3.0 * e)
            }),
            Self::Matern52 => map_pair(r2, value, slope, |r2| {
                let s = bounded((5.0 * r2).sqrt());
                (matern52((1.0, 1.0 / 3.0), 5.0 * r2), 5.0 / 3.0 * (1.0 + s) * exp_negative(s))
            }),
            Self::RationalQuadratic { alpha } => {
                value.copy_from_slice(r2);
                self.fill(value);
                for ((r2, value), slope) in r2.iter().zip(value).zip(slope) {
                    *slope = *value / (1.0 + r2 / (2.0 * alpha));
                }
            }
            // Shapes without a vector form.
            _ => {
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
                let slope = shape.value_and_slope(r2).1;
                assert_eq!(values[i], pair.0[i]);
                if r2.is_finite() {
                    assert!(
                        (pair.1[i] - slope).abs() <= 2e-15 * slope + 1e-300,
                        "{shape:?} {r2:e}: {} {slope}",
                        pair.1[i]
                    );
                }
            }
        }
    }
}
