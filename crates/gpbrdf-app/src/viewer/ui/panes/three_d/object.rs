//! Objects, which are lit on the graphics device.

use std::sync::Arc;

use eframe::egui::{self, Align2, Color32, Context, Rect, RichText, TextureHandle, Ui, pos2, vec2};
use gpbrdf_core::figure::Colormap;

use super::{DIFFERENCE, Map, corners, sphere, square, whole_ui};
use crate::viewer::state::document::{Document, DocumentId};
use crate::viewer::state::look::{Orbit, SceneLook, Shape, SphereShown};
use crate::viewer::ui::navigate::{DRAG_ORBIT, KEY_TURN, ViewKeys};
use crate::viewer::ui::pane::{PaneContext, Start};
use crate::viewer::ui::widgets::{narrow, psnr_text, put_texture, scale_ui, short};
use crate::viewer::work::mailbox::Sender;
use crate::viewer::work::outbox::Outbox;
use crate::viewer::work::quality::Quality;
use crate::viewer::work::scene::{LIMIT, SceneImage, SceneKey, SceneRequest, SceneResult, spawn};

/// Between two pictures side by side.
const GAP: f32 = 4.0;

/// An object as textures.
struct Shown {
    document: DocumentId,
    picture: u64,
    texture: TextureHandle,
    /// The prediction, where `texture` is the truth alone.
    beside: Option<TextureHandle>,
    samples: u32,
}

/// The object with its worker.
pub(super) struct ObjectView {
    /// `None` once the view is closed.
    worker: Option<Sender<SceneRequest>>,
    requested: Option<SceneKey>,
    shown: Option<Shown>,
    pub(super) quality: Option<Quality>,
    /// Pixels of one picture, where the object was drawn in this frame.
    size: Option<[u32; 2]>,
}

impl ObjectView {
    /// Starts the worker, on `device` or else on a device that it opens.
    pub(super) fn new(
        outbox: Outbox<SceneResult>,
        device: Option<gpbrdf_render::Context>,
        start: &Start,
    ) -> std::io::Result<Self> {
        let worker = Some(spawn(outbox, device, start.busy())?);
        Ok(Self { worker, requested: None, shown: None, quality: None, size: None })
    }

    /// Shows a picture in place of an older one.
    pub(super) fn take(&mut self, ctx: &Context, new: SceneImage) {
        let (first, second) = self.shown.take().map_or((None, None), |s| (Some(s.texture), s.beside));
        let texture = put_texture(ctx, &mut { first }, "object".to_owned(), new.image);
        let put_beside = |image| put_texture(ctx, &mut { second }, "object beside".to_owned(), image);
        let beside = new.beside.map(put_beside);
        let (document, picture, samples) = (new.document, new.picture, new.samples);
        self.shown = Some(Shown { document, picture, texture, beside, samples });
    }

    /// Drops what is shown, so that it is requested again.
    pub(super) fn clear(&mut self) {
        (self.shown, self.quality, self.requested) = (None, None, None);
    }

    /// Ends the worker. The graphics driver must not be unloaded while it runs.
    pub(super) fn close(&mut self) {
        if let Some(worker) = self.worker.take() {
            worker.join();
        }
    }

    /// Requests pictures of the selected material if the object is shown and anything has changed on which
    /// they depend.
    pub(super) fn request(&mut self, cx: &PaneContext, look: &SceneLook, map: &Map, exposure: f64) {
        let (Some(worker), Some(size)) = (&self.worker, self.size.take()) else { return };
        if look.shape == Shape::Sphere {
            return;
        }
        let Some(document) = cx.documents.selected() else { return };
        let Some(fitted) = &document.fitted else { return };
        let key = SceneKey {
            document: document.id,
            version: fitted.version,
            truth_is_tabulated: document.truth.is_some(),
            has_sigma: fitted.sigma.is_some(),
            shape: look.shape.clone(),
            orbit: look.orbit,
            light: look.light,
            environment: map.number,
            exposure: narrow(exposure),
            size,
            shown: look.shown,
            swipe: look.swipe,
        };
        if self.requested.as_ref() == Some(&key) {
            return;
        }
        worker.put(SceneRequest {
            key: key.clone(),
            truth: document.truth.clone(),
            mean: Arc::clone(&fitted.mean),
            sigma: fitted.sigma.clone(),
            environment: Arc::clone(&map.environment),
        });
        self.requested = Some(key);
    }

    /// Draws the object of a material; where its picture is, or the left one of two.
    pub(super) fn ui(&mut self, ui: &mut Ui, area: Rect, look: &SceneLook, document: &Document) -> Rect {
        let picture = area.shrink(6.0);
        let truth_is_tabulated = document.truth.is_some();
        let (left, right) = halves(picture);
        let pair = truth_is_tabulated && look.shown == SphereShown::SideBySide;
        let one = if pair { left } else { picture };
        let scale = ui.pixels_per_point().min(1.25);
        self.size = Some([one.width(), one.height()].map(|x| pixels(x * scale)));
        if let Some(shown) = self.shown.as_ref().filter(|s| s.document == document.id) {
            match &shown.beside {
                Some(beside) => {
                    whole_ui(ui, &shown.texture, left, picture);
                    whole_ui(ui, beside, right, picture);
                }
                None => whole_ui(ui, &shown.texture, picture, picture),
            }
            captions_ui(ui, picture, look, truth_is_tabulated);
            self.footer_ui(ui, picture, shown, look.shown, truth_is_tabulated);
        } else {
            ui.put(area, egui::Spinner::new().size(28.0));
        }
        one
    }

