//! Objects lit on a graphics device, progressively, by a thread that serves the newest request. A small picture of
//! many samples comes first, then the whole one once it is smooth enough to take its place.
//!
//! It uses a second device. On the window's device, long dispatches would delay presentation, and wgpu cannot
//! configure a surface while another thread submits work.

use std::f64::consts::TAU;
use std::sync::Arc;
use std::time::Duration;

use eframe::egui::{Color32, ColorImage};
use glam::Vec3;
use gpbrdf_core::base::Raster;
use gpbrdf_core::figure::round_limit;
use gpbrdf_core::nalgebra::Vector3;
use gpbrdf_core::{BrdfTable, Environment, SigmaTable};
use gpbrdf_render::{
    AdapterChoice, Background, BrdfTexture, Camera, Context, Display, EnvironmentLight, Geometry, Ground,
    Light, LinearPicture, LinearPixel, Mesh, Precision, Renderer, Show, ToneCurve, read_mesh,
};
use rayon::prelude::*;

use super::grain::without_grain;
use super::mailbox::{Mailbox, Sender};
use super::outbox::Outbox;
use super::quality::{Measured, Measurer, Quality};
use crate::viewer::state::document::DocumentId;
use crate::viewer::state::look::{Orbit, Shape, SphereLight, SphereShown};
use crate::viewer::state::messages::naming;

impl Shape {
    fn geometry(&self) -> Result<Geometry, String> {
        Ok(match self {
            Self::Sphere => Geometry::Sphere,
            Self::Knot => Geometry::Mesh(Mesh::knot()),
            Self::RoundedBox => Geometry::Mesh(Mesh::rounded_box()),
            Self::File(path) => Geometry::Mesh(read_mesh(path).map_err(|error| naming(path, &error))?),
        })
    }
}

/// What a picture depends on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SceneKey {
    pub(crate) document: DocumentId,
    pub(crate) version: u64,
    pub(crate) truth_is_tabulated: bool,
    pub(crate) has_sigma: bool,
    pub(crate) shape: Shape,
    pub(crate) orbit: Orbit,
    pub(crate) light: SphereLight,
    pub(crate) environment: u64,
    /// Whether the environment is the built-in studio.
    pub(crate) studio: bool,
    /// Pixels of one picture; there are two of this size side by side.
    pub(crate) size: [u32; 2],
    pub(crate) shown: SphereShown,
    pub(crate) swipe: f32,
}

impl SceneKey {
    /// Whether another scene has the same exposure: the eye may be elsewhere, and the model another one.
    fn has_exposure_of(&self, other: &Self) -> bool {
        self.document == other.document
            && self.truth_is_tabulated == other.truth_is_tabulated
            && self.shape == other.shape
            && self.environment == other.environment
            && self.light.is_like(&other.light)
    }

    /// The factor of the exposure that the user has set.
    fn stops(&self) -> f32 {
        to_f32(self.light.exposure.exp2())
    }

    /// The camera. The sphere looks the same from everywhere; its eye stays before the light, a little above the
    /// ground.
    fn camera(&self) -> Camera {
        let (orbit, camera) = (self.orbit, Camera::perspective(0.6, 0.82));
        let camera = if self.shape == Shape::Sphere {
            camera.orbited(0.0, SPHERE_ELEVATION)
        } else {
            camera.orbited(orbit.azimuth, orbit.elevation)
        };
        camera.zoomed(orbit.zoom)
    }

    /// Whether truth and prediction are two whole pictures.
    fn is_pair(&self) -> bool {
        self.truth_is_tabulated && self.shown == SphereShown::SideBySide
    }

    /// What each picture shows; the second one is only made side by side.
    fn show(&self) -> [Show; 2] {
        let first = match self.shown {
            SphereShown::Difference if self.truth_is_tabulated => Show::Difference,
            SphereShown::Sigma => Show::Sigma,
            SphereShown::Swipe if self.truth_is_tabulated => Show::Split { at: self.swipe },
            SphereShown::SideBySide if self.truth_is_tabulated => Show::Truth,
            _ => Show::Prediction,
        };
        [first, Show::Prediction]
    }
}

/// What the thread is told.
#[derive(Clone, Debug)]
pub(crate) enum SceneWork {
    /// Open the device and compile the shaders, which takes as long as a fit.
    Prepare,
    Picture(Box<SceneRequest>),
}

