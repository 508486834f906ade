//! Labelled controls that look alike everywhere and go back to their defaults on Ctrl+click.

use std::ops::RangeInclusive;

use eframe::egui::containers::menu::{MenuButton, MenuConfig};
use eframe::egui::text::{LayoutJob, TextFormat};
use eframe::egui::{self, Align, Color32, ComboBox, FontId, Response, RichText, Slider, TextureHandle, Ui};
use gpbrdf_core::figure::Colormap;

use crate::viewer::work::slices::colour;

/// Width of the labels of a form.
const LABEL_WIDTH: f32 = 104.0;
/// Width of the number beside a slider.
const NUMBER_WIDTH: f32 = 86.0;

/// A number that can be set.
#[derive(Clone, Debug)]
pub(crate) struct Number<'a> {
    pub(crate) label: &'a str,
    pub(crate) range: RangeInclusive<f64>,
    pub(crate) default: f64,
    pub(crate) logarithmic: bool,
    pub(crate) whole: bool,
    pub(crate) suffix: &'a str,
    pub(crate) help: &'a str,
}

impl<'a> Number<'a> {
    pub(crate) fn new(label: &'a str, range: RangeInclusive<f64>, default: f64, help: &'a str) -> Self {
        Self { label, range, default, logarithmic: false, whole: false, suffix: "", help }
    }

    /// A row with label, slider and number; whether the value has changed.
    pub(crate) fn row_ui(self, ui: &mut Ui, value: &mut f64) -> bool {
        row_ui(ui, self.label, |ui| self.slider_ui(ui, value))
    }

    /// The slider alone, as wide as there is room; whether the value has changed.
    pub(crate) fn slider_ui(self, ui: &mut Ui, value: &mut f64) -> bool {
        let before = *value;
        ui.spacing_mut().slider_width = (ui.available_width() - NUMBER_WIDTH).clamp(40.0, 400.0);
        let mut slider = Slider::new(value, self.range.clone()).suffix(self.suffix);
        if self.whole {
            slider = slider.integer();
        } else if self.logarithmic {
            slider = slider.custom_formatter(|x, _| short(x));
        } else {
            slider = slider.max_decimals(2);
        }
        if self.logarithmic {
            slider = slider.logarithmic(true).smallest_positive(self.range.start().max(1e-15));
        }
        let help = format!("{}\nCtrl+click: back to {}{}", self.help, short(self.default), self.suffix);
        let response = ui.name_inputs(self.label, |ui| ui.add(slider)).on_hover_text(help);
        if reset(ui, &response) {
            *value = self.default;
        }
        // A slider shows the nearest value that it can, and must not change the value by showing it.
        if response.changed() || reset(ui, &response) { *value != before } else { restore(value, before) }
    }
}

fn restore(value: &mut f64, before: f64) -> bool {
    *value = before;
    false
}

/// Whether a control has been clicked with Ctrl held.
pub(crate) fn reset(ui: &Ui, response: &Response) -> bool {
    let over = response.contains_pointer() || response.is_pointer_button_down_on();
    over && ui.input(|i| i.modifiers.command && (i.pointer.primary_down() || i.pointer.primary_clicked()))
}

/// A row of a form: a label and controls beside it, which the label names.
pub(crate) fn row_ui<R>(ui: &mut Ui, label: &str, content: impl FnOnce(&mut Ui) -> R) -> R {
    ui.horizontal(|ui| {
        let height = ui.spacing().interact_size.y;
        ui.allocate_ui_with_layout(
            egui::vec2(LABEL_WIDTH, height),
            egui::Layout::left_to_right(egui::Align::Center),
            |ui| {
                ui.set_min_width(LABEL_WIDTH);
                ui.add(egui::Label::new(subscripted(label)).truncate());
            },
        );
        ui.name_inputs(label, content)
    })
    .inner
}

/// A row with a choice; whether it has changed.
pub(crate) fn choice_ui<T: Copy + PartialEq>(
    ui: &mut Ui,
    label: &str,
    value: &mut T,
    all: &[T],
    name: impl Fn(T) -> &'static str,
) -> bool {
    let before = *value;
    row_ui(ui, label, |ui| {
        let width = ui.available_width() - 8.0;
        let combo = ComboBox::from_id_salt(label).width(width).truncate().selected_text(name(*value));
        let shown = combo.show_ui(ui, |ui| {
            for &option in all {
                ui.selectable_value(value, option, name(option));
            }
        });
        shown.response.accessible_name(label);
    });
    *value != before
}

/// A slider with its label among the tools over a view, `width` wide together.
pub(crate) fn tool_ui(ui: &mut Ui, number: Number<'_>, width: f32, value: &mut f64) -> bool {
    let size = egui::vec2(width, ui.spacing().interact_size.y);
    let layout = egui::Layout::left_to_right(egui::Align::Center);
    ui.allocate_ui_with_layout(size, layout, |ui| {
        ui.label(subscripted(number.label));
        number.slider_ui(ui, value)
    })
    .inner
}

