// An entry point for the lookup: the values for pairs of directions in a buffer.
// Needs shared/table.wgsl and shared/angles.wgsl.

struct GpbrdfDirections {
    // The fourth components are unused.
    wi: vec4f,
    wo: vec4f,
}

@group(0) @binding(0) var gpbrdf_table: texture_3d<f32>;
@group(0) @binding(1) var gpbrdf_sampler: sampler;
@group(0) @binding(2) var<storage, read> gpbrdf_directions: array<GpbrdfDirections>;
// Red, green, blue in 1/sr and the standard deviation.
@group(0) @binding(3) var<storage, read_write> gpbrdf_values: array<vec4f>;

@compute @workgroup_size(64)
fn gpbrdf_evaluate(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&gpbrdf_directions) || id.x >= arrayLength(&gpbrdf_values) {
        return;
    }
    let pair = gpbrdf_directions[id.x];
    gpbrdf_values[id.x] = gpbrdf_lookup(gpbrdf_table, gpbrdf_sampler, pair.wi.xyz, pair.wo.xyz);
}
