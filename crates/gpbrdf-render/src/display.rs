//! From radiance to a picture for the eye.

use gpbrdf_core::Colormap;

use crate::context::Context;
use crate::error::{Error, Result};
use crate::gbuffer::download_texture;
use crate::gpu_types::{self, View};
use crate::lookup::LOOKUP_WGSL;
use crate::shade::EnvironmentBuffers;

const DISPLAY_WGSL: &str = include_str!("../shaders/display.wgsl");
const WHAT: &str = "display";

pub(crate) fn source() -> String {
    format!("{LOOKUP_WGSL}\n{DISPLAY_WGSL}")
}

/// What is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Show {
    /// The truth.
    Truth,
    /// The prediction.
    #[default]
    Prediction,
    /// Standard deviation of the prediction's target, weighted by the light that each direction adds, in false colours
    /// from 0 to [`Display::limit`].
    Sigma,
    /// The paper's pixel difference `1 - b / a` of the truth `a` and the prediction `b`, means over R, G and B, in false
    /// colours from `-limit` to `limit`: red where the prediction is too dark.
    Difference,
    /// The truth on the left of a vertical line, the prediction on its right.
    Split {
        /// Where the line is, as a share of the width.
        at: f32,
    },
}

/// How radiance becomes brightness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToneCurve {
    /// Linear up to white.
    #[default]
    Clip,
    /// Reinhard's curve on luminance, white at 4.
    Reinhard,
    /// A film-like curve with a toe and a shoulder.
    Filmic,
}

/// How linear colours are stored in 8 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoding {
    /// A power of 1 / 2.2, as in the core's pictures.
    #[default]
    Gamma22,
    /// The curve of sRGB.
    Srgb,
}

/// What is seen beside the objects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Background {
    /// The environment map; black under other lights.
    #[default]
    Environment,
    /// Black.
    Black,
    /// Nothing: alpha is the share of the pixel that is covered, colours are not multiplied by it.
    Transparent,
}

/// How a picture is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Display {
    /// What is shown.
    pub show: Show,
    /// Factor of the radiance before the tone curve.
    pub exposure: f32,
    /// Tone curve.
    pub tone: ToneCurve,
    /// Encoding.
    pub encoding: Encoding,
    /// Background.
    pub background: Background,
    /// End of the scale of false colours.
    pub limit: f32,
}

impl Default for Display {
    fn default() -> Self {
        Self {
            show: Show::default(),
            exposure: 1.0,
            tone: ToneCurve::default(),
            encoding: Encoding::default(),
            background: Background::default(),
            limit: 0.1,
        }
    }
}

/// The pipeline, the colour maps and the picture.
#[derive(Debug)]
pub(crate) struct Displayer {
    pipeline: wgpu::ComputePipeline,
    uniform: wgpu::Buffer,
    view: wgpu::Buffer,
    colours: wgpu::TextureView,
}

/// The texture that a viewer shows: `rgba8unorm`, encoded, with straight alpha.
#[derive(Debug)]
pub(crate) struct DisplayTexture {
    texture: wgpu::Texture,
    pub(crate) view: wgpu::TextureView,
}

impl DisplayTexture {
    pub(crate) fn new(context: &Context, size: [u32; 2]) -> Result<Self> {
        let texture = context.guard(WHAT, || {
            context.device().create_texture(&wgpu::TextureDescriptor {
                label: Some("display"),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba8Unorm,
                usage: wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        })?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Self { texture, view })
    }

    pub(crate) fn download(&self, context: &Context) -> Result<Vec<[u8; 4]>> {
        download_texture(context, &self.texture)
    }
}

impl Displayer {
    pub(crate) fn new(context: &Context) -> Result<Self> {
        let pipeline = context.compute_pipeline(WHAT, &source(), "display_pixels")?;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let uniform =
            context.empty_buffer("display uniforms", size_of::<gpu_types::Display>() as u64, usage)?;
        let view = context.empty_buffer("display uniforms", size_of::<View>() as u64, usage)?;
        let texels: Vec<[u8; 4]> = [Colormap::Sequential, Colormap::Diverging]
            .into_iter()
            .flat_map(|map| (0..256).map(move |i| map.at(f64::from(i) / 255.0)))
            .map(|[r, g, b]| [r, g, b, 255])
            .collect();
        let size = wgpu::Extent3d { width: 256, height: 2, depth_or_array_layers: 1 };
        let texture = context.guard(WHAT, || {
            let texture = context.device().create_texture(&wgpu::TextureDescriptor {
                label: Some("colour maps"),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba8Unorm,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            });
            let layout =
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(1024), rows_per_image: None };
            let bytes = texels.as_flattened();
            context.queue().write_texture(texture.as_image_copy(), bytes, layout, size);
            texture
        })?;
        let colours = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Self { pipeline, uniform, view, colours })
    }

    /// Draws the sums of `samples` samples.
    pub(crate) fn draw(
        &self,
        context: &Context,
        display: &Display,
        sums: &wgpu::Buffer,
        samples: u32,
        view: &View,
        environment: Option<&EnvironmentBuffers>,
        black: &EnvironmentBuffers,
        target: &DisplayTexture,
    ) -> Result<()> {
        let finite = |x: f32| x > 0.0 && x.is_finite();
        if !finite(display.exposure) || !finite(display.limit) {
            return Err(Error::InvalidArgument {
                what: "display",
                expected: "a positive exposure and limit".to_owned(),
                found: format!("{} and {}", display.exposure, display.limit),
            });
        }
        let (show, split) = match display.show {
            Show::Truth => (0, 0.0),
            Show::Prediction => (1, 0.0),
            Show::Sigma => (2, 0.0),
            Show::Difference => (3, 0.0),
            Show::Split { at } => (4, at),
        };
        let size = [target.texture.width(), target.texture.height()];
        let map = environment.unwrap_or(black);
        #[expect(clippy::cast_precision_loss, reason = "counts under 2^24 are exact")]
        let uniform = gpu_types::Display {
            size,
            environment_size: map.size,
            show,
            tone: match display.tone {
                ToneCurve::Clip => 0,
                ToneCurve::Reinhard => 1,
                ToneCurve::Filmic => 2,
            },
            encoding: match display.encoding {
                Encoding::Gamma22 => 0,
                Encoding::Srgb => 1,
            },
            background: match display.background {
                Background::Environment if environment.is_some() => 0,
                Background::Environment | Background::Black => 1,
                Background::Transparent => 2,
            },
            samples: samples as f32,
            exposure: display.exposure,
            limit: display.limit,
            split,
        };
        context.guard(WHAT, || {
            context.queue().write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
            context.queue().write_buffer(&self.view, 0, bytemuck::bytes_of(view));
            let group = context.bind_group(
                &self.pipeline,
                [
                    self.uniform.as_entire_binding(),
                    self.view.as_entire_binding(),
                    sums.as_entire_binding(),
                    wgpu::BindingResource::TextureView(&map.view),
                    wgpu::BindingResource::TextureView(&self.colours),
                    wgpu::BindingResource::TextureView(&target.view),
                ],
            );
            context.dispatch(&self.pipeline, &group, [size[0].div_ceil(8), size[1].div_ceil(8), 1]);
        })
    }
}
