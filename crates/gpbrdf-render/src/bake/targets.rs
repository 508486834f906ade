//! Targets of a model in every cell of a table, on their way to a texture.

use gpbrdf_core::brdf::{N_PHI_D, N_THETA_D, N_THETA_H};
use gpbrdf_core::gp::TableGeometry;

use super::prepared::Prepared;
use crate::context::Context;
use crate::error::Result;
use crate::gpu_types::to_u32;

/// One target for each distinct cell.
pub(super) struct Targets<'a> {
    prepared: &'a Prepared<'a>,
    /// `[i_theta_h][row][i_theta_d]`: the target without its prior mean and, in w, sigma. If any part is mixed into
    /// all channels, the variances of the channels follow in the same layout.
    pub(super) buffer: wgpu::Buffer,
}

impl<'a> Targets<'a> {
    /// Targets of zero.
    pub(super) fn new(context: &Context, prepared: &'a Prepared<'a>) -> Result<Self> {
        let copies = if prepared.is_mixed() { 2 } else { 1 };
        let cells = copies * N_THETA_H * prepared.geometry.third().len() * N_THETA_D;
        let buffer = context.empty_buffer("targets", 16 * cells as u64, wgpu::BufferUsages::STORAGE)?;
        Ok(Self { prepared, buffer })
    }

    /// The cells in the space of the first part.
    pub(super) fn geometry(&self) -> &TableGeometry {
        &self.prepared.geometry
    }

    /// Rows along `phi_d`.
    pub(super) fn rows(&self) -> usize {
        self.geometry().third().len()
    }

    /// Workgroups of 32 x 2 x 1 invocations, one invocation for each target.
    pub(super) fn workgroups(&self) -> [u32; 3] {
        [groups(N_THETA_D, 32), groups(self.rows(), 2), to_u32(N_THETA_H)]
    }
}

/// Workgroups of 32 x 2 x 1 invocations, one invocation for each cell of a table.
pub(super) fn whole_table() -> [u32; 3] {
    [groups(N_THETA_H, 32), groups(N_THETA_D, 2), to_u32(N_PHI_D)]
}

/// Workgroups of `size` invocations for `count` invocations.
pub(super) fn groups(count: usize, size: usize) -> u32 {
    to_u32(count.div_ceil(size))
}