/// A picture to make.
#[derive(Clone, Debug)]
pub(crate) struct SceneRequest {
    /// A number that no earlier request had.
    pub(crate) number: u64,
    pub(crate) key: SceneKey,
    pub(crate) truth: Option<Arc<BrdfTable>>,
    pub(crate) mean: Arc<BrdfTable>,
    pub(crate) sigma: Option<Arc<BrdfTable>>,
    pub(crate) environment: Arc<Environment>,
}

/// What the thread sends.
#[derive(Clone, Debug)]
pub(crate) enum SceneResult {
    Picture(Box<SceneImage>),
    Quality(Quality),
    /// The whole picture once it is smooth, for files.
    Whole(Box<Whole>),
    /// The object cannot be shown: its file is broken or the device refuses.
    Failed(String),
    /// The device was lost, and another one is opened.
    DeviceLost(String),
}

/// A picture of an object.
#[derive(Clone, Debug)]
pub(crate) struct SceneImage {
    pub(crate) document: DocumentId,
    /// The number of the request.
    pub(crate) request: u64,
    /// A number that stays while this picture gets smoother, and that no other picture has.
    pub(crate) picture: u64,
    pub(crate) image: ColorImage,
    /// The picture of the prediction, where `image` shows the truth alone.
    pub(crate) beside: Option<ColorImage>,
    /// Samples of each pixel of the window's picture; `None` for a small picture that stands for it.
    pub(crate) samples: Option<u32>,
    /// Whether no smoother one follows.
    pub(crate) is_last: bool,
    pub(crate) limits: Limits,
}

/// The ends of the scales of false colours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Limits {
    pub(crate) difference: f32,
    pub(crate) sigma: f32,
}

/// A smooth picture, as shown and as numbers.
#[derive(Clone, Debug)]
pub(crate) struct Whole {
    pub(crate) document: DocumentId,
    /// The number of the picture.
    pub(crate) picture: u64,
    pub(crate) truth: Option<ColorImage>,
    pub(crate) prediction: ColorImage,
    pub(crate) difference: Option<ColorImage>,
    pub(crate) limits: Limits,
    pub(crate) linear: Arc<LinearPicture>,
}

/// The most pixels of a picture where the processor does the device's work; the window enlarges it.
const SOFTWARE_PIXELS: f64 = 320_000.0;

/// How high the eye is that sees the sphere, radians.
const SPHERE_ELEVATION: f32 = 0.2;

/// Directions of the light on the ground: in the small picture, and in the whole one.
const GROUND_AT_FIRST: usize = 48;
const GROUND_DIRECTIONS: usize = 320;

/// The height of a unit direction from which on the studio is sky.
const STUDIO_HORIZON: f32 = 0.08;

/// Samples of a smooth picture.
const SAMPLES: u32 = 192;
/// Samples of a picture that replaces the small one.
const FIRST_SAMPLES: u32 = 16;
/// The small picture has this share of the pixels along each side, and so many samples.
const SMALL: u32 = 3;
const SMALL_SAMPLES: u32 = 24;

/// Why there is no picture, with a message.
enum Stop {
    /// The device was lost. Another one may do.
    Lost(String),
    /// The file of the object cannot be read. Nothing is wrong with the device.
    File(String),
    Error(String),
}

impl From<gpbrdf_render::Error> for Stop {
    fn from(error: gpbrdf_render::Error) -> Self {
        let lost = matches!(error, gpbrdf_render::Error::Lost { .. });
        if lost { Self::Lost(error.to_string()) } else { Self::Error(error.to_string()) }
    }
}

