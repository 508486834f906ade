//! Where to measure, what was measured, and how measurements become inputs of kernels and targets of
//! processes.

pub(crate) mod blind_spots;
mod detect;
mod disturbance;
pub(crate) mod lattice;
pub(crate) mod layout;
pub(crate) mod origin;
mod scan;
pub(crate) mod set;
pub(crate) mod space;
pub(crate) mod symmetry;
pub(crate) mod target;

pub use detect::detect_symmetry;
pub use disturbance::Disturbance;
pub use lattice::LatticeLayout;
pub use layout::{
    Layout, MAX_DIRECTIONS, MIN_DRAWN_COSINE, hemisphere_directions, random_cells, random_directions,
};
pub use origin::{Provenance, SampleLayout};
pub use scan::{GonioGrid, InPlaneScan};
pub use set::{Sample, SampleSet};
pub use space::{InputSpace, WarpedBox};
pub use symmetry::Symmetry;
pub use target::{LOG_EPSILON, MeanFunction, Transform, log_value};
