// Directions drawn from a measured material, and their density: the same numbers as `Material` of `gpbrdf-core`,
// which describes the coordinates.
//
// Needs shared/table.wgsl, shared/angles.wgsl and a function that reads the densities of a material,
//
//     fn gpbrdf_density(index: u32) -> f32
//
// from a buffer that holds the arrays `values`, `conditional` and `marginal` of `DirectionDensities`, one behind the
// other. Directions are unit vectors in the local frame of the surface: the normal is +z, `wi` points to the light and
// `wo` to the viewer.

const GPBRDF_VIEWS: u32 = 64u;
const GPBRDF_ROWS: u32 = 80u;
const GPBRDF_COLUMNS: u32 = 24u;
// The share of directions that are drawn in proportion to the cosine.
const GPBRDF_COSINE_SHARE: f32 = 0.1;
const GPBRDF_CONDITIONAL: u32 = GPBRDF_VIEWS * GPBRDF_ROWS * GPBRDF_COLUMNS;
const GPBRDF_MARGINAL: u32 = 2u * GPBRDF_CONDITIONAL;
const GPBRDF_LEAST: f32 = 1e-37;

// A direction to the light, and its density over solid angle in 1/sr, which is 0 where there is no direction.
struct GpbrdfDirection {
    wi: vec3f,
    pdf: f32,
}

// The same with the weight `f cos theta_i / pdf`.
struct GpbrdfSample {
    wi: vec3f,
    pdf: f32,
    weight: vec3f,
}

// The square of half vectors of one viewer.
struct GpbrdfSquare {
    // Unit horizontal vector towards the viewer.
    toward: vec2f,
    sine: f32,
    cosine: f32,
    cotangent: f32,
    squeeze: f32,
}

// A point of the square: row, column, and 1/sr for each unit of density there.
struct GpbrdfPoint {
    row: f32,
    column: f32,
    per_steradian: f32,
}

// Two elevations of the viewer and the weight of the second.
struct GpbrdfView {
    first: u32,
    second_weight: f32,
}

// arccos with an error of at most 5e-7. Abramowitz and Stegun (1964), 4.4.46.
fn gpbrdf_acos(x: f32) -> f32 {
    let a = abs(x);
    var p = -0.0012624911;
    p = p * a + 0.0066700901;
    p = p * a - 0.0170881256;
    p = p * a + 0.0308918810;
    p = p * a - 0.0501743046;
    p = p * a + 0.0889789874;
    p = p * a - 0.2145988016;
    p = p * a + 1.5707963050;
    let quadrant = sqrt(1.0 - a) * p;
    return select(quadrant, GPBRDF_PI - quadrant, x < 0.0);
}

// (cos x, sin x) for x in [0, pi], with an error of at most 3e-7: Taylor's polynomials about pi/2.
fn gpbrdf_cos_sin(x: f32) -> vec2f {
    let t = x - 0.5 * GPBRDF_PI;
    let s = t * t;
    let sine = t * (1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0
        + s * (-1.0 / 5040.0 + s * (1.0 / 362880.0 - s * (1.0 / 39916800.0))))));
    let cosine = 1.0 + s * (-0.5 + s * (1.0 / 24.0
        + s * (-1.0 / 720.0 + s * (1.0 / 40320.0 + s * (-1.0 / 3628800.0 + s * (1.0 / 479001600.0))))));
    return vec2f(-sine, cosine);
}

fn gpbrdf_row_node(j: u32) -> f32 {
    let t = f32(j) / f32(GPBRDF_ROWS - 1u);
    return (t * t) * (t * t);
}

fn gpbrdf_column_node(i: u32) -> f32 {
    let t = 1.0 - f32(i) / f32(GPBRDF_COLUMNS - 1u);
    return 1.0 - t * t;
}

fn gpbrdf_view(cosine: f32) -> GpbrdfView {
    let c = clamp(cosine, 0.0, 1.0);
    let v = c / (1.0 + sqrt(1.0 - c));
    let position = f32(GPBRDF_VIEWS - 1u) * (1.0 - sqrt(v));
    let first = min(u32(position), GPBRDF_VIEWS - 2u);
    return GpbrdfView(first, clamp(position - f32(first), 0.0, 1.0));
}

fn gpbrdf_square(wo: vec3f) -> GpbrdfSquare {
    var toward = vec2f(1.0, 0.0);
    var sine = length(wo.xy);
    if sine > 1e-6 {
        toward = wo.xy / sine;
    } else {
        sine = 1e-6;
    }
    let top = wo.z / sqrt(2.0 * (1.0 + sine));
    return GpbrdfSquare(toward, sine, wo.z, wo.z / sine, top / (1.0 - top));
}

// The largest azimuth of half vectors, radians, at z = 1 - cos theta_h and the sine of theta_h.
fn gpbrdf_half_range(square: GpbrdfSquare, z: f32, sine_h: f32) -> f32 {
    let double_cosine = 1.0 - 2.0 * sine_h * sine_h;
    let double_sine = 2.0 * sine_h * (1.0 - z);
    return gpbrdf_acos(clamp(-square.cotangent * double_cosine / max(double_sine, GPBRDF_LEAST), -1.0, 1.0));
}

