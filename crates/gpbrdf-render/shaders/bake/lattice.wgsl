// The predictive mean and variance of a lattice process on every cell of a table, as sums of products of one function along
// each axis: contract theta_h, then phi_d, then evaluate along theta_d.
//
// Coefficients hold up to three channels in xyz and the share of the variance that noise hides in w. That one goes with the
// squares of the functions.

struct Lattice {
    // Functions along theta_h, theta_d, phi_d, and rows of phi_d: 90 where it is folded, else 180.
    shape: vec4u,
    // Offsets into `tables`: functions and (prior, residual) variances along theta_h, then along phi_d.
    first: vec2u,
    third: vec2u,
    // Offsets: what depends on theta_d in the second coordinate, on the column, how many cells of a column are distinct,
    // and the breaks of the piecewise cubics.
    second: vec4u,
    // Intervals between breaks, and cubics in each interval, even in its graded coordinate.
    pieces: vec2u,
    signal_variance: f32,
    // Prior variance along theta_d.
    second_prior: f32,
    // Largest second coordinate.
    limit: f32,
    // Components of inducing lattices: what this variance adds to that of each channel.
    share: vec4f,
}

const N_THETA_H: u32 = 90u;
const N_THETA_D: u32 = 90u;
const N_PHI_D: u32 = 180u;

@group(0) @binding(0) var<uniform> lattice: Lattice;
@group(0) @binding(1) var<storage, read> tables: array<f32>;
// Cubics `dot(vec4(1, x, x^2, x^3), cubic)` with x in [0, 1]: of each function and, last, of the residual deviation.
@group(0) @binding(2) var<storage, read> cubics: array<vec4f>;
@group(0) @binding(3) var<storage, read> operand: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> result: array<vec4f>;

fn accumulate(sum: vec4f, value: f32, coefficient: vec4f) -> vec4f {
    return sum + coefficient * vec4f(value, value, value, value * value);
}

// operand: coefficients [a][b][c]; result: [i_theta_h][b][c].
@compute @workgroup_size(64)
fn contract_first(@builtin(global_invocation_id) id: vec3u) {
    let plane = lattice.shape.y * lattice.shape.z;
    if id.x >= plane || id.y >= N_THETA_H {
        return;
    }
    var sum = vec4f(0.0);
    for (var a = 0u; a < lattice.shape.x; a++) {
        let value = tables[lattice.first.x + id.y * lattice.shape.x + a];
        sum = accumulate(sum, value, operand[a * plane + id.x]);
    }
    result[id.y * plane + id.x] = sum;
}

// operand: [i_theta_h][b][c]; result: [i_theta_h][row][b].
@compute @workgroup_size(8, 8)
fn contract_third(@builtin(global_invocation_id) id: vec3u) {
    let b = lattice.shape.y;
    let c = lattice.shape.z;
    let rows = lattice.shape.w;
    if id.x >= b || id.y >= rows || id.z >= N_THETA_H {
        return;
    }
    var sum = vec4f(0.0);
    for (var k = 0u; k < c; k++) {
        let value = tables[lattice.third.x + id.y * c + k];
        sum = accumulate(sum, value, operand[(id.z * b + id.x) * c + k]);
    }
    result[(id.z * rows + id.y) * b + id.x] = sum;
}

struct Evaluated {
    // Whether the cell has a place of its own.
    distinct: bool,
    // Of the cell in the targets.
    cell: u32,
    mean: vec3f,
    variance: f32,
}

// operand: [i_theta_h][row][b].
fn evaluate(id: vec3u) -> Evaluated {
    var found: Evaluated;
    let rows = lattice.shape.w;
    if id.x >= N_THETA_D || id.y >= rows || id.z >= N_THETA_H {
        return found;
    }
    let column = id.z * (N_PHI_D / 2u) + min(id.y, N_PHI_D - 1u - id.y);
    if f32(id.x) >= tables[lattice.second.z + column] {
        return found;
    }
    let t = min(tables[lattice.second.x + id.x] * tables[lattice.second.y + column], lattice.limit);

    // The interval of t, then the cubic within it.
    var low = 0u;
    var high = lattice.pieces.x;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if tables[lattice.second.w + middle] <= t {
            low = middle;
        } else {
            high = middle;
        }
    }
    // Pieces crowd quadratically towards both ends, from where the distance is taken: there the functions may have kinks.
    let begin = tables[lattice.second.w + low];
    let end = tables[lattice.second.w + low + 1u];
    let width = end - begin;
    let root = sqrt(clamp(0.5 * min(t - begin, end - t) / width, 0.0, 0.25));
    let upper = t - begin > end - t;
    let count = f32(lattice.pieces.y);
    let position = select(root * count, count - root * count, upper);
    let piece = min(u32(position), lattice.pieces.y - 1u);
    let x = position - f32(piece);
    let powers = vec4f(1.0, x, x * x, x * x * x);

    let functions = lattice.shape.y;
    let first_cubic = (low * lattice.pieces.y + piece) * (functions + 1u);
    let row = id.z * rows + id.y;
    var sum = vec4f(0.0);
    for (var b = 0u; b < functions; b++) {
        sum = accumulate(sum, dot(powers, cubics[first_cubic + b]), operand[row * functions + b]);
    }

    let deviation = dot(powers, cubics[first_cubic + functions]);
    let residual = deviation * deviation;
    let first_prior = tables[lattice.first.y + 2u * id.z];
    let first_residual = tables[lattice.first.y + 2u * id.z + 1u];
    let third_prior = tables[lattice.third.y + 2u * id.y];
    let third_residual = tables[lattice.third.y + 2u * id.y + 1u];
    let first_explained = first_prior - first_residual;
    let second_explained = lattice.second_prior - residual;
    let variance = sum.w + first_residual * lattice.second_prior * third_prior
        + first_explained * (residual * third_prior + second_explained * third_residual);

    found.distinct = true;
    found.cell = row * N_THETA_D + id.x;
    found.mean = sum.xyz;
    found.variance = max(lattice.signal_variance * variance, 0.0);
    return found;
}

// result: targets [i_theta_h][row][i_theta_d], to which the means are added; w takes the larger standard deviation.
@compute @workgroup_size(32, 2)
fn evaluate_second(@builtin(global_invocation_id) id: vec3u) {
    let found = evaluate(id);
    if found.distinct {
        let before = result[found.cell];
        result[found.cell] = vec4f(before.xyz + found.mean, max(before.w, sqrt(found.variance)));
    }
}

// Targets: as many again hold the variances of the channels.
fn cells() -> u32 {
    return N_THETA_H * lattice.shape.w * N_THETA_D;
}

// result: targets, to which the means are added, then variances, to which the shares of this one are.
@compute @workgroup_size(32, 2)
fn evaluate_component(@builtin(global_invocation_id) id: vec3u) {
    let found = evaluate(id);
    if found.distinct {
        result[found.cell] += vec4f(found.mean, 0.0);
        result[cells() + found.cell] += lattice.share * found.variance;
    }
}

// result: targets, whose w becomes the largest standard deviation of the three channels, then variances.
@compute @workgroup_size(32, 2)
fn largest_deviation(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= N_THETA_D || id.y >= lattice.shape.w || id.z >= N_THETA_H {
        return;
    }
    let cell = (id.z * lattice.shape.w + id.y) * N_THETA_D + id.x;
    let variance = result[cells() + cell];
    result[cell].w = sqrt(max(variance.x, max(variance.y, variance.z)));
}
