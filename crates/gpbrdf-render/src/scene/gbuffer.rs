//! Position and normal of the surface in every pixel.

use super::camera::{Camera, Projection};
use super::mesh::Mesh;
use crate::context::Context;
use crate::error::{Error, Result};
use crate::gpu_types::{Vertex, View};
use crate::shader;

/// The bits of 32-bit floats, because not every device renders to floats. Both textures together take 32
/// bytes per pixel, as many as every device supports in one pass.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
const WHAT: &str = "G-buffer";

/// The object of a scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// The unit sphere about the origin, exact at every pixel.
    Sphere,
    /// A mesh in the unit sphere ([`Mesh::fitted`]). Parts outside of the unit sphere may be cut off.
    Mesh(Mesh),
}

/// Position and normal of the surface in every pixel of a picture, rows from top to bottom.
#[derive(Clone, Debug)]
pub struct GBuffer {
    size: [u32; 2],
    position: wgpu::Texture,
    normal: wgpu::Texture,
    views: [wgpu::TextureView; 3],
}

/// One pixel of a [`GBuffer`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceTexel {
    /// Position in the world.
    pub position: [f32; 3],
    /// Unit normal that faces the viewer; all zero where no surface is.
    pub normal: [f32; 3],
    /// Whether a surface is there.
    pub hit: bool,
}

impl GBuffer {
    /// A G-buffer without surfaces.
    ///
    /// # Errors
    /// [`Error::Limit`] when a side is 0 or longer than the device supports, and those of [`Context::guard`].
    pub fn new(context: &Context, size: [u32; 2]) -> Result<Self> {
        let most = context.device().limits().max_texture_dimension_2d;
        if size.iter().any(|&side| side == 0 || side > most) {
            return Err(Error::Limit {
                what: "picture",
                expected: format!("sides of 1 to {most} pixels"),
                found: format!("{} x {}", size[0], size[1]),
            });
        }
        let texture = |label, format, usage| {
            context.device().create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let read = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let [position, normal, depth] = context.guard(WHAT, || {
            [
                texture("position", FORMAT, read),
                texture("normal", FORMAT, read),
                texture("depth", DEPTH, wgpu::TextureUsages::empty()),
            ]
        })?;
        let view = |t: &wgpu::Texture| t.create_view(&wgpu::TextureViewDescriptor::default());
        let views = [view(&position), view(&normal), view(&depth)];
        Ok(Self { size, position, normal, views })
    }

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    pub(crate) fn position_view(&self) -> &wgpu::TextureView {
        &self.views[0]
    }

    pub(crate) fn normal_view(&self) -> &wgpu::TextureView {
        &self.views[1]
    }

    /// All pixels, rows from top to bottom. Waits for the device.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    pub fn download(&self, context: &Context) -> Result<Vec<SurfaceTexel>> {
        let positions: Vec<[f32; 4]> = context.read_texture(&self.position)?;
        let normals: Vec<[f32; 4]> = context.read_texture(&self.normal)?;
        let texels = positions.iter().zip(&normals).map(|(p, n)| SurfaceTexel {
            position: [p[0], p[1], p[2]],
            normal: [n[0], n[1], n[2]],
            hit: n[3] > 0.0,
        });
        Ok(texels.collect())
    }
}

/// The uniform of a camera. `jitter` moves the picture, in pixels to the right and up.
#[expect(clippy::cast_precision_loss, reason = "sides of pictures are small")]
pub(crate) fn view_of(camera: &Camera, size: [u32; 2], jitter: [f32; 2]) -> View {
    let [width, height] = size.map(|side| side as f32);
    let aspect = width / height;
    let axes = camera.world_from_view();
    let (x, y) = camera.half_extents(aspect);
    let rays = if matches!(camera.projection, Projection::Perspective { .. }) { 1.0 } else { 0.0 };
    View {
        clip_from_world: camera.clip_from_world(aspect).to_cols_array_2d(),
        eye: camera.eye.extend(rays).to_array(),
        right: (axes.x_axis * x).extend(0.0).to_array(),
        up: (axes.y_axis * y).extend(0.0).to_array(),
        forward: (-axes.z_axis).extend(0.0).to_array(),
        size: [width, height],
        jitter: [2.0 * jitter[0] / width, 2.0 * jitter[1] / height],
    }
}

/// Fills G-buffers.
#[derive(Debug)]
pub(crate) struct Rasterizer {
    mesh: wgpu::RenderPipeline,
    sphere: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
}

