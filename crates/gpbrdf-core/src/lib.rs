//! Gaussian-process BRDFs: a complete, render-ready material out of few measurements, with an error bar.
//!
//! From a file, or a built-in material, to a table of mean and sigma:
//!
//! ```
//! use gpbrdf_core::{
//!     FitOptions, LatticeLayout, Layout, Provenance, SampleSet, Source, Symmetry, bake_mean, bake_sigma, fit,
//! };
//!
//! # fn main() -> gpbrdf_core::Result<()> {
//! let source = Source::built_in("cherry-235")?; // or Source::open(path)
//! let brdf = source.brdf().expect("an analytic model can be asked anywhere");
//! let layout = LatticeLayout::with_samples(500, Symmetry::Bilateral)?;
//! let samples = SampleSet::measure(brdf, &Layout::Lattice(layout))?;
//! let (model, report) = fit(&samples, &FitOptions::default(), Provenance::default())?;
//! let mean = bake_mean(&model); // 90 x 90 x 180 cells of RGB in 1/sr
//! let sigma = bake_sigma(&model); // and how sure it is
//! # assert!(report[0].converged && mean.cell(0, 0, 0)[0] > 0.0 && sigma.value(0, 0) > 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! # Where things are
//!
//! - **Conventions**: local frame with the normal `+z`, `wi` to the light, `wo` to the viewer, both unit; `f` in sr^-1
//!   without the cosine; half-difference angles in radians ([`HalfDiff`]). f64 throughout, f32 in tables.
//! - **Sources**: [`Source`] opens every kind of file that is read and the built-in [`materials`]; anything that
//!   implements [`Brdf`] can be sampled.
//! - **Samples**: [`Layout`] says where to measure, [`SampleSet`] holds what was measured.
//! - **Fitting**: [`fit`] finds hyper-parameters by maximum marginal likelihood and conditions an exact process: on a
//!   product lattice in milliseconds ([`LatticeGp`]), on any points in `O(n^3)` ([`DenseGp`]).
//! - **Models**: [`Model`] predicts means and intervals, is itself a [`Brdf`], and is saved and loaded bit for bit.
//! - **Tables**: [`bake_mean`] and [`bake_sigma`] fill all 1,458,000 cells; [`write_merl`] and [`write_table_exr`] write
//!   them.
//! - **Judging**: [`Metrics`] against a truth, [`slice_figure`] and [`sphere_figure`] for people.
//!
//! Results do not depend on the number of threads. The paper is Hao, Liu and Weng, "A BRDF Representing Method Based on
//! Gaussian Process"; equation numbers without another source are its.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]

mod analytic;
mod angles;
mod atomic_file;
mod bake;
mod brdf;
mod cell_grid;
mod colormap;
mod condition;
mod environment;
mod error;
mod figure;
mod fit;
mod fit_table;
mod formats;
mod gp;
mod half;
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
    AnalyticBrdf, AshikhminShirley, Blinn, BlinnPhong, CookTorrance, Lambert, NEURAL_FLOATS, NeuralBrdf,
    Phong, Sgd, Ward,
};
pub use angles::{BoxPoint, HalfDiff, direction, fold_phi_d, theta_d_max};
pub use atomic_file::{AtomicFile, PendingRemoved, remove_pending};
pub use bake::{AxisBasis, SeparableForm, SigmaTable, TableGeometry, bake_mean, bake_sigma};
pub use brdf::{Brdf, Reciprocal, Rgb};
pub use colormap::Colormap;
pub use condition::{Hyper, condition, fit_per_axis};
pub use environment::{EnvDirection, Environment};
pub use error::{Error, Result};
pub use figure::{Panel, Scale, panel_figure, round_limit, slice_figure, sphere_figure};
pub use fit::{FitOptions, Layout, SampleSet, Solver, detect_symmetry, fit};
pub use fit_table::{CellWeights, InducingSize, TableFitOptions, fit_table};
pub use formats::cornell::read_cornell;
pub use formats::image_exr::write_image_exr;
pub use formats::merl::{MERL_BYTES, read_merl, write_merl, write_merl_to};
pub use formats::merl_sha256::merl_material_name;
pub use formats::neural_csv::read_neural_csv;
pub use formats::rgl::{RglBrdf, read_rgl};
pub use formats::samples_csv::{
    Directions, read_directions_csv, read_samples_csv, write_samples_csv, write_samples_csv_to,
};
pub use formats::table_exr::{ExrChannels, ExrPart, read_table_exr, write_table_exr, write_table_exr_to};
pub use formats::{FileKind, recognise, sha256_file, sha256_hex};
pub use gp::{
    DenseCost, DenseEvaluator, DenseGp, DenseLikelihood, FitReport, InducingComponent, InducingGp,
    InducingShape, LatticeData, LatticeGp, LatticeHyper, LatticeLikelihood, LeaveOneOut, Noise,
    OptimizeOptions, Optimum, Parameter, dense_cost, fit_dense, fit_lattice, maximize,
};
pub use image_metrics::{ImageMetrics, PixelDifference, exposure_of, psnr, ssim};
pub use kernel::{AxisMetric, Kernel, Kernel1d, KernelBody, KernelTerm, ParameterKind, Shape, Term1d};
pub use layout::{LatticeLayout, Symmetry, random_cells, random_directions};
pub use materials::{Material, material, materials};
pub use metrics::{CellMetrics, Interval, Metrics};
pub use model::{IntervalOf, Model, Prediction, Process, Provenance, interval_95};
pub use picture::{Picture, Rgb8, write_rgba_png};
pub use samples::{Sample, Samples};
pub use slice::{Slice, SliceOptions};
pub use source::{Content, Source};
pub use space::InputSpace;
pub use sphere::{
    DistantLight, ENV_PATCHES, Image, MIN_COSINE, POINT_LIGHT, SPHERE_SIZE, ShadingFrame, environment_lights,
    render_env, render_point, render_sphere,
};
pub use table::{
    BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H, Trilinear, cell_center, cell_index, cell_indices,
};
pub use target::{MeanFunction, Transform};
