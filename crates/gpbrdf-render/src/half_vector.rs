//! The distribution of half vectors that directions are drawn from.

use std::f64::consts::FRAC_PI_2;

use gpbrdf_core::N_THETA_H;

use crate::context::Context;
use crate::error::Result;
use crate::lookup::LOOKUP_WGSL;
use crate::texture::BrdfTexture;

const HALF_VECTOR_WGSL: &str = include_str!("../shaders/half_vector.wgsl");
const EXACT: &str = "fn material(table: texture_3d<f32>, wi: vec3f, wo: vec3f) -> vec4f {\n    \
    return gpbrdf_lookup_exact(table, wi, wo);\n}\n";
const FILTERED: &str = "fn material(table: texture_3d<f32>, wi: vec3f, wo: vec3f) -> vec4f {\n    \
    return gpbrdf_lookup(table, material_sampler, wi, wo);\n}\n";
const WHAT: &str = "distribution of half vectors";

/// View angles from 0 to 90 degrees; `VIEW_BINS` of the shaders.
const VIEW_BINS: usize = 64;

/// A shader that calls `material`, with the lookup by loads or by the sampler in front of it.
pub(crate) fn with_material(shader: &str, exact: bool) -> String {
    if exact {
        format!("{LOOKUP_WGSL}\n{EXACT}\n{shader}")
    } else {
        format!("{LOOKUP_WGSL}\n{FILTERED}\n{}", shader.replace("//SAMPLER ", ""))
    }
}

pub(crate) fn source(exact: bool) -> String {
    with_material(HALF_VECTOR_WGSL, exact)
}

/// Running shares of the light reflected by rings of half vectors, by view angle.
#[derive(Debug)]
pub(crate) struct HalfVectorShares {
    /// `sin^2(theta_h / 2)` at the edges of the table's cells.
    pub(crate) edges: wgpu::Buffer,
    /// Shares of the sum of both materials.
    pub(crate) shares: wgpu::Buffer,
}

impl HalfVectorShares {
    /// Computes the shares of two materials together, so that one set of directions serves both.
    pub(crate) fn new(
        context: &Context,
        truth: &BrdfTexture,
        prediction: &BrdfTexture,
        exact: bool,
    ) -> Result<Self> {
        let pipeline = context.compute_pipeline(WHAT, &source(exact), "half_vector_shares")?;
        let edges: Vec<f32> = (0..=N_THETA_H).map(edge).collect();
        let storage = wgpu::BufferUsages::STORAGE;
        let edges = context.buffer_of(WHAT, bytemuck::cast_slice(&edges), storage)?;
        let size = 4 * VIEW_BINS * (N_THETA_H + 1);
        let shares = context.empty_buffer(WHAT, size as u64, storage | wgpu::BufferUsages::COPY_SRC)?;
        let sampler = BrdfTexture::sampler(context);
        context.guard(WHAT, || {
            let views = [
                wgpu::BindingResource::TextureView(truth.view()),
                wgpu::BindingResource::TextureView(prediction.view()),
                edges.as_entire_binding(),
                shares.as_entire_binding(),
            ];
            let group = if exact {
                context.bind_group(&pipeline, views)
            } else {
                let [a, b, c, d] = views;
                context.bind_group(&pipeline, [a, b, c, d, wgpu::BindingResource::Sampler(&sampler)])
            };
            #[expect(clippy::cast_possible_truncation, reason = "64")]
            context.dispatch(&pipeline, &group, [VIEW_BINS as u32, 1, 1]);
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
    use crate::context::test_context;
    use crate::texture::Precision;

    #[test]
    fn a_glossy_material_reflects_by_half_vectors_near_the_normal() {
        let Some(context) = test_context() else { return };
        let glossy = BrdfTable::from_fn(|a: HalfDiff| [a.theta_h.cos().powi(400); 3]);
        let black = BrdfTable::from_fn(|_| [0.0; 3]);
        let read = |table: &BrdfTable| {
            let texture = BrdfTexture::upload(context, table, None, Precision::Half).unwrap();
            let found = HalfVectorShares::new(context, &texture, &texture, false).unwrap();
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
