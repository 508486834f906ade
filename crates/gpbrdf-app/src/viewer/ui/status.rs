//! The line at the foot of the window.

use eframe::egui::{RichText, Ui};

use crate::viewer::app::Viewer;
use crate::viewer::state::document::Work;
use crate::viewer::ui::widgets::short;

impl Viewer {
    /// What is open, how good it is, how long it took.
    pub(crate) fn status_ui(&mut self, ui: &mut Ui) {
        let frame = self.frames_text();
        ui.horizontal_wrapped(|ui| {
            if let Some(document) = self.document() {
                ui.label(RichText::new(&document.name).strong());
                ui.separator();
                if let Some(fitted) = &document.fitted {
                    let n = fitted.model.samples();
                    let share = 100.0 * n as f64 / gpbrdf_core::N_CELLS as f64;
                    ui.label(format!(
                        "{n} samples ({} % of a table)",
                        short((100.0 * share).round() / 100.0)
                    ));
                    ui.separator();
                    let total = 1e3 * fitted.seconds.iter().sum::<f64>();
                    ui.label(format!("refitted and baked in {total:.0} ms"));
                    ui.separator();
                    ui.label(format!("noise σ {}", short(fitted.model.noise_variances()[0].sqrt())));
                }
                if let Work::Running { stage, .. } = &document.work {
                    ui.separator();
                    ui.label(*stage);
                }
            } else {
                ui.label("Nothing is open");
            }
            ui.separator();
            ui.weak(frame).on_hover_text("The window's own work in the last frame");
        });
    }

    fn frames_text(&self) -> String {
        format!("UI {:.1} ms", 1e3 * self.frame_times().last.as_secs_f64())
    }
}
