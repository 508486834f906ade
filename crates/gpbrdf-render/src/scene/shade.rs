//! Progressive shading of a G-buffer with two materials.

use std::sync::OnceLock;

use bytemuck::NoUninit;
use gpbrdf_core::BrdfTable;
use gpbrdf_core::base::Raster;
use gpbrdf_core::material::DirectionDensities;
use rayon::prelude::*;

use super::camera::{Camera, Projection};
use super::gbuffer::GBuffer;
use super::light::Light;
use crate::context::Context;
use crate::error::{Error, Result};
use crate::gpu_types::{LightKind, Shade};
use crate::material::density_buffer;
use crate::shader::{self, Lookup, MATERIAL_SAMPLER};
use crate::texture::BrdfTexture;

const WHAT: &str = "shading";

/// How the directions of light from an environment are drawn. All three converge to the same picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, NoUninit)]
#[repr(u32)]
pub enum Sampling {
    /// By the luminance of the light: best for matte materials.
    Light,
    /// By the light that the materials reflect, as [`gpbrdf_core::Material::sample`] does: best for glossy materials.
    Brdf,
    /// One direction from each of the two, weighted by the balance heuristic.
    #[default]
    Both,
}

/// How a scene is shaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingOptions {
    /// How directions of an environment are drawn.
    pub sampling: Sampling,
    /// Nothing is reflected where either cosine is smaller. Use 0 for physical pictures and
    /// [`gpbrdf_core::brdf::GRAZING_COSINE`] to compare with the image metrics.
    pub min_cosine: f32,
    /// Whether the picture is moved by parts of a pixel between passes, which smooths edges. Otherwise every
    /// ray goes through the centre of its pixel, as in the image metrics.
    pub antialias: bool,
    /// Whether tables are interpolated in full precision by eight loads, not by the texture unit, which
    /// rounds weights to 1/256.
    pub exact_lookup: bool,
}

impl Default for ShadingOptions {
    fn default() -> Self {
        Self { sampling: Sampling::default(), min_cosine: 0.0, antialias: true, exact_lookup: false }
    }
}

impl ShadingOptions {
    /// The options for pictures that are compared with the image metrics: rays through the centres of pixels,
    /// [`gpbrdf_core::brdf::GRAZING_COSINE`] and lookups in full precision.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "a small constant")]
    pub fn of_metrics() -> Self {
        Self {
            min_cosine: gpbrdf_core::brdf::GRAZING_COSINE as f32,
            antialias: false,
            exact_lookup: true,
            ..Self::default()
        }
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// [`gpbrdf_core::Error::InvalidArgument`] unless the least cosine is in `[0, 1)`.
    pub fn check(&self) -> Result<()> {
        if (0.0..1.0).contains(&self.min_cosine) {
            return Ok(());
        }
        Err(Error::argument("least cosine", "a number in [0, 1)", self.min_cosine))
    }
}

/// Pixels times samples of one dispatch, which take about 10 ms on a modest GPU and on a processor.
const HARDWARE_BUDGET: u64 = 1 << 21;
const SOFTWARE_BUDGET: u64 = 1 << 16;

/// Bytes of a map that are handed to the device at a time.
const BAND_BYTES: usize = 32 << 20;

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
        let (texels, cumulative) = match light {
            Light::Environment(map) => (map.texels(), map.cumulative()),
            _ => (&Raster::filled(1, 1, [0.0; 4]), &[0.0; 4][..]),
        };
        let (width, height) = (texels.width(), texels.height());
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
            // In bands, so that copies of the map stay small.
            let band = (BAND_BYTES / (16 * width)).max(1);
            for (i, lines) in texels.pixels().chunks(band * width).enumerate() {
                // Both are at most the number of rows.
                let [y, rows] = [i * band, lines.len() / width].map(|n| u32::try_from(n).unwrap_or(0));
                let mut target = texture.as_image_copy();
                target.origin.y = y;
                let extent = wgpu::Extent3d { height: rows, ..size };
                context.queue().write_texture(target, bytemuck::cast_slice(lines), layout, extent);
                context.queue().submit([]);
            }
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
    /// What both reflect together, so that one set of directions serves both: see [`density_buffer`].
    densities: wgpu::Buffer,
    lookup: Lookup,
    pipeline: wgpu::ComputePipeline,
}

impl Materials {
    /// A truth and a prediction, or one material for both.
    pub(crate) fn new(
        context: &Context,
        shader: &Shader,
        truth: Option<&BrdfTexture>,
        prediction: &BrdfTexture,
        exact: bool,
    ) -> Result<Self> {
        let other = truth.unwrap_or(prediction);
        let lookup = lookup_of(context, [prediction, other], exact);
        Ok(Self {
            densities: densities_of(context, truth, prediction)?,
            pipeline: shader.pipeline(context, lookup)?.clone(),
            truth: other.clone(),
            prediction: prediction.clone(),
            single: truth.is_none(),
            lookup,
        })
    }

    /// The same materials with the other kind of lookup, where the device has it.
    pub(crate) fn looked_up(&self, context: &Context, shader: &Shader, exact: bool) -> Result<Self> {
        let lookup = lookup_of(context, [&self.prediction, &self.truth], exact);
        let pipeline = shader.pipeline(context, lookup)?.clone();
        let (truth, prediction) = (self.truth.clone(), self.prediction.clone());
        Ok(Self {
            truth,
            prediction,
            single: self.single,
            densities: self.densities.clone(),
            lookup,
            pipeline,
        })
    }
}

