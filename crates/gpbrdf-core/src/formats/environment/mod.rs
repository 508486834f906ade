//! Environment maps: Radiance `.hdr` and `OpenEXR`.

mod cube;
mod openexr;
mod primaries;
mod radiance;

use std::path::Path;

use crate::base::error::{Error, Result};
use crate::base::raster::Raster;
use crate::formats::exr;
use crate::formats::format::foreign;
use crate::formats::read::read_bytes;
use crate::judge::Environment;

/// The largest number of pixels that [`read_environment`] accepts; they take 3.2 GB.
const MAX_PIXELS: usize = 1 << 28;

/// The largest file that is read: 4 GiB.
const MAX_BYTES: u64 = 1 << 32;

/// What can be read, for messages.
const EXPECTED: &str = "a Radiance HDR or OpenEXR environment map";

/// A square map of more columns is taken for one that is not latitude-longitude.
const MAX_SQUARE: usize = 16;

/// What a reader of one format finds: the pixels, and whether the file says that they are latitude-longitude.
struct Decoded {
    raster: Raster<[f32; 3]>,
    is_lat_long: bool,
}

/// Why a file is refused: what was expected and what was found.
struct Refused {
    expected: String,
    found: String,
}

impl Refused {
    fn new(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self { expected: expected.into(), found: found.into() }
    }
}

/// Reads a latitude-longitude map of radiance; the content decides whether it is Radiance HDR or `OpenEXR`.
///
/// Radiance: signatures `#?RADIANCE` and `#?RGBE`; RGB and XYZ; run lengths of both kinds or none; all eight
/// orientations. The factors of `EXPOSURE` and `COLORCORR`, which were applied before, are divided out.
///
/// `OpenEXR`: the channels R, G and B of the first part that has them, those of the layer that is called
/// `Combined`, `RGBA` or `Beauty`, or those of the only layer; else X, Y and Z, or Y alone as grey. The data window
/// is placed in the display window; what it leaves open is black. Cube maps, which the attribute `envmap` names,
/// become latitude-longitude maps of four times as many columns as a face has.
///
/// Other primaries, which either format may name, become those of sRGB; the white becomes D65 by the adaptation
/// named after Bradford, except for CIE XYZ. Negative values become 0.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read, [`Error::UnknownFormat`] when it has neither format,
/// [`Error::Format`] when it is damaged or over 4 GiB, has more than 2^28 pixels or the shape of another projection,
/// has none of these channels, holds deep or subsampled pixels, or a value that is not finite. Sizes are checked
/// before memory is taken for them.
pub fn read_environment(path: impl AsRef<Path>) -> Result<Environment> {
    let path = path.as_ref();
    parse_environment(&read_bytes(path, "environment map", MAX_BYTES)?, path)
}

/// Like [`read_environment`], from the content of a file, which `path` names in messages.
///
/// # Errors
/// Those of [`read_environment`].
pub fn parse_environment(bytes: &[u8], path: impl AsRef<Path>) -> Result<Environment> {
    let path = path.as_ref();
    let (format, Decoded { mut raster, is_lat_long }) = decode(bytes, path)?;
    let refused = refused(format, path);
    if !is_lat_long {
        check_shape(raster.width(), raster.height()).map_err(&refused)?;
    }
    for value in raster.pixels_mut().iter_mut().flatten() {
        // `max` is not used, since it would turn NaN into 0.
        if *value < 0.0 {
            *value = 0.0;
        }
    }
    Environment::new(raster).map_err(|error| refused(Refused::new("finite radiance", error.to_string())))
}

/// Reads a picture of any shape in linear RGB, as [`read_environment`] reads maps. Values may be negative or not
/// finite.
///
/// # Errors
/// Those of [`read_environment`] but for shapes and values.
pub fn read_linear_image(path: impl AsRef<Path>) -> Result<Raster<[f32; 3]>> {
    let path = path.as_ref();
    let (_, decoded) = decode(&read_bytes(path, "picture", MAX_BYTES)?, path)?;
    Ok(decoded.raster)
}

/// The name of the format and the pixels of a file.
fn decode(bytes: &[u8], path: &Path) -> Result<(&'static str, Decoded)> {
    let (format, decoded) = if bytes.starts_with(radiance::MAGIC) {
        ("Radiance HDR", radiance::decode(bytes))
    } else if bytes.starts_with(exr::MAGIC) {
        ("OpenEXR", openexr::decode(bytes))
    } else {
        return Err(Error::UnknownFormat {
            path: path.to_owned(),
            expected: EXPECTED.to_owned(),
            found: describe(bytes),
        });
    };
    Ok((format, decoded.map_err(refused(format, path))?))
}

/// Turns what is wrong into an error about a file.
fn refused(format: &'static str, path: &Path) -> impl Fn(Refused) -> Error {
    move |Refused { expected, found }| Error::Format { format, path: path.to_owned(), expected, found }
}

