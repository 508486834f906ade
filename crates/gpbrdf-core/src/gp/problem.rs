//! What a solver is given to fit, and who watches it.

use std::cell::Cell;
use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;

use crate::base::error::{Error, Result};
use crate::brdf::angles::HalfDiff;
use crate::gp::optimize::OptimizeOptions;
use crate::gp::posterior::Posterior;
use crate::gp::report::{FitReport, Noise};
use crate::kernel::Shape;
use crate::sample::lattice::LatticeLayout;
use crate::sample::space::InputSpace;

/// A posterior and how the search for its hyper-parameters went.
pub(crate) type Fitted = (Arc<dyn Posterior>, FitReport);

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
