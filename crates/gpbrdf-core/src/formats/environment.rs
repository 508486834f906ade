//! Environment maps: Radiance `.hdr` and `OpenEXR`.

use std::io::Cursor;
use std::path::Path;

use crate::base::error::{Error, Result};
use crate::base::raster::Raster;
use crate::formats::exr;
use crate::judge::Environment;

/// The largest number of pixels that [`read_environment`] accepts; they take 3.2 GB.
const MAX_PIXELS: usize = 1 << 28;

/// Reads a Radiance `.hdr` or an `OpenEXR` file (its first layer with R, G and B); the content decides which.
/// Negative values become 0.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read, [`Error::UnknownFormat`] when it has neither format,
/// [`Error::Format`] when it is damaged, has more than 2^28 pixels, or holds a value that is not finite.
pub fn read_environment(path: impl AsRef<Path>) -> Result<Environment> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|source| Error::read(path, source))?;
    let (format, decoded) = if bytes.starts_with(b"#?") {
        ("Radiance HDR", decode_hdr(&bytes))
    } else if bytes.starts_with(exr::MAGIC) {
        ("OpenEXR", decode_exr(&bytes))
    } else {
        let shown: String = bytes.iter().take(4).map(|b| format!("{b:02x} ")).collect();
        return Err(Error::UnknownFormat {
            path: path.to_owned(),
            expected: "a Radiance HDR or OpenEXR environment map".to_owned(),
            found: format!("{} bytes starting with [{}]", bytes.len(), shown.trim_end()),
        });
    };
    let broken = |expected: &str, found: String| Error::Format {
        format,
        path: path.to_owned(),
        expected: expected.to_owned(),
        found,
    };
    let mut raster = decoded.map_err(|found| broken("a latitude-longitude map in RGB", found))?;
    for value in raster.pixels_mut().iter_mut().flatten() {
        // `max` is not used, since it would turn NaN into 0.
        if *value < 0.0 {
            *value = 0.0;
        }
    }
    Environment::new(raster).map_err(|error| broken("finite radiance", error.to_string()))
}

/// The pixels, or a description of what is wrong.
type Decoded = Result<Raster<[f32; 3]>, String>;

fn decode_hdr(bytes: &[u8]) -> Decoded {
    let image = image::ImageReader::with_format(Cursor::new(bytes), image::ImageFormat::Hdr)
        .decode()
        .map_err(|error| error.to_string())?
        .into_rgb32f();
    let (width, height) = (image.width() as usize, image.height() as usize);
    Raster::new(width, height, image.pixels().map(|p| p.0).collect()).map_err(|error| error.to_string())
}

fn decode_exr(bytes: &[u8]) -> Decoded {
    use ::exr::prelude::{ReadChannels as _, ReadLayers as _};
    let meta = ::exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false)
        .map_err(|error| error.to_string())?;
    for header in &meta.headers {
        if header.layer_size.area() > MAX_PIXELS {
            return Err(format!("{} x {} pixels", header.layer_size.width(), header.layer_size.height()));
        }
    }
    let image = ::exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.width(), vec![[0.0f32; 3]; size.area()]),
            |(width, pixels): &mut (usize, Vec<[f32; 3]>), at, (r, g, b): (f32, f32, f32)| {
                pixels[at.y() * *width + at.x()] = [r, g, b];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| error.to_string())?;
    let size = image.layer_data.size;
    let (_, pixels) = image.layer_data.channel_data.pixels;
    Raster::new(size.width(), size.height(), pixels).map_err(|error| error.to_string())
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
        std::fs::write(&hdr, b"P6 1 1").unwrap();
        let message = read_environment(&hdr).unwrap_err().to_string();
        assert!(message.contains("6 bytes starting with [50 36 20 31]"), "{message}");
        assert!(matches!(read_environment(folder.path()), Err(Error::Io { .. })));
    }
}