/// Starts the thread that renders, on `context` or else on a device that it opens. Beyond the first pictures
/// it waits while the fitter is `busy`.
pub(crate) fn spawn(
    outbox: Outbox<SceneResult>,
    context: Option<Context>,
    busy: impl Fn() -> bool + Send + Sync + 'static,
) -> std::io::Result<Sender<SceneWork>> {
    // The shared pool may be busy with a fit for seconds.
    let pool = rayon::ThreadPoolBuilder::new().build().map_err(std::io::Error::other)?;
    let measurer = Measurer::spawn(outbox.map(SceneResult::Quality))?;
    let mut scene = Scene {
        context,
        renderer: None,
        materials: None,
        last: None,
        geometry: Geometry::Sphere,
        turned: None,
        ground: 0,
        picture: 0,
        exposure: None,
        limits: Limits::default(),
        handed: 0,
        measurer,
    };
    let mut serve = move |work: SceneWork, stale: &(dyn Fn() -> bool + Sync)| {
        let SceneWork::Picture(request) = work else {
            // What goes wrong is found again, and told, with the first picture.
            if scene.warm_up().is_err() {
                scene.clear();
            }
            return;
        };
        let mut result = scene.render(&request, &outbox, stale, &busy);
        if let Err(Stop::Lost(message)) = &result {
            let name = scene.context.as_ref().map_or_else(String::new, |c| c.info().name.clone());
            scene.drop_device();
            outbox
                .send(SceneResult::DeviceLost(format!("the graphics device \"{name}\" is lost: {message}")));
            result = scene.render(&request, &outbox, stale, &busy);
        }
        match result {
            Ok(()) => {}
            // Shaders stay compiled, which takes as long as a fit.
            Err(Stop::File(message)) => outbox.send(SceneResult::Failed(message)),
            Err(Stop::Lost(message) | Stop::Error(message)) => {
                scene.clear();
                outbox.send(SceneResult::Failed(message));
            }
        }
    };
    Mailbox::spawn("scene", move |work: SceneWork, stale| pool.install(|| serve(work, stale)))
}

struct Scene {
    context: Option<Context>,
    renderer: Option<Renderer>,
    materials: Option<Materials>,
    last: Option<SceneKey>,
    geometry: Geometry,
    /// The environment as it is turned; `None` under a point light.
    turned: Option<Environment>,
    /// Directions of the ground's light.
    ground: usize,
    picture: u64,
    /// The exposure that was found for a scene, which it keeps while the eye moves.
    exposure: Option<(SceneKey, f32)>,
    limits: Limits,
    /// The smooth picture that was last handed out.
    handed: u64,
    measurer: Measurer,
}

/// BRDFs on the device.
struct Materials {
    /// The truth of this document.
    truth: Option<(DocumentId, BrdfTexture)>,
    /// The result of this version, and whether its texture holds sigma.
    prediction: (u64, bool, BrdfTexture),
}

impl Scene {
    /// Drops everything that is on the device, which may be in any state.
    fn clear(&mut self) {
        (self.renderer, self.materials, self.last) = (None, None, None);
    }

    /// Drops the device too, after its loss.
    fn drop_device(&mut self) {
        self.clear();
        self.context = None;
    }

    /// The context and the renderer, which are opened and made where there are none.
    fn renderer(&mut self, size: [u32; 2]) -> Result<(Context, &mut Renderer), Stop> {
        let context = match &self.context {
            Some(context) => context.clone(),
            None => self.context.insert(Context::open(AdapterChoice::Any)?).clone(),
        };
        let renderer = match &mut self.renderer {
            Some(renderer) => renderer,
            none => none.insert(Renderer::new(&context, size)?),
        };
        Ok((context, renderer))
    }

