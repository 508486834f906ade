//! Radial covariance shapes of unit variance and unit length scale.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::kernel::bessel::scaled_bessel_k;

/// A radial covariance function `k(r)` with `k(0) = 1`, of the scaled distance
/// `r = sqrt(sum_k (x_k - x'_k)^2 / l_k^2)`.
///
/// Sources: the paper eqs. 6, 7 and 21; C. E. Rasmussen and C. K. I. Williams, "Gaussian Processes for Machine
/// Learning" (2006), eqs. 4.9, 4.14, 4.17 and 4.19. The paper's eq. 21 prints `sqrt(2 nu r)` where the Matern
/// class has `sqrt(2 nu) r`; the latter is what stands here.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Shape {
    /// `exp(-r^2 / 2)`.
    SquaredExponential,
    /// `(1 + r^2 / (2 alpha))^-alpha`: a scale mixture of squared exponentials.
    RationalQuadratic {
        /// Mixture parameter, positive; the squared exponential is its limit at infinity.
        alpha: f64,
    },
    /// `exp(-r)`: continuous paths.
    Matern12,
    /// `(1 + sqrt(3) r) exp(-sqrt(3) r)`: once differentiable paths.
    Matern32,
    /// `(1 + sqrt(5) r + 5 r^2 / 3) exp(-sqrt(5) r)`: twice differentiable paths.
    Matern52,
    /// `2^(1 - nu) / Gamma(nu) (sqrt(2 nu) r)^nu K_nu(sqrt(2 nu) r)`, with the modified Bessel function of the
    /// second kind. About a hundred times slower than the closed forms.
    Matern {
        /// Smoothness, in `[0.05, 50]`; the parameter is not optimised.
        nu: f64,
    },
}

impl Shape {
    /// `k` as a function of the squared scaled distance.
    #[must_use]
    pub fn value(self, r2: f64) -> f64 {
        match self {
            Self::SquaredExponential => (-0.5 * r2).exp(),
            Self::RationalQuadratic { alpha } => (-alpha * (r2 / (2.0 * alpha)).ln_1p()).exp(),
            Self::Matern12 => (-r2.sqrt()).exp(),
            Self::Matern32 => {
                let s = (3.0 * r2).sqrt();
                (1.0 + s) * (-s).exp()
            }
            Self::Matern52 => {
                let s = (5.0 * r2).sqrt();
                (1.0 + s + s * s / 3.0) * (-s).exp()
            }
            Self::Matern { nu } => general_matern(nu, r2).0,
        }
    }

    /// `k` and `dk / d ln r = r dk/dr`, which is zero at `r = 0` for every shape. The derivative in the logarithm of
    /// an ARD length scale is `-(dk / d ln r) (d_k / l_k)^2 / r^2`.
    #[must_use]
    pub fn value_and_log_slope(self, r2: f64) -> (f64, f64) {
        match self {
            Self::SquaredExponential => {
                let k = (-0.5 * r2).exp();
                (k, -r2 * k)
            }
            Self::RationalQuadratic { alpha } => {
                let base = 1.0 + r2 / (2.0 * alpha);
                let k = (-alpha * (r2 / (2.0 * alpha)).ln_1p()).exp();
                (k, -r2 * k / base)
            }
            Self::Matern12 => {
                let r = r2.sqrt();
                let k = (-r).exp();
                (k, -r * k)
            }
            Self::Matern32 => {
                let s = (3.0 * r2).sqrt();
                let e = (-s).exp();
                ((1.0 + s) * e, -s * s * e)
            }
            Self::Matern52 => {
                let s = (5.0 * r2).sqrt();
                let e = (-s).exp();
                ((1.0 + s + s * s / 3.0) * e, -s * s * (1.0 + s) / 3.0 * e)
            }
            Self::Matern { nu } => general_matern(nu, r2),
        }
    }

    /// `dk / d ln alpha`; zero for shapes without `alpha`.
    #[must_use]
    pub fn d_log_alpha(self, r2: f64) -> f64 {
        match self {
            Self::RationalQuadratic { alpha } => {
                let x = r2 / (2.0 * alpha);
                let k = (-alpha * x.ln_1p()).exp();
                alpha * k * (x / (1.0 + x) - x.ln_1p())
            }
            _ => 0.0,
        }
    }

    /// The mixture parameter of a rational quadratic.
    #[must_use]
    pub fn alpha(self) -> Option<f64> {
        match self {
            Self::RationalQuadratic { alpha } => Some(alpha),
            _ => None,
        }
    }

