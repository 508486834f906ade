//! Gaussian processes: an exact one for any points, one for thousands of scattered samples, an exact one for
//! product lattices, and a sparse one on inducing lattices.

mod cost;
mod hyper;
#[cfg(feature = "fit")]
mod optimize;
mod posterior;
#[cfg(feature = "fit")]
pub(crate) mod problem;
#[cfg(feature = "fit")]
mod report;
#[cfg(feature = "fit")]
mod search;
pub(crate) mod solver;
pub(crate) mod table;
pub(crate) mod tensors;

pub(crate) mod dense;
pub(crate) mod inducing;
pub(crate) mod lattice;
pub(crate) mod learned;
pub(crate) mod scattered;

pub use cost::{FitCost, available_bytes};
pub use dense::DenseGp;
pub use dense::cost::dense_cost;
pub use hyper::{Hyper, HyperKind, HyperParameter};
pub use inducing::{InducingComponent, InducingGp, InducingShape};
pub(crate) use lattice::kronecker::apply as contract;
pub use lattice::{AxisBasis, LatticeData, LatticeGp, LatticeHyper, SeparableForm};
pub use posterior::{DeviceForm, KernelSum, KernelSums, Posterior, SeparablePart};
pub use solver::Solver;
pub use table::{MeanTable, TableGeometry};
pub use tensors::{TensorReader, TensorWriter};

#[cfg(feature = "fit")]
pub use dense::fit::DenseFit;
#[cfg(feature = "fit")]
pub use dense::{DenseEvaluator, DenseLikelihood, LeaveOneOut};
#[cfg(feature = "fit")]
pub(crate) use inducing::fit::{Budget, GridData, fit_inducing};
#[cfg(feature = "fit")]
pub use lattice::{LatticeLikelihood, fit::fit_lattice};
#[cfg(feature = "fit")]
pub use optimize::{LogNormal, OptimizeOptions, Optimum, Parameter, maximize};
#[cfg(feature = "fit")]
pub use problem::Outliers;
#[cfg(feature = "fit")]
pub use report::{FitReport, Noise};
#[cfg(feature = "fit")]
pub use scattered::cost::scattered_cost;
#[cfg(feature = "fit")]
pub use search::UsualValues;
