//! Measured and planned directions on the hemisphere, and what a plan is worth.

use std::path::PathBuf;
use std::sync::mpsc::Receiver;

use eframe::egui::{self, Align2, Color32, Context, RichText, ScrollArea, Ui};
use egui_plot::{Line, PlotPoint, PlotPoints, PlotUi, Points, Text};
use gpbrdf_core::plan::{Device, Geometry, Plan};
use serde::{Deserialize, Serialize};

use crate::viewer::state::document::Document;
use crate::viewer::ui::half_disc;
use crate::viewer::ui::navigate::navigate_plot;
use crate::viewer::ui::pane::{
    Command, Offers, Order, Pane, PaneContext, Place, Progress, Start, restored, saved,
};
use crate::viewer::ui::widgets::{Number, short, subscripted, tool_ui};
use crate::viewer::work::dialogs::{Access, Question};
use crate::viewer::work::export;
use crate::viewer::work::mailbox::Sender;
use crate::viewer::work::outbox::Outbox;
use crate::viewer::work::planner::{PlanKey, PlanRequest, Planned, spawn};

/// Width of the list of planned directions.
const LIST: f32 = 310.0;

/// From this width on there is room for the list.
const ROOMY: f32 = 620.0;

/// What the pane remembers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
struct Look {
    /// Number of planned directions.
    count: f64,
    /// The limits of the instrument, degrees.
    theta_max: f64,
    step: f64,
    min_separation: f64,
    in_plane: bool,
}

impl Default for Look {
    fn default() -> Self {
        let Device { theta_max, step, min_separation, in_plane, .. } = Device::default();
        Self { count: 10.0, theta_max, step, min_separation, in_plane }
    }
}

impl Look {
    fn device(&self) -> Device {
        Device {
            step: self.step,
            incidences: None,
            theta_max: self.theta_max,
            in_plane: self.in_plane,
            min_separation: self.min_separation,
        }
    }

    fn count(&self) -> usize {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the slider ends at 50")]
        let count = self.count.clamp(1.0, 50.0) as usize;
        count
    }
}

/// What the pane is sent.
enum Message {
    Planned(Box<Planned>),
    /// Write the plan to this file.
    Export(PathBuf),
}

/// The pane of directions.
pub(crate) struct Directions {
    look: Look,
    outbox: Outbox<Message>,
    inbox: Receiver<Message>,
    worker: Sender<PlanRequest>,
    requested: Option<PlanKey>,
    /// Whether the last request has been answered.
    is_answered: bool,
    /// Whether the view was drawn in this frame.
    is_shown: bool,
    /// The rank that the pointer is over in the list.
    pointed: Option<usize>,
}

impl Directions {
    /// Starts the worker.
    pub(crate) fn new(start: &Start) -> std::io::Result<Self> {
        let (outbox, inbox) = start.channel();
        let worker = spawn(outbox.map(|planned| Message::Planned(Box::new(planned))))?;
        let look = Look::default();
        let (requested, is_answered, is_shown, pointed) = (None, true, false, None);
        Ok(Self { look, outbox, inbox, worker, requested, is_answered, is_shown, pointed })
    }
}

