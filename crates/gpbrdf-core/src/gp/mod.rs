//! Exact Gaussian processes: on any points, and on product lattices.

mod kronecker;
pub(crate) mod lattice;
pub(crate) mod lattice_fit;
pub(crate) mod optimize;