    /// Columns and rows of the picture of a request.
    fn size_of(&self, key: &SceneKey) -> [u32; 2] {
        let pixels: f64 = key.size.map(f64::from).iter().product();
        if pixels <= SOFTWARE_PIXELS || self.context.as_ref().is_none_or(Context::is_hardware) {
            return key.size;
        }
        let factor = (SOFTWARE_PIXELS / pixels).sqrt();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "smaller than it was")]
        key.size.map(|side| (f64::from(side) * factor).max(16.0) as u32)
    }

    /// Takes a picture of a few pixels, for which drivers compile all shaders.
    fn warm_up(&mut self) -> Result<(), Stop> {
        let (context, renderer) = self.renderer([16, 16])?;
        let black = BrdfTexture::empty(&context, Precision::Half)?;
        renderer.set_materials(Some(&black), &black)?;
        renderer.set_light(Light::Environment((&Environment::studio()).into()))?;
        renderer.render_more(1)?;
        renderer.read_display(&Display::default())?;
        Ok(())
    }

    fn render(
        &mut self,
        request: &SceneRequest,
        outbox: &Outbox<SceneResult>,
        stale: &(dyn Fn() -> bool + Sync),
        busy: &dyn Fn() -> bool,
    ) -> Result<(), Stop> {
        let key = &request.key;
        self.prepare(request)?;
        let size = self.size_of(key);
        let Some(renderer) = &mut self.renderer else { return Ok(()) };
        if renderer.samples() == 0 {
            renderer.resize(size.map(|side| (side / SMALL).max(16)))?;
            renderer.render_more(SMALL_SAMPLES)?;
            let linear = renderer.read_linear()?;
            let known = self.exposure.take().filter(|(last, _)| last.has_exposure_of(key));
            let found = || {
                let most = self.turned.as_ref().map_or(f32::INFINITY, most_exposure);
                automatic_exposure(linear.raster().pixels()).min(most)
            };
            let exposure = known.map_or_else(found, |(_, exposure)| exposure);
            self.exposure = Some((key.clone(), exposure));
            self.limits = limits(&linear, exposure * key.stops());
            let mut small = self.image(request, None)?;
            if !matches!(key.show()[0], Show::Difference | Show::Sigma) {
                let inside: Vec<bool> = linear.raster().pixels().iter().map(is_inside).collect();
                small.image = without_grain(&small.image, &inside);
                small.beside = small.beside.map(|beside| without_grain(&beside, &inside));
            }
            outbox.send(SceneResult::Picture(Box::new(small)));
        }
        if stale() {
            return Ok(());
        }
        let mut step = 1;
        loop {
            let Some(renderer) = &mut self.renderer else { return Ok(()) };
            renderer.resize(size)?;
            renderer.render_more(step.min(SAMPLES.saturating_sub(renderer.samples())))?;
            let samples = renderer.samples();
            if samples >= FIRST_SAMPLES {
                if let Some(map) = self.turned.as_ref().filter(|_| self.ground == GROUND_AT_FIRST) {
                    self.ground = GROUND_DIRECTIONS;
                    renderer.set_ground(Some(&ground(&self.geometry, map, key, self.ground)))?;
                }
                outbox.send(SceneResult::Picture(Box::new(self.image(request, Some(samples))?)));
                self.measure(request, samples, outbox)?;
            } else {
                renderer.wait()?;
            }
            let is_last = samples >= SAMPLES;
            while !is_last && busy() && !stale() {
                std::thread::sleep(Duration::from_millis(5));
            }
            if is_last || stale() {
                return Ok(());
            }
            step = (step * 2).min(8);
        }
    }

    /// The picture as it is; `samples` is `None` for a small one.
    fn image(&mut self, request: &SceneRequest, samples: Option<u32>) -> Result<SceneImage, Stop> {
        let key = &request.key;
        let [first, second] = key.show();
        let image = self.shown(key, first)?;
        let beside = if key.is_pair() { Some(self.shown(key, second)?) } else { None };
        Ok(SceneImage {
            document: key.document,
            request: request.number,
            picture: self.picture,
            image,
            beside,
            samples,
            is_last: samples >= Some(SAMPLES),
            limits: self.limits,
        })
    }

    /// What is shown of a scene, in colour.
    fn shown(&mut self, key: &SceneKey, show: Show) -> Result<ColorImage, Stop> {
        let exposure = self.exposure.as_ref().map_or(1.0, |(_, exposure)| *exposure);
        let limit = if show == Show::Sigma { self.limits.sigma } else { self.limits.difference };
        let Some(renderer) = &mut self.renderer else { return Ok(ColorImage::default()) };
        let display = Display {
            show,
            exposure: (exposure * key.stops()).clamp(1e-9, 1e9),
            tone: ToneCurve::Filmic,
            background: if key.light.point { Background::Black } else { Background::Environment },
            limit: Some(limit.max(1e-6)),
            ..Display::default()
        };
        let pixels = renderer.read_display(&display)?;
        let pixels = pixels.into_iter().map(|[r, g, b, _]| Color32::from_rgb(r, g, b)).collect();
        Ok(ColorImage::new(renderer.size().map(|side| side as usize), pixels))
    }

    /// Has truth and prediction compared now and then, and hands out the smooth picture.
    fn measure(
        &mut self,
        request: &SceneRequest,
        samples: u32,
        outbox: &Outbox<SceneResult>,
    ) -> Result<(), Stop> {
        let key = &request.key;
        let (document, picture, is_last) = (key.document, self.picture, samples >= SAMPLES);
        let compared = key.truth_is_tabulated && self.measurer.wants(picture, samples, is_last);
        let wanted = compared || (is_last && self.handed != picture);
        let Some(renderer) = self.renderer.as_ref().filter(|_| wanted) else { return Ok(()) };
        let linear = Arc::new(renderer.read_linear()?);
        if compared {
            self.measurer.put(Measured { document, picture, samples, linear: Arc::clone(&linear) });
        }
        if is_last && self.handed != picture {
            self.handed = picture;
            let mut truth = None;
            let mut difference = None;
            if key.truth_is_tabulated {
                truth = Some(self.shown(key, Show::Truth)?);
                difference = Some(self.shown(key, Show::Difference)?);
            }
            let prediction = self.shown(key, Show::Prediction)?;
            let limits = self.limits;
            let whole = Whole { document, picture, truth, prediction, difference, limits, linear };
            outbox.send(SceneResult::Whole(Box::new(whole)));
        }
        Ok(())
    }

    /// Hands the renderer what has changed.
    fn prepare(&mut self, request: &SceneRequest) -> Result<(), Stop> {
        let key = &request.key;
        let (context, _) = self.renderer(key.size)?;
        self.set_materials(&context, request)?;
        let size = self.size_of(key);
        let Some(renderer) = &mut self.renderer else { return Ok(()) };
        let last = self.last.take();
        let changed = |same: &dyn Fn(&SceneKey) -> bool| last.as_ref().is_none_or(|last| !same(last));
        if changed(&|l| l.shape == key.shape) {
            self.geometry = key.shape.geometry().map_err(Stop::File)?;
            renderer.set_geometry(&self.geometry)?;
        }
        if changed(&|l| l.size == key.size) {
            renderer.restart();
        }
        if changed(&|l| l.orbit == key.orbit) || changed(&|l| l.shape == key.shape) {
            renderer.set_camera(key.camera())?;
        }
        // A point light moves with the eye.
        let same_light = |l: &SceneKey| l.light.is_like(&key.light) && l.environment == key.environment;
        if changed(&|l| same_light(l) && (!key.light.point || l.camera() == key.camera())) {
            let turned = turned(&request.environment, key.light.yaw, key.light.pitch);
            renderer.set_light(light(&context, key, &turned)?)?;
            self.turned = (!key.light.point).then_some(turned);
        }
        if changed(&|l| same_light(l) && l.shape == key.shape) {
            self.ground = GROUND_AT_FIRST;
            let ground = self.turned.as_ref().map(|map| ground(&self.geometry, map, key, self.ground));
            renderer.set_ground(ground.as_ref())?;
        }
        // A small picture that was interrupted says nothing of the whole one.
        if renderer.size() != size {
            renderer.restart();
        }
        if renderer.samples() == 0 {
            self.picture += 1;
        } else if changed(&|l| l.light.exposure == key.light.exposure) {
            self.picture += 1;
            let exposure = self.exposure.as_ref().map_or(1.0, |(_, exposure)| *exposure);
            self.limits = limits(&renderer.read_linear()?, exposure * key.stops());
        }
        self.last = Some(key.clone());
        Ok(())
    }

    fn set_materials(&mut self, context: &Context, request: &SceneRequest) -> Result<(), Stop> {
        let Some(renderer) = &mut self.renderer else { return Ok(()) };
        let key = &request.key;
        let known = self.materials.as_ref();
        let same_truth = known
            .is_some_and(|m| m.truth.as_ref().map(|t| t.0) == request.truth.as_ref().map(|_| key.document));
        let same = same_truth
            && known.is_some_and(|m| m.prediction.0 == key.version && m.prediction.1 == key.has_sigma);
        if same {
            return Ok(());
        }
        let precision = Precision::Half;
        let truth = match (&request.truth, self.materials.take()) {
            (None, _) => None,
            (Some(_), Some(Materials { truth: Some(truth), .. })) if same_truth => Some(truth),
            (Some(table), _) => Some((key.document, BrdfTexture::upload(context, table, None, precision)?)),
        };
        let sigma = request.sigma.as_ref();
        let sigma = sigma.map(|table| SigmaTable::from_planes(vec![largest_channel(table)]));
        let sigma = sigma.transpose().map_err(gpbrdf_render::Error::from)?;
        let prediction = BrdfTexture::upload(context, &request.mean, sigma.as_ref(), precision)?;
        renderer.set_materials(truth.as_ref().map(|t| &t.1), &prediction)?;
        self.materials = Some(Materials { truth, prediction: (key.version, key.has_sigma, prediction) });
        Ok(())
    }
}

