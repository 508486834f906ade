//! From running sums of radiance to a picture for the eye.

use bytemuck::NoUninit;
use gpbrdf_core::figure::Colormap;

use super::ground::Ground;
use super::shade::EnvironmentBuffers;
use crate::context::Context;
use crate::error::{Error, Result};
use crate::gpu_types::{self, ShowKind, View};
use crate::shader;

const WHAT: &str = "display";

/// What a picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Show {
    /// The truth.
    Truth,
    /// The prediction.
    #[default]
    Prediction,
    /// Standard deviation of the prediction's target in false colours from 0 to [`Display::limit`]. A pixel
    /// shows the mean over its samples, weighted by the luminance that each of them adds.
    Sigma,
    /// `exposure (prediction - truth)` of linear radiance, the mean of the channels, in false colours from
    /// `-limit` to `limit`: red where the prediction is too bright, blue where it is too dark, pale yellow
    /// where it is right. No tone curve is applied, so 1 is the white of [`ToneCurve::Clip`].
    Difference,
    /// The truth on the left of a vertical line, the prediction on its right.
    Split {
        /// Where the line is, as a share of the width.
        at: f32,
    },
}

impl Show {
    /// The end of the colour scale without a [`Display::limit`]. Sigma has 0.1, which is about 10 % of a BRDF
    /// whose logarithm is the target. The difference has 0.05, a twentieth of white; a picture that is off by
    /// so much everywhere has a PSNR of 26 dB. Pictures that are not in false colours have 1, which is
    /// unused.
    #[must_use]
    pub fn default_limit(self) -> f32 {
        match self {
            Self::Sigma => 0.1,
            Self::Difference => 0.05,
            Self::Truth | Self::Prediction | Self::Split { .. } => 1.0,
        }
    }

    /// How the shader names it, and where the split is.
    fn kind(self) -> (ShowKind, f32) {
        match self {
            Self::Truth => (ShowKind::Truth, 0.0),
            Self::Prediction => (ShowKind::Prediction, 0.0),
            Self::Sigma => (ShowKind::Sigma, 0.0),
            Self::Difference => (ShowKind::Difference, 0.0),
            Self::Split { at } => (ShowKind::Split, at),
        }
    }
}

/// How radiance becomes brightness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, NoUninit)]
#[repr(u32)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, NoUninit)]
#[repr(u32)]
pub enum Encoding {
    /// A power of 1 / 2.2, as in the pictures of `gpbrdf-core`.
    #[default]
    Gamma22,
    /// The curve of sRGB.
    Srgb,
}

/// What surrounds the object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, NoUninit)]
#[repr(u32)]
pub enum Background {
    /// The environment map; black under other lights.
    #[default]
    Environment,
    /// Black.
    Black,
    /// Nothing: alpha is the share of the pixel that is covered. Colours are not multiplied by alpha.
    Transparent,
}

/// How a picture is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Display {
    /// What the picture shows.
    pub show: Show,
    /// Factor of the radiance before the tone curve, and of the difference.
    pub exposure: f32,
    /// Tone curve.
    pub tone: ToneCurve,
    /// Encoding.
    pub encoding: Encoding,
    /// Background.
    pub background: Background,
    /// End of the scale of false colours; [`Show::default_limit`] if there is none.
    pub limit: Option<f32>,
}

impl Default for Display {
    fn default() -> Self {
        Self {
            show: Show::default(),
            exposure: 1.0,
            tone: ToneCurve::default(),
            encoding: Encoding::default(),
            background: Background::default(),
            limit: None,
        }
    }
}

impl Display {
    /// The end of the colour scale.
    fn scale_end(&self) -> f32 {
        self.limit.unwrap_or_else(|| self.show.default_limit())
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// [`gpbrdf_core::Error::InvalidArgument`] unless exposure and limit are positive and finite.
    pub fn check(&self) -> Result<()> {
        let positive = |x: f32| x > 0.0 && x.is_finite();
        if positive(self.exposure) && positive(self.scale_end()) {
            return Ok(());
        }
        let found = format!("{} and {}", self.exposure, self.scale_end());
        Err(Error::argument("display", "a positive exposure and limit", found))
    }
}

/// The pipeline, its uniforms and the colour maps.
#[derive(Debug)]
pub(crate) struct Displayer {
    pipeline: wgpu::ComputePipeline,
    uniform: wgpu::Buffer,
    view: wgpu::Buffer,
    colours: wgpu::TextureView,
    /// Bound where there is no ground.
    no_ground: wgpu::Buffer,
}

/// The texture that a viewer shows: `rgba8unorm`, encoded, with straight alpha.
#[derive(Debug)]
pub(crate) struct DisplayTexture {
    texture: wgpu::Texture,
    pub(crate) view: wgpu::TextureView,
}

/// The picture that [`Displayer::draw`] shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shown<'a> {
    /// Running sums of `samples` samples of each pixel.
    pub(crate) sums: &'a wgpu::Buffer,
    pub(crate) samples: u32,
    pub(crate) view: View,
    /// The map behind the object, black if there is none.
    pub(crate) map: &'a EnvironmentBuffers,
    pub(crate) has_map: bool,
    /// The ground under the object, if there is one.
    pub(crate) ground: Option<&'a GroundBuffer>,
}