    /// The scale of false colours, metrics, and how many samples per pixel there are.
    fn footer_ui(&self, ui: &mut Ui, picture: Rect, shown: &Shown, mode: SphereShown, compared: bool) {
        let rect = Rect::from_min_max(picture.left_bottom() + vec2(6.0, -30.0), picture.max - vec2(6.0, 6.0));
        let scale = match mode {
            SphereShown::Difference if compared => Some((Colormap::Diverging, -f64::from(LIMIT))),
            SphereShown::Sigma => Some((Colormap::Sequential, 0.0)),
            _ => None,
        };
        let quality = self.quality.filter(|q| q.document == shown.document && compared);
        ui.scope_builder(egui::UiBuilder::new().max_rect(rect).id_salt("object footer"), |ui| {
            let back = egui::Frame::new().fill(Color32::from_black_alpha(170)).corner_radius(4);
            back.inner_margin(egui::Margin::symmetric(6, 2)).show(ui, |ui| {
                ui.visuals_mut().override_text_color = Some(Color32::WHITE);
                ui.horizontal(|ui| {
                    if let Some((map, low)) = scale {
                        ui.label(short(low));
                        scale_ui(ui, map);
                        ui.label(short(f64::from(LIMIT)));
                    }
                    quality_ui(ui, quality, shown);
                });
            });
        });
    }
}

/// The metrics, and the samples of the picture where those of the metrics are others.
fn quality_ui(ui: &mut Ui, quality: Option<Quality>, shown: &Shown) {
    let count = |n: u32| if n == 1 { "1 sample".to_owned() } else { format!("{n} samples") };
    if let Some(quality) = quality {
        ui.label(RichText::new(psnr_text(quality.psnr)).strong());
        ui.label(format!("SSIM {:.4} at {}", quality.ssim, count(quality.samples)));
    }
    let same = quality.is_some_and(|q| q.picture == shown.picture && q.samples == shown.samples);
    if !same {
        ui.label(format!("{} shown", count(shown.samples)));
    }
}

/// What the pictures show, and the line between truth and prediction.
fn captions_ui(ui: &Ui, picture: Rect, look: &SceneLook, compared: bool) {
    let [left, right] = corners(picture, vec2(8.0, 6.0));
    let label = |at: egui::Pos2, align: Align2, text: &str| {
        let font = egui::FontId::proportional(13.0);
        ui.painter().text(at + vec2(1.0, 1.0), align, text, font.clone(), Color32::BLACK);
        ui.painter().text(at, align, text, font, Color32::WHITE);
    };
    match look.shown {
        SphereShown::Sigma => label(left, Align2::LEFT_TOP, "Sigma"),
        SphereShown::Difference if compared => label(left, Align2::LEFT_TOP, DIFFERENCE),
        SphereShown::Swipe if compared => {
            let x = egui::lerp(picture.left()..=picture.right(), look.swipe);
            let stroke = egui::Stroke::new(1.5, Color32::from_white_alpha(200));
            ui.painter().line_segment([pos2(x, picture.top()), pos2(x, picture.bottom())], stroke);
            label(left, Align2::LEFT_TOP, "Truth");
            label(right, Align2::RIGHT_TOP, "Prediction");
        }
        SphereShown::SideBySide if compared => {
            let (first, second) = halves(picture);
            for (half, text) in [(first, "Truth"), (second, "Prediction")] {
                label(pos2(half.center().x, left.y), Align2::CENTER_TOP, text);
            }
        }
        _ => label(left, Align2::LEFT_TOP, "Prediction"),
    }
}

/// Left drag orbits; with Ctrl it turns the light, with Shift it moves the line between truth and prediction.
/// A double click resets.
pub(super) fn drag(ui: &Ui, response: &egui::Response, look: &mut SceneLook, picture: Rect) {
    let modifiers = ui.input(|i| i.modifiers);
    if response.double_clicked() {
        (look.orbit, look.swipe) = (Orbit::default(), 0.5);
    } else if modifiers.command || modifiers.shift {
        let disc = if modifiers.shift { picture } else { square(picture) };
        sphere::drag_light(ui, response, look, disc);
    } else if response.dragged_by(egui::PointerButton::Primary) {
        let delta = response.drag_delta() * DRAG_ORBIT;
        look.orbit.turn(-delta.x, delta.y);
    }
}

/// Arrow keys orbit.
pub(super) fn turn_by_keys(look: &mut SceneLook, keys: &ViewKeys) {
    look.orbit.turn(-narrow(KEY_TURN * keys.right), narrow(KEY_TURN * keys.up));
}

/// The places of two pictures side by side.
fn halves(picture: Rect) -> (Rect, Rect) {
    let (left, right) = picture.split_left_right_at_fraction(0.5);
    (left.with_max_x(left.max.x - 0.5 * GAP), right.with_min_x(right.min.x + 0.5 * GAP))
}

/// Whole pixels, few enough for any device.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
fn pixels(x: f32) -> u32 {
    x.round().clamp(16.0, 1600.0) as u32
}
