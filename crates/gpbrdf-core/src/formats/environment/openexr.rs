//! Environment maps as `OpenEXR`.

use std::io::Cursor;

use ::exr::block::UncompressedBlock;
use ::exr::block::chunk::Chunk;
use ::exr::block::reader::ChunksReader as _;
use ::exr::error::Error as ExrError;
use ::exr::math::Vec2;
use ::exr::meta::attribute::{EnvironmentMap, SampleType};
use ::exr::meta::header::Header;
use ::exr::prelude::f16;
use rayon::prelude::*;

use super::primaries::{self, ToSrgb};
use super::{Decoded, Refused, check_size, cube};
use crate::base::raster::Raster;
use crate::formats::exr::blocks::largest_block;

/// Names of layers that hold the whole picture, in small letters.
const WHOLE: [&str; 5] = ["combined", "rgba", "rgb", "beauty", "color"];

/// Blocks that are decompressed at a time.
const BATCH: usize = 64;

/// Blocks that the tables of a file may name.
const MAX_BLOCKS: usize = 1 << 22;

/// Memory that a file of any size may ask for, in bytes.
const SMALL: usize = 48 << 20;

/// How many times larger than the file its pixels may be: more than any compression of the format achieves.
const MAX_RATIO: usize = 4096;

/// Names of channels that a message lists.
const LISTED: usize = 20;

/// What three channels stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Colours {
    Rgb,
    Xyz,
    Grey,
}

/// Channels of one part that make a picture.
#[derive(Clone, Debug)]
struct Layer {
    part: usize,
    /// What comes before the names of its channels.
    name: String,
    colours: Colours,
    /// Places among the channels of the part.
    channels: [usize; 3],
}

/// Reads a whole file.
pub(super) fn decode(bytes: &[u8]) -> Result<Decoded, Refused> {
    let reader = ::exr::block::read(Cursor::new(bytes), false).map_err(damaged)?;
    let headers = reader.headers().to_vec();
    let layer = choose(&headers)?;
    let header = &headers[layer.part];
    let (place, window) = windows(header)?;
    check_plausible(&headers, header, window, bytes.len())?;

    let chunks = reader
        .filter_chunks(false, |_, _, block| block.layer == layer.part && block.level == Vec2(0, 0))
        .map_err(damaged)?;
    let meta = chunks.meta_data().clone();
    let mut raster = Raster::filled(window[0], window[1], [0.0f32; 3]);
    let (mut filled, mut batch) = (0, Vec::new());
    let mut chunks = chunks.fuse();
    loop {
        let next: Option<Chunk> = chunks.next().transpose().map_err(damaged)?;
        let is_last = next.is_none();
        batch.extend(next);
        if batch.len() < BATCH && !is_last {
            continue;
        }
        let blocks: Result<Vec<UncompressedBlock>, ExrError> = std::mem::take(&mut batch)
            .into_par_iter()
            .map(|chunk| UncompressedBlock::decompress_chunk(chunk, &meta, false))
            .collect();
        for block in blocks.map_err(damaged)? {
            if block.index.layer != layer.part || block.index.level != Vec2(0, 0) {
                return Err(Refused::new("blocks where the offset table says", "others"));
            }
            filled += insert(&block, header, &layer, place, &mut raster);
        }
        if is_last {
            break;
        }
    }
    let whole = header.layer_size.area();
    if filled != 3 * whole {
        return Err(Refused::new("every pixel once", format!("{} of {whole} pixels", filled / 3)));
    }
    if let Some(matrix) = to_srgb(header, layer.colours)? {
        primaries::convert(raster.pixels_mut(), &matrix);
    }
    Ok(match header.own_attributes.environment_map {
        Some(EnvironmentMap::Cube) => Decoded { raster: cube::to_lat_long(&raster)?, is_lat_long: true },
        Some(EnvironmentMap::LatitudeLongitude) => Decoded { raster, is_lat_long: true },
        None => Decoded { raster, is_lat_long: false },
    })
}

