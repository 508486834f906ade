// For every view angle, how the light that two materials reflect is spread over theta_h: the distribution that half vectors
// are drawn from. Comes after lookup.wgsl and a function `material`.
//
// With wo fixed, dw_i = 4 (wo . h) dw_h, so under uniform light the ring of half vectors between theta_h and theta_h' gives
// the integral of f(wi, wo) cos theta_i 4 (wo . h) over the ring.

const VIEW_BINS: u32 = 64u;
const RINGS: u32 = 90u;

@group(0) @binding(0) var truth: texture_3d<f32>;
@group(0) @binding(1) var prediction: texture_3d<f32>;
// sin^2(theta_h / 2) at the edges of the rings, which are the cells of the table.
@group(0) @binding(2) var<storage, read> edges: array<f32>;
// For every view angle RINGS + 1 running shares from 0 to 1.
@group(0) @binding(3) var<storage, read_write> shares: array<f32>;
//SAMPLER @group(0) @binding(4) var material_sampler: sampler;

var<workgroup> weights: array<f32, RINGS>;

fn ring_weight(view_bin: u32, ring: u32) -> f32 {
    let theta_o = (f32(view_bin) + 0.5) / f32(VIEW_BINS) * 0.5 * GPBRDF_PI;
    let wo = vec3f(sin(theta_o), 0.0, cos(theta_o));
    let low = edges[ring];
    let high = edges[ring + 1u];
    var sum = 0.0;
    for (var i = 0u; i < 3u; i++) {
        let s = mix(low, high, (f32(i) + 0.5) / 3.0);
        let sine = 2.0 * sqrt(s * (1.0 - s));
        for (var j = 0u; j < 16u; j++) {
            let azimuth = (f32(j) + 0.5) / 16.0 * GPBRDF_PI;
            let h = vec3f(sine * cos(azimuth), sine * sin(azimuth), 1.0 - 2.0 * s);
            let cosine = dot(wo, h);
            let wi = 2.0 * cosine * h - wo;
            if cosine > 0.0 && wi.z > 0.0 {
                let f = material(truth, wi, wo).rgb + material(prediction, wi, wo).rgb;
                sum += max(dot(f, vec3f(0.2126, 0.7152, 0.0722)), 0.0) * wi.z * cosine;
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
        let first = group.x * (RINGS + 1u);
        var sum = 0.0;
        shares[first] = 0.0;
        for (var i = 0u; i < RINGS; i++) {
            sum += weights[i];
            let even = f32(i + 1u) / f32(RINGS);
            // A black material is drawn from evenly.
            shares[first + i + 1u] = select(even, min(sum / total, 1.0), total > 0.0);
        }
        shares[first + RINGS] = 1.0;
    }
}
