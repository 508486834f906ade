//! Bakes Gaussian-process BRDFs into a 3-D texture on a graphics device, and renders with it.
//!
//! From a model to a texture, and from there to a picture, without a window:
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use gpbrdf_core::{Environment, FitOptions, LatticeLayout, Layout, Source, Symmetry, fit};
//! use gpbrdf_render::{AdapterChoice, Baker, Context, Precision};
//! use gpbrdf_render::{Display, Geometry, Light, Mesh, Renderer};
//!
//! # fn main() -> gpbrdf_render::Result<()> {
//! # if let Err(error) = Context::open(AdapterChoice::Any) {
//! #     return Ok(eprintln!("skipped: {error}"));
//! # }
//! let source = Source::built_in("red-plastic")?;
//! let layout = LatticeLayout::with_samples(500, Symmetry::Bilateral)?;
//! let samples = source.measure(&Layout::Lattice(layout))?;
//! let model = fit(&samples, &FitOptions::default())?.model;
//!
//! let context = Context::open(AdapterChoice::Any)?; // or Context::from_device
//! let baker = Baker::new(&context)?;
//! let texture = baker.bake(&model, Precision::Half, &mut |_done| ControlFlow::Continue(()))?;
//!
//! let mut renderer = Renderer::new(&context, [64, 48])?;
//! renderer.set_geometry(&Geometry::Mesh(Mesh::knot()))?;
//! renderer.set_materials(None, &texture)?;
//! renderer.set_light(Light::Environment((&Environment::studio()).into()))?;
//! renderer.render_more(4)?;
//! let pixels = renderer.read_display(&Display::default())?; // RGBA, rows from top to bottom
//! # assert_eq!(pixels.len(), 64 * 48);
//! # Ok(())
//! # }
//! ```
//!
//! # Where things are
//!
//! - **Device**: [`Context`] opens one, or works on a device that your program has opened.
//! - **Texture**: [`Baker`] writes a model to a [`BrdfTexture`]; [`BrdfTexture::upload`] takes a table.
//! - **Your own shaders**: [`LOOKUP_WGSL`] turns two directions into a value of the texture. [`translate`]
//!   has it in GLSL, HLSL, MSL and SPIR-V, [`evaluate`] runs it. [`MATERIAL_WGSL`] draws directions, too.
//! - **Pictures**: a [`Renderer`] lights a [`Geometry`] by a [`Light`] as a [`Camera`] sees it, with one
//!   material or with a truth and a prediction. It shows them by a [`Display`], or returns a
//!   [`LinearPicture`].
//! - **Checks**: [`twin`] shades on the CPU, to compare with.
//!
//! The types of [`wgpu`] and [`glam`] are in signatures, so both crates are re-exported. Environment
//! variables of [`Context::open`] choose the adapter.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]

mod bake;
mod context;
mod error;
mod gpu_types;
mod lookup;
mod material;
mod readback;
mod scene;
mod shader;
mod texture;

// Tests of modules and of the tests folder share a device in the same way.
#[cfg(test)]
extern crate self as gpbrdf_render;
#[cfg(test)]
#[path = "../tests/support/mod.rs"]
mod support;

pub use {glam, wgpu};

pub use bake::{Baker, Prepared, Progress};
pub use context::{AdapterChoice, Context};
pub use error::{Error, Result};
pub use lookup::{ShaderLanguage, evaluate, include, translate};
pub use material::density_buffer;
pub use scene::camera::{Camera, Projection};
pub use scene::display::{Background, Display, Encoding, Show, ToneCurve};
pub use scene::gbuffer::Geometry;
pub use scene::ground::Ground;
pub use scene::light::{EnvironmentLight, Light};
pub use scene::mesh::{MAX_TRIANGLES, Mesh};
pub use scene::mesh_file::{is_mesh, parse_mesh, read_mesh};
pub use scene::renderer::{LinearPicture, LinearPixel, Renderer};
pub use scene::shade::{Sampling, ShadingOptions};
pub use shader::{LOOKUP_WGSL, MATERIAL_WGSL, evaluate_wgsl};
pub use texture::{BrdfTexture, Precision};

/// The shading of scenes again on the CPU, in f64, and the surfaces that the device shades.
///
/// Tests compare the two: [`Renderer::gbuffer`] has the surfaces of the latest pass,
/// [`shade_on_cpu`](twin::shade_on_cpu) lights them without random numbers, and [`Renderer::read_linear`] is
/// the picture of the device.
pub mod twin {
    pub use crate::scene::gbuffer::{GBuffer, SurfaceTexel};
    pub use crate::scene::twin::{TwinLight, shade_on_cpu};
}

/// The examples of this crate's README, which are tests of documentation.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
