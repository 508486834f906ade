// Light reflected by two materials at the surfaces of the G-buffer, added to running sums. There are no
// shadows, and light is reflected once. Needs all of shared/ but view.wgsl and grid.wgsl, and only one of
// material_exact.wgsl and material_filtered.wgsl.

struct Shade {
    // Perspective camera: the eye, and 1. Orthographic camera: the direction to the viewer, and 0.
    viewer: vec4f,
    // Point light: its position. Directional light: the unit vector to it.
    light: vec4f,
    // Intensity of a point light; irradiance of a directional one on a surface that faces it.
    strength: vec4f,
    size: vec2u,
    environment_size: vec2u,
    first_row: u32,
    first_sample: u32,
    sample_count: u32,
    // One of LIGHT_*.
    light_kind: u32,
    // One of SAMPLE_*.
    sampling: u32,
    // 1 where the prediction is the only material, else 0.
    single_material: u32,
    // Nothing is reflected where either cosine is smaller.
    min_cosine: f32,
    padding: u32,
}

const LIGHT_DIRECTIONAL: u32 = 0u;
const LIGHT_POINT: u32 = 1u;
const LIGHT_ENVIRONMENT: u32 = 2u;

const SAMPLE_LIGHT: u32 = 0u;
const SAMPLE_BRDF: u32 = 1u;
const SAMPLE_BOTH: u32 = 2u;

@group(0) @binding(0) var<uniform> shade: Shade;
@group(0) @binding(1) var positions: texture_2d<u32>;
@group(0) @binding(2) var normals: texture_2d<u32>;
@group(0) @binding(3) var truth: texture_3d<f32>;
@group(0) @binding(4) var prediction: texture_3d<f32>;
// Radiance and, in alpha, the density of directions in 1/sr.
@group(0) @binding(5) var environment: texture_2d<f32>;
// Running shares of the rows, then of the pixels of each row.
@group(0) @binding(6) var<storage, read> environment_shares: array<f32>;
// What both materials reflect together, as shared/directions.wgsl wants it.
@group(0) @binding(7) var<storage, read> densities: array<f32>;
// [row][column].
@group(0) @binding(8) var<storage, read_write> sums: array<PixelSums>;

fn gpbrdf_density(index: u32) -> f32 {
    return densities[index];
}

// The only series of shared/search.wgsl.
const ENVIRONMENT_SHARES: u32 = 0u;

fn ascending(series: u32, i: u32) -> f32 {
    return environment_shares[i];
}

// A point of a surface: an orthonormal frame in the world, and the direction to the viewer in it.
struct Surface {
    tangent: vec3f,
    bitangent: vec3f,
    normal: vec3f,
    wo: vec3f,
}

struct Reflected {
    truth: vec3f,
    prediction: vec3f,
    // Luminance of the prediction times sigma.
    weighted_sigma: f32,
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
    return surface;
}

fn to_local(surface: Surface, w: vec3f) -> vec3f {
    return vec3f(dot(w, surface.tangent), dot(w, surface.bitangent), dot(w, surface.normal));
}

fn to_world(surface: Surface, w: vec3f) -> vec3f {
    return w.x * surface.tangent + w.y * surface.bitangent + w.z * surface.normal;
}

// Adds the light that both materials reflect. `irradiance` is that of a surface that faces `wi`.
fn reflect_light(sum: Reflected, surface: Surface, wi: vec3f, irradiance: vec3f) -> Reflected {
    var out = sum;
    if wi.z < shade.min_cosine || wi.z <= 0.0 {
        return out;
    }
    let light = irradiance * wi.z;
    let predicted = material(prediction, wi, surface.wo);
    let radiance = predicted.rgb * light;
    out.prediction += radiance;
    out.weighted_sigma += luminance(radiance) * predicted.a;
    if shade.single_material == 0u {
        out.truth += material(truth, wi, surface.wo).rgb * light;
    }
    return out;
}

// Radiance and, in alpha, density of the map's pixel in a direction.
fn environment_towards(w: vec3f) -> vec4f {
    let at = vec2u(max(environment_coordinates(w) * vec2f(shade.environment_size), vec2f(0.0)));
    return textureLoad(environment, min(at, shade.environment_size - 1u), 0);
}

// Adds one sample of the light of the environment. SAMPLE_BOTH draws one direction from the light and one
// from the BRDF and weights both by the balance heuristic of E. Veach and L. Guibas, "Optimally Combining
// Sampling Techniques" (1995), which here amounts to dividing by the sum of the densities.
fn environment_sample(sum: Reflected, surface: Surface, pixel: vec2u, index: u32) -> Reflected {
    var out = sum;
    if shade.sampling != SAMPLE_BRDF {
        let point = low_discrepancy(pixel, 1u, index);
        let row = find_place(ENVIRONMENT_SHARES, 0u, shade.environment_size.y, point.y);
        let first = shade.environment_size.y + 1u + row.interval * (shade.environment_size.x + 1u);
        let column = find_place(ENVIRONMENT_SHARES, first, shade.environment_size.x, point.x);
        let height = f32(shade.environment_size.y);
        let top = cos(GPBRDF_PI * f32(row.interval) / height);
        let bottom = cos(GPBRDF_PI * (f32(row.interval) + 1.0) / height);
        let u = (f32(column.interval) + column.within) / f32(shade.environment_size.x);
        let wi = to_local(surface, environment_direction(mix(top, bottom, row.within), u));
        let light = textureLoad(environment, vec2u(column.interval, row.interval), 0);
        var density = light.a;
        if wi.z > 0.0 && density > 0.0 {
            if shade.sampling == SAMPLE_BOTH {
                density += gpbrdf_pdf(wi, surface.wo);
            }
            out = reflect_light(out, surface, wi, light.rgb / density);
        }
    }
    if shade.sampling != SAMPLE_LIGHT {
        let drawn = gpbrdf_direction(surface.wo, low_discrepancy(pixel, 2u, index));
        if drawn.pdf > 0.0 {
            let light = environment_towards(to_world(surface, drawn.wi));
            var density = drawn.pdf;
            if shade.sampling == SAMPLE_BOTH {
                density += light.a;
            }
            out = reflect_light(out, surface, drawn.wi, light.rgb / density);
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
        if shade.light_kind == LIGHT_ENVIRONMENT {
            for (var i = 0u; i < shade.sample_count; i++) {
                sum = environment_sample(sum, surface, pixel, shade.first_sample + i);
            }
        } else if shade.light_kind == LIGHT_DIRECTIONAL {
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
    let at = pixel.y * shade.size.x + pixel.x;
    sums[at].truth += sum.truth;
    sums[at].hits += f32(shade.sample_count);
    sums[at].prediction += sum.prediction;
    sums[at].weighted_sigma += sum.weighted_sigma;
}
