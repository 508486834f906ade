// The value of a material by the texture unit. Needs shared/table.wgsl.
// shared/material_exact.wgsl declares the same function without a sampler; a shader takes one of the two.

@group(0) @binding(10) var material_sampler: sampler;

fn material(table: texture_3d<f32>, wi: vec3f, wo: vec3f) -> vec4f {
    return gpbrdf_lookup(table, material_sampler, wi, wo);
}
