//! Truth, prediction, difference and sigma side by side, in views that pan and zoom together.

use std::f64::consts::FRAC_PI_2;

use eframe::egui::{self, Align2, Color32, RichText, TextureId, Ui};
use egui_plot::{AxisHints, GridInput, GridMark, Plot, PlotImage, PlotPoint, PlotUi, Points};
use gpbrdf_core::{Brdf, Colormap, HalfDiff};

use crate::viewer::app::Viewer;
use crate::viewer::state::document::Document;
use crate::viewer::ui::widgets::{
    Number, ViewKeys, focus_ui, narrow, segments_ui, short, tool_ui, tools_menu_ui,
};
use crate::viewer::work::curves::band_at;
use crate::viewer::work::slices::{Channel, colour};

/// Titles of the four views.
const TITLES: [&str; 4] = ["Truth", "Prediction", "Difference", "Sigma"];

/// What the colours of a view mean.
const MEANINGS: [&str; 4] =
    ["f, 1/sr", "f, 1/sr", "ln(prediction + 0.001) - ln(truth + 0.001)", "standard deviation of the target"];

/// What the axes take of a view.
const AXES: egui::Vec2 = egui::vec2(72.0, 40.0);

/// Height of a view's title and the gap below it.
const TITLE: f32 = 28.0;

/// From this width on all tools stand in one row.
const WIDE: f32 = 780.0;

/// In how many columns views are largest.
fn columns(views: usize, area: egui::Vec2) -> usize {
    let side = |columns: usize| {
        let rows = views.div_ceil(columns);
        let (columns, rows) = (narrow(columns as f64), narrow(rows as f64));
        (area.x / columns - AXES.x).min(area.y / rows - AXES.y - TITLE)
    };
    (1..=views.max(1)).max_by(|a, b| side(*a).total_cmp(&side(*b))).unwrap_or(1)
}

/// Regions of a slice at phi_d = 90 degrees: name, theta_h and theta_d in degrees.
const REGIONS: [(&str, f64, f64); 4] = [
    ("specular", 6.0, 45.0),
    ("Fresnel", 12.0, 84.0),
    ("retro-reflection", 45.0, 5.0),
    ("grazing", 78.0, 78.0),
];

impl Viewer {
    /// The four slices and their controls.
    pub(crate) fn slices_ui(&mut self, ui: &mut Ui) {
        self.slice_tools_ui(ui);
        let Some(document) = self.document() else { return };
        let Some(shown) = self.slices.as_ref().filter(|s| s.key.document == document.id) else {
            ui.centered_and_justified(|ui| {
                ui.horizontal(|ui| {
                    ui.spinner();
                    ui.label("Fitting a model to the measurements");
                })
            });
            return;
        };
        let views: Vec<usize> = (0..4).filter(|&i| shown.textures[i].is_some()).collect();
        let gap = 10.0;
        let area = ui.available_size();
        let columns = columns(views.len(), area);
        let rows = views.len().div_ceil(columns);
        let share = |total: f32, parts: usize| {
            let parts = narrow(parts as f64);
            ((total - gap * (parts - 1.0)) / parts).max(80.0)
        };
        let size = egui::vec2(share(area.x, columns), share(area.y, rows));
        let (mut hovered, mut reset) = (None, false);
        for row in views.chunks(columns) {
            ui.horizontal_top(|ui| {
                ui.spacing_mut().item_spacing.x = gap;
                for &i in row {
                    let Some(texture) = &shown.textures[i] else { continue };
                    ui.allocate_ui(size, |ui| {
                        ui.set_min_size(size);
                        ui.set_max_size(size);
                        ui.vertical(|ui| {
                            // The topmost mark of an axis stands half a line above it.
                            ui.spacing_mut().item_spacing.y = 8.0;
                            let side = (size.x - AXES.x).min(size.y - AXES.y - TITLE).max(40.0);
                            ui.scope(|ui| {
                                ui.set_max_width(side + AXES.x - 14.0);
                                title_ui(ui, i, shown.limits[i]);
                            });
                            let (point, home) = self.slice_ui(ui, document, i, texture.id());
                            hovered = hovered.or(point);
                            reset |= home;
                        });
                    });
                }
            });
        }
        if let Some(angles) = hovered {
            hover_ui(ui, document, angles);
        }
        self.reset_next |= reset;
    }

