//! `gpbrdf-cli render`: pictures of objects, without a window.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
use clap::{Args, ValueEnum};
use gpbrdf_core::{
    AtomicFile, BrdfTable, Colormap, Content, Panel, Picture, PixelDifference, Scale, SigmaTable, Source,
    exposure_of, panel_figure, psnr, round_limit, ssim, write_image_exr, write_rgba_png,
};
use gpbrdf_render::{
    AdapterChoice, Background, BrdfTexture, Camera, Context, Display, Geometry, Light, LinearPicture, Mesh,
    Precision, Projection, Renderer, Sampling, ShadingOptions, Show, ToneCurve, read_obj,
};
use serde_json::{Value, json};

use super::backend::{BackendArgs, Baked};
use super::input::{environment, open};
use super::model_args::ModelArgs;
use super::report::{Seconds, significant};
use super::terminal::Terminal;

/// Samples given to the device at a time.
const CHUNK: u32 = 16;

#[derive(Args, Debug)]
pub(crate) struct Render {
    /// A measurement, table or model file, or the name of a built-in material.
    #[arg(default_value = "cherry-235")]
    input: PathBuf,
    /// Picture to write: .png (as shown) or .exr (linear). May be repeated.
    #[arg(short, long, value_name = "FILE", default_value = "render.png")]
    output: Vec<PathBuf>,
    /// The object: sphere, knot, box, or a Wavefront .obj file.
    #[arg(long, value_name = "sphere|knot|box|FILE", default_value = "sphere")]
    scene: PathBuf,
    /// A single light instead of an environment.
    #[arg(long, value_enum, conflicts_with = "env")]
    light: Option<LightName>,
    /// Towards the directional light, or position of the point light (the object is in the unit sphere).
    #[arg(long, value_name = "X,Y,Z", default_value = "1,1,1.5", value_parser = parse_vector, allow_hyphen_values = true)]
    light_at: [f32; 3],
    /// Environment map: studio, or a latitude-longitude .hdr or .exr file. [default: studio]
    #[arg(long, value_name = "studio|FILE")]
    env: Option<PathBuf>,
    /// How directions of the environment's light are drawn: by the light, by the material, or by both.
    #[arg(long, value_enum, default_value = "mis")]
    sampling: SamplingName,
    /// Samples a pixel.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: u32,
    /// Columns and rows of the picture.
    #[arg(long, value_name = "WxH", default_value = "512x512", value_parser = parse_size)]
    size: [u32; 2],
    /// Turn of the camera to the right and up, degrees.
    #[arg(long, value_name = "AZIMUTH,ELEVATION", value_parser = parse_pair, allow_hyphen_values = true)]
    orbit: Option<[f32; 2]>,
    /// Parallel rays; a unit sphere touches the frame, as in the image metrics.
    #[arg(long)]
    orthographic: bool,
    /// Exposure in stops; auto brings the 90th percentile to 0.6.
    #[arg(long, value_name = "auto|STOPS", default_value = "auto", value_parser = parse_exposure, allow_hyphen_values = true)]
    exposure: Exposure,
    /// Tone curve.
    #[arg(long, value_enum, default_value = "filmic")]
    tone: ToneName,
    /// What the picture shows; the difference is prediction - truth in exposed linear light, red where too bright.
    #[arg(long, value_enum, default_value = "prediction")]
    show: ShowName,
    /// What is behind the object.
    #[arg(long, value_enum, default_value = "environment")]
    background: BackgroundName,
    /// End of the scale of false colours. [default: chosen by the values]
    #[arg(long, value_name = "VALUE", value_parser = parse_positive)]
    limit: Option<f32>,
    /// One picture of truth, prediction and difference, with PSNR and SSIM.
    #[arg(long, conflicts_with_all = ["show", "background"])]
    compare: bool,
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten)]
    backend: BackendArgs,
    /// Print JSON on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum LightName {
    Directional,
    Point,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum SamplingName {
    Light,
    Brdf,
    Mis,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ToneName {
    Clip,
    Reinhard,
    Filmic,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ShowName {
    Truth,
    Prediction,
    Sigma,
    Difference,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum BackgroundName {
    Environment,
    Black,
    Transparent,
}

#[derive(Clone, Copy, Debug)]
enum Exposure {
    Auto,
    Stops(f32),
}

fn parse_numbers<const N: usize>(text: &str) -> Option<[f32; N]> {
    let numbers: Vec<f32> = text
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|x: &f32| x.is_finite()))
        .collect::<Option<_>>()?;
    numbers.try_into().ok()
}

fn parse_vector(text: &str) -> Result<[f32; 3], String> {
    parse_numbers(text).ok_or_else(|| "expected three numbers like 1,1,1.5".into())
}

fn parse_pair(text: &str) -> Result<[f32; 2], String> {
    parse_numbers(text).ok_or_else(|| "expected two numbers like 30,20".into())
}

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let sides: Option<Vec<u32>> =
        text.split(['x', 'X']).map(|side| side.parse().ok().filter(|&n| n > 0)).collect();
    sides.and_then(|s| s.try_into().ok()).ok_or_else(|| "expected two positive numbers like 640x480".into())
}