/// The largest of the three channels in each cell, which is the sigma that textures hold.
fn largest_channel(table: &BrdfTable) -> Vec<f32> {
    table.values().iter().map(|cell| cell.iter().copied().fold(0.0, f32::max)).collect()
}

/// The light of a request, from an environment that has been turned. A point light keeps its place over the picture
/// while the eye orbits.
fn light(context: &Context, key: &SceneKey, environment: &Environment) -> gpbrdf_render::Result<Light> {
    if key.light.point {
        let [x, y] = key.light.at.map(to_f32);
        let view = Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt());
        return Ok(Light::Directional {
            direction: key.camera().world_from_view() * view,
            irradiance: [std::f32::consts::PI; 3],
        });
    }
    Ok(Light::Environment(EnvironmentLight::for_device(context, environment)?))
}

/// The ground under an object. The studio's floor is dark and far below; the ground goes on into what is above the
/// horizon instead. Other environments show their own ground beyond it.
fn ground(geometry: &Geometry, map: &Environment, key: &SceneKey, directions: usize) -> Ground {
    let ground = Ground::new(geometry, map, directions);
    if key.studio { ground.with_horizon(STUDIO_HORIZON) } else { ground }
}

/// The environment turned by `yaw` about the vertical axis, which takes the light before the object to its right, and
/// then by `pitch` about the horizontal one, which takes it down. Without a pitch it is turned by whole pixels, else
/// interpolated.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the width")]
fn turned(environment: &Environment, yaw: f64, pitch: f64) -> Environment {
    let map = environment.raster();
    let (width, height) = (map.width(), map.height());
    let turned = if pitch == 0.0 {
        let shift = ((yaw / TAU).rem_euclid(1.0) * width as f64) as usize % width.max(1);
        Raster::from_fn(width, height, |x, y| *map.at((x + shift) % width, y))
    } else {
        let ((sy, cy), (sp, cp)) = (yaw.sin_cos(), pitch.sin_cos());
        let pixel = |i: usize| {
            let [u, v] = [(i % width, width), (i / width, height)].map(|(i, n)| (i as f64 + 0.5) / n as f64);
            let [x, y, z]: [f64; 3] = Environment::direction(u, v).into();
            let (y, z) = (cp * y + sp * z, cp * z - sp * y);
            let from = Vector3::new(cy * x - sy * z, y, cy * z + sy * x);
            environment.interpolated(Environment::coordinates(&from)).map(to_f32)
        };
        let pixels = (0..width * height).into_par_iter().map(pixel).collect();
        Raster::new(width, height, pixels).unwrap_or_else(|_| map.clone())
    };
    Environment::new(turned).unwrap_or_else(|_| environment.clone())
}

