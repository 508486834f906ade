// Points for quasi-Monte Carlo integration.

// The permutation pcg of M. Jarzynski and M. Olano, "Hash Functions for GPU Rendering" (2020).
fn hash(value: u32) -> u32 {
    let state = value * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Point `index` of an additive recurrence in [0, 1)^2, in fixed point. The steps are the reciprocals of the
// plastic number and of its square (M. Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences",
// 2018). Each pixel and each `stream` moves the sequence by its own random vector.
fn low_discrepancy(pixel: vec2u, stream: u32, index: u32) -> vec2f {
    let seed = hash(pixel.x + hash(pixel.y + hash(stream)));
    let x = seed + index * 3242174889u;
    let y = hash(seed) + index * 2447445414u;
    return vec2f(f32(x >> 8u), f32(y >> 8u)) * (1.0 / 16777216.0);
}
