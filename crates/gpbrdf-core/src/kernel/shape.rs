//! Radial covariance shapes of unit variance and unit length scale.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

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
