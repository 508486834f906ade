//! Radial covariance shapes of unit variance and unit length scale.

use serde::{Deserialize, Serialize};

use super::bessel::log_power_bessel_k;
use crate::base::error::{Error, Result};

/// A radial covariance function `k(r)` with `k(0) = 1`, of the scaled distance
/// `r = sqrt(sum_k (x_k - x'_k)^2 / l_k^2)`.
///
/// Sources: the paper, eqs. 6, 7 and 21; C. E. Rasmussen and C. K. I. Williams, "Gaussian Processes for
/// Machine Learning" (2006), eqs. 4.9, 4.14, 4.17 and 4.19. The paper's eq. 21 prints `sqrt(2 nu r)` where
/// the Matern class has `sqrt(2 nu) r`; the latter is used here.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Shape {
    /// `exp(-r^2 / 2)`.
    #[serde(rename = "se")]
    SquaredExponential,
    /// `(1 + r^2 / (2 alpha))^-alpha`: a scale mixture of squared exponentials.
    #[serde(rename = "rq")]
    RationalQuadratic {
        /// Mixture parameter, positive; the squared exponential is its limit at infinity.
        alpha: f64,
    },
    /// `exp(-r)`: continuous paths.
    #[serde(rename = "matern12")]
    Matern12,
    /// `(1 + sqrt(3) r) exp(-sqrt(3) r)`: once differentiable paths.
    #[serde(rename = "matern32")]
    Matern32,
    /// `(1 + sqrt(5) r + 5 r^2 / 3) exp(-sqrt(5) r)`: twice differentiable paths.
    #[serde(rename = "matern52")]
    Matern52,
    /// `2^(1 - nu) / Gamma(nu) (sqrt(2 nu) r)^nu K_nu(sqrt(2 nu) r)`, with the modified Bessel function of
    /// the second kind. About a hundred times slower than the closed forms.
    Matern {
        /// Smoothness, in `[0.05, 50]`; the parameter is not optimised.
        nu: f64,
    },
}

/// The orders that [`Shape::Matern`] accepts.
const NU_RANGE: std::ops::RangeInclusive<f64> = 0.05..=50.0;

/// Below this squared distance the general Matern shape is evaluated at zero: its square root is the smallest
/// distance whose square is a normal number.
const TINY_R2: f64 = f64::MIN_POSITIVE;

impl Shape {
    /// `k` as a function of the squared scaled distance `r2 = r^2 >= 0`. NaN for an invalid parameter.
    #[must_use]
    pub fn value(self, r2: f64) -> f64 {
        match self {
            Self::SquaredExponential => (-0.5 * r2).exp(),
            Self::RationalQuadratic { alpha } => (-alpha * (r2 / (2.0 * alpha)).ln_1p()).exp(),
            Self::Matern12 => (-r2.sqrt()).exp(),
            Self::Matern32 => {
                let s = (3.0 * r2).sqrt();
                finite_or_zero((1.0 + s) * (-s).exp(), s)
            }
            Self::Matern52 => {
                let s2 = 5.0 * r2;
                let s = s2.sqrt();
                finite_or_zero((1.0 + s + s2 / 3.0) * (-s).exp(), s)
            }
            Self::Matern { nu } => matern(nu, nu, r2, 0.0),
        }
    }

    /// `(k, slope)` with `slope = -2 dk/d(r^2) = -(dk/dr) / r >= 0`, at the squared scaled distance `r2`.
    ///
    /// The derivative with respect to the logarithm of one length scale is then a product, without a quotient
    /// of small numbers: `dk/d(ln l_k) = slope (x_k - x'_k)^2 / l_k^2`. Where the slope diverges at `r = 0`
    /// (Matern, `nu <= 1`), it is set to 0 there, since that product tends to 0.
    #[must_use]
    pub fn value_and_slope(self, r2: f64) -> (f64, f64) {
        match self {
            Self::SquaredExponential => {
                let k = (-0.5 * r2).exp();
                (k, k)
            }
            Self::RationalQuadratic { alpha } => {
                let q = r2 / (2.0 * alpha);
                let k = (-alpha * q.ln_1p()).exp();
                (k, k / (1.0 + q))
            }
            Self::Matern12 => {
                let r = r2.sqrt();
                let k = (-r).exp();
                (k, if r > 0.0 { k / r } else { 0.0 })
            }
            Self::Matern32 => {
                let s = (3.0 * r2).sqrt();
                let e = (-s).exp();
                (finite_or_zero((1.0 + s) * e, s), 3.0 * e)
            }
            Self::Matern52 => {
                let s2 = 5.0 * r2;
                let s = s2.sqrt();
                let e = (-s).exp();
                let slope = 5.0 / 3.0 * (1.0 + s) * e;
                (finite_or_zero((1.0 + s + s2 / 3.0) * e, s), finite_or_zero(slope, s))
            }
            // By DLMF 10.29.4, d/dz [z^nu K_nu(z)] = -z^nu K_(nu-1)(z); here z = sqrt(2 nu) r.
            Self::Matern { nu } => (self.value(r2), matern(nu, nu - 1.0, r2, (2.0 * nu).ln())),
        }
    }

