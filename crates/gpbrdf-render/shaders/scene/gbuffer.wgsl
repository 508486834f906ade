// Position and normal of the surface in each pixel: rasterised triangles, or the unit sphere hit by a ray.
// Needs shared/view.wgsl.

@group(0) @binding(0) var<uniform> view: View;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
}

// Bits of floats, because not every device renders to 32-bit floats.
struct Texels {
    @location(0) position: vec4u,
    // The fourth component is 1.0 where a surface is, else 0.
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

// At the outline of a mesh, interpolated normals may point away from the viewer; they are turned to this
// cosine.
const LEAST_COSINE: f32 = 0.02;

@fragment
fn mesh_texels(corner: Corner) -> Texels {
    let position = corner.position;
    // The normal of the triangle, towards the viewer whatever the order of its corners: surfaces have two
    // sides.
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
    // One triangle that covers the frame.
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn sphere_texels(@builtin(position) pixel: vec4f) -> Texels {
    let at = place_in_frame(view, pixel.xy) - view.jitter;
    let across = at.x * view.right.xyz + at.y * view.up.xyz;
    var origin = view.eye.xyz;
    var along = view.forward.xyz;
    if view.eye.w > 0.0 {
        along = normalize(along + across);
    } else {
        origin += across;
    }
    // From the ray's nearest point to the centre, which avoids cancellation when the eye is far away.
    let nearest = origin - dot(origin, along) * along;
    let square = 1.0 - dot(nearest, nearest);
    if square <= 0.0 {
        discard;
    }
    let normal = normalize(nearest - sqrt(square) * along);
    return texels(normal, normal);
}
