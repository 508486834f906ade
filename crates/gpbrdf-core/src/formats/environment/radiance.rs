//! Radiance pictures: G. W. Larson, "Real Pixels", Graphics Gems II (1991), and "Radiance File Formats" of the
//! Radiance documentation.

use super::primaries::{self, ToSrgb};
use super::{Decoded, Refused, check_size};
use crate::base::raster::Raster;

/// Bytes at the start of a Radiance file.
pub(super) const MAGIC: &[u8] = b"#?";

/// The longest header that is read.
const MAX_HEADER: usize = 1 << 20;

/// Lengths of lines that can be stored channel by channel.
const LINE_LENGTHS: std::ops::RangeInclusive<usize> = 8..=0x7FFF;

/// What a header says.
struct Header {
    /// Factors of R, G and B that have been applied to the pixels.
    factors: [f64; 3],
    to_srgb: Option<ToSrgb>,
    /// Columns and rows.
    size: [usize; 2],
    /// Whether lines are columns, and whether columns and rows run backwards.
    transposed: bool,
    from_right: bool,
    from_bottom: bool,
}

/// Reads a whole file.
pub(super) fn decode(bytes: &[u8]) -> Result<Decoded, Refused> {
    let (header, rest) = Header::read(bytes)?;
    let [width, height] = header.size;
    check_size(width, height)?;
    let (length, count) = if header.transposed { (height, width) } else { (width, height) };
    let mut pixels = decode_lines(rest, length, count, header.factors.map(|factor| 1.0 / factor))?;
    if let Some(matrix) = &header.to_srgb {
        primaries::convert(&mut pixels, matrix);
    }
    let raster = header.oriented(pixels).map_err(|error| Refused::new("pixels", error.to_string()))?;
    Ok(Decoded { raster, is_lat_long: false })
}

impl Header {
    /// Reads the header; what follows it are the pixels.
    fn read(bytes: &[u8]) -> Result<(Self, &[u8]), Refused> {
        let mut rest = &bytes[..bytes.len().min(MAX_HEADER)];
        let mut header = Self {
            factors: [1.0; 3],
            to_srgb: None,
            size: [0; 2],
            transposed: false,
            from_right: false,
            from_bottom: false,
        };
        let mut is_xyz = false;
        loop {
            let line =
                take_line(&mut rest).ok_or_else(|| Refused::new("a blank line after the header", "none"))?;
            if line.is_empty() {
                break;
            }
            let Some((key, value)) = line.split_once('=') else { continue };
            let unfit = |expected: &str| Refused::new(expected, format!("\"{line}\""));
            match key.trim() {
                "FORMAT" => match value.trim() {
                    "32-bit_rle_rgbe" => {}
                    "32-bit_rle_xyze" => is_xyz = true,
                    _ => return Err(unfit("the format 32-bit_rle_rgbe or 32-bit_rle_xyze")),
                },
                // Each line of these multiplies.
                "EXPOSURE" => {
                    let [factor] = numbers(value).ok_or_else(|| unfit("a positive exposure"))?;
                    header.factors = header.factors.map(|f| f * factor);
                }
                "COLORCORR" => {
                    let given =
                        numbers::<3>(value).ok_or_else(|| unfit("three positive colour corrections"))?;
                    header.factors = std::array::from_fn(|c| header.factors[c] * given[c]);
                }
                "PRIMARIES" => {
                    let given = chromaticities(value).ok_or_else(|| unfit("eight chromaticities"))?;
                    let matrix = primaries::from_chromaticities(given);
                    header.to_srgb =
                        matrix.map_err(|found| Refused::new("primaries that span colours", found))?;
                }
                _ => {}
            }
        }
        if is_xyz {
            header.to_srgb = Some(primaries::from_xyz());
        }
        if !header.factors.iter().all(|factor| factor.is_normal()) {
            return Err(Refused::new("exposures whose product is a number", format!("{:?}", header.factors)));
        }
        let line = take_line(&mut rest).unwrap_or_default();
        header.resolution(&line).ok_or_else(|| {
            Refused::new("a size such as \"-Y 512 +X 1024\" after the header", format!("\"{line}\""))
        })?;
        let length = bytes.len().min(MAX_HEADER) - rest.len();
        Ok((header, &bytes[length..]))
    }

