//! Curves of all visible materials: lobes, curves along the angles, albedos.

use std::path::PathBuf;
use std::sync::mpsc::Receiver;

use eframe::egui::{
    self, Color32, Context, Key, KeyboardShortcut, Modifiers, Rect, RichText, ScrollArea, Stroke, Ui,
    UiBuilder, Visuals,
};
use egui_plot::{
    AxisHints, FilledArea, GridInput, GridMark, HoverPosition, Line, LineStyle, Plot, PlotPoints, PlotUi,
    Points,
};

use crate::viewer::state::document::{Document, DocumentId};
use crate::viewer::state::look::{Channel, CurveKind, CurveLook};
use crate::viewer::ui::navigate::{ViewKeys, focus_ui, navigate_plot};
use crate::viewer::ui::pane::{
    Command, Offers, Order, Pane, PaneContext, Place, Share, Slot, Start, restored, saved,
};
use crate::viewer::ui::theme::LIGHT;
use crate::viewer::ui::ticks::{axis, degree_marks, linear_marks, log_marks};
use crate::viewer::ui::widgets::{Number, segments_ui, short, subscripted, tool_ui};
use crate::viewer::work::curves::{
    ALBEDO_ANGLES, Albedo, AlbedoRequest, CurvePoint, curve, samples_near, spawn,
};
use crate::viewer::work::dialogs::{Access, Question};
use crate::viewer::work::export;
use crate::viewer::work::mailbox::Sender;
use crate::viewer::work::outbox::Outbox;

const LOG: KeyboardShortcut = KeyboardShortcut::new(Modifiers::NONE, Key::L);
const COSINE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::NONE, Key::C);

/// The width of the boxes to tick that follow the kinds of curves, with a line before them.
const BOXES: f32 = 150.0;
/// In a narrower pane the channels have a line of their own, so that they stay together.
const NARROW: f32 = 430.0;

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
    /// Where the plot is on the screen, where it is shown.
    shown: Option<Rect>,
    files: Receiver<PathBuf>,
    answer: Outbox<PathBuf>,
    /// Where the curves are to be written.
    export: Option<PathBuf>,
}

