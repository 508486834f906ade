//! The messages above the views.

use eframe::egui::{self, Color32, Frame, Label, Layout, RichText, Ui};

use crate::viewer::state::messages::{Message, Messages};

/// The part of the window's height that messages may take; more of them scroll.
const SHARE: f32 = 0.3;

/// All messages, each with a button that dismisses it.
pub(crate) fn messages_ui(ui: &mut Ui, messages: &mut Messages) {
    if messages.is_empty() {
        return;
    }
    let mut read = None;
    let most = SHARE * ui.available_height();
    egui::Panel::top("messages").show_separator_line(false).show(ui, |ui| {
        egui::ScrollArea::vertical().max_height(most).auto_shrink([false, true]).show(ui, |ui| {
            for (i, message) in messages.iter().enumerate() {
                if message_ui(ui, message) {
                    read = Some(i);
                }
            }
        });
    });
    if let Some(i) = read {
        messages.dismiss(i);
    }
}

/// One message; whether it is dismissed.
fn message_ui(ui: &mut Ui, message: &Message) -> bool {
    let (colour, mark) = if message.is_error {
        (Color32::from_rgb(0xC8, 0x3C, 0x2E), "Error")
    } else {
        (Color32::from_rgb(0x2E, 0x7D, 0x52), "Done")
    };
    let mut dismissed = false;
    let frame = Frame::new().fill(colour).corner_radius(4).inner_margin(6).outer_margin(2);
    frame.show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.label(RichText::new(mark).strong().color(Color32::WHITE));
            ui.with_layout(Layout::right_to_left(egui::Align::Center), |ui| {
                dismissed = ui.button("Dismiss").clicked();
                ui.with_layout(Layout::left_to_right(egui::Align::Center), |ui| {
                    ui.add(Label::new(RichText::new(&message.text).color(Color32::WHITE)).wrap());
                });
            });
        });
    });
    dismissed
}
