//! Objects lit on a graphics device, progressively, by a thread that the newest request steers.
//!
//! The device is not the window's: what the window waits for would wait for the lighting too, and a window that changes
//! its size wants its device to be idle.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use eframe::egui::{Color32, ColorImage};
use glam::Vec3;
use gpbrdf_core::{BrdfTable, Environment, SigmaTable};
use gpbrdf_render::{
    AdapterChoice, Background, BrdfTexture, Camera, Context, Display, EnvironmentLight, Geometry, Light,
    Mesh, Precision, Renderer, Show, read_obj,
};
use serde::{Deserialize, Serialize};

use super::document::DocumentId;
use super::fitter::{Event, Outbox};
use super::mailbox::{Mailbox, Sender};
use super::messages::naming;
use super::quality::{Measured, Measurer};
use super::settings::SphereShown;
use super::spheres::SphereLight;
use super::widgets::narrow;

/// What is lit.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Shape {
    /// The sphere, by the processor.
    #[default]
    Sphere,
    Knot,
    RoundedBox,
    /// An OBJ file.
    File(PathBuf),
}

impl Shape {
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Sphere => "Sphere".to_owned(),
            Self::Knot => "Knot".to_owned(),
            Self::RoundedBox => "Rounded box".to_owned(),
            Self::File(path) => {
                path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned())
            }
        }
    }

    fn geometry(&self) -> Result<Geometry, String> {
        Ok(match self {
            Self::Sphere => Geometry::Sphere,
            Self::Knot => Geometry::Mesh(Mesh::knot()),
            Self::RoundedBox => Geometry::Mesh(Mesh::rounded_box()),
            Self::File(path) => Geometry::Mesh(read_obj(path).map_err(|error| naming(path, &error))?),
        })
    }
}

/// From where the object is seen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Orbit {
    /// Radians.
    pub(crate) azimuth: f32,
    pub(crate) elevation: f32,
    pub(crate) zoom: f32,
}

impl Default for Orbit {
    fn default() -> Self {
        Self { azimuth: 0.5, elevation: 0.35, zoom: 1.0 }
    }
}

/// What a picture depends on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SceneKey {
    pub(crate) document: DocumentId,
    pub(crate) version: u64,
    pub(crate) has_truth: bool,
    pub(crate) has_sigma: bool,
    pub(crate) shape: Shape,
    pub(crate) orbit: Orbit,
    pub(crate) light: SphereLight,
    pub(crate) environment: u64,
    pub(crate) exposure: f32,
    /// Of one picture, of which there are two side by side.
    pub(crate) size: [u32; 2],
    pub(crate) shown: SphereShown,
    pub(crate) swipe: f32,
}

impl SceneKey {
    /// Whether truth and prediction are two whole pictures.
    fn is_pair(&self) -> bool {
        self.has_truth && self.shown == SphereShown::SideBySide
    }

    /// What is shown, on each of two pictures where there are two.
    fn show(&self) -> [Show; 2] {
        let first = match self.shown {
            SphereShown::Difference if self.has_truth => Show::Difference,
            SphereShown::Sigma => Show::Sigma,
            SphereShown::Swipe if self.has_truth => Show::Split { at: self.swipe },
            SphereShown::SideBySide if self.has_truth => Show::Truth,
            _ => Show::Prediction,
        };
        [first, Show::Prediction]
    }
}

/// A picture to make.
#[derive(Clone, Debug)]
pub(crate) struct SceneRequest {
    pub(crate) key: SceneKey,
    pub(crate) truth: Option<Arc<BrdfTable>>,
    pub(crate) mean: Arc<BrdfTable>,
    pub(crate) sigma: Option<Arc<BrdfTable>>,
    pub(crate) environment: Arc<Environment>,
}

