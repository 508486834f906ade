//! The list of open materials.

use eframe::egui::{self, Color32, RichText, Ui};

use crate::viewer::app::Viewer;
use crate::viewer::state::document::{Document, DocumentId, Work};
use crate::viewer::ui::shortcuts::{self, Action};
use crate::viewer::ui::widgets::section_ui;

/// What the list asks for.
enum Wish {
    Select(DocumentId),
    Solo(DocumentId),
    Remove(DocumentId),
}

impl Viewer {
    /// The open materials: visibility, colour, name, solo, remove.
    pub(crate) fn materials_ui(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            section_ui(ui, "Materials");
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let keys = shortcuts::text(ui.ctx(), Action::Open);
                if ui
                    .button("Open…")
                    .on_hover_text(format!("Files and built-in materials ({keys})"))
                    .clicked()
                {
                    let ctx = ui.ctx().clone();
                    self.act(&ctx, Action::Open);
                }
            });
        });
        let mut wish = None;
        let (selected, solo) = (self.selected, self.solo);
        for document in &mut self.documents {
            ui.push_id(document.id.0, |ui| {
                let found = row_ui(ui, document, selected == Some(document.id), solo);
                wish = found.or(wish.take());
            });
        }
        match wish {
            Some(Wish::Select(id)) => self.selected = Some(id),
            Some(Wish::Solo(id)) => self.solo = if self.solo == Some(id) { None } else { Some(id) },
            Some(Wish::Remove(id)) => self.remove(id),
            None => {}
        }
        if let Some(document) = self.document() {
            ui.add_space(2.0);
            ui.label(RichText::new(&document.source.description).small());
        }
    }
}

fn row_ui(ui: &mut Ui, document: &mut Document, selected: bool, solo: Option<DocumentId>) -> Option<Wish> {
    let mut wish = None;
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
                let layout = egui::Layout::left_to_right(egui::Align::Center).with_main_justify(true);
                let size = egui::vec2(width, ui.spacing().interact_size.y);
                let shown = ui.allocate_ui_with_layout(size, layout, |ui| ui.add(button));
                if shown.inner.clicked() {
                    wish = Some(Wish::Select(document.id));
                }
            }
            let alone = solo == Some(document.id);
            let solo = ui.selectable_label(alone, "Solo").accessible_name(format!("Solo {name}"));
            if solo.on_hover_text("Draw this one alone in the plots").clicked() {
                wish = Some(Wish::Solo(document.id));
            }
            let remove = ui.button("×").accessible_name(format!("Remove {name}"));
            if remove.on_hover_text("Close this material").clicked() {
                wish = Some(Wish::Remove(document.id));
            }
            if matches!(document.work, Work::Running { .. } | Work::Waiting) {
                ui.spinner();
            }
        });
    });
    wish
}
