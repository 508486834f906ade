//! Truth, prediction, difference and sigma side by side, in views that pan and zoom together.

use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Receiver;

use eframe::egui::{self, Align2, Color32, Context, RichText, TextureHandle, Ui, Visuals, vec2};
use egui_plot::{AxisHints, GridInput, GridMark, Plot, PlotImage, PlotPoint, PlotUi, Points};
use gpbrdf_core::figure::Colormap;
use gpbrdf_core::{Brdf, HalfDiff};
use serde::{Deserialize, Serialize};

use super::directions::PLANNED;
use crate::viewer::state::document::{Document, Work};
use crate::viewer::state::look::{Channel, SliceLook};
use crate::viewer::ui::navigate::{ViewKeys, focus_ui, navigate_plot};
use crate::viewer::ui::pane::{
    Command, Offers, Order, Pane, PaneContext, Place, Progress, Share, Slot, Start, restored, saved,
};
use crate::viewer::ui::widgets::{
    Number, narrow, put_texture, scale_ui, segments_ui, short, subscripted, tool_ui, tools_menu_ui,
};
use crate::viewer::work::curves::band_at;
use crate::viewer::work::dialogs::{Access, Question};
use crate::viewer::work::export;
use crate::viewer::work::mailbox::Sender;
use crate::viewer::work::outbox::Outbox;
use crate::viewer::work::slices::{SliceImages, SliceKey, SliceRequest, Truth, spawn};

/// Titles of the four views.
const TITLES: [&str; 4] = ["Truth", "Prediction", "Difference", "Sigma"];
/// The index of one of them.
const DIFFERENCE: usize = 2;

/// What the colours of each view mean.
const MEANINGS: [&str; 4] =
    ["f, 1/sr", "f, 1/sr", "ln(prediction + 0.001) − ln(truth + 0.001)", "standard deviation of the target"];

/// Room for the axes of a view.
const AXES: egui::Vec2 = vec2(72.0, 40.0);
/// Height of a view's title and the gap below it.
const TITLE: f32 = 46.0;
/// From this height on a view has room for what its colours mean; the tooltip of its title says it, too.
const CAPTIONED: f32 = 180.0;
/// Between two views.
const GAP: f32 = 10.0;
/// From this width on, all tools are in one row.
const WIDE: f32 = 780.0;

/// Planned directions within this of `phi_d` of a slice are near it.
const NEAR_SLICE: f64 = 0.35;

/// Regions of a slice at `phi_d` = 90 degrees: name, `theta_h` and `theta_d` in degrees.
const REGIONS: [(&str, f64, f64); 4] = [
    ("specular", 6.0, 45.0),
    ("Fresnel", 12.0, 84.0),
    ("retro-reflection", 45.0, 5.0),
    ("grazing", 78.0, 78.0),
];

/// What the pane remembers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
struct Look {
    #[serde(flatten)]
    slices: SliceLook,
    samples: bool,
    plan: bool,
    regions: bool,
}

impl Default for Look {
    fn default() -> Self {
        Self { slices: SliceLook::default(), samples: false, plan: true, regions: false }
    }
}

/// What the pane is sent.
enum Message {
    Images(Box<SliceImages>),
    /// Write the slices to this file.
    Export(PathBuf),
}

/// Slices as textures.
struct Shown {
    key: SliceKey,
    textures: [Option<TextureHandle>; 4],
    limits: [Option<f64>; 4],
}

/// The pane of slices.
pub(crate) struct Slices {
    look: Look,
    outbox: Outbox<Message>,
    inbox: Receiver<Message>,
    worker: Sender<SliceRequest>,
    requested: Option<SliceKey>,
    shown: Option<Shown>,
}

impl Slices {
    /// Starts the worker.
    pub(crate) fn new(start: &Start) -> std::io::Result<Self> {
        let (outbox, inbox) = start.channel();
        let worker = spawn(outbox.map(Message::Images))?;
        Ok(Self { look: Look::default(), outbox, inbox, worker, requested: None, shown: None })
    }
}