/// Whether a file that starts like this may be an environment map. An `OpenEXR` file may hold a table as well.
#[must_use]
pub fn is_environment(head: &[u8]) -> bool {
    head.starts_with(radiance::MAGIC) || head.starts_with(exr::MAGIC)
}

/// What content of another format is.
fn describe(bytes: &[u8]) -> String {
    if let Some(name) = foreign(bytes) {
        let hint =
            if name.contains("image") { ", which holds no radiance; convert it to .hdr or .exr" } else { "" };
        return format!("{name}{hint}");
    }
    let shown: Vec<String> = bytes.iter().take(4).map(|byte| format!("{byte:02x}")).collect();
    format!("{} bytes starting with [{}]", bytes.len(), shown.join(" "))
}

/// Refuses numbers of pixels that memory cannot hold.
fn check_size(width: usize, height: usize) -> Result<usize, Refused> {
    let pixels = width.checked_mul(height).filter(|&pixels| (1..=MAX_PIXELS).contains(&pixels));
    pixels.ok_or_else(|| Refused::new(format!("1 to {MAX_PIXELS} pixels"), format!("{width} x {height}")))
}

/// Refuses shapes that other projections have.
fn check_shape(width: usize, height: usize) -> Result<(), Refused> {
    let is = |across: usize, down: usize| width * down == height * across;
    let kind = match () {
        () if width.max(height) <= MAX_SQUARE => return Ok(()),
        () if is(1, 1) => "an angular map or a mirror ball",
        () if is(1, 6) || is(6, 1) || is(3, 4) || is(4, 3) => "a cube map",
        () => return Ok(()),
    };
    let found = format!("{width} x {height} pixels, the shape of {kind}; convert it");
    Err(Refused::new("a latitude-longitude map, about twice as wide as high", found))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_both_kinds_are_read_back_and_others_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let pixels = [[1.0f32, 0.5, 0.25], [2.0, 4.0, 8.0], [0.0, 1.0, 0.0], [0.5, 0.5, 0.5]];
        let hdr = folder.path().join("map.dat");
        let rgb: Vec<_> = pixels.iter().map(|&p| image::Rgb(p)).collect();
        let file = std::fs::File::create(&hdr).unwrap();
        image::codecs::hdr::HdrEncoder::new(file).encode(&rgb, 2, 2).unwrap();
        let map = read_environment(&hdr).unwrap();
        assert_eq!(map.raster(), &Raster::new(2, 2, pixels.to_vec()).unwrap());

        let exr = folder.path().join("map.exr");
        ::exr::prelude::write_rgb_file(&exr, 2, 2, |x, y| {
            let [r, g, b] = pixels[2 * y + x];
            (r, g, if x == 0 && y == 1 { -1.0 } else { b })
        })
        .unwrap();
        assert_eq!(read_environment(&exr).unwrap().raster().pixels(), pixels);

        let bytes = std::fs::read(&hdr).unwrap();
        std::fs::write(&hdr, &bytes[..bytes.len() - 3]).unwrap();
        assert!(matches!(read_environment(&hdr), Err(Error::Format { .. })));
        let bytes = std::fs::read(&exr).unwrap();
        std::fs::write(&exr, &bytes[..bytes.len() / 2]).unwrap();
        assert!(matches!(read_environment(&exr), Err(Error::Format { .. })));
        ::exr::prelude::write_rgb_file(&exr, 1, 1, |_, _| (f32::NAN, 0.0, 0.0)).unwrap();
        assert!(matches!(read_environment(&exr), Err(Error::Format { .. })));
        assert!(matches!(read_environment(folder.path()), Err(Error::Io { .. })));
    }

    #[test]
    fn other_formats_and_shapes_are_refused_by_name() {
        let refused = |bytes: &[u8]| parse_environment(bytes, "a.hdr").unwrap_err().to_string();
        let message = refused(b"P6 1 1");
        assert!(message.contains("6 bytes starting with [50 36 20 31]"), "{message}");
        let message = refused(b"\xFF\xD8\xFF\xE0");
        assert!(
            message.ends_with("a JPEG image, which holds no radiance; convert it to .hdr or .exr"),
            "{message}"
        );
        let flat = |width: usize, height: usize| {
            let head = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n");
            [head.into_bytes(), [1u8, 1, 2, 128].repeat(width * height)].concat()
        };
        assert!(refused(&flat(32, 32)).contains("32 x 32 pixels, the shape of an angular map"));
        assert!(refused(&flat(8, 48)).contains("the shape of a cube map"));
        assert!(parse_environment(&flat(64, 32), "a").is_ok() && parse_environment(&flat(1, 1), "a").is_ok());
        let message = refused(b"#?RADIANCE\n\n-Y 65536 +X 65536\n");
        assert!(message.contains("1 to 268435456 pixels, found 65536 x 65536"), "{message}");
    }
}
