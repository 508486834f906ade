//! Pictures of a sphere as `render` shows it: drawn on a device where there is one, else on the processor, by
//! importance sampling on both.

use std::f64::consts::{PI, TAU};

use anyhow::Result;
use gpbrdf_core::base::{Raster, SplitMix64, quasi_random_pair};
use gpbrdf_core::figure::{Colormap, Figure, Panel, Picture, Rgb8, Scale, round_limit};
use gpbrdf_core::judge::{Image, ShadingFrame, exposed_difference, exposure_of};
use gpbrdf_core::nalgebra::Vector3;
use gpbrdf_core::{BrdfTable, Environment, Material, MaterialOptions, Rgb, SigmaTable};
use gpbrdf_render::{
    AdapterChoice, BrdfTexture, Camera, Context, EnvironmentLight, Light, LinearPixel, Precision, Projection,
    Renderer,
};
use rayon::prelude::*;

use super::backend::Backend;
use super::run::Observer;

/// Rows and columns of the picture.
const SIZE: usize = 512;
/// Samples of a pixel on a device, and how many of them are handed over at a time.
const DEVICE_SAMPLES: u32 = 128;
const CHUNK: u32 = 32;
/// Rays through a pixel on the processor; each is lit from two directions.
const RAYS: usize = 16;
/// Angle of view in radians, and the part of the frame that the sphere takes: those of `render`.
const VIEW: f32 = 0.55;
const FILL: f32 = 0.88;
/// What is shown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Subject<'a> {
    /// Of what material the figure is, and out of what its prediction was made.
    pub(crate) title: &'a str,
    pub(crate) truth: Option<&'a BrdfTable>,
    pub(crate) mean: &'a BrdfTable,
    pub(crate) sigma: Option<&'a SigmaTable>,
    /// The PSNR of the image metrics, if it is known.
    pub(crate) psnr: Option<f64>,
}

/// Truth and prediction, shaded.
#[derive(Debug)]
pub(crate) struct Portrait<'a> {
    subject: Subject<'a>,
    environment: &'a Environment,
    pixels: Raster<LinearPixel>,
    exposure: f64,
}

impl<'a> Portrait<'a> {
    /// Shades truth and prediction, or the prediction alone if there is no truth.
    ///
    /// # Errors
    /// A table with values that are not finite.
    pub(crate) fn new(
        subject: &Subject<'a>,
        environment: &'a Environment,
        backend: Backend,
        observer: &dyn Observer,
    ) -> Result<Self> {
        let device = if backend == Backend::Cpu { None } else { Context::open(AdapterChoice::Hardware).ok() };
        let drawn = device.and_then(|context| match on_device(&context, subject, environment) {
            Ok(pixels) => Some(pixels),
            Err(error) => {
                observer.detail(&format!("drawing the sphere on the CPU: {error}"));
                None
            }
        });
        let pixels = match drawn {
            Some(pixels) => pixels,
            None => on_processor(subject, environment)?,
        };
        Self::of(subject, environment, pixels)
    }

    fn of(subject: &Subject<'a>, environment: &'a Environment, pixels: Raster<LinearPixel>) -> Result<Self> {
        let mask = pixels.pixels().iter().map(|pixel| pixel.coverage > 0.0).collect();
        let reference = |p: &LinearPixel| if subject.truth.is_some() { p.truth } else { p.prediction };
        let exposure = exposure_of(&Image::new(pixels.map(reference), mask)?);
        Ok(Self { subject: *subject, environment, pixels, exposure })
    }

    /// The truth as it is shown.
    pub(crate) fn truth(&self) -> Picture {
        shown(&self.pixels, self.environment, self.exposure, |p| p.truth)
    }

    /// The prediction as it is shown, with the exposure of the truth if there is one.
    pub(crate) fn prediction(&self) -> Picture {
        shown(&self.pixels, self.environment, self.exposure, |p| p.prediction)
    }

    /// Truth, prediction and difference side by side, or the prediction alone.
    pub(crate) fn figure(&self) -> Figure {
        let (subject, pixels) = (&self.subject, &self.pixels);
        let mut title = subject.title.to_owned();
        if subject.truth.is_none() {
            return Figure::of_panels(title, vec![Panel::picture("prediction", self.prediction())], "");
        }
        if let Some(psnr) = subject.psnr {
            title.push_str(&format!(", PSNR {psnr:.1} dB"));
        }
        let wide = |rgb: [f32; 3]| rgb.map(f64::from);
        let gap = |p: &LinearPixel| exposed_difference(wide(p.prediction), wide(p.truth), self.exposure);
        let gaps: Vec<f64> = pixels.pixels().iter().map(gap).collect();
        let inside: Vec<bool> = pixels.pixels().iter().map(|pixel| pixel.coverage == 1.0).collect();
        let limit = round_limit(&gaps, &inside);
        let colours = Picture::from_fn(pixels.width(), pixels.height(), |x, y| {
            let i = y * pixels.width() + x;
            let colour = Colormap::Diverging.at(0.5 + 0.5 * gaps[i] / limit);
            mixed([255; 3], colour, f64::from(pixels.pixels()[i].coverage))
        });
        let panels = vec![
            Panel::picture("truth", self.truth()),
            Panel::picture("prediction", self.prediction()),
            Panel::scaled("difference", colours, Scale::signed(limit)),
        ];
        let note = "Difference: prediction − truth in linear light, mean of R, G and B; 1 is white.";
        Figure::of_panels(title, panels, note)
    }
}