/// A ground on the device.
#[derive(Debug)]
pub(crate) struct GroundBuffer {
    texels: wgpu::Buffer,
    size: u32,
    half: f32,
    height: f32,
    horizon: f32,
}

impl GroundBuffer {
    pub(crate) fn new(context: &Context, ground: &Ground) -> Result<Self> {
        let radiance = ground.radiance();
        let texels: Vec<[f32; 4]> = radiance.pixels().iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
        Ok(Self {
            texels: context.buffer_of(
                "ground",
                bytemuck::cast_slice(&texels),
                wgpu::BufferUsages::STORAGE,
            )?,
            size: gpu_types::to_u32(radiance.width()),
            half: ground.half(),
            height: ground.height(),
            horizon: ground.horizon(),
        })
    }
}

impl DisplayTexture {
    pub(crate) fn new(context: &Context, size: [u32; 2]) -> Result<Self> {
        let usage = wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC;
        let texture = context.guard(WHAT, || rgba8_texture(context, WHAT, size, usage))?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Self { texture, view })
    }

    pub(crate) fn download(&self, context: &Context) -> Result<Vec<[u8; 4]>> {
        context.read_texture(&self.texture)
    }
}

impl Displayer {
    pub(crate) fn new(context: &Context) -> Result<Self> {
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let uniform = |size: usize| context.empty_buffer("display uniforms", size as u64, usage);
        Ok(Self {
            pipeline: context.compute_pipeline(WHAT, &shader::display(), "display_pixels")?,
            uniform: uniform(size_of::<gpu_types::Display>())?,
            view: uniform(size_of::<View>())?,
            colours: colour_maps(context)?,
            no_ground: context.empty_buffer("no ground", 16, wgpu::BufferUsages::STORAGE)?,
        })
    }

    /// Draws a picture to `target`.
    pub(crate) fn draw(
        &self,
        context: &Context,
        display: &Display,
        shown: &Shown<'_>,
        target: &DisplayTexture,
    ) -> Result<()> {
        use wgpu::BindingResource::TextureView;
        display.check()?;
        let size = [target.texture.width(), target.texture.height()];
        let uniform = uniform_of(display, shown, size);
        context.guard(WHAT, || {
            context.queue().write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
            context.queue().write_buffer(&self.view, 0, bytemuck::bytes_of(&shown.view));
            let resources = [
                (0, self.uniform.as_entire_binding()),
                (1, self.view.as_entire_binding()),
                (2, shown.sums.as_entire_binding()),
                (3, TextureView(&shown.map.view)),
                (4, TextureView(&self.colours)),
                (5, TextureView(&target.view)),
                (6, shown.ground.map_or(&self.no_ground, |ground| &ground.texels).as_entire_binding()),
            ];
            let group = context.bind_group(&self.pipeline, resources);
            context.dispatch(&self.pipeline, &group, [size[0].div_ceil(8), size[1].div_ceil(8), 1]);
        })
    }
}

fn uniform_of(display: &Display, shown: &Shown<'_>, size: [u32; 2]) -> gpu_types::Display {
    let (show, split) = display.show.kind();
    let background = match display.background {
        Background::Environment if !shown.has_map => Background::Black,
        other => other,
    };
    #[expect(clippy::cast_precision_loss, reason = "counts under 2^24 are exact")]
    let samples = shown.samples as f32;
    gpu_types::Display {
        size,
        environment_size: shown.map.size,
        show,
        tone: display.tone,
        encoding: display.encoding,
        background,
        samples,
        exposure: display.exposure,
        limit: display.scale_end(),
        split,
        ground_size: shown.ground.map_or(0, |ground| ground.size),
        ground_half: shown.ground.map_or(1.0, |ground| ground.half),
        ground_height: shown.ground.map_or(0.0, |ground| ground.height),
        horizon: shown.ground.map_or(0.0, |ground| ground.horizon),
    }
}

/// `COLOURS_SEQUENTIAL` and `COLOURS_DIVERGING` of `scene/display.wgsl`, in the order of the rows of the
/// texture.
pub(crate) const COLOUR_MAPS: [Colormap; 2] = [Colormap::Sequential, Colormap::Diverging];

/// 256 colours of each map, one map in each row.
fn colour_maps(context: &Context) -> Result<wgpu::TextureView> {
    let texels: Vec<[u8; 4]> = COLOUR_MAPS
        .into_iter()
        .flat_map(|map| (0..256).map(move |i| map.at(f64::from(i) / 255.0)))
        .map(|[r, g, b]| [r, g, b, 255])
        .collect();
    let texture = context.guard(WHAT, || {
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
        let texture = rgba8_texture(context, "colour maps", [256, 2], usage);
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * 256), rows_per_image: None };
        let bytes = texels.as_flattened();
        context.queue().write_texture(texture.as_image_copy(), bytes, layout, texture.size());
        texture
    })?;
    Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
}

fn rgba8_texture(
    context: &Context,
    label: &str,
    size: [u32; 2],
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    context.device().create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage,
        view_formats: &[],
    })
}
