//! Objects lit on the window's own device, progressively, by a thread that the newest request steers.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use eframe::egui::TextureId;
use eframe::egui_wgpu::RenderState;
use eframe::wgpu::FilterMode;
use glam::Vec3;
use gpbrdf_core::{BrdfTable, Environment, SigmaTable, psnr, ssim};
use gpbrdf_render::{
    Background, BrdfTexture, Camera, Context, Display, EnvironmentLight, Geometry, Light, Mesh, Precision,
    Renderer, Show, read_obj,
};
use serde::{Deserialize, Serialize};

use super::document::DocumentId;
use super::fitter::{Event, Outbox};
use super::mailbox::{Mailbox, Sender};
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
    pub(crate) size: [u32; 2],
    pub(crate) shown: SphereShown,
    pub(crate) swipe: f32,
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
    pub(crate) texture: TextureId,
    pub(crate) samples: u32,
    /// Between truth and prediction, once the picture is smooth.
    pub(crate) quality: Option<(f64, f64)>,
}

/// Samples of a smooth picture.
const SAMPLES: u32 = 192;
/// End of the scales of false colours.
pub(crate) const LIMIT: f32 = 0.1;

/// Starts the thread that renders.
pub(crate) fn spawn(outbox: Outbox, state: RenderState) -> std::io::Result<Sender<SceneRequest>> {
    let mut scene = Scene { state, renderer: None, texture: None, materials: None, last: None };
    Mailbox::spawn("scene", move |request: SceneRequest, stale| {
        if let Err(message) = scene.render(&request, &outbox, stale) {
            (scene.renderer, scene.materials, scene.last) = (None, None, None);
            outbox.send(Event::SceneFailed(message));
        }
    })
}

struct Scene {
    state: RenderState,
    renderer: Option<(Context, Renderer)>,
    texture: Option<(TextureId, [u32; 2])>,
    materials: Option<Materials>,
    last: Option<SceneKey>,
}

/// Textures, with what they were made from.
struct Materials {
    truth: Option<(DocumentId, BrdfTexture)>,
    prediction: (u64, bool, BrdfTexture),
}

impl Scene {
    fn render(
        &mut self,
        request: &SceneRequest,
        outbox: &Outbox,
        stale: &(dyn Fn() -> bool + Sync),
    ) -> Result<(), String> {
        let say = |error: gpbrdf_render::Error| error.to_string();
        let key = &request.key;
        if self.renderer.is_none() {
            let state = &self.state;
            let context = Context::from_device(&state.adapter, state.device.clone(), state.queue.clone());
            let renderer = Renderer::new(&context, key.size).map_err(say)?;
            self.renderer = Some((context, renderer));
        }
        self.set_materials(request)?;
        let Some((context, renderer)) = &mut self.renderer else { return Ok(()) };
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
        if changed(&|l| l.light == key.light && l.environment == key.environment && l.orbit == key.orbit)
            && (key.light.point || changed(&|l| l.light == key.light && l.environment == key.environment))
        {
            renderer.set_light(light(key, &request.environment)).map_err(say)?;
        }
        let show = match key.shown {
            SphereShown::Difference if key.has_truth => Show::Difference,
            SphereShown::Sigma => Show::Sigma,
            SphereShown::Swipe | SphereShown::SideBySide if key.has_truth => Show::Split { at: key.swipe },
            _ => Show::Prediction,
        };
        let display = Display {
            show,
            exposure: key.exposure.max(1e-6),
            background: if key.light.point { Background::Black } else { Background::Environment },
            limit: LIMIT,
            ..Display::default()
        };
        self.last = Some(key.clone());
        let mut quality = None;
        let mut step = 1;
        loop {
            renderer.render_more(step).map_err(say)?;
            let view = renderer.display(&display).map_err(say)?.clone();
            let device = context.device();
            let texture = match self.texture {
                Some((texture, size)) if size == key.size => texture,
                old => {
                    let mut egui = self.state.renderer.write();
                    let texture = match old {
                        Some((id, _)) => {
                            egui.update_egui_texture_from_wgpu_texture(device, &view, FilterMode::Linear, id);
                            id
                        }
                        None => egui.register_native_texture(device, &view, FilterMode::Linear),
                    };
                    self.texture = Some((texture, key.size));
                    texture
                }
            };
            renderer.wait().map_err(say)?;
            let samples = renderer.samples();
            if samples >= SAMPLES && key.has_truth && !stale() {
                let pictures = renderer.read_linear().and_then(|linear| linear.images()).map_err(say)?;
                let exposure = f64::from(key.exposure);
                let found =
                    (psnr(&pictures.0, &pictures.1, exposure), ssim(&pictures.0, &pictures.1, exposure));
                quality = found.0.ok().zip(found.1.ok());
            }
            outbox.send(Event::Scene(SceneImage { document: key.document, texture, samples, quality }));
            if stale() || samples >= SAMPLES {
                return Ok(());
            }
            step = (step * 2).min(8);
        }
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
        let say = |error: gpbrdf_render::Error| error.to_string();
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
