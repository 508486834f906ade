//! Targets of a model in every cell of a table, on their way to a texture.

use std::borrow::Cow;

use gpbrdf_core::brdf::{N_PHI_D, N_THETA_D, N_THETA_H};
use gpbrdf_core::gp::TableGeometry;
use gpbrdf_core::sample::InputSpace;

use super::separable::Placement;
use super::{Form, Part};
use crate::context::Context;
use crate::error::Result;
use crate::gpu_types::to_u32;

/// One target for each distinct cell.
pub(super) struct Targets {
    space: InputSpace,
    pub(super) geometry: TableGeometry,
    /// Distinct cells of each column, as [`TableGeometry::distinct`], but the smallest number of all parts:
    /// their spaces may differ, and a cell at the horizon may be rounded to either side of it.
    pub(super) distinct: Vec<usize>,
    /// `[i_theta_h][row][i_theta_d]`: the target without its prior mean and, in w, sigma. If any part is
    /// [`Placement::Mixed`], the variances of the channels follow in the same layout.
    pub(super) buffer: wgpu::Buffer,
}

impl Targets {
    /// Targets of zero for the sum of `parts`, or of nothing in `space`.
    pub(super) fn new(context: &Context, space: InputSpace, parts: &[Part<'_>]) -> Result<Self> {
        let space = parts.first().map_or(space, |part| part.space);
        let geometry = TableGeometry::new(space);
        let mut distinct = geometry.distinct().to_vec();
        for other in parts.iter().map(|part| part.space).filter(|&other| other != space) {
            let found = TableGeometry::new(other);
            distinct.iter_mut().zip(found.distinct()).for_each(|(least, &n)| *least = n.min(*least));
        }
        let mixed = parts.iter().any(|part| matches!(part.form, Form::Separable(_, Placement::Mixed { .. })));
        let copies = if mixed { 2 } else { 1 };
        let cells = copies * N_THETA_H * geometry.third().len() * N_THETA_D;
        let buffer = context.empty_buffer("targets", 16 * cells as u64, wgpu::BufferUsages::STORAGE)?;
        Ok(Self { space, geometry, distinct, buffer })
    }

    /// Rows along `phi_d`.
    pub(super) fn rows(&self) -> usize {
        self.geometry.third().len()
    }

    /// The geometry of a part in `space`.
    pub(super) fn geometry_of(&self, space: InputSpace) -> Cow<'_, TableGeometry> {
        if space == self.space {
            Cow::Borrowed(&self.geometry)
        } else {
            Cow::Owned(TableGeometry::new(space))
        }
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
