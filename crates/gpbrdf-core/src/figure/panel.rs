//! Figures that show truth, prediction and difference side by side, with captions, axes and scales.

use crate::base::error::Result;
use crate::base::number::short;
use crate::brdf::{Brdf, Rgb};
use crate::figure::colormap::Colormap;
use crate::figure::picture::{Picture, Rgb8, tone_map};
use crate::figure::scale::round_limit;
use crate::figure::slice::{Slice, SliceOptions};
use crate::judge::Image;
use crate::judge::image_metrics::{exposed_difference, exposure_of, psnr};

const BACKGROUND: Rgb8 = [34, 34, 38];
const INK: Rgb8 = [226, 226, 230];
const FAINT: Rgb8 = [160, 160, 168];
/// Pixels per dot of the font, and the height of a line of text.
const SCALE: usize = 2;
const LINE: usize = 8 * SCALE;
const MARGIN: usize = 28;
/// Gap between panels, without axes and with them; labels of axes extend into it.
const GAP: usize = 44;
const AXES_GAP: usize = 76;
const SMALL_GAP: usize = 10;
const TICK: usize = 6;
/// How far a subscript is below its line.
const SUBSCRIPT_DROP: usize = 3 * SCALE;
/// Width of a colour bar.
const BAR: usize = 18;
/// Space to the left of the first panel for the labels of the y axis.
const Y_LABELS: usize = 104;

/// One picture of a figure.
#[derive(Clone, Debug)]
pub struct Panel {
    /// The picture.
    pub picture: Picture,
    /// The text above it.
    pub caption: &'static str,
    /// The meaning of its colours if they are false ones; it is drawn as a bar beside the picture.
    pub scale: Option<Scale>,
}

/// The meaning of a panel's colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// The colours.
    pub map: Colormap,
    /// The value of the lowest colour.
    pub low: f64,
    /// The value of the highest colour.
    pub high: f64,
}

/// The axes of a slice.
struct Axes {
    square_theta_h: bool,
}

/// A figure of image slices: truth, prediction and their difference, or the prediction alone if there is no
/// truth.
///
/// The difference is [`Slice::log_difference`], red where the prediction is too bright. Its scale is
/// symmetric and ends at [`round_limit`].
///
/// # Errors
/// The errors of [`Slice::log_difference`]; they do not occur, since both slices are taken with the same
/// options.
pub fn slice_figure(
    title: &str,
    truth: Option<&dyn Brdf>,
    prediction: &dyn Brdf,
    options: &SliceOptions,
) -> Result<Picture> {
    let predicted = Slice::new(prediction, options);
    let mut panels = Vec::new();
    let mut note = String::new();
    if let Some(truth) = truth {
        let truth = Slice::new(truth, options);
        let gap = predicted.log_difference(&truth)?;
        let limit = round_limit(&gap, predicted.above_horizon());
        let colours = truth.picture(|i| Colormap::Diverging.at(0.5 + 0.5 * gap[i] / limit));
        panels.push(Panel::plain("truth", truth.tone_mapped(options)));
        panels.push(Panel::plain("prediction", predicted.tone_mapped(options)));
        panels.push(Panel::signed("difference", colours, limit));
        note.push_str("difference: ln(prediction + 0.001) - ln(truth + 0.001), mean of R, G, B");
    } else {
        panels.push(Panel::plain("prediction", predicted.tone_mapped(options)));
    }
    let degrees = options.phi_d.to_degrees();
    let mut shown = format!("\u{3c6}_d {}\u{b0}", short(degrees, 3));
    if options.exposure != 0.0 {
        let sign = if options.exposure > 0.0 { "+" } else { "" };
        shown.push_str(&format!("   exposure {sign}{}", short(options.exposure, 3)));
    }
    let axes = Axes { square_theta_h: options.square_theta_h };
    Ok(compose(&join(title, &shown), &panels, Some(&axes), &note))
}

