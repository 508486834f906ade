//! Figures that show truth, prediction and difference side by side.

use crate::base::error::Result;
use crate::base::number::short;
use crate::brdf::{Brdf, Rgb};
use crate::figure::axis::{Axis, AxisScale, minus};
use crate::figure::colormap::Colormap;
use crate::figure::panel::{Panel, Scale};
use crate::figure::picture::{Picture, Rgb8, tone_map};
use crate::figure::scale::round_limit;
use crate::figure::sheet::Figure;
use crate::figure::slice::{Slice, SliceOptions};
use crate::figure::style::PAPER;
use crate::judge::Image;
use crate::judge::image_metrics::{exposed_difference, exposure_of, psnr};

/// A figure of image slices: truth, prediction and their difference, or the prediction alone if there is no
/// truth.
///
/// The difference is [`Slice::log_difference`], red where the prediction is too bright. Its scale is
/// symmetric and ends at [`round_limit`]. `title` says of what material the figure is, and out of what it was made.
///
/// # Errors
/// The errors of [`Slice::log_difference`]; they do not occur, since both slices are taken with the same
/// options.
pub fn slice_figure(
    title: &str,
    truth: Option<&dyn Brdf>,
    prediction: &dyn Brdf,
    options: &SliceOptions,
) -> Result<Figure> {
    let predicted = Slice::new(prediction, options);
    let scale = if options.square_theta_h { AxisScale::SquareRoot } else { AxisScale::Linear };
    let axes = || [Axis::degrees("θ_h (degrees)", scale), Axis::degrees("θ_d (degrees)", AxisScale::Linear)];
    let plain =
        |caption: &str, slice: &Slice| Panel::picture(caption, slice.tone_mapped(options)).with_axes(axes());
    let mut panels = Vec::new();
    let mut note = format!("Values at φ_d = {}°", minus(short(options.phi_d.to_degrees(), 3)));
    if options.exposure != 0.0 {
        let sign = if options.exposure > 0.0 { "+" } else { "" };
        note.push_str(&format!(", exposure {sign}{} stops", minus(short(options.exposure, 3))));
    }
    note.push_str(&format!(", clipped to white at 1/sr, gamma {}.", short(options.gamma, 3)));
    if let Some(truth) = truth {
        let truth = Slice::new(truth, options);
        let gap = predicted.log_difference(&truth)?;
        let limit = round_limit(&gap, predicted.above_horizon());
        let colours = truth.picture(|i| Colormap::Diverging.at(0.5 + 0.5 * gap[i] / limit));
        panels.push(plain("truth", &truth));
        panels.push(plain("prediction", &predicted));
        panels.push(Panel::scaled("difference", colours, Scale::signed(limit)).with_axes(axes()));
        note.push_str(" Difference: ln(prediction + 0.001) − ln(truth + 0.001), mean of R, G and B.");
    } else {
        panels.push(plain("prediction", &predicted));
    }
    Ok(Figure::of_panels(title, panels, note))
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
) -> Result<Figure> {
    let exposure = exposure_of(truth.unwrap_or(prediction));
    let show = |image: &Image| disc(image, |p| tone_map(p, exposure, 2.2));
    let mut panels = Vec::new();
    let (mut title, mut note) = (title.to_owned(), String::new());
    if let Some(truth) = truth {
        let found = psnr(truth, prediction, exposure)?;
        let separator = if title.is_empty() { "" } else { ", " };
        title.push_str(&format!("{separator}PSNR {:.1} dB", psnr_env.unwrap_or(found)));
        let pairs = prediction.raster().pixels().iter().zip(truth.raster().pixels());
        let gap: Vec<f64> = pairs.map(|(a, b)| exposed_difference(wide(a), wide(b), exposure)).collect();
        let limit = round_limit(&gap, truth.mask());
        let colours = disc_by_index(truth, |i| Colormap::Diverging.at(0.5 + 0.5 * gap[i] / limit));
        panels.push(Panel::picture("truth", show(truth)));
        panels.push(Panel::picture("prediction", show(prediction)));
        panels.push(Panel::scaled("difference", colours, Scale::signed(limit)));
        note.push_str("Difference: prediction − truth in linear light, mean of R, G and B; 1 is white.");
    } else {
        panels.push(Panel::picture("prediction", show(prediction)));
    }
    Ok(Figure::of_panels(title, panels, note))
}

/// A sphere picture on paper. Pixels on the rim are mixed with it by their coverage.
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
            return PAPER;
        }
        let (x, y) = (2.0 * (column as f64 + 0.5) / width - 1.0, 2.0 * (row as f64 + 0.5) / height - 1.0);
        let coverage = (0.5 + (1.0 - x.hypot(y)) * 0.5 * width).clamp(0.0, 1.0);
        let inside = colour(i);
        std::array::from_fn(|c| {
            let mixed = coverage * f64::from(inside[c]) + (1.0 - coverage) * f64::from(PAPER[c]);
            (mixed + 0.5) as u8
        })
    })
}

fn wide(pixel: &[f32; 3]) -> Rgb {
    pixel.map(f64::from)
}