impl Pane for Directions {
    fn name(&self) -> &'static str {
        "directions"
    }

    fn title(&self) -> &'static str {
        "Directions"
    }

    fn place(&self) -> Place {
        Place::View(None)
    }

    fn commands(&mut self, offers: &mut Offers, cx: &mut PaneContext) {
        if offers.offer(Command::menu("Export planned directions…")) {
            cx.order(Order::Ask(Question {
                title: "Export planned directions",
                help: "A CSV file, the most telling first; add what is measured there as a column r, g and b.",
                access: Access::Write { name: "plan.csv" },
                answer: self.outbox.map(Message::Export),
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

    fn receive(&mut self, _ctx: &Context, cx: &mut PaneContext) {
        while let Ok(message) = self.inbox.try_recv() {
            match message {
                Message::Planned(planned) => {
                    self.is_answered |= self.requested.as_ref() == Some(&planned.key);
                    if let Some(document) = cx.documents.get_mut(planned.key.document) {
                        document.planned = Some(*planned);
                    }
                }
                Message::Export(path) => {
                    if let Some(document) = cx.documents.selected() {
                        export::plan(document, &path, &cx.saved);
                    }
                }
            }
        }
    }

    fn ui(&mut self, ui: &mut Ui, cx: &mut PaneContext) {
        self.is_shown = true;
        self.tools_ui(ui);
        let Some(document) = cx.documents.selected() else { return };
        worth_ui(ui, document);
        let plan = document.plan();
        let has_list = ui.available_width() > ROOMY;
        let mut pointed = None;
        let home = ui
            .horizontal_top(|ui| {
                let width = ui.available_width() - if has_list { LIST } else { 0.0 };
                let home = self.hemisphere_ui(ui, document, plan, width, cx.reset_views);
                if let Some(plan) = plan.filter(|_| has_list) {
                    pointed = list_ui(ui, plan);
                }
                home
            })
            .inner;
        self.pointed = pointed;
        cx.reset_next |= home;
    }

    fn request(&mut self, cx: &mut PaneContext) {
        let is_shown = std::mem::take(&mut self.is_shown);
        // Plans of what is measured are on slices, too.
        let Some(document) = cx.documents.selected().filter(|d| is_shown || d.is_scattered()) else { return };
        let request = PlanRequest::of(document, self.look.device(), self.look.count());
        let Some(request) = request.filter(|request| self.requested.as_ref() != Some(&request.key)) else {
            return;
        };
        (self.requested, self.is_answered) = (Some(request.key.clone()), false);
        self.worker.put(request);
    }

    fn progress(&self) -> Progress {
        if self.is_answered { Progress::Done } else { Progress::Refining }
    }
}

impl Directions {
    fn tools_ui(&mut self, ui: &mut Ui) {
        let look = &mut self.look;
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new("Directions").strong().size(15.0));
            ui.add_space(6.0);
            let mut count = Number::new("Plan", 1.0..=50.0, 10.0, "Number of directions to measure next");
            count.whole = true;
            tool_ui(ui, count, 190.0, &mut look.count);
            let usual = Look::default();
            let mut degrees = |label, range, usual, help, value: &mut f64| {
                let mut number = Number::new(label, range, usual, help);
                number.suffix = "°";
                number.whole = true;
                tool_ui(ui, number, 210.0, value);
            };
            let reach = "The largest angle between detector and normal";
            degrees("Reach", 10.0..=87.0, usual.theta_max, reach, &mut look.theta_max);
            let step =
                "Step of all angles; the first 20 and those of matte materials are at multiples of 5 degrees";
            degrees("Step", 1.0..=30.0, usual.step, step, &mut look.step);
            let apart = "The smallest angle between light and detector";
            degrees("Apart", 0.0..=30.0, usual.min_separation, apart, &mut look.min_separation);
            ui.checkbox(&mut look.in_plane, "In plane")
                .on_hover_text("Keep the detector in the plane of light and normal");
        });
    }

    /// The hemisphere of the detector seen from above; whether the view is to be reset.
    fn hemisphere_ui(
        &self,
        ui: &mut Ui,
        document: &Document,
        plan: Option<&Plan>,
        width: f32,
        reset: bool,
    ) -> bool {
        let plot = half_disc::plot(ui, "hemisphere", reset).width(width.max(120.0));
        let weak = ui.visuals().weak_text_color();
        let strong = ui.visuals().strong_text_color();
        let response = plot.show(ui, |plot| {
            draw_frame(plot, weak);
            draw_measured(plot, document);
            if let Some(plan) = plan {
                self.draw_planned(plot, plan, strong);
            }
            navigate_plot(plot);
        });
        let planned = plan.map_or(0, |plan| plan.geometries.len());
        half_disc::keys(ui, &response.response, &format!("Hemisphere, {planned} planned directions"))
    }

    fn draw_planned(&self, plot: &mut PlotUi<'_>, plan: &Plan, colour: Color32) {
        for (rank, geometry) in plan.geometries.iter().enumerate() {
            let is_pointed = self.pointed == Some(rank);
            let at = detector(geometry);
            if is_pointed {
                let light = [geometry.theta_i, 0.0];
                let way = Line::new("pointed", PlotPoints::from(vec![light, [0.0, 0.0], at]));
                plot.line(way.color(colour).width(1.5).allow_hover(false));
                let light = Points::new("light", vec![light]).shape(egui_plot::MarkerShape::Diamond);
                plot.points(light.radius(6.0).color(LIGHT).allow_hover(false));
            }
            let radius = if is_pointed { 8.0 } else { 5.0 };
            let ring = Points::new("planned", vec![at]).radius(radius).filled(false).color(PLANNED);
            plot.points(ring.allow_hover(false));
            let text = RichText::new((rank + 1).to_string()).color(colour).size(11.0);
            let place = PlotPoint::new(at[0] + 2.0, at[1] + 2.0);
            plot.text(Text::new("rank", place, text).anchor(Align2::LEFT_BOTTOM).allow_hover(false));
        }
    }
}

/// The colour of planned directions, here and on slices.
pub(super) const PLANNED: Color32 = Color32::from_rgb(0xF0, 0x5A, 0x5A);

/// The colour of lights.
const LIGHT: Color32 = Color32::from_rgb(0xF0, 0xD0, 0x50);

/// The place of the detector in the picture.
fn detector(geometry: &Geometry) -> [f64; 2] {
    half_disc::place(geometry.theta_o, geometry.phi_o.to_radians())
}

/// What does not depend on the directions.
fn draw_frame(plot: &mut PlotUi<'_>, colour: Color32) {
    half_disc::rings(plot, colour, colour);
    let text = RichText::new("light this way").color(colour).size(11.0);
    plot.text(
        Text::new("light", PlotPoint::new(92.0, -1.0), text).anchor(Align2::RIGHT_TOP).allow_hover(false),
    );
}

/// Where detectors stood.
fn draw_measured(plot: &mut PlotUi<'_>, document: &Document) {
    let Some(fitted) = document.fitted.as_ref().filter(|_| document.is_scattered()) else { return };
    let measured = fitted.samples.angles.iter().take(half_disc::MOST_DRAWN).map(|angles| {
        let (wi, wo) = angles.to_directions();
        half_disc::place(half_disc::polar(&wo), half_disc::azimuth_between(&wi, &wo))
    });
    let points = Points::new("measured", measured.collect::<Vec<_>>()).radius(2.0);
    plot.points(points.color(document.colour).allow_hover(false));
}

/// What is expected of the model and of the plan, beside what leaving out each sample says.
fn worth_ui(ui: &mut Ui, document: &Document) {
    let expected = match document.planned.as_ref().map(|planned| &planned.plan) {
        None => "planning…".to_owned(),
        Some(Err(message)) => message.clone(),
        Some(Ok(Plan { errors, .. })) => {
            let percent = |error: f64| format!("{} %", short(100.0 * error));
            let [now, then] = [errors.first(), errors.last()].map(|e| e.copied().unwrap_or(f64::NAN));
            format!("expected error {} now, {} after {} more", percent(now), percent(then), errors.len() - 1)
        }
    };
    let left_out = document.fitted.as_ref().and_then(|fitted| fitted.left_out.as_ref());
    let found = left_out.map(|left_out| {
        let m = &left_out.metrics;
        let [error, covered] = [m.median_abs_log, m.coverage_95].map(|x| short(100.0 * x));
        format!("left out: median error {error} %, {covered} % covered")
    });
    ui.horizontal_wrapped(|ui| {
        let whose = if document.is_scattered() { "What to measure next:" } else { "What to measure first:" };
        ui.label(RichText::new(whose).strong());
        ui.label(expected).on_hover_text(
            "Root mean square of the error of ln f, weighted with the cosines, that the process itself expects",
        );
        if let Some(found) = found {
            ui.separator();
            ui.label(found).on_hover_text("Every sample as it is predicted from all others");
        }
    });
}

/// The planned directions by rank; the one under the pointer.
fn list_ui(ui: &mut Ui, plan: &Plan) -> Option<usize> {
    let mut pointed = None;
    ui.vertical(|ui| {
        ui.set_width(LIST - 12.0);
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            egui::Grid::new("planned").num_columns(5).striped(true).spacing([14.0, 3.0]).show(ui, |ui| {
                for title in ["", "θi", "θo", "φo", "error after"] {
                    ui.label(subscripted(title));
                }
                ui.end_row();
                for (rank, geometry) in plan.geometries.iter().enumerate() {
                    let Geometry { theta_i, theta_o, phi_o } = geometry;
                    let mut row = ui.label((rank + 1).to_string());
                    for degrees in [theta_i, theta_o, phi_o] {
                        row |= ui.label(format!("{}°", short(*degrees)));
                    }
                    row |= ui.label(format!("{} %", short(100.0 * plan.errors[rank + 1])));
                    if row.hovered() {
                        pointed = Some(rank);
                    }
                    ui.end_row();
                }
            });
        });
    });
    pointed
}
