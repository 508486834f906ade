//! Lit objects, the sphere among them: truth and prediction on either side of a line or side by side, their
//! difference, sigma.

mod controls;
mod moves;
mod object;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Receiver;

use eframe::egui::{self, Color32, Context, Rect, RichText, Sense, TextureHandle, Ui, pos2};
use gpbrdf_core::Environment;
use gpbrdf_core::formats::read_environment;

use self::object::ObjectView;
use crate::viewer::state::document::DocumentId;
use crate::viewer::state::look::{Orbit, SceneLook, Shape, SphereShown};
use crate::viewer::ui::navigate::{ViewKeys, focus_ui, zoom_factor};
use crate::viewer::ui::pane::{
    Command, Offers, Order, Pane, PaneContext, Place, Progress, Share, Shown, Slot, Start, restored, saved,
};
use crate::viewer::ui::widgets::{narrow, segments_ui, tools_menu_ui};
use crate::viewer::work::dialogs::{Access, Question};
use crate::viewer::work::export;
use crate::viewer::work::mailbox::Sender;
use crate::viewer::work::outbox::{Outbox, in_background};
use crate::viewer::work::scene::{SceneResult, Whole};
use crate::viewer::work::sphere_metrics::{self, MetricsRequest, SphereMetrics};

/// What the views are called, with what the mouse does in them.
const SPHERE_HELP: &str = "Sphere view: drag or arrow keys turn the light";
const OBJECT_HELP: &str = "Object view: drag or arrow keys orbit";

/// Columns of an environment; larger ones are averaged.
const MAX_COLUMNS: usize = 4096;

/// An environment and its file, or why it cannot be read.
type ReadMap = Result<(PathBuf, Arc<Environment>), String>;

/// What the pane is sent.
enum Message {
    Metrics(SphereMetrics),
    Scene(SceneResult),
    Map(ReadMap),
    /// Show what this file holds.
    Open(Shown),
    /// Write the picture to this file.
    Export(PathBuf),
}

/// An environment.
struct Map {
    /// A number that no earlier environment had.
    number: u64,
    name: String,
    environment: Arc<Environment>,
    /// Whether it is the built-in one.
    is_studio: bool,
}

impl Map {
    fn studio(number: u64) -> Self {
        let environment = Arc::new(Environment::studio());
        Self { number, name: "Studio (built in)".to_owned(), environment, is_studio: true }
    }
}

/// The pane of spheres and objects.
pub(crate) struct ThreeD {
    look: SceneLook,
    map: Map,
    object: ObjectView,
    /// The smooth picture that was last made.
    whole: Option<Whole>,
    /// Where the picture is written once it is smooth.
    export: Option<PathBuf>,
    metrics: Sender<MetricsRequest>,
    /// The document and the result whose metrics were last requested.
    measured: Option<(DocumentId, u64)>,
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
            object: ObjectView::new(outbox.map(Message::Scene), None, start)?,
            whole: None,
            export: None,
            metrics: sphere_metrics::spawn(outbox.map(Message::Metrics), start.busy())?,
            measured: None,
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
        if offers.offer(Command::menu("Export picture…")) {
            cx.order(Order::Ask(Question {
                title: "Export picture",
                help: "The lit object as a figure (.png, .svg or .pdf), and linear pictures as EXR files beside it.",
                access: Access::Write { name: "picture.png" },
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
                Message::Metrics(SphereMetrics { document, version, images }) => {
                    let document = cx.documents.get_mut(document);
                    if let Some(fitted) = document.and_then(|d| d.result_mut(version)) {
                        fitted.images = Some(*images);
                    }
                }
                Message::Scene(result) => self.take_scene(ctx, cx, result),
                Message::Map(Ok((path, environment))) => {
                    let name =
                        path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
                    let number = self.map.number + 1;
                    self.map = Map { number, name, environment, is_studio: false };
                    self.look.environment = Some(path);
                }
                Message::Map(Err(message)) => cx.messages.error(message),
                Message::Open(file) => {
                    self.show(&file);
                }
                Message::Export(path) => {
                    self.export = Some(path);
                    self.write_when_smooth(cx);
                }
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
        let picture = self.object.ui(ui, area, &self.look, document);
        moves::drag(ui, &response, &mut self.look, picture);
        self.navigate(ui, &response);
    }

    fn request(&mut self, cx: &mut PaneContext) {
        self.object.request(cx, &self.look, &self.map);
        let Some(request) = cx.documents.selected().and_then(MetricsRequest::of) else { return };
        let key = Some((request.document, request.version));
        if self.measured != key {
            self.measured = key;
            self.metrics.put(request);
        }
    }

    fn progress(&self) -> Progress {
        self.object.progress()
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
            SceneResult::Whole(whole) => {
                self.whole = Some(*whole);
                self.write_when_smooth(cx);
            }
            SceneResult::Failed(message) if self.look.shape == Shape::Sphere => self.object.fail(message),
            SceneResult::Failed(message) => {
                // The sphere needs no file.
                self.look.shape = Shape::Sphere;
                self.object.clear();
                cx.messages.error(message);
            }
            SceneResult::DeviceLost(message) => cx.messages.error(format!("{message}; it is opened anew")),
        }
    }

    /// Writes the picture to the file that waits for it, if there is one and the picture is smooth.
    fn write_when_smooth(&mut self, cx: &mut PaneContext) {
        let Some(document) = cx.documents.selected() else { return };
        let smooth = self.whole.as_ref().filter(|whole| {
            whole.document == document.id && self.object.picture().is_none_or(|shown| shown == whole.picture)
        });
        match (smooth, &self.export) {
            (Some(whole), Some(path)) => {
                export::picture(&document.name, whole, path, &cx.saved);
                self.export = None;
            }
            (None, Some(_)) => cx.messages.note("the picture is written once it is smooth"),
            (_, None) => {}
        }
    }

    /// What wheel, right drag and keys do.
    fn navigate(&mut self, ui: &Ui, response: &egui::Response) {
        let factor = zoom_factor(ui.ctx(), response);
        focus_ui(ui, response);
        let keys = ViewKeys::of(ui.ctx(), response);
        self.look.orbit.enlarge(factor * narrow(keys.zoom));
        moves::turn_by_keys(&mut self.look, &keys);
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

/// A whole picture, within `clip`.
fn whole_ui(ui: &Ui, texture: &TextureHandle, rect: Rect, clip: Rect) {
    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    ui.painter().with_clip_rect(clip).image(texture.id(), rect, whole, Color32::WHITE);
}
