// Running sums to a picture for the eye. Comes after lookup.wgsl.

struct View {
    clip_from_world: mat4x4f,
    eye: vec4f,
    right: vec4f,
    up: vec4f,
    forward: vec4f,
    size: vec2f,
    jitter: vec2f,
}

struct Display {
    size: vec2u,
    environment_size: vec2u,
    show: u32,
    tone: u32,
    encoding: u32,
    background: u32,
    samples: f32,
    // Factor of the radiance.
    exposure: f32,
    // End of the scale of sigma or of the difference.
    limit: f32,
    // The column, as a share of the width, where the prediction begins.
    split: f32,
}

const SHOW_TRUTH: u32 = 0u;
const SHOW_PREDICTION: u32 = 1u;
const SHOW_SIGMA: u32 = 2u;
const SHOW_DIFFERENCE: u32 = 3u;
const SHOW_SPLIT: u32 = 4u;

const TONE_CLIP: u32 = 0u;
const TONE_REINHARD: u32 = 1u;
const TONE_FILMIC: u32 = 2u;

const GAMMA_22: u32 = 0u;

const BACKGROUND_ENVIRONMENT: u32 = 0u;
const BACKGROUND_BLACK: u32 = 1u;
const BACKGROUND_TRANSPARENT: u32 = 2u;

// What surrounds objects that are shown in false colours, encoded.
const NEUTRAL: vec3f = vec3f(0.1333, 0.1333, 0.149);

@group(0) @binding(0) var<uniform> display: Display;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> sums: array<vec4f>;
@group(0) @binding(3) var environment: texture_2d<f32>;
// Rows: for magnitudes, for signed differences.
@group(0) @binding(4) var colours: texture_2d<f32>;
@group(0) @binding(5) var picture: texture_storage_2d<rgba8unorm, write>;

fn luminance(rgb: vec3f) -> f32 {
    return dot(rgb, vec3f(0.2126, 0.7152, 0.0722));
}

// Radiance to what a screen shows, linear, in [0, 1].
fn tone_mapped(radiance: vec3f) -> vec3f {
    let x = max(radiance * display.exposure, vec3f(0.0));
    if display.tone == TONE_REINHARD {
        // E. Reinhard et al., "Photographic Tone Reproduction for Digital Images" (2002), eq. 4, on luminance, white at 4.
        let l = luminance(x);
        return clamp(x * (1.0 + l / 16.0) / (1.0 + l), vec3f(0.0), vec3f(1.0));
    }
    if display.tone == TONE_FILMIC {
        // K. Narkowicz's fit (2015) to the curve of the Academy Color Encoding System, scaled to keep middle grey.
        let y = min(0.8 * x, vec3f(1e4));
        return clamp(y * (2.51 * y + 0.03) / (y * (2.43 * y + 0.59) + 0.14), vec3f(0.0), vec3f(1.0));
    }
    return clamp(x, vec3f(0.0), vec3f(1.0));
}

fn encoded(linear: vec3f) -> vec3f {
    if display.encoding == GAMMA_22 {
        return pow(linear, vec3f(1.0 / 2.2));
    }
    let curve = 1.055 * pow(linear, vec3f(1.0 / 2.4)) - 0.055;
    return select(curve, 12.92 * linear, linear <= vec3f(0.0031308));
}

// The map in the direction of a pixel, filtered.
fn background_radiance(pixel: vec2u) -> vec3f {
    let at = vec2f(2.0, -2.0) * (vec2f(pixel) + 0.5) / view.size + vec2f(-1.0, 1.0);
    // Parallel rays see one point only; they get the background of an angle of view of 30 degrees.
    var across = 0.268 * (at.x * normalize(view.right.xyz) * max(view.size.x / view.size.y, 1.0)
        + at.y * normalize(view.up.xyz) * max(view.size.y / view.size.x, 1.0));
    if view.eye.w > 0.0 {
        across = at.x * view.right.xyz + at.y * view.up.xyz;
    }
    let w = normalize(view.forward.xyz + across);
    let u = gpbrdf_atan2(w.x, -w.z) / (2.0 * GPBRDF_PI) + 0.5;
    let v = gpbrdf_atan2(length(w.xz), w.y) / GPBRDF_PI;
    let size = vec2i(display.environment_size);
    let position = vec2f(u, v) * vec2f(size) - 0.5;
    let corner = vec2i(floor(position));
    let upper = position - floor(position);
    let x = (vec2i(corner.x, corner.x + 1) + size.x) % size.x;
    let y = clamp(vec2i(corner.y, corner.y + 1), vec2i(0), vec2i(size.y - 1));
    let low = mix(textureLoad(environment, vec2i(x.x, y.x), 0), textureLoad(environment, vec2i(x.y, y.x), 0), upper.x);
    let high = mix(textureLoad(environment, vec2i(x.x, y.y), 0), textureLoad(environment, vec2i(x.y, y.y), 0), upper.x);
    return mix(low, high, upper.y).rgb;
}

fn colour(row: i32, t: f32) -> vec3f {
    return textureLoad(colours, vec2i(i32(clamp(t, 0.0, 1.0) * 255.0 + 0.5), row), 0).rgb;
}

@compute @workgroup_size(8, 8)
fn display_pixels(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= display.size.x || id.y >= display.size.y {
        return;
    }
    let at = 2u * (id.y * display.size.x + id.x);
    let truth = sums[at];
    let prediction = sums[at + 1u];
    let hits = truth.w;
    let coverage = clamp(hits / max(display.samples, 1.0), 0.0, 1.0);
    let share = 1.0 / max(hits, 1.0);
    var shown: vec3f;
    if display.show == SHOW_SIGMA || display.show == SHOW_DIFFERENCE {
        var inside = colour(0, 0.0);
        let light = luminance(prediction.rgb);
        if display.show == SHOW_SIGMA {
            if light > 0.0 {
                inside = colour(0, prediction.w / light / display.limit);
            }
        } else {
            // 1 - b / a of the means over red, green and blue.
            let a = truth.r + truth.g + truth.b;
            let b = prediction.r + prediction.g + prediction.b;
            let difference = select(0.0, 1.0 - b / a, a > 0.0);
            inside = colour(1, 0.5 + 0.5 * difference / display.limit);
        }
        let around = select(NEUTRAL, inside, display.background == BACKGROUND_TRANSPARENT);
        shown = mix(around, inside, coverage);
    } else {
        let right_of_split = (f32(id.x) + 0.5) >= display.split * f32(display.size.x);
        let predicted = display.show == SHOW_PREDICTION || (display.show == SHOW_SPLIT && right_of_split);
        let inside = tone_mapped(share * select(truth.rgb, prediction.rgb, predicted));
        var around = vec3f(0.0);
        if display.background == BACKGROUND_ENVIRONMENT {
            around = tone_mapped(background_radiance(id.xy));
        } else if display.background == BACKGROUND_TRANSPARENT {
            around = inside;
        }
        shown = encoded(mix(around, inside, coverage));
    }
    // Colours that are not finite show as magenta: an error to be seen.
    if !all(abs(shown) <= vec3f(1.0)) {
        shown = vec3f(1.0, 0.0, 1.0);
    }
    let alpha = select(1.0, coverage, display.background == BACKGROUND_TRANSPARENT);
    textureStore(picture, id.xy, vec4f(shown, alpha));
}
