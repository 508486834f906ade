//! The renderer of scenes, for a viewer and for files.

use glam::Vec2;
use gpbrdf_core::Image;

use crate::camera::Camera;
use crate::context::Context;
use crate::display::{Display, DisplayTexture, Displayer};
use crate::error::Result;
use crate::gbuffer::{GBuffer, Geometry, MeshBuffers, Rasterizer, view_of};
use crate::gpu_types::View;
use crate::light::Light;
use crate::shade::{EnvironmentBuffers, Job, Materials, Shader, ShadingOptions};
use crate::texture::BrdfTexture;

/// Samples that share one move of the picture by parts of a pixel.
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
/// Whatever changes the picture starts it anew; what is shown, and how, does not. The result depends on the number of
/// samples and on nothing else, so pictures repeat. There are no shadows, and light is reflected once.
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
    materials: Option<Materials>,
    options: ShadingOptions,
    view: wgpu::Buffer,
    /// Samples in the sums.
    samples: u32,
    passes: u32,
}

/// What has the size of the picture.
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
        let bytes = 32 * u64::from(size[0]) * u64::from(size[1]);
        let sums = context.empty_buffer("running sums of the picture", bytes, usage)?;
        Ok(Self { gbuffer, sums, display: DisplayTexture::new(context, size)? })
    }
}

/// Means of a picture's samples, in linear RGB; rows from top to bottom.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearPicture {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Radiance of the truth where there is an object; black elsewhere.
    pub truth: Vec<[f32; 3]>,
    /// Radiance of the prediction where there is an object; black elsewhere.
    pub prediction: Vec<[f32; 3]>,
    /// Standard deviation of the prediction's target, weighted by reflected luminance.
    pub sigma: Vec<f32>,
    /// The share of each pixel that objects cover, in `[0, 1]`.
    pub coverage: Vec<f32>,
}

impl LinearPicture {
    /// The paper's pixel difference `1 - b / a` of the means over R, G and B; 0 where the truth is black.
    #[must_use]
    pub fn difference(&self) -> Vec<f32> {
        let sum = |p: &[f32; 3]| p[0] + p[1] + p[2];
        let pairs = self.truth.iter().zip(&self.prediction).map(|(a, b)| (sum(a), sum(b)));
        pairs.map(|(a, b)| if a > 0.0 { 1.0 - b / a } else { 0.0 }).collect()
    }

    /// Truth and prediction as images of the core, for its metrics; pixels count where anything is covered.
    ///
    /// # Errors
    /// Those of [`Image::new`].
    pub fn images(&self) -> Result<(Image, Image)> {
        let mask: Vec<bool> = self.coverage.iter().map(|&share| share > 0.0).collect();
        let image = |pixels: &[[f32; 3]]| Image::new(self.width, self.height, pixels.to_vec(), mask.clone());
        Ok((image(&self.truth)?, image(&self.prediction)?))
    }
}

