//! Bakes Gaussian-process BRDFs into a 3-D texture on the GPU, and shades with it.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]

mod bake;
mod camera;
mod context;
mod cpu;
mod display;
mod error;
mod gbuffer;
mod gpu_types;
mod half_vector;
mod light;
mod lookup;
mod mesh;
mod obj;
mod offscreen;
#[cfg(test)]
mod reflect;
#[cfg(test)]
mod scene_tests;
mod shade;
mod texture;

pub use bake::{Baker, Progress};
pub use camera::{Camera, Projection};
pub use context::{AdapterChoice, Context};
pub use cpu::{TwinLight, shade_on_cpu};
pub use display::{Background, Display, Encoding, Show, ToneCurve};
pub use error::{Error, Result};
pub use gbuffer::{GBuffer, Geometry, SurfaceTexel};
pub use light::{EnvironmentLight, Light};
pub use lookup::{LOOKUP_WGSL, ShaderLanguage, evaluate, evaluate_wgsl, translate};
pub use mesh::{MAX_TRIANGLES, Mesh};
pub use obj::read_obj;
pub use offscreen::{LinearPicture, Renderer};
pub use shade::{Sampling, ShadingOptions};
pub use texture::{BrdfTexture, Precision};
