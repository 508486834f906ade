//! Three lines for whoever opens the program for the first time.

use eframe::egui::{Align2, Area, Context, Frame, Id, Order, RichText, Ui, vec2};

/// What the lines say: what is seen, what to do with it, and where all else is.
const LINES: [&str; 3] = [
    "You see a measured material, what the model makes of few of its samples, and where it is unsure.",
    "Drop your own file of measurements on the window, or open one with Ctrl+O; every slider refits at once.",
    "Drag turns, the wheel zooms, the pointer reads values; 1 to 6 choose a view, H shows all keys.",
];

/// Draws the hint over the views; whether it has been read.
pub(crate) fn hint_ui(ctx: &Context) -> bool {
    let mut read = false;
    let room = ctx.content_rect().width() - 60.0;
    let area = Area::new(Id::unique("hint")).order(Order::Foreground);
    area.anchor(Align2::LEFT_BOTTOM, vec2(12.0, -36.0)).show(ctx, |ui: &mut Ui| {
        Frame::popup(ui.style()).inner_margin(10).show(ui, |ui| {
            ui.set_max_width(room.min(620.0));
            for line in LINES {
                ui.label(RichText::new(line).color(ui.visuals().strong_text_color()));
            }
            read = ui.button("Got it").on_hover_text("Help, First steps shows it again").clicked();
        });
    });
    read
}
