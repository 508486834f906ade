//! The colours of the window, in a dark and in a light theme.

use eframe::egui::{Color32, Context, Style, TextStyle, Theme, Visuals, vec2};

/// The fill behind messages, on which white text is read.
pub(crate) const ERROR: Color32 = Color32::from_rgb(0xB0, 0x30, 0x24);
pub(crate) const NOTE: Color32 = Color32::from_rgb(0x2C, 0x5F, 0x8A);
pub(crate) const DONE: Color32 = Color32::from_rgb(0x26, 0x6B, 0x46);

/// The direction of the light, in plots of both themes.
pub(crate) const LIGHT: Color32 = Color32::from_rgb(0xD0, 0x9A, 0x10);

/// The colours of a theme: those of egui, with text that has a contrast of at least 4.5 to what is behind it.
pub(crate) fn visuals(theme: Theme) -> Visuals {
    let gray = Color32::from_gray;
    let (mut visuals, text, weak, error, warning, link) = match theme {
        Theme::Dark => {
            let (error, warning) = (Color32::from_rgb(255, 120, 108), Color32::from_rgb(255, 160, 40));
            (Visuals::dark(), gray(190), gray(155), error, warning, Color32::from_rgb(110, 180, 255))
        }
        Theme::Light => {
            let (error, warning) = (Color32::from_rgb(176, 0, 0), Color32::from_rgb(140, 70, 0));
            (Visuals::light(), gray(50), gray(90), error, warning, Color32::from_rgb(0, 90, 170))
        }
    };
    visuals.widgets.noninteractive.fg_stroke.color = text;
    visuals.weak_text_color = Some(weak);
    (visuals.error_fg_color, visuals.warn_fg_color, visuals.hyperlink_color) = (error, warning, link);
    visuals
}

/// Gives both themes their colours, and their spacing and text.
pub(crate) fn apply(ctx: &Context) {
    for theme in [Theme::Dark, Theme::Light] {
        ctx.set_visuals_of(theme, visuals(theme));
    }
    ctx.all_styles_mut(|style: &mut Style| {
        style.spacing.item_spacing = vec2(8.0, 5.0);
        style.spacing.button_padding = vec2(7.0, 3.0);
        if let Some(small) = style.text_styles.get_mut(&TextStyle::Small) {
            small.size = 11.0;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The ratio of contrast of Web Content Accessibility Guidelines 2.2: `(a + 0.05) / (b + 0.05)` of the relative
    /// luminances, the lighter one above.
    fn contrast(a: Color32, b: Color32) -> f64 {
        let luminance = |colour: Color32| {
            let linear = |x: u8| {
                let x = f64::from(x) / 255.0;
                if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
            };
            0.2126 * linear(colour.r()) + 0.7152 * linear(colour.g()) + 0.0722 * linear(colour.b())
        };
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn contrast_is_that_of_the_guidelines() {
        // Black on white, and the example of technique G18: #767676 on white is just enough.
        assert!((contrast(Color32::BLACK, Color32::WHITE) - 21.0).abs() < 1e-9);
        assert!((contrast(Color32::from_gray(0x76), Color32::WHITE) - 4.54).abs() < 0.01);
    }

    #[test]
    fn all_text_of_both_themes_can_be_read() {
        for theme in [Theme::Dark, Theme::Light] {
            let visuals = visuals(theme);
            let mut pairs = Vec::new();
            let grounds = [visuals.panel_fill, visuals.window_fill, visuals.extreme_bg_color];
            for ground in grounds {
                for (what, colour) in [
                    ("text", visuals.text_color()),
                    ("weak text", visuals.weak_text_color()),
                    ("strong text", visuals.strong_text_color()),
                    ("errors", visuals.error_fg_color),
                    ("warnings", visuals.warn_fg_color),
                    ("links", visuals.hyperlink_color),
                ] {
                    pairs.push((what, colour, ground));
                }
            }
            let widgets = &visuals.widgets;
            for (what, look) in [
                ("buttons", &widgets.inactive),
                ("a button under the pointer", &widgets.hovered),
                ("a pressed button", &widgets.active),
                ("an open menu", &widgets.open),
            ] {
                pairs.push((what, look.text_color(), look.weak_bg_fill));
                pairs.push((what, look.text_color(), look.bg_fill));
            }
            pairs.push(("what is chosen", visuals.selection.stroke.color, visuals.selection.bg_fill));
            for fill in [ERROR, NOTE, DONE] {
                pairs.push(("messages", Color32::WHITE, fill));
            }
            for (what, colour, ground) in pairs {
                assert_eq!((colour.a(), ground.a()), (255, 255), "{theme:?}: {what}");
                let found = contrast(colour, ground);
                assert!(found >= 4.5, "{theme:?}: {what}, {colour:?} on {ground:?}: {found:.2}");
            }
        }
    }
}
