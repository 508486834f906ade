//! The lit sphere: truth and prediction either side of a line, their difference, sigma.

use eframe::egui::{self, Color32, Rect, RichText, Sense, TextureHandle, Ui, pos2, vec2};
use gpbrdf_core::Colormap;

use crate::viewer::app::{ShownSpheres, Viewer};
use crate::viewer::state::settings::SphereShown;
use crate::viewer::ui::panes::slices::scale_ui;
use crate::viewer::ui::widgets::{Number, ViewKeys, focus_ui, narrow, segments_ui, short, tools_menu_ui};
use crate::viewer::work::dialogs::Purpose;
use crate::viewer::work::scene::{Orbit, Shape};
use crate::viewer::work::spheres::SphereLight;

/// What the views are called, with what the mouse does in them.
const SPHERE_HELP: &str = "Sphere view: drag or arrow keys turn the light";
const OBJECT_HELP: &str = "Object view: drag or arrow keys orbit";

impl Viewer {
    /// The sphere and its controls.
    pub(crate) fn sphere_ui(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new("3-D").strong().size(15.0));
            ui.add_space(6.0);
            segments_ui(ui, &mut self.settings.sphere, &SphereShown::ALL, SphereShown::name);
            tools_menu_ui(ui, "Shape", |ui| self.shape_ui(ui));
            tools_menu_ui(ui, "Light", |ui| self.light_ui(ui));
        });
        let Some(id) = self.document().map(|d| d.id) else { return };
        let area = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(area, Sense::click_and_drag());
        let name = if self.settings.shape == Shape::Sphere { SPHERE_HELP } else { OBJECT_HELP };
        response.widget_info(|| egui::WidgetInfo::labeled(egui::accesskit::Role::Canvas, true, name));
        ui.painter().rect_filled(area, 6.0, ui.visuals().extreme_bg_color);
        if self.settings.shape != Shape::Sphere {
            self.object_ui(ui, &response, area);
            return;
        }
        let Some(shown) = self.spheres.as_ref().filter(|s| s.images.key.document == id) else {
            ui.put(area, egui::Spinner::new().size(28.0));
            return;
        };
        let top = area.top() + 8.0;
        let picture = Rect::from_min_max(pos2(area.left() + 8.0, top), area.max - vec2(8.0, 30.0));
        let text = ui.visuals().strong_text_color();
        let font = egui::FontId::proportional(13.0);
        let mode = if shown.truth.is_some() { self.settings.sphere } else { only(self.settings.sphere) };
        let caption = |at: egui::Pos2, align: egui::Align2, words: &str| {
            ui.painter().text(at, align, words, font.clone(), text);
        };
        let zoom = self.settings.orbit.zoom;
        let zoomed = |area: Rect| {
            let square = square(area);
            Rect::from_center_size(square.center(), square.size() * zoom)
        };
        let mut disc = zoomed(picture);
        match (mode, &shown.truth) {
            (SphereShown::Swipe, Some(truth)) => {
                let line = egui::lerp(disc.left()..=disc.right(), self.settings.swipe);
                part(ui, truth, disc, [disc.left(), line], picture);
                part(ui, &shown.mean, disc, [line, disc.right()], picture);
                let stroke = egui::Stroke::new(1.5, text.gamma_multiply(0.8));
                let (upper, lower) = (disc.top().max(picture.top()), disc.bottom().min(picture.bottom()));
                if picture.x_range().contains(line) {
                    ui.painter().line_segment([pos2(line, upper), pos2(line, lower)], stroke);
                }
                caption(pos2(area.left() + 12.0, top), egui::Align2::LEFT_TOP, "Truth");
                caption(pos2(area.right() - 12.0, top), egui::Align2::RIGHT_TOP, "Prediction");
            }
            (SphereShown::SideBySide, Some(truth)) => {
                let (left, right) = picture.split_left_right_at_fraction(0.5);
                let (left, right) = (left.shrink(4.0), right.shrink(4.0));
                disc = zoomed(left);
                whole(ui, truth, disc, left);
                whole(ui, &shown.mean, zoomed(right), right);
                caption(pos2(left.center().x, top), egui::Align2::CENTER_TOP, "Truth");
                caption(pos2(right.center().x, top), egui::Align2::CENTER_TOP, "Prediction");
            }
            (SphereShown::Difference, _) => {
                let image = shown.difference.as_ref().unwrap_or(&shown.mean);
                whole(ui, image, disc, picture);
                caption(pos2(area.left() + 12.0, top), egui::Align2::LEFT_TOP, "1 - prediction / truth");
            }
            (SphereShown::Sigma, _) if shown.sigma.is_some() => {
                let image = shown.sigma.as_ref().unwrap_or(&shown.mean);
                whole(ui, image, disc, picture);
                caption(
                    pos2(area.left() + 12.0, top),
                    egui::Align2::LEFT_TOP,
                    "Sigma, averaged over the light",
                );
            }
            _ => {
                whole(ui, &shown.mean, disc, picture);
                caption(pos2(area.left() + 12.0, top), egui::Align2::LEFT_TOP, "Prediction");
            }
        }
        footer_ui(ui, area, shown, mode);
        self.sphere_drag(ui, &response, disc);
        self.zoom_drag(ui, &response);
        focus_ui(ui, &response);
        let keys = ViewKeys::of(ui.ctx(), &response);
        let light = &mut self.settings.light;
        if light.point {
            let [x, y] = [light.at[0] + 0.05 * keys.right, light.at[1] + 0.05 * keys.up];
            let scale = x.hypot(y).max(1.0);
            light.at = [x / scale, y / scale];
        } else {
            light.yaw += 0.1 * keys.right;
            light.pitch -= 0.1 * keys.up;
        }
        self.view_keys(&keys);
    }

    /// What keys do in both views.
    pub(crate) fn view_keys(&mut self, keys: &ViewKeys) {
        let orbit = &mut self.settings.orbit;
        orbit.zoom = (orbit.zoom * narrow(keys.zoom)).clamp(0.3, 6.0);
        if keys.reset {
            let point = self.settings.light.point;
            self.settings.light = SphereLight { point, ..SphereLight::default() };
            (self.settings.orbit, self.settings.swipe) = (Orbit::default(), 0.5);
        }
    }

    pub(crate) fn sphere_drag(&mut self, ui: &Ui, response: &egui::Response, disc: Rect) {
        let light = &mut self.settings.light;
        if response.double_clicked() {
            *light = SphereLight { point: light.point, ..SphereLight::default() };
            (self.settings.swipe, self.settings.orbit.zoom) = (0.5, 1.0);
        } else if response.dragged_by(egui::PointerButton::Primary)
            && let Some(at) = response.interact_pointer_pos()
        {
            let x = (at.x - disc.center().x) / (0.5 * disc.width());
            let y = (disc.center().y - at.y) / (0.5 * disc.height());
            if ui.input(|i| i.modifiers.shift) {
                self.settings.swipe = (0.5 + 0.5 * x).clamp(0.0, 1.0);
            } else if light.point {
                let scale = x.hypot(y).max(1.0);
                light.at = [f64::from(x / scale), f64::from(y / scale)];
            } else {
                light.yaw += f64::from(response.drag_delta().x) * 0.01;
                light.pitch += f64::from(response.drag_delta().y) * 0.01;
            }
        }
    }

    fn shape_ui(&mut self, ui: &mut Ui) {
        let mut shapes = vec![Shape::Sphere, Shape::Knot, Shape::RoundedBox];
        if let Shape::File(_) = &self.settings.shape {
            shapes.push(self.settings.shape.clone());
        }
        for shape in shapes {
            if ui.radio(self.settings.shape == shape, shape.name()).clicked() {
                self.settings.shape = shape;
            }
        }
        if ui.button("OBJ file…").clicked() {
            self.ask_where(Purpose::Object, "");
            ui.close();
        }
        ui.separator();
        let fallback = Orbit::default();
        let orbit = &mut self.settings.orbit;
        let mut row = |label: &str, range, default: f32, help: &str, value: &mut f32| {
            let mut shown = f64::from(*value);
            if Number::new(label, range, f64::from(default), help).row_ui(ui, &mut shown) {
                *value = narrow(shown);
            }
        };
        row(
            "Azimuth",
            -3.15..=3.15,
            fallback.azimuth,
            "Of the eye about an object, radians",
            &mut orbit.azimuth,
        );
        row(
            "Elevation",
            -1.5..=1.5,
            fallback.elevation,
            "Of the eye over an object, radians",
            &mut orbit.elevation,
        );
        row("Zoom", 0.3..=6.0, fallback.zoom, "How large it is", &mut orbit.zoom);
    }

    /// Wheel and right drag zoom.
    pub(crate) fn zoom_drag(&mut self, ui: &Ui, response: &egui::Response) {
        let mut factor = 1.0;
        if response.hovered() {
            factor *= (0.004 * ui.input(|i| i.smooth_scroll_delta().y)).exp();
        }
        if response.dragged_by(egui::PointerButton::Secondary) {
            factor *= (0.01 * (response.drag_delta().x - response.drag_delta().y)).exp();
        }
        if factor != 1.0 {
            self.settings.orbit.zoom = (self.settings.orbit.zoom * factor).clamp(0.3, 6.0);
        }
    }

    fn light_ui(&mut self, ui: &mut Ui) {
        let light = &mut self.settings.light;
        ui.radio_value(&mut light.point, false, format!("Environment: {}", self.environment.1));
        ui.radio_value(&mut light.point, true, "Point light");
        let number = Number::new("Exposure", -8.0..=8.0, 0.0, "Stops");
        number.row_ui(ui, &mut light.exposure);
        let mut swipe = f64::from(self.settings.swipe);
        let number = Number::new("Swipe", 0.0..=1.0, 0.5, "Where truth ends and prediction begins");
        if number.row_ui(ui, &mut swipe) {
            self.settings.swipe = narrow(swipe);
        }
        let degrees = |ui: &mut Ui, label: &str, help: &str, value: &mut f64| {
            let mut shown = value.to_degrees();
            let mut number = Number::new(label, -180.0..=180.0, 0.0, help);
            number.suffix = "°";
            if number.row_ui(ui, &mut shown) {
                *value = shown.to_radians();
            }
        };
        if light.point {
            let fallback = SphereLight::default().at;
            let mut at = light.at;
            let mut changed = false;
            for (k, name) in ["Light x", "Light y"].into_iter().enumerate() {
                let number =
                    Number::new(name, -1.0..=1.0, fallback[k], "Where the light stands over the disc");
                changed |= number.row_ui(ui, &mut at[k]);
            }
            if changed {
                let scale = at[0].hypot(at[1]).max(1.0);
                light.at = at.map(|x| x / scale);
            }
        } else {
            degrees(ui, "Turned", "The environment about the vertical axis", &mut light.yaw);
            degrees(
                ui,
                "Tilted",
                "The environment about the horizontal axis, of the sphere only",
                &mut light.pitch,
            );
        }
        ui.separator();
        if ui.button("Environment map…").clicked() {
            self.ask_where(Purpose::Environment, "");
            ui.close();
        }
        if ui.button("Built-in studio").clicked() {
            self.use_studio();
        }
    }
}

