//! Curves of all visible materials: lobes, angles, albedos.

use eframe::egui::{self, Color32, RichText, Ui};
use egui_plot::{FilledArea, Legend, Line, LineStyle, Plot, PlotPoints, PlotUi, Points};

use crate::viewer::app::Viewer;
use crate::viewer::state::document::DocumentId;
use crate::viewer::ui::panes::slices::{home, zoom};
use crate::viewer::ui::widgets::{Number, focus_ui, segments_ui, short, tool_ui};
use crate::viewer::work::curves::{ALBEDO_ANGLES, CurveKind, CurveLook, CurvePoint, curve, samples_near};
use crate::viewer::work::slices::Channel;

/// What a curve was made from.
type Key = (DocumentId, u64, bool, bool, CurveLook);

/// Curves as they were last computed.
#[derive(Debug, Default)]
pub(crate) struct PlotCache {
    curves: Vec<(Key, Vec<CurvePoint>, Vec<[f64; 2]>)>,
}

impl PlotCache {
    pub(crate) fn clear(&mut self) {
        self.curves.clear();
    }
}

/// One material's lines, ready to be drawn.
struct Drawn {
    name: String,
    colour: Color32,
    points: Vec<CurvePoint>,
    samples: Vec<[f64; 2]>,
}

impl Viewer {
    /// The plot and its controls.
    pub(crate) fn plots_ui(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new("Plots").strong().size(15.0));
            ui.add_space(6.0);
            let look = &mut self.settings.curves;
            segments_ui(ui, &mut look.kind, &CurveKind::ALL, CurveKind::name);
            ui.separator();
            ui.checkbox(&mut look.log, "Log").on_hover_text("Logarithmic values (L)");
            ui.checkbox(&mut look.times_cosine, "× cos θi")
                .on_hover_text("Times the cosine of the light (C)");
        });
        self.where_ui(ui);
        self.refresh_curves();
        let look = self.settings.curves;
        let drawn = self.drawn();
        let lobe = look.kind == CurveKind::Lobe;
        let log_y = look.log && !lobe;
        let mut plot = Plot::new(("plot", look.kind, look.log))
            .height(ui.available_height())
            .allow_scroll(false)
            .allow_boxed_zoom(false)
            .legend(Legend::default())
            .y_axis_formatter(
                move |mark, _| if log_y { short(10f64.powf(mark.value)) } else { short(mark.value) },
            )
            .label_formatter(move |at| {
                let egui_plot::HoverPosition::NearDataPoint { plot_name, position, .. } = at else {
                    return None;
                };
                let y = if log_y { 10f64.powf(position.y) } else { position.y };
                Some(format!("{plot_name}\n{}  {}", short(position.x), short(y)))
            });
        plot = if lobe {
            plot.data_aspect(1.0).x_axis_formatter(|mark, _| short(mark.value.abs())).show_grid(true)
        } else {
            plot.x_axis_formatter(|mark, _| format!("{}°", short(mark.value)))
                .x_axis_label(match look.kind {
                    CurveKind::ThetaH => "θh",
                    CurveKind::ThetaD => "θd",
                    CurveKind::PhiD => "φd",
                    _ => "angle of incidence",
                })
                .y_axis_label(if look.kind == CurveKind::Albedo { "albedo" } else { "f, 1/sr" })
        };
        if self.reset_views {
            plot = plot.reset();
        }
        let response = plot.show(ui, |plot| {
            for one in &drawn {
                draw(plot, one, &look);
            }
            if lobe {
                draw_incidence(plot, &drawn, &look);
            }
            zoom(plot);
        });
        focus_ui(ui, &response.response);
        self.reset_next |= home(ui, &response.response);
        let name = format!("{} plot", look.kind.name());
        response
            .response
            .widget_info(|| egui::WidgetInfo::labeled(egui::accesskit::Role::Figure, true, &name));
    }

    /// Where the curves stand.
    fn where_ui(&mut self, ui: &mut Ui) {
        let look = &mut self.settings.curves;
        ui.horizontal_wrapped(|ui| {
            let slider = |ui: &mut Ui, name: &str, high: f64, default: f64, value: &mut f64| {
                let mut number = Number::new(name, 0.0..=high, default, "Where the curve stands");
                number.suffix = "°";
                tool_ui(ui, number, if name.len() > 8 { 260.0 } else { 200.0 }, value);
            };
            let fixed = CurveLook::default().at;
            match look.kind {
                CurveKind::Lobe => slider(ui, "Incidence θi", 89.0, 45.0, &mut look.incidence),
                CurveKind::Albedo => {}
                kind => {
                    let names = ["At θh", "At θd", "At φd"];
                    let own = match kind {
                        CurveKind::ThetaH => 0,
                        CurveKind::ThetaD => 1,
                        _ => 2,
                    };
                    for axis in (0..3).filter(|axis| *axis != own) {
                        let high = if axis == 2 { 180.0 } else { 90.0 };
                        slider(ui, names[axis], high, fixed[axis], &mut look.at[axis]);
                    }
                    ui.checkbox(&mut look.samples, "Samples").on_hover_text("Measurements next to the curve");
                }
            }
            let names = |c| if c == Channel::Rgb { "Mean" } else { Channel::name(c) };
            segments_ui(ui, &mut look.channel, &Channel::ALL, names);
        });
    }

    /// Computes what has changed.
    fn refresh_curves(&mut self) {
        let look = CurveLook { log: false, samples: self.settings.curves.samples, ..self.settings.curves };
        let keys: Vec<Key> = self
            .visible()
            .filter_map(|d| {
                let fitted = d.fitted.as_ref()?;
                Some((d.id, fitted.version, fitted.sigma.is_some(), d.truth.is_some(), look))
            })
            .collect();
        let mut old = std::mem::take(&mut self.plots.curves);
        let mut curves = Vec::new();
        for key in keys {
            if let Some(at) = old.iter().position(|(k, ..)| *k == key) {
                curves.push(old.swap_remove(at));
            } else if let Some(document) = self.documents.iter().find(|d| d.id == key.0) {
                let samples = if look.samples { samples_near(document, &look) } else { Vec::new() };
                let points = if look.kind == CurveKind::Albedo { Vec::new() } else { curve(document, &look) };
                curves.push((key, points, samples));
            }
        }
        self.plots.curves = curves;
    }

    fn drawn(&self) -> Vec<Drawn> {
        let look = &self.settings.curves;
        let named = |id: DocumentId| self.documents.iter().find(|d| d.id == id);
        if look.kind == CurveKind::Albedo {
            let albedos = self.albedos.iter().filter_map(|a| {
                let document = named(a.document).filter(|d| self.visible().any(|v| v.id == d.id))?;
                let points = (0..ALBEDO_ANGLES).map(|k| CurvePoint {
                    x: 5.0 * k as f64,
                    truth: a.truth.as_ref().map(|t| look.channel.of(t[k])),
                    mean: look.channel.of(a.mean[k]),
                    band: None,
                });
                Some(Drawn {
                    name: document.name.clone(),
                    colour: document.colour,
                    points: points.collect(),
                    samples: Vec::new(),
                })
            });
            return albedos.collect();
        }
        let curves = self.plots.curves.iter().filter_map(|((id, ..), points, samples)| {
            let document = named(*id)?;
            Some(Drawn {
                name: document.name.clone(),
                colour: document.colour,
                points: points.clone(),
                samples: samples.clone(),
            })
        });
        curves.collect()
    }
}

