//! An 8-bit picture with drawing and text, and its PNG file.

use std::io::Write;
use std::path::Path;

use font8x8::legacy::{BASIC_LEGACY, GREEK_LEGACY, LATIN_LEGACY};
use image::ImageEncoder as _;

use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::base::raster::Raster;
use crate::brdf::Rgb;

/// An sRGB colour, 8 bits per channel.
pub type Rgb8 = [u8; 3];

/// A lower-case theta of full height. The font's own theta is as low as an `e`, and looks like one.
const THETA: [u8; 8] = [0x1c, 0x36, 0x36, 0x3e, 0x36, 0x36, 0x1c, 0x00];

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

    /// Copies `other` with its upper left corner at `(x, y)`.
    pub fn blit(&mut self, x: i64, y: i64, other: &Self) {
        for (i, &colour) in other.pixels().iter().enumerate() {
            self.set(x + (i % other.width()) as i64, y + (i / other.width()) as i64, colour);
        }
    }

    /// Writes `text` with its upper left corner at `(x, y)`, each dot of the 8 x 8 font `scale` pixels wide.
    ///
    /// An underscore after a Greek letter makes the next character a subscript, three dots lower. A character
    /// that is not in the font is shown as `?`.
    pub fn text(&mut self, x: i64, y: i64, scale: usize, colour: Rgb8, text: &str) {
        for letter in letters(text, scale) {
            for (row, bits) in glyph(letter.character).into_iter().enumerate() {
                for column in 0..8 {
                    if bits >> column & 1 == 1 {
                        let left = x + (letter.x + column * scale) as i64;
                        let top = y + (letter.y + row * scale) as i64;
                        self.fill(left, top, scale, scale, colour);
                    }
                }
            }
        }
    }

    /// The width in pixels of a text that is written by [`Picture::text`], without the empty column after the
    /// last character.
    #[must_use]
    pub fn text_width(text: &str, scale: usize) -> usize {
        letters(text, scale).last().map_or(0, |letter| letter.x + 7 * scale)
    }

    /// Writes the picture as PNG.
    ///
    /// # Errors
    /// Any error of `out`; also an error for an empty picture, which PNG cannot hold.
    pub fn write_png(&self, out: &mut impl Write) -> std::io::Result<()> {
        let side = |n: usize| u32::try_from(n).map_err(std::io::Error::other);
        image::codecs::png::PngEncoder::new(&mut *out)
            .write_image(
                self.pixels().as_flattened(),
                side(self.width())?,
                side(self.height())?,
                image::ExtendedColorType::Rgb8,
            )
            .map_err(|error| match error {
                image::ImageError::IoError(error) => error,
                other => std::io::Error::other(other),
            })?;
        out.flush()
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
    let side = |n: usize| u32::try_from(n).map_err(std::io::Error::other);
    image::codecs::png::PngEncoder::new(&mut *out)
        .write_image(pixels.as_flattened(), side(width)?, side(height)?, image::ExtendedColorType::Rgba8)
        .map_err(std::io::Error::other)?;
    out.flush()
}

/// Linear RGB as it is shown: times `scale`, clipped to `[0, 1]`, raised to `1 / gamma`, rounded. NaN becomes
/// black.
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the value is within [0, 255.5]")]
pub(crate) fn tone_map(linear: Rgb, scale: f64, gamma: f64) -> Rgb8 {
    linear.map(|x| ((x * scale).clamp(0.0, 1.0).powf(1.0 / gamma) * 255.0 + 0.5) as u8)
}

/// One character and its place.
struct Letter {
    character: char,
    x: usize,
    y: usize,
}

/// Places the characters of a line of text.
fn letters(text: &str, scale: usize) -> Vec<Letter> {
    let mut letters = Vec::new();
    let mut x = 0;
    let mut characters = text.chars().peekable();
    let mut after_greek = false;
    while let Some(character) = characters.next() {
        let subscript = if after_greek && character == '_' { characters.next() } else { None };
        if let Some(character) = subscript {
            letters.push(Letter { character, x, y: 3 * scale });
            x += 8 * scale;
        } else {
            letters.push(Letter { character, x, y: 0 });
            x += 8 * scale;
        }
        after_greek = ('\u{390}'..='\u{3c9}').contains(&character);
    }
    letters
}

/// The rows of a character; the lowest bit is at the left.
fn glyph(character: char) -> [u8; 8] {
    let at = character as usize;
    let found = match character {
        '\u{3b8}' => Some(&THETA),
        '\0'..='\u{7f}' => BASIC_LEGACY.get(at),
        '\u{a0}'..='\u{ff}' => LATIN_LEGACY.get(at - 0xa0),
        '\u{390}'..='\u{3c9}' => GREEK_LEGACY.get(at - 0x390),
        _ => None,
    };
    *found.unwrap_or(&BASIC_LEGACY['?' as usize])
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
    fn text_stays_within_its_width_and_the_picture() {
        for text in ["Wy_", "\u{3b8}_h", "0.5\u{b0}", "\u{4e2d}"] {
            let width = Picture::text_width(text, 2);
            let mut picture = Picture::filled(width + 20, 40, [0; 3]);
            picture.text(10, 10, 2, [255; 3], text);
            let lit = |i: usize| picture.pixels()[i] != [0; 3];
            let columns: Vec<_> =
                (0..picture.pixels().len()).filter(|&i| lit(i)).map(|i| i % picture.width()).collect();
            let (first, last) = (*columns.iter().min().unwrap(), *columns.iter().max().unwrap());
            assert!(first >= 10 && last < 10 + width + 2, "{text} {first} {last} {width}");
            picture.text(-7, -9, 3, [9; 3], text);
        }
        assert_eq!(Picture::text_width("ab", 2), 30);
        assert_eq!(Picture::text_width("\u{3b8}_h", 2), 16 + 14);
        assert_eq!(Picture::text_width("", 2), 0);
    }

    #[test]
    fn tone_mapping_clips_rounds_and_takes_nan_for_black() {
        assert_eq!(tone_map([-1.0, 0.5, 3.0], 1.0, 1.0), [0, 128, 255]);
        assert_eq!(tone_map([0.25, f64::NAN, 0.125], 2.0, 2.2), [186, 0, 136]);
    }
}
