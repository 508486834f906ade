//! The distribution of half vectors from which directions are drawn.

use std::f64::consts::FRAC_PI_2;

use gpbrdf_core::brdf::N_THETA_H;

use crate::context::Context;
use crate::error::Result;
use crate::shader::{self, Lookup, MATERIAL_SAMPLER};
use crate::texture::BrdfTexture;

const WHAT: &str = "distribution of half vectors";

/// `VIEW_BINS` of `shared/rings.wgsl`: bins of view angles from 0 to 90 degrees.
pub(crate) const VIEW_BINS: u32 = 64;

/// The running shares of the light that rings of half vectors reflect, for each bin of view angles.
#[derive(Debug)]
pub(crate) struct HalfVectorShares {
    /// `sin^2(theta_h / 2)` at the edges of the table's cells.
    pub(crate) edges: wgpu::Buffer,
    /// Shares of the sum of both materials.
    pub(crate) shares: wgpu::Buffer,
}

impl HalfVectorShares {
    /// The pipeline that computes shares.
    pub(crate) fn pipeline(context: &Context, lookup: Lookup) -> Result<wgpu::ComputePipeline> {
        context.compute_pipeline(WHAT, &shader::sampler(lookup), "half_vector_shares")
    }

    /// Computes the shares of two materials together, so that one set of directions serves both. The pipeline is that
    /// of the lookup.
    pub(crate) fn new(
        context: &Context,
        pipeline: &wgpu::ComputePipeline,
        truth: &BrdfTexture,
        prediction: &BrdfTexture,
        lookup: Lookup,
    ) -> Result<Self> {
        let edges: Vec<f32> = (0..=N_THETA_H).map(edge).collect();
        let storage = wgpu::BufferUsages::STORAGE;
        let edges = context.buffer_of(WHAT, bytemuck::cast_slice(&edges), storage)?;
        let size = 4 * u64::from(VIEW_BINS) * (N_THETA_H as u64 + 1);
        let shares = context.empty_buffer(WHAT, size, storage | wgpu::BufferUsages::COPY_SRC)?;
        let sampler = BrdfTexture::sampler(context);
        context.guard(WHAT, || {
            let mut resources = vec![
                (0, wgpu::BindingResource::TextureView(truth.view())),
                (1, wgpu::BindingResource::TextureView(prediction.view())),
                (2, edges.as_entire_binding()),
                (3, shares.as_entire_binding()),
            ];
            if lookup == Lookup::Filtered {
                resources.push((MATERIAL_SAMPLER, wgpu::BindingResource::Sampler(&sampler)));
            }
            let group = context.bind_group(pipeline, resources);
            context.dispatch(pipeline, &group, [VIEW_BINS, 1, 1]);
        })?;
        Ok(Self { edges, shares })
    }
}

/// `sin^2(theta_h / 2)` where cell `i` of a table begins.
#[expect(clippy::cast_possible_truncation, reason = "single precision is the shader's")]
fn edge(i: usize) -> f32 {
    let u = i as f64 / N_THETA_H as f64;
    (0.5 * u * u * FRAC_PI_2).sin().powi(2) as f32
}

#[cfg(test)]
mod tests {
    use gpbrdf_core::{BrdfTable, HalfDiff};

    use super::*;
    use crate::texture::Precision;

    crate::support::gpu_tests![a_glossy_material_reflects_by_half_vectors_near_the_normal];

    fn a_glossy_material_reflects_by_half_vectors_near_the_normal(context: &Context) {
        let glossy = BrdfTable::from_fn(|a: HalfDiff| [a.theta_h.cos().powi(400); 3]);
        let black = BrdfTable::from_fn(|_| [0.0; 3]);
        let read = |table: &BrdfTable| {
            let texture = BrdfTexture::upload(context, table, None, Precision::Half).unwrap();
            let pipeline = HalfVectorShares::pipeline(context, Lookup::Filtered).unwrap();
            let found =
                HalfVectorShares::new(context, &pipeline, &texture, &texture, Lookup::Filtered).unwrap();
            let bytes = context.read_buffer(&found.shares).unwrap();
            let shares: Vec<f32> = bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
            assert_eq!(shares.len(), 64 * 91);
            for row in shares.chunks_exact(91) {
                assert!(row[0] == 0.0 && row[90] == 1.0 && row.is_sorted(), "{row:?}");
            }
            shares
        };
        let shares = read(&glossy);
        // At normal incidence the integral over theta_h up to t is 1 - cos^403 t within a percent.
        for ring in [10, 20, 30, 50] {
            let expected = 1.0 - (1.0 - 2.0 * edge(ring)).powi(403);
            assert!((shares[ring] - expected).abs() < 0.01, "{ring}: {} {expected}", shares[ring]);
        }
        assert!((read(&black)[45] - 0.5).abs() < 1e-6);
    }
}