/// Describes an error of the decoder.
#[expect(clippy::needless_pass_by_value, reason = "the shape that map_err takes")]
fn damaged(error: ExrError) -> Refused {
    let found = error.to_string();
    if found.contains("subsampling") {
        let found = "subsampled channels, as the luminance and chroma Y, RY and BY are; save it as RGB";
        return Refused::new("the channels R, G and B in full resolution", found);
    }
    Refused::new("a whole OpenEXR file", found)
}

/// The channels to read.
fn choose(headers: &[Header]) -> Result<Layer, Refused> {
    let mut layers: Vec<Layer> = Vec::new();
    for (part, header) in headers.iter().enumerate().filter(|(_, header)| !header.deep) {
        let names: Vec<String> =
            header.channels.list.iter().map(|channel| channel.name.to_string()).collect();
        let split = |name: &str| -> (String, String) {
            let (layer, channel) = name.rsplit_once('.').unwrap_or(("", name));
            (layer.to_owned(), channel.to_ascii_lowercase())
        };
        let mut prefixes: Vec<String> = names.iter().map(|name| split(name).0).collect();
        prefixes.dedup();
        for prefix in prefixes {
            let place = |wanted: [&str; 2]| {
                names.iter().position(|name| {
                    let (layer, channel) = split(name);
                    layer == prefix && wanted.contains(&channel.as_str())
                })
            };
            let three =
                |wanted: [[&str; 2]; 3]| Some([place(wanted[0])?, place(wanted[1])?, place(wanted[2])?]);
            let rgb =
                three([["r", "red"], ["g", "green"], ["b", "blue"]]).map(|places| (Colours::Rgb, places));
            let xyz = || three([["x", "x"], ["y", "y"], ["z", "z"]]).map(|places| (Colours::Xyz, places));
            let chroma = place(["ry", "by"]).is_some();
            let grey = || place(["y", "y"]).filter(|_| !chroma).map(|y| (Colours::Grey, [y; 3]));
            if let Some((colours, channels)) = rgb.or_else(xyz).or_else(grey) {
                layers.push(Layer { part, name: prefix, colours, channels });
            }
        }
    }
    let best = layers.iter().map(|layer| layer.colours).min();
    layers.retain(|layer| Some(layer.colours) == best);
    let is_whole = |layer: &&Layer| {
        let last = layer.name.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
        WHOLE.contains(&last.as_str())
    };
    let chosen = layers.iter().find(|layer| layer.name.is_empty()).or_else(|| layers.iter().find(is_whole));
    match (chosen, &layers[..]) {
        (Some(layer), _) | (None, [layer]) => Ok(layer.clone()),
        _ if headers.iter().all(|header| header.deep) => {
            Err(Refused::new("flat pixels", "deep ones; flatten them"))
        }
        _ => {
            let mut found: Vec<String> = headers
                .iter()
                .flat_map(|header| header.channels.list.iter().map(|channel| channel.name.to_string()))
                .collect();
            if found.len() > LISTED {
                found.truncate(LISTED);
                found.push("...".to_owned());
            }
            let expected = "the channels R, G and B, of one layer or of one called Combined, or Y";
            Err(Refused::new(expected, format!("channels {}", found.join(", "))))
        }
    }
}

/// Where the data window begins in the display window, which may be outside, and the size of the display window.
fn windows(header: &Header) -> Result<([i64; 2], [usize; 2]), Refused> {
    let display = header.shared_attributes.display_window;
    let data = header.own_attributes.layer_position;
    let size = [display.size.x(), display.size.y()];
    check_size(size[0], size[1])?;
    let offset = |data: i32, display: i32| i64::from(data) - i64::from(display);
    Ok(([offset(data.x(), display.position.x()), offset(data.y(), display.position.y())], size))
}