/// The factor of radiance at which nine tenths of an object are below 0.6 of white, as in the image metrics, or a
/// smaller one: the tone curve comes near its white at 6, and no more than one pixel in 500 is brighter than that.
/// The truth is exposed, or the prediction where it is alone.
fn automatic_exposure(pixels: &[LinearPixel]) -> f32 {
    let inside = pixels.iter().filter(|pixel| is_inside(pixel));
    let mut brightest: Vec<f32> =
        inside.map(|pixel| pixel.truth.into_iter().fold(0.0, f32::max)).filter(|x| x.is_finite()).collect();
    brightest.sort_unstable_by(f32::total_cmp);
    let Some(last) = brightest.len().checked_sub(1) else { return 1.0 };
    let [usual, bright] = [last * 9 / 10, last * 499 / 500].map(|at| brightest[at]);
    let exposure = (0.6 / usual).min(6.0 / bright);
    if exposure.is_normal() { exposure } else { 1.0 }
}

/// The factor at which a quarter of the directions of an environment are brighter than 1.2, which the tone curve shows
/// as a light grey: what is behind an object is not burnt out either.
fn most_exposure(environment: &Environment) -> f32 {
    let pixels = environment.raster().pixels().iter();
    let mut brightest: Vec<f32> = pixels.map(|pixel| pixel.iter().copied().fold(0.0, f32::max)).collect();
    let at = brightest.len() * 3 / 4;
    let (_, level, _) = brightest.select_nth_unstable_by(at, f32::total_cmp);
    let exposure = 1.2 / *level;
    if exposure.is_normal() { exposure } else { f32::INFINITY }
}

/// Whether an object covers the whole pixel.
fn is_inside(pixel: &LinearPixel) -> bool {
    pixel.coverage >= 1.0
}