    /// `dk/d(ln alpha)` at the squared scaled distance `r2`; 0 for the shapes that have no alpha.
    ///
    /// For the rational quadratic it is `alpha k (q / (1 + q) - ln(1 + q))` with `q = r^2 / (2 alpha)`.
    #[must_use]
    pub fn d_log_alpha(self, r2: f64) -> f64 {
        match self {
            Self::RationalQuadratic { alpha } => {
                let q = r2 / (2.0 * alpha);
                let log = q.ln_1p();
                alpha * (-alpha * log).exp() * (q / (1.0 + q) - log)
            }
            _ => 0.0,
        }
    }

    /// Checks that the parameters are in their domains.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for an `alpha` that is not positive and finite, or a `nu` outside
    /// `[0.05, 50]`.
    pub fn validate(self) -> Result<()> {
        match self {
            Self::RationalQuadratic { alpha } if !(alpha > 0.0 && alpha.is_finite()) => {
                Err(Error::argument("alpha of the rational quadratic kernel", "a positive number", alpha))
            }
            Self::Matern { nu } if !NU_RANGE.contains(&nu) => {
                Err(Error::argument("nu of the Matern kernel", "a number from 0.05 to 50", nu))
            }
            _ => Ok(()),
        }
    }

    /// Every shape, with its default parameters: an `alpha` of 1, a `nu` of 3/2.
    pub const ALL: [Self; 6] = [
        Self::SquaredExponential,
        Self::RationalQuadratic { alpha: 1.0 },
        Self::Matern12,
        Self::Matern32,
        Self::Matern52,
        Self::Matern { nu: 1.5 },
    ];

    /// The name in files, in reports and on the command line, and the name on screens.
    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::SquaredExponential => ("se", "Squared exponential"),
            Self::RationalQuadratic { .. } => ("rq", "Rational quadratic"),
            Self::Matern12 => ("matern12", "Mat\u{e9}rn 1/2"),
            Self::Matern32 => ("matern32", "Mat\u{e9}rn 3/2"),
            Self::Matern52 => ("matern52", "Mat\u{e9}rn 5/2"),
            Self::Matern { .. } => ("matern", "Mat\u{e9}rn"),
        }
    }

    /// The name in files, in reports and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.names().0
    }

    /// The name on screens.
    #[must_use]
    pub fn label(self) -> &'static str {
        self.names().1
    }

    /// The shape with this [`Shape::name`] and the parameters of [`Shape::ALL`].
    ///
    /// # Errors
    /// [`Error::UnknownName`], which lists the names that exist.
    pub fn from_name(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|shape| shape.name() == name).ok_or_else(|| Error::UnknownName {
            kind: "kernel shape",
            name: name.to_owned(),
            known: Self::ALL.map(Self::name).join(", "),
        })
    }

    /// Whether the shape has the mixture parameter alpha.
    #[must_use]
    pub fn has_alpha(self) -> bool {
        self.alpha().is_some()
    }

    /// The mixture parameter of the rational quadratic; `None` for other shapes.
    #[must_use]
    pub fn alpha(self) -> Option<f64> {
        match self {
            Self::RationalQuadratic { alpha } => Some(alpha),
            _ => None,
        }
    }

    /// The same shape with another `alpha`. Shapes without one are unchanged.
    #[must_use]
    pub fn with_alpha(self, alpha: f64) -> Self {
        match self {
            Self::RationalQuadratic { .. } => Self::RationalQuadratic { alpha },
            other => other,
        }
    }
}

/// A product that contains the factor `exp(-s)`; for an infinite `s` it would be computed as infinity times
/// zero.
fn finite_or_zero(product: f64, s: f64) -> f64 {
    if s == f64::INFINITY { 0.0 } else { product }
}

