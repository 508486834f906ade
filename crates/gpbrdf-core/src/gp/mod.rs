//! Exact Gaussian processes: on any points, and on product lattices.

mod dense;
mod kronecker;
pub(crate) mod lattice;
mod lattice_fit;
pub(crate) mod optimize;

pub use dense::{DenseGp, fit_dense};
pub use lattice::{LatticeData, LatticeGp, LatticeHyper, LatticeLikelihood};
pub use lattice_fit::{FitReport, Noise, fit_lattice};
pub use optimize::{OptimizeOptions, Optimum, Parameter, maximize};
