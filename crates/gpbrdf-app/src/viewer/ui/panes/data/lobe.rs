//! The lobe of one direction of the light in three dimensions: a hemisphere of the detector's directions whose radius
//! is `f cos(theta_o)`, with the upper end of the 95 % interval around it.

use std::f64::consts::{PI, TAU};

use eframe::egui::{self, Color32, Mesh, Pos2, Rect, RichText, Sense, Shape, Stroke, Ui, pos2};
use gpbrdf_core::brdf::direction;
use gpbrdf_core::figure::Colormap;
use gpbrdf_core::{Brdf, HalfDiff};

use super::Look;
use crate::viewer::state::document::{Document, DocumentId, Fitted};
use crate::viewer::ui::navigate::{DRAG_ORBIT, KEY_TURN, ViewKeys, focus_ui};
use crate::viewer::ui::widgets::{narrow, scale_ui, short, subscripted};
use crate::viewer::work::curves::band_at;
use crate::viewer::work::slices::colour;

/// Steps of the polar angle and of the azimuth.
const ROWS: usize = 45;
const COLUMNS: usize = 72;
/// The interval is cut off at so many times the largest value.
const MOST: f64 = 1.5;
/// Points of the window within which the pointer finds a direction.
const REACH: f32 = 14.0;

/// What a lobe was made from.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Key {
    document: DocumentId,
    version: u64,
    has_sigma: bool,
    truth_is_tabulated: bool,
    incidence: f64,
    channel: crate::viewer::state::look::Channel,
    truth: bool,
}

/// A direction of the detector.
#[derive(Clone, Copy, Debug)]
struct Node {
    theta: f64,
    phi: f64,
    /// `f cos(theta_o)`, 1/sr.
    value: f64,
    /// The 95 % interval of the value.
    band: Option<[f64; 2]>,
}

impl Node {
    /// The point at a radius in this direction.
    fn at(&self, radius: f64) -> [f64; 3] {
        let w = direction(self.theta, self.phi);
        [radius * w.x, radius * w.y, radius * w.z]
    }
}

/// The view with its latest lobe.
#[derive(Default)]
pub(super) struct LobeView {
    key: Option<Key>,
    /// Row by row from the normal to the horizon.
    nodes: Vec<Node>,
}

impl LobeView {
    /// Draws the lobe, which drags and arrow keys turn.
    pub(super) fn ui(&mut self, ui: &mut Ui, document: &Document, fitted: &Fitted, look: &mut Look) {
        self.refresh(document, fitted, look);
        let has_truth = self.key.is_some_and(|key| key.truth);
        let which = if has_truth { "truth" } else { "prediction" };
        ui.label(RichText::new(format!("Lobe of the {which}")).strong());
        let largest = self.nodes.iter().map(|node| node.value).fold(1e-9, f64::max);
        ui.horizontal(|ui| {
            ui.label(subscripted("f cos θo, 1/sr: 0"));
            scale_ui(ui, Colormap::Sequential);
            ui.label(short(largest));
            if self.nodes.iter().any(|node| node.band.is_some()) {
                ui.label("shell: up to 97.5 %");
            }
        });
        let area = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(area, Sense::click_and_drag());
        let name = "Lobe in 3-D: drag or arrow keys turn it";
        response.widget_info(|| egui::WidgetInfo::labeled(egui::accesskit::Role::Canvas, true, name));
        ui.painter().rect_filled(area, 6.0, ui.visuals().extreme_bg_color);
        let keys = ViewKeys::of(ui.ctx(), &response);
        if response.dragged_by(egui::PointerButton::Primary) {
            let step = response.drag_delta() * DRAG_ORBIT;
            look.azimuth += f64::from(step.x);
            look.elevation += f64::from(step.y);
        }
        look.azimuth += KEY_TURN * keys.right;
        look.elevation = (look.elevation + KEY_TURN * keys.up).clamp(0.0, 0.5 * PI);
        if response.double_clicked() || keys.reset {
            let usual = Look::default();
            (look.azimuth, look.elevation) = (usual.azimuth, usual.elevation);
        }
        let eye = Eye::new(area, look);
        self.paint(ui, &eye, largest, look);
        if let Some(at) = response.hover_pos() {
            self.hover_ui(ui, &eye, largest, at);
        }
        focus_ui(ui, &response);
    }