/// A figure of sphere pictures: truth, prediction and their difference, or the prediction alone if there is
/// no truth. All are shown with the exposure of the truth, or else of the prediction ([`exposure_of`]), and
/// with a gamma of 2.2.
///
/// The difference is [`exposed_difference`], red where the prediction is too bright. With a truth, the title
/// shows a PSNR: `psnr_env` if it is given, else that of the pictures.
///
/// # Errors
/// [`crate::Error::InvalidArgument`] when the pictures differ in size.
pub fn sphere_figure(
    title: &str,
    truth: Option<&Image>,
    prediction: &Image,
    psnr_env: Option<f64>,
) -> Result<Picture> {
    let exposure = exposure_of(truth.unwrap_or(prediction));
    let show = |image: &Image| disc(image, |p| tone_map(p, exposure, 2.2));
    let mut panels = Vec::new();
    let (mut shown, mut note) = (String::new(), String::new());
    if let Some(truth) = truth {
        let found = psnr(truth, prediction, exposure)?;
        shown = format!("PSNR {:.1} dB", psnr_env.unwrap_or(found));
        let pairs = prediction.raster().pixels().iter().zip(truth.raster().pixels());
        let gap: Vec<f64> = pairs.map(|(a, b)| exposed_difference(wide(a), wide(b), exposure)).collect();
        let limit = round_limit(&gap, truth.mask());
        let colours = disc_by_index(truth, |i| Colormap::Diverging.at(0.5 + 0.5 * gap[i] / limit));
        panels.push(Panel::plain("truth", show(truth)));
        panels.push(Panel::plain("prediction", show(prediction)));
        panels.push(Panel::signed("difference", colours, limit));
        note.push_str("difference: prediction - truth, linear, mean of R, G, B; 1 = white");
    } else {
        panels.push(Panel::plain("prediction", show(prediction)));
    }
    Ok(compose(&join(title, &shown), &panels, None, &note))
}

/// A figure of pictures in a row, with a title above, captions, colour bars, and a note below.
#[must_use]
pub fn panel_figure(title: &str, panels: &[Panel], note: &str) -> Picture {
    compose(title, panels, None, note)
}

impl Panel {
    fn plain(caption: &'static str, picture: Picture) -> Self {
        Self { picture, caption, scale: None }
    }

    fn signed(caption: &'static str, picture: Picture, limit: f64) -> Self {
        let scale = Scale { map: Colormap::Diverging, low: -limit, high: limit };
        Self { picture, caption, scale: Some(scale) }
    }
}

impl Scale {
    /// The labels of five ticks, from the top down.
    fn labels(&self) -> [String; 5] {
        std::array::from_fn(|i| {
            let value = self.high + (self.low - self.high) * i as f64 / 4.0;
            if self.low < 0.0 && value > 0.0 { format!("+{}", short(value, 3)) } else { short(value, 3) }
        })
    }

    /// Width that the bar and its labels take to the right of the panel.
    fn width(&self) -> usize {
        let labels = self.labels();
        let widest = labels.iter().map(|label| Picture::text_width(label, SCALE)).max().unwrap_or(0);
        2 * SMALL_GAP + BAR + TICK + SMALL_GAP / 2 + widest
    }
}

/// Lays the panels out in a row, with the title above and the note below.
fn compose(title: &str, panels: &[Panel], axes: Option<&Axes>, note: &str) -> Picture {
    let left = MARGIN + if axes.is_some() { Y_LABELS } else { 0 };
    let gap = if axes.is_some() { AXES_GAP } else { GAP };
    let mut right = left;
    let mut places = Vec::new();
    for (i, panel) in panels.iter().enumerate() {
        right += if i > 0 { gap } else { 0 };
        places.push(right);
        // A caption that is wider than its panel makes the panel's place wider.
        right += panel.picture.width().max(Picture::text_width(panel.caption, SCALE));
        right += panel.scale.as_ref().map_or(0, Scale::width);
    }
    if axes.is_some() && panels.last().is_some_and(|panel| panel.scale.is_none()) {
        right += 3 * LINE / 2;
    }
    let title_height = if title.is_empty() { 0 } else { LINE + MARGIN };
    let top = MARGIN + title_height + LINE + SMALL_GAP;
    let tallest = panels.iter().map(|panel| panel.picture.height()).max().unwrap_or(0);
    let mut bottom = top + tallest;
    if axes.is_some() {
        bottom += TICK + 2 * SMALL_GAP + 2 * LINE + SUBSCRIPT_DROP;
    }
    let note_top = bottom + MARGIN - SMALL_GAP / 2;
    if !note.is_empty() {
        bottom = note_top + LINE;
    }
    let texts = Picture::text_width(title, SCALE).max(Picture::text_width(note, SCALE));
    let width = right.max(left + texts) + MARGIN;
    let mut canvas = Picture::filled(width, bottom + MARGIN, BACKGROUND);
    canvas.text(left as i64, MARGIN as i64, SCALE, INK, title);
    canvas.text(left as i64, note_top as i64, SCALE, FAINT, note);
    for (i, (panel, &x)) in panels.iter().zip(&places).enumerate() {
        let caption_top = top - LINE - SMALL_GAP;
        let spare = panel.picture.width().saturating_sub(Picture::text_width(panel.caption, SCALE));
        canvas.text((x + spare / 2) as i64, caption_top as i64, SCALE, INK, panel.caption);
        canvas.blit(x as i64, top as i64, &panel.picture);
        if let Some(axes) = axes {
            draw_axes(&mut canvas, x, top, panel.picture.width(), axes, i == 0);
        }
        if let Some(scale) = &panel.scale {
            let bar = x + panel.picture.width() + 2 * SMALL_GAP;
            draw_scale(&mut canvas, bar, top, panel.picture.height(), scale);
        }
    }
    canvas
}