/// A mesh on the device.
#[derive(Debug)]
pub(crate) struct MeshBuffers {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    count: u32,
}

impl MeshBuffers {
    pub(crate) fn new(context: &Context, mesh: &Mesh) -> Result<Self> {
        // The fields are public: check again what the shader relies on.
        let mesh = Mesh::new(mesh.positions.clone(), mesh.normals.clone(), mesh.indices.clone())?;
        let vertices: Vec<Vertex> = std::iter::zip(&mesh.positions, &mesh.normals)
            .map(|(p, n)| Vertex { position: p.to_array(), normal: n.to_array() })
            .collect();
        let bytes = bytemuck::cast_slice(&vertices);
        Ok(Self {
            vertices: context.buffer_of("vertices", bytes, wgpu::BufferUsages::VERTEX)?,
            indices: context.buffer_of(
                "indices",
                bytemuck::cast_slice(&mesh.indices),
                wgpu::BufferUsages::INDEX,
            )?,
            count: u32::try_from(mesh.indices.len()).unwrap_or(u32::MAX),
        })
    }
}

/// How a pipeline of the G-buffer makes surfaces.
struct Stage<'a> {
    vertex: &'a str,
    fragment: &'a str,
    buffers: &'a [Option<wgpu::VertexBufferLayout<'a>>],
    /// Whether nearer surfaces hide those behind them.
    depth: bool,
}

impl Rasterizer {
    pub(crate) fn new(context: &Context) -> Result<Self> {
        let device = context.device();
        context.guard(WHAT, || {
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(WHAT),
                source: wgpu::ShaderSource::Wgsl(shader::gbuffer().into()),
            });
            let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(WHAT),
                entries: &[wgpu::BindGroupLayoutEntry {
                    binding: 0,
                    visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
                    ty: wgpu::BindingType::Buffer {
                        ty: wgpu::BufferBindingType::Uniform,
                        has_dynamic_offset: false,
                        min_binding_size: None,
                    },
                    count: None,
                }],
            });
            let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(WHAT),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            let corners = wgpu::VertexBufferLayout {
                array_stride: size_of::<Vertex>() as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3],
            };
            let mesh = Stage {
                vertex: "mesh_corner",
                fragment: "mesh_texels",
                buffers: &[Some(corners)],
                depth: true,
            };
            let sphere =
                Stage { vertex: "whole_frame", fragment: "sphere_texels", buffers: &[], depth: false };
            Self {
                mesh: pipeline(device, &pipeline_layout, &module, &mesh),
                sphere: pipeline(device, &pipeline_layout, &module, &sphere),
                layout,
            }
        })
    }

    /// A bind group of a buffer that holds a [`View`].
    pub(crate) fn bind(&self, context: &Context, view: &wgpu::Buffer) -> wgpu::BindGroup {
        context.device().create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(WHAT),
            layout: &self.layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: view.as_entire_binding() }],
        })
    }

    /// Records the pass that fills `target` with a mesh, or with the sphere if there is none.
    pub(crate) fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        view: &wgpu::BindGroup,
        mesh: Option<&MeshBuffers>,
        target: &GBuffer,
    ) {
        let colour = |view| {
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(WHAT),
            color_attachments: &[colour(&target.views[0]), colour(&target.views[1])],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.views[2],
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(1.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_bind_group(0, view, &[]);
        if let Some(mesh) = mesh {
            pass.set_pipeline(&self.mesh);
            pass.set_vertex_buffer(0, mesh.vertices.slice(..));
            pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..mesh.count, 0, 0..1);
        } else {
            pass.set_pipeline(&self.sphere);
            pass.draw(0..3, 0..1);
        }
    }
}

fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::PipelineLayout,
    module: &wgpu::ShaderModule,
    stage: &Stage<'_>,
) -> wgpu::RenderPipeline {
    let target =
        Some(wgpu::ColorTargetState { format: FORMAT, blend: None, write_mask: wgpu::ColorWrites::ALL });
    let compare = if stage.depth { wgpu::CompareFunction::Less } else { wgpu::CompareFunction::Always };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(stage.vertex),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(stage.vertex),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: stage.buffers,
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(stage.depth),
            depth_compare: Some(compare),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(stage.fragment),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[target.clone(), target],
        }),
        multiview_mask: None,
        cache: None,
    })
}
