//! Plain pictures as `OpenEXR`.

use std::io::{self, Seek, Write};

use exr::prelude::{Image, SpecificChannels, WritableImage};

use crate::brdf::Rgb;

/// Writes a `width x height` picture of linear RGB, rows from top to bottom, as f32. `to` should be buffered.
///
/// # Errors
/// Any error of `to`, or [`io::ErrorKind::InvalidInput`] unless there are `width x height` pixels, at least
/// one.
pub fn write_image_exr(to: impl Write + Seek, width: usize, height: usize, pixels: &[Rgb]) -> io::Result<()> {
    if width == 0 || width.checked_mul(height) != Some(pixels.len()) || height == 0 {
        let what = format!("expected {width} x {height} pixels, at least one, found {}", pixels.len());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    }
    #[expect(clippy::cast_possible_truncation, reason = "f32 is the file's precision")]
    let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| {
        let [r, g, b] = pixels[at.y() * width + at.x()];
        (r as f32, g as f32, b as f32)
    });
    Image::from_channels((width, height), channels).write().to_buffered(to).map_err(|error| match error {
        exr::error::Error::Io(error) => error,
        other => io::Error::new(io::ErrorKind::InvalidData, other.to_string()),
    })
}

#[cfg(test)]
mod tests {
    use exr::prelude::{ReadChannels, ReadLayers};

    use super::*;

    #[test]
    fn pictures_read_back() {
        let pixels: Vec<Rgb> = (0..12).map(|i| [f64::from(i), 0.5, -1.0]).collect();
        let mut file = io::Cursor::new(Vec::new());
        write_image_exr(&mut file, 4, 3, &pixels).unwrap();
        file.set_position(0);
        let found = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(file)
            .unwrap();
        let red = found.layer_data.channel_data.list.iter().find(|c| c.name.to_string() == "R").unwrap();
        let values: Vec<f32> = red.sample_data.values_as_f32().collect();
        assert_eq!(values, (0u8..12).map(f32::from).collect::<Vec<_>>());
        assert!(write_image_exr(io::Cursor::new(Vec::new()), 5, 3, &pixels).is_err());
    }
}
