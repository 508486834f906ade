//! Curves of all visible materials: lobes, curves along the angles, albedos.

use std::sync::mpsc::Receiver;

use eframe::egui::{self, Color32, Context, Key, KeyboardShortcut, Modifiers, RichText, Ui};
use egui_plot::{FilledArea, HoverPosition, Legend, Line, LineStyle, Plot, PlotPoints, PlotUi, Points};

use crate::viewer::state::document::{Document, DocumentId};
use crate::viewer::state::look::{Channel, CurveKind, CurveLook};
use crate::viewer::ui::navigate::{ViewKeys, focus_ui, navigate_plot};
use crate::viewer::ui::pane::{
    Command, Offers, Pane, PaneContext, Place, Share, Slot, Start, restored, saved,
};
use crate::viewer::ui::widgets::{Number, segments_ui, short, tool_ui};
use crate::viewer::work::curves::{
    ALBEDO_ANGLES, Albedo, AlbedoRequest, CurvePoint, curve, samples_near, spawn,
};
use crate::viewer::work::mailbox::Sender;

const LOG: KeyboardShortcut = KeyboardShortcut::new(Modifiers::NONE, Key::L);
const COSINE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::NONE, Key::C);

/// What a curve was made from.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CurveKey {
    document: DocumentId,
    version: u64,
    has_sigma: bool,
    truth_is_tabulated: bool,
    look: CurveLook,
}

/// A curve and the samples near it, as they were last computed.
struct Curve {
    key: CurveKey,
    points: Vec<CurvePoint>,
    samples: Vec<[f64; 2]>,
}

/// The document, the version of its result and whether its truth is tabulated.
type AlbedoKey = (DocumentId, u64, bool);

/// The lines of one material, ready to be drawn.
struct Drawn {
    name: String,
    colour: Color32,
    points: Vec<CurvePoint>,
    samples: Vec<[f64; 2]>,
}

/// The pane of plots.
pub(crate) struct Plots {
    look: CurveLook,
    curves: Vec<Curve>,
    inbox: Receiver<Vec<Albedo>>,
    worker: Sender<Vec<AlbedoRequest>>,
    requested: Vec<AlbedoKey>,
    albedos: Vec<Albedo>,
}

impl Plots {
    /// Starts the worker, which integrates albedos.
    pub(crate) fn new(start: &Start) -> std::io::Result<Self> {
        let (outbox, inbox) = start.channel();
        let worker = spawn(outbox)?;
        let look = CurveLook::default();
        Ok(Self { look, curves: Vec::new(), inbox, worker, requested: Vec::new(), albedos: Vec::new() })
    }
}

impl Pane for Plots {
    fn name(&self) -> &'static str {
        "plots"
    }

    fn title(&self) -> &'static str {
        "Plots"
    }

    fn place(&self) -> Place {
        Place::View(Some(Share { slot: Slot::Right, tab: "Curves" }))
    }

    fn commands(&mut self, offers: &mut Offers, _cx: &mut PaneContext) {
        if offers.offer(Command::key(LOG, "Plots: logarithmic or linear")) {
            self.look.log ^= true;
        }
        if offers.offer(Command::key(COSINE, "Plots: times the cosine")) {
            self.look.times_cosine ^= true;
        }
    }

    fn settings(&self) -> serde_json::Value {
        saved(&self.look)
    }

    fn restore(&mut self, settings: &serde_json::Value) -> serde_json::Result<()> {
        self.look = restored(settings)?;
        Ok(())
    }

    fn receive(&mut self, _ctx: &Context, _cx: &mut PaneContext) {
        if let Some(albedos) = self.inbox.try_iter().last() {
            self.albedos = albedos;
        }
    }

    fn ui(&mut self, ui: &mut Ui, cx: &mut PaneContext) {
        self.tools_ui(ui);
        self.place_ui(ui);
        self.refresh(cx);
        let drawn = self.drawn(cx);
        let look = self.look;
        let mut plot = empty_plot(&look).height(ui.available_height());
        if cx.reset_views {
            plot = plot.reset();
        }
        let response = plot.show(ui, |plot| {
            for one in &drawn {
                draw(plot, one, &look);
            }
            if look.kind == CurveKind::Lobe {
                draw_incidence(plot, &drawn, &look);
            }
            navigate_plot(plot);
        });
        focus_ui(ui, &response.response);
        cx.reset_next |= ViewKeys::of(ui.ctx(), &response.response).reset;
        let name = format!("{} plot", look.kind.name());
        let info = || egui::WidgetInfo::labeled(egui::accesskit::Role::Figure, true, &name);
        response.response.widget_info(info);
    }

    fn request(&mut self, cx: &mut PaneContext) {
        if self.look.kind != CurveKind::Albedo {
            return;
        }
        let requests: Vec<_> = cx.documents.visible().filter_map(AlbedoRequest::of).collect();
        let keys: Vec<_> = requests.iter().map(|r| (r.document, r.version, r.truth.is_some())).collect();
        if keys != self.requested {
            self.requested = keys;
            self.worker.put(requests);
        }
    }
}