/// The smallest value on logarithmic axes.
const FLOOR: f64 = 1e-4;

/// A point of a curve on the axes.
fn placed(look: &CurveLook, x: f64, y: f64) -> [f64; 2] {
    match (look.kind, look.log) {
        (CurveKind::Lobe, log) => {
            let radius = if log { (y.max(FLOOR) / FLOOR).log10() } else { y };
            let (sine, cosine) = x.to_radians().sin_cos();
            [radius * sine, radius * cosine]
        }
        (_, true) => [x, y.max(FLOOR).log10()],
        (_, false) => [x, y],
    }
}

fn draw(plot: &mut PlotUi<'_>, one: &Drawn, look: &CurveLook) {
    let line = |y: &dyn Fn(&CurvePoint) -> Option<f64>| -> PlotPoints<'static> {
        one.points.iter().filter_map(|p| y(p).map(|y| placed(look, p.x, y))).collect::<Vec<_>>().into()
    };
    let low = |p: &CurvePoint| p.band.map(|b| b.0);
    let high = |p: &CurvePoint| p.band.map(|b| b.1);
    if one.points.iter().any(|p| p.band.is_some()) {
        if look.kind == CurveKind::Lobe {
            let thin = |y: &dyn Fn(&CurvePoint) -> Option<f64>| {
                Line::new("95 %", line(y)).color(one.colour.gamma_multiply(0.5)).width(0.7).allow_hover(false)
            };
            plot.line(thin(&low).name(""));
            plot.line(thin(&high).name(""));
        } else {
            let band: Vec<_> = one.points.iter().filter_map(|p| p.band.map(|b| (p.x, b))).collect();
            let xs: Vec<f64> = band.iter().map(|(x, _)| *x).collect();
            let lows: Vec<f64> = band.iter().map(|(x, b)| placed(look, *x, b.0)[1]).collect();
            let highs: Vec<f64> = band.iter().map(|(x, b)| placed(look, *x, b.1)[1]).collect();
            let area = FilledArea::new("", &xs, &lows, &highs).fill_color(one.colour.gamma_multiply(0.25));
            plot.add(area.allow_hover(false));
        }
    }
    if one.points.iter().any(|p| p.truth.is_some()) {
        let ink = plot.ctx().global_style().visuals.strong_text_color();
        let truth = Line::new(format!("{} (truth)", one.name), line(&|p| p.truth));
        plot.line(truth.color(ink.gamma_multiply(0.75)).width(1.4).style(LineStyle::dashed_dense()));
    }
    plot.line(Line::new(one.name.clone(), line(&|p| Some(p.mean))).color(one.colour).width(2.2));
    if look.samples && !one.samples.is_empty() {
        let points: Vec<[f64; 2]> = one.samples.iter().map(|[x, y]| placed(look, *x, *y)).collect();
        plot.points(Points::new("samples", points).radius(2.2).color(one.colour).allow_hover(false));
    }
}

