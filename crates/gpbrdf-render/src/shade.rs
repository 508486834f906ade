//! Progressive shading of a G-buffer with two materials.

use crate::camera::{Camera, Projection};
use crate::context::Context;
use crate::error::{Error, Result};
use crate::gbuffer::GBuffer;
use crate::gpu_types::Shade;
use crate::half_vector::{HalfVectorShares, with_material};
use crate::light::Light;
use crate::texture::BrdfTexture;

const SHADE_WGSL: &str = include_str!("../shaders/shade.wgsl");
const WHAT: &str = "shading";

pub(crate) fn source(exact: bool) -> String {
    with_material(SHADE_WGSL, exact)
}

/// How the directions of light from an environment are drawn. All three converge to the same picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampling {
    /// By the light's luminance: best for matte materials.
    Light,
    /// By half vectors as the materials reflect them, mixed with a cosine lobe: best for glossy materials.
    Brdf,
    /// One direction of each, weighted by the balance heuristic.
    #[default]
    Both,
}

/// How a scene is shaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingOptions {
    /// How directions of an environment are drawn.
    pub sampling: Sampling,
    /// Where either cosine is smaller, nothing is reflected: 0 for physical pictures, the core's `MIN_COSINE` to compare
    /// with the image metrics.
    pub min_cosine: f32,
    /// Moves the picture by parts of a pixel between passes, which smooths edges. Without it every ray goes through the
    /// middle of its pixel, as in the image metrics.
    pub antialias: bool,
    /// Interpolates tables in full precision by eight loads, not by the texture unit, which rounds weights to 1/256.
    pub exact_lookup: bool,
}

impl Default for ShadingOptions {
    fn default() -> Self {
        Self { sampling: Sampling::default(), min_cosine: 0.0, antialias: true, exact_lookup: false }
    }
}

impl ShadingOptions {
    /// Options that see what the core's sphere sees: pixel centres, its `MIN_COSINE`, full precision.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "a small constant")]
    pub fn of_metrics() -> Self {
        Self {
            min_cosine: gpbrdf_core::MIN_COSINE as f32,
            antialias: false,
            exact_lookup: true,
            ..Self::default()
        }
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] unless the least cosine is in `[0, 1)`.
    pub fn check(&self) -> Result<()> {
        if (0.0..1.0).contains(&self.min_cosine) {
            return Ok(());
        }
        Err(Error::InvalidArgument {
            what: "least cosine",
            expected: "a number in [0, 1)".to_owned(),
            found: self.min_cosine.to_string(),
        })
    }
}

/// The share of directions that [`Sampling::Brdf`] draws by the cosine.
const COSINE_SHARE: f32 = 0.3;

/// Pixels times samples of one dispatch: some 10 ms of a modest GPU, and of a processor.
const HARDWARE_BUDGET: u64 = 1 << 21;
const SOFTWARE_BUDGET: u64 = 1 << 16;

/// An environment on the device; a black one where the light is of another kind.
#[derive(Debug)]
pub(crate) struct EnvironmentBuffers {
    pub(crate) size: [u32; 2],
    pub(crate) view: wgpu::TextureView,
    shares: wgpu::Buffer,
}

impl EnvironmentBuffers {
    pub(crate) fn new(context: &Context, light: &Light) -> Result<Self> {
        const WHAT: &str = "environment map";
        let (width, height, texels, cumulative) = match light {
            Light::Environment(map) => (map.width(), map.height(), map.texels(), map.cumulative()),
            _ => (1, 1, &[[0.0; 4]][..], &[0.0; 4][..]),
        };
        let most = context.device().limits().max_texture_dimension_2d;
        let side = |n: usize| u32::try_from(n).ok().filter(|&n| n <= most);
        let (Some(columns), Some(rows)) = (side(width), side(height)) else {
            return Err(Error::Limit {
                what: WHAT,
                expected: format!("at most {most} x {most} pixels"),
                found: format!("{width} x {height}"),
            });
        };
        let size = wgpu::Extent3d { width: columns, height: rows, depth_or_array_layers: 1 };
        let texture = context.guard(WHAT, || {
            let texture = context.device().create_texture(&wgpu::TextureDescriptor {
                label: Some(WHAT),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba32Float,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            });
            let layout = wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(16 * columns),
                rows_per_image: None,
            };
            context.queue().write_texture(
                texture.as_image_copy(),
                bytemuck::cast_slice(texels),
                layout,
                size,
            );
            texture
        })?;
        let shares =
            context.buffer_of(WHAT, bytemuck::cast_slice(cumulative), wgpu::BufferUsages::STORAGE)?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Self { size: [columns, rows], view, shares })
    }
}

/// The materials of a scene on the device.
#[derive(Debug)]
pub(crate) struct Materials {
    truth: BrdfTexture,
    prediction: BrdfTexture,
    single: bool,
    shares: HalfVectorShares,
    exact: bool,
}

