//! The rule for the noise variance of a fit, and the report of its search.

use serde::{Deserialize, Serialize};

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

/// The outcome of a search for hyper-parameters.
#[derive(Clone, Debug, PartialEq)]
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
}
