// Light reflected by two materials at the points of the G-buffer, added to running sums. Comes after lookup.wgsl and a
// function `material`. No shadows; light is reflected once.

struct Shade {
    // Perspective: the eye and 1. Orthographic: towards the viewer and 0.
    viewer: vec4f,
    // Point light: its position. Directional light: towards it, of unit length.
    light: vec4f,
    // Intensity of a point light; irradiance of a directional one on a surface that faces it.
    strength: vec4f,
    size: vec2u,
    environment_size: vec2u,
    first_row: u32,
    first_sample: u32,
    sample_count: u32,
    light_kind: u32,
    strategy: u32,
    single_material: u32,
    min_cosine: f32,
    // The share of directions drawn by the cosine when drawing from the BRDF.
    cosine_share: f32,
}

const DIRECTIONAL: u32 = 0u;
const POINT: u32 = 1u;
const ENVIRONMENT: u32 = 2u;

const SAMPLE_LIGHT: u32 = 0u;
const SAMPLE_BRDF: u32 = 1u;
const SAMPLE_BOTH: u32 = 2u;

const VIEW_BINS: u32 = 64u;
const RINGS: u32 = 90u;

@group(0) @binding(0) var<uniform> shade: Shade;
@group(0) @binding(1) var positions: texture_2d<u32>;
@group(0) @binding(2) var normals: texture_2d<u32>;
@group(0) @binding(3) var truth: texture_3d<f32>;
@group(0) @binding(4) var prediction: texture_3d<f32>;
// Radiance and, in alpha, the density of directions in 1/sr.
@group(0) @binding(5) var environment: texture_2d<f32>;
// Running shares of the rows, then of the pixels of each row.
@group(0) @binding(6) var<storage, read> environment_shares: array<f32>;
// sin^2(theta_h / 2) at the edges of the rings, then running shares of the rings for every view angle.
@group(0) @binding(7) var<storage, read> edges: array<f32>;
@group(0) @binding(8) var<storage, read> shares: array<f32>;
// Two for each pixel: radiance of the truth and number of hits; radiance of the prediction and luminance times sigma.
@group(0) @binding(9) var<storage, read_write> sums: array<vec4f>;
//SAMPLER @group(0) @binding(10) var material_sampler: sampler;

// A point of a surface: an orthonormal frame in the world, and the direction to the viewer in it.
struct Surface {
    tangent: vec3f,
    bitangent: vec3f,
    normal: vec3f,
    wo: vec3f,
    // First running share of its view angle.
    view_bin: u32,
}

struct Reflected {
    truth: vec3f,
    prediction: vec3f,
    // Luminance of the prediction times sigma.
    sigma: f32,
}

