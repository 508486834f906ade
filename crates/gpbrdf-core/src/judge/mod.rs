//! Comparison of a prediction with a truth: cell by cell, and in pictures of a lit sphere; and whether a
//! material is one that renderers can rely on.

mod environment;
mod image;
pub(crate) mod image_metrics;
#[cfg(feature = "fit")]
mod left_out;
mod material_check;
mod metrics;
mod sample_metrics;
pub(crate) mod sphere;
mod ssim;

pub use environment::{EnvDirection, Environment};
pub use image::Image;
pub use image_metrics::{ImageMetrics, PixelDifference, exposed_difference, exposure_of, psnr, ssim};
#[cfg(feature = "fit")]
pub use left_out::{LeftOut, Outlier};
pub use material_check::{
    CHECK_VIEWS, CheckOptions, Energy, MaterialCheck, Reciprocity, SamplingCheck, sidak,
};
pub use metrics::{CellMetrics, Interval, Metrics};
pub use sample_metrics::SampleMetrics;
pub use sphere::{
    DistantLight, ENV_PATCHES, POINT_LIGHT, SPHERE_SIZE, ShadingFrame, environment_lights, render_env,
    render_point, render_sphere,
};
