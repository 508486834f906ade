//! Gaussian-process BRDFs.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]

mod analytic;
mod angles;
mod atomic_file;
mod bake;
mod brdf;
mod colormap;
mod environment;
mod error;
mod figure;
mod fit;
mod formats;
mod gp;
mod image_metrics;
mod kernel;
mod layout;
mod materials;
mod metrics;
mod model;
mod model_file;
mod picture;
mod samples;
mod simd;
mod slice;
mod source;
mod space;
mod spectrum;
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
pub use atomic_file::{AtomicFile, PendingRemoved, remove_pending};
pub use bake::{SigmaTable, bake_mean, bake_sigma};
pub use brdf::{Brdf, Reciprocal, Rgb};
pub use colormap::Colormap;
pub use environment::{EnvDirection, Environment};
pub use error::{Error, Result};
pub use figure::{slice_figure, sphere_figure};
pub use fit::{FitOptions, Layout, SampleSet, Solver, detect_symmetry, fit};
pub use formats::cornell::read_cornell;
pub use formats::image_exr::write_image_exr;
pub use formats::merl::{MERL_BYTES, read_merl, write_merl, write_merl_to};
pub use formats::merl_sha256::merl_material_name;
pub use formats::rgl::{RglBrdf, read_rgl};
pub use formats::samples_csv::{
    Directions, read_directions_csv, read_samples_csv, write_samples_csv, write_samples_csv_to,
};
pub use formats::table_exr::{ExrChannels, ExrPart, read_table_exr, write_table_exr, write_table_exr_to};
pub use formats::{FileKind, recognise, sha256_file, sha256_hex};
pub use gp::{
    DenseCost, DenseEvaluator, DenseGp, DenseLikelihood, FitReport, LatticeData, LatticeGp, LatticeHyper,
    LatticeLikelihood, LeaveOneOut, Noise, OptimizeOptions, Optimum, Parameter, dense_cost, fit_dense,
    fit_lattice, maximize,
};
pub use image_metrics::{ImageMetrics, PixelDifference, exposure_of, psnr, ssim};
pub use kernel::{AxisMetric, Kernel, Kernel1d, KernelBody, KernelTerm, ParameterKind, Shape, Term1d};
pub use layout::{LatticeLayout, Symmetry, random_cells, random_directions};
pub use materials::{Material, material, materials};
pub use metrics::{CellMetrics, Interval, Metrics};
pub use model::{IntervalOf, Model, Prediction, Process, Provenance, interval_95};
pub use picture::{Picture, Rgb8};
pub use samples::{Sample, Samples};
pub use slice::{Slice, SliceOptions};
pub use source::{Content, Source};
pub use space::InputSpace;
pub use sphere::{ENV_PATCHES, Image, MIN_COSINE, POINT_LIGHT, SPHERE_SIZE, render_env, render_point};
pub use table::{
    BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H, Trilinear, cell_center, cell_index, cell_indices,
};
pub use target::{MeanFunction, Transform};
