//! Shapes evaluated over whole slices, in vector instructions where there is a closed form.

use super::shape::Shape;
use crate::base::simd::{exp, exp_slice, vectorized};

/// Above this `exp(-s)` is zero. Factors of it are bounded by this, so that infinity is not multiplied by
/// zero.
const LARGEST: f64 = 800.0;

#[inline(always)]
pub(super) fn bounded_sqrt(s2: f64) -> f64 {
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
            // Shapes without a vector form.
            _ => {
                for v in r2 {
                    *v = self.value(*v);
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
            for (value, &r2) in values.iter().zip(&r2) {
                let k = shape.value(r2);
                assert!((value - k).abs() <= 2e-15 * k, "{shape:?} {r2:e}: {value} {k}");
            }
        }
    }
}
