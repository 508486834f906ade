//! Gaussian processes: exact on any points and on product lattices, and sparse on an inducing lattice.

mod hyper;
mod optimize;
mod posterior;
mod report;
pub(crate) mod solver;
pub(crate) mod table;
pub(crate) mod tensors;

pub(crate) mod dense;
pub(crate) mod inducing;
pub(crate) mod lattice;

pub use dense::cost::{DenseCost, dense_cost};
pub use dense::fit::DenseFit;
pub use dense::{DenseEvaluator, DenseGp, DenseLikelihood, LeaveOneOut};
pub use hyper::{Hyper, HyperKind, HyperParameter};
pub(crate) use inducing::fit::{Budget, GridData, fit_inducing};
pub use inducing::{InducingComponent, InducingGp, InducingShape};
pub use lattice::fit::fit_lattice;
pub(crate) use lattice::kronecker::apply as contract;
pub use lattice::{AxisBasis, LatticeData, LatticeGp, LatticeHyper, LatticeLikelihood, SeparableForm};
pub use optimize::{OptimizeOptions, Optimum, Parameter, maximize};
pub use posterior::{DeviceForm, KernelSum, Posterior, SeparablePart};
pub use report::{FitReport, Noise};
pub use solver::{Observer, Solver};
pub use table::{MeanTable, TableGeometry};
pub use tensors::{TensorReader, TensorWriter};