impl Pane for Slices {
    fn name(&self) -> &'static str {
        "slices"
    }

    fn title(&self) -> &'static str {
        "Slices"
    }

    fn place(&self) -> Place {
        Place::View(Some(Share { slot: Slot::Below, tab: "Images" }))
    }

    fn commands(&mut self, offers: &mut Offers, cx: &mut PaneContext) {
        if offers.offer(Command::menu("Export slices…")) {
            cx.order(Order::Ask(Question {
                title: "Export slices",
                help: "A figure (.png, .svg or .pdf), and linear slices as EXR files beside it.",
                access: Access::Write { name: "slices.png" },
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

    fn receive(&mut self, ctx: &Context, cx: &mut PaneContext) {
        while let Ok(message) = self.inbox.try_recv() {
            match message {
                Message::Images(images) => self.take(ctx, *images),
                Message::Export(path) => {
                    if let Some(document) = cx.documents.selected() {
                        export::slices(document, &self.look.slices, &path, &cx.saved);
                    }
                }
            }
        }
    }

    fn ui(&mut self, ui: &mut Ui, cx: &mut PaneContext) {
        self.tools_ui(ui);
        let Some(document) = cx.documents.selected() else { return };
        let Some(shown) = self.shown.as_ref().filter(|s| s.key.document == document.id) else {
            if waiting_ui(ui, document) {
                let id = document.id;
                cx.documents.get_mut(id).into_iter().for_each(Document::retry);
            }
            return;
        };
        let grid = Grid { look: &self.look, shown, document, reset: cx.reset_views };
        let pointed = grid.ui(ui);
        if let Some(angles) = pointed.angles {
            hover_ui(ui, document, angles);
        }
        cx.reset_next |= pointed.home;
    }

    fn request(&mut self, cx: &mut PaneContext) {
        let Some(document) = cx.documents.selected() else {
            (self.requested, self.shown) = (None, None);
            return;
        };
        let Some(fitted) = &document.fitted else { return };
        let key = SliceKey {
            document: document.id,
            version: fitted.version,
            look: self.look.slices,
            truth_is_tabulated: document.truth.is_some(),
            has_sigma: fitted.sigma.is_some(),
        };
        if self.requested == Some(key) {
            return;
        }
        let (mean, sigma) = (Arc::clone(&fitted.mean), fitted.sigma.clone());
        self.worker.put(SliceRequest { key, truth: Truth::of(document), mean, sigma });
        self.requested = Some(key);
    }

    fn progress(&self) -> Progress {
        let shown = self.shown.as_ref().map(|shown| shown.key);
        if shown == self.requested { Progress::Done } else { Progress::Waiting }
    }

    fn shown_version(&self) -> Option<u64> {
        Some(self.shown.as_ref().map_or(0, |shown| shown.key.version))
    }
}

impl Slices {
    fn take(&mut self, ctx: &Context, images: SliceImages) {
        let limits = images.slices.each_ref().map(|s| s.as_ref().and_then(|s| s.limit));
        let mut old = self.shown.take().map(|s| s.textures).unwrap_or_default();
        let mut textures = [None, None, None, None];
        for (i, slice) in images.slices.into_iter().enumerate() {
            let Some(slice) = slice else { continue };
            textures[i] = Some(put_texture(ctx, &mut old[i], format!("slice {i}"), slice.image));
        }
        self.shown = Some(Shown { key: images.key, textures, limits });
    }

    fn tools_ui(&mut self, ui: &mut Ui) {
        let Look { slices: look, samples, plan, regions } = &mut self.look;
        let exposure = Number::new("Exposure", -8.0..=8.0, 0.0, "Stops: values are shown times 2 to this");
        let gamma = Number::new(
            "Gamma",
            1.0..=4.0,
            2.2,
            "Values are shown to the power of one over this, which has no unit",
        );
        let wide = ui.available_width() > WIDE;
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new("Slices").strong().size(15.0));
            ui.add_space(6.0);
            let help = "Azimuth of the light about the half vector, degrees";
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
                ui.checkbox(&mut look.square_theta_h, subscripted("Square θh"))
                    .on_hover_text("The warp of the table: more room for the specular peak");
                ui.checkbox(&mut look.chroma, "Chroma")
                    .on_hover_text("Colours divided by their largest channel");
                ui.checkbox(samples, "Samples").on_hover_text("Where it was measured");
                ui.checkbox(plan, "Planned").on_hover_text("Where to measure next, of measured materials");
                ui.checkbox(regions, "Regions").on_hover_text("Names of the regions");
                if !wide {
                    ui.set_min_width(280.0);
                    exposure.row_ui(ui, &mut look.exposure);
                    gamma.row_ui(ui, &mut look.gamma);
                }
            });
        });
    }
}

