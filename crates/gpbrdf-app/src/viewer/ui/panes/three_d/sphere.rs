//! The lit sphere.

use std::sync::Arc;

use eframe::egui::{self, Align2, Context, Rect, RichText, TextureHandle, Ui, pos2, vec2};
use gpbrdf_core::figure::Colormap;

use super::{DIFFERENCE, Map, corners, part_ui, square, whole_ui};
use crate::viewer::state::document::DocumentId;
use crate::viewer::state::look::{SceneLook, SphereShown};
use crate::viewer::ui::navigate::{DRAG_LIGHT, KEY_PLACE, KEY_TURN, ViewKeys};
use crate::viewer::ui::pane::{PaneContext, Progress, Start};
use crate::viewer::ui::widgets::{psnr_text, put_texture, scale_ui, short};
use crate::viewer::work::mailbox::Sender;
use crate::viewer::work::outbox::Outbox;
use crate::viewer::work::spheres::{SphereImages, SphereKey, SphereRequest, SphereResult, spawn};

/// Spheres as textures.
struct Shown {
    images: SphereImages,
    truth: Option<TextureHandle>,
    mean: TextureHandle,
    difference: Option<TextureHandle>,
    sigma: Option<TextureHandle>,
}

/// The sphere with its worker.
pub(super) struct SphereView {
    worker: Sender<SphereRequest>,
    requested: Option<SphereKey>,
    shown: Option<Shown>,
}

impl SphereView {
    /// Starts the worker.
    pub(super) fn new(outbox: Outbox<SphereResult>, start: &Start) -> std::io::Result<Self> {
        Ok(Self { worker: spawn(outbox, start.busy())?, requested: None, shown: None })
    }

    /// The pictures that are shown.
    pub(super) fn images(&self) -> Option<&SphereImages> {
        self.shown.as_ref().map(|shown| &shown.images)
    }

    /// The factor of radiance in the pictures.
    pub(super) fn exposure(&self) -> Option<f64> {
        self.images().map(|images| images.exposure)
    }

    /// A sphere refines from the start: what a fit says is shown without waiting for its first picture.
    pub(super) fn progress(&self) -> Progress {
        let shown = self.images().map(|images| (images.key, images.fine));
        if shown == self.requested.map(|key| (key, true)) { Progress::Done } else { Progress::Refining }
    }

    /// Shows pictures in place of older ones.
    pub(super) fn take(&mut self, ctx: &Context, images: SphereImages) {
        let load = |name: &str, image: &egui::ColorImage| {
            put_texture(ctx, &mut None, format!("sphere {name}"), image.clone())
        };
        self.shown = Some(Shown {
            truth: images.truth.as_ref().map(|image| load("truth", image)),
            mean: load("prediction", &images.mean),
            difference: images.difference.as_ref().map(|(image, _)| load("difference", image)),
            sigma: images.sigma.as_ref().map(|(image, _)| load("sigma", image)),
            images,
        });
    }

    /// Requests spheres of the selected material if anything has changed on which they depend.
    pub(super) fn request(&mut self, cx: &PaneContext, look: &SceneLook, map: &Map) {
        let Some(document) = cx.documents.selected() else {
            (self.requested, self.shown) = (None, None);
            return;
        };
        let Some(fitted) = &document.fitted else { return };
        let key = SphereKey {
            document: document.id,
            version: fitted.version,
            light: look.light,
            environment: map.number,
            truth_is_tabulated: document.truth.is_some(),
            has_sigma: fitted.sigma.is_some(),
        };
        if self.requested == Some(key) {
            return;
        }
        self.worker.put(SphereRequest {
            key,
            truth: document.truth.clone(),
            mean: Arc::clone(&fitted.mean),
            sigma: fitted.sigma.clone(),
            environment: Arc::clone(&map.environment),
            wants_metrics: document.source_is_truth() && fitted.images.is_none(),
        });
        self.requested = Some(key);
    }

    /// Draws the sphere of a material; where its disc is, or the left one of two. `None` while there is no
    /// picture.
    pub(super) fn ui(&self, ui: &mut Ui, area: Rect, look: &SceneLook, document: DocumentId) -> Option<Rect> {
        let Some(shown) = self.shown.as_ref().filter(|s| s.images.key.document == document) else {
            ui.put(area, egui::Spinner::new().size(28.0));
            return None;
        };
        let picture = Rect::from_min_max(area.min + vec2(8.0, 8.0), area.max - vec2(8.0, 30.0));
        let mode = if shown.truth.is_some() { look.shown } else { without_truth(look.shown) };
        let canvas = Canvas { ui, area, picture, look };
        let disc = match (mode, &shown.truth) {
            (SphereShown::Swipe, Some(truth)) => canvas.swipe_ui(truth, &shown.mean),
            (SphereShown::SideBySide, Some(truth)) => canvas.pair_ui(truth, &shown.mean),
            (SphereShown::Difference, _) => {
                canvas.single_ui(shown.difference.as_ref().unwrap_or(&shown.mean), DIFFERENCE)
            }
            (SphereShown::Sigma, _) if shown.sigma.is_some() => {
                let sigma = shown.sigma.as_ref().unwrap_or(&shown.mean);
                canvas.single_ui(sigma, "Sigma, averaged over the light")
            }
            _ => canvas.single_ui(&shown.mean, "Prediction"),
        };
        footer_ui(ui, area, &shown.images, mode);
        Some(disc)
    }
}

/// What can be shown without a truth.
fn without_truth(mode: SphereShown) -> SphereShown {
    if mode == SphereShown::Sigma { mode } else { SphereShown::Swipe }
}

/// Where spheres are drawn.
struct Canvas<'a> {
    ui: &'a Ui,
    area: Rect,
    picture: Rect,
    look: &'a SceneLook,
}

