// Rings of half vectors about the normal, by which directions are drawn. Needs shared/angles.wgsl.
//
// Each cell of a table along theta_h is a ring. Each bin of view angles has its own distribution over the
// rings: RINGS + 1 running shares from 0 to 1.

// Bins of view angles from 0 to pi/2.
const VIEW_BINS: u32 = 64u;
// Rings of half vectors: the cells of a table along theta_h.
const RINGS: u32 = 90u;

// Where the running shares of a bin of view angles begin.
fn first_share_of(view_bin: u32) -> u32 {
    return view_bin * (RINGS + 1u);
}

// The bin of a view angle in radians.
fn view_bin_of(theta_o: f32) -> u32 {
    let bin = u32(max(theta_o * (2.0 / GPBRDF_PI) * f32(VIEW_BINS), 0.0));
    return min(bin, VIEW_BINS - 1u);
}

// The view angle in the middle of a bin, in radians.
fn theta_o_of(view_bin: u32) -> f32 {
    return (f32(view_bin) + 0.5) / f32(VIEW_BINS) * 0.5 * GPBRDF_PI;
}

// The ring of an angle theta_h in radians.
fn ring_of(theta_h: f32) -> u32 {
    return min(u32(sqrt(theta_h * (2.0 / GPBRDF_PI)) * f32(RINGS)), RINGS - 1u);
}

// The half vector with s = sin^2(theta_h / 2), in which rings are even, and the azimuth of a unit vector.
fn half_vector_at(s: f32, azimuth: vec2f) -> vec3f {
    return vec3f(2.0 * sqrt(s * (1.0 - s)) * azimuth, 1.0 - 2.0 * s);
}

// The mirror image of a direction about a half vector.
fn mirrored(w: vec3f, h: vec3f) -> vec3f {
    return 2.0 * dot(w, h) * h - w;
}
