//! Measured directions on the hemisphere of the detector: values by colour, errors of those left out by size.

use eframe::egui::{self, Align2, RichText, Ui};
use egui_plot::{PlotPoint, PlotUi, Points, Text};
use gpbrdf_core::HalfDiff;
use gpbrdf_core::figure::Colormap;

use super::Look;
use crate::viewer::state::document::{Document, DocumentId, Fitted};
use crate::viewer::state::look::Channel;
use crate::viewer::ui::half_disc;
use crate::viewer::ui::navigate::navigate_plot;
use crate::viewer::ui::theme::LIGHT;
use crate::viewer::ui::widgets::{narrow, scale_ui, short, subscripted};
use crate::viewer::work::slices::colour;

/// Steps of colour and of size.
const COLOURS: usize = 24;
const SIZES: usize = 5;
/// Radii of points without and with the largest error.
const RADII: [f32; 2] = [2.0, 7.0];
/// An error of this much of `ln f`, a factor of about 1.6, has the largest size.
const LARGEST: f64 = 0.5;
/// Degrees within which the pointer finds a measurement.
const REACH: f64 = 3.0;

/// A measurement on the hemisphere.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Measured {
    /// Degrees from the normal, times the direction of the azimuth between light and detector.
    place: [f64; 2],
    theta_i: f64,
    theta_o: f64,
    phi: f64,
    value: f64,
    /// The mean of the sizes of the residuals of its channels when it is left out, in units of the target.
    error: Option<f64>,
}

/// Polar angles of light and detector and the angle between their azimuths, 0 to 180, in degrees.
fn angles_of(angles: &HalfDiff) -> [f64; 3] {
    let (wi, wo) = angles.to_directions();
    let azimuth = half_disc::azimuth_between(&wi, &wo).to_degrees();
    [half_disc::polar(&wi), half_disc::polar(&wo), azimuth]
}

/// The measurements near a direction of the light. Where the detector is there, light and detector change places,
/// which no reciprocal material notices.
fn measurements(fitted: &Fitted, look: &Look) -> Vec<Measured> {
    let left_out = fitted.report.as_ref().and_then(|report| report.leave_one_out.as_ref());
    let samples = &fitted.samples;
    let channels = left_out.map_or(0, |left_out| left_out.residuals.len() / samples.len().max(1));
    let error = |i: usize| {
        let residuals =
            left_out?.residuals.get(i * channels..(i + 1) * channels).filter(|r| !r.is_empty())?;
        Some(residuals.iter().map(|x| x.abs()).sum::<f64>() / residuals.len() as f64)
    };
    let all = samples.angles.iter().zip(&samples.values).enumerate();
    let found = all.filter_map(|(i, (angles, value))| {
        let [first, second, phi] = angles_of(angles);
        let near = |theta: f64| (theta - look.incidence).abs() <= look.within;
        let (theta_i, theta_o) = match (near(first), near(second)) {
            (true, _) => (first, second),
            (false, true) => (second, first),
            (false, false) => return None,
        };
        let place = half_disc::place(theta_o, phi.to_radians());
        Some(Measured { place, theta_i, theta_o, phi, value: look.channel.of(*value), error: error(i) })
    });
    found.take(half_disc::MOST_DRAWN).collect()
}

/// What the measurements that are shown depend on.
type Key = (DocumentId, u64, f64, f64, Channel);

/// The view with its latest measurements.
#[derive(Default)]
pub(super) struct HemisphereView {
    key: Option<Key>,
    measured: Vec<Measured>,
}

impl HemisphereView {
    /// Draws the hemisphere; whether the view is to be reset.
    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        document: &Document,
        fitted: &Fitted,
        look: &Look,
        reset: bool,
    ) -> bool {
        let key = (document.id, fitted.version, look.incidence, look.within, look.channel);
        if self.key != Some(key) {
            (self.key, self.measured) = (Some(key), measurements(fitted, look));
        }
        measured_ui(ui, document, &self.measured, look, reset)
    }
}