    fn slice_tools_ui(&mut self, ui: &mut Ui) {
        let look = &mut self.settings.slices;
        let exposure = Number::new("Exposure", -8.0..=8.0, 0.0, "Stops: values are shown times 2 to this");
        let gamma = Number::new("Gamma", 1.0..=4.0, 2.2, "Values are shown to the power of one over this");
        let wide = ui.available_width() > WIDE;
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new("Slices").strong().size(15.0));
            ui.add_space(6.0);
            let help = "Azimuth of the light about the half vector";
            let mut number = Number::new("φd", 0.0..=180.0, 90.0, help);
            number.suffix = "°";
            tool_ui(ui, number, 220.0, &mut look.phi_d);
            if wide {
                tool_ui(ui, exposure.clone(), 205.0, &mut look.exposure);
                tool_ui(ui, gamma.clone(), 185.0, &mut look.gamma);
            }
            segments_ui(ui, &mut look.channel, &Channel::ALL, Channel::name);
            ui.add_space(6.0);
            tools_menu_ui(ui, "Show", |ui| {
                ui.checkbox(&mut look.square_theta_h, "Square θh")
                    .on_hover_text("The table's own warp: more room for the specular peak");
                ui.checkbox(&mut look.chroma, "Chroma")
                    .on_hover_text("Colours divided by their largest channel");
                ui.checkbox(&mut self.settings.show_samples, "Samples")
                    .on_hover_text("Where it was measured");
                ui.checkbox(&mut self.settings.show_regions, "Regions").on_hover_text("Names of the regions");
                if !wide {
                    ui.set_min_width(280.0);
                    exposure.row_ui(ui, &mut look.exposure);
                    gamma.row_ui(ui, &mut look.gamma);
                }
            });
        });
    }

    /// One view; the angles under the pointer.
    fn slice_ui(
        &self,
        ui: &mut Ui,
        document: &Document,
        i: usize,
        texture: TextureId,
    ) -> (Option<HalfDiff>, bool) {
        let square = self.settings.slices.square_theta_h;
        let phi_d = self.settings.slices.phi_d.to_radians();
        let room = ui.available_size();
        let side = (room.x - AXES.x).min(room.y - AXES.y).max(40.0);
        let mut plot = Plot::new(("slice", i))
            .link_axis(egui::Id::unique("slices"), true)
            .link_cursor(egui::Id::unique("slices"), true)
            .data_aspect(1.0)
            .width(side + AXES.x - 14.0)
            .height(side + AXES.y)
            .set_margin_fraction(egui::vec2(0.0, 0.0))
            .allow_scroll(false)
            .allow_boxed_zoom(false)
            .allow_axis_zoom_drag(false)
            .show_x(false)
            .show_y(false)
            .show_grid(false)
            .clamp_grid(true)
            .x_grid_spacer(move |input| degrees_marks(&input, square))
            .y_grid_spacer(|input| degrees_marks(&input, false))
            .label_formatter(|_| None)
            .custom_x_axes(vec![
                AxisHints::new_x()
                    .formatter(move |mark, _| {
                        format!("{}°", short(if square { unwarped(mark.value) } else { mark.value }))
                    })
                    .label_spacing(egui::Rangef::new(22.0, 30.0))
                    .label("θh"),
            ])
            .custom_y_axes(vec![
                AxisHints::new_y()
                    .formatter(|mark, _| format!("{}°", short(mark.value)))
                    .label("θd")
                    .min_thickness(AXES.x - 36.0),
            ]);
        if self.reset_views {
            plot = plot.reset();
        }
        let show_samples = self.settings.show_samples;
        let regions = self.settings.show_regions;
        let place = move |theta_h: f64| if square { warped(theta_h) } else { theta_h };
        let samples = if show_samples { sample_points(document, phi_d, place) } else { Vec::new() };
        let response = plot.show(ui, |plot| {
            let image = PlotImage::new(TITLES[i], texture, PlotPoint::new(45.0, 45.0), [90.0, 90.0]);
            plot.image(image.allow_hover(false));
            if !samples.is_empty() {
                let points =
                    Points::new("samples", samples).radius(1.6).color(document.colour).allow_hover(false);
                plot.points(points);
            }
            if regions {
                for (name, theta_h, theta_d) in REGIONS {
                    let text = RichText::new(name)
                        .color(Color32::WHITE)
                        .background_color(Color32::from_black_alpha(150));
                    let at = PlotPoint::new(place(theta_h), theta_d);
                    let anchor = if theta_h < 20.0 { Align2::LEFT_CENTER } else { Align2::CENTER_CENTER };
                    plot.text(egui_plot::Text::new(name, at, text).anchor(anchor).allow_hover(false));
                }
            }
            zoom(plot);
            plot.pointer_coordinate().filter(|_| plot.response().hovered())
        });
        focus_ui(ui, &response.response);
        let name = format!("{} slice", TITLES[i]);
        response
            .response
            .widget_info(|| egui::WidgetInfo::labeled(egui::accesskit::Role::Image, true, &name));
        let home = home(ui, &response.response);
        let Some(at) = response.inner else { return (None, home) };
        let x = at.x / 90.0;
        let theta_h = if square { x * x.abs() } else { x } * FRAC_PI_2;
        let theta_d = at.y / 90.0 * FRAC_PI_2;
        let inside = (0.0..=FRAC_PI_2).contains(&theta_h) && (0.0..=FRAC_PI_2).contains(&theta_d);
        (inside.then_some(HalfDiff { theta_h, theta_d, phi_d }), home)
    }
}