    /// Takes in the line of the size. None if it is not one.
    fn resolution(&mut self, line: &str) -> Option<()> {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let [first, lines, second, pixels] = words[..] else { return None };
        let [lines, pixels]: [usize; 2] = [lines.parse().ok()?, pixels.parse().ok()?];
        let axis = |word: &str| match word {
            "-Y" => Some((true, false)),
            "+Y" => Some((true, true)),
            "+X" => Some((false, false)),
            "-X" => Some((false, true)),
            _ => None,
        };
        let ((first_is_y, first_back), (second_is_y, second_back)) = (axis(first)?, axis(second)?);
        if first_is_y == second_is_y {
            return None;
        }
        self.transposed = !first_is_y;
        [self.from_right, self.from_bottom] =
            if first_is_y { [second_back, first_back] } else { [first_back, second_back] };
        self.size = if first_is_y { [pixels, lines] } else { [lines, pixels] };
        Some(())
    }

    /// Pixels in the order of lines as a raster.
    fn oriented(&self, pixels: Vec<[f32; 3]>) -> crate::Result<Raster<[f32; 3]>> {
        let [width, height] = self.size;
        if !(self.transposed || self.from_right || self.from_bottom) {
            return Raster::new(width, height, pixels);
        }
        Ok(Raster::from_fn(width, height, |x, y| {
            let x = if self.from_right { width - 1 - x } else { x };
            let y = if self.from_bottom { height - 1 - y } else { y };
            pixels[if self.transposed { x * height + y } else { y * width + x }]
        }))
    }
}

/// Takes a line off a header, without its end.
fn take_line(rest: &mut &[u8]) -> Option<String> {
    let end = rest.iter().position(|&byte| byte == b'\n')?;
    let line = String::from_utf8_lossy(&rest[..end]).trim_end().to_owned();
    *rest = &rest[end + 1..];
    Some(line)
}

/// Exactly `N` positive numbers.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let found: Vec<f64> = text.split_ascii_whitespace().map_while(|word| word.parse().ok()).collect();
    let found: [f64; N] = found.try_into().ok()?;
    found.iter().all(|x| *x > 0.0 && x.is_finite()).then_some(found)
}

/// The `x, y` of red, green, blue and white.
fn chromaticities(text: &str) -> Option<[[f64; 2]; 4]> {
    let found: Vec<f64> = text.split_ascii_whitespace().map_while(|word| word.parse().ok()).collect();
    let found: [f64; 8] = found.try_into().ok()?;
    Some(std::array::from_fn(|i| [found[2 * i], found[2 * i + 1]]))
}

/// Decodes `count` lines of `length` pixels and multiplies them by `factors`. Memory grows with what is decoded.
fn decode_lines(
    mut rest: &[u8],
    length: usize,
    count: usize,
    factors: [f64; 3],
) -> Result<Vec<[f32; 3]>, Refused> {
    let mut pixels: Vec<[f32; 3]> = Vec::new();
    let mut line = Vec::new();
    for i in 0..count {
        decode_line(&mut rest, length, &mut line).map_err(|expected| {
            Refused::new(expected, format!("another or the end of the file in line {} of {count}", i + 1))
        })?;
        if pixels.capacity() - pixels.len() < length {
            let more = pixels.len().clamp(length, length * (count - i));
            pixels.try_reserve_exact(more).map_err(|_| {
                Refused::new(format!("memory for {count} lines of {length} pixels"), "too little")
            })?;
        }
        pixels.extend(line.iter().map(|pixel| radiance(*pixel, factors)));
    }
    Ok(pixels)
}

/// The value of a pixel: mantissas over 256 times a power of two.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of a map")]
fn radiance([r, g, b, exponent]: [u8; 4], factors: [f64; 3]) -> [f32; 3] {
    if exponent == 0 {
        return [0.0; 3];
    }
    let scale = f64::from(i32::from(exponent) - 136).exp2();
    let channel = |c: usize, mantissa: u8| (f64::from(mantissa) * scale * factors[c]) as f32;
    [channel(0, r), channel(1, g), channel(2, b)]
}

