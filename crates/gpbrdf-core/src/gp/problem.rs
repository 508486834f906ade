//! The input of a fit.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::base::error::{Error, Result};
use crate::base::watch::Watch;
use crate::brdf::angles::HalfDiff;
use crate::gp::optimize::OptimizeOptions;
use crate::gp::posterior::Posterior;
use crate::gp::report::{FitReport, Noise};
use crate::kernel::Shape;
use crate::prior::Prior;
use crate::sample::blind_spots::is_in_plane;
use crate::sample::lattice::LatticeLayout;
use crate::sample::space::InputSpace;

/// A posterior and the report of the search for its hyper-parameters.
pub(crate) type Fitted = (Arc<dyn Posterior>, FitReport);

/// The input of a solver: directions, zero-mean targets of channels that share hyper-parameters, and the
/// settings of the search.
#[derive(Clone)]
pub(crate) struct Problem<'a> {
    /// Directions of the samples.
    pub(crate) angles: &'a [HalfDiff],
    /// The lattice on which the samples lie, in the order of its nodes; `None` for samples off a lattice.
    pub(crate) lattice: Option<&'a LatticeLayout>,
    /// Zero-mean targets, `[channel][sample]`.
    pub(crate) targets: Vec<Vec<f64>>,
    /// Input space for samples off a lattice, if it is not to be chosen.
    pub(crate) space: Option<InputSpace>,
    /// For each axis, the shapes whose kernels are summed.
    pub(crate) kernel: &'a [Vec<Shape>; 3],
    /// The rule for the noise variance.
    pub(crate) noise: Noise,
    /// What is known of the noise variance of each sample, in squared target units; empty if nothing is.
    pub(crate) known_noise: &'a [f64],
    /// Whether hyper-parameters have priors.
    pub(crate) priors: bool,
    /// The variance that targets usually have, for these priors; `None` where only the targets tell.
    pub(crate) usual_variance: Option<f64>,
    /// A prior learned from other materials, if it is to be used.
    pub(crate) prior: Option<Arc<Prior>>,
    /// Functions that describe the targets together with the kernel.
    pub(crate) basis: Option<BasisTerm<'a>>,
    /// Whether a process with a basis factorises its whole covariance in the search, however many samples there are.
    pub(crate) factorises: bool,
    /// What is done about outliers.
    pub(crate) outliers: Outliers,
    /// Settings of the search.
    pub(crate) optimize: &'a OptimizeOptions,
    /// Counts the evaluations of the likelihood and calls the observer before each of them, and during other long
    /// work.
    pub(crate) watch: &'a Watch,
}

/// Basis functions with independent coefficients of the same variance, about 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BasisTerm<'a> {
    /// The number of functions.
    pub(crate) count: usize,
    /// Their values at the samples, one row per sample.
    pub(crate) rows: &'a [f64],
    /// The standard deviation of what they usually leave.
    pub(crate) left: f64,
}

impl Problem<'_> {
    /// Whether all samples lie in the plane of incidence.
    pub(crate) fn is_in_plane(&self) -> bool {
        self.angles.iter().all(|angles| is_in_plane(*angles))
    }

    /// Refuses samples with standard deviations of their own, for solvers whose samples share one noise.
    pub(crate) fn refuse_known_noise(&self) -> Result<()> {
        if self.known_noise.is_empty() {
            return Ok(());
        }
        let found = "samples with standard deviations of their own";
        Err(Error::argument(
            "samples of this solver",
            "one noise for all of them (or the scattered solver)",
            found,
        ))
    }
}

/// Some of the samples of a problem.
#[derive(Debug)]
pub(crate) struct Subset {
    angles: Vec<HalfDiff>,
    targets: Vec<Vec<f64>>,
    known_noise: Vec<f64>,
    /// Values of the basis functions of the problem, if it has any.
    rows: Vec<f64>,
}

impl Subset {
    /// The samples of these indices.
    pub(crate) fn new(problem: &Problem<'_>, indices: &[usize]) -> Self {
        let pick =
            |values: &[f64]| indices.iter().filter_map(|&i| values.get(i).copied()).collect::<Vec<f64>>();
        let rows = problem.basis.map_or_else(Vec::new, |BasisTerm { count, rows, .. }| {
            indices.iter().flat_map(|&i| &rows[i * count..(i + 1) * count]).copied().collect()
        });
        Self {
            angles: indices.iter().map(|&i| problem.angles[i]).collect(),
            targets: problem.targets.iter().map(|y| pick(y)).collect(),
            known_noise: pick(problem.known_noise),
            rows,
        }
    }

    /// The problem of these samples alone, off a lattice.
    pub(crate) fn of<'a>(&'a self, problem: &Problem<'a>) -> Problem<'a> {
        Problem {
            angles: &self.angles,
            lattice: None,
            targets: self.targets.clone(),
            known_noise: &self.known_noise,
            basis: problem.basis.map(|basis| BasisTerm { rows: &self.rows, ..basis }),
            ..problem.clone()
        }
    }
}

/// What is done about samples that contradict all samples around them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outliers {
    /// They are taken like all others.
    Keep,
    /// Their noise variance is larger, according to Student's t distribution, so that they hardly count.
    #[default]
    Downweight,
}