/// Wheel and right drag zoom, as viewers of BRDFs do.
pub(crate) fn zoom(plot: &mut PlotUi<'_>) {
    let response = plot.response().clone();
    let ctx = plot.ctx().clone();
    let mut factor = 1.0;
    if response.hovered() {
        factor *= (0.004 * ctx.input(|i| i.smooth_scroll_delta().y)).exp();
    }
    if response.dragged_by(egui::PointerButton::Secondary) {
        factor *= (0.01 * (response.drag_delta().x - response.drag_delta().y)).exp();
    }
    if (factor - 1.0).abs() > 1e-6 {
        plot.zoom_bounds_around_hovered(egui::Vec2::splat(factor));
    }
    let keys = ViewKeys::of(&ctx, &response);
    if keys.right != 0.0 || keys.up != 0.0 {
        let bounds = plot.plot_bounds();
        let step = [0.1 * keys.right * bounds.width(), 0.1 * keys.up * bounds.height()];
        plot.translate_bounds(egui::Vec2::from(step.map(narrow)));
    }
    if keys.zoom != 1.0 {
        plot.zoom_bounds(egui::Vec2::splat(narrow(keys.zoom)), plot.plot_bounds().center());
    }
}

/// Whether a view that has the focus is to be reset.
pub(crate) fn home(ui: &Ui, response: &egui::Response) -> bool {
    ViewKeys::of(ui.ctx(), response).reset
}

/// Where degrees of theta_h stand on an axis with the table's warp.
fn warped(degrees: f64) -> f64 {
    90.0 * (degrees / 90.0).max(0.0).sqrt()
}

/// Degrees of theta_h at a place of an axis with the table's warp.
fn unwarped(place: f64) -> f64 {
    place * place.abs() / 90.0
}

/// Marks at round degrees: every 5 or 30, of a warped axis denser where it is wider.
fn degrees_marks(input: &GridInput, warp: bool) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    let near = high - low < 40.0;
    let step = if near { 5.0 } else { 30.0 };
    let values: Vec<f64> = match (warp, near) {
        (true, false) => [0.0, 5.0, 20.0, 45.0, 90.0].map(warped).to_vec(),
        (true, true) => [0.0, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0]
            .map(warped)
            .to_vec(),
        (false, _) => (0..=18).map(|i| f64::from(i) * step).filter(|x| *x <= 90.0).collect(),
    };
    let inside = values.into_iter().filter(|x| *x >= low - step && *x <= high + step);
    inside.map(|value| GridMark { value, step_size: step }).collect()
}

fn title_ui(ui: &mut Ui, i: usize, limit: Option<f64>) {
    ui.horizontal(|ui| {
        ui.label(RichText::new(TITLES[i]).strong()).on_hover_text(MEANINGS[i]);
        let Some(limit) = limit else { return };
        let map = if i == 2 { Colormap::Diverging } else { Colormap::Sequential };
        let low = if i == 2 { format!("-{}", short(limit)) } else { "0".to_owned() };
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            let end = if i == 2 { format!("+{}", short(limit)) } else { short(limit) };
            ui.label(RichText::new(end).small());
            scale_ui(ui, map);
            ui.label(RichText::new(low).small());
        });
    });
}

/// A colour bar.
pub(crate) fn scale_ui(ui: &mut Ui, map: Colormap) {
    let (rect, _) = ui.allocate_exact_size(egui::vec2(72.0, 9.0), egui::Sense::hover());
    let mut mesh = egui::Mesh::default();
    let steps: u16 = 24;
    for k in 0..=steps {
        let t = f64::from(k) / f64::from(steps);
        let x = egui::lerp(rect.left()..=rect.right(), narrow(t));
        let fill = colour(map, t);
        mesh.colored_vertex(egui::pos2(x, rect.top()), fill);
        mesh.colored_vertex(egui::pos2(x, rect.bottom()), fill);
        if k > 0 {
            let v = 2 * u32::from(k);
            mesh.add_triangle(v - 2, v - 1, v);
            mesh.add_triangle(v - 1, v, v + 1);
        }
    }
    ui.painter().add(mesh);
}

