//! The lit object as the graphics device shows it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use eframe::egui::{self, Align, Color32, Context, Rect, RichText, TextureHandle, Ui, pos2, vec2};
use gpbrdf_core::figure::Colormap;

use super::{Map, whole_ui};
use crate::viewer::state::document::{Document, DocumentId};
use crate::viewer::state::look::{SceneLook, SphereShown};
use crate::viewer::ui::pane::{PaneContext, Progress, Start};
use crate::viewer::ui::widgets::{psnr_text, put_texture, scale_ui, short};
use crate::viewer::work::mailbox::Sender;
use crate::viewer::work::outbox::Outbox;
use crate::viewer::work::quality::Quality;
use crate::viewer::work::scene::{Limits, SceneImage, SceneKey, SceneRequest, SceneResult, SceneWork, spawn};

/// Between two pictures side by side.
const GAP: f32 = 4.0;

/// What the colours of differences and of sigma mean.
const DIFFERENCE: &str = "exposure × (prediction − truth), mean of R, G, B";
const SIGMA: &str = "standard deviation of the target, weighted by the reflected light";

/// An object as textures.
struct Shown {
    document: DocumentId,
    /// The number of the request that it answers.
    request: u64,
    picture: u64,
    texture: TextureHandle,
    /// The prediction, where `texture` is the truth alone.
    beside: Option<TextureHandle>,
    samples: Option<u32>,
    is_last: bool,
    limits: Limits,
}

