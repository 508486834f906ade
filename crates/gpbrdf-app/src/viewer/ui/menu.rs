//! The menus and the choice of views.

use eframe::egui::{self, Ui};
use gpbrdf_core::materials;

use crate::viewer::app::Viewer;
use crate::viewer::state::settings::Arrangement;
use crate::viewer::ui::shortcuts::{self, Action};
use crate::viewer::work::dialogs::Purpose;

impl Viewer {
    pub(crate) fn menu_ui(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        let item = |ui: &mut Ui, text: &str, action: Action| {
            let keys = shortcuts::text(&ctx, action);
            ui.add(egui::Button::new(text).shortcut_text(keys)).clicked()
        };
        egui::MenuBar::new().ui(ui, |ui| {
            ui.menu_button("File", |ui| {
                for (text, action) in [
                    ("Open…", Action::Open),
                    ("Save session…", Action::SaveSession),
                    ("Screenshot", Action::Screenshot),
                ] {
                    if item(ui, text, action) {
                        self.act(&ctx, action);
                        ui.close();
                    }
                }
                ui.separator();
                for (text, purpose, name) in [
                    ("Export slices…", Purpose::ExportSlices, "slices.png"),
                    ("Export sphere…", Purpose::ExportSphere, "sphere.png"),
                    ("Save model…", Purpose::SaveModel, "model.safetensors"),
                ] {
                    if ui.button(text).clicked() {
                        self.ask_where(purpose, name);
                        ui.close();
                    }
                }
                ui.separator();
                ui.menu_button("Recent", |ui| {
                    if self.settings.recent.is_empty() {
                        ui.weak("None yet");
                    }
                    for path in self.settings.recent.clone() {
                        if ui.button(path.display().to_string()).clicked() {
                            self.open_paths(&[path]);
                            ui.close();
                        }
                    }
                });
                if item(ui, "Quit", Action::Quit) {
                    self.act(&ctx, Action::Quit);
                }
            });
            ui.menu_button("Materials", |ui| {
                for material in materials() {
                    if ui.button(material.title).on_hover_text(material.description).clicked() {
                        self.open_built_in(material.name, None);
                        ui.close();
                    }
                }
            });
            ui.menu_button("View", |ui| {
                let themes = [("Dark", Some(true)), ("Light", Some(false)), ("As the system", None)];
                for (name, dark) in themes {
                    ui.radio_value(&mut self.settings.dark, dark, name);
                }
                ui.separator();
                for (name, zoom) in [("100 %", 1.0), ("125 %", 1.25), ("150 %", 1.5), ("200 %", 2.0)] {
                    if ui.radio((ctx.zoom_factor() - zoom).abs() < 0.01, name).clicked() {
                        ctx.set_zoom_factor(zoom);
                    }
                }
                ui.separator();
                if item(ui, "Hide panels", Action::TogglePanels) {
                    self.act(&ctx, Action::TogglePanels);
                    ui.close();
                }
                if ui.button("Reset views").clicked() {
                    self.reset_next = true;
                    ui.close();
                }
            });
            ui.menu_button("Help", |ui| {
                if item(ui, "Shortcuts", Action::Help) {
                    self.act(&ctx, Action::Help);
                    ui.close();
                }
            });
            ui.add_space(12.0);
            let actions = [Action::Overview, Action::Slices, Action::Plots, Action::Sphere];
            for (view, action) in Arrangement::ALL.into_iter().zip(actions) {
                let shown = self.settings.arrangement == view;
                let help = format!("Show it ({})", shortcuts::text(&ctx, action));
                if ui.selectable_label(shown, view.name()).on_hover_text(help).clicked() {
                    self.settings.arrangement = view;
                }
            }
        });
    }
}
