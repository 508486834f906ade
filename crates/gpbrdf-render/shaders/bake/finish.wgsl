// From targets to the texels of a baked table. The texel format is put in place of TEXEL_FORMAT.

struct Finish {
    // Prior mean of each channel.
    offsets: vec4f,
    // 0: f = g; 1: f = exp(g) - epsilon; 2: f = g^3.
    transform: u32,
    epsilon: f32,
    // Rows of phi_d: 90 where it is folded, else 180.
    rows: u32,
    // The largest number that the texels hold.
    largest: f32,
}

const N_THETA_H: u32 = 90u;
const N_THETA_D: u32 = 90u;
const N_PHI_D: u32 = 180u;

@group(0) @binding(0) var<uniform> finish: Finish;
// [i_theta_h][row][i_theta_d]: target without its prior mean, and sigma.
@group(0) @binding(1) var<storage, read> targets: array<vec4f>;
// [i_theta_h][column]: how many cells have a target of their own; those above share the last.
@group(0) @binding(2) var<storage, read> distinct: array<u32>;
@group(0) @binding(3) var table: texture_storage_3d<TEXEL_FORMAT, write>;

@compute @workgroup_size(32, 2)
fn write_table(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= N_THETA_H || id.y >= N_THETA_D || id.z >= N_PHI_D {
        return;
    }
    let column = min(id.z, N_PHI_D - 1u - id.z);
    let row = select(id.z, column, finish.rows < N_PHI_D);
    let last = distinct[id.x * (N_PHI_D / 2u) + column] - 1u;
    let found = targets[(id.x * finish.rows + row) * N_THETA_D + min(id.y, last)];
    let g = found.xyz + finish.offsets.xyz;
    var f = g;
    if finish.transform == 1u {
        f = exp(g) - finish.epsilon;
    } else if finish.transform == 2u {
        f = g * g * g;
    }
    let texel = vec4f(clamp(f, vec3f(0.0), vec3f(finish.largest)), min(found.w, finish.largest));
    textureStore(table, vec3i(id), texel);
}