fn lookup_of(context: &Context, textures: [&BrdfTexture; 2], exact: bool) -> Lookup {
    let are_filterable = textures.iter().all(|texture| texture.is_filterable(context));
    if are_filterable && !exact { Lookup::Filtered } else { Lookup::Exact }
}

/// The densities of what a prediction and a truth reflect together. Waits for the device.
fn densities_of(
    context: &Context,
    truth: Option<&BrdfTexture>,
    prediction: &BrdfTexture,
) -> Result<wgpu::Buffer> {
    let mut texels = prediction.download(context)?;
    if let Some(truth) = truth {
        let others = truth.download(context)?;
        texels.par_iter_mut().zip(others).for_each(|(sum, other)| (0..3).for_each(|c| sum[c] += other[c]));
    }
    // What a device makes of a value that is too large must not spoil the others.
    let usable = |x: f32| if x.is_finite() { x } else { 0.0 };
    let values = texels.into_par_iter().map(|[r, g, b, _]| [r, g, b].map(usable)).collect();
    density_buffer(context, &DirectionDensities::of_table(&BrdfTable::from_values(values)?)?)
}

/// The pipelines of both kinds of lookup, each made when it is first needed, and the uniform they share.
#[derive(Debug)]
pub(crate) struct Shader {
    exact: OnceLock<wgpu::ComputePipeline>,
    filtered: OnceLock<wgpu::ComputePipeline>,
    uniform: wgpu::Buffer,
    sampler: wgpu::Sampler,
}

/// The work of one call of [`Shader::add`].
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
            exact: OnceLock::new(),
            filtered: OnceLock::new(),
            uniform: context.empty_buffer(
                "shading uniforms",
                size_of::<Shade>() as u64,
                wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            )?,
            sampler: BrdfTexture::sampler(context),
        })
    }

    fn pipeline(&self, context: &Context, lookup: Lookup) -> Result<&wgpu::ComputePipeline> {
        let known = match lookup {
            Lookup::Exact => &self.exact,
            Lookup::Filtered => &self.filtered,
        };
        if let Some(pipeline) = known.get() {
            return Ok(pipeline);
        }
        let made = context.compute_pipeline(WHAT, &shader::shade(lookup), "shade_pixels")?;
        Ok(known.get_or_init(|| made))
    }

    /// Adds samples to the sums. Each dispatch shades some rows, few enough for any driver.
    pub(crate) fn add(&self, context: &Context, job: &Job<'_>) {
        let pipeline = &job.materials.pipeline;
        let group = self.bind(context, pipeline, job);
        let [width, height] = job.gbuffer.size();
        let budget = if context.is_hardware() { HARDWARE_BUDGET } else { SOFTWARE_BUDGET };
        let rows = budget / (u64::from(width) * u64::from(job.sample_count.max(1)));
        // Whole workgroups of 8 rows.
        let rows = u32::try_from(rows).unwrap_or(u32::MAX).clamp(8, height.next_multiple_of(8)) / 8 * 8;
        let mut uniform = uniform_of(job);
        for first_row in (0..height).step_by(rows as usize) {
            uniform.first_row = first_row;
            context.queue().write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
            let count = rows.min(height - first_row);
            context.dispatch(pipeline, &group, [width.div_ceil(8), count.div_ceil(8), 1]);
        }
    }

    fn bind(&self, context: &Context, pipeline: &wgpu::ComputePipeline, job: &Job<'_>) -> wgpu::BindGroup {
        use wgpu::BindingResource::{Sampler, TextureView};
        let mut resources = vec![
            (0, self.uniform.as_entire_binding()),
            (1, TextureView(job.gbuffer.position_view())),
            (2, TextureView(job.gbuffer.normal_view())),
            (3, TextureView(job.materials.truth.view())),
            (4, TextureView(job.materials.prediction.view())),
            (5, TextureView(&job.environment.view)),
            (6, job.environment.shares.as_entire_binding()),
            (7, job.materials.densities.as_entire_binding()),
            (8, job.sums.as_entire_binding()),
        ];
        if job.materials.lookup == Lookup::Filtered {
            resources.push((MATERIAL_SAMPLER, Sampler(&self.sampler)));
        }
        context.bind_group(pipeline, resources)
    }
}

fn uniform_of(job: &Job<'_>) -> Shade {
    let viewer = match job.camera.projection {
        Projection::Perspective { .. } => job.camera.eye.extend(1.0),
        Projection::Orthographic { .. } => job.camera.world_from_view().z_axis.extend(0.0),
    };
    let (light_kind, light, strength) = match job.light {
        Light::Directional { direction, irradiance } => {
            (LightKind::Directional, direction.try_normalize().unwrap_or(glam::Vec3::Z), *irradiance)
        }
        Light::Point { position, intensity } => (LightKind::Point, *position, *intensity),
        Light::Environment(_) => (LightKind::Environment, glam::Vec3::ZERO, [0.0; 3]),
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
        sampling: job.options.sampling,
        single_material: u32::from(job.materials.single),
        min_cosine: job.options.min_cosine,
        padding: 0,
    }
}