fn camera() -> Camera {
    Camera::perspective(VIEW, FILL)
}

fn on_device(
    context: &Context,
    subject: &Subject<'_>,
    environment: &Environment,
) -> gpbrdf_render::Result<Raster<LinearPixel>> {
    let side = u32::try_from(SIZE).unwrap_or(u32::MAX);
    let mut renderer = Renderer::new(context, [side; 2])?;
    renderer.set_camera(camera())?;
    renderer.set_light(Light::Environment(EnvironmentLight::for_device(context, environment)?))?;
    let upload = |table: &BrdfTable, sigma| BrdfTexture::upload(context, table, sigma, Precision::Half);
    let truth = subject.truth.map(|table| upload(table, None)).transpose()?;
    renderer.set_materials(truth.as_ref(), &upload(subject.mean, subject.sigma)?)?;
    while renderer.samples() < DEVICE_SAMPLES {
        renderer.render_more(CHUNK)?;
        renderer.wait()?;
    }
    Ok(renderer.read_linear()?.raster().clone())
}

/// An environment map from which directions are drawn by their luminance.
struct Lamp(EnvironmentLight);

impl Lamp {
    /// Radiance and, last, density in 1/sr from a direction.
    fn from(&self, [u, v]: [f64; 2]) -> [f64; 4] {
        let texels = self.0.texels();
        self.texel(index(u, texels.width()), index(v, texels.height()))
    }

    fn texel(&self, column: usize, row: usize) -> [f64; 4] {
        self.0.texels().at(column, row).map(f64::from)
    }

    /// A direction by two random numbers, with its radiance and density.
    fn draw(&self, [a, b]: [f64; 2]) -> (Vector3<f64>, [f64; 4]) {
        let (width, height) = (self.0.texels().width(), self.0.texels().height());
        let shares = self.0.cumulative();
        let (row, down) = find(&shares[..=height], a);
        let (column, across) = find(&shares[height + 1 + row * (width + 1)..][..=width], b);
        let edge = |i: usize| (PI * i as f64 / height as f64).cos();
        let cosine = edge(row) + down * (edge(row + 1) - edge(row));
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let azimuth = TAU * ((column as f64 + across) / width as f64 - 0.5);
        (Vector3::new(sine * azimuth.sin(), cosine, -sine * azimuth.cos()), self.texel(column, row))
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "t is in [0, 1]")]
fn index(t: f64, count: usize) -> usize {
    ((t * count as f64) as usize).min(count.saturating_sub(1))
}

