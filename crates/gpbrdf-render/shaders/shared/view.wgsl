// A camera and the picture it takes.

struct View {
    clip_from_world: mat4x4f,
    // 1 in the fourth component for rays out of the eye, 0 for parallel ones.
    eye: vec4f,
    // Half of the frame: in units of the world, or at distance 1 from the eye.
    right: vec4f,
    up: vec4f,
    forward: vec4f,
    // Columns and rows of the picture.
    size: vec2f,
    // How far the picture is moved, in clip space.
    jitter: vec2f,
}

// The place of a pixel in the frame, in [-1, 1]: x to the right, y up. Centres of pixels have a half as
// fraction.
fn place_in_frame(view: View, pixel: vec2f) -> vec2f {
    return vec2f(2.0, -2.0) * pixel / view.size + vec2f(-1.0, 1.0);
}