impl Plots {
    /// Starts the worker, which integrates albedos.
    pub(crate) fn new(start: &Start) -> std::io::Result<Self> {
        let (outbox, inbox) = start.channel();
        let worker = spawn(outbox)?;
        let look = CurveLook::default();
        let (answer, files) = start.channel();
        Ok(Self {
            look,
            curves: Vec::new(),
            inbox,
            worker,
            requested: Vec::new(),
            albedos: Vec::new(),
            shown: None,
            files,
            answer,
            export: None,
        })
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

    fn commands(&mut self, offers: &mut Offers, cx: &mut PaneContext) {
        if offers.offer(Command::key(LOG, "Plots: logarithmic or linear")) {
            self.look.log ^= true;
        }
        if offers.offer(Command::key(COSINE, "Plots: times the cosine")) {
            self.look.times_cosine ^= true;
        }
        if offers.offer(Command::menu("Export curves…")) {
            cx.order(Order::Ask(Question {
                title: "Export curves",
                help: "A CSV file of the curves that are plotted, and a PNG picture beside it where the plot is shown.",
                access: Access::Write { name: "curves.csv" },
                answer: self.answer.clone(),
            }));
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
        self.export = self.files.try_iter().last().or(self.export.take());
    }

    fn ui(&mut self, ui: &mut Ui, cx: &mut PaneContext) {
        self.tools_ui(ui);
        self.place_ui(ui);
        self.refresh(cx);
        let drawn = self.drawn(cx);
        let look = self.look;
        let beside = ui.available_width() > ROOMY;
        if !beside {
            ui.horizontal_wrapped(|ui| legend_ui(ui, &drawn, &look, false));
        }
        let mut size = ui.available_size();
        if beside {
            size.x -= LEGEND;
        }
        let mut plot = empty_plot(&look, ui.visuals()).width(size.x).height(size.y);
        if cx.reset_views {
            plot = plot.reset();
        }
        let area = ui.available_rect_before_wrap();
        let response = plot.show(ui, |plot| {
            for one in &drawn {
                draw(plot, one, &look);
            }
            if look.kind == CurveKind::Lobe {
                draw_incidence(plot, &drawn, &look);
            }
            navigate_plot(plot);
        });
        if beside {
            let room = area.with_min_x(area.left() + size.x + 10.0);
            ui.scope_builder(UiBuilder::new().max_rect(room).id_salt("legend"), |ui| {
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| legend_ui(ui, &drawn, &look, true));
            });
        }
        self.shown = Some(area);
        focus_ui(ui, &response.response);
        cx.reset_next |= ViewKeys::of(ui.ctx(), &response.response).reset;
        let name = format!("{} plot", look.kind.name());
        let info = || egui::WidgetInfo::labeled(egui::accesskit::Role::Figure, true, &name);
        response.response.widget_info(info);
    }

    fn request(&mut self, cx: &mut PaneContext) {
        let shown = self.shown.take();
        if let Some(path) = self.export.take() {
            self.refresh(cx);
            let text = csv(&self.drawn(cx), &self.look);
            export::curves(&cx.egui, text, shown, &path, &cx.saved);
        }
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
            if ui.available_size_before_wrap().x > BOXES {
                ui.separator();
            } else {
                ui.end_row();
            }
            ui.checkbox(&mut self.look.log, "Log").on_hover_text(format!("Logarithmic values ({log})"));
            ui.checkbox(&mut self.look.times_cosine, subscripted("× cos θi"))
                .on_hover_text(format!("Times the cosine of the light ({cosine})"));
        });
    }

    /// Where the curves cut the BRDF, and of which channel they are.
    fn place_ui(&mut self, ui: &mut Ui) {
        let look = &mut self.look;
        let names = |c| if c == Channel::Rgb { "Mean" } else { Channel::name(c) };
        let is_narrow = ui.available_width() < NARROW;
        ui.horizontal_wrapped(|ui| {
            let slider = |ui: &mut Ui, name: &str, high: f64, default: f64, value: &mut f64| {
                let mut number =
                    Number::new(name, 0.0..=high, default, "Where the curve cuts the BRDF, degrees");
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
            if !is_narrow {
                segments_ui(ui, &mut look.channel, &Channel::ALL, names);
            }
        });
        if is_narrow {
            ui.horizontal_wrapped(|ui| segments_ui(ui, &mut look.channel, &Channel::ALL, names));
        }
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
fn empty_plot(look: &CurveLook, visuals: &Visuals) -> Plot<'static> {
    let lobe = look.kind == CurveKind::Lobe;
    let (kind, log) = (look.kind, look.log);
    let look = *look;
    let value = move |y: f64| short(if log { 10f64.powf(y) } else { y });
    let (x, y) = names(&look);
    let plot = Plot::new(("plot", look.kind, look.log)).allow_scroll(false).allow_boxed_zoom(false);
    let plot = plot.label_formatter(move |at| {
        let HoverPosition::NearDataPoint { plot_name, position, .. } = at else { return None };
        let (place, value) = read(&look, [position.x, position.y]);
        Some(format!("{plot_name}\n{x} {place:.1}°\n{y} {}", short(value)))
    });
    if lobe {
        // The radius is the value; along a logarithmic one, each unit is a power of ten.
        let radius = move |mark: GridMark| {
            short(if log { FLOOR * 10f64.powf(mark.value.abs()) } else { mark.value.abs() })
        };
        let marks = move |input: GridInput| {
            let marks = linear_marks(&input, RADII_APART);
            marks.into_iter().filter(|mark| !log || mark.value.fract() == 0.0).collect()
        };
        let (across, up) = (AxisHints::new_x().label(y), AxisHints::new_y());
        return plot
            .data_aspect(1.0)
            .x_grid_spacer(marks)
            .y_grid_spacer(marks)
            .custom_x_axes(vec![axis(across, visuals).formatter(move |mark, _| radius(mark))])
            .custom_y_axes(vec![axis(up, visuals).formatter(move |mark, _| radius(mark))]);
    }
    let across =
        AxisHints::new_x().label(subscripted(x)).formatter(|mark, _| format!("{}°", short(mark.value)));
    let up = AxisHints::new_y().label(subscripted(y)).formatter(move |mark, _| value(mark.value));
    let up_marks = move |input: GridInput| {
        if log && kind != CurveKind::Lobe { log_marks(&input) } else { linear_marks(&input, VALUES_APART) }
    };
    plot.x_grid_spacer(|input| degree_marks(&input, DEGREES_APART))
        .y_grid_spacer(up_marks)
        .custom_x_axes(vec![axis(across, visuals)])
        .custom_y_axes(vec![axis(up, visuals).min_thickness(48.0)])
}

/// Points between marks whose labels are beside or above each other.
const DEGREES_APART: f64 = 44.0;
const RADII_APART: f64 = 60.0;
const VALUES_APART: f64 = 28.0;

/// What is plotted along both axes, with units.
fn names(look: &CurveLook) -> (&'static str, &'static str) {
    let value = if look.times_cosine { "f cos θi, 1/sr" } else { "f, 1/sr" };
    match look.kind {
        CurveKind::Lobe => ("θo", value),
        CurveKind::ThetaH => ("θh", value),
        CurveKind::ThetaD => ("θd", value),
        CurveKind::PhiD => ("φd", value),
        CurveKind::Albedo => ("θi", "albedo"),
    }
}

/// Degrees and value at a point of the plot; the other way round than [`placed`].
fn read(look: &CurveLook, [x, y]: [f64; 2]) -> (f64, f64) {
    match (look.kind, look.log) {
        (CurveKind::Lobe, log) => {
            let radius = x.hypot(y);
            (x.atan2(y).to_degrees(), if log { FLOOR * 10f64.powf(radius) } else { radius })
        }
        (_, true) => (x, 10f64.powf(y)),
        (_, false) => (x, y),
    }
}

/// The width of the legend beside a plot, and the room from which on it is there.
const LEGEND: f32 = 150.0;
const ROOMY: f32 = 480.0;

/// What the lines are: the materials in the order of their list, then what each kind of line means; below each other
/// where the legend is beside the plot, else in rows.
fn legend_ui(ui: &mut Ui, drawn: &[Drawn], look: &CurveLook, beside: bool) {
    let entry = |ui: &mut Ui, text: &str, paint: &dyn Fn(&egui::Painter, Rect)| {
        let parts = |ui: &mut Ui| {
            ui.spacing_mut().item_spacing.x = 6.0;
            let (rect, _) = ui.allocate_exact_size(egui::vec2(24.0, 12.0), egui::Sense::hover());
            paint(ui.painter(), rect);
            let label = egui::Label::new(text);
            let label = if beside { label.truncate() } else { label.extend() };
            ui.add(label).on_hover_text(text);
        };
        if beside {
            ui.horizontal(parts);
        } else {
            parts(ui);
        }
    };
    for one in drawn {
        entry(ui, &one.name, &|painter, rect| {
            painter.hline(rect.x_range(), rect.center().y, Stroke::new(3.0, one.colour));
        });
    }
    let ink = ui.visuals().text_color();
    let has = |test: &dyn Fn(&CurvePoint) -> bool| drawn.iter().any(|one| one.points.iter().any(test));
    entry(ui, "prediction", &|painter, rect| {
        painter.hline(rect.x_range(), rect.center().y, Stroke::new(2.2, ink.gamma_multiply(FAINT)));
    });
    if has(&|point| point.truth.is_some()) {
        entry(ui, "truth", &|painter, rect| {
            let line = [rect.left_center(), rect.right_center()];
            painter.extend(egui::Shape::dashed_line(&line, Stroke::new(1.6, ink), 5.0, 3.0));
        });
    }
    if has(&|point| point.band.is_some()) {
        entry(ui, "95 % interval", &|painter, rect| {
            painter.rect_filled(rect.shrink2(egui::vec2(0.0, 1.0)), 2.0, ink.gamma_multiply(0.25));
        });
    }
    if look.samples && drawn.iter().any(|one| !one.samples.is_empty()) {
        entry(ui, "samples", &|painter, rect| {
            painter.circle_filled(rect.center(), 2.5, ink);
        });
    }
    if look.kind == CurveKind::Lobe {
        entry(ui, "light", &|painter, rect| {
            painter.hline(rect.x_range(), rect.center().y, Stroke::new(1.6, LIGHT));
        });
    }
}

/// How strong the line of a prediction is, over which the truth is dashed.
const FAINT: f32 = 0.6;

/// The curves as a table: a row for each point of each material.
fn csv(drawn: &[Drawn], look: &CurveLook) -> String {
    let (x, y) = names(look);
    let mut text = format!("# {}: {y} over {x} in degrees", look.kind.name());
    if look.kind == CurveKind::Lobe {
        text.push_str(&format!(", light at {} degrees on the other side", short(look.incidence)));
    }
    text.push_str("\nmaterial,degrees,truth,prediction,lower_95,upper_95\n");
    for one in drawn {
        let name = format!("\"{}\"", one.name.replace('"', "\"\""));
        for point in &one.points {
            let optional = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
            let (lower, upper) = (point.band.map(|band| band.0), point.band.map(|band| band.1));
            let [truth, lower, upper] = [point.truth, lower, upper].map(optional);
            text.push_str(&format!("{name},{},{truth},{},{lower},{upper}\n", point.x, point.mean));
        }
    }
    text
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
    let mean = Line::new(one.name.clone(), line(&|p| Some(p.mean)));
    plot.line(mean.color(one.colour.gamma_multiply(FAINT)).width(2.6));
    if one.points.iter().any(|p| p.truth.is_some()) {
        let truth = Line::new(format!("{} (truth)", one.name), line(&|p| p.truth));
        plot.line(truth.color(one.colour).width(1.6).style(LineStyle::dashed_dense()));
    }
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
    plot.line(Line::new("light", light).color(LIGHT).width(1.6).allow_hover(false));
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
        // What is read at a point is what was placed there.
        for look in [look, log, CurveLook { log: true, ..look }, CurveLook { log: false, ..log }] {
            let (degrees, value) = read(&look, placed(&look, 35.0, 0.2));
            assert!((degrees - 35.0).abs() < 1e-9 && (value - 0.2).abs() < 1e-9, "{degrees} {value}");
        }
    }

    #[test]
    fn tables_of_curves_have_a_row_for_each_point() {
        let point = |x: f64, band| CurvePoint { x, truth: None, mean: 0.5, band };
        let points = vec![point(1.0, Some((0.25, 1.0))), point(2.0, None)];
        let one = Drawn { name: "a \"b\", c".into(), colour: Color32::RED, points, samples: Vec::new() };
        let text = csv(&[one], &CurveLook::default());
        let rows: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(
            rows,
            [
                "material,degrees,truth,prediction,lower_95,upper_95",
                "\"a \"\"b\"\", c\",1,,0.5,0.25,1",
                "\"a \"\"b\"\", c\",2,,0.5,,"
            ]
        );
    }
}
