//! Where everything stands in the window.

use std::path::PathBuf;

use eframe::egui::{self, CentralPanel, Context, Frame, Panel, RichText, Ui};
use gpbrdf_core::materials;

use super::app::Viewer;
use super::dialogs::Purpose;
use super::settings::Arrangement;
use super::shortcuts::{self, Action, MOUSE, SHORTCUTS};

impl Viewer {
    /// The whole window.
    pub(crate) fn window_ui(&mut self, ui: &mut Ui) {
        if self.settings.panels {
            Panel::top("menu").show(ui, |ui| self.menu_ui(ui));
        }
        self.messages.messages_ui(ui);
        if self.settings.panels {
            Panel::bottom("status").show(ui, |ui| self.status_ui(ui));
            Panel::left("side").resizable(false).exact_size(320.0).show(ui, |ui| {
                egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    self.materials_ui(ui);
                    self.model_ui(ui);
                });
            });
        }
        let frame = Frame::central_panel(ui.style()).inner_margin(10);
        CentralPanel::default().frame(frame).show(ui, |ui| self.views_ui(ui));
        let ctx = ui.ctx().clone();
        self.open_window_ui(&ctx);
        self.save_window_ui(&ctx);
        self.help_window_ui(&ctx);
    }

    fn views_ui(&mut self, ui: &mut Ui) {
        if self.documents.is_empty() {
            ui.centered_and_justified(|ui| {
                let keys = shortcuts::text(ui.ctx(), Action::Open);
                ui.label(RichText::new(format!("Drop a material here, or open one with {keys}")).size(18.0));
            });
            return;
        }
        // Small windows and large text: views keep a size at which they can be read, and are scrolled to.
        let least = match self.settings.arrangement {
            Arrangement::All => egui::vec2(900.0, 620.0),
            Arrangement::Slices => egui::vec2(860.0, 380.0),
            Arrangement::Plots => egui::vec2(560.0, 300.0),
            Arrangement::Sphere => egui::vec2(480.0, 280.0),
        };
        let there = ui.available_size();
        if there.x >= least.x && there.y >= least.y {
            self.arranged_ui(ui);
            return;
        }
        // The wheel zooms what is under it.
        let area = egui::ScrollArea::both().scroll_source(egui::scroll_area::ScrollSource::SCROLL_BAR);
        area.auto_shrink(false).show(ui, |ui| {
            let (rect, _) =
                ui.allocate_exact_size(there.max(least) - egui::Vec2::splat(12.0), egui::Sense::hover());
            ui.scope_builder(egui::UiBuilder::new().max_rect(rect), |ui| self.arranged_ui(ui));
        });
    }

    fn arranged_ui(&mut self, ui: &mut Ui) {
        match self.settings.arrangement {
            Arrangement::Slices => self.slices_ui(ui),
            Arrangement::Plots => self.plots_ui(ui),
            Arrangement::Sphere => self.sphere_ui(ui),
            Arrangement::All => {
                let area = ui.available_rect_before_wrap();
                // Four slices in a row take what their width allows; the rest is the sphere's and the plots'.
                let gap = 14.0;
                let slices = (0.25 * area.width() + 36.0).min(area.height() * 0.46);
                let split = (area.height() - slices - gap).round();
                let sphere_width = (split * 0.92).min(area.width() * 0.42).round();
                let top = egui::Rect::from_min_size(area.min, egui::vec2(sphere_width, split));
                let right = egui::Rect::from_min_max(
                    egui::pos2(top.max.x + gap, area.min.y),
                    egui::pos2(area.max.x, top.max.y),
                );
                let below = egui::Rect::from_min_max(egui::pos2(area.min.x, top.max.y + gap), area.max);
                for (rect, name) in [(top, "sphere"), (right, "plots"), (below, "slices")] {
                    let builder = egui::UiBuilder::new().max_rect(rect).id_salt(name);
                    ui.scope_builder(builder, |ui| match name {
                        "sphere" => self.sphere_ui(ui),
                        "plots" => self.plots_ui(ui),
                        _ => self.slices_ui(ui),
                    });
                }
            }
        }
    }

    fn menu_ui(&mut self, ui: &mut Ui) {
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
                if ui.button("Quit").clicked() {
                    ctx.send_viewport_cmd(egui::ViewportCommand::Close);
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
                    self.reset_views = true;
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

    fn open_window_ui(&mut self, ctx: &Context) {
        let mut open = self.windows.open;
        let mut chosen = None;
        egui::Window::new("Open materials").open(&mut open).collapsible(false).default_width(420.0).show(
            ctx,
            |ui| {
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
            },
        );
        self.windows.open = open && self.windows.open;
        if let Some(path) = chosen {
            self.chosen(Purpose::Open, &[path]);
        }
    }

    fn save_window_ui(&mut self, ctx: &Context) {
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

    fn help_window_ui(&mut self, ctx: &Context) {
        egui::Window::new("Shortcuts").open(&mut self.windows.help).collapsible(false).show(ctx, |ui| {
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
