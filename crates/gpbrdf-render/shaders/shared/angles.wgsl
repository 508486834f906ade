// Half-difference angles of two directions.

const GPBRDF_PI: f32 = 3.14159265358979;

// atan2 with an error of at most 5e-8; the built-in function may be off by 4096 units in the last place.
// M. Abramowitz and I. Stegun, "Handbook of Mathematical Functions" (1964), 4.4.49.
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

// (theta_h, theta_d, phi_d) of S. Rusinkiewicz, "A New Change of Variables for Efficient BRDF Representation"
// (1998), in radians: theta_h and theta_d in [0, pi/2], phi_d in [0, pi). By reciprocity, phi_d and phi_d +
// pi give the same value.
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
