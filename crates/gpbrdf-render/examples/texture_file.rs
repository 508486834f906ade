//! A texture file in a wgpu program of one's own:
//!
//! ```sh
//! gpbrdf-cli bake satin.bsdf --texture satin.dds
//! cargo run --release -p gpbrdf-render --example texture_file -- satin.dds sphere.png
//! ```
//!
//! The program reads a `.dds` or `.ktx2` file, uploads it as it is, and draws a sphere under a distant light into a
//! picture. Of this project it uses the text of a shader only, [`LOOKUP_WGSL`]. Everything else is what a renderer has
//! already.
#![expect(clippy::print_stdout, reason = "an example reports to a terminal")]

use std::path::Path;

use gpbrdf_render::LOOKUP_WGSL;

type Result<T = (), E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

/// Width and height of the picture, pixels; its rows are a multiple of 256 bytes long, as copies require.
const SIDE: u32 = 512;

/// One triangle covers the picture, and each pixel looks for the sphere of radius 1 in it. The viewer is far away along
/// +z, the light along `LIGHT`; the irradiance is 3.
const SHADER: &str = "
@group(0) @binding(0) var table: texture_3d<f32>;
@group(0) @binding(1) var filtering: sampler;

const LIGHT: vec3f = vec3f(-0.5, 0.6, 0.62);

@vertex
fn corner(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn sphere(@builtin(position) pixel: vec4f) -> @location(0) vec4f {
    let p = 1.05 * (pixel.xy / 256.0 - 1.0) * vec2f(1.0, -1.0);
    let square = dot(p, p);
    if square >= 1.0 {
        return vec4f(0.02, 0.02, 0.02, 1.0);
    }
    let normal = vec3f(p, sqrt(1.0 - square));
    // The local frame of the surface: its normal is +z.
    let up = select(vec3f(0.0, 1.0, 0.0), vec3f(1.0, 0.0, 0.0), abs(normal.y) > 0.9);
    let tangent = normalize(cross(up, normal));
    let frame = mat3x3f(tangent, cross(normal, tangent), normal);
    let wi = normalize(LIGHT) * frame;
    let wo = vec3f(0.0, 0.0, 1.0) * frame;
    let f = gpbrdf_lookup(table, filtering, wi, wo);
    return vec4f(f.rgb * max(wi.z, 0.0) * 3.0, 1.0);
}
";

fn main() -> Result {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [from, to] = &arguments[..] else {
        return Err(format!(
            "expected a .dds or .ktx2 file and the name of a picture, found {} arguments",
            arguments.len()
        )
        .into());
    };
    let texels = texels(Path::new(from)).map_err(|e| format!("\"{from}\": {e}"))?;
    let pixels = draw(&texels)?;
    image::save_buffer(to, &pixels, SIDE, SIDE, image::ColorType::Rgba8)?;
    let brightest = pixels.iter().max().copied().unwrap_or(0);
    println!("\"{to}\": {SIDE} x {SIDE} pixels, the brightest is {brightest} of 255");
    Ok(())
}

/// Width, height, depth and bytes of a texture of four halves a texel.
struct Texels {
    size: wgpu::Extent3d,
    bytes: Vec<u8>,
}

fn texels(path: &Path) -> Result<Texels> {
    let file = std::fs::read(path)?;
    let (size, bytes) = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ktx2")) {
        let reader = ktx2::Reader::new(&file).map_err(|e| format!("expected a KTX2 file, found {e:?}"))?;
        let header = reader.header();
        if header.format != Some(ktx2::Format::R16G16B16A16_SFLOAT) {
            return Err(format!("expected R16G16B16A16_SFLOAT, found {:?}", header.format).into());
        }
        let level = reader.levels().next().ok_or("expected a level, found none")?;
        ([header.pixel_width, header.pixel_height, header.pixel_depth], level.data.to_vec())
    } else {
        let dds = ddsfile::Dds::read(&file[..])?;
        let format = dds.get_dxgi_format();
        if format != Some(ddsfile::DxgiFormat::R16G16B16A16_Float) {
            return Err(format!("expected R16G16B16A16_FLOAT, found {format:?}").into());
        }
        ([dds.get_width(), dds.get_height(), dds.get_depth()], dds.data)
    };
    let [width, height, depth] = size;
    let expected = 8 * u64::from(width) * u64::from(height) * u64::from(depth);
    if depth < 2 || bytes.len() as u64 != expected {
        return Err(format!("expected a 3-D texture of {expected} bytes, found {}", bytes.len()).into());
    }
    Ok(Texels { size: wgpu::Extent3d { width, height, depth_or_array_layers: depth }, bytes })
}

/// The picture, rows from top to bottom, sRGB.
fn draw(texels: &Texels) -> Result<Vec<u8>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;
    println!("on {}", adapter.get_info().name);

    let table = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("BRDF"),
        size: texels.size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D3,
        format: wgpu::TextureFormat::Rgba16Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(8 * texels.size.width),
        rows_per_image: Some(texels.size.height),
    };
    queue.write_texture(table.as_image_copy(), &texels.bytes, layout, texels.size);
    let filtering = device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("BRDF"),
        address_mode_u: wgpu::AddressMode::ClampToEdge,
        address_mode_v: wgpu::AddressMode::ClampToEdge,
        address_mode_w: wgpu::AddressMode::Repeat,
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    });

    let format = wgpu::TextureFormat::Rgba8UnormSrgb;
    let pipeline = pipeline(&device, format);
    let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(&table.create_view(&Default::default())),
            },
            wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&filtering) },
        ],
    });

    let size = wgpu::Extent3d { width: SIDE, height: SIDE, depth_or_array_layers: 1 };
    let picture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let read = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("picture"),
        size: u64::from(4 * SIDE * SIDE),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    let view = picture.create_view(&Default::default());
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: None,
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                store: wgpu::StoreOp::Store,
            },
        })],
        ..Default::default()
    });
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &bindings, &[]);
    pass.draw(0..3, 0..1);
    drop(pass);
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * SIDE), rows_per_image: None };
    let into = wgpu::TexelCopyBufferInfo { buffer: &read, layout };
    encoder.copy_texture_to_buffer(picture.as_image_copy(), into, size);
    queue.submit([encoder.finish()]);

    let (send, receive) = std::sync::mpsc::channel();
    read.slice(..).map_async(wgpu::MapMode::Read, move |result| {
        // The receiver waits below.
        let _ = send.send(result);
    });
    device.poll(wgpu::PollType::wait_indefinitely())?;
    receive.recv()??;
    Ok(read.slice(..).get_mapped_range()?.to_vec())
}

fn pipeline(device: &wgpu::Device, format: wgpu::TextureFormat) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("sphere"),
        source: wgpu::ShaderSource::Wgsl(format!("{LOOKUP_WGSL}{SHADER}").into()),
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("sphere"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("corner"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: None,
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("sphere"),
            compilation_options: Default::default(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
