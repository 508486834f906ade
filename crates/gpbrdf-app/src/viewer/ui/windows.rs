//! Small windows: what to open, where to write, the shortcuts.

use std::path::PathBuf;

use eframe::egui::{self, Context, RichText, Ui};
use gpbrdf_core::materials;

use crate::viewer::app::Viewer;
use crate::viewer::ui::shortcuts::{MOUSE, SHORTCUTS};
use crate::viewer::work::dialogs::Purpose;

impl Viewer {
    pub(crate) fn open_window_ui(&mut self, ctx: &Context) {
        let mut open = self.windows.open;
        let mut chosen = None;
        egui::Window::new("Open materials")
            .open(&mut open)
            .collapsible(false)
            .vscroll(true)
            .default_width(420.0)
            .show(ctx, |ui| {
                ui.label("A MERL .binary, RGL .bsdf, samples CSV, OpenEXR table, model or session:");
                chosen = self.path_row_ui(ui, "Path to open", "Open", Purpose::Open);
                ui.add_space(6.0);
                ui.label(RichText::new("Built-in materials").strong());
                ui.horizontal_wrapped(|ui| {
                    for material in materials() {
                        if ui.button(material.title).on_hover_text(material.description).clicked() {
                            chosen = Some(PathBuf::from(material.name));
                        }
                    }
                });
            });
        self.windows.open = open && self.windows.open;
        if let Some(path) = chosen {
            self.chosen(Purpose::Open, &[path]);
        }
    }

    pub(crate) fn save_window_ui(&mut self, ctx: &Context) {
        let Some(purpose) = self.windows.save else { return };
        let (title, what) = match purpose {
            Purpose::SaveSession => ("Save session", "The open materials and how they are shown, as JSON."),
            Purpose::ExportSlices => {
                ("Export slices", "A PNG figure, and linear slices as EXR files beside it.")
            }
            Purpose::ExportSphere => {
                ("Export sphere", "A PNG figure, and linear pictures as EXR files beside it.")
            }
            Purpose::SaveModel => ("Save model", "The fitted model with its weights, as safetensors."),
            Purpose::Environment => ("Environment", "A latitude-longitude map, .hdr or .exr."),
            Purpose::Object => ("Object", "A Wavefront OBJ file."),
            Purpose::Open => return,
        };
        let mut open = true;
        let mut chosen = None;
        egui::Window::new(title).open(&mut open).collapsible(false).default_width(420.0).show(ctx, |ui| {
            ui.label(what);
            let verb =
                if matches!(purpose, Purpose::Environment | Purpose::Object) { "Load" } else { "Write" };
            chosen = self.path_row_ui(ui, "Path", verb, purpose);
        });
        if !open {
            self.windows.save = None;
        }
        if let Some(path) = chosen {
            self.chosen(purpose, &[path]);
        }
    }

    /// A path to type, or to choose in the system's dialog; the path once it is meant.
    fn path_row_ui(&mut self, ui: &mut Ui, label: &str, verb: &str, purpose: Purpose) -> Option<PathBuf> {
        let mut chosen = None;
        ui.horizontal(|ui| {
            let width = ui.available_width() - 150.0;
            let field = egui::TextEdit::singleline(&mut self.windows.path).desired_width(width);
            let field = ui.add(field).accessible_name(label);
            let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
            let given = !self.windows.path.trim().is_empty();
            if (ui.add_enabled(given, egui::Button::new(verb)).clicked() || entered) && given {
                chosen = Some(PathBuf::from(self.windows.path.trim()));
            }
            if ui.button("Browse…").on_hover_text("The system's file dialog").clicked() {
                self.browse(purpose);
            }
        });
        chosen
    }

    pub(crate) fn help_window_ui(&mut self, ctx: &Context) {
        // All of it where there is room.
        let height = 0.9 * ctx.content_rect().height();
        let window = egui::Window::new("Shortcuts").open(&mut self.windows.help);
        window.collapsible(false).vscroll(true).default_height(height).show(ctx, |ui| {
            egui::Grid::new("shortcuts").num_columns(2).spacing([24.0, 5.0]).striped(true).show(ui, |ui| {
                for (_, shortcut, what) in &SHORTCUTS {
                    ui.label(RichText::new(ctx.format_shortcut(shortcut)).strong());
                    ui.label(*what);
                    ui.end_row();
                }
                for (how, what) in MOUSE {
                    ui.label(RichText::new(how).strong());
                    ui.label(what);
                    ui.end_row();
                }
            });
        });
    }
}
