//! The line at the foot of the window.

use std::time::Duration;

use eframe::egui::{Label, RichText, Ui};

use super::widgets::short;
use crate::viewer::state::document::{Document, Fitted, Work};
use crate::viewer::state::documents::Documents;

/// The width that the time of the last frame takes. It is left out rather than put on a second line.
const FRAME_ROOM: f32 = 110.0;

/// The selected material, the size and the time of its fit, what is being done, how far the others are, and the time of
/// the last frame.
pub(crate) fn status_ui(ui: &mut Ui, documents: &Documents, frame: Duration) {
    ui.horizontal_wrapped(|ui| {
        if let Some(document) = documents.selected() {
            ui.label(RichText::new(&document.name).strong());
            if let Some(fitted) = &document.fitted {
                ui.separator();
                fit_ui(ui, fitted);
            }
            if let Some(text) = document.work.text() {
                ui.separator();
                ui.add(Label::new(text).truncate());
            }
        } else {
            ui.label("Nothing is open");
        }
        others_ui(ui, documents);
        if ui.available_size_before_wrap().x < FRAME_ROOM {
            return;
        }
        ui.separator();
        let text = format!("UI {:.1} ms", 1e3 * frame.as_secs_f64());
        ui.weak(text).on_hover_text("The time that the window itself took for the last frame");
    });
}

/// How many materials are fitted, where there are several and not all of them are.
fn others_ui(ui: &mut Ui, documents: &Documents) {
    let count = documents.iter().count();
    let is_done = |d: &&Document| d.work == Work::Idle && d.fitted.is_some();
    let done = documents.iter().filter(is_done).count();
    if count < 2 || done == count {
        return;
    }
    ui.separator();
    let mut text = format!("{done} of {count} fitted");
    let selected = documents.selected_id();
    let others = documents.iter().filter(|d| selected != Some(d.id));
    let mut running = others.filter(|d| matches!(d.work, Work::Running { .. }));
    if let Some((other, work)) = running.next().and_then(|d| Some((d, d.work.text()?))) {
        text.push_str(&format!("; {}: {work}", other.name));
    }
    ui.label(text);
}

fn fit_ui(ui: &mut Ui, fitted: &Fitted) {
    let n = fitted.model.n_samples();
    let share = 100.0 * n as f64 / gpbrdf_core::brdf::N_CELLS as f64;
    let share = gpbrdf_core::base::number::short(share, 3);
    ui.label(format!("{n} samples ({share} % of a table)"));
    ui.separator();
    let total = 1e3 * fitted.seconds.iter().sum::<f64>();
    ui.label(format!("refitted and baked in {total:.0} ms"));
    ui.separator();
    // Of three channels the largest, as for sigma.
    let noise = fitted.model.noise_variances().into_iter().fold(0.0, f64::max);
    ui.label(format!("noise σ {}", short(noise.sqrt())));
}
