//! Where to measure, what was measured, and how measurements become inputs of kernels and targets of
//! processes.

mod blind_spots;
mod detect;
pub(crate) mod lattice;
pub(crate) mod layout;
pub(crate) mod origin;
pub(crate) mod set;
pub(crate) mod space;
pub(crate) mod symmetry;
pub(crate) mod target;

pub use detect::detect_symmetry;
pub use lattice::LatticeLayout;
pub use layout::{Layout, random_cells, random_directions};
pub use origin::{Provenance, SampleLayout};
pub use set::{Sample, SampleSet};
pub use space::{InputSpace, WarpedBox};
pub use symmetry::Symmetry;
pub use target::{LOG_EPSILON, MeanFunction, Transform, log_value};
