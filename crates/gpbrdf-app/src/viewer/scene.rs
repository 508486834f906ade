//! Objects lit on the window's own device, progressively, by a thread that the newest request steers.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use eframe::egui::TextureId;
use eframe::egui_wgpu::RenderState;
use eframe::wgpu::{FilterMode, TextureView};
use glam::Vec3;
use gpbrdf_core::{BrdfTable, Environment, SigmaTable};
use gpbrdf_render::{
    Background, BrdfTexture, Camera, Context, Display, EnvironmentLight, Geometry, Light, Mesh, Precision,
    Renderer, Show, read_obj,
};
use serde::{Deserialize, Serialize};

use super::document::DocumentId;
use super::fitter::{Event, Outbox};
use super::mailbox::{Mailbox, Sender};
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
            Self::File(path) => Geometry::Mesh(read(path)?),
        })
    }
}

fn read(path: &Path) -> Result<Mesh, String> {
    read_obj(path).map_err(|error| {
        let (text, name) = (error.to_string(), path.display().to_string());
        if text.contains(&name) { text } else { format!("\"{name}\": {text}") }
    })
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

/// A picture on the device.
#[derive(Clone, Debug)]
pub(crate) struct SceneImage {
    pub(crate) document: DocumentId,
    /// Tells this picture, however smooth it gets, from all others.
    pub(crate) picture: u64,
    pub(crate) texture: TextureId,
    /// The prediction, where `texture` is the truth alone.
    pub(crate) beside: Option<TextureId>,
    pub(crate) samples: u32,
}

/// Samples of a smooth picture.
const SAMPLES: u32 = 192;
/// End of the scales of false colours.
pub(crate) const LIMIT: f32 = 0.1;

/// Starts the thread that renders; beyond the first samples it lets the fitter go first.
pub(crate) fn spawn(
    outbox: Outbox,
    state: RenderState,
    busy: impl Fn() -> bool + Send + 'static,
) -> std::io::Result<Sender<SceneRequest>> {
    let mut scene = Scene {
        textures: Textures { state, shown: [None, None] },
        renderer: None,
        materials: None,
        last: None,
        picture: 0,
        measurer: Measurer::spawn(outbox.clone())?,
    };
    Mailbox::spawn("scene", move |request: SceneRequest, stale| {
        if let Err(message) = scene.render(&request, &outbox, stale, &busy) {
            (scene.renderer, scene.materials, scene.last) = (None, None, None);
            outbox.send(Event::SceneFailed(message));
        }
    })
}

struct Scene {
    textures: Textures,
    renderer: Option<(Context, Renderer)>,
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

/// Pictures as the window knows them.
struct Textures {
    state: RenderState,
    shown: [Option<(TextureId, TextureView)>; 2],
}

impl Textures {
    /// The name of a picture.
    fn id(&mut self, slot: usize, view: &TextureView) -> TextureId {
        let device = &self.state.device;
        let id = match &self.shown[slot] {
            Some((id, known)) if known == view => return *id,
            Some((id, _)) => {
                let mut renderer = self.state.renderer.write();
                renderer.update_egui_texture_from_wgpu_texture(device, view, FilterMode::Linear, *id);
                *id
            }
            None => self.state.renderer.write().register_native_texture(device, view, FilterMode::Linear),
        };
        self.shown[slot] = Some((id, view.clone()));
        id
    }
}

fn say(error: gpbrdf_render::Error) -> String {
    error.to_string()
}

impl Scene {
    fn render(
        &mut self,
        request: &SceneRequest,
        outbox: &Outbox,
        stale: &(dyn Fn() -> bool + Sync),
        busy: &dyn Fn() -> bool,
    ) -> Result<(), String> {
        let key = &request.key;
        self.prepare(request)?;
        let Some((_, renderer)) = &mut self.renderer else { return Ok(()) };
        let display = Display {
            exposure: key.exposure.max(1e-6),
            background: if key.light.point { Background::Black } else { Background::Environment },
            limit: LIMIT,
            ..Display::default()
        };
        let displays = key.show().map(|show| Display { show, ..display });
        let mut step = 1;
        loop {
            if renderer.samples() < SAMPLES {
                renderer.render_more(step).map_err(say)?;
            }
            let (texture, beside) = if key.is_pair() {
                let [truth, prediction] = renderer.display_pair(&displays).map_err(say)?;
                (self.textures.id(0, truth), Some(self.textures.id(1, prediction)))
            } else {
                (self.textures.id(0, renderer.display(&displays[0]).map_err(say)?), None)
            };
            renderer.wait().map_err(say)?;
            let (document, picture, samples) = (key.document, self.picture, renderer.samples());
            outbox.send(Event::Scene(SceneImage { document, picture, texture, beside, samples }));
            let last = samples >= SAMPLES;
            if key.has_truth && self.measurer.wants(picture, samples, last) {
                let linear = renderer.read_linear().map_err(say)?;
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
    fn prepare(&mut self, request: &SceneRequest) -> Result<(), String> {
        let key = &request.key;
        if self.renderer.is_none() {
            let state = &self.textures.state;
            let context = Context::from_device(&state.adapter, state.device.clone(), state.queue.clone());
            let renderer = Renderer::new(&context, key.size).map_err(say)?;
            self.renderer = Some((context, renderer));
        }
        self.set_materials(request)?;
        let Some((_, renderer)) = &mut self.renderer else { return Ok(()) };
        let last = self.last.take();
        let changed = |same: &dyn Fn(&SceneKey) -> bool| last.as_ref().is_none_or(|last| !same(last));
        if changed(&|l| l.shape == key.shape) {
            renderer.set_geometry(&key.shape.geometry()?).map_err(say)?;
        }
        if changed(&|l| l.size == key.size) {
            renderer.resize(key.size).map_err(say)?;
        }
        if changed(&|l| l.orbit == key.orbit) {
            let orbit = key.orbit;
            let camera = Camera::perspective(0.6, 1.0).orbited(orbit.azimuth, orbit.elevation);
            renderer.set_camera(camera.zoomed(orbit.zoom)).map_err(say)?;
        }
        // A point light turns with the eye.
        let same_light = |l: &SceneKey| l.light == key.light && l.environment == key.environment;
        if changed(&|l| same_light(l) && (!key.light.point || l.orbit == key.orbit)) {
            renderer.set_light(light(key, &request.environment)).map_err(say)?;
        }
        if renderer.samples() == 0 || changed(&|l| l.exposure == key.exposure) {
            self.picture += 1;
        }
        self.last = Some(key.clone());
        Ok(())
    }

    fn set_materials(&mut self, request: &SceneRequest) -> Result<(), String> {
        let Some((context, renderer)) = &mut self.renderer else { return Ok(()) };
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
            (Some(table), _) => {
                Some((key.document, BrdfTexture::upload(context, table, None, precision).map_err(say)?))
            }
        };
        let sigma = request
            .sigma
            .as_ref()
            .and_then(|table| SigmaTable::from_planes(vec![table.values().iter().map(|v| v[0]).collect()]));
        let prediction =
            BrdfTexture::upload(context, &request.mean, sigma.as_ref(), precision).map_err(say)?;
        renderer.set_materials(truth.as_ref().map(|t| &t.1), &prediction).map_err(say)?;
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