/// Draws frame, ticks and labels at 0, 30, 60 and 90 degrees of a slice at `(x, y)`.
fn draw_axes(canvas: &mut Picture, x: usize, y: usize, size: usize, axes: &Axes, y_labels: bool) {
    let (left, top) = (x as i64, y as i64);
    for (dx, dy, width, height) in
        [(-1, -1, size + 2, 1), (-1, size as i64, size + 2, 1), (-1, 0, 1, size), (size as i64, 0, 1, size)]
    {
        canvas.fill(left + dx, top + dy, width, height, FAINT);
    }
    for degrees in [0u8, 30, 60, 90] {
        let label = format!("{degrees}\u{b0}");
        let t = f64::from(degrees) / 90.0;
        let across = along(if axes.square_theta_h { t.sqrt() } else { t }, size);
        canvas.fill((x + across) as i64, (y + size) as i64, 1, TICK, FAINT);
        // In a small slice the warp brings the last two labels too close together.
        if degrees != 60 || size - across > 3 * LINE + SMALL_GAP {
            // The label is centred on its digits, without the degree sign.
            let digits = Picture::text_width(&degrees.to_string(), SCALE);
            let text_x = (x + across) as i64 - (digits / 2) as i64;
            canvas.text(text_x, (y + size + TICK + SMALL_GAP) as i64, SCALE, FAINT, &label);
        }

        let up = y + along(1.0 - t, size);
        canvas.fill(left - TICK as i64, up as i64, TICK, 1, FAINT);
        if y_labels {
            let text_x = left - (TICK + SMALL_GAP / 2 + Picture::text_width(&label, SCALE)) as i64;
            canvas.text(text_x, up as i64 - (LINE / 2) as i64 + 1, SCALE, FAINT, &label);
        }
    }
    let name_top = y + size + TICK + 2 * SMALL_GAP + LINE;
    centred(canvas, x + size / 2, name_top, INK, "\u{3b8}_h");
    if y_labels {
        let middle = (y + size / 2) as i64 - (LINE / 2) as i64;
        canvas.text(left - Y_LABELS as i64, middle, SCALE, INK, "\u{3b8}_d");
    }
}

/// Draws a vertical colour bar with five labelled ticks.
fn draw_scale(canvas: &mut Picture, x: usize, y: usize, height: usize, scale: &Scale) {
    for row in 0..height {
        let t = 1.0 - (row as f64 + 0.5) / height as f64;
        canvas.fill(x as i64, (y + row) as i64, BAR, 1, scale.map.at(t));
    }
    for (i, label) in scale.labels().iter().enumerate() {
        let at = y + along(i as f64 / 4.0, height);
        canvas.fill((x + BAR) as i64, at as i64, TICK, 1, FAINT);
        let text_x = x + BAR + TICK + SMALL_GAP / 2;
        canvas.text(text_x as i64, at as i64 - (LINE / 2) as i64 + 1, SCALE, FAINT, label);
    }
}

/// The pixel at a fraction `t` of a side.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "t is in [0, 1]")]
fn along(t: f64, side: usize) -> usize {
    (t * side.saturating_sub(1) as f64).round() as usize
}

fn centred(canvas: &mut Picture, x: usize, y: usize, colour: Rgb8, text: &str) {
    let half = Picture::text_width(text, SCALE) / 2;
    canvas.text(x as i64 - half as i64, y as i64, SCALE, colour, text);
}

