//! An 8-bit picture, and its PNG file.

use std::io::Write;
use std::path::Path;

use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::base::raster::Raster;
use crate::brdf::Rgb;

/// An sRGB colour, 8 bits per channel.
pub type Rgb8 = [u8; 3];

/// An 8-bit sRGB picture, rows from top to bottom. Drawing outside of it has no effect.
pub type Picture = Raster<Rgb8>;

impl Picture {
    /// Fills a rectangle.
    pub fn fill(&mut self, x: i64, y: i64, width: usize, height: usize, colour: Rgb8) {
        for row in 0..height {
            for column in 0..width {
                self.set(x + column as i64, y + row as i64, colour);
            }
        }
    }

    /// Writes the picture as PNG.
    ///
    /// # Errors
    /// Any error of `out`; also an error for an empty picture, which PNG cannot hold.
    pub fn write_png(&self, out: &mut impl Write) -> std::io::Result<()> {
        write_png(out, self.width(), self.height(), png::ColorType::Rgb, self.pixels().as_flattened(), None)
    }

    /// [`Picture::write_png`] with a resolution, by which other programs know the size on paper.
    pub(crate) fn write_png_at(&self, out: &mut impl Write, dots_per_inch: f64) -> std::io::Result<()> {
        let pixels = self.pixels().as_flattened();
        write_png(out, self.width(), self.height(), png::ColorType::Rgb, pixels, Some(dots_per_inch))
    }

    /// Writes the picture as a PNG file.
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be written.
    pub fn save_png(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        let mut file = AtomicFile::create(path)?;
        self.write_png(&mut file).map_err(|source| Error::write(path, source))?;
        file.commit()
    }

    fn set(&mut self, x: i64, y: i64, colour: Rgb8) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        let width = self.width();
        if x < width && y < self.height() {
            self.pixels_mut()[y * width + x] = colour;
        }
    }
}

/// Writes `width x height` pixels of RGBA, rows from top to bottom, as PNG.
///
/// # Errors
/// Any error of `out`, or [`std::io::ErrorKind::Other`] unless there are `width x height` pixels, at least
/// one.
pub fn write_rgba_png(
    out: &mut impl Write,
    width: usize,
    height: usize,
    pixels: &[[u8; 4]],
) -> std::io::Result<()> {
    if pixels.is_empty() || width.checked_mul(height) != Some(pixels.len()) {
        let what = format!("expected {width} x {height} pixels, at least one, found {}", pixels.len());
        return Err(std::io::Error::other(what));
    }
    write_png(out, width, height, png::ColorType::Rgba, pixels.as_flattened(), None)
}

fn write_png(
    out: &mut impl Write,
    width: usize,
    height: usize,
    colour: png::ColorType,
    bytes: &[u8],
    dots_per_inch: Option<f64>,
) -> std::io::Result<()> {
    let side = |n: usize| u32::try_from(n).map_err(std::io::Error::other);
    let failed = |error: png::EncodingError| match error {
        png::EncodingError::IoError(error) => error,
        other => std::io::Error::other(other),
    };
    let mut encoder = png::Encoder::new(&mut *out, side(width)?, side(height)?);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    if let Some(dots) = dots_per_inch {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a cast to an integer saturates"
        )]
        let per_metre = (dots / 0.0254).round() as u32;
        let unit = png::Unit::Meter;
        encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit }));
    }
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(bytes).map_err(failed)?;
    writer.finish().map_err(failed)?;
    out.flush()
}

/// Linear RGB as it is shown: times `scale`, clipped to `[0, 1]`, raised to `1 / gamma`, rounded. NaN becomes
/// black.
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the value is within [0, 255.5]")]
pub(crate) fn tone_map(linear: Rgb, scale: f64, gamma: f64) -> Rgb8 {
    linear.map(|x| ((x * scale).clamp(0.0, 1.0).powf(1.0 / gamma) * 255.0 + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_holds_the_pixels() {
        let picture =
            Picture::from_fn(5, 3, |x, y| if (x + y) % 3 == 0 { [9, 90, 200] } else { [255, 1, 0] });
        let mut bytes = Vec::new();
        picture.write_png(&mut bytes).unwrap();
        let back = image::load_from_memory(&bytes).unwrap().into_rgb8();
        assert_eq!((back.width(), back.height()), (5, 3));
        assert_eq!(back.into_raw(), picture.pixels().as_flattened());
        assert!(Picture::filled(0, 0, [0; 3]).write_png(&mut bytes).is_err());
        let folder = tempfile::tempdir().unwrap();
        assert!(picture.save_png(folder.path()).is_err());
    }

    #[test]
    fn tone_mapping_clips_rounds_and_takes_nan_for_black() {
        assert_eq!(tone_map([-1.0, 0.5, 3.0], 1.0, 1.0), [0, 128, 255]);
        assert_eq!(tone_map([0.25, f64::NAN, 0.125], 2.0, 2.2), [186, 0, 136]);
    }
}