/// The ends of the scales, which hold 99 % of the pixels of the object.
fn limits(picture: &LinearPicture, exposure: f32) -> Limits {
    let mask: Vec<bool> = picture.raster().pixels().iter().map(is_inside).collect();
    let limit = |values: &[f32]| {
        let wide: Vec<f64> = values.iter().copied().map(f64::from).collect();
        to_f32(round_limit(&wide, &mask))
    };
    let sigma = picture.raster().map(|pixel| pixel.sigma);
    Limits { difference: limit(&picture.difference(exposure)), sigma: limit(sigma.pixels()) }
}

#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of the device")]
fn to_f32(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn exposure_keeps_highlights_below_white_and_leaves_out_what_is_behind() {
        let pixel =
            |truth: f32, coverage: f32| LinearPixel { truth: [truth; 3], coverage, ..Default::default() };
        let mut pixels = vec![pixel(0.2, 1.0); 1000];
        pixels.extend([pixel(1e6, 0.0); 500]);
        assert!((automatic_exposure(&pixels) - 3.0).abs() < 1e-5);
        // A highlight of one pixel in 20 is 40 times as bright as may be shown so.
        pixels.extend([pixel(80.0, 1.0); 50]);
        assert!((automatic_exposure(&pixels) - 6.0 / 80.0).abs() < 1e-6);
        // One pixel alone changes nothing.
        let pixels = [vec![pixel(0.2, 1.0); 1000], vec![pixel(80.0, 1.0)]].concat();
        assert!((automatic_exposure(&pixels) - 3.0).abs() < 1e-5);
        for nothing in [vec![], vec![pixel(0.0, 1.0)], vec![pixel(f32::NAN, 1.0)]] {
            assert_eq!(automatic_exposure(&nothing), 1.0);
        }
    }

    #[test]
    fn an_environment_turns_as_a_solid_body() {
        // A lamp before the object, which is at +z: between columns 0 and 63, at the height of the eye.
        let lamp = |x: usize, y: usize| (x == 0 || x == 63) && (y == 15 || y == 16);
        let map = Raster::from_fn(64, 32, |x, y| if lamp(x, y) { [1.0; 3] } else { [0.0; 3] });
        let map = Environment::new(map).unwrap();
        let brightest = |map: &Environment| -> [f64; 3] {
            let (mut sum, mut total) = ([0.0; 3], 0.0);
            for y in 0..32 {
                for x in 0..64 {
                    let azimuth = TAU * (x as f64 + 0.5) / 64.0 - PI;
                    let (sine, height) = (PI * (y as f64 + 0.5) / 32.0).sin_cos();
                    let weight = f64::from(map.raster().at(x, y)[0]) * sine;
                    let direction = [sine * azimuth.sin(), height, -sine * azimuth.cos()];
                    for c in 0..3 {
                        sum[c] += weight * direction[c];
                    }
                    total += weight;
                }
            }
            sum.map(|s| s / total)
        };
        for (yaw, pitch, expected) in [
            (0.0, 0.0, [0.0, 0.0, 1.0]),
            (PI / 4.0, 0.0, [0.5f64.sqrt(), 0.0, 0.5f64.sqrt()]),
            (0.0, PI / 4.0, [0.0, -(0.5f64.sqrt()), 0.5f64.sqrt()]),
            (PI / 4.0, PI / 2.0, [0.5f64.sqrt(), -(0.5f64.sqrt()), 0.0]),
        ] {
            let found = brightest(&turned(&map, yaw, pitch));
            for (a, b) in std::iter::zip(found, expected) {
                assert!((a - b).abs() < 0.03, "{yaw} {pitch}: {found:?}, not {expected:?}");
            }
        }
    }

    #[test]
    fn sigma_of_three_channels_is_the_largest_of_them() {
        let cell =
            |a: gpbrdf_core::HalfDiff| if a.theta_h < 0.5 { [0.5, 0.25, 0.75] } else { [0.5, 0.25, 0.0] };
        let table = BrdfTable::from_fn(cell);
        let largest = largest_channel(&table);
        assert_eq!((largest[0], *largest.last().unwrap()), (0.75, 0.5));
        for (value, cell) in std::iter::zip(largest, table.values()) {
            assert!(cell.contains(&value) && cell.iter().all(|x| *x <= value));
        }
    }
}