/// Refuses sizes that the file cannot hold, before memory is taken for them.
fn check_plausible(
    headers: &[Header],
    header: &Header,
    window: [usize; 2],
    length: usize,
) -> Result<(), Refused> {
    let Vec2(width, height) = header.layer_size;
    check_size(width, height)?;
    let blocks = headers.iter().map(|header| header.chunk_count).fold(0usize, usize::saturating_add);
    // Each block has an entry of eight bytes in a table.
    if blocks > MAX_BLOCKS || blocks.saturating_mul(8) > length {
        return Err(Refused::new(format!("blocks for {length} bytes"), format!("{blocks} blocks")));
    }
    let pixels = window[0].saturating_mul(window[1]).max(width.saturating_mul(height));
    let need = pixels.saturating_mul(12usize.saturating_add(header.channels.bytes_per_pixel));
    if need > SMALL.max(length.saturating_mul(MAX_RATIO)) {
        return Err(Refused::new(
            format!("pixels for {length} bytes"),
            format!("{} x {}", window[0], window[1]),
        ));
    }
    let (block, most) = (largest_block(headers), SMALL.max(need));
    if block > most {
        return Err(Refused::new(format!("blocks of at most {most} bytes"), format!("one of {block}")));
    }
    Ok(())
}

/// Copies the part of a block that is in the display window. Returns how many numbers the block has of the three
/// channels, in the window or not.
fn insert(
    block: &UncompressedBlock,
    header: &Header,
    layer: &Layer,
    place: [i64; 2],
    raster: &mut Raster<[f32; 3]>,
) -> usize {
    let (width, height) = (raster.width(), raster.height());
    let mut filled = 0;
    for line in block.lines(&header.channels) {
        let channel = line.location.channel;
        let kind = header.channels.list.get(channel).map(|channel| channel.sample_type);
        let Vec2(x, y) = line.location.position;
        for (c, _) in layer.channels.iter().enumerate().filter(|&(_, &at)| at == channel) {
            filled += line.location.sample_count;
            let row = i64::try_from(y).ok().map(|y| y + place[1]).and_then(|y| usize::try_from(y).ok());
            let Some(row) = row.filter(|&row| row < height) else { continue };
            let first = i64::try_from(x).unwrap_or(i64::MAX).saturating_add(place[0]);
            let pixels = &mut raster.pixels_mut()[row * width..][..width];
            let mut put = |k: usize, value: f32| {
                let column = first.saturating_add(i64::try_from(k).unwrap_or(i64::MAX));
                if let Some(pixel) = usize::try_from(column).ok().and_then(|column| pixels.get_mut(column)) {
                    pixel[c] = value;
                }
            };
            match kind {
                Some(SampleType::F16) => {
                    line.value.as_chunks::<2>().0.iter().enumerate().for_each(|(k, raw)| {
                        put(k, f16::from_ne_bytes(*raw).to_f32());
                    })
                }
                Some(SampleType::F32) => {
                    line.value.as_chunks::<4>().0.iter().enumerate().for_each(|(k, raw)| {
                        put(k, f32::from_ne_bytes(*raw));
                    })
                }
                #[expect(clippy::cast_precision_loss, reason = "f32 is the precision of a map")]
                _ => line.value.as_chunks::<4>().0.iter().enumerate().for_each(|(k, raw)| {
                    put(k, u32::from_ne_bytes(*raw) as f32);
                }),
            }
        }
    }
    filled
}

