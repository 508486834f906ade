//! Gaussian-process BRDFs: a complete, render-ready material from few measurements, with an error bar.
//!
//! From a file or a built-in material to a table of mean and sigma:
//!
//! ```
//! # #[cfg(all(feature = "fit", feature = "formats"))]
//! use gpbrdf_core::{Baked, FitOptions, LatticeLayout, Layout, Source, Symmetry, fit};
//!
//! # #[cfg(not(all(feature = "fit", feature = "formats")))]
//! # fn main() {}
//! # #[cfg(all(feature = "fit", feature = "formats"))]
//! # fn main() -> gpbrdf_core::Result<()> {
//! let source = Source::built_in("cherry-235")?; // or Source::open(path)
//! let layout = LatticeLayout::with_samples(500, Symmetry::Bilateral)?;
//! let samples = source.measure(&Layout::Lattice(layout))?;
//! let fitted = fit(&samples, &FitOptions::default())?;
//! let baked = Baked::new(&fitted.model)?; // 90 x 90 x 180 cells of RGB in 1/sr, and how sure they are
//! # assert!(fitted.reports[0].converged);
//! # assert!(baked.mean.cell(0, 0, 0)[0] > 0.0 && baked.sigma.value(0, 0) > 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! A renderer turns a table, a model or a source into a [`Material`]:
//!
//! - [`Material::eval`]: `f(wi, wo)` in sr^-1, without the cosine;
//! - [`Material::sample`]: a direction with its density and `f cos / pdf`;
//! - [`Material::pdf`]: the density of a direction;
//! - [`Material::albedo`]: the directional-hemispherical reflectance.
//!
//! ```
//! use gpbrdf_core::{BrdfTable, Material, MaterialOptions};
//!
//! # fn main() -> gpbrdf_core::Result<()> {
//! let table = BrdfTable::from_fn(|angles| [0.1 + (-40.0 * angles.theta_h.powi(2)).exp(); 3]); // or baked, or read
//! let material = Material::new(table, &MaterialOptions::default())?;
//! let wo = [0.6, 0.0, 0.8];
//! if let Some(drawn) = material.sample(wo, 0.3, 0.7) {
//!     assert!(material.pdf(drawn.wi, wo) > 0.0 && drawn.weight[0] < 2.0 * material.albedo(wo)[0]);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! The names that most users need are exported here. The modules hold everything else; they follow the flow
//! of data:
//!
//! - [`formats`]: [`Source`] opens every kind of file that can be read, and the built-in
//!   [materials](brdf::materials()).
//! - [`brdf`]: the trait [`Brdf`], half-difference angles, tables and analytic models. In the local frame the
//!   normal is `+z`; `wi` points to the light and `wo` to the viewer, both of unit length. Values are `f` in
//!   sr^-1 without the cosine, angles are in radians, numbers are f64 (f32 in tables).
//! - [`sample`]: [`Layout`] says where to measure, [`SampleSet`] holds what was measured.
//! - [`kernel`], [`gp`]: covariance functions and exact Gaussian processes. On a product lattice they take
//!   milliseconds, on scattered points `O(n^3)` operations.
//! - [`model`]: [`fit`](fit()) finds hyper-parameters by maximum marginal likelihood. A [`Model`] predicts
//!   means and intervals, implements [`Brdf`], and is saved and loaded bit for bit. [`Baked`] holds its
//!   values in all 1,458,000 cells of a table.
//! - [`material`]: a [`Material`] is what a renderer calls, in single precision and without allocations.
//! - [`prior`]: what other materials tell. `plan` (with the feature `fit`): what to measure next.
//! - [`judge`], [`figure`]: metrics against a truth, and pictures for people.
//!
//! All features are on by default. Without them a program that loads, evaluates and bakes models builds a tree of
//! 49 crates; each feature adds what its name says:
//!
//! - `fit` makes models: [`fit`], [`condition`], [`compress`] and what they are made of. It brings argmin and faer.
//!   faer then computes predictions, too: their rounding differs from nalgebra's, and the first variance of a large
//!   dense model is there sooner.
//! - `formats` reads and writes measurements, tables and environment maps: [`formats`], [`Source`].
//! - `figures` draws slices, spheres and their captions: [`figure`].
//!
//! Results do not depend on the number of threads. "The paper" is Hao, Liu and Weng, "A BRDF Representing
//! Method Based on Gaussian Process"; equation numbers without another source refer to it.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]

pub mod base;
pub mod brdf;
#[cfg(feature = "figures")]
pub mod figure;
#[cfg(feature = "formats")]
pub mod formats;
pub mod gp;
pub mod judge;
pub mod kernel;
pub mod material;
pub mod model;
#[cfg(feature = "fit")]
pub mod plan;
pub mod prior;
pub mod sample;
#[cfg(test)]
mod test_data;

/// Directions are vectors of this crate.
pub use nalgebra;

pub use base::{Error, Observer, Progress, Result};
pub use brdf::{Brdf, BrdfTable, HalfDiff, Rgb, SigmaTable};
#[cfg(feature = "formats")]
pub use formats::{Content, Source};
#[cfg(feature = "fit")]
pub use gp::{FitReport, Noise, Outliers};
pub use gp::{Hyper, Solver};
pub use judge::{Environment, Metrics};
pub use kernel::Shape;
pub use material::{Material, MaterialOptions, SampledDirection};
pub use model::{Baked, IntervalOf, Intervals, Model, Prediction, bake_mean, bake_sigma};
#[cfg(feature = "fit")]
pub use model::{CompressOptions, Fit, FitOptions, InducingSize, compress, condition, fit};
pub use sample::{
    LatticeLayout, Layout, MeanFunction, Provenance, Sample, SampleSet, Symmetry, Transform, detect_symmetry,
};

/// The examples of this crate's README, which are tests of documentation.
#[cfg(all(doctest, feature = "fit", feature = "formats"))]
#[doc = include_str!("../README.md")]
struct Readme;
