//! Gaussian-process BRDFs.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]

mod angles;
mod brdf;
mod error;
mod gp;
mod kernel;
mod simd;
mod table;
#[cfg(test)]
mod test_data;

pub use angles::{BoxPoint, HalfDiff, direction, fold_phi_d, theta_d_max};
pub use brdf::{Brdf, Reciprocal, Rgb};
pub use error::{Error, Result};
pub use gp::{DenseCost, DenseEvaluator, DenseGp, DenseLikelihood, LeaveOneOut, dense_cost};
pub use kernel::{AxisMetric, Kernel, Kernel1d, KernelBody, KernelTerm, Shape, Term1d};
pub use table::{
    BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H, Trilinear, cell_center, cell_index, cell_indices,
};
