//! The messages, which float over the views and move nothing.

use std::time::Duration;

use eframe::egui::{self, Align2, Area, Context, Frame, Id, Label, Order, RichText, Ui, vec2};

use super::theme;
use crate::viewer::state::messages::{Kind, Message, Messages};

/// The part of the window's height that messages may take; more of them scroll.
const SHARE: f32 = 0.45;
/// The width of a message where there is room for it.
const WIDTH: f32 = 460.0;
/// Room for what is beside the text of a message.
const BESIDE: f32 = 150.0;
/// From the right and the lower edge of the window, above the status line.
const MARGIN: egui::Vec2 = vec2(-12.0, -36.0);
/// Seconds for which a success is shown.
const BRIEF: f64 = 8.0;

/// All messages, each with a button that dismisses it. Successes go by themselves.
pub(crate) fn messages_ui(ctx: &Context, messages: &mut Messages) {
    let now = ctx.input(|input| input.time);
    messages.expire(now, BRIEF);
    if messages.is_empty() {
        return;
    }
    if messages.iter().any(|message| message.kind == Kind::Success) {
        ctx.request_repaint_after(Duration::from_millis(500));
    }
    let room = ctx.content_rect().size();
    let width = WIDTH.min(room.x - 40.0);
    let mut read = None;
    let mut all = false;
    let area =
        Area::new(Id::unique("messages")).order(Order::Foreground).anchor(Align2::RIGHT_BOTTOM, MARGIN);
    area.show(ctx, |ui| {
        ui.set_width(width);
        if messages.iter().count() > 2 {
            ui.horizontal(|ui| {
                ui.add_space((width - 86.0).max(0.0));
                all = ui.button("Dismiss all").clicked();
            });
        }
        // An area offers only the height that it had in the last frame.
        let most = SHARE * room.y;
        let scroll = egui::ScrollArea::vertical().max_height(most).min_scrolled_height(most);
        scroll.auto_shrink([false, true]).show(ui, |ui| {
            for (i, message) in messages.iter().enumerate() {
                if message_ui(ui, message, width) {
                    read = Some(i);
                }
            }
        });
    });
    if all {
        messages.clear();
    } else if let Some(i) = read {
        messages.dismiss(i);
    }
}

/// One message of a width; whether it is dismissed.
fn message_ui(ui: &mut Ui, message: &Message, width: f32) -> bool {
    let (colour, mark) = match message.kind {
        Kind::Error => (theme::ERROR, "Error"),
        Kind::Note => (theme::NOTE, "Note"),
        Kind::Success => (theme::DONE, "Done"),
    };
    let white = egui::Color32::WHITE;
    let mut dismissed = false;
    let frame = Frame::new().fill(colour).corner_radius(4).inner_margin(6).outer_margin(2);
    frame.show(ui, |ui| {
        ui.horizontal_top(|ui| {
            ui.label(RichText::new(mark).strong().color(white));
            ui.vertical(|ui| {
                ui.set_width((width - BESIDE).max(80.0));
                ui.add(Label::new(RichText::new(&message.text).color(white)).wrap());
            });
            dismissed = ui.button("Dismiss").clicked();
        });
    });
    dismissed
}