// T. Duff et al., "Building an Orthonormal Basis, Revisited" (2017).
fn make_surface(normal: vec3f, to_viewer: vec3f) -> Surface {
    let sign = select(-1.0, 1.0, normal.z >= 0.0);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    var surface: Surface;
    surface.tangent = vec3f(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
    surface.bitangent = vec3f(b, sign + normal.y * normal.y * a, -normal.y);
    surface.normal = normal;
    surface.wo = to_local(surface, to_viewer);
    let theta_o = gpbrdf_atan2(length(surface.wo.xy), surface.wo.z);
    let bin = u32(max(theta_o * (2.0 / GPBRDF_PI) * f32(VIEW_BINS), 0.0));
    surface.view_bin = min(bin, VIEW_BINS - 1u) * (RINGS + 1u);
    return surface;
}

fn to_local(surface: Surface, w: vec3f) -> vec3f {
    return vec3f(dot(w, surface.tangent), dot(w, surface.bitangent), dot(w, surface.normal));
}

fn to_world(surface: Surface, w: vec3f) -> vec3f {
    return w.x * surface.tangent + w.y * surface.bitangent + w.z * surface.normal;
}

// Adds what both materials reflect of `irradiance`, that of a surface that faces `wi`.
fn reflect_light(sum: Reflected, surface: Surface, wi: vec3f, irradiance: vec3f) -> Reflected {
    var out = sum;
    if wi.z < shade.min_cosine || wi.z <= 0.0 {
        return out;
    }
    let light = irradiance * wi.z;
    let predicted = material(prediction, wi, surface.wo);
    let radiance = predicted.rgb * light;
    out.prediction += radiance;
    out.sigma += dot(radiance, vec3f(0.2126, 0.7152, 0.0722)) * predicted.a;
    if shade.single_material == 0u {
        out.truth += material(truth, wi, surface.wo).rgb * light;
    }
    return out;
}

// The permutation pcg of M. Jarzynski and M. Olano, "Hash Functions for GPU Rendering" (2020).
fn hash(value: u32) -> u32 {
    let state = value * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Point `index` of the additive recurrence with the reciprocals of the plastic number and of its square (M. Roberts, "The
// Unreasonable Effectiveness of Quasirandom Sequences", 2018), in fixed point, moved by a random vector for each pixel and
// `stream`.
fn low_discrepancy(pixel: vec2u, stream: u32, index: u32) -> vec2f {
    let seed = hash(pixel.x + hash(pixel.y + hash(stream)));
    let x = seed + index * 3242174889u;
    let y = hash(seed) + index * 2447445414u;
    return vec2f(f32(x >> 8u), f32(y >> 8u)) * (1.0 / 16777216.0);
}

// The direction of a map's coordinates: see the environment of the core.
fn environment_direction(cosine: f32, u: f32) -> vec3f {
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let azimuth = 2.0 * GPBRDF_PI * (u - 0.5);
    return vec3f(sine * sin(azimuth), cosine, -sine * cos(azimuth));
}

// Radiance and density of the pixel in a direction.
fn environment_towards(w: vec3f) -> vec4f {
    let u = gpbrdf_atan2(w.x, -w.z) / (2.0 * GPBRDF_PI) + 0.5;
    let v = gpbrdf_atan2(length(w.xz), w.y) / GPBRDF_PI;
    let at = vec2u(max(vec2f(u, v) * vec2f(shade.environment_size), vec2f(0.0)));
    return textureLoad(environment, min(at, shade.environment_size - 1u), 0);
}

// A number in [0, 1) to one of `count` intervals: its index and the place within it.
fn find_environment_share(first: u32, count: u32, x: f32) -> vec2f {
    var low = 0u;
    var high = count;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if environment_shares[first + middle] <= x {
            low = middle;
        } else {
            high = middle;
        }
    }
    let begin = environment_shares[first + low];
    let width = environment_shares[first + low + 1u] - begin;
    return vec2f(f32(low), select(0.5, clamp((x - begin) / width, 0.0, 1.0), width > 0.0));
}

fn find_ring(first: u32, x: f32) -> vec2f {
    var low = 0u;
    var high = RINGS;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if shares[first + middle] <= x {
            low = middle;
        } else {
            high = middle;
        }
    }
    let begin = shares[first + low];
    let width = shares[first + low + 1u] - begin;
    return vec2f(f32(low), select(0.5, clamp((x - begin) / width, 0.0, 1.0), width > 0.0));
}

// The density, in 1/sr, with which `brdf_direction` draws wi.
fn brdf_density(surface: Surface, wi: vec3f) -> f32 {
    let sum = wi + surface.wo;
    let h = sum / max(length(sum), 1e-20);
    let cosine = dot(surface.wo, h);
    // sin^2(theta_h / 2) without cancellation.
    let s = dot(h.xy, h.xy) / (2.0 * (1.0 + h.z));
    let theta_h = 2.0 * gpbrdf_atan2(sqrt(s), sqrt(max(1.0 - s, 0.0)));
    let ring = min(u32(sqrt(theta_h * (2.0 / GPBRDF_PI)) * f32(RINGS)), RINGS - 1u);
    let first = surface.view_bin + ring;
    let share = shares[first + 1u] - shares[first];
    let solid_angle = 4.0 * GPBRDF_PI * (edges[ring + 1u] - edges[ring]);
    let by_half_vector = share / (solid_angle * 4.0 * max(cosine, 1e-6));
    return mix(by_half_vector, max(wi.z, 0.0) / GPBRDF_PI, shade.cosine_share);
}

// Draws a direction: by the cosine, or the mirror image of wo in a half vector out of the distribution of its view angle.
fn brdf_direction(surface: Surface, point: vec2f) -> vec3f {
    let azimuth = 2.0 * GPBRDF_PI * point.y;
    let around = vec2f(cos(azimuth), sin(azimuth));
    if point.x < shade.cosine_share {
        let square = point.x / shade.cosine_share;
        return vec3f(sqrt(square) * around, sqrt(1.0 - square));
    }
    let found = find_ring(surface.view_bin, (point.x - shade.cosine_share) / (1.0 - shade.cosine_share));
    let ring = u32(found.x);
    let s = mix(edges[ring], edges[ring + 1u], found.y);
    let h = vec3f(2.0 * sqrt(s * (1.0 - s)) * around, 1.0 - 2.0 * s);
    return normalize(2.0 * dot(surface.wo, h) * h - surface.wo);
}

// One sample of the light of the environment. With both strategies one direction of each, weighted by the balance
// heuristic of E. Veach and L. Guibas, "Optimally Combining Sampling Techniques" (1995), which here is to divide by the sum
// of the densities.
fn environment_sample(sum: Reflected, surface: Surface, pixel: vec2u, index: u32) -> Reflected {
    var out = sum;
    if shade.strategy != SAMPLE_BRDF {
        let point = low_discrepancy(pixel, 1u, index);
        let row = find_environment_share(0u, shade.environment_size.y, point.y);
        let y = u32(row.x);
        let first = shade.environment_size.y + 1u + y * (shade.environment_size.x + 1u);
        let column = find_environment_share(first, shade.environment_size.x, point.x);
        let height = f32(shade.environment_size.y);
        let top = cos(GPBRDF_PI * row.x / height);
        let bottom = cos(GPBRDF_PI * (row.x + 1.0) / height);
        let u = (column.x + column.y) / f32(shade.environment_size.x);
        let wi = to_local(surface, environment_direction(mix(top, bottom, row.y), u));
        let light = textureLoad(environment, vec2u(u32(column.x), y), 0);
        var density = light.a;
        if wi.z > 0.0 && density > 0.0 {
            if shade.strategy == SAMPLE_BOTH {
                density += brdf_density(surface, wi);
            }
            out = reflect_light(out, surface, wi, light.rgb / density);
        }
    }
    if shade.strategy != SAMPLE_LIGHT {
        let wi = brdf_direction(surface, low_discrepancy(pixel, 2u, index));
        if wi.z > 0.0 {
            var density = brdf_density(surface, wi);
            let light = environment_towards(to_world(surface, wi));
            if shade.strategy == SAMPLE_BOTH {
                density += light.a;
            }
            if density > 0.0 {
                out = reflect_light(out, surface, wi, light.rgb / density);
            }
        }
    }
    return out;
}

@compute @workgroup_size(8, 8)
fn shade_pixels(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2u(id.x, id.y + shade.first_row);
    if pixel.x >= shade.size.x || pixel.y >= shade.size.y {
        return;
    }
    let normal = bitcast<vec4f>(textureLoad(normals, pixel, 0));
    if normal.w == 0.0 {
        return;
    }
    let position = bitcast<vec4f>(textureLoad(positions, pixel, 0)).xyz;
    var to_viewer = shade.viewer.xyz;
    if shade.viewer.w > 0.0 {
        to_viewer = normalize(shade.viewer.xyz - position);
    }
    let surface = make_surface(normal.xyz, to_viewer);
    var sum = Reflected(vec3f(0.0), vec3f(0.0), 0.0);
    if surface.wo.z > 0.0 && surface.wo.z >= shade.min_cosine {
        if shade.light_kind == ENVIRONMENT {
            for (var i = 0u; i < shade.sample_count; i++) {
                sum = environment_sample(sum, surface, pixel, shade.first_sample + i);
            }
        } else if shade.light_kind == DIRECTIONAL {
            sum = reflect_light(sum, surface, to_local(surface, shade.light.xyz), shade.strength.rgb);
        } else {
            let gap = shade.light.xyz - position;
            let square = max(dot(gap, gap), 1e-12);
            let wi = to_local(surface, gap * inverseSqrt(square));
            sum = reflect_light(sum, surface, wi, shade.strength.rgb / square);
        }
    }
    if shade.single_material != 0u {
        sum.truth = sum.prediction;
    }
    let at = 2u * (pixel.y * shade.size.x + pixel.x);
    sums[at] += vec4f(sum.truth, f32(shade.sample_count));
    sums[at + 1u] += vec4f(sum.prediction, sum.sigma);
}