impl Materials {
    /// A truth and a prediction, or one material for both.
    pub(crate) fn new(
        context: &Context,
        truth: Option<&BrdfTexture>,
        prediction: &BrdfTexture,
        exact: bool,
    ) -> Result<Self> {
        let other = truth.unwrap_or(prediction);
        let exact = exact || !prediction.is_filterable(context) || !other.is_filterable(context);
        Ok(Self {
            shares: HalfVectorShares::new(context, other, prediction, exact)?,
            truth: other.clone(),
            prediction: prediction.clone(),
            single: truth.is_none(),
            exact,
        })
    }

    pub(crate) fn textures(&self) -> (Option<&BrdfTexture>, &BrdfTexture) {
        ((!self.single).then_some(&self.truth), &self.prediction)
    }
}

/// The shading pipelines and the uniform they share.
#[derive(Debug)]
pub(crate) struct Shader {
    exact: wgpu::ComputePipeline,
    filtered: wgpu::ComputePipeline,
    uniform: wgpu::Buffer,
    sampler: wgpu::Sampler,
}

/// What one call of [`Shader::add`] shades.
#[derive(Debug)]
pub(crate) struct Job<'a> {
    pub(crate) gbuffer: &'a GBuffer,
    pub(crate) sums: &'a wgpu::Buffer,
    pub(crate) materials: &'a Materials,
    pub(crate) light: &'a Light,
    pub(crate) environment: &'a EnvironmentBuffers,
    pub(crate) camera: &'a Camera,
    pub(crate) options: &'a ShadingOptions,
    pub(crate) first_sample: u32,
    pub(crate) sample_count: u32,
}

impl Shader {
    pub(crate) fn new(context: &Context) -> Result<Self> {
        Ok(Self {
            exact: context.compute_pipeline(WHAT, &source(true), "shade_pixels")?,
            filtered: context.compute_pipeline(WHAT, &source(false), "shade_pixels")?,
            uniform: context.empty_buffer(
                "shading uniforms",
                size_of::<Shade>() as u64,
                wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            )?,
            sampler: BrdfTexture::sampler(context),
        })
    }

    /// Adds samples to the sums, some rows a dispatch, each dispatch short enough for any driver.
    pub(crate) fn add(&self, context: &Context, job: &Job<'_>) {
        use wgpu::BindingResource::{Sampler, TextureView};
        let pipeline = if job.materials.exact { &self.exact } else { &self.filtered };
        let resources = [
            self.uniform.as_entire_binding(),
            TextureView(job.gbuffer.position_view()),
            TextureView(job.gbuffer.normal_view()),
            TextureView(job.materials.truth.view()),
            TextureView(job.materials.prediction.view()),
            TextureView(&job.environment.view),
            job.environment.shares.as_entire_binding(),
            job.materials.shares.edges.as_entire_binding(),
            job.materials.shares.shares.as_entire_binding(),
            job.sums.as_entire_binding(),
        ];
        let group = if job.materials.exact {
            context.bind_group(pipeline, resources)
        } else {
            let [a, b, c, d, e, f, g, h, i, j] = resources;
            context.bind_group(pipeline, [a, b, c, d, e, f, g, h, i, j, Sampler(&self.sampler)])
        };
        let [width, height] = job.gbuffer.size();
        let budget = if context.is_hardware() { HARDWARE_BUDGET } else { SOFTWARE_BUDGET };
        let rows = budget / (u64::from(width) * u64::from(job.sample_count.max(1)));
        // Whole workgroups of 8 rows.
        let rows = u32::try_from(rows).unwrap_or(u32::MAX).clamp(8, height.next_multiple_of(8)) / 8 * 8;
        let mut uniform = self.uniform_of(job);
        for first_row in (0..height).step_by(rows as usize) {
            uniform.first_row = first_row;
            context.queue().write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
            let count = rows.min(height - first_row);
            context.dispatch(pipeline, &group, [width.div_ceil(8), count.div_ceil(8), 1]);
        }
    }

    fn uniform_of(&self, job: &Job<'_>) -> Shade {
        let viewer = match job.camera.projection {
            Projection::Perspective { .. } => job.camera.eye.extend(1.0),
            Projection::Orthographic { .. } => job.camera.world_from_view().z_axis.extend(0.0),
        };
        let (light_kind, light, strength) = match job.light {
            Light::Directional { direction, irradiance } => {
                (0, direction.try_normalize().unwrap_or(glam::Vec3::Z), *irradiance)
            }
            Light::Point { position, intensity } => (1, *position, *intensity),
            Light::Environment(_) => (2, glam::Vec3::ZERO, [0.0; 3]),
        };
        Shade {
            viewer: viewer.to_array(),
            light: light.extend(0.0).to_array(),
            strength: [strength[0], strength[1], strength[2], 0.0],
            size: job.gbuffer.size(),
            environment_size: job.environment.size,
            first_row: 0,
            first_sample: job.first_sample,
            sample_count: job.sample_count,
            light_kind,
            strategy: match job.options.sampling {
                Sampling::Light => 0,
                Sampling::Brdf => 1,
                Sampling::Both => 2,
            },
            single_material: u32::from(job.materials.single),
            min_cosine: job.options.min_cosine,
            cosine_share: COSINE_SHARE,
        }
    }
}