impl Canvas<'_> {
    /// Truth and prediction in one disc, on either side of a line.
    fn swipe_ui(&self, truth: &TextureHandle, mean: &TextureHandle) -> Rect {
        let (ui, picture, disc) = (self.ui, self.picture, self.disc(self.picture));
        let line = egui::lerp(disc.left()..=disc.right(), self.look.swipe);
        part_ui(ui, truth, disc, [disc.left(), line], picture);
        part_ui(ui, mean, disc, [line, disc.right()], picture);
        let stroke = egui::Stroke::new(1.5, ui.visuals().strong_text_color().gamma_multiply(0.8));
        let (upper, lower) = (disc.top().max(picture.top()), disc.bottom().min(picture.bottom()));
        if picture.x_range().contains(line) {
            ui.painter().line_segment([pos2(line, upper), pos2(line, lower)], stroke);
        }
        let [left, right] = corners(self.area, vec2(12.0, 8.0));
        self.caption_ui(left, Align2::LEFT_TOP, "Truth");
        self.caption_ui(right, Align2::RIGHT_TOP, "Prediction");
        disc
    }

    /// Truth and prediction side by side.
    fn pair_ui(&self, truth: &TextureHandle, mean: &TextureHandle) -> Rect {
        let (left, right) = self.picture.split_left_right_at_fraction(0.5);
        let halves = [(left.shrink(4.0), truth, "Truth"), (right.shrink(4.0), mean, "Prediction")];
        for (half, texture, words) in halves {
            whole_ui(self.ui, texture, self.disc(half), half);
            self.caption_ui(pos2(half.center().x, self.picture.top()), Align2::CENTER_TOP, words);
        }
        self.disc(left.shrink(4.0))
    }

    fn single_ui(&self, texture: &TextureHandle, words: &str) -> Rect {
        let disc = self.disc(self.picture);
        whole_ui(self.ui, texture, disc, self.picture);
        let [left, _] = corners(self.area, vec2(12.0, 8.0));
        self.caption_ui(left, Align2::LEFT_TOP, words);
        disc
    }

    fn caption_ui(&self, at: egui::Pos2, align: Align2, words: &str) {
        let colour = self.ui.visuals().strong_text_color();
        self.ui.painter().text(at, align, words, egui::FontId::proportional(13.0), colour);
    }

    /// The square around the sphere, which may be larger than the room for it.
    fn disc(&self, room: Rect) -> Rect {
        let square = square(room);
        Rect::from_center_size(square.center(), square.size() * self.look.orbit.zoom)
    }
}

/// The scale of false colours, metrics, and whether finer pictures follow.
fn footer_ui(ui: &mut Ui, area: Rect, images: &SphereImages, mode: SphereShown) {
    let rect = Rect::from_min_max(pos2(area.left() + 12.0, area.bottom() - 28.0), area.max - vec2(12.0, 4.0));
    let scale = match mode {
        SphereShown::Difference => images.difference.as_ref().map(|d| (Colormap::Diverging, -d.1, d.1)),
        SphereShown::Sigma => images.sigma.as_ref().map(|s| (Colormap::Sequential, 0.0, s.1)),
        SphereShown::Swipe | SphereShown::SideBySide => None,
    };
    ui.scope_builder(egui::UiBuilder::new().max_rect(rect).id_salt("sphere footer"), |ui| {
        ui.horizontal_centered(|ui| {
            if let Some((map, low, high)) = scale {
                ui.label(short(low));
                scale_ui(ui, map);
                ui.label(short(high));
                ui.add_space(12.0);
            }
            if let (Some(psnr), Some(ssim)) = (images.psnr, images.ssim) {
                ui.label(RichText::new(psnr_text(psnr)).strong());
                ui.label(format!("SSIM {ssim:.4}"));
            }
            if !images.fine {
                ui.weak("refining");
            }
        });
    });
}

/// Left drag turns the light, or moves the line between truth and prediction with Shift; a double click
/// resets.
pub(super) fn drag(ui: &Ui, response: &egui::Response, look: &mut SceneLook, disc: Rect) {
    if response.double_clicked() {
        look.light.reset();
        (look.swipe, look.orbit.zoom) = (0.5, 1.0);
    } else {
        drag_light(ui, response, look, disc);
    }
}

/// Left drag turns the light, or moves the line between truth and prediction with Shift.
pub(super) fn drag_light(ui: &Ui, response: &egui::Response, look: &mut SceneLook, disc: Rect) {
    if !response.dragged_by(egui::PointerButton::Primary) {
        return;
    }
    let Some(at) = response.interact_pointer_pos() else { return };
    let x = (at.x - disc.center().x) / (0.5 * disc.width());
    let y = (disc.center().y - at.y) / (0.5 * disc.height());
    if ui.input(|i| i.modifiers.shift) {
        look.swipe = (0.5 + 0.5 * x).clamp(0.0, 1.0);
    } else if look.light.point {
        look.light.place([f64::from(x), f64::from(y)]);
    } else {
        look.light.yaw += f64::from(response.drag_delta().x) * DRAG_LIGHT;
        look.light.pitch += f64::from(response.drag_delta().y) * DRAG_LIGHT;
    }
}

/// Arrow keys turn the light.
pub(super) fn turn_by_keys(look: &mut SceneLook, keys: &ViewKeys) {
    let light = &mut look.light;
    if light.point {
        light.place([light.at[0] + KEY_PLACE * keys.right, light.at[1] + KEY_PLACE * keys.up]);
    } else {
        light.yaw += KEY_TURN * keys.right;
        light.pitch -= KEY_TURN * keys.up;
    }
}