/// A menu of tools, which stays open while they are used.
pub(crate) fn tools_menu_ui(ui: &mut Ui, name: &str, content: impl FnOnce(&mut Ui)) {
    let config = MenuConfig::new().close_behavior(egui::PopupCloseBehavior::CloseOnClickOutside);
    MenuButton::new(name).config(config).ui(ui, content);
}

/// Buttons of which one is down; whether another is now.
pub(crate) fn segments_ui<T: Copy + PartialEq>(
    ui: &mut Ui,
    value: &mut T,
    all: &[T],
    name: impl Fn(T) -> &'static str,
) -> bool {
    let before = *value;
    let gap = std::mem::replace(&mut ui.spacing_mut().item_spacing.x, 2.0);
    for &option in all {
        ui.selectable_value(value, option, subscripted(name(option)));
    }
    ui.spacing_mut().item_spacing.x = gap;
    *value != before
}

/// Puts an image into a texture that is no longer shown, or into a new one.
pub(crate) fn put_texture(
    ctx: &egui::Context,
    old: &mut Option<TextureHandle>,
    name: String,
    image: egui::ColorImage,
) -> TextureHandle {
    match old.take() {
        Some(mut texture) => {
            texture.set(image, egui::TextureOptions::LINEAR);
            texture
        }
        None => ctx.load_texture(name, image, egui::TextureOptions::LINEAR),
    }
}

/// A text in which the letters h, d, i and o after a theta or a phi are subscripts.
pub(crate) fn subscripted(text: &str) -> LayoutJob {
    let mut job = LayoutJob::default();
    let whole = |size: f32, valign| TextFormat { font_id: FontId::proportional(size), valign, ..plain() };
    let mut rest = text;
    while let Some(at) = rest.find(['θ', 'φ']) {
        let letter = at + 'θ'.len_utf8();
        job.append(&rest[..letter], 0.0, whole(14.0, Align::BOTTOM));
        rest = &rest[letter..];
        if rest.starts_with(['h', 'd', 'i', 'o']) {
            job.append(&rest[..1], 0.0, whole(9.5, Align::BOTTOM));
            rest = &rest[1..];
        }
    }
    if !rest.is_empty() {
        job.append(rest, 0.0, whole(14.0, Align::BOTTOM));
    }
    job
}

/// Text in the colour of the widget that shows it.
fn plain() -> TextFormat {
    TextFormat { color: Color32::PLACEHOLDER, ..TextFormat::default() }
}

/// The heading of a part of a panel.
pub(crate) fn section_ui(ui: &mut Ui, title: &str) {
    ui.add_space(8.0);
    ui.label(RichText::new(title).strong().size(15.0));
    ui.add_space(2.0);
}

/// The bar of a colour map.
pub(crate) fn scale_ui(ui: &mut Ui, map: Colormap) {
    let (rect, _) = ui.allocate_exact_size(egui::vec2(72.0, 9.0), egui::Sense::hover());
    let mut mesh = egui::Mesh::default();
    let steps: u16 = 24;
    for k in 0..=steps {
        let t = f64::from(k) / f64::from(steps);
        let x = egui::lerp(rect.left()..=rect.right(), narrow(t));
        let fill = colour(map, t);
        mesh.colored_vertex(egui::pos2(x, rect.top()), fill);
        mesh.colored_vertex(egui::pos2(x, rect.bottom()), fill);
        if k > 0 {
            let v = 2 * u32::from(k);
            mesh.add_triangle(v - 2, v - 1, v);
            mesh.add_triangle(v - 1, v, v + 1);
        }
    }
    ui.painter().add(mesh);
}

/// A peak signal-to-noise ratio for people.
pub(crate) fn psnr_text(psnr: f64) -> String {
    if psnr.is_finite() { format!("PSNR {psnr:.1} dB") } else { "PSNR ∞ dB".to_owned() }
}

/// A number for people, with four significant digits.
pub(crate) fn short(x: f64) -> String {
    if !x.is_finite() {
        return if x > 0.0 { "∞".to_owned() } else { "–".to_owned() };
    }
    gpbrdf_core::base::number::short(x, 4)
}

/// Rounds to the precision of the window.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of the window")]
pub(crate) fn narrow(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use eframe::epaint::text::ByteRangeExt;

    use super::*;

    #[test]
    fn only_letters_after_an_angle_are_subscripts() {
        let job = subscripted("× cos θi at φd, heading");
        assert_eq!(job.text, "× cos θi at φd, heading");
        let small: Vec<&str> = job
            .sections
            .iter()
            .filter(|section| section.format.font_id.size < 12.0)
            .map(|section| &job.text[section.byte_range.as_usize()])
            .collect();
        assert_eq!(small, ["i", "d"]);
        assert_eq!(subscripted("").text, "");
    }

    #[test]
    fn numbers_keep_four_digits() {
        for (x, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (0.05, "0.05"),
            (12.345_6, "12.35"),
            (1e-7, "1e-7"),
            (123_456.0, "1.235e5"),
            (-0.25, "-0.25"),
            (f64::INFINITY, "∞"),
        ] {
            assert_eq!(short(x), text);
        }
    }
}
