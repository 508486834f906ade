//! Lit spheres and objects: truth and prediction on either side of a line or side by side, their difference,
//! sigma.

mod controls;
mod object;
mod sphere;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Receiver;

use eframe::egui::{self, Color32, Context, Rect, RichText, Sense, TextureHandle, Ui, pos2, vec2};
use gpbrdf_core::Environment;
use gpbrdf_core::formats::read_environment;

use self::object::ObjectView;
use self::sphere::SphereView;
use crate::viewer::state::look::{Orbit, SceneLook, Shape, SphereShown};
use crate::viewer::ui::navigate::{ViewKeys, focus_ui, zoom_factor};
use crate::viewer::ui::pane::{
    Command, Offers, Order, Pane, PaneContext, Place, Progress, Share, Shown, Slot, Start, restored, saved,
};
use crate::viewer::ui::widgets::{narrow, segments_ui, tools_menu_ui};
use crate::viewer::work::dialogs::{Access, Question};
use crate::viewer::work::export;
use crate::viewer::work::outbox::{Outbox, in_background};
use crate::viewer::work::scene::SceneResult;
use crate::viewer::work::spheres::SphereResult;

/// What the views are called, with what the mouse does in them.
const SPHERE_HELP: &str = "Sphere view: drag or arrow keys turn the light";
const OBJECT_HELP: &str = "Object view: drag or arrow keys orbit";

/// The caption of differences of spheres and of objects: the mean over R, G and B of the exposed linear
/// radiances.
const DIFFERENCE: &str = "prediction - truth, exposed";

/// Columns of an environment; larger ones are averaged.
const MAX_COLUMNS: usize = 4096;

/// An environment and its file, or why it cannot be read.
type ReadMap = Result<(PathBuf, Arc<Environment>), String>;

/// What the pane is sent.
enum Message {
    Sphere(SphereResult),
    Scene(SceneResult),
    Map(ReadMap),
    /// Show what this file holds.
    Open(Shown),
    /// Write the spheres to this file.
    Export(PathBuf),
}

/// An environment.
struct Map {
    /// A number that no earlier environment had.
    number: u64,
    name: String,
    environment: Arc<Environment>,
}

impl Map {
    fn studio(number: u64) -> Self {
        let environment = Arc::new(Environment::studio());
        Self { number, name: "Studio (built in)".to_owned(), environment }
    }
}

/// The pane of spheres and objects.
pub(crate) struct ThreeD {
    look: SceneLook,
    map: Map,
    sphere: SphereView,
    object: ObjectView,
    outbox: Outbox<Message>,
    inbox: Receiver<Message>,
    start: Start,
}

impl ThreeD {
    /// Starts the workers.
    pub(crate) fn new(start: &Start) -> std::io::Result<Self> {
        let (outbox, inbox) = start.channel();
        Ok(Self {
            look: SceneLook::default(),
            map: Map::studio(0),
            sphere: SphereView::new(outbox.map(Message::Sphere), start)?,
            object: ObjectView::new(outbox.map(Message::Scene), None, start)?,
            outbox,
            inbox,
            start: start.clone(),
        })
    }
}

impl Pane for ThreeD {
    fn name(&self) -> &'static str {
        "3d"
    }

    fn title(&self) -> &'static str {
        "3-D"
    }

    fn place(&self) -> Place {
        Place::View(Some(Share { slot: Slot::Left, tab: "Material" }))
    }

    fn commands(&mut self, offers: &mut Offers, cx: &mut PaneContext) {
        if offers.offer(Command::menu("Export sphere…")) {
            cx.order(Order::Ask(Question {
                title: "Export sphere",
                help: "A PNG figure, and linear pictures as EXR files beside it.",
                access: Access::Write { name: "sphere.png" },
                answer: self.outbox.map(Message::Export),
            }));
        }
    }

    fn settings(&self) -> serde_json::Value {
        saved(&self.look)
    }

    fn restore(&mut self, settings: &serde_json::Value) -> serde_json::Result<()> {
        self.look = restored(settings)?;
        match self.look.environment.clone() {
            Some(path) => self.open_map(path),
            None => self.use_studio(),
        }
        Ok(())
    }

    fn show(&mut self, file: &Shown) -> bool {
        match file {
            Shown::Environment(path) => {
                self.look.light.point = false;
                self.open_map(path.clone());
            }
            Shown::Mesh(path) => self.look.shape = Shape::File(path.clone()),
        }
        true
    }

    fn receive(&mut self, ctx: &Context, cx: &mut PaneContext) {
        while let Ok(message) = self.inbox.try_recv() {
            match message {
                Message::Sphere(SphereResult::Pictures(images)) => self.sphere.take(ctx, *images),
                Message::Sphere(SphereResult::Metrics { document, version, images }) => {
                    let document = cx.documents.get_mut(document);
                    if let Some(fitted) = document.and_then(|d| d.result_mut(version)) {
                        fitted.images = Some(*images);
                    }
                }
                Message::Scene(result) => self.take_scene(ctx, cx, result),
                Message::Map(Ok((path, environment))) => {
                    let name =
                        path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
                    self.map = Map { number: self.map.number + 1, name, environment };
                    self.look.environment = Some(path);
                }
                Message::Map(Err(message)) => cx.messages.error(message),
                Message::Open(file) => {
                    self.show(&file);
                }
                Message::Export(path) => self.export(cx, &path),
            }
        }
    }

    fn ui(&mut self, ui: &mut Ui, cx: &mut PaneContext) {
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new(self.title()).strong().size(15.0));
            ui.add_space(6.0);
            segments_ui(ui, &mut self.look.shown, &SphereShown::ALL, SphereShown::name);
            tools_menu_ui(ui, "Shape", |ui| self.shape_ui(ui, cx));
            tools_menu_ui(ui, "Light", |ui| self.light_ui(ui, cx));
        });
        let Some(document) = cx.documents.selected() else { return };
        let area = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(area, Sense::click_and_drag());
        let is_sphere = self.look.shape == Shape::Sphere;
        let name = if is_sphere { SPHERE_HELP } else { OBJECT_HELP };
        response.widget_info(|| egui::WidgetInfo::labeled(egui::accesskit::Role::Canvas, true, name));
        ui.painter().rect_filled(area, 6.0, ui.visuals().extreme_bg_color);
        if is_sphere {
            if let Some(disc) = self.sphere.ui(ui, area, &self.look, document.id) {
                sphere::drag(ui, &response, &mut self.look, disc);
                self.navigate(ui, &response);
            }
        } else {
            let picture = self.object.ui(ui, area, &self.look, document);
            object::drag(ui, &response, &mut self.look, picture);
            self.navigate(ui, &response);
        }
    }

    fn request(&mut self, cx: &mut PaneContext) {
        self.sphere.request(cx, &self.look, &self.map);
        let exposure = self.sphere.exposure().unwrap_or(1.0);
        self.object.request(cx, &self.look, &self.map, exposure);
    }

    fn progress(&self) -> Progress {
        self.sphere.progress()
    }

    fn use_device(&mut self, device: &gpbrdf_render::Context) -> std::io::Result<()> {
        let outbox = self.outbox.map(Message::Scene);
        self.object = ObjectView::new(outbox, Some(device.clone()), &self.start)?;
        Ok(())
    }

    fn close(&mut self) {
        self.object.close();
    }
}

