//! What the user has to read: messages stay until they are dismissed.

use std::path::Path;

use eframe::egui::{self, Color32, Frame, RichText, Ui};

/// What is wrong with a file, with its name.
pub(crate) fn naming(path: &Path, error: &dyn std::fmt::Display) -> String {
    let (text, name) = (error.to_string(), path.display().to_string());
    if text.contains(&name) { text } else { format!("\"{name}\": {text}") }
}

/// Messages, the oldest first.
#[derive(Debug, Default)]
pub(crate) struct Messages {
    list: Vec<(bool, String)>,
}

/// Of more notes than this, the oldest go.
const NOTES: usize = 3;
/// Share of the window that messages may take; more of them scroll.
const SHARE: f32 = 0.3;

impl Messages {
    /// Says what went wrong.
    pub(crate) fn error(&mut self, message: impl Into<String>) {
        self.push(true, message.into());
    }

    /// Says what has been done.
    pub(crate) fn note(&mut self, message: impl Into<String>) {
        self.push(false, message.into());
    }

    fn push(&mut self, error: bool, message: String) {
        if !self.list.iter().any(|(_, known)| *known == message) {
            self.list.push((error, message));
        }
        // Notes make room for newer ones; errors stay until they are read.
        let notes = self.list.iter().filter(|(error, _)| !error).count();
        if notes > NOTES
            && let Some(oldest) = self.list.iter().position(|(error, _)| !error)
        {
            self.list.remove(oldest);
        }
    }

    /// The messages, each with a button that dismisses it.
    pub(crate) fn messages_ui(&mut self, ui: &mut Ui) {
        if self.list.is_empty() {
            return;
        }
        let mut read = None;
        let most = SHARE * ui.available_height();
        egui::Panel::top("messages").show_separator_line(false).show(ui, |ui| {
            egui::ScrollArea::vertical().max_height(most).auto_shrink([false, true]).show(ui, |ui| {
                for (i, (error, message)) in self.list.iter().enumerate() {
                    let (colour, mark) = if *error {
                        (Color32::from_rgb(0xC8, 0x3C, 0x2E), "Error")
                    } else {
                        (Color32::from_rgb(0x2E, 0x7D, 0x52), "Done")
                    };
                    Frame::new().fill(colour).corner_radius(4).inner_margin(6).outer_margin(2).show(
                        ui,
                        |ui| {
                            ui.horizontal(|ui| {
                                ui.label(RichText::new(mark).strong().color(Color32::WHITE));
                                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                                    if ui.button("Dismiss").clicked() {
                                        read = Some(i);
                                    }
                                    ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                                        ui.add(
                                            egui::Label::new(RichText::new(message).color(Color32::WHITE))
                                                .wrap(),
                                        );
                                    });
                                });
                            });
                        },
                    );
                }
            });
        });
        if let Some(i) = read {
            self.list.remove(i);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_stay_and_notes_make_room() {
        let mut messages = Messages::default();
        for i in 0..20 {
            messages.error(format!("error {i}"));
            messages.note(format!("note {i}"));
        }
        messages.error("error 3");
        let count = |error: bool| messages.list.iter().filter(|m| m.0 == error).count();
        assert_eq!((count(true), count(false)), (20, NOTES));
        assert_eq!(messages.list[0].1, "error 0");
        assert!(messages.list.iter().any(|m| m.1 == "note 19"));
    }
}
