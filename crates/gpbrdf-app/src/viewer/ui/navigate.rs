//! How views are moved by mouse and keys. Every view that zooms or turns does it at these rates.

use eframe::egui::{self, Context, Key, Response, Ui};
use egui_plot::PlotUi;

use super::widgets::narrow;

/// Logarithm of the zoom for one point of the wheel and for one point of a right drag.
const WHEEL_ZOOM: f32 = 0.004;
const DRAG_ZOOM: f32 = 0.01;
/// The zoom of one press of the plus key.
const KEY_ZOOM: f64 = 1.15;
/// Fraction of a plot by which one press of an arrow key pans.
const KEY_PAN: f64 = 0.1;
/// Radians by which the light turns for one point of a drag.
pub(crate) const DRAG_LIGHT: f64 = 0.01;
/// Radians by which the eye orbits for one point of a drag.
pub(crate) const DRAG_ORBIT: f32 = 0.008;
/// Radians by which the light or the eye turns for one press of an arrow key.
pub(crate) const KEY_TURN: f64 = 0.1;
/// Fraction of the radius of the disc by which one press of an arrow key moves the point light.
pub(crate) const KEY_PLACE: f64 = 0.05;

/// The keys that were pressed for a view that has the focus: arrows, plus and minus, Home.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ViewKeys {
    /// Presses of the arrow to the right less those of the arrow to the left.
    pub(crate) right: f64,
    /// Presses of the arrow up less those of the arrow down.
    pub(crate) up: f64,
    /// The factor by which the view is enlarged.
    pub(crate) zoom: f64,
    pub(crate) reset: bool,
}

impl ViewKeys {
    /// Reads the keys; none were pressed if the view has no focus.
    pub(crate) fn of(ctx: &egui::Context, response: &Response) -> Self {
        if !response.has_focus() {
            return Self { right: 0.0, up: 0.0, zoom: 1.0, reset: false };
        }
        let filter =
            egui::EventFilter { horizontal_arrows: true, vertical_arrows: true, ..Default::default() };
        ctx.memory_mut(|memory| memory.set_focus_lock_filter(response.id, filter));
        ctx.input(|input| {
            let presses =
                |key: Key| if input.modifiers.command { 0.0 } else { input.num_presses(key) as f64 };
            let larger = presses(Key::Plus) + presses(Key::Equals) - presses(Key::Minus);
            Self {
                right: presses(Key::ArrowRight) - presses(Key::ArrowLeft),
                up: presses(Key::ArrowUp) - presses(Key::ArrowDown),
                zoom: KEY_ZOOM.powf(larger),
                reset: input.key_pressed(Key::Home),
            }
        })
    }
}

/// Shows that a view has the focus.
pub(crate) fn focus_ui(ui: &Ui, response: &Response) {
    if response.has_focus() {
        let stroke = ui.visuals().selection.stroke;
        ui.painter().rect_stroke(response.rect, 4.0, stroke, egui::StrokeKind::Inside);
    }
}

/// The factor by which wheel and right drag enlarge a view in this frame.
pub(crate) fn zoom_factor(ctx: &Context, response: &Response) -> f32 {
    let mut log = 0.0;
    if response.hovered() {
        log += WHEEL_ZOOM * ctx.input(|i| i.smooth_scroll_delta().y);
    }
    if response.dragged_by(egui::PointerButton::Secondary) {
        log += DRAG_ZOOM * (response.drag_delta().x - response.drag_delta().y);
    }
    log.exp()
}

/// Zooms and pans a plot by wheel, right drag and keys.
pub(crate) fn navigate_plot(plot: &mut PlotUi<'_>) {
    let response = plot.response().clone();
    let ctx = plot.ctx().clone();
    let factor = zoom_factor(&ctx, &response);
    if (factor - 1.0).abs() > 1e-6 {
        plot.zoom_bounds_around_hovered(egui::Vec2::splat(factor));
    }
    let keys = ViewKeys::of(&ctx, &response);
    if keys.right != 0.0 || keys.up != 0.0 {
        let bounds = plot.plot_bounds();
        let step = [KEY_PAN * keys.right * bounds.width(), KEY_PAN * keys.up * bounds.height()];
        plot.translate_bounds(egui::Vec2::from(step.map(narrow)));
    }
    if keys.zoom != 1.0 {
        plot.zoom_bounds(egui::Vec2::splat(narrow(keys.zoom)), plot.plot_bounds().center());
    }
}