/// A picture of an object.
#[derive(Clone, Debug)]
pub(crate) struct SceneImage {
    pub(crate) document: DocumentId,
    /// Tells this picture, however smooth it gets, from all others.
    pub(crate) picture: u64,
    pub(crate) image: ColorImage,
    /// The prediction, where `image` is the truth alone.
    pub(crate) beside: Option<ColorImage>,
    pub(crate) samples: u32,
}

/// Samples of a smooth picture.
const SAMPLES: u32 = 192;
/// End of the scales of false colours.
pub(crate) const LIMIT: f32 = 0.1;

/// Why there is no picture.
enum Stop {
    /// The device is gone; another one may do.
    Lost(String),
    /// With a message.
    Error(String),
}

impl From<gpbrdf_render::Error> for Stop {
    fn from(error: gpbrdf_render::Error) -> Self {
        let lost = matches!(error, gpbrdf_render::Error::Lost { .. });
        if lost { Self::Lost(error.to_string()) } else { Self::Error(error.to_string()) }
    }
}

/// Starts the thread that renders, on a device of its own unless one is given; beyond the first samples it lets the
/// fitter go first.
pub(crate) fn spawn(
    outbox: Outbox,
    context: Option<Context>,
    busy: impl Fn() -> bool + Send + 'static,
) -> std::io::Result<Sender<SceneRequest>> {
    let measurer = Measurer::spawn(outbox.clone())?;
    let mut scene = Scene { context, renderer: None, materials: None, last: None, picture: 0, measurer };
    Mailbox::spawn("scene", move |request: SceneRequest, stale| {
        let mut result = scene.render(&request, &outbox, stale, &busy);
        if let Err(Stop::Lost(message)) = &result {
            let name = scene.context.as_ref().map_or_else(String::new, |c| c.info().name.clone());
            scene.forget(true);
            outbox.send(Event::DeviceLost(format!("the graphics device \"{name}\" is lost: {message}")));
            result = scene.render(&request, &outbox, stale, &busy);
        }
        if let Err(Stop::Lost(message) | Stop::Error(message)) = result {
            scene.forget(false);
            outbox.send(Event::SceneFailed(message));
        }
    })
}

struct Scene {
    context: Option<Context>,
    renderer: Option<Renderer>,
    materials: Option<Materials>,
    last: Option<SceneKey>,
    picture: u64,
    measurer: Measurer,
}

/// BRDFs on the device, with what they were made from.
struct Materials {
    truth: Option<(DocumentId, BrdfTexture)>,
    prediction: (u64, bool, BrdfTexture),
}

impl Scene {
    /// Drops what is on the device, which may be in any state, and the device too where it is `lost`.
    fn forget(&mut self, lost: bool) {
        (self.renderer, self.materials, self.last) = (None, None, None);
        if lost {
            self.context = None;
        }
    }

    fn render(
        &mut self,
        request: &SceneRequest,
        outbox: &Outbox,
        stale: &(dyn Fn() -> bool + Sync),
        busy: &dyn Fn() -> bool,
    ) -> Result<(), Stop> {
        let key = &request.key;
        self.prepare(request)?;
        let Some(renderer) = &mut self.renderer else { return Ok(()) };
        let display = Display {
            exposure: key.exposure.max(1e-6),
            background: if key.light.point { Background::Black } else { Background::Environment },
            limit: Some(LIMIT),
            ..Display::default()
        };
        let shown = |renderer: &mut Renderer, show: Show| -> Result<ColorImage, Stop> {
            let pixels = renderer.read_display(&Display { show, ..display })?;
            let pixels = pixels.into_iter().map(|[r, g, b, _]| Color32::from_rgb(r, g, b)).collect();
            Ok(ColorImage::new(key.size.map(|side| side as usize), pixels))
        };
        let [first, second] = key.show();
        let mut step = 1;
        loop {
            if renderer.samples() < SAMPLES {
                renderer.render_more(step)?;
            }
            let image = shown(renderer, first)?;
            let beside = if key.is_pair() { Some(shown(renderer, second)?) } else { None };
            let (document, picture, samples) = (key.document, self.picture, renderer.samples());
            outbox.send(Event::Scene(Box::new(SceneImage { document, picture, image, beside, samples })));
            let last = samples >= SAMPLES;
            if key.has_truth && self.measurer.wants(picture, samples, last) {
                let linear = renderer.read_linear()?;
                let exposure = f64::from(display.exposure);
                self.measurer.put(Measured { document, picture, samples, exposure, linear });
            }
            while !last && busy() && !stale() {
                std::thread::sleep(Duration::from_millis(5));
            }
            if last || stale() {
                return Ok(());
            }
            step = (step * 2).min(8);
        }
    }