/// The step of running shares in which a number is, and where in it.
fn find(shares: &[f32], at: f64) -> (usize, f64) {
    let step = shares.partition_point(|&share| f64::from(share) <= at).clamp(1, shares.len() - 1) - 1;
    let (low, high) = (f64::from(shares[step]), f64::from(shares[step + 1]));
    (step, if high > low { ((at - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 })
}

/// A ray through a pixel at `(x, y)` of the frame, each from -1 to 1: its direction.
fn ray(camera: &Camera, [x, y]: [f64; 2]) -> Vector3<f64> {
    let (across, up) = camera.half_extents(1.0);
    Vector3::new(x * f64::from(across), y * f64::from(up), -1.0).normalize()
}

/// Where a ray from the eye meets the unit sphere, which is the normal there, too.
fn meet(distance: f64, direction: &Vector3<f64>) -> Option<Vector3<f64>> {
    let eye = Vector3::new(0.0, 0.0, distance);
    let along = -eye.dot(direction);
    let square = along * along - (distance * distance - 1.0);
    (square > 0.0).then(|| eye + (along - square.sqrt()) * direction)
}

fn on_processor(subject: &Subject<'_>, environment: &Environment) -> Result<Raster<LinearPixel>> {
    let camera = camera();
    debug_assert!(matches!(camera.projection, Projection::Perspective { .. }), "rays start at the eye");
    let distance = f64::from(camera.eye.z);
    let lamp = Lamp(EnvironmentLight::new(environment));
    let tables: Vec<&BrdfTable> = std::iter::once(subject.mean).chain(subject.truth).collect();
    let drawn = subject.truth.unwrap_or(subject.mean);
    let material = Material::new(drawn.clone(), &MaterialOptions { energy_conserving: false })?;
    let pixels: Vec<LinearPixel> = (0..SIZE * SIZE)
        .into_par_iter()
        .map(|i| {
            let mut random = SplitMix64::stream(1, i as u64);
            // Each pixel has a shift of its own for the place of its rays, for the lamp and for the material.
            let shifts: [[f64; 2]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| random.next_unit()));
            let mut sums = vec![[0.0; 3]; tables.len()];
            let mut hits = 0.0;
            for k in 0..RAYS {
                let [within, by_lamp, by_material] = shifts.map(|shift| quasi_random_pair(shift, k));
                let corner = [(i % SIZE) as f64, (i / SIZE) as f64];
                let place: [f64; 2] =
                    std::array::from_fn(|j| 2.0 * (corner[j] + within[j]) / SIZE as f64 - 1.0);
                let direction = ray(&camera, [place[0], -place[1]]);
                let Some(normal) = meet(distance, &direction) else { continue };
                hits += 1.0;
                let Some(frame) = ShadingFrame::new(&normal, &-direction, 0.0) else { continue };
                light(&frame, &lamp, &material, &tables, [by_lamp, by_material], &mut sums);
            }
            let mean =
                |sum: Option<&Rgb>| sum.map_or([0.0; 3], |sum| sum.map(|x| single(x / f64::max(hits, 1.0))));
            LinearPixel {
                prediction: mean(sums.first()),
                truth: mean(sums.get(1).or(sums.first())),
                sigma: 0.0,
                coverage: single(hits / RAYS as f64),
            }
        })
        .collect();
    Ok(Raster::new(SIZE, SIZE, pixels)?)
}

/// Adds the light from a direction drawn by the lamp and from one drawn by the material, with the balance heuristic of
/// E. Veach and L. Guibas, "Optimally Combining Sampling Techniques for Monte Carlo Rendering" (1995).
fn light(
    frame: &ShadingFrame,
    lamp: &Lamp,
    material: &Material,
    tables: &[&BrdfTable],
    [by_lamp, by_material]: [[f64; 2]; 2],
    sums: &mut [Rgb],
) {
    let mut add = |w: &Vector3<f64>, [r, g, b, lamp_density]: [f64; 4], material_density: f64| {
        let density = lamp_density + material_density;
        if density > 0.0 {
            frame.add_light(tables, w, [r, g, b].map(|x| x / density), sums);
        }
    };
    let (w, texel) = lamp.draw(by_lamp);
    if let Some((wi, wo)) = frame.directions(&w) {
        add(&w, texel, f64::from(material.pdf(wi.map(single).into(), wo.map(single).into())));
    }
    let wo = frame.to_viewer();
    let [a, b] = by_material.map(single);
    if let Some(drawn) = material.sample(wo.map(single).into(), a, b) {
        let w = frame.to_world(&Vector3::from(drawn.wi.map(f64::from)));
        add(&w, lamp.from(Environment::coordinates(&w)), f64::from(drawn.pdf));
    }
}

/// A picture of the sphere in front of the environment, with the tone curve of `render`.
fn shown(
    pixels: &Raster<LinearPixel>,
    environment: &Environment,
    exposure: f64,
    of: fn(&LinearPixel) -> [f32; 3],
) -> Picture {
    let camera = camera();
    let (width, height) = (pixels.width(), pixels.height());
    Picture::from_fn(width, height, |x, y| {
        let pixel = pixels.at(x, y);
        let place =
            [2.0 * (x as f64 + 0.5) / width as f64 - 1.0, 1.0 - 2.0 * (y as f64 + 0.5) / height as f64];
        let around = environment.interpolated(Environment::coordinates(&ray(&camera, place)));
        let [inside, around] = [of(pixel).map(f64::from), around].map(|rgb| encoded(rgb, exposure));
        mixed(around, inside, f64::from(pixel.coverage))
    })
}

/// A radiance as it is shown: K. Narkowicz's fit (2015) to the curve of the Academy Color Encoding System, scaled to
/// keep middle grey, and a gamma of 2.2.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255.5")]
fn encoded(radiance: Rgb, exposure: f64) -> Rgb8 {
    radiance.map(|x| {
        let y = (0.8 * exposure * x).clamp(0.0, 1e4);
        let linear = (y * (2.51 * y + 0.03) / (y * (2.43 * y + 0.59) + 0.14)).clamp(0.0, 1.0);
        (255.0 * linear.powf(1.0 / 2.2) + 0.5) as u8
    })
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a mean of two u8 is one")]
fn mixed(around: Rgb8, inside: Rgb8, coverage: f64) -> Rgb8 {
    std::array::from_fn(|c| {
        (coverage * f64::from(inside[c]) + (1.0 - coverage) * f64::from(around[c]) + 0.5) as u8
    })
}

#[expect(clippy::cast_possible_truncation, reason = "single precision is that of materials and pictures")]
fn single(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use gpbrdf_core::Source;

    fn table(name: &str) -> BrdfTable {
        Source::built_in(name).unwrap().table().unwrap().into_owned()
    }

    fn subject<'a>(truth: Option<&'a BrdfTable>, mean: &'a BrdfTable) -> Subject<'a> {
        Subject { title: "t", truth, mean, sigma: None, psnr: None }
    }

    #[test]
    fn a_white_furnace_shows_the_albedo_everywhere() {
        let albedo: f64 = 0.5;
        let mean = BrdfTable::from_fn(|_| [albedo / PI; 3]);
        let white = Environment::new(Raster::filled(16, 8, [2.0; 3])).unwrap();
        let pixels = on_processor(&subject(None, &mean), &white).unwrap();
        let inside: Vec<f64> = pixels
            .pixels()
            .iter()
            .filter(|pixel| pixel.coverage == 1.0)
            .map(|pixel| f64::from(pixel.prediction[1]))
            .collect();
        let average = inside.iter().sum::<f64>() / inside.len() as f64;
        assert!((average / (2.0 * albedo) - 1.0).abs() < 2e-3, "{average}");
        let covered = inside.len() as f64 / (SIZE * SIZE) as f64;
        let expected = 0.25 * PI * f64::from(FILL).powi(2);
        assert!((covered / expected - 1.0).abs() < 0.02, "{covered} {expected}");
    }

    /// The renderer on a device is another program for the same picture.
    #[test]
    fn the_processor_draws_what_a_device_draws() {
        let Ok(context) = Context::open(AdapterChoice::Any) else {
            assert!(std::env::var("GPBRDF_REQUIRE_GPU").is_err(), "no graphics adapter");
            eprintln!("skipped: no graphics adapter");
            return;
        };
        let (truth, mean) = (table("red-plastic"), table("silver-paint"));
        let studio = Environment::studio();
        let subject = subject(Some(&truth), &mean);
        let device = on_device(&context, &subject, &studio).unwrap();
        let processor = on_processor(&subject, &studio).unwrap();
        for (which, of) in [("truth", of_truth as Channels), ("prediction", of_prediction)] {
            let (a, b) = (tiles(&device, of), tiles(&processor, of));
            let mask = vec![true; device.pixels().len()];
            let exposure = exposure_of(&Image::new(device.map(of), mask).unwrap());
            let squares = std::iter::zip(&a, &b).map(|(a, b)| (exposure * (a - b)).powi(2));
            let gap = (squares.sum::<f64>() / a.len() as f64).sqrt();
            // What is left is noise: a tile has 256 pixels, and a pixel an error of a few hundredths.
            assert!(gap < 0.01 && a.len() > 300, "{which}: {gap} over {} tiles", a.len());
            let sum = |tiles: &[f64]| tiles.iter().sum::<f64>();
            assert!((sum(&a) / sum(&b) - 1.0).abs() < 0.005, "{which}: {} {}", sum(&a), sum(&b));
        }
    }

    type Channels = fn(&LinearPixel) -> [f32; 3];

    fn of_truth(pixel: &LinearPixel) -> [f32; 3] {
        pixel.truth
    }

    fn of_prediction(pixel: &LinearPixel) -> [f32; 3] {
        pixel.prediction
    }

    /// Means of the green channel over tiles of 16 x 16 pixels that are wholly on the sphere.
    fn tiles(pixels: &Raster<LinearPixel>, of: Channels) -> Vec<f64> {
        const SIDE: usize = 16;
        let of_tile = |tile: usize| {
            let (left, top) = (tile % (SIZE / SIDE) * SIDE, tile / (SIZE / SIDE) * SIDE);
            let within = (0..SIDE * SIDE).map(|i| pixels.at(left + i % SIDE, top + i / SIDE));
            let covered = within.clone().all(|pixel| pixel.coverage == 1.0);
            covered.then(|| within.map(|pixel| f64::from(of(pixel)[1])).sum::<f64>() / (SIDE * SIDE) as f64)
        };
        (0..(SIZE / SIDE).pow(2)).filter_map(of_tile).collect()
    }

    #[test]
    fn figures_have_a_panel_for_each_picture() {
        let mean = table("lambert");
        let studio = Environment::studio();
        for (truth, panels) in [(None, 1), (Some(&mean), 3)] {
            let subject = Subject { psnr: Some(30.0), ..subject(truth, &mean) };
            let pixels = on_processor(&subject, &studio).unwrap();
            let figure = Portrait::of(&subject, &studio, pixels).unwrap().figure();
            assert_eq!(figure.rows[0].panels.len(), panels);
            assert_eq!(figure.title.contains("30.0 dB"), panels == 3);
        }
    }
}