fn parse_exposure(text: &str) -> Result<Exposure, String> {
    if text == "auto" {
        return Ok(Exposure::Auto);
    }
    match text.parse::<f32>() {
        Ok(stops) if stops.abs() <= 60.0 => Ok(Exposure::Stops(stops)),
        _ => Err("expected auto or a number of stops within -60 and 60".into()),
    }
}

fn parse_positive(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a positive number".into()),
    }
}

/// What is rendered with: tables of the truth, if there is one, and of the prediction.
struct Materials {
    truth: Option<BrdfTable>,
    prediction: Option<(BrdfTable, SigmaTable)>,
}

impl Render {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        for path in &self.output {
            if is_exr(path)? && self.compare {
                bail!("\"{}\": expected a .png file, as --compare makes a figure", path.display());
            }
        }
        let start = Instant::now();
        let mut seconds = Seconds::default();
        // What can fail at once comes first.
        let context = Context::open(AdapterChoice::Any)?;
        terminal.detail(&format!("adapter: {}", context.describe()));
        let mut renderer = Renderer::new(&context, self.size)?;
        let (geometry, camera) = self.scene()?;
        renderer.set_geometry(&geometry)?;
        renderer.set_camera(camera)?;
        renderer.set_light(self.light()?)?;
        renderer.set_shading(ShadingOptions {
            sampling: match self.sampling {
                SamplingName::Light => Sampling::Light,
                SamplingName::Brdf => Sampling::Brdf,
                SamplingName::Mis => Sampling::Both,
            },
            ..ShadingOptions::default()
        })?;
        let source = seconds.measure("load", || terminal.stage("reading", || open(&self.input)))?;
        let materials = self.materials(&source, &mut seconds, terminal)?;
        let upload = |table: &BrdfTable, sigma| BrdfTexture::upload(&context, table, sigma, Precision::Half);
        let truth = materials.truth.as_ref().map(|table| upload(table, None)).transpose()?;
        match (&materials.prediction, &truth) {
            (Some((table, sigma)), truth) => {
                renderer.set_materials(truth.as_ref(), &upload(table, Some(sigma))?)?;
            }
            (None, Some(truth)) => renderer.set_materials(None, truth)?,
            (None, None) => bail!("{}: nothing to render", source.origin()),
        }
        seconds.measure("render", || terminal.stage("rendering", || self.accumulate(&mut renderer)))?;
        let linear = renderer.read_linear()?;
        let (truth_image, predicted_image) = linear.images()?;
        let exposure = match self.exposure {
            Exposure::Auto => exposure_of(&truth_image),
            Exposure::Stops(stops) => f64::from(stops).exp2(),
        };
        let mut report = json!({
            "material": source.name,
            "scene": self.scene.display().to_string(),
            "width": linear.width,
            "height": linear.height,
            "spp": renderer.samples(),
            "adapter": context.describe(),
            "exposure": exposure,
        });
        let mut title = source.name.clone();
        if materials.truth.is_some() && materials.prediction.is_some() {
            let psnr = psnr(&truth_image, &predicted_image, exposure)?;
            let ssim = ssim(&truth_image, &predicted_image, exposure)?;
            let difference = PixelDifference::new(&truth_image, &predicted_image)?;
            title.push_str(&format!("   PSNR {psnr:.1} dB   SSIM {ssim:.4}"));
            report["psnr"] = if psnr.is_finite() { json!(psnr) } else { json!(psnr.to_string()) };
            report["ssim"] = json!(ssim);
            report["pixel_difference"] = serde_json::to_value(difference)?;
        }
        let mut files = Vec::new();
        for path in &self.output {
            let mut file = AtomicFile::create(path)?;
            self.write(&mut file, path, &mut renderer, &linear, exposure, &title)
                .with_context(|| format!("cannot write \"{}\"", path.display()))?;
            files.push(file);
        }
        AtomicFile::commit_all(files)?;
        seconds.add("total", start);
        report["seconds"] = serde_json::to_value(&seconds)?;
        report["outputs"] = self.output.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().into();
        self.say(&report, terminal)
    }

    fn say(&self, report: &Value, terminal: &Terminal) -> Result<()> {
        if self.json {
            return terminal.print(&format!("{}\n", serde_json::to_string_pretty(report)?));
        }
        if let (Some(psnr), Some(ssim)) = (report["psnr"].as_f64(), report["ssim"].as_f64()) {
            terminal.summary(&format!("PSNR {} dB, SSIM {}", significant(psnr), significant(ssim)))?;
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
            _ if self.scene.exists()
                || self.scene.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")) =>
            {
                (Geometry::Mesh(read_obj(&self.scene)?), [0.0, 10.0])
            }
            _ => bail!(
                "--scene: expected sphere, knot, box or an .obj file, found \"{}\"",
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

    fn light(&self) -> Result<Light> {
        let at = self.light_at.into();
        Ok(match self.light {
            // Irradiance pi: a white Lambertian surface that faces the light has radiance 1.
            Some(LightName::Directional) => {
                Light::Directional { direction: at, irradiance: [std::f32::consts::PI; 3] }
            }
            Some(LightName::Point) => Light::Point { position: at, intensity: [std::f32::consts::PI; 3] },
            None => {
                let file = self.env.as_deref().filter(|path| *path != Path::new("studio"));
                Light::Environment((&environment(file)?).into())
            }
        })
    }

    fn materials(&self, source: &Source, seconds: &mut Seconds, terminal: &Terminal) -> Result<Materials> {
        let is_model = matches!(source.content, Content::Model(_));
        let (needs_truth, needs_prediction) = match self.show {
            _ if self.compare => (true, true),
            ShowName::Truth => (true, false),
            ShowName::Prediction | ShowName::Sigma => (false, true),
            ShowName::Difference => (true, true),
        };
        let truth = match source.table() {
            Some(table) if needs_truth && !is_model => Some(table.into_owned()),
            _ if needs_truth => {
                bail!("{}: expected a source with a truth to compare with, found none", source.origin())
            }
            _ => None,
        };
        let prediction = if !needs_prediction {
            None
        } else if let Content::Model(model) = &source.content {
            Some(self.backend.bake(model, true, seconds, terminal)?)
        } else {
            let (model, _) = self.model.sample_and_fit(source, seconds, terminal)?;
            Some(self.backend.bake(&model, true, seconds, terminal)?)
        };
        let prediction = match prediction {
            Some(Baked { mean, sigma: Some(sigma), .. }) => Some((mean, sigma)),
            _ => None,
        };
        Ok(Materials { truth, prediction })
    }

    fn accumulate(&self, renderer: &mut Renderer) -> Result<()> {
        while renderer.samples() < self.spp {
            renderer.render_more(CHUNK.min(self.spp - renderer.samples()))?;
            renderer.wait()?;
        }
        Ok(())
    }

    fn write(
        &self,
        file: &mut AtomicFile,
        path: &Path,
        renderer: &mut Renderer,
        linear: &LinearPicture,
        exposure: f64,
        title: &str,
    ) -> Result<()> {
        if is_exr(path)? {
            let grey = |values: &[f32]| values.iter().map(|&x| [f64::from(x); 3]).collect();
            let colour = |pixels: &[[f32; 3]]| pixels.iter().map(|p| p.map(f64::from)).collect();
            let pixels: Vec<[f64; 3]> = match self.show {
                ShowName::Truth => colour(&linear.truth),
                ShowName::Prediction => colour(&linear.prediction),
                ShowName::Sigma => grey(&linear.sigma),
                ShowName::Difference => grey(&linear.difference(1.0)),
            };
            return Ok(write_image_exr(file, linear.width, linear.height, &pixels)?);
        }
        #[expect(clippy::cast_possible_truncation, reason = "single precision is the shader's")]
        let display = Display {
            exposure: exposure as f32,
            tone: match self.tone {
                ToneName::Clip => ToneCurve::Clip,
                ToneName::Reinhard => ToneCurve::Reinhard,
                ToneName::Filmic => ToneCurve::Filmic,
            },
            background: match self.background {
                BackgroundName::Environment => Background::Environment,
                BackgroundName::Black => Background::Black,
                BackgroundName::Transparent => Background::Transparent,
            },
            ..Display::default()
        };
        if self.compare {
            let shown = [ShowName::Truth, ShowName::Prediction, ShowName::Difference];
            let panels = shown
                .map(|show| self.panel(show, renderer, linear, display))
                .into_iter()
                .collect::<Result<Vec<_>>>()?;
            let note = "difference: prediction - truth, linear, mean of R, G, B; 1 = white";
            return Ok(panel_figure(title, &panels, note).write_png(file)?);
        }
        match self.show {
            ShowName::Sigma | ShowName::Difference => {
                let panel = self.panel(self.show, renderer, linear, display)?;
                let note = if self.show == ShowName::Sigma {
                    "weighted by reflected light"
                } else {
                    "prediction - truth, linear, mean of R, G, B; 1 = white"
                };
                Ok(panel_figure(title, &[panel], note).write_png(file)?)
            }
            ShowName::Truth | ShowName::Prediction => {
                let show = if self.show == ShowName::Truth { Show::Truth } else { Show::Prediction };
                let pixels = renderer.read_display(&Display { show, ..display })?;
                if self.background == BackgroundName::Transparent {
                    write_rgba_png(file, linear.width, linear.height, &pixels)?;
                } else {
                    picture(linear, &pixels).write_png(file)?;
                }
                Ok(file.flush()?)
            }
        }
    }

    /// What is shown, with its scale where colours are false.
    fn panel(
        &self,
        show: ShowName,
        renderer: &mut Renderer,
        linear: &LinearPicture,
        display: Display,
    ) -> Result<Panel> {
        let mask: Vec<bool> = linear.coverage.iter().map(|&c| c == 1.0).collect();
        let limit_of = |values: Vec<f32>| {
            let wide: Vec<f64> = values.into_iter().map(f64::from).collect();
            self.limit.map_or_else(|| round_limit(&wide, &mask), f64::from)
        };
        let (caption, mode, scale) = match show {
            ShowName::Truth => ("truth", Show::Truth, None),
            ShowName::Prediction => ("prediction", Show::Prediction, None),
            ShowName::Sigma => {
                let high = limit_of(linear.sigma.clone());
                ("sigma", Show::Sigma, Some(Scale { map: Colormap::Sequential, low: 0.0, high }))
            }
            ShowName::Difference => {
                let high = limit_of(linear.difference(display.exposure));
                ("difference", Show::Difference, Some(Scale { map: Colormap::Diverging, low: -high, high }))
            }
        };
        #[expect(clippy::cast_possible_truncation, reason = "single precision is the shader's")]
        let limit = scale.map(|scale| scale.high as f32);
        let pixels = renderer.read_display(&Display { show: mode, limit, ..display })?;
        Ok(Panel { picture: picture(linear, &pixels), caption, scale })
    }
}

fn picture(linear: &LinearPicture, pixels: &[[u8; 4]]) -> Picture {
    Picture::from_fn(linear.width, linear.height, |x, y| {
        let [r, g, b, _] = pixels[y * linear.width + x];
        [r, g, b]
    })
}

fn is_exr(path: &Path) -> Result<bool> {
    match path.extension() {
        Some(png) if png.eq_ignore_ascii_case("png") => Ok(false),
        Some(exr) if exr.eq_ignore_ascii_case("exr") => Ok(true),
        _ => bail!("\"{}\": expected a name that ends in .png or .exr", path.display()),
    }
}
