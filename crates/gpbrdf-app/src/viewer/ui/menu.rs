//! The menus and the choice of views.

use eframe::egui::{self, Button, Ui};
use gpbrdf_core::brdf::materials;

use super::pane::Command;
use super::shortcuts::{self, Action};
use crate::viewer::state::settings::Settings;

/// The bar at the top of the window.
pub(crate) struct Menu<'a> {
    pub(crate) settings: &'a mut Settings,
    /// All commands, of the program and of the panes.
    pub(crate) commands: &'a [(Action, Command)],
    /// Name and title of each view.
    pub(crate) views: &'a [(&'static str, &'static str)],
}

impl Menu<'_> {
    /// Draws the bar; what was chosen.
    pub(crate) fn ui(&mut self, ui: &mut Ui) -> Option<Action> {
        let mut chosen = None;
        egui::MenuBar::new().ui(ui, |ui| {
            ui.menu_button("File", |ui| self.file_ui(ui, &mut chosen));
            ui.menu_button("Materials", |ui| materials_ui(ui, &mut chosen));
            ui.menu_button("View", |ui| self.view_ui(ui, &mut chosen));
            ui.menu_button("Help", |ui| {
                self.item_ui(ui, "First steps", Action::Hint, &mut chosen);
                self.item_ui(ui, "Shortcuts", Action::Help, &mut chosen);
            });
            ui.add_space(12.0);
            self.views_ui(ui, &mut chosen);
        });
        chosen
    }

    /// An entry with its key.
    fn item_ui(&self, ui: &mut Ui, words: &str, action: Action, chosen: &mut Option<Action>) {
        let keys = shortcuts::text(ui.ctx(), self.commands, &action);
        let button = Button::new(words);
        let button = if keys.is_empty() { button } else { button.shortcut_text(keys) };
        if ui.add(button).clicked() {
            *chosen = Some(action);
            ui.close();
        }
    }

    fn file_ui(&self, ui: &mut Ui, chosen: &mut Option<Action>) {
        // The commands of the panes follow those of the program.
        let mut of_panes = false;
        for (action, command) in self.commands {
            let Some(words) = command.menu else { continue };
            if matches!(action, Action::Pane(..)) && !of_panes {
                of_panes = true;
                ui.separator();
            }
            self.item_ui(ui, words, action.clone(), chosen);
        }
        ui.separator();
        ui.menu_button("Recent", |ui| {
            if self.settings.recent.is_empty() {
                ui.weak("None yet");
            }
            for path in &self.settings.recent {
                if ui.button(path.display().to_string()).clicked() {
                    *chosen = Some(Action::Open(path.clone()));
                    ui.close();
                }
            }
        });
        self.item_ui(ui, "Quit", Action::Quit, chosen);
    }

    fn view_ui(&mut self, ui: &mut Ui, chosen: &mut Option<Action>) {
        for (name, dark) in [("Dark", Some(true)), ("Light", Some(false)), ("As the system", None)] {
            ui.radio_value(&mut self.settings.dark, dark, name);
        }
        ui.separator();
        for (name, zoom) in [("100 %", 1.0), ("125 %", 1.25), ("150 %", 1.5), ("200 %", 2.0)] {
            if ui.radio((ui.ctx().zoom_factor() - zoom).abs() < 0.01, name).clicked() {
                ui.ctx().set_zoom_factor(zoom);
            }
        }
        ui.separator();
        self.item_ui(ui, "Hide panels", Action::TogglePanels, chosen);
        self.item_ui(ui, "Reset views", Action::ResetViews, chosen);
    }

    /// The overview and each view, of which one is shown.
    fn views_ui(&self, ui: &mut Ui, chosen: &mut Option<Action>) {
        let views = self.views.iter().map(|&(name, title)| (Some(name), title, Action::View(name)));
        let shown = self.settings.view.as_deref();
        // The overview is shown if no view has this name.
        let shown = shown.filter(|shown| self.views.iter().any(|(name, _)| name == shown));
        for (name, title, action) in std::iter::once((None, "Overview", Action::Overview)).chain(views) {
            let keys = shortcuts::text(ui.ctx(), self.commands, &action);
            let help = format!("Show it ({keys})");
            if ui.selectable_label(shown == name, title).on_hover_text(help).clicked() {
                *chosen = Some(action);
            }
        }
    }
}

fn materials_ui(ui: &mut Ui, chosen: &mut Option<Action>) {
    for material in materials() {
        if ui.button(material.title).on_hover_text(material.description).clicked() {
            *chosen = Some(Action::OpenBuiltIn(material.name));
            ui.close();
        }
    }
}