/// `exp(log_factor) 2^(1 - nu) / Gamma(nu) z^order K_order(z)` with `z = sqrt(2 nu) r`, computed in
/// logarithms.
fn matern(nu: f64, order: f64, r2: f64, log_factor: f64) -> f64 {
    if !NU_RANGE.contains(&nu) || r2.is_nan() {
        return f64::NAN;
    }
    if r2 < TINY_R2 {
        return match order {
            _ if order == nu => 1.0,
            // The limit of z^v K_v(z) at zero is 2^(v - 1) Gamma(v).
            _ if order > 0.0 => nu / order,
            _ => 0.0,
        };
    }
    let z = (2.0 * nu).sqrt() * r2.sqrt();
    // exp(-z) z^50 is zero in double precision long before this.
    if z > 4000.0 {
        return 0.0;
    }
    let log_norm = (1.0 - nu) * std::f64::consts::LN_2 - libm::lgamma(nu);
    (log_factor + log_norm + log_power_bessel_k(order, z)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Shape; 11] = [
        Shape::SquaredExponential,
        Shape::RationalQuadratic { alpha: 0.8 },
        Shape::RationalQuadratic { alpha: 1e4 },
        Shape::Matern12,
        Shape::Matern32,
        Shape::Matern52,
        Shape::Matern { nu: 0.05 },
        Shape::Matern { nu: 0.7 },
        Shape::Matern { nu: 1.0 },
        Shape::Matern { nu: 1.3 },
        Shape::Matern { nu: 50.0 },
    ];

    #[test]
    fn closed_forms_at_a_distance_of_two() {
        let cases = [
            (Shape::SquaredExponential, (-2.0f64).exp()),
            (Shape::RationalQuadratic { alpha: 1.0 }, 1.0 / 3.0),
            (Shape::Matern12, (-2.0f64).exp()),
            (Shape::Matern32, (1.0 + 12f64.sqrt()) * (-(12f64.sqrt())).exp()),
            (Shape::Matern52, (1.0 + 20f64.sqrt() + 20.0 / 3.0) * (-(20f64.sqrt())).exp()),
        ];
        for (shape, expected) in cases {
            assert!((shape.value(4.0) - expected).abs() < 1e-15, "{}", shape.name());
        }
    }

    #[test]
    fn general_nu_meets_the_closed_forms() {
        for (nu, closed) in [(0.5, Shape::Matern12), (1.5, Shape::Matern32), (2.5, Shape::Matern52)] {
            let general = Shape::Matern { nu };
            for r in [1e-150, 1e-20, 1e-7, 1e-3, 0.1, 0.9, 2.0, 7.0, 30.0, 200.0] {
                let ((k, slope), (k0, slope0)) =
                    (general.value_and_slope(r * r), closed.value_and_slope(r * r));
                assert!((k / k0 - 1.0).abs() < 1e-12, "nu {nu}, r {r}: {k} {k0}");
                assert!((slope / slope0 - 1.0).abs() < 1e-12, "nu {nu}, r {r}: {slope} {slope0}");
            }
        }
    }

    #[test]
    fn shapes_are_one_at_zero_finite_everywhere_and_never_rise() {
        for shape in ALL {
            assert_eq!(shape.value(0.0), 1.0, "{shape:?}");
            let mut last = 1.0;
            for exponent in -320..=308 {
                let r2 = 10f64.powi(exponent);
                let (k, slope) = shape.value_and_slope(r2);
                assert!(
                    k.is_finite() && slope.is_finite() && slope >= 0.0,
                    "{shape:?} at {r2:e}: {k} {slope}"
                );
                assert!((slope * r2).is_finite() && shape.d_log_alpha(r2).is_finite(), "{shape:?} at {r2:e}");
                assert!(k <= last * (1.0 + 1e-13), "{shape:?} at {r2:e}: {k} after {last}");
                assert!((k - shape.value(r2)).abs() < 1e-15);
                last = k;
            }
            assert!(shape.value(f64::INFINITY) == 0.0, "{shape:?}");
        }
    }

    #[test]
    fn slope_and_alpha_derivative_match_central_differences() {
        for shape in ALL {
            for r2 in [1e-4, 0.03, 0.5, 1.7, 6.0, 25.0] {
                let step = 1e-4 * r2;
                let slope = -(shape.value(r2 + step) - shape.value(r2 - step)) / step;
                let (_, analytic) = shape.value_and_slope(r2);
                // The last term allows for the rounding of the two values, divided by the step.
                let tolerance = 1e-6 * analytic + 1e-13 / step;
                assert!((slope - analytic).abs() < tolerance, "{shape:?} {r2}: {slope} {analytic}");
                if let Some(alpha) = shape.alpha() {
                    let h = 1e-5f64;
                    let k = |sign: f64| shape.with_alpha(alpha * (sign * h).exp()).value(r2);
                    let difference = (k(1.0) - k(-1.0)) / (2.0 * h);
                    assert!((difference - shape.d_log_alpha(r2)).abs() < 1e-9, "{shape:?} {r2}");
                }
            }
        }
    }

    #[test]
    fn invalid_parameters_are_refused_and_evaluate_to_nan() {
        for nu in [0.0, -1.0, 0.049, 50.1, f64::NAN, f64::INFINITY] {
            assert!(Shape::Matern { nu }.validate().is_err());
            assert!(Shape::Matern { nu }.value(1.0).is_nan());
        }
        for alpha in [0.0, -2.0, f64::NAN, f64::INFINITY] {
            assert!(Shape::RationalQuadratic { alpha }.validate().is_err());
        }
        for shape in ALL {
            assert!(shape.validate().is_ok());
            assert!(shape.value(f64::NAN).is_nan());
        }
    }
}
