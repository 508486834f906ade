// The distribution that half vectors are drawn from: for each bin of view angles, the running shares of the
// light that two materials together reflect by each ring of half vectors. Needs shared/angles.wgsl,
// table.wgsl, rings.wgsl, colour.wgsl and one of material_exact.wgsl and material_filtered.wgsl.
//
// With wo fixed, dw_i = 4 (wo . h) dw_h. Under uniform light, the half vectors of a ring therefore reflect
// the integral of f(wi, wo) cos theta_i 4 (wo . h) over the solid angle of the ring.

@group(0) @binding(0) var truth: texture_3d<f32>;
@group(0) @binding(1) var prediction: texture_3d<f32>;
// sin^2(theta_h / 2) at the edges of the rings.
@group(0) @binding(2) var<storage, read> edges: array<f32>;
// [view bin][RINGS + 1] running shares.
@group(0) @binding(3) var<storage, read_write> shares: array<f32>;

var<workgroup> weights: array<f32, RINGS>;

fn ring_weight(view_bin: u32, ring: u32) -> f32 {
    let theta_o = theta_o_of(view_bin);
    let wo = vec3f(sin(theta_o), 0.0, cos(theta_o));
    let low = edges[ring];
    let high = edges[ring + 1u];
    var sum = 0.0;
    for (var i = 0u; i < 3u; i++) {
        let s = mix(low, high, (f32(i) + 0.5) / 3.0);
        for (var j = 0u; j < 16u; j++) {
            let azimuth = (f32(j) + 0.5) / 16.0 * GPBRDF_PI;
            let h = half_vector_at(s, vec2f(cos(azimuth), sin(azimuth)));
            let cosine = dot(wo, h);
            let wi = mirrored(wo, h);
            if cosine > 0.0 && wi.z > 0.0 {
                let f = material(truth, wi, wo).rgb + material(prediction, wi, wo).rgb;
                sum += max(luminance(f), 0.0) * wi.z * cosine;
            }
        }
    }
    return sum * (high - low);
}

@compute @workgroup_size(96)
fn half_vector_shares(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) ring: u32) {
    if ring < RINGS {
        weights[ring] = ring_weight(group.x, ring);
    }
    workgroupBarrier();
    if ring == 0u {
        var total = 0.0;
        for (var i = 0u; i < RINGS; i++) {
            total += weights[i];
        }
        let first = first_share_of(group.x);
        var sum = 0.0;
        shares[first] = 0.0;
        for (var i = 0u; i < RINGS; i++) {
            sum += weights[i];
            let even = f32(i + 1u) / f32(RINGS);
            // The rings of a black material have equal shares.
            shares[first + i + 1u] = select(even, min(sum / total, 1.0), total > 0.0);
        }
        shares[first + RINGS] = 1.0;
    }
}
