// The value of a material by loads in full precision. Needs shared/table.wgsl.
// shared/material_filtered.wgsl declares the same function with a sampler; a shader takes one of the two.

fn material(table: texture_3d<f32>, wi: vec3f, wo: vec3f) -> vec4f {
    return gpbrdf_lookup_exact(table, wi, wo);
}
