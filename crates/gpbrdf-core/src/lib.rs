//! Gaussian-process BRDFs.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]

mod analytic;
mod angles;
mod brdf;
mod error;
mod gp;
mod kernel;
mod layout;
mod materials;
mod simd;
mod space;
mod table;
mod target;
#[cfg(test)]
mod test_data;

pub use analytic::{
    AnalyticBrdf, AshikhminShirley, Blinn, BlinnPhong, CookTorrance, Lambert, Phong, Sgd, Ward,
};
pub use angles::{BoxPoint, HalfDiff, direction, fold_phi_d, theta_d_max};
pub use brdf::{Brdf, Reciprocal, Rgb};
pub use error::{Error, Result};
pub use materials::{Material, material, materials};
pub use table::{
    BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H, Trilinear, cell_center, cell_index, cell_indices,
};