    /// Hands the renderer what has changed.
    fn prepare(&mut self, request: &SceneRequest) -> Result<(), Stop> {
        let key = &request.key;
        let context = match &self.context {
            Some(context) => context.clone(),
            None => self.context.insert(Context::open(AdapterChoice::Any)?).clone(),
        };
        if self.renderer.is_none() {
            self.renderer = Some(Renderer::new(&context, key.size)?);
        }
        self.set_materials(&context, request)?;
        let Some(renderer) = &mut self.renderer else { return Ok(()) };
        let last = self.last.take();
        let changed = |same: &dyn Fn(&SceneKey) -> bool| last.as_ref().is_none_or(|last| !same(last));
        if changed(&|l| l.shape == key.shape) {
            renderer.set_geometry(&key.shape.geometry().map_err(Stop::Error)?)?;
        }
        if changed(&|l| l.size == key.size) {
            renderer.resize(key.size)?;
        }
        if changed(&|l| l.orbit == key.orbit) {
            let orbit = key.orbit;
            let camera = Camera::perspective(0.6, 1.0).orbited(orbit.azimuth, orbit.elevation);
            renderer.set_camera(camera.zoomed(orbit.zoom))?;
        }
        // A point light turns with the eye.
        let same_light = |l: &SceneKey| l.light == key.light && l.environment == key.environment;
        if changed(&|l| same_light(l) && (!key.light.point || l.orbit == key.orbit)) {
            renderer.set_light(light(key, &request.environment))?;
        }
        if renderer.samples() == 0 || changed(&|l| l.exposure == key.exposure) {
            self.picture += 1;
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
        let sigma = request
            .sigma
            .as_ref()
            .and_then(|table| SigmaTable::from_planes(vec![table.values().iter().map(|v| v[0]).collect()]));
        let prediction = BrdfTexture::upload(context, &request.mean, sigma.as_ref(), precision)?;
        renderer.set_materials(truth.as_ref().map(|t| &t.1), &prediction)?;
        self.materials = Some(Materials { truth, prediction: (key.version, key.has_sigma, prediction) });
        Ok(())
    }
}

/// The light of a request: a point light stands where it does over the picture.
fn light(key: &SceneKey, environment: &Environment) -> Light {
    if key.light.point {
        let [x, y] = key.light.at.map(narrow);
        let view = Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt());
        let camera = Camera::perspective(0.6, 1.0).orbited(key.orbit.azimuth, key.orbit.elevation);
        return Light::Directional {
            direction: camera.world_from_view() * view,
            irradiance: [std::f32::consts::PI; 3],
        };
    }
    Light::Environment(EnvironmentLight::new(&turned(environment, key.light.yaw)))
}

/// The map turned about the vertical axis, by whole pixels.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the width")]
fn turned(environment: &Environment, yaw: f64) -> Environment {
    let width = environment.width();
    let shift = ((yaw / std::f64::consts::TAU).rem_euclid(1.0) * width as f64) as usize % width.max(1);
    let mut pixels = environment.pixels().to_vec();
    for row in pixels.chunks_mut(width.max(1)) {
        row.rotate_left(shift);
    }
    Environment::new(width, environment.height(), pixels).unwrap_or_else(|_| environment.clone())
}
