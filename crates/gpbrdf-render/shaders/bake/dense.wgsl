// The predictive mean of a dense process: for each cell the sum of kernel values times weights over all samples.
//
// Put in front: `alias real = f64;` or `alias real = f32;`, and `const PARAMETERS: u32` with the number of kernel
// parameters; behind: `fn kernel(d: vec3<real>) -> real`, the covariance for the squared distances along the three axes,
// which reads `parameters`. Numbers come as pairs of f32 whose sum is the value, so that one source serves both precisions.

struct Dense {
    // The cells and the samples of this dispatch.
    first_cell: u32,
    last_cell: u32,
    first_sample: u32,
    last_sample: u32,
    // Rows of phi_d, and 1 where the third coordinate comes as sine and cosine and |sin(difference)| is its distance.
    rows: u32,
    chord: u32,
    // Largest second coordinate.
    limit: f32,
    unused: u32,
}

struct Sample {
    // Coordinates; where the third is an angle, its sine and cosine.
    high: vec4f,
    low: vec4f,
    // One a channel.
    weight_high: vec4f,
    weight_low: vec4f,
}

const N_THETA_H: u32 = 90u;
const N_THETA_D: u32 = 90u;
const N_PHI_D: u32 = 180u;
const TILE: u32 = 64u;

// Where things stand in `tables`.
const SECOND: u32 = N_THETA_H;
const SCALE: u32 = SECOND + N_THETA_D;
const THIRD: u32 = SCALE + N_THETA_H * N_PHI_D / 2u;

@group(0) @binding(0) var<uniform> dense: Dense;
// First coordinates [i_theta_h]; what depends on theta_d [i_theta_d] and on the column [i_theta_h][column] in the second;
// third coordinates, or their sines and cosines, [row][2]; parameters of the kernel.
@group(0) @binding(1) var<storage, read> tables: array<vec2f>;
@group(0) @binding(2) var<storage, read> samples: array<Sample>;
// (i_theta_h rows + row) 90 + i_theta_d of the cells that differ.
@group(0) @binding(3) var<storage, read> cells: array<u32>;
@group(0) @binding(4) var<storage, read_write> targets: array<vec4f>;

var<private> parameters: array<real, PARAMETERS>;
var<workgroup> tile_coordinates: array<array<real, 4>, TILE>;
var<workgroup> tile_weights: array<array<real, 3>, TILE>;

fn joined(pair: vec2f) -> real {
    return real(pair.x) + real(pair.y);
}

// exp(x) for x <= 0 to the last places of `real`; 0 below -86.
fn exp_real(x: real) -> real {
    if x < real(-86.0) {
        return real(0.0);
    }
    let n = round(f32(x) * 1.44269504);
    let r = (x - real(n) * real(0.693145751953125)) - real(n) * real(1.42860682030941723212e-6);
    var p = real(1.6059043836821613e-10);
    p = p * r + real(2.08767569878681e-9);
    p = p * r + real(2.505210838544172e-8);
    p = p * r + real(2.755731922398589e-7);
    p = p * r + real(2.7557319223985893e-6);
    p = p * r + real(2.48015873015873e-5);
    p = p * r + real(1.984126984126984e-4);
    p = p * r + real(1.388888888888889e-3);
    p = p * r + real(8.333333333333333e-3);
    p = p * r + real(4.1666666666666664e-2);
    p = p * r + real(1.6666666666666666e-1);
    p = p * r + real(0.5);
    p = p * r + real(1.0);
    p = p * r + real(1.0);
    return p * real(bitcast<f32>(u32(i32(n) + 127) << 23u));
}

// ln(x) for x >= 1: the built-in one, and a step of Halley's method on exp(y) = x.
fn log_real(x: real) -> real {
    let y = real(log(f32(x)));
    let e = x * exp_real(-y);
    return y + real(2.0) * (e - real(1.0)) / (e + real(1.0));
}

// Radial shapes of the squared scaled distance.
fn squared_exponential(r2: real) -> real {
    return exp_real(real(-0.5) * r2);
}

fn rational_quadratic(r2: real, alpha: real) -> real {
    return exp_real(-alpha * log_real(real(1.0) + r2 / (real(2.0) * alpha)));
}

fn matern_1_2(r2: real) -> real {
    return exp_real(-sqrt(r2));
}

fn matern_3_2(r2: real) -> real {
    let s = sqrt(real(3.0) * r2);
    return (real(1.0) + s) * exp_real(-s);
}

fn matern_5_2(r2: real) -> real {
    let s = sqrt(real(5.0) * r2);
    return (real(1.0) + s + s * s * real(0.3333333333333333)) * exp_real(-s);
}

@compute @workgroup_size(TILE)
fn sum_kernels(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    for (var k = 0u; k < PARAMETERS; k++) {
        parameters[k] = joined(tables[THIRD + 2u * dense.rows + k]);
    }
    // Invocations past the last cell compute its sum along, as all have to meet at the barriers.
    let number = dense.first_cell + id.x;
    let cell = cells[min(number, dense.last_cell - 1u)];
    let l = cell % N_THETA_D;
    let row = cell / N_THETA_D % dense.rows;
    let i = cell / N_THETA_D / dense.rows;
    let column = i * (N_PHI_D / 2u) + min(row, N_PHI_D - 1u - row);
    let x0 = joined(tables[i]);
    let x1 = min(joined(tables[SECOND + l]) * joined(tables[SCALE + column]), real(dense.limit));
    let x2 = joined(tables[THIRD + 2u * row]);
    let x3 = joined(tables[THIRD + 2u * row + 1u]);

    var sum0 = real(0.0);
    var sum1 = real(0.0);
    var sum2 = real(0.0);
    for (var first = dense.first_sample; first < dense.last_sample; first += TILE) {
        workgroupBarrier();
        let own = samples[min(first + local, dense.last_sample - 1u)];
        for (var k = 0u; k < 4u; k++) {
            tile_coordinates[local][k] = real(own.high[k]) + real(own.low[k]);
        }
        for (var k = 0u; k < 3u; k++) {
            tile_weights[local][k] = real(own.weight_high[k]) + real(own.weight_low[k]);
        }
        workgroupBarrier();
        let count = min(TILE, dense.last_sample - first);
        for (var j = 0u; j < count; j++) {
            let d0 = x0 - tile_coordinates[j][0];
            let d1 = x1 - tile_coordinates[j][1];
            var d2 = x2 - tile_coordinates[j][2];
            if dense.chord == 1u {
                d2 = x2 * tile_coordinates[j][3] - x3 * tile_coordinates[j][2];
            }
            let k = kernel(vec3<real>(d0 * d0, d1 * d1, d2 * d2));
            sum0 += k * tile_weights[j][0];
            sum1 += k * tile_weights[j][1];
            sum2 += k * tile_weights[j][2];
        }
    }
    if number < dense.last_cell {
        targets[cell] += vec4f(f32(sum0), f32(sum1), f32(sum2), 0.0);
    }
}