    fn refresh(&mut self, document: &Document, fitted: &Fitted, look: &Look) {
        let key = Key {
            document: document.id,
            version: fitted.version,
            has_sigma: fitted.sigma.is_some(),
            truth_is_tabulated: document.truth.is_some(),
            incidence: look.incidence,
            channel: look.channel,
            truth: look.truth && document.source_is_truth(),
        };
        if self.key == Some(key) {
            return;
        }
        let wi = direction(look.incidence.to_radians(), PI);
        let node = |i: usize| {
            let theta = (i / COLUMNS) as f64 / ROWS as f64 * 0.5 * PI;
            let phi = TAU * (i % COLUMNS) as f64 / COLUMNS as f64;
            let wo = direction(theta, phi);
            let angles = HalfDiff::from_directions(&wi, &wo);
            let cosine = theta.cos().max(0.0);
            let scaled = |rgb| cosine * look.channel.of(rgb).max(0.0);
            let mean = fitted.mean.eval_half_diff(angles);
            let truth = if key.truth { document.truth_at(angles) } else { None };
            let band = fitted.sigma.as_ref().filter(|_| !key.truth).map(|sigma| {
                let (low, high) = band_at(&fitted.model, mean, sigma, angles);
                [scaled(low), scaled(high)]
            });
            Node { theta, phi, value: scaled(truth.unwrap_or(mean)), band }
        };
        self.nodes = (0..(ROWS + 1) * COLUMNS).map(node).collect();
        self.key = Some(key);
    }

    /// Faces from far to near, over the surface with its normal and the light.
    fn paint(&self, ui: &Ui, eye: &Eye, largest: f64, look: &Look) {
        let painter = ui.painter().with_clip_rect(eye.area);
        let ink = ui.visuals().text_color();
        let circle = (0..=72).map(|i| {
            let (sine, cosine) = (TAU * f64::from(i) / 72.0).sin_cos();
            eye.project([cosine, sine, 0.0]).0
        });
        painter.add(Shape::line(circle.collect(), Stroke::new(1.0, ink.gamma_multiply(0.5))));
        let origin = eye.project([0.0; 3]).0;
        painter.line_segment([origin, eye.project([0.0, 0.0, 1.1]).0], Stroke::new(1.0, ink));
        let light = direction(look.incidence.to_radians(), PI);
        let lamp = Color32::from_rgb(0xD0, 0x9A, 0x10);
        let tip = eye.project([1.1 * light.x, 1.1 * light.y, 1.1 * light.z]).0;
        painter.line_segment([origin, tip], Stroke::new(2.0, lamp));
        let label = |at: Pos2, text: &str| {
            painter.text(at, egui::Align2::CENTER_BOTTOM, text, egui::FontId::proportional(11.0), ink);
        };
        label(tip, "light");
        label(eye.project([0.0, 0.0, 1.1]).0, "normal");

        let mut faces: Vec<(f64, [Pos2; 4], Color32)> = Vec::with_capacity(2 * ROWS * COLUMNS);
        let mut add = |radius: &dyn Fn(&Node) -> Option<f64>, fill: &dyn Fn(f64, f64) -> Color32| {
            for row in 0..ROWS {
                for column in 0..COLUMNS {
                    let next = (column + 1) % COLUMNS;
                    let corners = [(row, column), (row, next), (row + 1, next), (row + 1, column)];
                    let nodes = corners.map(|(r, c)| &self.nodes[r * COLUMNS + c]);
                    let Some(radii) = all(nodes.map(radius)) else { continue };
                    let points: [[f64; 3]; 4] = std::array::from_fn(|k| nodes[k].at(radii[k]));
                    let seen = points.map(|p| eye.project(p));
                    let depth = seen.iter().map(|(_, depth)| depth).sum::<f64>();
                    let mean = radii.iter().sum::<f64>() / 4.0;
                    faces.push((depth, seen.map(|(at, _)| at), fill(mean, slant(&points))));
                }
            }
        };
        add(&|node| Some(node.value / largest), &|radius, slant| {
            let [r, g, b, _] = colour(Colormap::Sequential, radius).to_array();
            let lit = |x: u8| narrow(f64::from(x) * (0.6 + 0.4 * slant)) / 255.0;
            egui::Rgba::from_rgb(lit(r).powf(2.2), lit(g).powf(2.2), lit(b).powf(2.2)).into()
        });
        let shell = ink.gamma_multiply(0.08);
        add(&|node| node.band.map(|[_, high]| (high / largest).min(MOST)), &|_, _| shell);
        faces.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut mesh = Mesh::default();
        for (_, corners, fill) in faces {
            #[expect(clippy::cast_possible_truncation, reason = "some thousand faces")]
            let first = mesh.vertices.len() as u32;
            for corner in corners {
                mesh.colored_vertex(corner, fill);
            }
            mesh.add_triangle(first, first + 1, first + 2);
            mesh.add_triangle(first, first + 2, first + 3);
        }
        painter.add(mesh);
    }

