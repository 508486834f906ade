// Measured materials in any renderer: the value of a baked table for two directions.
//
// Directions are unit vectors in the local frame of the surface: the normal is +z, `wi` points to the light
// and `wo` to the viewer. The table is a 3-D texture of 90 x 90 x 180 texels: x is sqrt(theta_h / (pi/2)), y
// is theta_d / (pi/2), z is phi_d / pi, and each value is that at the centre of its texel. Filter linearly,
// clamp x and y, repeat z. Red, green and blue hold the BRDF in 1/sr, without the cosine. Alpha holds the
// standard deviation of the model's target, which is ln(f + 0.001) by default.

// Texture coordinates of two directions, each in [0, 1].
fn gpbrdf_coordinates(wi: vec3f, wo: vec3f) -> vec3f {
    let angles = gpbrdf_half_difference(wi, wo);
    return vec3f(sqrt(angles.x * (2.0 / GPBRDF_PI)), angles.y * (2.0 / GPBRDF_PI), angles.z / GPBRDF_PI);
}

// The BRDF and, in alpha, its standard deviation; zero below the horizon. The sampler filters: it has to be
// linear and to clamp x, clamp y and repeat z. GPUs round the weights of a sampler to 1/256.
fn gpbrdf_lookup(table: texture_3d<f32>, filtering: sampler, wi: vec3f, wo: vec3f) -> vec4f {
    if wi.z <= 0.0 || wo.z <= 0.0 {
        return vec4f(0.0);
    }
    return textureSampleLevel(table, filtering, gpbrdf_coordinates(wi, wo), 0.0);
}

// Interpolates within the layer `p` between two columns `h` and two rows `d`, with the weights of the upper
// ones.
fn gpbrdf_bilinear(table: texture_3d<f32>, h: vec2i, d: vec2i, p: i32, upper: vec2f) -> vec4f {
    let below = mix(
        textureLoad(table, vec3i(h.x, d.x, p), 0),
        textureLoad(table, vec3i(h.y, d.x, p), 0),
        upper.x,
    );
    let above = mix(
        textureLoad(table, vec3i(h.x, d.y, p), 0),
        textureLoad(table, vec3i(h.y, d.y, p), 0),
        upper.x,
    );
    return mix(below, above, upper.y);
}

// As `gpbrdf_lookup`, with weights in full precision, by eight loads. The texture need not be filterable.
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
    let low = gpbrdf_bilinear(table, h, d, p.x, upper.xy);
    let high = gpbrdf_bilinear(table, h, d, p.y, upper.xy);
    return low * lower.z + high * upper.z;
}
