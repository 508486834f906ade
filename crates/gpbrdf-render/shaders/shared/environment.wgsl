// Directions and the coordinates of latitude-longitude maps. Needs shared/angles.wgsl.
//
// u runs from 0 to 1 across the map, with -z in the middle and +x on its right; v runs from 0 at +y to 1 at
// -y.

fn environment_coordinates(w: vec3f) -> vec2f {
    let u = gpbrdf_atan2(w.x, -w.z) / (2.0 * GPBRDF_PI) + 0.5;
    let v = gpbrdf_atan2(length(w.xz), w.y) / GPBRDF_PI;
    return vec2f(u, v);
}

// The direction with y = `cosine` at the coordinate `u`.
fn environment_direction(cosine: f32, u: f32) -> vec3f {
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let azimuth = 2.0 * GPBRDF_PI * (u - 0.5);
    return vec3f(sine * sin(azimuth), cosine, -sine * cos(azimuth));
}