impl Renderer {
    /// A renderer of pictures of `size` columns and rows: the sphere, seen by the default camera under
    /// [`Light::of_metrics`], of no material yet.
    ///
    /// # Errors
    /// [`crate::Error::Limit`] over what the device takes (72 bytes a pixel), and those of [`Context::guard`].
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

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        self.frame.gbuffer.size()
    }

    /// Samples a pixel so far.
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

    /// How the scene is shaded.
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

    /// Changes the materials: a prediction, with its sigma in alpha, and the truth beside it if there is one. The textures
    /// are shared, not copied; call this again after writing to them.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    pub fn set_materials(&mut self, truth: Option<&BrdfTexture>, prediction: &BrdfTexture) -> Result<()> {
        self.materials = Some(Materials::new(&self.context, truth, prediction, self.options.exact_lookup)?);
        self.restart();
        Ok(())
    }

    /// Changes how the scene is shaded.
    ///
    /// # Errors
    /// Those of [`ShadingOptions::check`] and [`Context::guard`].
    pub fn set_shading(&mut self, options: ShadingOptions) -> Result<()> {
        options.check()?;
        if options.exact_lookup != self.options.exact_lookup
            && let Some(materials) = &self.materials
        {
            let (truth, prediction) = materials.textures();
            self.materials = Some(Materials::new(&self.context, truth, prediction, options.exact_lookup)?);
        }
        if options != self.options {
            self.options = options;
            self.restart();
        }
        Ok(())
    }

    /// Adds samples to every pixel. Under a directional or a point light a sample is exact, and more of them only smooth
    /// edges. Returns as soon as the device has the work; [`Renderer::wait`] waits for it. Does nothing without a material.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    pub fn render_more(&mut self, samples: u32) -> Result<()> {
        let Some(materials) = &self.materials else { return Ok(()) };
        let mut left = samples.min((1 << 24) - self.samples);
        let per_pass = if matches!(self.light, Light::Environment(_)) { SAMPLES_PER_PASS } else { 1 };
        let binding = self.rasterizer.bind(&self.context, &self.view);
        self.context.guard("rendering", || {
            while left > 0 {
                let count = left.min(per_pass);
                if self.samples == 0 || self.options.antialias {
                    let jitter =
                        if self.options.antialias { jitter(self.passes).to_array() } else { [0.0; 2] };
                    let view = view_of(&self.camera, self.frame.gbuffer.size(), jitter);
                    self.context.queue().write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
                    let mut encoder = self.context.device().create_command_encoder(&Default::default());
                    if self.samples == 0 {
                        encoder.clear_buffer(&self.frame.sums, 0, None);
                    }
                    self.rasterizer.draw(&mut encoder, &binding, self.mesh.as_ref(), &self.frame.gbuffer);
                    self.context.queue().submit([encoder.finish()]);
                }
                self.shader.add(
                    &self.context,
                    &Job {
                        gbuffer: &self.frame.gbuffer,
                        sums: &self.frame.sums,
                        materials,
                        light: &self.light,
                        environment: &self.environment,
                        camera: &self.camera,
                        options: &self.options,
                        first_sample: self.samples,
                        sample_count: count,
                    },
                );
                self.samples += count;
                self.passes += 1;
                left -= count;
            }
        })
    }

    /// Waits until the device has done what it was given.
    ///
    /// # Errors
    /// Those of [`Context::wait`].
    pub fn wait(&self) -> Result<()> {
        self.context.wait("rendering")
    }

    /// Draws the picture and returns the texture it is on, for a viewer to show: `rgba8unorm`, encoded already, alpha not
    /// multiplied in. The view changes only with the size.
    ///
    /// # Errors
    /// [`crate::Error::InvalidArgument`] unless exposure and limit are positive, and those of [`Context::guard`].
    pub fn display(&mut self, display: &Display) -> Result<&wgpu::TextureView> {
        if self.samples == 0 {
            self.context.guard("rendering", || {
                let mut encoder = self.context.device().create_command_encoder(&Default::default());
                encoder.clear_buffer(&self.frame.sums, 0, None);
                self.context.queue().submit([encoder.finish()]);
            })?;
        }
        let environment = matches!(self.light, Light::Environment(_)).then_some(&self.environment);
        let view = view_of(&self.camera, self.size(), [0.0; 2]);
        self.displayer.draw(
            &self.context,
            display,
            &self.frame.sums,
            self.samples,
            &view,
            environment,
            &self.black,
            &self.frame.display,
        )?;
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
        let pixels = width * height;
        let mut picture = LinearPicture {
            width,
            height,
            truth: Vec::with_capacity(pixels),
            prediction: Vec::with_capacity(pixels),
            sigma: Vec::with_capacity(pixels),
            coverage: Vec::with_capacity(pixels),
        };
        if self.samples == 0 {
            picture.truth.resize(pixels, [0.0; 3]);
            picture.prediction.resize(pixels, [0.0; 3]);
            picture.sigma.resize(pixels, 0.0);
            picture.coverage.resize(pixels, 0.0);
            return Ok(picture);
        }
        let bytes = self.context.read_buffer(&self.frame.sums)?;
        let scale = 1.0 / self.samples as f32;
        for sums in bytes.chunks_exact(32).map(bytemuck::pod_read_unaligned::<[[f32; 4]; 2]>).take(pixels) {
            let [[ar, ag, ab, hits], [br, bg, bb, weighted]] = sums;
            picture.truth.push([ar, ag, ab].map(|x| x * scale));
            picture.prediction.push([br, bg, bb].map(|x| x * scale));
            let luminance = 0.2126 * br + 0.7152 * bg + 0.0722 * bb;
            picture.sigma.push(if luminance > 0.0 { weighted / luminance } else { 0.0 });
            picture.coverage.push((hits * scale).min(1.0));
        }
        Ok(picture)
    }

    /// The G-buffer of the latest pass.
    #[must_use]
    pub fn gbuffer(&self) -> &GBuffer {
        &self.frame.gbuffer
    }
}

/// How far pass `i` moves the picture, in pixels within `[-0.5, 0.5]`: an additive recurrence whose steps have nothing in
/// common with those of the light's samples. The first pass goes through the middles.
#[expect(clippy::cast_possible_truncation, reason = "parts of a pixel")]
fn jitter(i: u32) -> Vec2 {
    // Reciprocals of the root of x^5 = x + 1 and of its square.
    let along = |step: f64| ((0.5 + f64::from(i) * step).fract() - 0.5) as f32;
    Vec2::new(along(0.856_674_883_854_503), along(0.733_891_856_627_126))
}