fn gpbrdf_per_steradian(square: GpbrdfSquare, row: f32, half_range: f32, wo_dot_h: f32) -> f32 {
    let stretch = 1.0 + square.squeeze * row;
    return stretch * stretch / max(8.0 * half_range * wo_dot_h, 1e-30);
}

// The point of the square that stands for a direction above the horizon.
fn gpbrdf_point(square: GpbrdfSquare, wi: vec3f, wo: vec3f) -> GpbrdfPoint {
    let sum = wi + wo;
    let across2 = dot(sum.xy, sum.xy);
    let along_h = length(sum);
    let z = across2 / (along_h * (along_h + sum.z));
    let row = min(z / max(1.0 - square.squeeze * z, GPBRDF_LEAST), 1.0);
    let half_range = gpbrdf_half_range(square, z, sqrt(across2) / along_h);
    let along = dot(sum.xy, square.toward);
    let across = sum.y * square.toward.x - sum.x * square.toward.y;
    let azimuth = gpbrdf_atan2(abs(across), along);
    var column = 1.0;
    if azimuth < half_range {
        column = azimuth / half_range;
    }
    return GpbrdfPoint(row, column, gpbrdf_per_steradian(square, row, half_range, 0.5 * along_h));
}

// The density at a point of the square.
fn gpbrdf_density_at(view: GpbrdfView, row: f32, column: f32) -> f32 {
    let j = min(u32(sqrt(sqrt(row)) * f32(GPBRDF_ROWS - 1u)), GPBRDF_ROWS - 2u);
    let bottom = gpbrdf_row_node(j);
    let x = clamp((row - bottom) / (gpbrdf_row_node(j + 1u) - bottom), 0.0, 1.0);
    let i = min(u32((1.0 - sqrt(max(1.0 - column, 0.0))) * f32(GPBRDF_COLUMNS - 1u)), GPBRDF_COLUMNS - 2u);
    let start = gpbrdf_column_node(i);
    let b = clamp((column - start) / (gpbrdf_column_node(i + 1u) - start), 0.0, 1.0);
    var found = array<f32, 2>(0.0, 0.0);
    for (var k = 0u; k < 2u; k++) {
        let at = ((view.first + k) * GPBRDF_ROWS + j) * GPBRDF_COLUMNS + i;
        let low = mix(gpbrdf_density(at), gpbrdf_density(at + 1u), b);
        let high = mix(gpbrdf_density(at + GPBRDF_COLUMNS), gpbrdf_density(at + GPBRDF_COLUMNS + 1u), b);
        found[k] = mix(low, high, x);
    }
    return mix(found[0], found[1], view.second_weight);
}

// How far along a cell the integral of the linear density from a to b is `mass`.
fn gpbrdf_invert_linear(a: f32, b: f32, mass: f32) -> f32 {
    let root = sqrt(max(a * a + 2.0 * mass * (b - a), 0.0));
    return min(2.0 * mass / max(a + root, GPBRDF_LEAST), 1.0);
}

// A point (row, column) of the square drawn by two uniform numbers.
fn gpbrdf_draw(view: GpbrdfView, u1: f32, u2: f32) -> vec2f {
    var k = view.first;
    var u = (u1 - view.second_weight) / max(1.0 - view.second_weight, GPBRDF_LEAST);
    if u1 < view.second_weight {
        k += 1u;
        u = u1 / view.second_weight;
    }
    let marginal = GPBRDF_MARGINAL + k * GPBRDF_ROWS;
    let target_row = u * gpbrdf_density(marginal + GPBRDF_ROWS - 1u);
    var j = 0u;
    var end = GPBRDF_ROWS - 1u;
    while end - j > 1u {
        let middle = (j + end) / 2u;
        if gpbrdf_density(marginal + middle) <= target_row {
            j = middle;
        } else {
            end = middle;
        }
    }
    let values = (k * GPBRDF_ROWS + j) * GPBRDF_COLUMNS;
    let conditional = GPBRDF_CONDITIONAL + values;
    let bottom = gpbrdf_row_node(j);
    let top = gpbrdf_row_node(j + 1u);
    let below = gpbrdf_density(conditional + GPBRDF_COLUMNS - 1u);
    let above = gpbrdf_density(conditional + 2u * GPBRDF_COLUMNS - 1u);
    let x = gpbrdf_invert_linear(below, above, (target_row - gpbrdf_density(marginal + j)) / (top - bottom));
    let target_column = u2 * mix(below, above, x);
    var i = 0u;
    end = GPBRDF_COLUMNS - 1u;
    while end - i > 1u {
        let middle = (i + end) / 2u;
        let sum = mix(
            gpbrdf_density(conditional + middle),
            gpbrdf_density(conditional + GPBRDF_COLUMNS + middle),
            x,
        );
        if sum <= target_column {
            i = middle;
        } else {
            end = middle;
        }
    }
    let sum = mix(gpbrdf_density(conditional + i), gpbrdf_density(conditional + GPBRDF_COLUMNS + i), x);
    let left = mix(gpbrdf_density(values + i), gpbrdf_density(values + GPBRDF_COLUMNS + i), x);
    let right = mix(gpbrdf_density(values + i + 1u), gpbrdf_density(values + GPBRDF_COLUMNS + i + 1u), x);
    let first = gpbrdf_column_node(i);
    let width = gpbrdf_column_node(i + 1u) - first;
    let along = gpbrdf_invert_linear(left, right, (target_column - sum) / width);
    return vec2f(bottom + (top - bottom) * x, first + width * along);
}

