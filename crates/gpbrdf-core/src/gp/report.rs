//! The rule for the noise variance of a fit, and the report of its search.

use serde::{Deserialize, Serialize};

use crate::base::error::{Error, Result};
use crate::gp::LeaveOneOut;

/// The rule for the noise variance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Noise {
    /// The noise variance is optimised together with the other hyper-parameters.
    #[default]
    Optimized,
    /// The noise variance is held at this value, in squared target units.
    Fixed(f64),
}

impl Noise {
    /// Checks a fixed variance.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for one that is not positive and finite.
    pub(crate) fn validate(self) -> Result<()> {
        match self {
            Self::Fixed(variance) if !(variance > 0.0 && variance.is_finite()) => {
                Err(Error::argument("noise variance", "a positive number", variance))
            }
            _ => Ok(()),
        }
    }
}

/// The outcome of a search for hyper-parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitReport {
    /// Log marginal likelihood at the hyper-parameters that were found, summed over the channels. For a
    /// compressed table it is the variational bound.
    pub log_marginal_likelihood: f64,
    /// Number of evaluations of the likelihood and its gradient; for a compressed table, of regressions
    /// solved.
    pub evaluations: usize,
    /// Whether the search ended because it reached one of its tolerances.
    pub converged: bool,
    /// Names of the hyper-parameters that ended at a bound of their range.
    pub at_bound: Vec<String>,
    /// Every sample as it is predicted from all others, in the order of the samples; `None` where the solver
    /// does not compute it.
    pub leave_one_out: Option<LeaveOneOut>,
    /// The weight of each sample: its noise variance is that of all samples divided by the weight. Empty where
    /// all weights are 1.
    pub weights: Vec<f64>,
    /// With a learned prior: the log marginal likelihood of the brightness of `n` samples with the prior, less that of
    /// a stationary process about their mean, plus `ln(n) / 2` for that mean, which is a parameter more (G. Schwarz,
    /// "Estimating the Dimension of a Model", 1978); `None` without a prior, and for samples on a lattice or in the
    /// plane of incidence, for which it decides nothing.
    pub evidence_of_prior: Option<f64>,
}
