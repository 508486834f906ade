// The predictive mean of a process in the form of a kernel sum: in each cell, the sum of kernel values times
// weights over all samples. Needs bake/real.wgsl and bake/shapes.wgsl.
//
// Composed with the definitions of `real`, f64 or f32, and of PARAMETERS, the number of kernel parameters,
// and with `fn kernel(d: vec3<real>) -> real`: the covariance for the squared distances along the three axes,
// which reads `parameters`. Numbers come as pairs of f32 whose sum is the value, so that one source serves
// both precisions.

struct KernelSum {
    // The cells and the samples of this dispatch.
    first_cell: u32,
    last_cell: u32,
    first_sample: u32,
    last_sample: u32,
    // 1 where the third coordinate is an angle, given as sine and cosine, with the distance
    // |sin(difference)|; else 0.
    chord: u32,
}

struct Sample {
    // Coordinates. The third and fourth are the sine and cosine of the third one where that is an angle.
    high: vec4f,
    low: vec4f,
    // The weight of each channel.
    weight_high: vec4f,
    weight_low: vec4f,
}

// Samples that a workgroup shares at a time, one for each of its invocations.
const TILE: u32 = 64u;

@group(0) @binding(0) var<uniform> form: KernelSum;
// The parameters of the kernel, then the coordinates of the cells [cell][4]: the third and fourth are the sine
// and cosine of the third one where that is an angle.
@group(0) @binding(1) var<storage, read> tables: array<vec2f>;
@group(0) @binding(2) var<storage, read> samples: array<Sample>;
// Which targets are computed, as indices into `targets`: those of the cells whose coordinates differ.
@group(0) @binding(3) var<storage, read> cells: array<u32>;
@group(0) @binding(4) var<storage, read_write> targets: array<vec4f>;

var<private> parameters: array<real, PARAMETERS>;
var<workgroup> tile_coordinates: array<array<real, 4>, TILE>;
var<workgroup> tile_weights: array<array<real, 3>, TILE>;

fn joined(pair: vec2f) -> real {
    return real(pair.x) + real(pair.y);
}

@compute @workgroup_size(TILE)
fn sum_kernels(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    for (var k = 0u; k < PARAMETERS; k++) {
        parameters[k] = joined(tables[k]);
    }
    // Invocations past the last cell repeat its sum, because all of a workgroup have to reach the barriers.
    let number = form.first_cell + id.x;
    let last = min(number, form.last_cell - 1u);
    let at = PARAMETERS + 4u * last;
    let x0 = joined(tables[at]);
    let x1 = joined(tables[at + 1u]);
    let x2 = joined(tables[at + 2u]);
    let x3 = joined(tables[at + 3u]);

    var sum0 = real(0.0);
    var sum1 = real(0.0);
    var sum2 = real(0.0);
    for (var first = form.first_sample; first < form.last_sample; first += TILE) {
        workgroupBarrier();
        let own = samples[min(first + local, form.last_sample - 1u)];
        for (var k = 0u; k < 4u; k++) {
            tile_coordinates[local][k] = real(own.high[k]) + real(own.low[k]);
        }
        for (var k = 0u; k < 3u; k++) {
            tile_weights[local][k] = real(own.weight_high[k]) + real(own.weight_low[k]);
        }
        workgroupBarrier();
        let count = min(TILE, form.last_sample - first);
        for (var j = 0u; j < count; j++) {
            let d0 = x0 - tile_coordinates[j][0];
            let d1 = x1 - tile_coordinates[j][1];
            var d2 = x2 - tile_coordinates[j][2];
            if form.chord == 1u {
                d2 = x2 * tile_coordinates[j][3] - x3 * tile_coordinates[j][2];
            }
            let k = kernel(vec3<real>(d0 * d0, d1 * d1, d2 * d2));
            sum0 += k * tile_weights[j][0];
            sum1 += k * tile_weights[j][1];
            sum2 += k * tile_weights[j][2];
        }
    }
    if number < form.last_cell {
        targets[cells[number]] += vec4f(f32(sum0), f32(sum1), f32(sum2), 0.0);
    }
}
