//! The model of the selected material: where to measure, what to fit, hyper-parameters set by hand, metrics.

use std::path::PathBuf;
use std::sync::mpsc::Receiver;

use eframe::egui::{self, Context, Key, KeyboardShortcut, Modifiers, RichText, Ui};
use gpbrdf_core::judge::{LeftOut, Outlier};
use gpbrdf_core::{LatticeLayout, MeanFunction, Progress, Shape, Symmetry};

use crate::job::{
    Kernels, LayoutChoice, ModelSpec, NoiseChoice, PriorName, SymmetryChoice, TransformChoice, bound_name,
    hyper_sliders, remaining,
};
use crate::viewer::state::document::{Document, Work};
use crate::viewer::ui::pane::{Command, Offers, Order, Pane, PaneContext, Place, Start};
use crate::viewer::ui::shortcuts::CANCEL;
use crate::viewer::ui::widgets::{Number, choice_ui, narrow, reset, row_ui, section_ui, short};
use crate::viewer::work::dialogs::{Access, Question};
use crate::viewer::work::export;
use crate::viewer::work::outbox::Outbox;

const OPTIMISE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::NONE, Key::O);

/// The largest numbers of samples on a lattice and of scattered samples.
const MAX_LATTICE: f64 = 200_000.0;
const MAX_SCATTERED: f64 = 20_000.0;

/// What is wanted of the work on a model.
enum Click {
    Optimise,
    Cancel,
    Retry,
}

/// Where the selected material is to be written.
#[derive(Debug)]
enum Message {
    Model(PathBuf),
    Table(PathBuf),
}

/// The pane of the model.
pub(crate) struct ModelPane {
    outbox: Outbox<Message>,
    inbox: Receiver<Message>,
}

impl ModelPane {
    pub(crate) fn new(start: &Start) -> Self {
        let (outbox, inbox) = start.channel();
        Self { outbox, inbox }
    }
}

impl Pane for ModelPane {
    fn name(&self) -> &'static str {
        "model"
    }

    fn title(&self) -> &'static str {
        "Model"
    }

    fn place(&self) -> Place {
        Place::Side
    }

    fn commands(&mut self, offers: &mut Offers, cx: &mut PaneContext) {
        if offers.offer(Command::key(OPTIMISE, "Optimise the hyper-parameters"))
            && let Some(document) = cx.documents.selected_mut()
        {
            document.optimise();
        }
        if offers.offer(Command::menu("Save model…")) {
            cx.order(Order::Ask(Question {
                title: "Save model",
                help: "The fitted model with its weights, as safetensors.",
                access: Access::Write { name: "model.safetensors" },
                answer: self.outbox.map(Message::Model),
            }));
        }
        if offers.offer(Command::menu("Export table…")) {
            cx.order(Order::Ask(Question {
                title: "Export table",
                help: "The prediction, as the name says: .binary (MERL), .exr, .bsdf (RGL), .csv (samples), or \
                       .dds, .ktx2, .npy or .bin (texture).",
                access: Access::Write { name: "table.binary" },
                answer: self.outbox.map(Message::Table),
            }));
        }
    }

    fn receive(&mut self, _ctx: &Context, cx: &mut PaneContext) {
        while let Ok(message) = self.inbox.try_recv() {
            let Some(document) = cx.documents.selected() else { continue };
            match message {
                Message::Model(path) => export::model(document, &path, &cx.saved),
                Message::Table(path) => export::table(document, &path, &cx.saved),
            }
        }
    }

    fn ui(&mut self, ui: &mut Ui, cx: &mut PaneContext) {
        let Some(document) = cx.documents.selected_mut() else { return };
        section_ui(ui, "Measurements");
        measurements_ui(ui, document);
        if !document.is_model() {
            section_ui(ui, "Gaussian process");
            let before = document.spec.clone();
            process_ui(ui, document);
            if document.spec != before {
                // Hyper-parameters of another kernel or of other targets would mean nothing.
                document.spec.hyper = None;
            }
            section_ui(ui, "Hyper-parameters");
            hyper_ui(ui, document);
        }
        ui.add_space(4.0);
        let click = work_ui(ui, document);
        section_ui(ui, "Result");
        metrics_ui(ui, document);
        match click {
            Some(Click::Optimise) => document.optimise(),
            Some(Click::Retry) => document.retry(),
            Some(Click::Cancel) => {
                let id = document.id;
                cx.order(Order::Cancel(id));
            }
            None => {}
        }
    }
}