/// The object with its worker.
pub(super) struct ObjectView {
    /// `None` once the view is closed.
    worker: Option<Sender<SceneWork>>,
    is_prepared: bool,
    /// Whether the first picture is awaited, for the fitter.
    awaited: Arc<AtomicBool>,
    requests: u64,
    requested: Option<SceneKey>,
    shown: Option<Shown>,
    pub(super) quality: Option<Quality>,
    /// Why there is no picture.
    failed: Option<String>,
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
        Ok(Self {
            worker: Some(spawn(outbox, device, start.busy())?),
            is_prepared: false,
            awaited: Arc::clone(&start.awaited),
            requests: 0,
            requested: None,
            shown: None,
            quality: None,
            failed: None,
            size: None,
        })
    }

    /// Shows a picture in place of an older one.
    pub(super) fn take(&mut self, ctx: &Context, new: SceneImage) {
        let (first, second) = self.shown.take().map_or((None, None), |s| (Some(s.texture), s.beside));
        let texture = put_texture(ctx, &mut { first }, "object".to_owned(), new.image);
        let put_beside = |image| put_texture(ctx, &mut { second }, "object beside".to_owned(), image);
        let beside = new.beside.map(put_beside);
        let SceneImage { document, request, picture, samples, is_last, limits, .. } = new;
        self.shown = Some(Shown { document, request, picture, texture, beside, samples, is_last, limits });
        self.failed = None;
        self.awaited.store(false, Ordering::Relaxed);
    }

    /// Drops what is shown, so that it is requested again.
    pub(super) fn clear(&mut self) {
        (self.shown, self.quality, self.requested, self.failed) = (None, None, None, None);
    }

    /// Shows why there is no picture. It is not requested again before anything changes.
    pub(super) fn fail(&mut self, message: String) {
        (self.shown, self.quality, self.failed) = (None, None, Some(message));
        self.awaited.store(false, Ordering::Relaxed);
    }

    /// Ends the worker. The graphics driver must not be unloaded while it runs.
    pub(super) fn close(&mut self) {
        if let Some(worker) = self.worker.take() {
            worker.join();
        }
    }

    /// The number of the picture that is shown.
    pub(super) fn picture(&self) -> Option<u64> {
        self.shown.as_ref().map(|shown| shown.picture)
    }

    /// An object refines from the start: what a fit says is shown without waiting for its first picture.
    pub(super) fn progress(&self) -> Progress {
        let compared = self.requested.as_ref().is_some_and(|key| key.truth_is_tabulated);
        let measured = |shown: &Shown| {
            self.quality.is_some_and(|q| q.picture == shown.picture && Some(q.samples) == shown.samples)
        };
        let smooth = self.shown.as_ref().is_some_and(|shown| {
            shown.is_last && shown.request == self.requests && (!compared || measured(shown))
        });
        if smooth || self.requested.is_none() || self.failed.is_some() {
            Progress::Done
        } else {
            Progress::Refining
        }
    }

    /// Requests pictures of the selected material if the object is shown and anything has changed on which
    /// they depend.
    pub(super) fn request(&mut self, cx: &PaneContext, look: &SceneLook, map: &Map) {
        let (Some(worker), Some(size)) = (&self.worker, self.size.take()) else { return };
        if !self.is_prepared {
            self.is_prepared = true;
            worker.put(SceneWork::Prepare);
            self.awaited.store(true, Ordering::Relaxed);
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
            studio: map.is_studio,
            size,
            shown: look.shown,
            swipe: look.swipe,
        };
        if self.requested.as_ref() == Some(&key) {
            return;
        }
        self.requests += 1;
        worker.put(SceneWork::Picture(Box::new(SceneRequest {
            number: self.requests,
            key: key.clone(),
            truth: document.truth.clone(),
            mean: Arc::clone(&fitted.mean),
            sigma: fitted.sigma.clone(),
            environment: Arc::clone(&map.environment),
        })));
        (self.requested, self.failed) = (Some(key), None);
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
        if let Some(message) = self.failed.clone() {
            self.failed_ui(ui, picture, &message);
        } else if let Some(shown) = self.shown.as_ref().filter(|s| s.document == document.id) {
            match &shown.beside {
                Some(beside) => {
                    whole_ui(ui, &shown.texture, left, picture);
                    whole_ui(ui, beside, right, picture);
                }
                None => whole_ui(ui, &shown.texture, picture, picture),
            }
            captions_ui(ui, picture, look, truth_is_tabulated);
            self.footer_ui(ui, picture, shown, look.shown, truth_is_tabulated);
        } else if document.is_busy() || document.fitted.is_some() {
            ui.put(area, egui::Spinner::new().size(28.0));
        }
        one
    }

    fn failed_ui(&mut self, ui: &mut Ui, picture: Rect, message: &str) {
        ui.scope_builder(egui::UiBuilder::new().max_rect(picture.shrink(12.0)).id_salt("no object"), |ui| {
            ui.label(RichText::new("The object cannot be shown").strong());
            ui.label(message);
            if ui.button("Light it again").clicked() {
                self.clear();
            }
        });
    }

    /// The scale of false colours, metrics, and how many samples per pixel there are.
    fn footer_ui(&self, ui: &mut Ui, picture: Rect, shown: &Shown, mode: SphereShown, compared: bool) {
        let rect = Rect::from_min_max(picture.left_bottom() + vec2(6.0, -30.0), picture.max - vec2(6.0, 6.0));
        let Limits { difference, sigma } = shown.limits;
        let scale = match mode {
            SphereShown::Difference if compared => Some((Colormap::Diverging, -difference, difference)),
            SphereShown::Sigma => Some((Colormap::Sequential, 0.0, sigma)),
            _ => None,
        };
        let quality = self.quality.filter(|q| q.document == shown.document && compared);
        ui.scope_builder(egui::UiBuilder::new().max_rect(rect).id_salt("object footer"), |ui| {
            let back = egui::Frame::new().fill(Color32::from_black_alpha(170)).corner_radius(4);
            back.inner_margin(egui::Margin::symmetric(6, 2)).show(ui, |ui| {
                ui.visuals_mut().override_text_color = Some(Color32::WHITE);
                ui.horizontal(|ui| {
                    if let Some((map, low, high)) = scale {
                        let plus = if low < 0.0 { "+" } else { "" };
                        ui.label(short(f64::from(low)));
                        scale_ui(ui, map);
                        ui.label(format!("{plus}{}", short(f64::from(high))));
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
        ui.label(RichText::new(psnr_text(quality.psnr)).strong().color(Color32::WHITE));
        ui.label(format!("SSIM {:.4} at {}", quality.ssim, count(quality.samples)));
    }
    match shown.samples {
        None => {
            ui.label("preview");
        }
        Some(samples) => {
            let same = quality.is_some_and(|q| q.picture == shown.picture && q.samples == samples);
            if !same {
                ui.label(format!("{} shown", count(samples)));
            }
        }
    }
}

/// What the pictures show, and the line between truth and prediction.
fn captions_ui(ui: &mut Ui, picture: Rect, look: &SceneLook, compared: bool) {
    let (first, second) = halves(picture);
    match look.shown {
        SphereShown::Sigma => caption_ui(ui, picture, Align::Min, &format!("Sigma: {SIGMA}")),
        SphereShown::Difference if compared => {
            caption_ui(ui, picture, Align::Min, &format!("Difference: {DIFFERENCE}"));
        }
        SphereShown::Swipe if compared => {
            let x = egui::lerp(picture.left()..=picture.right(), look.swipe);
            let stroke = egui::Stroke::new(1.5, Color32::from_white_alpha(200));
            ui.painter().line_segment([pos2(x, picture.top()), pos2(x, picture.bottom())], stroke);
            caption_ui(ui, first, Align::Min, "Truth");
            caption_ui(ui, second, Align::Max, "Prediction");
        }
        SphereShown::SideBySide if compared => {
            caption_ui(ui, first, Align::Center, "Truth");
            caption_ui(ui, second, Align::Center, "Prediction");
        }
        _ => caption_ui(ui, picture, Align::Min, "Prediction"),
    }
}

/// A text at the upper edge of a picture.
fn caption_ui(ui: &mut Ui, room: Rect, align: Align, text: &str) {
    let font = egui::FontId::proportional(13.0);
    let galley = ui.painter().layout(text.to_owned(), font, Color32::WHITE, (room.width() - 24.0).max(40.0));
    let align = egui::Align2([align, Align::Min]);
    let rect = align.align_size_within_rect(galley.size(), room.shrink2(vec2(12.0, 8.0)));
    ui.painter().rect_filled(rect.expand2(vec2(6.0, 2.0)), 4.0, Color32::from_black_alpha(170));
    ui.put(rect, egui::Label::new(galley));
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
