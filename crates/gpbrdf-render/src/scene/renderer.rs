//! The renderer of scenes, which a viewer shows or a program writes to files.

use glam::Vec2;
use gpbrdf_core::base::Raster;
use gpbrdf_core::judge::Image;

use super::camera::Camera;
use super::colour::luminance;
use super::display::{Display, DisplayTexture, Displayer, GroundBuffer, Shown};
use super::gbuffer::{GBuffer, Geometry, MeshBuffers, Rasterizer, view_of};
use super::ground::Ground;
use super::light::Light;
use super::shade::{EnvironmentBuffers, Job, Materials, Shader, ShadingOptions};
use crate::context::Context;
use crate::error::Result;
use crate::gpu_types::{PixelSums, View, narrow};
use crate::texture::BrdfTexture;

/// Samples between two moves of the picture by parts of a pixel.
const SAMPLES_PER_PASS: u32 = 4;

/// Renders one object under one light with one or two materials, progressively and without a window.
///
/// ```no_run
/// use gpbrdf_render::{
///     AdapterChoice, BrdfTexture, Context, Display, Geometry, Light, Mesh, Precision, Renderer,
/// };
/// # fn main() -> gpbrdf_render::Result<()> {
/// # let table = gpbrdf_core::BrdfTable::from_fn(|_| [0.3; 3]);
/// let context = Context::open(AdapterChoice::Any)?;
/// let material = BrdfTexture::upload(&context, &table, None, Precision::Half)?;
/// let mut renderer = Renderer::new(&context, [640, 480])?;
/// renderer.set_geometry(&Geometry::Mesh(Mesh::knot()))?;
/// renderer.set_materials(None, &material)?;
/// renderer.set_light(Light::Environment((&gpbrdf_core::Environment::studio()).into()))?;
/// renderer.render_more(64)?;
/// let picture = renderer.read_display(&Display::default())?; // or display() for a texture to show
/// # Ok(())
/// # }
/// ```
///
/// A change of the scene starts the picture anew; a change of the [`Display`] does not. The result depends on
/// the number of samples and on nothing else, so pictures can be repeated. Light is reflected once,
/// and the only shadow is that on a [`Ground`].
#[derive(Debug)]
pub struct Renderer {
    context: Context,
    rasterizer: Rasterizer,
    shader: Shader,
    displayer: Displayer,
    frame: Frame,
    mesh: Option<MeshBuffers>,
    camera: Camera,
    light: Light,
    environment: EnvironmentBuffers,
    black: EnvironmentBuffers,
    ground: Option<GroundBuffer>,
    materials: Option<Materials>,
    options: ShadingOptions,
    view: wgpu::Buffer,
    /// Samples in the sums.
    samples: u32,
    passes: u32,
}

/// The buffers and textures that have the size of the picture.
#[derive(Debug)]
struct Frame {
    gbuffer: GBuffer,
    sums: wgpu::Buffer,
    display: DisplayTexture,
}

impl Frame {
    fn new(context: &Context, size: [u32; 2]) -> Result<Self> {
        let gbuffer = GBuffer::new(context, size)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let bytes = size_of::<PixelSums>() as u64 * u64::from(size[0]) * u64::from(size[1]);
        let sums = context.empty_buffer("running sums of the picture", bytes, usage)?;
        Ok(Self { gbuffer, sums, display: DisplayTexture::new(context, size)? })
    }
}

/// Means of one pixel's samples, in linear RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinearPixel {
    /// Radiance of the truth where an object is; black elsewhere.
    pub truth: [f32; 3],
    /// Radiance of the prediction where an object is; black elsewhere.
    pub prediction: [f32; 3],
    /// Standard deviation of the prediction's target: the mean over the samples, weighted by reflected
    /// luminance.
    pub sigma: f32,
    /// The share of the pixel that objects cover, in `[0, 1]`.
    pub coverage: f32,
}

/// Means of a picture's samples.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearPicture {
    raster: Raster<LinearPixel>,
}

impl LinearPicture {
    /// The means of each pixel.
    #[must_use]
    pub fn raster(&self) -> &Raster<LinearPixel> {
        &self.raster
    }

    /// `exposure (prediction - truth)`, the mean of the channels, of every pixel: positive where the
    /// prediction is too bright. [`Show::Difference`](crate::Show::Difference) shows the same. An exposure of
    /// 1 gives the difference of radiance.
    #[must_use]
    pub fn difference(&self, exposure: f32) -> Vec<f32> {
        let mean_gap = |p: &LinearPixel| (0..3).map(|c| p.prediction[c] - p.truth[c]).sum::<f32>() / 3.0;
        self.raster.pixels().iter().map(|pixel| exposure * mean_gap(pixel)).collect()
    }

    /// Truth and prediction as images for the metrics of `gpbrdf-core`. Their masks hold the pixels that an
    /// object covers, wholly or in part.
    ///
    /// # Errors
    /// Those of [`Image::new`].
    pub fn images(&self) -> Result<(Image, Image)> {
        let mask: Vec<bool> = self.raster.pixels().iter().map(|pixel| pixel.coverage > 0.0).collect();
        let truth = Image::new(self.raster.map(|pixel| pixel.truth), mask.clone())?;
        Ok((truth, Image::new(self.raster.map(|pixel| pixel.prediction), mask)?))
    }
}