/// Decodes one line of any of the three kinds. The error is what was expected.
fn decode_line(rest: &mut &[u8], length: usize, line: &mut Vec<[u8; 4]>) -> Result<(), &'static str> {
    line.clear();
    if let [2, 2, high @ 0..=127, low, after @ ..] = *rest
        && LINE_LENGTHS.contains(&length)
    {
        if usize::from(*high) << 8 | usize::from(*low) != length {
            return Err("lines of the width of the picture");
        }
        *rest = after;
        line.resize(length, [0; 4]);
        return decode_channels(rest, line).ok_or("whole runs of each channel");
    }
    decode_pixels(rest, length, line).ok_or("whole pixels or runs of them")
}

/// Run lengths of each channel.
fn decode_channels(rest: &mut &[u8], line: &mut [[u8; 4]]) -> Option<()> {
    for channel in 0..4 {
        let mut x = 0;
        while x < line.len() {
            let (&code, after) = rest.split_first()?;
            *rest = after;
            let count = usize::from(if code > 128 { code - 128 } else { code });
            let run = line.get_mut(x..x + count).filter(|run| !run.is_empty())?;
            if code > 128 {
                let (&value, after) = rest.split_first()?;
                *rest = after;
                run.iter_mut().for_each(|pixel| pixel[channel] = value);
            } else {
                let (values, after) = rest.split_at_checked(count)?;
                *rest = after;
                run.iter_mut().zip(values).for_each(|(pixel, value)| pixel[channel] = *value);
            }
            x += count;
        }
    }
    Some(())
}