/// What is going on while there are no slices; whether the model is to be fitted again.
fn waiting_ui(ui: &mut Ui, document: &Document) -> bool {
    let mut again = false;
    ui.vertical_centered(|ui| {
        ui.add_space((0.3 * ui.available_height()).max(8.0));
        if document.is_busy() || document.fitted.is_some() {
            ui.spinner();
        }
        ui.label(document.work.text().unwrap_or_else(|| "Drawing slices".to_owned()));
        if matches!(document.work, Work::Failed(_) | Work::Cancelled) {
            again = ui.button("Fit it again").clicked();
        }
    });
    again
}

/// What the pointer and the keys say about the views.
#[derive(Default)]
struct Pointed {
    /// The angles under the pointer.
    angles: Option<HalfDiff>,
    /// Whether the views are to be reset.
    home: bool,
}

/// The views, in rows.
struct Grid<'a> {
    look: &'a Look,
    shown: &'a Shown,
    document: &'a Document,
    reset: bool,
}

impl Grid<'_> {
    fn ui(&self, ui: &mut Ui) -> Pointed {
        let views: Vec<usize> = (0..4).filter(|&i| self.shown.textures[i].is_some()).collect();
        let area = ui.available_size();
        let columns = columns(views.len(), area);
        let rows = views.len().div_ceil(columns);
        let share = |total: f32, parts: usize| {
            let parts = narrow(parts as f64);
            ((total - GAP * (parts - 1.0)) / parts).max(80.0)
        };
        let size = vec2(share(area.x, columns), share(area.y, rows));
        let mut pointed = Pointed::default();
        for row in views.chunks(columns) {
            ui.horizontal_top(|ui| {
                ui.spacing_mut().item_spacing.x = GAP;
                for &i in row {
                    let Some(texture) = &self.shown.textures[i] else { continue };
                    ui.allocate_ui(size, |ui| {
                        ui.set_min_size(size);
                        ui.set_max_size(size);
                        ui.vertical(|ui| self.view_ui(ui, i, texture, size, &mut pointed));
                    });
                }
            });
        }
        pointed
    }

    /// One view with its title.
    fn view_ui(&self, ui: &mut Ui, i: usize, texture: &TextureHandle, size: egui::Vec2, out: &mut Pointed) {
        // The topmost mark of an axis reaches half a line above it.
        ui.spacing_mut().item_spacing.y = 8.0;
        let side = (size.x - AXES.x).min(size.y - AXES.y - TITLE).max(40.0);
        ui.scope(|ui| {
            ui.set_max_width(side + AXES.x - 14.0);
            title_ui(ui, i, self.shown.limits[i], size.y > CAPTIONED);
        });
        let room = ui.available_size();
        let side = (room.x - AXES.x).min(room.y - AXES.y).max(40.0);
        let mut plot = slice_plot(i, side, self.look.slices.square_theta_h, ui.visuals());
        if self.reset {
            plot = plot.reset();
        }
        let response = plot.show(ui, |plot| {
            let image = PlotImage::new(TITLES[i], texture.id(), PlotPoint::new(45.0, 45.0), [90.0, 90.0]);
            plot.image(image.allow_hover(false));
            self.draw_samples(plot);
            self.draw_plan(plot);
            self.draw_regions(plot);
            navigate_plot(plot);
            plot.pointer_coordinate().filter(|_| plot.response().hovered())
        });
        focus_ui(ui, &response.response);
        let name = format!("{} slice", TITLES[i]);
        let info = || egui::WidgetInfo::labeled(egui::accesskit::Role::Image, true, &name);
        response.response.widget_info(info);
        out.home |= ViewKeys::of(ui.ctx(), &response.response).reset;
        out.angles = out.angles.or(response.inner.and_then(|at| self.angles(at)));
    }

    fn draw_samples(&self, plot: &mut PlotUi<'_>) {
        if !self.look.samples {
            return;
        }
        let phi_d = self.look.slices.phi_d.to_radians();
        let samples = sample_points(self.document, phi_d, |theta_h| self.place(theta_h));
        if !samples.is_empty() {
            let points = Points::new("samples", samples).radius(1.6).color(self.document.colour);
            plot.points(points.allow_hover(false));
        }
    }

    /// The planned directions with their ranks; those far from the slice are faint.
    fn draw_plan(&self, plot: &mut PlotUi<'_>) {
        let Some(plan) = self.document.plan().filter(|_| self.document.is_scattered() && self.look.plan)
        else {
            return;
        };
        let phi_d = folded(self.look.slices.phi_d.to_radians());
        for (rank, geometry) in plan.geometries.iter().enumerate() {
            let angles = geometry.angles();
            let is_near = (folded(angles.phi_d) - phi_d).abs() <= NEAR_SLICE;
            let colour = if is_near { PLANNED } else { PLANNED.gamma_multiply(0.35) };
            let at = [self.place(angles.theta_h.to_degrees()), angles.theta_d.to_degrees()];
            let ring = Points::new("planned", vec![at]).radius(4.0).filled(false).color(colour);
            plot.points(ring.allow_hover(false));
            if is_near {
                let text = RichText::new((rank + 1).to_string()).color(Color32::WHITE).size(10.0);
                let at = PlotPoint::new(at[0] + 1.2, at[1] + 1.2);
                plot.text(
                    egui_plot::Text::new("rank", at, text).anchor(Align2::LEFT_BOTTOM).allow_hover(false),
                );
            }
        }
    }

    fn draw_regions(&self, plot: &mut PlotUi<'_>) {
        if !self.look.regions {
            return;
        }
        for (name, theta_h, theta_d) in REGIONS {
            let shade = Color32::from_black_alpha(150);
            let text = RichText::new(name).color(Color32::WHITE).background_color(shade);
            let at = PlotPoint::new(self.place(theta_h), theta_d);
            let anchor = if theta_h < 20.0 { Align2::LEFT_CENTER } else { Align2::CENTER_CENTER };
            plot.text(egui_plot::Text::new(name, at, text).anchor(anchor).allow_hover(false));
        }
    }

    /// The place of `theta_h`, in degrees, on the axis.
    fn place(&self, theta_h: f64) -> f64 {
        if self.look.slices.square_theta_h { warped(theta_h) } else { theta_h }
    }

    /// The angles at a point of a view; `None` outside of the slice.
    fn angles(&self, at: PlotPoint) -> Option<HalfDiff> {
        let x = at.x / 90.0;
        let theta_h = if self.look.slices.square_theta_h { x * x.abs() } else { x } * FRAC_PI_2;
        let theta_d = at.y / 90.0 * FRAC_PI_2;
        let inside = (0.0..=FRAC_PI_2).contains(&theta_h) && (0.0..=FRAC_PI_2).contains(&theta_d);
        inside.then_some(HalfDiff { theta_h, theta_d, phi_d: self.look.slices.phi_d.to_radians() })
    }
}

