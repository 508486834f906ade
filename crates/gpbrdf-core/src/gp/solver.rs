//! The list of solvers, and the choice of one for a fit. A new solver is registered here.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::base::error::Result;
#[cfg(feature = "fit")]
use crate::gp::hyper::Hyper;
use crate::gp::posterior::Posterior;
#[cfg(feature = "fit")]
use crate::gp::problem::{Fitted, Problem};
use crate::gp::tensors::TensorReader;
use crate::gp::{dense, inducing, lattice, learned, scattered};

/// The solver that a fit uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Solver {
    /// The lattice solver for samples that lie on a lattice, else the scattered solver.
    #[default]
    Auto,
    /// Kronecker algebra, for samples that lie on a lattice; conditioning takes milliseconds.
    Lattice,
    /// Nearest-neighbour likelihood and conjugate gradients, for tens of thousands of samples at any directions.
    Scattered,
    /// Cholesky factorisation, for samples at any directions; conditioning takes `O(n^3)`.
    Dense,
}

impl Solver {
    /// The names in files and on the command line.
    pub const NAMES: [&'static str; 4] = ["auto", "lattice", "scattered", "dense"];

    /// Replaces [`Solver::Auto`] by the solver for samples on a lattice or off it.
    #[must_use]
    pub fn resolve(self, on_lattice: bool) -> Self {
        match self {
            Self::Auto if on_lattice => Self::Lattice,
            Self::Auto => Self::Scattered,
            chosen => chosen,
        }
    }
}

#[cfg(feature = "fit")]
impl Solver {
    /// Finds hyper-parameters and conditions the process at them.
    pub(crate) fn fit(self, problem: &Problem<'_>) -> Result<Fitted> {
        if let Some(prior) = &problem.prior {
            return learned::solve::fit(problem, prior);
        }
        match self.resolve(problem.lattice.is_some()) {
            Self::Lattice => lattice::solve::fit(problem),
            Self::Scattered => scattered::solve::fit(problem),
            _ => dense::solve::fit(problem),
        }
    }

    /// Conditions the process at known hyper-parameters. The second value is the log marginal likelihood
    /// there.
    pub(crate) fn condition(problem: &Problem<'_>, hyper: &Hyper) -> Result<(Arc<dyn Posterior>, f64)> {
        if let Some(prior) = &problem.prior {
            return learned::solve::condition(problem, prior, hyper);
        }
        match hyper.solver.resolve(problem.lattice.is_some()) {
            Self::Lattice => lattice::solve::condition(problem, hyper),
            Self::Scattered => scattered::solve::condition(problem, hyper),
            _ => dense::solve::condition(problem, hyper),
        }
    }
}

/// Reads a posterior that the solver with this name has saved.
pub(crate) fn load(solver: &str, header: Value, tensors: &TensorReader<'_>) -> Result<Arc<dyn Posterior>> {
    match solver {
        lattice::posterior::NAME => lattice::posterior::load(header, tensors),
        dense::posterior::NAME => dense::posterior::load(header, tensors),
        scattered::posterior::NAME => scattered::posterior::load(header, tensors),
        learned::posterior::NAME => learned::posterior::load(header, tensors),
        inducing::posterior::NAME => inducing::posterior::load(header, tensors),
        other => Err(tensors.wrong("a solver of this version", format!("\"{other}\""))),
    }
}