/// What can be shown without a truth.
fn only(mode: SphereShown) -> SphereShown {
    if mode == SphereShown::Sigma { mode } else { SphereShown::Swipe }
}

/// The largest square in the middle of a rectangle.
pub(crate) fn square(rect: Rect) -> Rect {
    Rect::from_center_size(rect.center(), egui::Vec2::splat(rect.size().min_elem().max(1.0)))
}

/// The part of a picture between two vertical lines, within `clip`.
fn part(ui: &Ui, texture: &TextureHandle, rect: Rect, [left, right]: [f32; 2], clip: Rect) {
    if right <= left {
        return;
    }
    let u = |x: f32| (x - rect.left()) / rect.width();
    let uv = Rect::from_min_max(pos2(u(left), 0.0), pos2(u(right), 1.0));
    let area = Rect::from_min_max(pos2(left, rect.top()), pos2(right, rect.bottom()));
    ui.painter().with_clip_rect(clip).image(texture.id(), area, uv, Color32::WHITE);
}

/// A whole picture of a sphere, within `clip`.
fn whole(ui: &Ui, texture: &TextureHandle, rect: Rect, clip: Rect) {
    part(ui, texture, rect, [rect.left(), rect.right()], clip);
}

/// A peak signal-to-noise ratio for people.
pub(crate) fn psnr_text(psnr: f64) -> String {
    if psnr.is_finite() { format!("PSNR {psnr:.1} dB") } else { "PSNR ∞ dB".to_owned() }
}

fn footer_ui(ui: &mut Ui, area: Rect, shown: &ShownSpheres, mode: SphereShown) {
    let rect = Rect::from_min_max(pos2(area.left() + 12.0, area.bottom() - 28.0), area.max - vec2(12.0, 4.0));
    ui.scope_builder(egui::UiBuilder::new().max_rect(rect).id_salt("sphere footer"), |ui| {
        ui.horizontal_centered(|ui| {
            let images = &shown.images;
            let scale = match mode {
                SphereShown::Difference => {
                    images.difference.as_ref().map(|d| (Colormap::Diverging, -d.1, d.1))
                }
                SphereShown::Sigma => images.sigma.as_ref().map(|s| (Colormap::Sequential, 0.0, s.1)),
                _ => None,
            };
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