/// The number of columns in which views are largest.
fn columns(views: usize, area: egui::Vec2) -> usize {
    let side = |columns: usize| {
        let rows = views.div_ceil(columns);
        let (columns, rows) = (narrow(columns as f64), narrow(rows as f64));
        (area.x / columns - AXES.x).min(area.y / rows - AXES.y - TITLE)
    };
    (1..=views.max(1)).max_by(|a, b| side(*a).total_cmp(&side(*b))).unwrap_or(1)
}

/// The empty plot of a view: `theta_h` to the right, `theta_d` up, both in degrees.
fn slice_plot(i: usize, side: f32, square: bool, visuals: &Visuals) -> Plot<'static> {
    let degrees =
        move |mark: GridMark| format!("{}°", short(if square { unwarped(mark.value) } else { mark.value }));
    let theta_h = AxisHints::new_x().formatter(move |mark, _| degrees(mark)).label(subscripted("θh"));
    let theta_d =
        AxisHints::new_y().formatter(|mark, _| format!("{}°", short(mark.value))).label(subscripted("θd"));
    let text = visuals.text_color();
    let (theta_h, theta_d) = (theta_h.tick_label_color(text), theta_d.tick_label_color(text));
    Plot::new(("slice", i))
        .link_axis(egui::Id::unique("slices"), true)
        .link_cursor(egui::Id::unique("slices"), true)
        .data_aspect(1.0)
        .width(side + AXES.x - 14.0)
        .height(side + AXES.y)
        .set_margin_fraction(vec2(0.0, 0.0))
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
        .custom_x_axes(vec![theta_h.label_spacing(egui::Rangef::new(22.0, 30.0))])
        .custom_y_axes(vec![theta_d.min_thickness(AXES.x - 36.0)])
}