/// The surface, its normal and the direction of the light.
fn draw_incidence(plot: &mut PlotUi<'_>, drawn: &[Drawn], look: &CurveLook) {
    let most = drawn.iter().flat_map(|d| &d.points).map(|p| {
        let [x, y] = placed(look, p.x, p.mean);
        x.hypot(y)
    });
    let length = most.fold(0.0, f64::max).max(1e-3) * 1.1;
    let (sine, cosine) = look.incidence.to_radians().sin_cos();
    let grey = plot.ctx().global_style().visuals.weak_text_color();
    for points in [vec![[-length, 0.0], [length, 0.0]], vec![[0.0, 0.0], [0.0, length]]] {
        plot.line(Line::new("", points).color(grey).width(1.0).allow_hover(false));
    }
    let light = vec![[-length * sine, length * cosine], [0.0, 0.0]];
    plot.line(
        Line::new("light", light).color(Color32::from_rgb(0xF0, 0xC4, 0x30)).width(1.6).allow_hover(false),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_lobes_lie_in_their_direction() {
        let look = CurveLook::default();
        let [x, y] = placed(&look, 90.0, 2.0);
        assert!((x - 2.0).abs() < 1e-12 && y.abs() < 1e-12);
        let log = CurveLook { kind: CurveKind::ThetaD, log: true, ..look };
        assert_eq!(placed(&log, 10.0, 0.0), [10.0, -4.0]);
    }
}
