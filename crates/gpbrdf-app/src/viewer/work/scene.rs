//! Objects lit on a graphics device, progressively, by a thread that serves the newest request.
//!
//! It uses a second device. On the window's device, long dispatches would delay presentation, and wgpu cannot
//! configure a surface while another thread submits work.

use std::sync::Arc;
use std::time::Duration;

use eframe::egui::{Color32, ColorImage};
use glam::Vec3;
use gpbrdf_core::base::Raster;
use gpbrdf_core::{BrdfTable, Environment, SigmaTable};
use gpbrdf_render::{
    AdapterChoice, Background, BrdfTexture, Camera, Context, Display, EnvironmentLight, Geometry, Light,
    Mesh, Precision, Renderer, Show, read_mesh,
};

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
    pub(crate) exposure: f32,
    /// Pixels of one picture; there are two of this size side by side.
    pub(crate) size: [u32; 2],
    pub(crate) shown: SphereShown,
    pub(crate) swipe: f32,
}

impl SceneKey {
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

/// A picture to make.
#[derive(Clone, Debug)]
pub(crate) struct SceneRequest {
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
    /// The object cannot be shown: its file is broken or the device refuses.
    Failed(String),
    /// The device was lost, and another one is opened.
    DeviceLost(String),
}

/// A picture of an object.
#[derive(Clone, Debug)]
pub(crate) struct SceneImage {
    pub(crate) document: DocumentId,
    /// A number that stays while this picture gets smoother, and that no other picture has.
    pub(crate) picture: u64,
    pub(crate) image: ColorImage,
    /// The picture of the prediction, where `image` shows the truth alone.
    pub(crate) beside: Option<ColorImage>,
    pub(crate) samples: u32,
}

/// Samples of a smooth picture.
const SAMPLES: u32 = 192;
/// The value at the end of the scales of false colours.
pub(crate) const LIMIT: f32 = 0.1;

/// Why there is no picture, with a message.
enum Stop {
    /// The device was lost. Another one may do.
    Lost(String),
    Error(String),
}

impl From<gpbrdf_render::Error> for Stop {
    fn from(error: gpbrdf_render::Error) -> Self {
        let lost = matches!(error, gpbrdf_render::Error::Lost { .. });
        if lost { Self::Lost(error.to_string()) } else { Self::Error(error.to_string()) }
    }
}

/// Starts the thread that renders, on `context` or else on a device that it opens. Beyond the first samples
/// it waits while the fitter is `busy`.
pub(crate) fn spawn(
    outbox: Outbox<SceneResult>,
    context: Option<Context>,
    busy: impl Fn() -> bool + Send + 'static,
) -> std::io::Result<Sender<SceneRequest>> {
    let measurer = Measurer::spawn(outbox.map(SceneResult::Quality))?;
    let mut scene = Scene { context, renderer: None, materials: None, last: None, picture: 0, measurer };
    Mailbox::spawn("scene", move |request: SceneRequest, stale| {
        let mut result = scene.render(&request, &outbox, stale, &busy);
        if let Err(Stop::Lost(message)) = &result {
            let name = scene.context.as_ref().map_or_else(String::new, |c| c.info().name.clone());
            scene.drop_device();
            outbox
                .send(SceneResult::DeviceLost(format!("the graphics device \"{name}\" is lost: {message}")));
            result = scene.render(&request, &outbox, stale, &busy);
        }
        if let Err(Stop::Lost(message) | Stop::Error(message)) = result {
            scene.clear();
            outbox.send(SceneResult::Failed(message));
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

    fn render(
        &mut self,
        request: &SceneRequest,
        outbox: &Outbox<SceneResult>,
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
            outbox.send(SceneResult::Picture(Box::new(SceneImage {
                document,
                picture,
                image,
                beside,
                samples,
            })));
            let last = samples >= SAMPLES;
            if key.truth_is_tabulated && self.measurer.wants(picture, samples, last) {
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
        // A point light moves with the eye.
        let same_light = |l: &SceneKey| l.light == key.light && l.environment == key.environment;
        if changed(&|l| same_light(l) && (!key.light.point || l.orbit == key.orbit)) {
            renderer.set_light(light(&context, key, &request.environment)?)?;
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

/// The light of a request. A point light keeps its place over the picture while the eye orbits.
fn light(context: &Context, key: &SceneKey, environment: &Environment) -> gpbrdf_render::Result<Light> {
    if key.light.point {
        let [x, y] = key.light.at.map(to_f32);
        let view = Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt());
        let camera = Camera::perspective(0.6, 1.0).orbited(key.orbit.azimuth, key.orbit.elevation);
        return Ok(Light::Directional {
            direction: camera.world_from_view() * view,
            irradiance: [std::f32::consts::PI; 3],
        });
    }
    Ok(Light::Environment(EnvironmentLight::for_device(context, &turned(environment, key.light.yaw))?))
}

/// The environment turned about the vertical axis, by whole pixels.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the width")]
fn turned(environment: &Environment, yaw: f64) -> Environment {
    let map = environment.raster();
    let width = map.width();
    let shift = ((yaw / std::f64::consts::TAU).rem_euclid(1.0) * width as f64) as usize % width.max(1);
    let turned = Raster::from_fn(width, map.height(), |x, y| *map.at((x + shift) % width, y));
    Environment::new(turned).unwrap_or_else(|_| environment.clone())
}

#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of the device")]
fn to_f32(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use super::*;

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