impl Plots {
    fn tools_ui(&mut self, ui: &mut Ui) {
        let keys = |key| ui.ctx().format_shortcut(&key);
        let (log, cosine) = (keys(LOG), keys(COSINE));
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new("Plots").strong().size(15.0));
            ui.add_space(6.0);
            segments_ui(ui, &mut self.look.kind, &CurveKind::ALL, CurveKind::name);
            ui.separator();
            ui.checkbox(&mut self.look.log, "Log").on_hover_text(format!("Logarithmic values ({log})"));
            ui.checkbox(&mut self.look.times_cosine, "× cos θi")
                .on_hover_text(format!("Times the cosine of the light ({cosine})"));
        });
    }

    /// Where the curves cut the BRDF, and of which channel they are.
    fn place_ui(&mut self, ui: &mut Ui) {
        let look = &mut self.look;
        ui.horizontal_wrapped(|ui| {
            let slider = |ui: &mut Ui, name: &str, high: f64, default: f64, value: &mut f64| {
                let mut number = Number::new(name, 0.0..=high, default, "Where the curve cuts the BRDF");
                number.suffix = "°";
                tool_ui(ui, number, if name.len() > 8 { 260.0 } else { 200.0 }, value);
            };
            let defaults = CurveLook::default().at;
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
                        slider(ui, names[axis], high, defaults[axis], &mut look.at[axis]);
                    }
                    ui.checkbox(&mut look.samples, "Samples").on_hover_text("Measurements near the curve");
                }
            }
            let names = |c| if c == Channel::Rgb { "Mean" } else { Channel::name(c) };
            segments_ui(ui, &mut look.channel, &Channel::ALL, names);
        });
    }

    /// Computes the curves that have changed and drops those that are no longer visible.
    fn refresh(&mut self, cx: &PaneContext) {
        // The axis is scaled when curves are drawn.
        let look = CurveLook { log: false, ..self.look };
        let mut old = std::mem::take(&mut self.curves);
        for document in cx.documents.visible() {
            let Some(fitted) = &document.fitted else { continue };
            let key = CurveKey {
                document: document.id,
                version: fitted.version,
                has_sigma: fitted.sigma.is_some(),
                truth_is_tabulated: document.truth.is_some(),
                look,
            };
            let known = old.iter().position(|curve| curve.key == key);
            self.curves.push(known.map_or_else(|| compute(document, key), |at| old.swap_remove(at)));
        }
    }

    fn drawn(&self, cx: &PaneContext) -> Vec<Drawn> {
        let look = &self.look;
        let named = |document: &Document, points, samples| Drawn {
            name: document.name.clone(),
            colour: document.colour,
            points,
            samples,
        };
        if look.kind == CurveKind::Albedo {
            let albedos = self.albedos.iter().filter_map(|a| {
                let document = cx.documents.visible().find(|d| d.id == a.document)?;
                let points = (0..ALBEDO_ANGLES).map(|k| CurvePoint {
                    x: 5.0 * k as f64,
                    truth: a.truth.as_ref().map(|t| look.channel.of(t[k])),
                    mean: look.channel.of(a.mean[k]),
                    band: None,
                });
                Some(named(document, points.collect(), Vec::new()))
            });
            return albedos.collect();
        }
        let curves = self.curves.iter().filter_map(|curve| {
            let document = cx.documents.get(curve.key.document)?;
            Some(named(document, curve.points.clone(), curve.samples.clone()))
        });
        curves.collect()
    }
}