/// The samples that stand next to the slice.
fn sample_points(document: &Document, phi_d: f64, place: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
    let Some(fitted) = &document.fitted else { return Vec::new() };
    // The nodes next to the slice: half a step of a lattice's phi_d.
    let width = match &fitted.samples.lattice {
        Some(lattice) => 0.51 * FRAC_PI_2 / lattice.shape[2] as f64,
        None => 5f64.to_radians(),
    };
    let folded = |p: f64| if p > FRAC_PI_2 { std::f64::consts::PI - p } else { p };
    let near = fitted.samples.angles.iter().filter(|a| (folded(a.phi_d) - folded(phi_d)).abs() <= width);
    near.take(6000).map(|a| [place(a.theta_h.to_degrees()), a.theta_d.to_degrees()]).collect()
}

/// What is known about a pair of directions.
pub(crate) fn hover_lines(document: &Document, angles: HalfDiff) -> Vec<(&'static str, String)> {
    let degrees = |x: f64| format!("{:.2}°", x.to_degrees());
    let mut lines =
        vec![("θh", degrees(angles.theta_h)), ("θd", degrees(angles.theta_d)), ("φd", degrees(angles.phi_d))];
    if !angles.is_above_horizon() {
        lines.push(("", "below the horizon".to_owned()));
        return lines;
    }
    let rgb = |v: [f64; 3]| v.map(short).join("  ");
    let truth = match &document.truth {
        Some(table) => Some(table.eval_half_diff(angles)),
        None if document.has_truth() => document.source.brdf().map(|b| b.eval_half_diff(angles)),
        None => None,
    };
    if let Some(truth) = truth {
        lines.push(("truth", rgb(truth)));
    }
    if let Some(fitted) = &document.fitted {
        let mean = fitted.mean.eval_half_diff(angles);
        lines.push(("mean", rgb(mean)));
        if let Some(sigma) = &fitted.sigma {
            let noise = fitted.model.noise_variances();
            let (low, high) = band_at(fitted.model.transform, mean, sigma, noise, angles);
            lines.push(("95 % from", rgb(low)));
            lines.push(("95 % to", rgb(high)));
        }
    }
    lines
}

fn hover_ui(ui: &Ui, document: &Document, angles: HalfDiff) {
    egui::Tooltip::always_open(
        ui.ctx().clone(),
        ui.layer_id(),
        egui::Id::unique("slice values"),
        egui::PopupAnchor::Pointer,
    )
    .gap(16.0)
    .show(|ui| {
        egui::Grid::new("values").num_columns(2).spacing([12.0, 2.0]).show(ui, |ui| {
            for (name, value) in hover_lines(document, angles) {
                ui.label(RichText::new(name).weak());
                ui.label(RichText::new(value).monospace());
                ui.end_row();
            }
        });
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_of_a_warped_axis_stand_at_round_degrees() {
        let input = GridInput { bounds: (0.0, 90.0), base_step_size: 1.0 };
        let degrees = |warp: bool| -> Vec<f64> {
            let marks = degrees_marks(&input, warp);
            marks.iter().map(|m| if warp { unwarped(m.value) } else { m.value }).collect()
        };
        assert_eq!(degrees(false), [0.0, 30.0, 60.0, 90.0]);
        for (found, expected) in std::iter::zip(degrees(true), [0.0, 5.0, 20.0, 45.0, 90.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        assert!((warped(unwarped(30.0)) - 30.0).abs() < 1e-12 && warped(22.5) == 45.0);
    }

    #[test]
    fn values_of_a_direction_are_read() {
        let source = gpbrdf_core::Source::built_in("lambert").unwrap();
        let document = Document::new(crate::viewer::state::document::DocumentId(0), source);
        let angles = |theta_h| HalfDiff { theta_h, theta_d: 0.3, phi_d: FRAC_PI_2 };
        let lines = hover_lines(&document, angles(0.2));
        assert!(lines.iter().any(|(name, _)| *name == "truth"), "{lines:?}");
        let below = HalfDiff { theta_h: 1.5, theta_d: 1.5, phi_d: 0.0 };
        assert!(hover_lines(&document, below).iter().any(|(_, value)| value == "below the horizon"));
    }
}
