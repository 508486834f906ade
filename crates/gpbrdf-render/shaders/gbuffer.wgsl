// Position and normal of what every pixel shows: rasterised triangles, or the unit sphere met by a ray.

struct View {
    clip_from_world: mat4x4f,
    // 1 in the fourth component for rays out of the eye, 0 for parallel ones.
    eye: vec4f,
    // Half of the frame: in units of the world, or at distance 1 from the eye.
    right: vec4f,
    up: vec4f,
    forward: vec4f,
    size: vec2f,
    // How far the picture moves, in clip space.
    jitter: vec2f,
}

@group(0) @binding(0) var<uniform> view: View;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
}

// Bits of floats: integers are a colour on every device, 32-bit floats are not.
struct Texels {
    @location(0) position: vec4u,
    // The fourth component is 1.0 where there is something.
    @location(1) normal: vec4u,
}

fn texels(position: vec3f, normal: vec3f) -> Texels {
    return Texels(bitcast<vec4u>(vec4f(position, 1.0)), bitcast<vec4u>(vec4f(normal, 1.0)));
}

@vertex
fn mesh_corner(@location(0) position: vec3f, @location(1) normal: vec3f) -> Corner {
    var corner: Corner;
    corner.clip = view.clip_from_world * vec4f(position, 1.0);
    corner.clip = vec4f(corner.clip.xy + view.jitter * corner.clip.w, corner.clip.zw);
    corner.position = position;
    corner.normal = normal;
    return corner;
}

// Interpolated normals that point away from the viewer at the outline of a mesh are turned to this cosine.
const LEAST_COSINE: f32 = 0.02;

@fragment
fn mesh_texels(corner: Corner) -> Texels {
    let position = corner.position;
    // The normal of the triangle, facing the viewer, whatever the order of its corners: surfaces have two sides.
    var flat_normal = cross(dpdx(position), dpdy(position));
    var to_viewer = -view.forward.xyz;
    if view.eye.w > 0.0 {
        to_viewer = normalize(view.eye.xyz - position);
    }
    if dot(flat_normal, to_viewer) < 0.0 {
        flat_normal = -flat_normal;
    }
    let size = length(corner.normal);
    var normal = select(to_viewer, corner.normal / size, size > 1e-6);
    if dot(normal, flat_normal) < 0.0 {
        normal = -normal;
    }
    let cosine = dot(normal, to_viewer);
    if cosine < LEAST_COSINE {
        normal = normalize(normal + (LEAST_COSINE - cosine) * to_viewer);
    }
    return texels(position, normal);
}

@vertex
fn whole_frame(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    // One triangle over the frame.
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn sphere_texels(@builtin(position) pixel: vec4f) -> Texels {
    let at = vec2f(2.0, -2.0) * pixel.xy / view.size + vec2f(-1.0, 1.0) - view.jitter;
    let across = at.x * view.right.xyz + at.y * view.up.xyz;
    var origin = view.eye.xyz;
    var along = view.forward.xyz;
    if view.eye.w > 0.0 {
        along = normalize(along + across);
    } else {
        origin += across;
    }
    // The ray's nearest point to the centre: no cancellation where the eye is far away.
    let nearest = origin - dot(origin, along) * along;
    let square = 1.0 - dot(nearest, nearest);
    if square <= 0.0 {
        discard;
    }
    let normal = normalize(nearest - sqrt(square) * along);
    return texels(normal, normal);
}
