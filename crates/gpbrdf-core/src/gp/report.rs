//! What a search for hyper-parameters is told, and what it says.

use serde::{Deserialize, Serialize};

/// What to do with the noise variance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Noise {
    /// Found together with the other hyper-parameters.
    #[default]
    Optimized,
    /// Held at this value, in squared target units.
    Fixed(f64),
}

/// How a search for hyper-parameters went.
#[derive(Clone, Debug, PartialEq)]
pub struct FitReport {
    /// Log marginal likelihood at the result, summed over the channels.
    pub log_marginal_likelihood: f64,
    /// Evaluations of likelihood and gradient.
    pub evaluations: usize,
    /// Whether the search ended by its tolerances.
    pub converged: bool,
    /// Hyper-parameters that ended at a bound of their range.
    pub at_bound: Vec<String>,
}
