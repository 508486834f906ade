//! Gaussian processes: exact on any points and on product lattices, and sparse on an inducing lattice.

mod cost;
mod dense;
mod dense_fit;
mod factor;
mod heavy_tails;
pub(crate) mod inducing;
mod inducing_fit;
mod kronecker;
pub(crate) mod lattice;
mod lattice_fit;
pub(crate) mod optimize;
mod regression;

pub use cost::{DenseCost, dense_cost};
pub use dense::{DenseEvaluator, DenseGp, DenseLikelihood, LeaveOneOut};
pub use dense_fit::fit_dense;
pub(crate) use dense_fit::fit_dense_until;
pub use inducing::{InducingComponent, InducingGp, InducingShape};
pub(crate) use inducing_fit::{Budget, GridData, fit_inducing};
pub(crate) use kronecker::apply as contract;
pub use lattice::{LatticeData, LatticeGp, LatticeHyper, LatticeLikelihood};
pub(crate) use lattice_fit::fit_lattice_until;
pub use lattice_fit::{FitReport, Noise, fit_lattice};
pub use optimize::{OptimizeOptions, Optimum, Parameter, maximize};