/// A sphere picture on the figure's background. Pixels on the rim are mixed with it by their coverage.
fn disc(image: &Image, colour: impl Fn(Rgb) -> Rgb8) -> Picture {
    disc_by_index(image, |i| colour(wide(&image.raster().pixels()[i])))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a mean of two u8 is one")]
fn disc_by_index(image: &Image, colour: impl Fn(usize) -> Rgb8) -> Picture {
    let (columns, rows) = (image.raster().width(), image.raster().height());
    let (width, height) = (columns as f64, rows as f64);
    Picture::from_fn(columns, rows, |column, row| {
        let i = row * columns + column;
        if !image.mask()[i] {
            return BACKGROUND;
        }
        let (x, y) = (2.0 * (column as f64 + 0.5) / width - 1.0, 2.0 * (row as f64 + 0.5) / height - 1.0);
        let coverage = (0.5 + (1.0 - x.hypot(y)) * 0.5 * width).clamp(0.0, 1.0);
        let inside = colour(i);
        std::array::from_fn(|c| {
            let mixed = coverage * f64::from(inside[c]) + (1.0 - coverage) * f64::from(BACKGROUND[c]);
            (mixed + 0.5) as u8
        })
    })
}

fn join(title: &str, shown: &str) -> String {
    match (title.is_empty(), shown.is_empty()) {
        (false, false) => format!("{title}   {shown}"),
        _ => format!("{title}{shown}"),
    }
}

fn wide(pixel: &[f32; 3]) -> Rgb {
    pixel.map(f64::from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::angles::HalfDiff;
    use crate::brdf::table::BrdfTable;
    use crate::judge::Environment;
    use crate::judge::sphere::render_env;

    fn glossy(a: HalfDiff) -> Rgb {
        let fresnel = 0.05 + 0.95 * (1.0 - a.theta_d.cos()).powi(5);
        let lobe = 12.0 * fresnel * a.theta_h.cos().powi(120);
        [0.16 + lobe, 0.018 + lobe, 0.014 + lobe]
    }

    /// Differs from [`glossy`] by a ripple of 4 percent.
    fn rippled(a: HalfDiff) -> Rgb {
        let ripple = 1.0 + 0.04 * (9.0 * a.theta_h).sin() * (7.0 * a.theta_d).cos();
        glossy(a).map(|x| x * ripple)
    }

    #[test]
    fn nothing_is_drawn_on_the_margin_and_the_panels_are_inside() {
        let (truth, prediction) = (BrdfTable::from_fn(glossy), BrdfTable::from_fn(rippled));
        let options = SliceOptions { size: 128, ..SliceOptions::default() };
        let slices = slice_figure("chm_mint", Some(&truth), &prediction, &options).unwrap();
        let images = render_env(&[&truth, &prediction], &Environment::studio(), 64);
        let spheres = sphere_figure(
            "a title longer than it should be, by far, for three panels this small",
            Some(&images[0]),
            &images[1],
            None,
        );
        let alone = sphere_figure("", None, &images[1], None).unwrap();
        for figure in [slices, spheres.unwrap(), alone] {
            let (width, height) = (figure.width(), figure.height());
            for (i, colour) in figure.pixels().iter().enumerate() {
                let (x, y) = (i % width, i / width);
                if x.min(width - 1 - x) < MARGIN - 8 || y.min(height - 1 - y) < MARGIN - 8 {
                    assert_eq!(*colour, BACKGROUND, "{x} {y} of {width} x {height}");
                }
            }
            let drawn = figure.pixels().iter().filter(|&&c| c != BACKGROUND).count();
            assert!(drawn > 3000, "{drawn}");
        }
    }

    #[test]
    fn limits_are_round_and_labels_short() {
        let limit = |x: f64| round_limit(&[-x, 0.0, f64::NAN, 100.0], &[true, true, true, false]);
        assert_eq!(limit(0.02), 0.02);
        assert!((limit(0.021) - 0.05).abs() < 1e-12);
        assert!((limit(7.0) - 10.0).abs() < 1e-12);
        assert_eq!(limit(0.0), 1e-6);
        let texts = [0.05, -0.025, 0.0, 90.0, 1e-6, 2.5e-6, 1.5].map(|x| short(x, 3));
        assert_eq!(texts, ["0.05", "-0.025", "0", "90", "1e-6", "2.5e-6", "1.5"]);
    }
}
