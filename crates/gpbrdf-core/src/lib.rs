//! Gaussian-process BRDFs.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]

mod angles;
mod brdf;
mod error;
mod kernel;
mod simd;
mod table;

pub use angles::{BoxPoint, HalfDiff, direction, fold_phi_d, theta_d_max};
pub use brdf::{Brdf, Reciprocal, Rgb};
pub use error::{Error, Result};
pub use kernel::Shape;
pub use table::{
    BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H, Trilinear, cell_center, cell_index, cell_indices,
};
