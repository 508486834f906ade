// The picture for the eye, made from running sums.
// Needs shared/angles.wgsl, view.wgsl, colour.wgsl, environment.wgsl and sums.wgsl.

struct Display {
    size: vec2u,
    environment_size: vec2u,
    // One of SHOW_*, TONE_*, ENCODING_* and BACKGROUND_*.
    show: u32,
    tone: u32,
    encoding: u32,
    background: u32,
    // Samples in the sums of each pixel.
    samples: f32,
    // Factor of the radiance.
    exposure: f32,
    // End of the colour scale of sigma or of the difference.
    limit: f32,
    // SHOW_SPLIT: the column where the prediction begins, as a share of the width.
    split: f32,
    // Texels along each side of the ground; 0 where there is none.
    ground_size: u32,
    // Half of a side of the ground, and its height.
    ground_half: f32,
    ground_height: f32,
    // Behind the ground the map is mirrored at the horizon up to this height of a unit direction; 0 where it is shown
    // as it is.
    horizon: f32,
}

const SHOW_TRUTH: u32 = 0u;
const SHOW_PREDICTION: u32 = 1u;
const SHOW_SIGMA: u32 = 2u;
const SHOW_DIFFERENCE: u32 = 3u;
const SHOW_SPLIT: u32 = 4u;

const TONE_CLIP: u32 = 0u;
const TONE_REINHARD: u32 = 1u;
const TONE_FILMIC: u32 = 2u;

const ENCODING_GAMMA_22: u32 = 0u;
const ENCODING_SRGB: u32 = 1u;

const BACKGROUND_ENVIRONMENT: u32 = 0u;
const BACKGROUND_BLACK: u32 = 1u;
const BACKGROUND_TRANSPARENT: u32 = 2u;

// The rows of `colours`.
const COLOURS_SEQUENTIAL: i32 = 0;
const COLOURS_DIVERGING: i32 = 1;

// The colour around objects in false colours, encoded.
const NEUTRAL: vec3f = vec3f(0.1333, 0.1333, 0.149);

@group(0) @binding(0) var<uniform> display: Display;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> sums: array<PixelSums>;
@group(0) @binding(3) var environment: texture_2d<f32>;
// 256 colours of each of two maps.
@group(0) @binding(4) var colours: texture_2d<f32>;
// Radiance of the ground: rows along z, columns along x.
@group(0) @binding(6) var<storage, read> ground: array<vec4f>;
@group(0) @binding(5) var picture: texture_storage_2d<rgba8unorm, write>;

// The linear brightness of a screen, in [0, 1], that stands for a radiance.
fn tone_mapped(radiance: vec3f) -> vec3f {
    let x = max(radiance * display.exposure, vec3f(0.0));
    if display.tone == TONE_REINHARD {
        // E. Reinhard et al., "Photographic Tone Reproduction for Digital Images" (2002), eq. 4, applied to
        // the luminance, with white at 4.
        let l = luminance(x);
        return clamp(x * (1.0 + l / 16.0) / (1.0 + l), vec3f(0.0), vec3f(1.0));
    }
    if display.tone == TONE_FILMIC {
        // The fit of K. Narkowicz (2015) to the curve of the Academy Color Encoding System, scaled to keep
        // middle grey.
        let y = min(0.8 * x, vec3f(1e4));
        return clamp(y * (2.51 * y + 0.03) / (y * (2.43 * y + 0.59) + 0.14), vec3f(0.0), vec3f(1.0));
    }
    return clamp(x, vec3f(0.0), vec3f(1.0));
}

fn encoded(linear: vec3f) -> vec3f {
    if display.encoding == ENCODING_GAMMA_22 {
        return pow(linear, vec3f(1.0 / 2.2));
    }
    let curve = 1.055 * pow(linear, vec3f(1.0 / 2.4)) - 0.055;
    return select(curve, 12.92 * linear, linear <= vec3f(0.0031308));
}

// The radiance behind objects in the direction of a pixel: that of the ground, or of the map.
fn background_radiance(pixel: vec2u) -> vec3f {
    let at = place_in_frame(view, vec2f(pixel) + 0.5);
    // Parallel rays all see the same point of the map. They get the background of an angle of view of 30
    // degrees.
    var across = 0.268 * (at.x * normalize(view.right.xyz) * max(view.size.x / view.size.y, 1.0)
        + at.y * normalize(view.up.xyz) * max(view.size.y / view.size.x, 1.0));
    if view.eye.w > 0.0 {
        across = at.x * view.right.xyz + at.y * view.up.xyz;
    }
    let w = normalize(view.forward.xyz + across);
    if display.ground_size == 0u || view.eye.w == 0.0 || view.eye.y <= display.ground_height || w.y >= -1e-4 {
        return map_radiance(w);
    }
    let behind = map_radiance(select(w, normalize(vec3f(w.x, min(-w.y, display.horizon), w.z)), display.horizon > 0.0));
    let met = view.eye.xyz + (display.ground_height - view.eye.y) / w.y * w;
    let distance = length(met.xz) / display.ground_half;
    let fade = smoothstep(0.25, 1.0, distance);
    if fade >= 1.0 {
        return behind;
    }
    return mix(ground_radiance(met.xz), behind, fade);
}