    /// The same shape with another `alpha`, where it has one.
    #[must_use]
    pub fn with_alpha(self, alpha: f64) -> Self {
        match self {
            Self::RationalQuadratic { .. } => Self::RationalQuadratic { alpha },
            other => other,
        }
    }

    /// The name in reports and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SquaredExponential => "squared_exponential",
            Self::RationalQuadratic { .. } => "rational_quadratic",
            Self::Matern12 => "matern_1_2",
            Self::Matern32 => "matern_3_2",
            Self::Matern52 => "matern_5_2",
            Self::Matern { .. } => "matern",
        }
    }

    /// Checks the parameter.
    ///
    /// # Errors
    /// `alpha` not positive and finite, `nu` outside `[0.05, 50]`.
    pub fn validate(self) -> Result<()> {
        match self {
            Self::RationalQuadratic { alpha } if !(alpha > 0.0 && alpha.is_finite()) => {
                Err(Error::argument("alpha of the rational quadratic kernel", "a positive number", alpha))
            }
            Self::Matern { nu } if !(0.05..=50.0).contains(&nu) => {
                Err(Error::argument("nu of the Matern kernel", "0.05 to 50", nu))
            }
            _ => Ok(()),
        }
    }
}

/// The Matern class and its derivative in `ln r`, from `d/dz [z^nu K_nu(z)] = -z^nu K_(nu-1)(z)`
/// (NIST DLMF 10.29.4).
fn general_matern(nu: f64, r2: f64) -> (f64, f64) {
    let z = (2.0 * nu * r2).sqrt();
    if z < 1e-150 {
        return (1.0, 0.0);
    }
    let log_factor = (1.0 - nu) * std::f64::consts::LN_2 - libm::lgamma(nu) + nu * z.ln();
    let value = scaled_bessel_k(nu, z, log_factor);
    let slope = scaled_bessel_k((nu - 1.0).abs(), z, log_factor + z.ln());
    (value.min(1.0), -slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Shape; 9] = [
        Shape::SquaredExponential,
        Shape::RationalQuadratic { alpha: 0.8 },
        Shape::Matern12,
        Shape::Matern32,
        Shape::Matern52,
        Shape::Matern { nu: 0.05 },
        Shape::Matern { nu: 0.4 },
        Shape::Matern { nu: 1.3 },
        Shape::Matern { nu: 50.0 },
    ];

    #[test]
    fn shapes_start_at_one_and_fall() {
        for shape in ALL {
            assert_eq!(shape.value(0.0), 1.0, "{shape:?}");
            assert_eq!(shape.value_and_log_slope(0.0), (1.0, 0.0), "{shape:?}");
            let mut previous = 1.0;
            for i in 1..200 {
                let (value, slope) = shape.value_and_log_slope((f64::from(i) * 0.05).powi(2));
                assert!(value < previous && value > 0.0 && slope < 0.0, "{shape:?} {i} {value}");
                previous = value;
            }
            assert!(shape.value(1e12).abs() < 1e-8);
        }
    }

    #[test]
    fn slopes_agree_with_finite_differences() {
        for shape in ALL {
            for r in [0.01, 0.3, 1.0, 4.0] {
                let at = |log_r: f64| shape.value((2.0 * log_r).exp());
                let step = 1e-5;
                let numeric = (at(f64::ln(r) + step) - at(f64::ln(r) - step)) / (2.0 * step);
                let (_, slope) = shape.value_and_log_slope(r * r);
                assert!((slope - numeric).abs() < 1e-8, "{shape:?} {r} {slope} {numeric}");
            }
        }
    }

    #[test]
    fn general_matern_agrees_with_the_closed_forms() {
        for (nu, closed) in [(0.5, Shape::Matern12), (1.5, Shape::Matern32), (2.5, Shape::Matern52)] {
            for r in [1e-12, 1e-3, 0.2, 1.0, 7.0, 40.0] {
                let (a, b) =
                    (Shape::Matern { nu }.value_and_log_slope(r * r), closed.value_and_log_slope(r * r));
                assert!((a.0 / b.0 - 1.0).abs() < 1e-12, "{nu} {r} {a:?} {b:?}");
                assert!((a.1 - b.1).abs() < 1e-12 * b.1.abs() + 1e-16, "{nu} {r} {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn parameters_are_checked() {
        assert!(Shape::Matern { nu: 0.0 }.validate().is_err());
        assert!(Shape::RationalQuadratic { alpha: -1.0 }.validate().is_err());
        assert!(ALL.into_iter().all(|s| s.validate().is_ok()));
    }
}