/// Pixel after pixel; the pixel 1, 1, 1 repeats the one before, and several such are the digits of one count.
fn decode_pixels(rest: &mut &[u8], length: usize, line: &mut Vec<[u8; 4]>) -> Option<()> {
    let mut shift = 0;
    while line.len() < length {
        let (&pixel, after) = rest.split_first_chunk::<4>()?;
        *rest = after;
        if let [1, 1, 1, digit] = pixel {
            let count = usize::from(digit).checked_shl(shift)?;
            let last = *line.last()?;
            if count > length - line.len() {
                return None;
            }
            line.resize(line.len() + count, last);
            shift += 8;
        } else {
            line.push(pixel);
            shift = 0;
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of 9 x 4 pixels, each of which says where it is.
    fn picture(head: &str, size: &str, order: impl Fn(usize) -> [u8; 2]) -> Vec<u8> {
        let pixels: Vec<u8> = (0..36)
            .flat_map(|i| {
                let [x, y] = order(i);
                [x + 1, y + 1, 5, 136]
            })
            .collect();
        [format!("#?RGBE\n{head}FORMAT=32-bit_rle_rgbe\n\n{size}\n").as_bytes(), &pixels].concat()
    }

    fn pixels(bytes: &[u8]) -> Raster<[f32; 3]> {
        decode(bytes).map_err(|refused| format!("{} {}", refused.expected, refused.found)).unwrap().raster
    }

    #[expect(clippy::cast_possible_truncation, reason = "below 36")]
    fn rows(i: usize) -> [u8; 2] {
        [(i % 9) as u8, (i / 9) as u8]
    }

    #[expect(clippy::cast_possible_truncation, reason = "below 36")]
    fn columns(i: usize) -> [u8; 2] {
        [(i / 4) as u8, (i % 4) as u8]
    }

    #[test]
    fn all_orientations_are_the_same_picture() {
        let expected = Raster::from_fn(9, 4, |x, y| [x as f32 + 1.0, y as f32 + 1.0, 5.0]);
        let flipped = |[x, y]: [u8; 2], right: bool, bottom: bool| {
            [if right { 8 - x } else { x }, if bottom { 3 - y } else { y }]
        };
        for (sign_x, right) in [("+", false), ("-", true)] {
            for (sign_y, bottom) in [("-", false), ("+", true)] {
                let by_rows =
                    picture("", &format!("{sign_y}Y 4 {sign_x}X 9"), |i| flipped(rows(i), right, bottom));
                assert_eq!(pixels(&by_rows), expected, "{sign_y}Y {sign_x}X");
                let by_columns =
                    picture("", &format!("{sign_x}X 9 {sign_y}Y 4"), |i| flipped(columns(i), right, bottom));
                assert_eq!(pixels(&by_columns), expected, "{sign_x}X {sign_y}Y");
            }
        }
    }

    #[test]
    fn factors_of_the_header_are_divided_out() {
        let plain = pixels(&picture("", "-Y 4 +X 9", rows));
        let head = "SOFTWARE=x = y\r\nEXPOSURE=4\nEXPOSURE= 0.5\nCOLORCORR=1 2 0.25\n";
        let found = pixels(&picture(head, "-Y 4 +X 9", rows));
        assert_eq!(found, plain.map(|[r, g, b]| [r / 2.0, g / 4.0, b * 2.0]));
        for head in ["EXPOSURE=0\n", "EXPOSURE=x\n", "COLORCORR=1 2\n", "PRIMARIES=1\n", "FORMAT=jpeg\n"] {
            assert!(decode(&picture(head, "-Y 4 +X 9", rows)).is_err(), "{head}");
        }
    }

    #[test]
    fn white_of_xyz_and_of_other_primaries_is_white() {
        let white = |head: &str, pixel: [u8; 4]| {
            let head = format!("#?RADIANCE\n{head}\n\n-Y 1 +X 1\n");
            *pixels(&[head.as_bytes(), &pixel].concat()).at(0, 0)
        };
        let d65 = white("FORMAT=32-bit_rle_xyze", [238, 250, 255, 129]);
        assert!(d65.iter().all(|x| (x / d65[1] - 1.0).abs() < 0.08), "{d65:?}");
        let grey = white("PRIMARIES=0.64 0.33 0.29 0.60 0.15 0.06 0.3333 0.3333", [128, 128, 128, 129]);
        assert!(grey.iter().all(|x| (x - 1.0).abs() < 1e-4), "{grey:?}");
    }

    #[test]
    fn runs_of_all_kinds_agree_with_another_encoder() {
        let source: Vec<[f32; 3]> =
            (0..40 * 20).map(|i| [(i / 7 % 5) as f32, (i % 40) as f32, 0.25]).collect();
        let rgb: Vec<_> = source.iter().map(|&p| image::Rgb(p)).collect();
        let mut bytes = Vec::new();
        image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&rgb, 40, 20).unwrap();
        let expected =
            image::load_from_memory_with_format(&bytes, image::ImageFormat::Hdr).unwrap().into_rgb32f();
        let found = pixels(&bytes);
        assert!(found.pixels().iter().zip(expected.pixels()).all(|(a, b)| *a == b.0));
        // 300 equal pixels as a run of 44 + 256 after one pixel.
        let old = [&b"#?RADIANCE\n\n-Y 1 +X 301\n"[..], &[9, 8, 7, 136, 1, 1, 1, 44, 1, 1, 1, 1]].concat();
        assert!(pixels(&old).pixels().iter().all(|p| *p == [9.0, 8.0, 7.0]));
    }

    #[test]
    fn cut_files_and_wrong_sizes_are_refused() {
        let whole = picture("", "-Y 4 +X 9", rows);
        for length in 2..whole.len() {
            assert!(decode(&whole[..length]).is_err(), "{length}");
        }
        for size in ["-Y 4", "-Y 4 +Y 9", "-Y 0 +X 9", "-Y -4 +X 9", "-Y 99999999999999999999 +X 1", "4 9"] {
            assert!(decode(&picture("", size, rows)).is_err(), "{size}");
        }
        let long = [&b"#?RADIANCE\n\n-Y 1 +X 9\n"[..], &[2, 2, 0, 8, 1, 1]].concat();
        assert!(decode(&long).is_err());
    }
}
