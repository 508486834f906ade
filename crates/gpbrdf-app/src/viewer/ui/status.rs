//! The line at the foot of the window.

use std::time::Duration;

use eframe::egui::{RichText, Ui};

use super::widgets::short;
use crate::viewer::state::document::{Fitted, Work};
use crate::viewer::state::documents::Documents;

/// The selected material, the size and the time of its fit, and the time of the last frame.
pub(crate) fn status_ui(ui: &mut Ui, documents: &Documents, frame: Duration) {
    ui.horizontal_wrapped(|ui| {
        if let Some(document) = documents.selected() {
            ui.label(RichText::new(&document.name).strong());
            ui.separator();
            if let Some(fitted) = &document.fitted {
                fit_ui(ui, fitted);
            }
            if let Work::Running { stage, .. } = &document.work {
                ui.separator();
                ui.label(stage.label());
            }
        } else {
            ui.label("Nothing is open");
        }
        ui.separator();
        let text = format!("UI {:.1} ms", 1e3 * frame.as_secs_f64());
        ui.weak(text).on_hover_text("The time that the window itself took for the last frame");
    });
}

fn fit_ui(ui: &mut Ui, fitted: &Fitted) {
    let n = fitted.model.n_samples();
    let share = 100.0 * n as f64 / gpbrdf_core::brdf::N_CELLS as f64;
    ui.label(format!("{n} samples ({} % of a table)", short((100.0 * share).round() / 100.0)));
    ui.separator();
    let total = 1e3 * fitted.seconds.iter().sum::<f64>();
    ui.label(format!("refitted and baked in {total:.0} ms"));
    ui.separator();
    // Of three channels the largest, as for sigma.
    let noise = fitted.model.noise_variances().into_iter().fold(0.0, f64::max);
    ui.label(format!("noise σ {}", short(noise.sqrt())));
}
