//! `gpbrdf-cli render`: pictures of objects, without a window.

mod choices;
mod pictures;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use clap::{Args, value_parser};
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::base::number::significant;
use gpbrdf_core::judge::{PixelDifference, exposure_of, psnr, ssim};
use gpbrdf_core::{BrdfTable, Content, Environment, Source};
use gpbrdf_render::{
    AdapterChoice, BrdfTexture, Camera, Context, Display, EnvironmentLight, Geometry, Light, LinearPicture,
    Mesh, Precision, Projection, Renderer, ShadingOptions, read_mesh,
};
use serde_json::{Value, json};

use super::figure_args::{FigureSize, PictureFile, title};
use super::input::{environment, open};
use super::json::to_json;
use super::parse::{Exposure, parse_exposure, parse_pair, parse_positive, parse_size, parse_vector};
use super::reading::Reading;
use super::terminal::Terminal;
use crate::job::{Backend, Baked, Baking, Job, ModelSpec, Observer, Run, Stage};
use choices::{BackgroundName, LightName, SamplingName, ShowName, ToneName};
use pictures::Pictures;

/// Samples given to the device at a time.
const CHUNK: u32 = 16;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli render purple-paint --scene knot --compare -o knot.png",
    "\n  gpbrdf-cli render model.safetensors --scene bunny.obj --env studio.hdr --spp 256",
))]
pub(crate) struct Render {
    /// A measurement, table or model file, the name of a built-in material, or - for measured samples from
    /// standard input.
    #[arg(default_value = "cherry-235")]
    input: PathBuf,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    model: ModelSpec,
    /// Picture to write: .png as shown, .svg or .pdf with a title, or linear .exr. May be repeated.
    #[arg(help_heading = "Output", short, long, value_name = "FILE", default_value = "render.png")]
    output: Vec<PathBuf>,
    /// The object: sphere, knot, box, or a mesh: Wavefront .obj, glTF .glb or .gltf.
    #[arg(help_heading = "Scene", long, value_name = "sphere|knot|box|FILE", default_value = "sphere")]
    scene: PathBuf,
    /// A single light instead of an environment.
    #[arg(help_heading = "Scene", long, value_enum, conflicts_with = "env")]
    light: Option<LightName>,
    /// Direction towards the directional light, or position of the point light; the object fills the unit
    /// sphere.
    #[arg(
        help_heading = "Scene",
        long,
        value_name = "X,Y,Z",
        default_value = "1,1,1.5",
        value_parser = parse_vector,
        allow_hyphen_values = true
    )]
    light_at: [f32; 3],
    /// Environment map: studio, or a latitude-longitude .hdr or .exr file. [default: studio]
    #[arg(help_heading = "Scene", long, value_name = "studio|FILE")]
    env: Option<PathBuf>,
    /// How directions of the environment's light are drawn: by the light, by the material, or by both.
    #[arg(help_heading = "Scene", long, value_enum, default_value = "mis")]
    sampling: SamplingName,
    /// Samples per pixel.
    #[arg(help_heading = "Scene", long, value_name = "N", default_value_t = 64)]
    #[arg(value_parser = value_parser!(u32).range(1..=1 << 20))]
    spp: u32,
    /// Columns and rows of the picture.
    #[arg(help_heading = "Scene", long, value_name = "WxH", default_value = "512x512", value_parser = parse_size)]
    size: [u32; 2],
    /// Turn of the camera to the right and up, degrees.
    #[arg(help_heading = "Scene", long, value_name = "AZIMUTH,ELEVATION")]
    #[arg(value_parser = parse_pair, allow_hyphen_values = true)]
    orbit: Option<[f32; 2]>,
    /// Parallel rays; a unit sphere touches the frame, as in the image metrics.
    #[arg(help_heading = "Scene", long)]
    orthographic: bool,
    /// Exposure in stops; auto brings the 90th percentile to 0.6.
    #[arg(
        help_heading = "Output",
        long,
        value_name = "auto|STOPS",
        default_value = "auto",
        value_parser = parse_exposure,
        allow_hyphen_values = true
    )]
    exposure: Exposure,
    /// Tone curve.
    #[arg(help_heading = "Output", long, value_enum, default_value = "filmic")]
    tone: ToneName,
    /// What the picture shows; the difference is prediction - truth in exposed linear light, red where too
    /// bright.
    #[arg(help_heading = "Output", long, value_enum, default_value = "prediction")]
    show: ShowName,
    /// What is behind the object.
    #[arg(help_heading = "Output", long, value_enum, default_value = "environment")]
    background: BackgroundName,
    /// End of the scale of false colours. [default: chosen by the values]
    #[arg(help_heading = "Output", long, value_name = "VALUE", value_parser = parse_positive)]
    limit: Option<f32>,
    /// One picture of truth, prediction and difference, with PSNR and SSIM.
    #[arg(help_heading = "Output", long, conflicts_with_all = ["show", "background"])]
    compare: bool,
    /// Where to bake.
    #[arg(help_heading = "Output", long, value_enum, default_value_t)]
    backend: Backend,
    #[command(flatten)]
    figure_size: FigureSize,
    /// Print JSON on standard output, and nothing else there.
    #[arg(help_heading = "Output", long)]
    json: bool,
}

