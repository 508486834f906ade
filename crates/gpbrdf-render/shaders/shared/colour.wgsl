// Luminance of linear sRGB (ITU-R BT.709).

const LUMINANCE_WEIGHTS: vec3f = vec3f(0.2126, 0.7152, 0.0722);

fn luminance(rgb: vec3f) -> f32 {
    return dot(rgb, LUMINANCE_WEIGHTS);
}