/// The curve of a document and the samples near it; the worker integrates albedos.
fn compute(document: &Document, key: CurveKey) -> Curve {
    let look = &key.look;
    let samples = if look.samples { samples_near(document, look) } else { Vec::new() };
    let points = if look.kind == CurveKind::Albedo { Vec::new() } else { curve(document, look) };
    Curve { key, points, samples }
}

/// The plot without its curves.
fn empty_plot(look: &CurveLook) -> Plot<'static> {
    let lobe = look.kind == CurveKind::Lobe;
    let log = look.log && !lobe;
    let value = move |y: f64| short(if log { 10f64.powf(y) } else { y });
    let plot = Plot::new(("plot", look.kind, look.log))
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .legend(Legend::default())
        .y_axis_formatter(move |mark, _| value(mark.value))
        .label_formatter(move |at| {
            let HoverPosition::NearDataPoint { plot_name, position, .. } = at else { return None };
            Some(format!("{plot_name}\n{}  {}", short(position.x), value(position.y)))
        });
    if lobe {
        return plot.data_aspect(1.0).x_axis_formatter(|mark, _| short(mark.value.abs())).show_grid(true);
    }
    let (x, y) = match look.kind {
        CurveKind::ThetaH => ("θh", "f, 1/sr"),
        CurveKind::ThetaD => ("θd", "f, 1/sr"),
        CurveKind::PhiD => ("φd", "f, 1/sr"),
        CurveKind::Albedo | CurveKind::Lobe => ("angle of incidence", "albedo"),
    };
    plot.x_axis_formatter(|mark, _| format!("{}°", short(mark.value))).x_axis_label(x).y_axis_label(y)
}

/// The smallest value on logarithmic axes.
const FLOOR: f64 = 1e-4;

/// The place of a point of a curve on the axes.
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

/// Draws the lines of one material.
fn draw(plot: &mut PlotUi<'_>, one: &Drawn, look: &CurveLook) {
    let line = |y: &dyn Fn(&CurvePoint) -> Option<f64>| -> PlotPoints<'static> {
        one.points.iter().filter_map(|p| y(p).map(|y| placed(look, p.x, y))).collect::<Vec<_>>().into()
    };
    draw_interval(plot, one, look);
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

/// Draws the 95 % interval: two thin lines around a lobe, an area around other curves.
fn draw_interval(plot: &mut PlotUi<'_>, one: &Drawn, look: &CurveLook) {
    let band: Vec<_> = one.points.iter().filter_map(|p| p.band.map(|ends| (p.x, ends))).collect();
    if band.is_empty() {
        return;
    }
    let ends = [0, 1].map(|k| -> Vec<[f64; 2]> {
        band.iter().map(|(x, (low, high))| placed(look, *x, [*low, *high][k])).collect()
    });
    if look.kind == CurveKind::Lobe {
        for end in ends {
            let line = Line::new("", end).color(one.colour.gamma_multiply(0.5)).width(0.7);
            plot.line(line.allow_hover(false));
        }
    } else {
        let xs: Vec<f64> = band.iter().map(|(x, _)| *x).collect();
        let [lows, highs] = ends.map(|end| end.into_iter().map(|[_, y]| y).collect::<Vec<_>>());
        let area = FilledArea::new("", &xs, &lows, &highs).fill_color(one.colour.gamma_multiply(0.25));
        plot.add(area.allow_hover(false));
    }
}

/// Draws the surface, its normal and the direction of the light.
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