/// What is rendered with: the tables of the truth and of the prediction, as far as they are shown.
struct Materials {
    title: String,
    truth: Option<BrdfTable>,
    prediction: Option<Baked>,
}

/// A picture that has been rendered.
struct Rendered {
    linear: LinearPicture,
    exposure: f64,
    title: String,
    report: Value,
}

impl Render {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        for path in &self.output {
            if PictureFile::of(path)? == PictureFile::Exr && self.compare {
                bail!("\"{}\": expected .png, .svg or .pdf, as --compare makes a figure", path.display());
            }
        }
        let mut run = Run::new(terminal.clone());
        // Whatever can fail at once comes first, and files before the device, whose driver takes time and memory.
        let (geometry, camera) = self.scene()?;
        let map = self.light.is_none().then(|| self.map()).transpose()?;
        let context = Context::open(AdapterChoice::Any)?;
        terminal.detail(&format!("adapter: {}", context.describe()));
        let mut renderer = Renderer::new(&context, self.size)?;
        renderer.set_geometry(&geometry)?;
        renderer.set_camera(camera)?;
        renderer.set_light(self.light(&context, map.as_ref(), terminal)?)?;
        let sampling = self.sampling.into();
        renderer.set_shading(ShadingOptions { sampling, ..ShadingOptions::default() })?;
        drop((geometry, map));
        let source = run.stage(Stage::Load, || open(&self.input, self.reading, terminal))?;
        let materials = self.materials(&source, &mut run)?;
        set_materials(&mut renderer, &context, &source, &materials)?;
        run.stage(Stage::Render, || self.accumulate(&mut renderer))?;
        let rendered = self.rendered(&source, &materials, &context, &renderer)?;
        self.write(&mut renderer, &rendered)?;
        let mut report = rendered.report;
        report["seconds"] = serde_json::to_value(run.seconds())?;
        report["outputs"] =
            self.output.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().into();
        self.say(&report, terminal)
    }

    /// Reads the picture back, and compares prediction and truth where both are there.
    fn rendered(
        &self,
        source: &Source,
        materials: &Materials,
        context: &Context,
        renderer: &Renderer,
    ) -> Result<Rendered> {
        let linear = renderer.read_linear()?;
        let (truth, prediction) = linear.images()?;
        let exposure = match self.exposure {
            Exposure::Auto => exposure_of(&truth),
            Exposure::Stops(stops) => f64::from(stops).exp2(),
        };
        let mut report = json!({
            "material": source.name,
            "scene": self.scene.display().to_string(),
            "width": linear.raster().width(),
            "height": linear.raster().height(),
            "spp": renderer.samples(),
            "adapter": context.describe(),
            "exposure": exposure,
        });
        let mut title = materials.title.clone();
        if materials.truth.is_some() && materials.prediction.is_some() {
            let psnr = psnr(&truth, &prediction, exposure)?;
            let ssim = ssim(&truth, &prediction, exposure)?;
            let difference = PixelDifference::new(&truth, &prediction)?;
            title.push_str(&format!(", PSNR {psnr:.1} dB, SSIM {ssim:.4}"));
            report["psnr"] = if psnr.is_finite() { json!(psnr) } else { json!(psnr.to_string()) };
            report["ssim"] = json!(ssim);
            report["pixel_difference"] = serde_json::to_value(difference)?;
        }
        Ok(Rendered { linear, exposure, title, report })
    }

    /// Writes all outputs or none.
    fn write(&self, renderer: &mut Renderer, rendered: &Rendered) -> Result<()> {
        #[expect(clippy::cast_possible_truncation, reason = "shaders compute in single precision")]
        let display = Display {
            exposure: rendered.exposure as f32,
            tone: self.tone.into(),
            background: self.background.into(),
            ..Display::default()
        };
        let (linear, title) = (&rendered.linear, rendered.title.as_str());
        let figures = self.figure_size.into();
        let mut pictures = Pictures { renderer, linear, display, limit: self.limit, title, figures };
        let mut files = Vec::new();
        for path in &self.output {
            let mut file = AtomicFile::create(path)?;
            let written = match PictureFile::of(path)? {
                PictureFile::Exr => pictures.write_exr(&mut file, self.show),
                PictureFile::Figure(format) if self.compare => pictures.write_comparison(&mut file, format),
                PictureFile::Figure(format) => pictures.write_figure(&mut file, self.show, format),
            };
            written.with_context(|| format!("cannot write \"{}\"", path.display()))?;
            files.push(file);
        }
        Ok(AtomicFile::commit_all(files)?)
    }

    fn say(&self, report: &Value, terminal: &Terminal) -> Result<()> {
        if self.json {
            return terminal.print(&to_json(report)?);
        }
        if let (Some(psnr), Some(ssim)) = (report["psnr"].as_f64(), report["ssim"].as_f64()) {
            terminal.summary(&format!("PSNR {} dB, SSIM {}", significant(psnr, 4), significant(ssim, 4)))?;
        }
        for path in &self.output {
            terminal.summary(&format!("wrote {}", path.display()))?;
        }
        Ok(())
    }

    fn scene(&self) -> Result<(Geometry, Camera)> {
        let (geometry, orbit) = match self.scene.to_str() {
            Some("sphere") => (Geometry::Sphere, [0.0, 0.0]),
            Some("knot") => (Geometry::Mesh(Mesh::knot()), [8.0, -10.0]),
            Some("box") => (Geometry::Mesh(Mesh::rounded_box()), [-33.0, 28.0]),
            // A name with an ending stands for a file, also for one that is missing.
            _ if self.scene.exists() || self.scene.extension().is_some() => {
                (Geometry::Mesh(read_mesh(&self.scene)?), [0.0, 10.0])
            }
            _ => bail!(
                "--scene: expected sphere, knot, box or a mesh file, found \"{}\"",
                self.scene.display()
            ),
        };
        let camera = if self.orthographic { Camera::default() } else { Camera::perspective(0.55, 0.88) };
        let [azimuth, elevation] = match (self.orbit, camera.projection) {
            (Some(orbit), _) => orbit,
            (None, Projection::Orthographic { .. }) => [0.0; 2],
            (None, Projection::Perspective { .. }) => orbit,
        };
        Ok((geometry, camera.orbited(azimuth.to_radians(), elevation.to_radians())))
    }

    /// The environment map.
    fn map(&self) -> Result<Environment> {
        environment(self.env.as_deref().filter(|path| *path != Path::new("studio")))
    }

    /// The light that is chosen, or that of the map.
    fn light(&self, context: &Context, map: Option<&Environment>, terminal: &Terminal) -> Result<Light> {
        let at = self.light_at.into();
        Ok(match (self.light, map) {
            (Some(LightName::Point), _) => {
                Light::Point { position: at, intensity: [std::f32::consts::PI; 3] }
            }
            (None, Some(environment)) => {
                let light = EnvironmentLight::for_device(context, environment)?;
                let size = |width: usize, height: usize| format!("{width} x {height}");
                let (given, used) = (environment.raster(), light.texels());
                if given.width() != used.width() {
                    terminal.note(&format!(
                        "the environment map of {} pixels is averaged to {} for the device",
                        size(given.width(), given.height()),
                        size(used.width(), used.height())
                    ));
                }
                Light::Environment(light)
            }
            // Irradiance pi: a white Lambertian surface that faces the light has radiance 1.
            (Some(LightName::Directional), _) | (None, None) => {
                Light::Directional { direction: at, irradiance: [std::f32::consts::PI; 3] }
            }
        })
    }

    /// The tables that are shown, fitted and baked as far as need be.
    fn materials(&self, source: &Source, run: &mut Run) -> Result<Materials> {
        let is_model = matches!(source.content, Content::Model(_));
        let (needs_truth, needs_prediction) = match self.show {
            _ if self.compare => (true, true),
            ShowName::Truth => (true, false),
            ShowName::Prediction | ShowName::Sigma => (false, true),
            ShowName::Difference => (true, true),
        };
        let truth = match source.table() {
            Ok(table) if needs_truth && !is_model => Some(table.into_owned()),
            _ if needs_truth => {
                bail!("{}: expected a source with a truth to compare with, found none", source.origin())
            }
            _ => None,
        };
        let (mut prediction, mut name) = (None, source.name.clone());
        if needs_prediction {
            if !is_model {
                self.model.check(source)?;
            }
            let baking = Some(Baking { backend: self.backend, sigma: true });
            let job = Job { keep_model: true, baking, ..Job::new(source, &self.model) };
            let outcome = run.job(&job)?;
            name = title(&source.name, &outcome.fitted.model);
            prediction = outcome.baked;
        }
        Ok(Materials { title: name, truth, prediction })
    }

    fn accumulate(&self, renderer: &mut Renderer) -> Result<()> {
        while renderer.samples() < self.spp {
            renderer.render_more(CHUNK.min(self.spp - renderer.samples()))?;
            renderer.wait()?;
        }
        Ok(())
    }
}

/// Hands the tables to the renderer.
fn set_materials(
    renderer: &mut Renderer,
    context: &Context,
    source: &Source,
    materials: &Materials,
) -> Result<()> {
    let upload = |table: &BrdfTable, sigma| BrdfTexture::upload(context, table, sigma, Precision::Half);
    let truth = materials.truth.as_ref().map(|table| upload(table, None)).transpose()?;
    match (&materials.prediction, &truth) {
        (Some(baked), truth) => {
            let prediction = upload(&baked.mean, baked.sigma.as_deref())?;
            renderer.set_materials(truth.as_ref(), &prediction)?;
        }
        (None, Some(truth)) => renderer.set_materials(None, truth)?,
        (None, None) => bail!("{}: nothing to render", source.origin()),
    }
    Ok(())
}