/// What is measured, and where.
fn measurements_ui(ui: &mut Ui, document: &mut Document) {
    if document.is_model() {
        ui.label("A fitted model from a file.");
        if let Some(fitted) = &document.fitted {
            ui.label(format!("{}: {} numbers.", fitted.model.solver_label(), fitted.model.n_floats()));
        }
    } else if document.is_scattered() {
        ui.label("Scattered measurements: all of them are used.");
    } else {
        layout_ui(ui, &mut document.spec);
    }
}

fn layout_ui(ui: &mut Ui, spec: &mut ModelSpec) {
    let help = "Where to measure: a lattice in the warped box, or scattered directions, solved densely";
    let before = spec.layout;
    choice_ui(ui, "Layout", &mut spec.layout, &LayoutChoice::ALL, LayoutChoice::label);
    if (before == LayoutChoice::Lattice) != (spec.layout == LayoutChoice::Lattice) {
        spec.hyper = None;
    }
    if spec.layout == LayoutChoice::Lattice {
        let mut count = spec.count() as f64;
        let mut number = Number::new("Samples", 64.0..=MAX_LATTICE, 36_864.0, help);
        (number.logarithmic, number.whole) = (true, true);
        if number.row_ui(ui, &mut count)
            && let Ok(lattice) = LatticeLayout::with_samples(whole(count), Symmetry::Bilateral)
        {
            spec.lattice = Some(lattice.shape);
        }
        row_ui(ui, "Lattice", |ui| {
            let defaults = LatticeLayout::default().shape;
            let mut shape = spec.shape();
            for ((side, default), name) in shape.iter_mut().zip(defaults).zip(["θh", "θd", "φd"]) {
                let value = egui::DragValue::new(side).range(2..=160).speed(0.1);
                let help = format!("Nodes along {name}\nCtrl+click: back to {default}");
                let response =
                    ui.add(value).accessible_name(format!("Nodes along {name}")).on_hover_text(help);
                if reset(ui, &response) {
                    *side = default;
                }
            }
            spec.lattice = Some(shape);
        });
        choice_ui(ui, "Symmetry", &mut spec.symmetry, &SymmetryChoice::ALL, SymmetryChoice::label);
    } else {
        let mut count = spec.count() as f64;
        let mut number = Number::new("Samples", 20.0..=MAX_SCATTERED, 800.0, help);
        (number.logarithmic, number.whole) = (true, true);
        if number.row_ui(ui, &mut count) {
            spec.samples = Some(whole(count));
        }
        let seed = row_ui(ui, "Seed", |ui| ui.add(egui::DragValue::new(&mut spec.seed)));
        if reset(ui, &seed.on_hover_text("Of the random directions\nCtrl+click: back to 0")) {
            spec.seed = 0;
        }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the range of a slider")]
fn whole(x: f64) -> usize {
    x.round().max(0.0) as usize
}

fn process_ui(ui: &mut Ui, document: &mut Document) {
    let scattered = document.is_scattered();
    let spec = &mut document.spec;
    let names = ["Kernel θh", "Kernel θd", "Kernel φd"];
    let choose = |ui: &mut Ui, kernel: &Kernels, name: &str, axis: usize| {
        // A kernel that a session brought and no list offers stays until another is chosen.
        let mut shape = kernel.choice(axis).unwrap_or(Kernels::CHOICES[0]);
        choice_ui(ui, name, &mut shape, &Kernels::CHOICES, Shape::label).then_some(shape)
    };
    if spec.layout == LayoutChoice::Lattice && !scattered {
        for (axis, name) in names.into_iter().enumerate() {
            if let Some(shape) = choose(ui, &spec.kernel, name, axis) {
                spec.kernel.set(axis, shape);
            }
        }
    } else if let Some(shape) = choose(ui, &spec.kernel, "Kernel", 0) {
        spec.kernel.set_all(shape);
    }
    choice_ui(ui, "Target", &mut spec.transform, &TransformChoice::ALL, TransformChoice::label);
    if spec.transform == TransformChoice::Log {
        let mut number =
            Number::new("ε (1/sr)", 1e-6..=1.0, 1e-3, "Keeps dark values apart from zero in ln(f + ε)");
        number.logarithmic = true;
        number.row_ui(ui, &mut spec.epsilon);
    }
    let means = [MeanFunction::Constant, MeanFunction::Zero];
    let mean_name = |m| if m == MeanFunction::Zero { "Zero" } else { "Average of the samples" };
    choice_ui(ui, "Prior mean", &mut spec.mean, &means, mean_name);
    let mut learned = spec.prior != PriorName::None;
    row_ui(ui, "Other materials", |ui| {
        let help = "Use what other materials have in common, where samples are few or lie in one plane";
        ui.checkbox(&mut learned, "Prior").on_hover_text(help);
    });
    if learned != (spec.prior != PriorName::None) {
        spec.prior = if learned { PriorName::BuiltIn } else { PriorName::None };
    }
    let mut fixed = spec.noise.0.is_some();
    row_ui(ui, "Noise", |ui| {
        ui.checkbox(&mut fixed, "Fixed").on_hover_text("Hold the noise variance while optimising");
    });
    if fixed != spec.noise.0.is_some() {
        spec.noise = NoiseChoice(fixed.then_some(1e-6));
    }
    if let Some(noise) = &mut spec.noise.0 {
        let mut number =
            Number::new("Fixed noise", 1e-12..=1.0, 1e-6, "Noise variance in squared target units");
        number.logarithmic = true;
        number.row_ui(ui, noise);
    }
}

fn hyper_ui(ui: &mut Ui, document: &mut Document) {
    let current = document.fitted.as_ref().and_then(|fitted| fitted.model.hyper());
    let Some(hyper) = document.spec.hyper.clone().or(current) else {
        ui.weak("Found by the first fit");
        return;
    };
    let defaults = document.optimum.as_ref().map(hyper_sliders).unwrap_or_default();
    for (index, parameter) in hyper_sliders(&hyper).into_iter().enumerate() {
        let default = defaults.get(index).map_or(parameter.value, |d| d.value);
        let (low, high) = parameter.range;
        let help = format!("{}\nSet by hand; the search found the default", parameter.help);
        let mut number = Number::new(&parameter.name, low..=high, default, &help);
        number.logarithmic = true;
        let mut value = parameter.value;
        if number.row_ui(ui, &mut value) {
            let mut changed = hyper.clone();
            if changed.set(index, value).is_ok() {
                document.spec.hyper = Some(changed);
            }
        }
    }
}

/// What is being done, and the buttons that start and stop it.
fn work_ui(ui: &mut Ui, document: &Document) -> Option<Click> {
    let mut click = None;
    ui.horizontal(|ui| {
        let keys = |key| ui.ctx().format_shortcut(&key);
        let (optimise, cancel) = (keys(OPTIMISE), keys(CANCEL));
        let button = egui::Button::new(RichText::new("Optimise").strong());
        let help = format!("Find the hyper-parameters by maximum marginal likelihood ({optimise})");
        if ui.add_enabled(!document.is_model(), button).on_hover_text(help).clicked() {
            click = Some(Click::Optimise);
        }
        let button = egui::Button::new("Cancel");
        if ui
            .add_enabled(document.is_busy(), button)
            .on_hover_text(format!("Stop the work ({cancel})"))
            .clicked()
        {
            click = Some(Click::Cancel);
        }
        match &document.work {
            Work::Running { .. } | Work::Waiting => {
                ui.spinner();
            }
            Work::Failed(_) | Work::Cancelled => {
                let help = "Fit the model that is wanted now, from the start";
                if ui.button("Try again").on_hover_text(help).clicked() {
                    click = Some(Click::Retry);
                }
            }
            Work::Idle => {
                let mode = if document.spec.hyper.is_some() { "By hand" } else { "Optimised" };
                ui.weak(mode);
            }
        }
    });
    if let Some(text) = document.work.text() {
        let failed = matches!(document.work, Work::Failed(_));
        let colour = if failed { ui.visuals().error_fg_color } else { ui.visuals().text_color() };
        ui.colored_label(colour, text);
    }
    // What is over at once needs no bar.
    if let Work::Running { begun, progress: Progress { share: Some(share), .. }, .. } = document.work
        && remaining(begun.elapsed(), share).is_some()
    {
        ui.add(egui::ProgressBar::new(narrow(share)).desired_height(6.0));
    }
    click
}

/// What a fit says about its own samples. `line` shows a name, a value and an explanation.
fn left_out_ui(line: &dyn Fn(&mut Ui, &str, String, &str), ui: &mut Ui, left_out: &LeftOut) {
    let m = &left_out.metrics;
    line(
        ui,
        "Left out",
        format!("{} %, {:.1} % covered", short(100.0 * m.median_abs_log), 100.0 * m.coverage_95),
        "Every sample as it is predicted from all others: median of |ln(prediction + 0.001) - ln(value + 0.001)|, \
         and the share of the samples in their 95 % interval",
    );
    let outliers = &left_out.outliers;
    if outliers.is_empty() {
        return;
    }
    let mut places: Vec<String> = outliers.iter().take(LISTED).map(Outlier::place).collect();
    if outliers.len() > LISTED {
        places.push(format!("and {} more", outliers.len() - LISTED));
    }
    let help = format!("Suspected outliers, which were given a larger noise: {}", places.join(", "));
    line(ui, "Outliers", outliers.len().to_string(), &help);
}

/// The largest number of outliers that are named.
const LISTED: usize = 20;

fn metrics_ui(ui: &mut Ui, document: &Document) {
    let Some(fitted) = &document.fitted else {
        ui.weak("None yet");
        return;
    };
    let line = |ui: &mut Ui, name: &str, value: String, help: &str| {
        row_ui(ui, name, |ui| {
            let spoken = format!("{name}: {value}");
            ui.label(RichText::new(value).strong()).on_hover_text(help).accessible_name(spoken);
        });
    };
    let dots = || "…".to_owned();
    line(
        ui,
        "Log likelihood",
        fitted.log_marginal_likelihood.map_or("–".into(), |value| format!("{value:.1}")),
        "Log marginal likelihood of the samples, all channels together",
    );
    if let Some(report) = &fitted.report {
        let state = if report.converged { "converged" } else { "not converged" };
        line(
            ui,
            "Search",
            format!("{} evaluations, {state}", report.evaluations),
            "Evaluations of the likelihood",
        );
        if !report.at_bound.is_empty() {
            let names: Vec<String> = report.at_bound.iter().map(|name| bound_name(name)).collect();
            line(ui, "At a bound", names.join(", "), "Hyper-parameters at the end of their range");
        }
    }
    if let Some(left_out) = &fitted.left_out {
        left_out_ui(&line, ui, left_out);
    }
    if let Some(plan) = document.plan().filter(|_| document.is_scattered()) {
        let expected =
            plan.errors.first().map_or("–".into(), |error| format!("{} %", short(100.0 * error)));
        let help =
            "Root mean square of the error of ln f over the hemisphere that the process itself expects";
        line(ui, "Expected error", expected, help);
    }
    if document.source_is_truth() {
        let images = fitted.images.as_ref();
        let (psnr, ssim) = (images.map(|i| i.psnr_env), images.map(|i| i.ssim_env));
        line(
            ui,
            "Sphere PSNR",
            psnr.map_or_else(dots, |x| format!("{} dB", short(x))),
            "Pictures of a sphere under the built-in studio, as gpbrdf-cli reports it",
        );
        line(ui, "Sphere SSIM", ssim.map_or_else(dots, |x| format!("{x:.5}")), "Structural similarity");
        let cells = fitted.cells.as_ref();
        let show = |f: &dyn Fn(&gpbrdf_core::judge::CellMetrics) -> String| cells.map_or_else(dots, f);
        line(
            ui,
            "Median error",
            show(&|c| format!("{} %", short(100.0 * c.median_abs_log))),
            "Median of |ln(prediction + 0.001) - ln(truth + 0.001)|",
        );
        line(ui, "MAE", show(&|c| format!("{} /sr", short(c.mae))), "Mean absolute error of all valid cells");
        line(ui, "MSE", show(&|c| format!("{} /sr²", short(c.mse))), "Mean squared error of all valid cells");
        line(
            ui,
            "95 % covers",
            show(&|c| c.coverage_95.map_or("–".into(), |x| format!("{:.1} %", 100.0 * x))),
            "Share of cells whose truth lies within the 95 % interval",
        );
    }
    let [sample, fit, bake] = fitted.seconds.map(|s| 1e3 * s);
    line(ui, "Time", format!("{sample:.0} + {fit:.0} + {bake:.0} ms"), "Sampling, fitting, baking the mean");
}
