//! The list of open materials.

use eframe::egui::{self, Color32, RichText, Ui};

use crate::viewer::state::document::{Document, DocumentId, Work};
use crate::viewer::ui::pane::{Order, Pane, PaneContext, Place};
use crate::viewer::ui::shortcuts::OPEN;
use crate::viewer::ui::widgets::section_ui;

/// What was clicked in the list.
enum Click {
    Select(DocumentId),
    Solo(DocumentId),
    Remove(DocumentId),
}

/// The pane of materials.
pub(crate) struct Materials;

impl Pane for Materials {
    fn name(&self) -> &'static str {
        "materials"
    }

    fn title(&self) -> &'static str {
        "Materials"
    }

    fn place(&self) -> Place {
        Place::Side
    }

    /// Visibility, colour, name, solo and removal of each material.
    fn ui(&mut self, ui: &mut Ui, cx: &mut PaneContext) {
        ui.horizontal(|ui| {
            section_ui(ui, self.title());
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let help = format!("Files and built-in materials ({})", ui.ctx().format_shortcut(&OPEN));
                if ui.button("Open…").on_hover_text(help).clicked() {
                    cx.order(Order::OpenWindow);
                }
            });
        });
        let mut click = None;
        let (selected, solo) = (cx.documents.selected_id(), cx.documents.solo());
        for document in cx.documents.iter_mut() {
            ui.push_id(document.id.0, |ui| {
                let found = row_ui(ui, document, selected == Some(document.id), solo);
                click = found.or(click.take());
            });
        }
        match click {
            Some(Click::Select(id)) => cx.documents.select(id),
            Some(Click::Solo(id)) => cx.documents.toggle_solo(id),
            Some(Click::Remove(id)) => cx.order(Order::Remove(id)),
            None => {}
        }
        if let Some(document) = cx.documents.selected() {
            ui.add_space(2.0);
            ui.label(RichText::new(&document.source.description).small());
        }
    }
}

/// One material.
fn row_ui(ui: &mut Ui, document: &mut Document, selected: bool, solo: Option<DocumentId>) -> Option<Click> {
    let mut click = None;
    let fill =
        if selected { ui.visuals().selection.bg_fill.gamma_multiply(0.45) } else { Color32::TRANSPARENT };
    egui::Frame::new().fill(fill).corner_radius(4).inner_margin(4).show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 5.0;
            let name = document.name.clone();
            ui.checkbox(&mut document.visible, "")
                .accessible_name(format!("Show {name}"))
                .on_hover_text("Draw its curves in the plots");
            ui.color_edit_button_srgba(&mut document.colour).accessible_name(format!("Colour of {name}"));
            let width = ui.available_width() - 92.0;
            if selected {
                let field = egui::TextEdit::singleline(&mut document.name).desired_width(width - 8.0);
                ui.add(field).accessible_name("Name").on_hover_text("Type to rename");
            } else {
                let button = egui::Button::new(&name).frame(false).truncate();
                let layout = egui::Layout::left_to_right(egui::Align::Center);
                let size = egui::vec2(width, ui.spacing().interact_size.y);
                let shown = ui.allocate_ui_with_layout(size, layout, |ui| ui.add(button));
                if shown.inner.clicked() {
                    click = Some(Click::Select(document.id));
                }
            }
            let alone = solo == Some(document.id);
            let solo = ui.selectable_label(alone, "Solo").accessible_name(format!("Solo {name}"));
            if solo.on_hover_text("Draw this one alone in the plots").clicked() {
                click = Some(Click::Solo(document.id));
            }
            let remove = ui.button("×").accessible_name(format!("Remove {name}"));
            if remove.on_hover_text("Close this material").clicked() {
                click = Some(Click::Remove(document.id));
            }
            match &document.work {
                Work::Waiting | Work::Running { .. } => {
                    let text = document.work.text().unwrap_or_default();
                    ui.add(egui::Spinner::new()).on_hover_text(text);
                }
                Work::Failed(message) => {
                    let mark = RichText::new("!").strong().color(ui.visuals().error_fg_color);
                    ui.label(mark).on_hover_text(message).accessible_name(format!("{name} has failed"));
                }
                Work::Cancelled => {
                    let help = "Cancelled; \"Try again\" below fits it";
                    ui.weak("–").on_hover_text(help).accessible_name(format!("{name} is cancelled"));
                }
                Work::Idle => {}
            }
        });
    });
    click
}