    /// The values of the direction under the pointer that is nearest to the eye.
    fn hover_ui(&self, ui: &Ui, eye: &Eye, largest: f64, at: Pos2) {
        let seen = self.nodes.iter().map(|node| (node, eye.project(node.at(node.value / largest))));
        let near = seen.filter(|(_, (place, _))| place.distance(at) < REACH);
        let Some((node, _)) = near.max_by(|a, b| a.1.1.total_cmp(&b.1.1)) else { return };
        let degrees = |x: f64| format!("{:.0}°", x.to_degrees());
        let azimuth = (node.phi - PI).abs();
        let mut lines = vec![
            ("θo", degrees(node.theta)),
            ("φ", degrees(azimuth)),
            ("f cos θo", format!("{} 1/sr", short(node.value))),
        ];
        lines
            .extend(node.band.map(|[low, high]| ("95 %", format!("{} to {} 1/sr", short(low), short(high)))));
        let id = egui::Id::unique("lobe values");
        let tooltip =
            egui::Tooltip::always_open(ui.ctx().clone(), ui.layer_id(), id, egui::PopupAnchor::Pointer);
        tooltip.gap(16.0).show(|ui| {
            egui::Grid::new("lobe").num_columns(2).spacing([12.0, 2.0]).show(ui, |ui| {
                for (name, value) in lines {
                    ui.label(subscripted(name));
                    ui.label(RichText::new(value).monospace());
                    ui.end_row();
                }
            });
        });
    }
}

/// All four numbers, if none is missing.
fn all(numbers: [Option<f64>; 4]) -> Option<[f64; 4]> {
    let [a, b, c, d] = numbers;
    Some([a?, b?, c?, d?])
}

/// How much a face is turned to a lamp at the upper left of the eye, in `[0, 1]`, whichever of its sides is seen.
fn slant(points: &[[f64; 3]; 4]) -> f64 {
    let gap = |a: usize, b: usize| -> [f64; 3] { std::array::from_fn(|c| points[b][c] - points[a][c]) };
    let (u, v) = (gap(0, 2), gap(1, 3));
    let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    let towards = (-0.4 * normal[0] - 0.5 * normal[1] + 0.77 * normal[2]).abs();
    if length > 0.0 { (towards / length).min(1.0) } else { 0.5 }
}

/// Parallel projection.
struct Eye {
    area: Rect,
    middle: Pos2,
    scale: f64,
    azimuth: (f64, f64),
    elevation: (f64, f64),
}

impl Eye {
    fn new(area: Rect, look: &Look) -> Self {
        let scale = f64::from(0.42 * area.width().min(1.4 * area.height()).max(1.0));
        let (azimuth, elevation) = (look.azimuth.sin_cos(), look.elevation.sin_cos());
        let middle = pos2(area.center().x, area.center().y + 0.3 * narrow(scale * elevation.1));
        Self { area, middle, scale, azimuth, elevation }
    }

    /// Where a point is on the screen, and how near it is to the eye.
    fn project(&self, [x, y, z]: [f64; 3]) -> (Pos2, f64) {
        let ((sa, ca), (se, ce)) = (self.azimuth, self.elevation);
        let (right, away) = (ca * x - sa * y, sa * x + ca * y);
        let up = ce * z + se * away;
        let at = pos2(self.middle.x + narrow(self.scale * right), self.middle.y - narrow(self.scale * up));
        (at, se * z - ce * away)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_eye_sees_the_normal_up_and_the_near_side_in_front() {
        let area = Rect::from_min_max(pos2(0.0, 0.0), pos2(200.0, 200.0));
        let look = Look { azimuth: 0.0, elevation: 0.3, ..Look::default() };
        let eye = Eye::new(area, &look);
        let (origin, _) = eye.project([0.0; 3]);
        let (top, _) = eye.project([0.0, 0.0, 1.0]);
        assert!(top.y < origin.y && (top.x - origin.x).abs() < 1e-4);
        let ((_, near), (_, far)) = (eye.project([0.0, -1.0, 0.0]), eye.project([0.0, 1.0, 0.0]));
        assert!(near > far);
        // From above, the surface is a disc and the normal a point.
        let above = Eye::new(area, &Look { elevation: 0.5 * PI, ..look });
        let (origin, _) = above.project([0.0; 3]);
        let (top, near) = above.project([0.0, 0.0, 1.0]);
        assert!(top.distance(origin) < 1e-3 && near > 0.9);
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert!((slant(&flat) - 0.77).abs() < 1e-9 && slant(&[[0.0; 3]; 4]) == 0.5);
    }
}