// The radiance of the ground at x and z, interpolated linearly.
fn ground_radiance(at: vec2f) -> vec3f {
    let last = i32(display.ground_size) - 1;
    let place = (0.5 * at / display.ground_half + 0.5) * f32(display.ground_size) - 0.5;
    let low = clamp(vec2i(floor(place)), vec2i(0), vec2i(last));
    let high = min(low + 1, vec2i(last));
    let upper = clamp(place - vec2f(low), vec2f(0.0), vec2f(1.0));
    let near = mix(ground_texel(low.x, low.y), ground_texel(high.x, low.y), upper.x);
    let far = mix(ground_texel(low.x, high.y), ground_texel(high.x, high.y), upper.x);
    return mix(near, far, upper.y);
}

fn ground_texel(x: i32, z: i32) -> vec3f {
    return ground[u32(z) * display.ground_size + u32(x)].rgb;
}

// The radiance of the map in a direction, interpolated linearly.
fn map_radiance(w: vec3f) -> vec3f {
    let size = vec2i(display.environment_size);
    let position = environment_coordinates(w) * vec2f(size) - 0.5;
    let corner = vec2i(floor(position));
    let upper = position - floor(position);
    let x = (vec2i(corner.x, corner.x + 1) + size.x) % size.x;
    let y = clamp(vec2i(corner.y, corner.y + 1), vec2i(0), vec2i(size.y - 1));
    let low = mix(map_texel(x.x, y.x), map_texel(x.y, y.x), upper.x);
    let high = mix(map_texel(x.x, y.y), map_texel(x.y, y.y), upper.x);
    return mix(low, high, upper.y);
}

fn map_texel(x: i32, y: i32) -> vec3f {
    return textureLoad(environment, vec2i(x, y), 0).rgb;
}

// The colour of `t` in [0, 1] in one of the COLOURS_*.
fn false_colour(row: i32, t: f32) -> vec3f {
    return textureLoad(colours, vec2i(i32(clamp(t, 0.0, 1.0) * 255.0 + 0.5), row), 0).rgb;
}

// Sigma of the target, averaged over the samples with their luminance as weight, from 0 to `limit`.
fn sigma_colour(sum: PixelSums) -> vec3f {
    let light = luminance(sum.prediction);
    let sigma = select(0.0, sum.weighted_sigma / light, light > 0.0);
    return false_colour(COLOURS_SEQUENTIAL, sigma / display.limit);
}

// exposure (prediction - truth), linear, mean of the channels, from `-limit` to `limit`: red where the
// prediction is too bright. `share` is the reciprocal of the number of samples.
fn difference_colour(sum: PixelSums, share: f32) -> vec3f {
    let gap = share * (sum.prediction - sum.truth);
    let difference = display.exposure * (gap.r + gap.g + gap.b) / 3.0;
    return false_colour(COLOURS_DIVERGING, 0.5 + 0.5 * difference / display.limit);
}

@compute @workgroup_size(8, 8)
fn display_pixels(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= display.size.x || id.y >= display.size.y {
        return;
    }
    let sum = sums[id.y * display.size.x + id.x];
    let coverage = clamp(sum.hits / max(display.samples, 1.0), 0.0, 1.0);
    let share = 1.0 / max(sum.hits, 1.0);
    var shown: vec3f;
    if display.show == SHOW_SIGMA || display.show == SHOW_DIFFERENCE {
        var inside = sigma_colour(sum);
        if display.show == SHOW_DIFFERENCE {
            inside = difference_colour(sum, share);
        }
        let around = select(NEUTRAL, inside, display.background == BACKGROUND_TRANSPARENT);
        shown = mix(around, inside, coverage);
    } else {
        let right_of_split = (f32(id.x) + 0.5) >= display.split * f32(display.size.x);
        let predicted = display.show == SHOW_PREDICTION || (display.show == SHOW_SPLIT && right_of_split);
        let inside = tone_mapped(share * select(sum.truth, sum.prediction, predicted));
        var around = vec3f(0.0);
        if display.background == BACKGROUND_ENVIRONMENT {
            around = tone_mapped(background_radiance(id.xy));
        } else if display.background == BACKGROUND_TRANSPARENT {
            around = inside;
        }
        shown = encoded(mix(around, inside, coverage));
    }
    // Magenta makes colours that are not finite visible: they are an error.
    if !all(abs(shown) <= vec3f(1.0)) {
        shown = vec3f(1.0, 0.0, 1.0);
    }
    let alpha = select(1.0, coverage, display.background == BACKGROUND_TRANSPARENT);
    textureStore(picture, id.xy, vec4f(shown, alpha));
}
