//! Which solvers there are, and which one a fit takes. A new one is entered here.

use std::cell::Cell;
use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::base::error::{Error, Result};
use crate::brdf::angles::HalfDiff;
use crate::gp::hyper::Hyper;
use crate::gp::optimize::OptimizeOptions;
use crate::gp::posterior::{Fitted, Posterior};
use crate::gp::report::Noise;
use crate::gp::tensors::TensorReader;
use crate::gp::{dense, inducing, lattice};
use crate::kernel::Shape;
use crate::sample::lattice::LatticeLayout;
use crate::sample::space::InputSpace;

/// Which exact solver to use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Solver {
    /// The lattice solver where the samples stand on a lattice, else the dense one.
    #[default]
    Auto,
    /// Kronecker algebra on a lattice, milliseconds.
    Lattice,
    /// Cholesky on any points, `O(n^3)`.
    Dense,
}

impl Solver {
    /// The solver that samples get: on a lattice or on any points.
    #[must_use]
    pub fn resolve(self, on_lattice: bool) -> Self {
        match self {
            Self::Auto if on_lattice => Self::Lattice,
            Self::Auto => Self::Dense,
            chosen => chosen,
        }
    }

    /// Finds hyper-parameters and conditions.
    pub(crate) fn fit(self, problem: &Problem<'_>) -> Result<Fitted> {
        match self.resolve(problem.lattice.is_some()) {
            Self::Lattice => lattice::posterior::fit(problem),
            _ => dense::posterior::fit(problem),
        }
    }

    /// Conditions at known hyper-parameters; the second value is the log marginal likelihood there.
    pub(crate) fn condition(problem: &Problem<'_>, hyper: &Hyper) -> Result<(Arc<dyn Posterior>, f64)> {
        match hyper.solver.resolve(problem.lattice.is_some()) {
            Self::Lattice => lattice::posterior::condition(problem, hyper),
            _ => dense::posterior::condition(problem, hyper),
        }
    }
}

/// Reads a posterior that the solver of this name has saved.
pub(crate) fn load(solver: &str, header: Value, tensors: &TensorReader<'_>) -> Result<Arc<dyn Posterior>> {
    match solver {
        lattice::posterior::NAME => lattice::posterior::load(header, tensors),
        dense::posterior::NAME => dense::posterior::load(header, tensors),
        inducing::posterior::NAME => inducing::posterior::load(header, tensors),
        other => Err(tensors.wrong("a solver of this version", format!("\"{other}\""))),
    }
}

/// What a solver is given: directions, zero-mean targets of channels that share hyper-parameters, and how to search.
pub(crate) struct Problem<'a> {
    /// Directions of the samples.
    pub(crate) angles: &'a [HalfDiff],
    /// The lattice that they stand on, if they do, in its order.
    pub(crate) lattice: Option<&'a LatticeLayout>,
    /// `[channel][sample]`.
    pub(crate) targets: Vec<Vec<f64>>,
    /// Input space of samples off the lattice.
    pub(crate) space: InputSpace,
    /// Shapes of the kernel of each axis, summed.
    pub(crate) kernel: &'a [Vec<Shape>; 3],
    /// The rule for the noise variance.
    pub(crate) noise: Noise,
    /// How long to search.
    pub(crate) optimize: &'a OptimizeOptions,
    /// Called before each evaluation of the likelihood.
    pub(crate) watch: &'a Watch<'a>,
}

/// Called before each evaluation of a likelihood with the number of evaluations so far, this one included; it decides
/// whether the search goes on.
#[derive(Clone, Default)]
pub struct Observer(Option<Arc<dyn Fn(usize) -> ControlFlow<()> + Send + Sync>>);

impl Observer {
    /// An observer. A search that it breaks off ends with [`Error::Cancelled`].
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

    /// To be called before each evaluation.
    pub(crate) fn evaluation(&self) -> Result<()> {
        self.evaluations.set(self.evaluations.get() + 1);
        match &self.observer.0 {
            Some(observe) if observe(self.evaluations.get()).is_break() => Err(Error::Cancelled),
            _ => Ok(()),
        }
    }
}