/// The title of a view, with the scale of its false colours and with what its colours mean.
fn title_ui(ui: &mut Ui, i: usize, limit: Option<f64>, captioned: bool) {
    ui.spacing_mut().item_spacing.y = 1.0;
    ui.horizontal(|ui| {
        ui.label(RichText::new(TITLES[i]).strong()).on_hover_text(MEANINGS[i]);
        let Some(limit) = limit else { return };
        let (map, low, high) = if i == DIFFERENCE {
            (Colormap::Diverging, format!("-{}", short(limit)), format!("+{}", short(limit)))
        } else {
            (Colormap::Sequential, "0".to_owned(), short(limit))
        };
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            ui.label(RichText::new(high).small());
            scale_ui(ui, map);
            ui.label(RichText::new(low).small());
        });
    });
    if captioned {
        ui.add(egui::Label::new(RichText::new(MEANINGS[i]).small()).truncate());
    }
}

/// The place of degrees of `theta_h` on an axis with the warp of the table.
fn warped(degrees: f64) -> f64 {
    90.0 * (degrees / 90.0).max(0.0).sqrt()
}

/// Degrees of `theta_h` at a place of an axis with the warp of the table.
fn unwarped(place: f64) -> f64 {
    place * place.abs() / 90.0
}

/// Marks at round degrees: at every 5 or 30, and denser on the wider part of a warped axis.
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

/// The places of the samples that are near the slice.
fn sample_points(document: &Document, phi_d: f64, place: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
    let Some(fitted) = &document.fitted else { return Vec::new() };
    // Near means within half a step of `phi_d` of a lattice.
    let width = match fitted.samples.lattice() {
        Some(lattice) => 0.51 * FRAC_PI_2 / lattice.shape[2] as f64,
        None => 5f64.to_radians(),
    };
    let near = fitted.samples.angles.iter().filter(|a| (folded(a.phi_d) - folded(phi_d)).abs() <= width);
    near.take(6000).map(|a| [place(a.theta_h.to_degrees()), a.theta_d.to_degrees()]).collect()
}

/// The azimuth between 0 and 90 degrees that bilateral materials take for the same.
fn folded(phi: f64) -> f64 {
    if phi > FRAC_PI_2 { std::f64::consts::PI - phi } else { phi }
}

/// The values at a pair of directions, with their names.
fn hover_lines(document: &Document, angles: HalfDiff) -> Vec<(&'static str, String)> {
    let degrees = |x: f64| format!("{:.2}°", x.to_degrees());
    let mut lines =
        vec![("θh", degrees(angles.theta_h)), ("θd", degrees(angles.theta_d)), ("φd", degrees(angles.phi_d))];
    if !angles.is_above_horizon() {
        lines.push(("", "below the horizon".to_owned()));
        return lines;
    }
    let rgb = |v: [f64; 3]| v.map(short).join("  ");
    if let Some(truth) = document.truth_at(angles) {
        lines.push(("truth", rgb(truth)));
    }
    if let Some(fitted) = &document.fitted {
        let mean = fitted.mean.eval_half_diff(angles);
        lines.push(("mean", rgb(mean)));
        if let Some(sigma) = &fitted.sigma {
            let (low, high) = band_at(&fitted.model, mean, sigma, angles);
            lines.push(("95 % from", rgb(low)));
            lines.push(("95 % to", rgb(high)));
        }
    }
    lines
}

/// The values under the pointer.
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
                ui.label(subscripted(name));
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
    fn marks_of_a_warped_axis_are_at_round_degrees() {
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
