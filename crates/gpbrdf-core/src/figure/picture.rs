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

/// Writes pictures of one size as an animated PNG that repeats without end, each shown for `milliseconds`.
///
/// # Errors
/// Any error of `out`, or [`std::io::ErrorKind::Other`] for no picture, an empty one, or one of another size.
pub fn write_moving_png(out: &mut impl Write, frames: &[Picture], milliseconds: u16) -> std::io::Result<()> {
    let side = |n: usize| u32::try_from(n).map_err(std::io::Error::other);
    let size = frames.first().map_or((0, 0), |frame| (frame.width(), frame.height()));
    if let Some(odd) = frames.iter().find(|frame| (frame.width(), frame.height()) != size) {
        let found = format!("{} x {}", odd.width(), odd.height());
        let what = format!("expected frames of {} x {} pixels, found one of {found}", size.0, size.1);
        return Err(std::io::Error::other(what));
    }
    let mut encoder = png::Encoder::new(&mut *out, side(size.0)?, side(size.1)?);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_animated(side(frames.len())?, 0).map_err(failed)?;
    encoder.set_frame_delay(milliseconds, 1000).map_err(failed)?;
    let mut writer = encoder.write_header().map_err(failed)?;
    for frame in frames {
        writer.write_image_data(frame.pixels().as_flattened()).map_err(failed)?;
    }
    writer.finish().map_err(failed)?;
    out.flush()
}

fn failed(error: png::EncodingError) -> std::io::Error {
    match error {
        png::EncodingError::IoError(error) => error,
        other => std::io::Error::other(other),
    }
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
    fn a_moving_picture_holds_its_frames_in_order() {
        let frames: Vec<Picture> = [[9u8; 3], [80; 3], [200; 3]].map(|c| Picture::filled(6, 4, c)).to_vec();
        let mut bytes = Vec::new();
        write_moving_png(&mut bytes, &frames, 250).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 3);
        let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
        for frame in &frames {
            reader.next_frame(&mut buffer).unwrap();
            assert_eq!(buffer, frame.pixels().as_flattened());
        }
        assert!(write_moving_png(&mut bytes, &[], 250).is_err());
        let odd = [Picture::filled(6, 4, [0; 3]), Picture::filled(4, 6, [0; 3])];
        let error = write_moving_png(&mut bytes, &odd, 250).unwrap_err().to_string();
        assert_eq!(error, "expected frames of 6 x 4 pixels, found one of 4 x 6");
    }

    #[test]
    fn tone_mapping_clips_rounds_and_takes_nan_for_black() {
        assert_eq!(tone_map([-1.0, 0.5, 3.0], 1.0, 1.0), [0, 128, 255]);
        assert_eq!(tone_map([0.25, f64::NAN, 0.125], 2.0, 2.2), [186, 0, 136]);
    }
}