fn gpbrdf_mixed(of_table: f32, cosine: f32) -> f32 {
    return (1.0 - GPBRDF_COSINE_SHARE) * of_table + (GPBRDF_COSINE_SHARE / GPBRDF_PI) * cosine;
}

// The BRDF in 1/sr, without the cosine; zero below the horizon.
fn gpbrdf_eval(table: texture_3d<f32>, wi: vec3f, wo: vec3f) -> vec3f {
    return gpbrdf_lookup_exact(table, wi, wo).rgb;
}

// The density, in 1/sr, with which `gpbrdf_sample` draws `wi` for this `wo`; zero below the horizon.
fn gpbrdf_pdf(wi: vec3f, wo: vec3f) -> f32 {
    if wi.z <= 0.0 || wo.z <= 0.0 {
        return 0.0;
    }
    let at = gpbrdf_point(gpbrdf_square(wo), wi, wo);
    return gpbrdf_mixed(gpbrdf_density_at(gpbrdf_view(wo.z), at.row, at.column) * at.per_steradian, wi.z);
}

// A direction to the light drawn by two numbers that are uniform on [0, 1). Its density is 0 where there is none.
fn gpbrdf_direction(wo: vec3f, u: vec2f) -> GpbrdfDirection {
    let none = GpbrdfDirection(vec3f(0.0, 0.0, 1.0), 0.0);
    if wo.z <= 0.0 {
        return none;
    }
    let square = gpbrdf_square(wo);
    let view = gpbrdf_view(wo.z);
    // The second number also chooses the side of the plane of incidence.
    var side = 1.0;
    var u2 = 2.0 * u.y;
    if u.y >= 0.5 {
        side = -1.0;
        u2 = 2.0 * u.y - 1.0;
    }
    var wi = vec3f(0.0);
    var of_table = 0.0;
    if u.x < GPBRDF_COSINE_SHARE {
        let u1 = u.x / GPBRDF_COSINE_SHARE;
        let radius = sqrt(u1);
        let turn = gpbrdf_cos_sin(u2 * GPBRDF_PI);
        wi = vec3f(radius * turn.x, side * radius * turn.y, sqrt(1.0 - u1));
        let at = gpbrdf_point(square, wi, wo);
        of_table = gpbrdf_density_at(view, at.row, at.column) * at.per_steradian;
    } else {
        let at = gpbrdf_draw(view, (u.x - GPBRDF_COSINE_SHARE) / (1.0 - GPBRDF_COSINE_SHARE), u2);
        let z = at.x / (1.0 + square.squeeze * at.x);
        let sine_h = sqrt(z * (2.0 - z));
        let cosine_h = 1.0 - z;
        let half_range = gpbrdf_half_range(square, z, sine_h);
        let turn = gpbrdf_cos_sin(at.y * half_range);
        let along = sine_h * turn.x;
        let across = side * sine_h * turn.y;
        let wo_dot_h = square.sine * along + square.cosine * cosine_h;
        let x = 2.0 * wo_dot_h * along - square.sine;
        let y = 2.0 * wo_dot_h * across;
        wi = vec3f(
            x * square.toward.x - y * square.toward.y,
            x * square.toward.y + y * square.toward.x,
            2.0 * wo_dot_h * cosine_h - square.cosine,
        );
        of_table =
            gpbrdf_density_at(view, at.x, at.y) * gpbrdf_per_steradian(square, at.x, half_range, wo_dot_h);
    }
    if wi.z <= 0.0 {
        return none;
    }
    return GpbrdfDirection(wi, gpbrdf_mixed(of_table, wi.z));
}

// `gpbrdf_direction` with the weight of the table.
fn gpbrdf_sample(table: texture_3d<f32>, wo: vec3f, u: vec2f) -> GpbrdfSample {
    let drawn = gpbrdf_direction(wo, u);
    var weight = vec3f(0.0);
    if drawn.pdf > 0.0 {
        weight = gpbrdf_eval(table, drawn.wi, wo) * (drawn.wi.z / drawn.pdf);
    }
    return GpbrdfSample(drawn.wi, drawn.pdf, weight);
}