impl ThreeD {
    /// Reads an environment in the background.
    fn open_map(&self, path: PathBuf) {
        let outbox = self.outbox.map(Message::Map);
        let cannot = format!("cannot read \"{}\"", path.display());
        in_background(&outbox, "reader", &cannot, move || {
            let environment = read_environment(&path).and_then(of_moderate_size);
            Ok((path, Arc::new(environment.map_err(|error| error.to_string())?)))
        });
    }

    /// Takes the built-in environment.
    fn use_studio(&mut self) {
        self.map = Map::studio(self.map.number + 1);
        self.look.environment = None;
    }

    fn take_scene(&mut self, ctx: &Context, cx: &mut PaneContext, result: SceneResult) {
        match result {
            SceneResult::Picture(image) => self.object.take(ctx, *image),
            SceneResult::Quality(quality) => self.object.quality = Some(quality),
            SceneResult::Failed(message) => {
                // The sphere needs no device and no file.
                self.look.shape = Shape::Sphere;
                self.object.clear();
                cx.messages.error(message);
            }
            SceneResult::DeviceLost(message) => cx.messages.error(format!("{message}; it is opened anew")),
        }
    }

    fn export(&self, cx: &mut PaneContext, path: &std::path::Path) {
        match (cx.documents.selected(), self.sphere.images()) {
            (Some(document), Some(images)) => export::spheres(&document.name, images, path, &cx.saved),
            _ => cx.messages.error("nothing to export: no sphere has been drawn yet"),
        }
    }

    /// What wheel, right drag and keys do in both views.
    fn navigate(&mut self, ui: &Ui, response: &egui::Response) {
        let factor = zoom_factor(ui.ctx(), response);
        focus_ui(ui, response);
        let keys = ViewKeys::of(ui.ctx(), response);
        self.look.orbit.enlarge(factor * narrow(keys.zoom));
        if self.look.shape == Shape::Sphere {
            sphere::turn_by_keys(&mut self.look, &keys);
        } else {
            object::turn_by_keys(&mut self.look, &keys);
        }
        if keys.reset {
            self.look.light.reset();
            (self.look.orbit, self.look.swipe) = (Orbit::default(), 0.5);
        }
    }
}

/// An environment of at most [`MAX_COLUMNS`], which is turned anew while the light is dragged.
fn of_moderate_size(environment: Environment) -> gpbrdf_core::Result<Environment> {
    let (width, height) = (environment.raster().width(), environment.raster().height());
    match width.div_ceil(MAX_COLUMNS) {
        0 | 1 => Ok(environment),
        factor => environment.scaled_to(width.div_ceil(factor), height.div_ceil(factor)),
    }
}

/// The largest square in the middle of a rectangle.
fn square(rect: Rect) -> Rect {
    Rect::from_center_size(rect.center(), egui::Vec2::splat(rect.size().min_elem().max(1.0)))
}

/// The part of a picture between two vertical lines, within `clip`.
fn part_ui(ui: &Ui, texture: &TextureHandle, rect: Rect, [left, right]: [f32; 2], clip: Rect) {
    if right <= left {
        return;
    }
    let u = |x: f32| (x - rect.left()) / rect.width();
    let uv = Rect::from_min_max(pos2(u(left), 0.0), pos2(u(right), 1.0));
    let area = Rect::from_min_max(pos2(left, rect.top()), pos2(right, rect.bottom()));
    ui.painter().with_clip_rect(clip).image(texture.id(), area, uv, Color32::WHITE);
}

/// A whole picture, within `clip`.
fn whole_ui(ui: &Ui, texture: &TextureHandle, rect: Rect, clip: Rect) {
    part_ui(ui, texture, rect, [rect.left(), rect.right()], clip);
}

/// The upper left and the upper right corner of a picture, where its captions are.
fn corners(rect: Rect, margin: egui::Vec2) -> [egui::Pos2; 2] {
    [rect.left_top() + margin, rect.right_top() + vec2(-margin.x, margin.y)]
}
