// Measured materials in any renderer: two directions to a value of the baked table.
//
// Directions are unit vectors in the local frame of the surface, normal +z, `wi` to the light and `wo` to the viewer. The
// table is a 3-D texture of 90 x 90 x 180 texels: x is sqrt(theta_h / (pi/2)), y is theta_d / (pi/2), z is phi_d / pi, each
// value at the centre of its texel. Filter linearly, clamp x and y, repeat z. Red, green and blue hold the BRDF in 1/sr,
// without the cosine; alpha holds the standard deviation of ln(f + 0.001), or of what else the model was fitted to.

const GPBRDF_PI: f32 = 3.14159265358979;

// atan2 to 5e-8, where the built-in one may be off by 4096 units in the last place: M. Abramowitz and I. Stegun, "Handbook
// of Mathematical Functions" (1964), 4.4.49.
fn gpbrdf_atan2(y: f32, x: f32) -> f32 {
    let ax = abs(x);
    let ay = abs(y);
    let large = max(ax, ay);
    if large == 0.0 {
        return 0.0;
    }
    let t = min(ax, ay) / large;
    let s = t * t;
    var p = 0.0028662257 * s;
    p = (p - 0.0161657367) * s;
    p = (p + 0.0429096138) * s;
    p = (p - 0.0752896400) * s;
    p = (p + 0.1065626393) * s;
    p = (p - 0.1420889944) * s;
    p = (p + 0.1999355085) * s;
    p = (p - 0.3333314528) * s;
    let octant = t + t * p;
    let quadrant = select(octant, 0.5 * GPBRDF_PI - octant, ay > ax);
    let half_plane = select(quadrant, GPBRDF_PI - quadrant, x < 0.0);
    return select(half_plane, -half_plane, y < 0.0);
}

// (theta_h, theta_d, phi_d) of S. Rusinkiewicz, "A New Change of Variables for Efficient BRDF Representation" (1998), in
// radians: theta_h and theta_d in [0, pi/2], phi_d in [0, pi), as reciprocity makes phi_d and phi_d + pi alike.
fn gpbrdf_half_difference(wi: vec3f, wo: vec3f) -> vec3f {
    let sum = wi + wo;
    let along = length(sum);
    let across = length(sum.xy);
    let theta_d = gpbrdf_atan2(length(wi - wo), along);
    var azimuth_of_h = vec2f(1.0, 0.0);
    if across > 1e-7 {
        azimuth_of_h = sum.xy / across;
    }
    let theta_h = gpbrdf_atan2(across, sum.z);
    let x = (sum.z * dot(azimuth_of_h, wi.xy) - across * wi.z) / max(along, 1e-20);
    let y = azimuth_of_h.x * wi.y - azimuth_of_h.y * wi.x;
    let azimuth = gpbrdf_atan2(y, x);
    let phi_d = select(azimuth, azimuth + GPBRDF_PI, azimuth < 0.0);
    return vec3f(theta_h, theta_d, select(phi_d, 0.0, phi_d >= GPBRDF_PI));
}

// Texture coordinates of two directions, each in [0, 1].
fn gpbrdf_coordinates(wi: vec3f, wo: vec3f) -> vec3f {
    let angles = gpbrdf_half_difference(wi, wo);
    return vec3f(sqrt(angles.x * (2.0 / GPBRDF_PI)), angles.y * (2.0 / GPBRDF_PI), angles.z / GPBRDF_PI);
}

// The BRDF and, in alpha, its standard deviation; zero below the horizon. Filtered by the sampler: linear, clamp, clamp,
// repeat. GPUs round the weights of a sampler to 1/256.
fn gpbrdf_lookup(table: texture_3d<f32>, filtering: sampler, wi: vec3f, wo: vec3f) -> vec4f {
    if wi.z <= 0.0 || wo.z <= 0.0 {
        return vec4f(0.0);
    }
    return textureSampleLevel(table, filtering, gpbrdf_coordinates(wi, wo), 0.0);
}

// The same with weights in full precision: eight loads, and no need of a texture that can be filtered.
fn gpbrdf_lookup_exact(table: texture_3d<f32>, wi: vec3f, wo: vec3f) -> vec4f {
    if wi.z <= 0.0 || wo.z <= 0.0 {
        return vec4f(0.0);
    }
    let size = vec3i(textureDimensions(table));
    let position = gpbrdf_coordinates(wi, wo) * vec3f(size) - 0.5;
    let corner = floor(position);
    let upper = position - corner;
    let lower = 1.0 - upper;
    let first = vec3i(corner);
    let h = clamp(vec2i(first.x, first.x + 1), vec2i(0), vec2i(size.x - 1));
    let d = clamp(vec2i(first.y, first.y + 1), vec2i(0), vec2i(size.y - 1));
    let p = (vec2i(first.z, first.z + 1) + size.z) % size.z;
    let low = mix(
        mix(textureLoad(table, vec3i(h.x, d.x, p.x), 0), textureLoad(table, vec3i(h.y, d.x, p.x), 0), upper.x),
        mix(textureLoad(table, vec3i(h.x, d.y, p.x), 0), textureLoad(table, vec3i(h.y, d.y, p.x), 0), upper.x),
        upper.y,
    );
    let high = mix(
        mix(textureLoad(table, vec3i(h.x, d.x, p.y), 0), textureLoad(table, vec3i(h.y, d.x, p.y), 0), upper.x),
        mix(textureLoad(table, vec3i(h.x, d.y, p.y), 0), textureLoad(table, vec3i(h.y, d.y, p.y), 0), upper.x),
        upper.y,
    );
    return low * lower.z + high * upper.z;
}
