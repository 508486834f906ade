//! The transform from BRDF values to regression targets, and its inverse.

use serde::{Deserialize, Serialize};

use crate::base::error::{Error, Result};
use crate::base::simd::exp_slice;

/// The transform to the targets of a Gaussian process: a monotone function `g(f)` of a BRDF value `f` in
/// sr^-1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Transform {
    /// `g = f`. This is the paper's own setting.
    Identity,
    /// `g = ln(f + epsilon)`. Errors become relative to the value, and predictions stay positive.
    Log {
        /// Bounds the logarithm of dark values, sr^-1.
        epsilon: f64,
    },
    /// `g = f^(1/3)`.
    CubeRoot,
}

/// The epsilon of logarithms of BRDF values, sr^-1, in the default transform, in metrics and in pictures.
pub const LOG_EPSILON: f64 = 1e-3;

/// `ln(max(f, 0) + 1e-3)`. On this scale, errors are relative for values above [`LOG_EPSILON`].
#[must_use]
pub fn log_value(f: f64) -> f64 {
    (f.max(0.0) + LOG_EPSILON).ln()
}

impl Default for Transform {
    fn default() -> Self {
        Self::Log { epsilon: LOG_EPSILON }
    }
}

impl Transform {
    /// `g(f)`. The logarithm takes negative values as zero.
    #[must_use]
    pub fn forward(self, f: f64) -> f64 {
        match self {
            Self::Identity => f,
            Self::Log { epsilon } => (f.max(0.0) + epsilon).ln(),
            Self::CubeRoot => f.cbrt(),
        }
    }

    /// The inverse of [`Transform::forward`]: `f` at the target `g`, at least zero.
    #[must_use]
    pub fn inverse(self, g: f64) -> f64 {
        match self {
            Self::Identity => g.max(0.0),
            Self::Log { epsilon } => (g.exp() - epsilon).max(0.0),
            Self::CubeRoot => (g * g * g).max(0.0),
        }
    }

    /// [`Transform::inverse`] of a whole slice; vectorised.
    pub(crate) fn inverse_in_place(self, g: &mut [f64]) {
        match self {
            Self::Log { epsilon } => {
                exp_slice(g);
                g.iter_mut().for_each(|f| *f = (*f - epsilon).max(0.0));
            }
            _ => g.iter_mut().for_each(|x| *x = self.inverse(*x)),
        }
    }

    /// The variance that the targets of a reflectance usually have over all directions: for logarithms 4, the
    /// middle of 17 measured materials (RGL material database), which have 1.5 to 58. `None` for targets that
    /// scale with the reflectance.
    #[cfg(feature = "fit")]
    pub(crate) fn usual_variance(self) -> Option<f64> {
        matches!(self, Self::Log { .. }).then_some(4.0)
    }

    /// `df / dg` at the target `g`.
    #[cfg(feature = "fit")]
    pub(crate) fn slope_of_inverse(self, g: f64) -> f64 {
        match self {
            Self::Identity => 1.0,
            Self::Log { .. } => g.exp(),
            Self::CubeRoot => 3.0 * g * g,
        }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for an `epsilon` that is not positive and finite.
    pub fn validate(self) -> Result<()> {
        match self {
            Self::Log { epsilon } if !(epsilon > 0.0 && epsilon.is_finite()) => {
                Err(Error::argument("epsilon of the logarithmic transform", "a positive number", epsilon))
            }
            _ => Ok(()),
        }
    }
}

/// The prior mean of the Gaussian process in target units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum MeanFunction {
    /// The average target of each channel.
    #[default]
    Constant,
    /// Zero. This is the paper's own setting.
    Zero,
    /// That of a learned prior, which differs from direction to direction.
    Learned,
}

impl MeanFunction {
    /// The prior mean of one channel with these targets.
    #[must_use]
    pub fn offset(self, targets: &[f64]) -> f64 {
        match self {
            Self::Constant if !targets.is_empty() => targets.iter().sum::<f64>() / targets.len() as f64,
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_round_trip_and_never_go_below_zero() {
        for transform in [Transform::Identity, Transform::default(), Transform::CubeRoot] {
            for f in [0.0, 1e-6, 0.3, 7.0, 5e3] {
                let back = transform.inverse(transform.forward(f));
                assert!((back - f).abs() <= 1e-12 * f.max(1e-2), "{transform:?} {f} {back}");
            }
            assert!(transform.inverse(-50.0) >= 0.0 && transform.forward(-1.0).is_finite());
        }
        assert!(Transform::Log { epsilon: 0.0 }.validate().is_err());
        assert!(Transform::Log { epsilon: f64::NAN }.validate().is_err());
    }

    #[test]
    fn constant_mean_is_the_average() {
        assert_eq!(MeanFunction::Constant.offset(&[1.0, 3.0]), 2.0);
        assert_eq!(MeanFunction::Constant.offset(&[]), 0.0);
        assert_eq!(MeanFunction::Zero.offset(&[1.0, 3.0]), 0.0);
    }
}