fn measured_ui(ui: &mut Ui, document: &Document, measured: &[Measured], look: &Look, reset: bool) -> bool {
    let logs: Vec<f64> = measured.iter().map(|m| m.value.max(1e-6).log10()).collect();
    let (low, high) =
        logs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    let count = match measured.len() {
        1 => "1 measurement".to_owned(),
        n => format!("{n} measurements"),
    };
    let title = format!("{count} with the light within {:.0}° of {:.0}°", look.within, look.incidence);
    ui.label(RichText::new(title).strong());
    ui.horizontal(|ui| {
        if measured.is_empty() {
            ui.label("None was measured there; move the light.");
            return;
        }
        ui.label("f, 1/sr:");
        ui.label(short(10f64.powf(low)));
        scale_ui(ui, Colormap::Sequential);
        ui.label(short(10f64.powf(high)));
        if measured.iter().any(|m| m.error.is_some()) {
            ui.label("size: its error when it is left out");
        }
    });
    let plot = half_disc::plot(ui, "measured directions", reset);
    let text = ui.visuals().text_color();
    let response = plot.show(ui, |plot| {
        frame(plot, text, look.incidence);
        let mut groups = vec![Vec::new(); COLOURS * SIZES];
        for (m, log) in measured.iter().zip(&logs) {
            let share = if high > low { (log - low) / (high - low) } else { 0.5 };
            let (hue, size) = (step(share, COLOURS), step(m.error.unwrap_or(0.2) / LARGEST, SIZES));
            groups[hue * SIZES + size].push(m.place);
        }
        for (i, group) in groups.into_iter().enumerate().filter(|(_, group)| !group.is_empty()) {
            let share = |k: usize, n: usize| k as f64 / (n - 1) as f64;
            let radius = eframe::egui::lerp(RADII[0]..=RADII[1], narrow(share(i % SIZES, SIZES)));
            let points = Points::new("measured", group).radius(radius).allow_hover(false);
            plot.points(points.color(colour(Colormap::Sequential, share(i / SIZES, COLOURS))));
        }
        navigate_plot(plot);
        plot.pointer_coordinate().filter(|_| plot.response().hovered())
    });
    if let Some(at) = response.inner {
        let distance = |m: &&Measured| (m.place[0] - at.x).hypot(m.place[1] - at.y);
        let nearest = measured.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(m) = nearest.filter(|m| distance(m) < REACH) {
            hover_ui(ui, m);
        }
    }
    let name = format!("Measured directions of {}, {} shown", document.name, measured.len());
    half_disc::keys(ui, &response.response, &name)
}

/// One of `count` steps of a share.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the number of steps")]
fn step(share: f64, count: usize) -> usize {
    (share.clamp(0.0, 1.0) * (count - 1) as f64).round() as usize
}

fn hover_ui(ui: &Ui, m: &Measured) {
    let id = egui::Id::unique("measured values");
    egui::Tooltip::always_open(ui.ctx().clone(), ui.layer_id(), id, egui::PopupAnchor::Pointer)
        .gap(16.0)
        .show(|ui| {
            let degrees = |x: f64| format!("{x:.1}°");
            let mut lines = vec![
                ("θi", degrees(m.theta_i)),
                ("θo", degrees(m.theta_o)),
                ("φ", degrees(m.phi)),
                ("measured", format!("{} 1/sr", short(m.value))),
            ];
            lines.extend(m.error.map(|error| ("left out", format!("off by {} of the target", short(error)))));
            egui::Grid::new("measured").num_columns(2).spacing([12.0, 2.0]).show(ui, |ui| {
                for (name, value) in lines {
                    ui.label(subscripted(name));
                    ui.label(RichText::new(value).monospace());
                    ui.end_row();
                }
            });
        });
}

/// What does not depend on the measurements, and where the light is.
fn frame(plot: &mut PlotUi<'_>, text: egui::Color32, incidence: f64) {
    half_disc::rings(plot, text.gamma_multiply(0.5), text);
    let light = Points::new("light", vec![[incidence, 0.0]]).shape(egui_plot::MarkerShape::Diamond);
    plot.points(light.radius(6.0).color(LIGHT).allow_hover(false));
    let label = RichText::new("light").color(text).size(11.0);
    let at = PlotPoint::new(incidence, -3.0);
    plot.text(Text::new("light", at, label).anchor(Align2::CENTER_TOP).allow_hover(false));
}

#[cfg(test)]
mod tests {
    use gpbrdf_core::brdf::direction;

    use super::*;

    #[test]
    fn angles_are_those_of_the_directions() {
        for (theta_i, theta_o, phi) in [(30.0, 40.0, 180.0), (10.0, 70.0, 35.0), (60.0, 5.0, 90.0)] {
            let wi = direction(f64::to_radians(theta_i), 0.3);
            let wo = direction(f64::to_radians(theta_o), 0.3 + f64::to_radians(phi));
            let found = angles_of(&HalfDiff::from_directions(&wi, &wo));
            // Light and detector may have changed places.
            let close = |expected: [f64; 3]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(close([theta_i, theta_o, phi]) || close([theta_o, theta_i, phi]), "{found:?}");
        }
        assert_eq!([step(0.0, 5), step(0.5, 5), step(9.0, 5), step(-1.0, 5)], [0, 2, 4, 0]);
    }
}
