//! The input of a fit, and the observer that can stop it.

use std::cell::Cell;
use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::base::error::{Error, Result};
use crate::brdf::angles::HalfDiff;
use crate::gp::optimize::OptimizeOptions;
use crate::gp::posterior::Posterior;
use crate::gp::report::{FitReport, Noise};
use crate::kernel::Shape;
use crate::prior::Prior;
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
    /// What is done about outliers.
    pub(crate) outliers: Outliers,
    /// Settings of the search.
    pub(crate) optimize: &'a OptimizeOptions,
    /// Counts the evaluations of the likelihood and calls the observer before each of them.
    pub(crate) watch: &'a Watch<'a>,
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

/// A callback that runs before each evaluation of a likelihood. It receives the number of evaluations so far,
/// including the one that is about to run, and decides whether the search continues. The default observer
/// lets every search run to its end.
#[derive(Clone, Default)]
pub struct Observer(Option<Arc<dyn Fn(usize) -> ControlFlow<()> + Send + Sync>>);

impl Observer {
    /// An observer that calls `observe`. A search in which it returns [`ControlFlow::Break`] ends with
    /// [`Error::Cancelled`].
    pub fn new(observe: impl Fn(usize) -> ControlFlow<()> + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(observe)))
    }
}

impl fmt::Debug for Observer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Observer" } else { "no observer" })
    }
}

/// Counts the evaluations of one fit for its observer.
pub(crate) struct Watch<'a> {
    observer: &'a Observer,
    evaluations: Cell<usize>,
}

impl<'a> Watch<'a> {
    pub(crate) fn new(observer: &'a Observer) -> Self {
        Self { observer, evaluations: Cell::new(0) }
    }

    /// Counts one evaluation and calls the observer; every evaluation must be preceded by this call. The
    /// error is [`Error::Cancelled`] where the observer stops the search.
    pub(crate) fn evaluation(&self) -> Result<()> {
        self.evaluations.set(self.evaluations.get() + 1);
        match &self.observer.0 {
            Some(observe) if observe(self.evaluations.get()).is_break() => Err(Error::Cancelled),
            _ => Ok(()),
        }
    }
}
