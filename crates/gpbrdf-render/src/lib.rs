//! Bakes Gaussian-process BRDFs into a 3-D texture on the GPU, and shades with it.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]

mod bake;
mod context;
mod error;
mod lookup;
#[cfg(test)]
mod reflect;
mod texture;

pub use bake::{Baker, Progress};
pub use context::{AdapterChoice, Context};
pub use error::{Error, Result};
pub use lookup::{LOOKUP_WGSL, ShaderLanguage, evaluate, evaluate_wgsl, translate};
pub use texture::{BrdfTexture, Precision};
