//! What shaders need to draw directions from a material.

use gpbrdf_core::material::DirectionDensities;

use crate::context::Context;
use crate::error::Result;

/// The storage buffer that the function `gpbrdf_density` of [`MATERIAL_WGSL`](crate::MATERIAL_WGSL) reads: the arrays
/// `values`, `conditional` and `marginal` of the densities, one behind the other, 1.0 MB.
///
/// # Errors
/// Those of [`Context::buffer_of`].
pub fn density_buffer(context: &Context, densities: &DirectionDensities) -> Result<wgpu::Buffer> {
    let all = [densities.values(), densities.conditional(), densities.marginal()].concat();
    context.buffer_of("densities", bytemuck::cast_slice(&all), wgpu::BufferUsages::STORAGE)
}
