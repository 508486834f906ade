//! Shapes evaluated over whole slices, in vector instructions where there is a closed form.

use super::shape::Shape;
use crate::base::simd::{LARGEST_NEGATIVE, exp_negative, exp_slice, scale_in_place, vectorized};

/// The argument of an exponential: where it is larger than this, the value of a kernel is below 1e-300.
#[inline(always)]
pub(super) fn bounded(s: f64) -> f64 {
    if s > LARGEST_NEGATIVE { LARGEST_NEGATIVE } else { s }
}

/// `variance exp(-s)` with `s = r^2 / 2`.
#[inline(always)]
pub(super) fn squared_exponential(variance: f64, s: f64) -> f64 {
    variance * exp_negative(bounded(s))
}

/// `variance exp(-s)` with `s^2 = r^2`.
#[inline(always)]
pub(super) fn matern12(variance: f64, s2: f64) -> f64 {
    variance * exp_negative(bounded(s2.sqrt()))
}

/// `variance (1 + s) exp(-s)` with `s^2 = 3 r^2`.
#[inline(always)]
pub(super) fn matern32(variance: f64, s2: f64) -> f64 {
    let s = bounded(s2.sqrt());
    (variance + variance * s) * exp_negative(s)
}

/// `variance (1 + s + s^2 / 3) exp(-s)` with `s^2 = 5 r^2`; `third` is a third of the variance.
#[inline(always)]
pub(super) fn matern52((variance, third): (f64, f64), s2: f64) -> f64 {
    let s = bounded(s2.sqrt());
    (variance + s * (variance + s * third)) * exp_negative(s)
}

/// `out_i = f(parameters, sum_k scales_k (x_ki - y_k)^2)`.
#[inline(always)]
fn map_distances<P: Copy>(
    [x0, x1, x2]: [&[f64]; 3],
    [y0, y1, y2]: [f64; 3],
    [w0, w1, w2]: [f64; 3],
    out: &mut [f64],
    parameters: P,
    f: impl Fn(P, f64) -> f64,
) {
    // Scalars are moved into the loop, where nothing that is written can be one of them.
    vectorized(
        #[inline(always)]
        move || {
            for (((o, x0), x1), x2) in out.iter_mut().zip(x0).zip(x1).zip(x2) {
                let (d0, d1, d2) = (x0 - y0, x1 - y1, x2 - y2);
                *o = f(parameters, w0 * (d0 * d0) + w1 * (d1 * d1) + w2 * (d2 * d2));
            }
        },
    );
}

#[inline(always)]
fn map(values: &mut [f64], f: impl Fn(f64) -> f64) {
    vectorized(
        #[inline(always)]
        || {
            for v in values.iter_mut() {
                *v = f(*v);
            }
        },
    );
}

impl Shape {
    /// `out_i = variance value(sum_k scales_k (x_ki - y_k)^2)`, in one pass where there is a closed form.
    pub(super) fn fill_between(
        self,
        variance: f64,
        x: [&[f64]; 3],
        y: [f64; 3],
        scales: [f64; 3],
        out: &mut [f64],
    ) {
        let third = variance * (1.0 / 3.0);
        // The factor of the squared distance is taken into the scales.
        let scaled = |factor: f64| scales.map(|scale| factor * scale);
        match self {
            Self::SquaredExponential => {
                map_distances(x, y, scaled(0.5), out, variance, squared_exponential);
            }
            Self::Matern12 => map_distances(x, y, scales, out, variance, matern12),
            Self::Matern32 => map_distances(x, y, scaled(3.0), out, variance, matern32),
            Self::Matern52 => map_distances(x, y, scaled(5.0), out, (variance, third), matern52),
            _ => {
                map_distances(x, y, scales, out, (), |(), r2| r2);
                self.fill(out);
                scale_in_place(variance, out);
            }
        }
    }

    /// Replaces every squared scaled distance by its [`Shape::value`], with a relative error of 2e-15 and an absolute
    /// one of 1e-300.
    pub(crate) fn fill(self, r2: &mut [f64]) {
        match self {
            Self::SquaredExponential => map(r2, |r2| squared_exponential(1.0, 0.5 * r2)),
            Self::Matern12 => map(r2, |r2| matern12(1.0, r2)),
            Self::Matern32 => map(r2, |r2| matern32(1.0, 3.0 * r2)),
            Self::Matern52 => map(r2, |r2| matern52((1.0, 1.0 / 3.0), 5.0 * r2)),
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
                assert!((value - k).abs() <= 2e-15 * k + 1e-300, "{shape:?} {r2:e}: {value} {k}");
            }
        }
    }
}
