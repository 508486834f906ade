//! The hemisphere of the detector seen from above, in degrees, with the light turned to the right: half of it, since no
//! isotropic and bilateral material tells both sides of the plane of incidence from each other.

use std::f64::consts::PI;

use eframe::egui::{self, Align2, Color32, Response, RichText, Ui};
use egui_plot::{Line, Plot, PlotPoint, PlotPoints, PlotUi, Text};
use gpbrdf_core::nalgebra::Vector3;

use super::navigate::{ViewKeys, focus_ui};

/// The most measured directions that are drawn.
pub(crate) const MOST_DRAWN: usize = 6000;

/// The place of a direction by its angle from the normal, in degrees, and its azimuth from the light, in radians.
pub(crate) fn place(theta: f64, phi: f64) -> [f64; 2] {
    [theta * phi.cos(), theta * phi.sin()]
}

/// The angle of a direction from the normal, degrees.
pub(crate) fn polar(w: &Vector3<f64>) -> f64 {
    w.z.clamp(-1.0, 1.0).acos().to_degrees()
}

/// The angle between the azimuths of two directions, 0 to pi.
pub(crate) fn azimuth_between(wi: &Vector3<f64>, wo: &Vector3<f64>) -> f64 {
    (wo.y * wi.x - wo.x * wi.y).abs().atan2(wo.x * wi.x + wo.y * wi.y)
}

/// The plot that the half disc fills; `reset` shows all of it again.
pub(crate) fn plot(ui: &Ui, id: &'static str, reset: bool) -> Plot<'static> {
    let plot = Plot::new(id)
        .data_aspect(1.0)
        .height(ui.available_height())
        .include_x(-98.0)
        .include_x(98.0)
        .include_y(-8.0)
        .include_y(98.0)
        .show_axes(false)
        .show_grid(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .label_formatter(|_| None);
    if reset { plot.reset() } else { plot }
}

/// Draws half circles of equal angle from the normal, and the plane of incidence.
pub(crate) fn rings(plot: &mut PlotUi<'_>, line: Color32, text: Color32) {
    for theta in [30.0, 60.0, 90.0] {
        let circle: Vec<[f64; 2]> = (0..=90).map(|i| place(theta, f64::from(i) * PI / 90.0)).collect();
        plot.line(Line::new("ring", PlotPoints::from(circle)).color(line).width(1.0).allow_hover(false));
        let label = RichText::new(format!("{theta:.0}°")).color(text).size(11.0);
        let at = PlotPoint::new(0.0, theta + 1.0);
        plot.text(Text::new("angle", at, label).anchor(Align2::CENTER_BOTTOM).allow_hover(false));
    }
    let base = PlotPoints::from(vec![[-90.0, 0.0], [90.0, 0.0]]);
    plot.line(Line::new("plane of incidence", base).color(line).width(1.0).allow_hover(false));
}

/// Names the plot that was shown and reads its keys; whether the view is to be reset.
pub(crate) fn keys(ui: &mut Ui, response: &Response, name: &str) -> bool {
    focus_ui(ui, response);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::accesskit::Role::Figure, true, name));
    ViewKeys::of(ui.ctx(), response).reset
}
