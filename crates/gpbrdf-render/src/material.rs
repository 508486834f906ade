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

#[cfg(test)]
mod tests {
    use gpbrdf_core::base::SplitMix64;
    use gpbrdf_core::{BrdfTable, Material, MaterialOptions, SampledDirection, Source};

    use super::*;
    use crate::shader::MATERIAL_WGSL;
    use crate::texture::{BrdfTexture, Precision};

    crate::support::gpu_tests![sampled_directions_are_those_of_the_core];

    const SHADER: &str = "
    @group(0) @binding(0) var table: texture_3d<f32>;
    @group(0) @binding(1) var<storage, read> densities: array<f32>;
    @group(0) @binding(2) var<storage, read> viewers: array<vec4f>;
    @group(0) @binding(3) var<storage, read> uniforms: array<vec2f>;
    @group(0) @binding(4) var<storage, read_write> found: array<vec4f>;

    fn gpbrdf_density(index: u32) -> f32 {
        return densities[index];
    }

    @compute @workgroup_size(64)
    fn draw(@builtin(global_invocation_id) id: vec3u) {
        let wo = viewers[id.x].xyz;
        let drawn = gpbrdf_sample(table, wo, uniforms[id.x]);
        found[3u * id.x] = vec4f(drawn.wi, drawn.pdf);
        found[3u * id.x + 1u] = vec4f(drawn.weight, gpbrdf_pdf(drawn.wi, wo));
        found[3u * id.x + 2u] = vec4f(gpbrdf_eval(table, drawn.wi, wo), 0.0);
    }
    ";

    const COUNT: usize = 1 << 14;

    #[expect(clippy::cast_possible_truncation, reason = "materials are in single precision")]
    fn viewer(random: &mut SplitMix64) -> [f32; 4] {
        let (z, phi) = (1.0 - 0.995 * random.next_unit(), std::f64::consts::TAU * random.next_unit());
        let r = (1.0 - z * z).sqrt();
        [(r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32, 0.0]
    }

    fn sampled_directions_are_those_of_the_core(context: &Context) {
        for name in ["red-plastic", "cook-torrance"] {
            let source = Source::built_in(name).unwrap();
            let brdf = source.brdf().unwrap();
            let table = BrdfTable::from_fn(|angles| brdf.eval_half_diff(angles));
            let material = Material::new(table, &MaterialOptions::default()).unwrap();
            let mut random = SplitMix64::new(3);
            let viewers: Vec<[f32; 4]> = (0..COUNT).map(|_| viewer(&mut random)).collect();
            #[expect(clippy::cast_possible_truncation, reason = "materials are in single precision")]
            let uniforms: Vec<[f32; 2]> =
                (0..COUNT).map(|_| [random.next_unit() as f32, random.next_unit() as f32]).collect();
            let found = drawn(context, &material, &viewers, &uniforms);
            let mut worst = [0.0f32; 4];
            let mut other = 0;
            for ((wo, &[u1, u2]), rows) in viewers.iter().zip(&uniforms).zip(&found) {
                let wo = [wo[0], wo[1], wo[2]];
                let Some(SampledDirection { wi, weight, pdf }) = material.sample(wo, u1, u2) else {
                    other += usize::from(rows[0][3] != 0.0);
                    continue;
                };
                let away = (0..3).map(|k| (rows[0][k] - wi[k]).abs()).fold(0.0, f32::max);
                if away > 1e-3 {
                    // A number at the boundary of two cells may fall into either.
                    other += 1;
                    continue;
                }
                let relative = |a: f32, b: f32| (a - b).abs() / b.abs().max(1e-3);
                let f = material.eval(wi, wo);
                let errors = [
                    away,
                    relative(rows[0][3], pdf).max(relative(rows[1][3], pdf)),
                    (0..3).map(|c| relative(rows[1][c], weight[c])).fold(0.0, f32::max),
                    (0..3).map(|c| relative(rows[2][c], f[c])).fold(0.0, f32::max),
                ];
                worst = std::array::from_fn(|k| worst[k].max(errors[k]));
            }
            assert!(other <= 3, "{name}: {other}");
            assert!(worst[0] < 1e-3 && worst[1..].iter().all(|error| *error < 2e-2), "{name}: {worst:?}");
        }
    }

    /// The three rows of each thread.
    fn drawn(
        context: &Context,
        material: &Material,
        viewers: &[[f32; 4]],
        uniforms: &[[f32; 2]],
    ) -> Vec<[[f32; 4]; 3]> {
        let texture = BrdfTexture::upload(context, material.table(), None, Precision::Single).unwrap();
        let source = format!("{MATERIAL_WGSL}{SHADER}");
        let pipeline = context.compute_pipeline("draw", &source, "draw").unwrap();
        let storage = wgpu::BufferUsages::STORAGE;
        let densities = density_buffer(context, material.densities()).unwrap();
        let viewers = context.buffer_of("viewers", bytemuck::cast_slice(viewers), storage).unwrap();
        let numbers = context.buffer_of("uniforms", bytemuck::cast_slice(uniforms), storage).unwrap();
        let size = 48 * uniforms.len() as u64;
        let found = context.empty_buffer("found", size, storage | wgpu::BufferUsages::COPY_SRC).unwrap();
        let resources = [
            (0, wgpu::BindingResource::TextureView(texture.view())),
            (1, densities.as_entire_binding()),
            (2, viewers.as_entire_binding()),
            (3, numbers.as_entire_binding()),
            (4, found.as_entire_binding()),
        ];
        let group = context.bind_group(&pipeline, resources);
        context.dispatch(&pipeline, &group, [u32::try_from(uniforms.len() / 64).unwrap(), 1, 1]);
        let bytes = context.read_buffer(&found).unwrap();
        bytes.chunks_exact(48).map(bytemuck::pod_read_unaligned).collect()
    }
}
