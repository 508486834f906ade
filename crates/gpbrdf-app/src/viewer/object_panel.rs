//! Objects lit on the device: truth and prediction either side of a line or side by side, their difference, sigma.

use eframe::egui::{self, Align2, Color32, Rect, RichText, Ui, pos2, vec2};
use gpbrdf_core::Colormap;

use super::app::{ShownScene, Viewer};
use super::scene::{LIMIT, Orbit};
use super::settings::SphereShown;
use super::slices_panel::scale_ui;
use super::sphere_panel::{psnr_text, square};
use super::widgets::{ViewKeys, focus_ui, narrow, short};

/// Between two pictures side by side.
const GAP: f32 = 4.0;

impl Viewer {
    /// An object: left drag orbits, right drag and wheel zoom, Ctrl + drag turns the light.
    pub(crate) fn object_ui(&mut self, ui: &mut Ui, response: &egui::Response, area: Rect) {
        let picture = area.shrink(6.0);
        let has_truth = self.document().is_some_and(|d| d.truth.is_some());
        let pair = has_truth && self.settings.sphere == SphereShown::SideBySide;
        let (left, right) = halves(picture);
        let one = if pair { left } else { picture };
        let scale = ui.pixels_per_point().min(1.25);
        self.scene_size = [one.width(), one.height()].map(|x| pixels(x * scale));
        let Some(id) = self.document().map(|d| d.id) else { return };
        if let Some(scene) = self.scene.as_ref().filter(|s| s.document == id) {
            let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            match &scene.beside {
                Some(beside) => {
                    ui.painter().image(scene.texture.id(), left, uv, Color32::WHITE);
                    ui.painter().image(beside.id(), right, uv, Color32::WHITE);
                }
                None => {
                    ui.painter().image(scene.texture.id(), picture, uv, Color32::WHITE);
                }
            }
            self.captions_ui(ui, picture, has_truth);
            self.foot_ui(ui, picture, scene, has_truth);
        } else {
            ui.put(area, egui::Spinner::new().size(28.0));
        }
        self.orbit_drag(ui, response, if pair { left } else { picture });
    }

    fn captions_ui(&self, ui: &Ui, picture: Rect, has_truth: bool) {
        let label = |x: f32, align: Align2, text: &str| {
            let at = pos2(x, picture.top() + 6.0);
            let font = egui::FontId::proportional(13.0);
            ui.painter().text(at + vec2(1.0, 1.0), align, text, font.clone(), Color32::BLACK);
            ui.painter().text(at, align, text, font, Color32::WHITE);
        };
        let from_left = |text: &str| label(picture.left() + 8.0, Align2::LEFT_TOP, text);
        match self.settings.sphere {
            SphereShown::Sigma => from_left("Sigma"),
            SphereShown::Difference if has_truth => from_left("Prediction - truth, exposed, mean of R, G, B"),
            SphereShown::Swipe if has_truth => {
                let x = egui::lerp(picture.left()..=picture.right(), self.settings.swipe);
                let stroke = egui::Stroke::new(1.5, Color32::from_white_alpha(200));
                ui.painter().line_segment([pos2(x, picture.top()), pos2(x, picture.bottom())], stroke);
                from_left("Truth");
                label(picture.right() - 8.0, Align2::RIGHT_TOP, "Prediction");
            }
            SphereShown::SideBySide if has_truth => {
                let (left, right) = halves(picture);
                label(left.center().x, Align2::CENTER_TOP, "Truth");
                label(right.center().x, Align2::CENTER_TOP, "Prediction");
            }
            _ => from_left("Prediction"),
        }
    }

    /// Scale, metrics and how smooth the picture is.
    fn foot_ui(&self, ui: &mut Ui, picture: Rect, scene: &ShownScene, has_truth: bool) {
        let rect = Rect::from_min_max(picture.left_bottom() + vec2(6.0, -30.0), picture.max - vec2(6.0, 6.0));
        let scale = match self.settings.sphere {
            SphereShown::Difference if has_truth => Some((Colormap::Diverging, -f64::from(LIMIT))),
            SphereShown::Sigma => Some((Colormap::Sequential, 0.0)),
            _ => None,
        };
        let quality = self.quality.filter(|q| q.document == scene.document && has_truth);
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
                    let many = |n: u32| if n == 1 { "1 sample".to_owned() } else { format!("{n} samples") };
                    if let Some(quality) = quality {
                        ui.label(RichText::new(psnr_text(quality.psnr)).strong());
                        ui.label(format!("SSIM {:.4} at {}", quality.ssim, many(quality.samples)));
                    }
                    let measured = quality.is_some_and(|q| q.picture == scene.picture);
                    if !measured || quality.is_some_and(|q| q.samples != scene.samples) {
                        ui.label(format!("{} shown", many(scene.samples)));
                    }
                });
            });
        });
    }

    fn orbit_drag(&mut self, ui: &Ui, response: &egui::Response, picture: Rect) {
        let modifiers = ui.input(|i| i.modifiers);
        if response.double_clicked() {
            self.settings.orbit = Orbit::default();
            self.settings.swipe = 0.5;
        } else if modifiers.command || modifiers.shift {
            self.sphere_drag(ui, response, if modifiers.shift { picture } else { square(picture) });
        } else if response.dragged_by(egui::PointerButton::Primary) {
            let orbit = &mut self.settings.orbit;
            orbit.azimuth -= response.drag_delta().x * 0.008;
            orbit.elevation = (orbit.elevation + response.drag_delta().y * 0.008).clamp(-1.5, 1.5);
        }
        self.zoom_drag(ui, response);
        focus_ui(ui, response);
        let keys = ViewKeys::of(ui.ctx(), response);
        let orbit = &mut self.settings.orbit;
        orbit.azimuth -= narrow(0.1 * keys.right);
        orbit.elevation = (orbit.elevation + narrow(0.1 * keys.up)).clamp(-1.5, 1.5);
        self.view_keys(&keys);
    }
}

/// Where two pictures stand side by side.
fn halves(picture: Rect) -> (Rect, Rect) {
    let (left, right) = picture.split_left_right_at_fraction(0.5);
    (left.with_max_x(left.max.x - 0.5 * GAP), right.with_min_x(right.min.x + 0.5 * GAP))
}

/// Whole pixels, few enough for any device.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
fn pixels(x: f32) -> u32 {
    x.round().clamp(16.0, 1600.0) as u32
}