/// What turns the colours into linear sRGB.
fn to_srgb(header: &Header, colours: Colours) -> Result<Option<ToSrgb>, Refused> {
    match (colours, &header.shared_attributes.chromaticities) {
        (Colours::Grey, _) | (Colours::Rgb, None) => Ok(None),
        (Colours::Xyz, _) => Ok(Some(primaries::from_xyz())),
        (Colours::Rgb, Some(given)) => {
            let pairs = [given.red, given.green, given.blue, given.white];
            let pairs = pairs.map(|Vec2(x, y)| [f64::from(x), f64::from(y)]);
            primaries::from_chromaticities(pairs)
                .map_err(|found| Refused::new("primaries that span colours", found))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::exr::blocks::with_tile_width;
    use ::exr::meta::attribute::Chromaticities;
    use ::exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, IntegerBounds, Layer as ExrLayer,
        LayerAttributes, Text, WritableImage,
    };

    /// A file of one part; all channels are 4 x 2 in f32.
    fn file(
        channels: &[(&str, [f32; 8])],
        change: impl FnOnce(&mut Image<ExrLayer<AnyChannels<FlatSamples>>>),
    ) -> Vec<u8> {
        let list = channels
            .iter()
            .map(|(name, values)| AnyChannel::new(*name, FlatSamples::F32(values.to_vec())))
            .collect();
        let layer =
            ExrLayer::new((4, 2), LayerAttributes::named(""), Encoding::default(), AnyChannels::sort(list));
        let mut image = Image::from_layer(layer);
        change(&mut image);
        let mut bytes = Cursor::new(Vec::new());
        image.write().non_parallel().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    fn pixels(bytes: &[u8]) -> Raster<[f32; 3]> {
        decode(bytes).map_err(|refused| format!("{} {}", refused.expected, refused.found)).unwrap().raster
    }

    fn refused(bytes: &[u8]) -> String {
        decode(bytes)
            .err()
            .map(|refused| format!("expected {}, found {}", refused.expected, refused.found))
            .unwrap()
    }

    const RAMP: [f32; 8] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

    #[test]
    fn layers_of_common_tools_are_found() {
        let [r, g, b] = [1.0f32, 2.0, 3.0].map(|x| [x; 8]);
        for names in [
            ["R", "G", "B"],
            ["r", "g", "b"],
            ["red", "green", "blue"],
            ["ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B"],
            ["left.R", "left.G", "left.B"],
        ] {
            let bytes = file(&[(names[0], r), (names[1], g), (names[2], b), ("other.Z", r)], |_| {});
            assert_eq!(*pixels(&bytes).at(3, 1), [1.0, 2.0, 3.0], "{names:?}");
        }
        assert_eq!(*pixels(&file(&[("Y", RAMP), ("A", r)], |_| {})).at(1, 1), [5.0; 3]);
        let two = [("a.R", r), ("a.G", g), ("a.B", b), ("b.R", b), ("b.G", b), ("b.B", b)];
        let message = refused(&file(&two, |_| {}));
        assert!(message.contains("found channels a.B, a.G, a.R, b.B"), "{message}");
        let both =
            [two, [("RGBA.R", b), ("RGBA.G", g), ("RGBA.B", r), ("c.R", r), ("d.G", r), ("e.B", r)]].concat();
        assert_eq!(*pixels(&file(&both, |_| {})).at(0, 0), [3.0, 2.0, 1.0]);
        let message = refused(&file(&[("Z", r), ("N.X", r)], |_| {}));
        assert!(message.contains("found channels N.X, Z"), "{message}");
        assert!(refused(&file(&[("Y", r), ("RY", g), ("BY", b)], |_| {})).contains("channels BY, RY, Y"));
    }

    #[test]
    fn subsampled_channels_are_refused_by_name() {
        let whole = file(&[("BY", RAMP), ("RY", RAMP), ("Y", RAMP)], |_| {});
        // An entry of the list of channels: name, type, linearity, and the steps along x and y.
        for name in [&b"\0Y\0"[..], b"BY\0", b"RY\0"] {
            let mut bytes = whole.clone();
            let entry = [name, &2u32.to_le_bytes()].concat();
            let places: Vec<usize> =
                (0..bytes.len() - entry.len()).filter(|&at| bytes[at..].starts_with(&entry)).collect();
            assert_eq!(places.len(), 1, "{name:?}");
            for step in [4, 8] {
                let at = places[0] + name.len() + 4 + step;
                bytes[at..at + 4].copy_from_slice(&2u32.to_le_bytes());
            }
            let message = refused(&bytes);
            assert!(
                message.starts_with("expected the channels R, G and B in full resolution, found "),
                "{message}"
            );
            assert!(message.contains("subsampled channels") && message.contains("RY and BY"), "{message}");
        }
    }

    #[test]
    fn the_data_window_is_placed_in_the_display_window() {
        let grey = [("R", RAMP), ("G", RAMP), ("B", RAMP)];
        let moved = |position: (i32, i32), bounds: IntegerBounds| {
            pixels(&file(&grey, |image| {
                image.layer_data.attributes.layer_position = position.into();
                image.attributes.display_window = bounds;
            }))
        };
        let larger = moved((2, -1), IntegerBounds::new((0, -2), (8, 4)));
        assert_eq!((larger.width(), larger.height()), (8, 4));
        let expected = |x: usize, y: usize| {
            if (2..6).contains(&x) && (1..3).contains(&y) { RAMP[4 * (y - 1) + x - 2] } else { 0.0 }
        };
        assert_eq!(larger, Raster::from_fn(8, 4, |x, y| [expected(x, y); 3]));
        let smaller = moved((-1, 0), IntegerBounds::new((0, 1), (2, 1)));
        assert_eq!(smaller.pixels(), [[5.0; 3], [6.0; 3]]);
    }

    #[test]
    fn tiles_that_are_larger_than_pictures_are_refused_before_memory_is_taken() {
        let tiled = |image: &mut Image<ExrLayer<AnyChannels<FlatSamples>>>| {
            image.layer_data.encoding = Encoding::FAST_LOSSLESS;
        };
        let whole = file(&[("R", RAMP), ("G", RAMP), ("B", RAMP)], tiled);
        assert_eq!(*pixels(&whole).at(1, 1), [5.0; 3]);
        assert_eq!(pixels(&with_tile_width(&whole, 16384)), pixels(&whole));
        let message = refused(&with_tile_width(&whole, 1 << 25));
        assert_eq!(message, "expected blocks of at most 50331648 bytes, found one of 25769803776");
        assert!(decode(&with_tile_width(&whole, i32::MAX.cast_unsigned())).is_err());
    }

    #[test]
    fn primaries_and_cubes_are_converted() {
        let [r, g, b] = [0.952f32, 1.0, 1.089].map(|x| [x; 8]);
        let xyz = Chromaticities {
            red: Vec2(1.0, 0.0),
            green: Vec2(0.0, 1.0),
            blue: Vec2(0.0, 0.0),
            white: Vec2(1.0 / 3.0, 1.0 / 3.0),
        };
        let rgb = [("R", r), ("G", g), ("B", b)];
        let named = file(&rgb, |image| image.attributes.chromaticities = Some(xyz));
        let direct = file(&[("X", r), ("Y", g), ("Z", b)], |_| {});
        for bytes in [named, direct] {
            assert!(pixels(&bytes).at(2, 1).iter().all(|x| (x - 1.0).abs() < 0.01));
        }
        let flat = Chromaticities { red: Vec2(0.3, 0.3), green: Vec2(0.3, 0.3), ..xyz };
        let message = refused(&file(&rgb, |image| image.attributes.chromaticities = Some(flat)));
        assert!(message.contains("chromaticities"), "{message}");
        let cube =
            file(&rgb, |image| image.layer_data.attributes.environment_map = Some(EnvironmentMap::Cube));
        assert_eq!(refused(&cube), "expected a cube map, six squares below each other, found 4 x 2");
    }

    #[test]
    fn of_several_parts_the_first_with_colours_is_read_and_cut_files_are_refused() {
        let part = |name: &str, channels: &[(&'static str, [f32; 8])]| {
            let list = channels
                .iter()
                .map(|(name, values)| AnyChannel::new(*name, FlatSamples::F32(values.to_vec())))
                .collect();
            let attributes = LayerAttributes::named(Text::new_or_none(name).unwrap());
            ExrLayer::new((4, 2), attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(list))
        };
        let depth = part("depth", &[("Z", RAMP)]);
        let light = part("light", &[("R", RAMP), ("G", RAMP), ("B", RAMP)]);
        let image =
            Image::empty(::exr::prelude::ImageAttributes::new(IntegerBounds::from_dimensions((4, 2))));
        let image = image.with_layer(depth).with_layer(light);
        let mut bytes = Cursor::new(Vec::new());
        image.write().non_parallel().to_buffered(&mut bytes).unwrap();
        let bytes = bytes.into_inner();
        assert_eq!(*pixels(&bytes).at(3, 1), [7.0; 3]);
        for length in (4..bytes.len() - 1).step_by(7) {
            assert!(decode(&bytes[..length]).is_err(), "{length}");
        }
    }
}
