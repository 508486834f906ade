//! Gaussian-process BRDFs.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]

mod analytic;
mod angles;
mod brdf;
mod colormap;
mod environment;
mod error;
mod figure;
mod gp;
mod image_metrics;
mod kernel;
mod layout;
mod materials;
mod metrics;
mod picture;
mod simd;
mod slice;
mod space;
mod sphere;
mod ssim;
mod table;
mod target;
#[cfg(test)]
mod test_data;

pub use analytic::{
    AnalyticBrdf, AshikhminShirley, Blinn, BlinnPhong, CookTorrance, Lambert, Phong, Sgd, Ward,
};
pub use angles::{BoxPoint, HalfDiff, direction, fold_phi_d, theta_d_max};
pub use brdf::{Brdf, Reciprocal, Rgb};
pub use colormap::Colormap;
pub use environment::{EnvDirection, Environment};
pub use error::{Error, Result};
pub use figure::{slice_figure, sphere_figure};
pub use image_metrics::{ImageMetrics, PixelDifference, exposure_of, psnr, ssim};
pub use materials::{Material, material, materials};
pub use metrics::{CellMetrics, Interval, Metrics};
pub use picture::{Picture, Rgb8};
pub use slice::{Slice, SliceOptions};
pub use sphere::{ENV_PATCHES, Image, MIN_COSINE, POINT_LIGHT, SPHERE_SIZE, render_env, render_point};
pub use table::{
    BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H, Trilinear, cell_center, cell_index, cell_indices,
};
