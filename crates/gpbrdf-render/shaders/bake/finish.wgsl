// The texels of a baked table, made from targets. Needs shared/grid.wgsl.
//
// Composed with the definition of `Texels`: a texture_storage_3d of the format of the table, to write.

struct Finish {
    // Prior mean of each channel.
    offsets: vec4f,
    // One of TRANSFORM_*.
    transform: u32,
    epsilon: f32,
    // Rows of the targets along phi_d.
    rows: u32,
    // The largest number that the texels hold.
    largest: f32,
}

// f = g, f = exp(g) - epsilon and f = g^3 for a target g.
const TRANSFORM_IDENTITY: u32 = 0u;
const TRANSFORM_LOG: u32 = 1u;
const TRANSFORM_CUBE_ROOT: u32 = 2u;

@group(0) @binding(0) var<uniform> finish: Finish;
// [i_theta_h][row][i_theta_d]: the target without its prior mean and, in w, sigma.
@group(0) @binding(1) var<storage, read> targets: array<vec4f>;
// [i_theta_h][column]: how many cells along theta_d have their own target; those above share the last one.
@group(0) @binding(2) var<storage, read> distinct: array<u32>;
@group(0) @binding(3) var table: Texels;

@compute @workgroup_size(32, 2)
fn write_table(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= N_THETA_H || id.y >= N_THETA_D || id.z >= N_PHI_D {
        return;
    }
    let row = select(id.z, column_of(id.z), finish.rows < N_PHI_D);
    let last = distinct[column_index(id.x, id.z)] - 1u;
    let found = targets[target_index(id.x, row, min(id.y, last), finish.rows)];
    let g = found.xyz + finish.offsets.xyz;
    var f = g;
    if finish.transform == TRANSFORM_LOG {
        f = exp(g) - finish.epsilon;
    } else if finish.transform == TRANSFORM_CUBE_ROOT {
        f = g * g * g;
    }
    let texel = vec4f(clamp(f, vec3f(0.0), vec3f(finish.largest)), min(found.w, finish.largest));
    textureStore(table, vec3i(id), texel);
}