impl Renderer {
    /// A renderer of pictures of `size` columns and rows. The scene is the sphere, seen by the default
    /// camera, under [`Light::of_metrics`]; it has no material yet.
    ///
    /// # Errors
    /// [`crate::Error::Limit`] when the picture, which takes 72 bytes per pixel, is too large for the device,
    /// and those of [`Context::guard`].
    pub fn new(context: &Context, size: [u32; 2]) -> Result<Self> {
        let light = Light::of_metrics();
        Ok(Self {
            rasterizer: Rasterizer::new(context)?,
            shader: Shader::new(context)?,
            displayer: Displayer::new(context)?,
            frame: Frame::new(context, size)?,
            mesh: None,
            camera: Camera::default(),
            environment: EnvironmentBuffers::new(context, &light)?,
            black: EnvironmentBuffers::new(context, &light)?,
            ground: None,
            light,
            materials: None,
            options: ShadingOptions::default(),
            view: context.empty_buffer(
                "view",
                size_of::<View>() as u64,
                wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            )?,
            samples: 0,
            passes: 0,
            context: context.clone(),
        })
    }

    /// Columns and rows of the picture.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        self.frame.gbuffer.size()
    }

    /// Samples per pixel so far.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The light.
    #[must_use]
    pub fn light(&self) -> &Light {
        &self.light
    }

    /// The shading options.
    #[must_use]
    pub fn shading(&self) -> &ShadingOptions {
        &self.options
    }

    /// Starts the picture anew.
    pub fn restart(&mut self) {
        self.samples = 0;
        self.passes = 0;
    }

    /// Changes the size of the picture. On an error it stays as it was.
    ///
    /// # Errors
    /// Those of [`Renderer::new`].
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        if size != self.size() {
            self.frame = Frame::new(&self.context, size)?;
            self.restart();
        }
        Ok(())
    }

    /// Changes the object.
    ///
    /// # Errors
    /// Those of [`crate::Mesh::new`] and [`Context::guard`].
    pub fn set_geometry(&mut self, geometry: &Geometry) -> Result<()> {
        self.mesh = match geometry {
            Geometry::Sphere => None,
            Geometry::Mesh(mesh) => Some(MeshBuffers::new(&self.context, mesh)?),
        };
        self.restart();
        Ok(())
    }

    /// Changes the camera.
    ///
    /// # Errors
    /// Those of [`Camera::check`].
    pub fn set_camera(&mut self, camera: Camera) -> Result<()> {
        camera.check()?;
        if camera != self.camera {
            self.camera = camera;
            self.restart();
        }
        Ok(())
    }

    /// Changes the light.
    ///
    /// # Errors
    /// Those of [`Light::check`], [`crate::Error::Limit`] for a map too large for the device, and those of
    /// [`Context::guard`].
    pub fn set_light(&mut self, light: Light) -> Result<()> {
        light.check()?;
        if matches!(light, Light::Environment(_)) {
            self.environment = EnvironmentBuffers::new(&self.context, &light)?;
        }
        self.light = light;
        self.restart();
        Ok(())
    }

    /// Changes the ground that is seen behind the object, under an environment and with a perspective camera. It is
    /// part of the background, so samples are kept.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    pub fn set_ground(&mut self, ground: Option<&Ground>) -> Result<()> {
        self.ground = ground.map(|ground| GroundBuffer::new(&self.context, ground)).transpose()?;
        Ok(())
    }

    /// Changes the materials: a prediction, with its sigma in alpha, and a truth to compare it with, if there
    /// is one. The textures are shared, not copied; call this again after writing to them. Directions are drawn by what
    /// the materials reflect, for which they are read back: some 50 ms, in which this waits for the device.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    pub fn set_materials(&mut self, truth: Option<&BrdfTexture>, prediction: &BrdfTexture) -> Result<()> {
        let exact = self.options.exact_lookup;
        self.materials = Some(Materials::new(&self.context, &self.shader, truth, prediction, exact)?);
        self.restart();
        Ok(())
    }

    /// Changes the shading options.
    ///
    /// # Errors
    /// Those of [`ShadingOptions::check`] and [`Context::guard`].
    pub fn set_shading(&mut self, options: ShadingOptions) -> Result<()> {
        options.check()?;
        if options.exact_lookup != self.options.exact_lookup
            && let Some(materials) = &self.materials
        {
            let exact = options.exact_lookup;
            self.materials = Some(materials.looked_up(&self.context, &self.shader, exact)?);
        }
        if options != self.options {
            self.options = options;
            self.restart();
        }
        Ok(())
    }

    /// Adds samples to every pixel. Under a directional or a point light every sample is exact, and more of
    /// them only smooth edges. Returns as soon as the work is submitted; [`Renderer::wait`] waits for it.
    /// Does nothing without a material.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    pub fn render_more(&mut self, samples: u32) -> Result<()> {
        let mut left = samples.min((1 << 24) - self.samples);
        let per_pass = if matches!(self.light, Light::Environment(_)) { SAMPLES_PER_PASS } else { 1 };
        let binding = self.rasterizer.bind(&self.context, &self.view);
        let context = self.context.clone();
        context.guard("rendering", || {
            while left > 0 {
                let Some(materials) = &self.materials else { return };
                let count = left.min(per_pass);
                if self.samples == 0 {
                    self.clear_sums();
                }
                if self.samples == 0 || self.options.antialias {
                    self.rasterize(&binding);
                }
                let job = Job {
                    gbuffer: &self.frame.gbuffer,
                    sums: &self.frame.sums,
                    materials,
                    light: &self.light,
                    environment: &self.environment,
                    camera: &self.camera,
                    options: &self.options,
                    first_sample: self.samples,
                    sample_count: count,
                };
                self.shader.add(&self.context, &job);
                self.samples += count;
                self.passes += 1;
                left -= count;
            }
        })
    }

    /// Clears the running sums.
    fn clear_sums(&self) {
        let mut encoder = self.context.device().create_command_encoder(&Default::default());
        encoder.clear_buffer(&self.frame.sums, 0, None);
        self.context.queue().submit([encoder.finish()]);
    }

    /// Fills the G-buffer for the next pass. `binding` is that of `self.view`.
    fn rasterize(&self, binding: &wgpu::BindGroup) {
        let jitter = if self.options.antialias { jitter(self.passes).to_array() } else { [0.0; 2] };
        let view = view_of(&self.camera, self.size(), jitter);
        self.context.queue().write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
        let mut encoder = self.context.device().create_command_encoder(&Default::default());
        self.rasterizer.draw(&mut encoder, binding, self.mesh.as_ref(), &self.frame.gbuffer);
        self.context.queue().submit([encoder.finish()]);
    }

    /// Waits until the device has done all submitted work.
    ///
    /// # Errors
    /// Those of [`Context::wait`].
    pub fn wait(&self) -> Result<()> {
        self.context.wait("rendering")
    }

    /// Draws the picture and returns its texture, for a viewer to show: `rgba8unorm`, already encoded, with
    /// colours that are not multiplied by alpha. The view changes only with the size.
    ///
    /// # Errors
    /// Those of [`Display::check`] and [`Context::guard`].
    pub fn display(&mut self, display: &Display) -> Result<&wgpu::TextureView> {
        if self.samples == 0 {
            self.context.guard("rendering", || self.clear_sums())?;
        }
        let has_map = matches!(self.light, Light::Environment(_));
        let shown = Shown {
            sums: &self.frame.sums,
            samples: self.samples,
            view: view_of(&self.camera, self.size(), [0.0; 2]),
            map: if has_map { &self.environment } else { &self.black },
            has_map,
            ground: self.ground.as_ref(),
        };
        self.displayer.draw(&self.context, display, &shown, &self.frame.display)?;
        Ok(&self.frame.display.view)
    }

    /// Draws the picture and reads it back: RGBA, encoded, rows from top to bottom. Waits for the device.
    ///
    /// # Errors
    /// Those of [`Renderer::display`].
    pub fn read_display(&mut self, display: &Display) -> Result<Vec<[u8; 4]>> {
        self.display(display)?;
        self.frame.display.download(&self.context)
    }

    /// Reads back the means of the samples. Waits for the device.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    #[expect(clippy::cast_precision_loss, reason = "at most 2^24 samples")]
    pub fn read_linear(&self) -> Result<LinearPicture> {
        let [width, height] = self.size().map(|side| side as usize);
        let mut raster = Raster::filled(width, height, LinearPixel::default());
        if self.samples > 0 {
            let bytes = self.context.read_buffer(&self.frame.sums)?;
            let scale = 1.0 / self.samples as f32;
            let sums = bytes.chunks_exact(size_of::<PixelSums>());
            for (pixel, bytes) in raster.pixels_mut().iter_mut().zip(sums) {
                let sums: PixelSums = bytemuck::pod_read_unaligned(bytes);
                let light = narrow(luminance(&sums.prediction));
                *pixel = LinearPixel {
                    truth: sums.truth.map(|x| x * scale),
                    prediction: sums.prediction.map(|x| x * scale),
                    sigma: if light > 0.0 { sums.weighted_sigma / light } else { 0.0 },
                    coverage: (sums.hits * scale).min(1.0),
                };
            }
        }
        Ok(LinearPicture { raster })
    }

    /// The G-buffer of the latest pass.
    #[must_use]
    pub fn gbuffer(&self) -> &GBuffer {
        &self.frame.gbuffer
    }
}

/// How far pass `i` moves the picture, in pixels within `[-0.5, 0.5]`: an additive recurrence whose steps are
/// unrelated to those of the samples of light. The rays of the first pass go through the centres of pixels.
fn jitter(i: u32) -> Vec2 {
    // Reciprocals of the root of x^5 = x + 1 and of its square.
    let along = |step: f64| narrow((0.5 + f64::from(i) * step).fract() - 0.5);
    Vec2::new(along(0.856_674_883_854_503), along(0.733_891_856_627_126))
}
