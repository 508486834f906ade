// The predictive mean and variance of a process in its separable form, in every cell of a table. The form is
// a sum of products of one function along each axis: contract theta_h, then phi_d, then evaluate along
// theta_d. Needs shared/grid.wgsl and shared/search.wgsl.
//
// Coefficients hold up to three channels in xyz. Their w is the share of the variance that noise hides, which
// goes with the squares of the functions.

struct Separable {
    // Functions along theta_h, theta_d and phi_d, and rows of the targets along phi_d.
    shape: vec4u,
    // Offsets into `tables` of the functions and of the (prior, residual) variances: along theta_h in
    // `first`, along phi_d in `third`.
    first: vec2u,
    third: vec2u,
    // Offsets into `tables` for theta_d: the factor of the second coordinate that depends on theta_d, the
    // factor that depends on the column, the number of distinct cells of each column, and the breaks of the
    // piecewise cubics.
    second: vec4u,
    // Intervals between breaks, and pieces of each interval.
    pieces: vec2u,
    signal_variance: f32,
    // Prior variance along theta_d.
    second_prior: f32,
    // The largest second coordinate.
    limit: f32,
    // Where the form is a component that is mixed into all channels: the factor by which its variance adds to
    // that of each channel.
    share: vec4f,
}

@group(0) @binding(0) var<uniform> form: Separable;
@group(0) @binding(1) var<storage, read> tables: array<f32>;
// [interval][piece][function, and last the residual deviation]: the cubic `dot(vec4(1, x, x^2, x^3), cubic)`
// in the place x of a piece, from 0 to 1.
@group(0) @binding(2) var<storage, read> cubics: array<vec4f>;
@group(0) @binding(3) var<storage, read> operand: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> result: array<vec4f>;

// The only series of shared/search.wgsl.
fn ascending(series: u32, i: u32) -> f32 {
    return tables[i];
}

fn accumulate(sum: vec4f, value: f32, coefficient: vec4f) -> vec4f {
    return sum + coefficient * vec4f(value, value, value, value * value);
}

// operand: coefficients [a][b][c]; result: [i_theta_h][b][c].
@compute @workgroup_size(64)
fn contract_first(@builtin(global_invocation_id) id: vec3u) {
    let plane = form.shape.y * form.shape.z;
    if id.x >= plane || id.y >= N_THETA_H {
        return;
    }
    var sum = vec4f(0.0);
    for (var a = 0u; a < form.shape.x; a++) {
        let value = tables[form.first.x + id.y * form.shape.x + a];
        sum = accumulate(sum, value, operand[a * plane + id.x]);
    }
    result[id.y * plane + id.x] = sum;
}

// operand: [i_theta_h][b][c]; result: [i_theta_h][row][b].
@compute @workgroup_size(8, 8)
fn contract_third(@builtin(global_invocation_id) id: vec3u) {
    let b = form.shape.y;
    let c = form.shape.z;
    let rows = form.shape.w;
    if id.x >= b || id.y >= rows || id.z >= N_THETA_H {
        return;
    }
    var sum = vec4f(0.0);
    for (var k = 0u; k < c; k++) {
        let value = tables[form.third.x + id.y * c + k];
        sum = accumulate(sum, value, operand[(id.z * b + id.x) * c + k]);
    }
    result[(id.z * rows + id.y) * b + id.x] = sum;
}

struct Evaluated {
    // Whether the cell has its own target.
    distinct: bool,
    // Where that target is.
    cell: u32,
    mean: vec3f,
    variance: f32,
}

// A piece of the piecewise cubics, and the powers 1, x, x^2, x^3 of the place in it.
struct Piece {
    index: u32,
    powers: vec4f,
}

// The piece at the second coordinate t. Pieces crowd quadratically towards both ends of an interval, where
// functions may have kinks, so places are measured from the nearer end.
fn find_piece(t: f32) -> Piece {
    let interval = find_interval(0u, form.second.w, form.pieces.x, t);
    let begin = tables[form.second.w + interval];
    let end = tables[form.second.w + interval + 1u];
    let width = end - begin;
    let root = sqrt(clamp(0.5 * min(t - begin, end - t) / width, 0.0, 0.25));
    let upper = t - begin > end - t;
    let count = f32(form.pieces.y);
    let position = select(root * count, count - root * count, upper);
    let piece = min(u32(position), form.pieces.y - 1u);
    let x = position - f32(piece);
    return Piece(interval * form.pieces.y + piece, vec4f(1.0, x, x * x, x * x * x));
}

// operand: [i_theta_h][row][b].
fn evaluate(id: vec3u) -> Evaluated {
    var found: Evaluated;
    let rows = form.shape.w;
    if id.x >= N_THETA_D || id.y >= rows || id.z >= N_THETA_H {
        return found;
    }
    let column = column_index(id.z, id.y);
    if f32(id.x) >= tables[form.second.z + column] {
        return found;
    }
    let t = min(tables[form.second.x + id.x] * tables[form.second.y + column], form.limit);
    let piece = find_piece(t);

    let functions = form.shape.y;
    let first_cubic = piece.index * (functions + 1u);
    let row = id.z * rows + id.y;
    var sum = vec4f(0.0);
    for (var b = 0u; b < functions; b++) {
        sum = accumulate(sum, dot(piece.powers, cubics[first_cubic + b]), operand[row * functions + b]);
    }

    let deviation = dot(piece.powers, cubics[first_cubic + functions]);
    let residual = deviation * deviation;
    let first_prior = tables[form.first.y + 2u * id.z];
    let first_residual = tables[form.first.y + 2u * id.z + 1u];
    let third_prior = tables[form.third.y + 2u * id.y];
    let third_residual = tables[form.third.y + 2u * id.y + 1u];
    let first_explained = first_prior - first_residual;
    let second_explained = form.second_prior - residual;
    let variance = sum.w + first_residual * form.second_prior * third_prior
        + first_explained * (residual * third_prior + second_explained * third_residual);

    found.distinct = true;
    found.cell = target_index(id.z, id.y, id.x, rows);
    found.mean = sum.xyz;
    found.variance = max(form.signal_variance * variance, 0.0);
    return found;
}

// result: targets, to which the means are added; w takes the larger standard deviation.
@compute @workgroup_size(32, 2)
fn evaluate_second(@builtin(global_invocation_id) id: vec3u) {
    let found = evaluate(id);
    if found.distinct {
        let before = result[found.cell];
        result[found.cell] = vec4f(before.xyz + found.mean, max(before.w, sqrt(found.variance)));
    }
}

// Where the variances of the channels begin: behind the targets, in the same layout.
fn first_variance() -> u32 {
    return target_index(N_THETA_H, 0u, 0u, form.shape.w);
}

// result: targets, to which the means are added, then variances, to which the shares of the variance are
// added.
@compute @workgroup_size(32, 2)
fn evaluate_component(@builtin(global_invocation_id) id: vec3u) {
    let found = evaluate(id);
    if found.distinct {
        result[found.cell] += vec4f(found.mean, 0.0);
        result[first_variance() + found.cell] += form.share * found.variance;
    }
}

// result: targets, whose w becomes the largest standard deviation of the channels, then variances.
@compute @workgroup_size(32, 2)
fn largest_deviation(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= N_THETA_D || id.y >= form.shape.w || id.z >= N_THETA_H {
        return;
    }
    let cell = target_index(id.z, id.y, id.x, form.shape.w);
    let variance = result[first_variance() + cell];
    result[cell].w = sqrt(max(variance.x, max(variance.y, variance.z)));
}
