//! Baked tables as `OpenEXR`.
//!
//! The file has one part (layer) per quantity, for example `mean` and `sigma`. Each is an image of 180 x 8100
//! pixels in f32 with `x = i_phi_d` and `y = i_theta_d + 90 i_theta_h`, which is the order of
//! [`cell_index`](crate::brdf::cell_index). The attribute `comments` of a part says what it holds, `unit`
//! gives its unit and `layout` the meaning of `x` and `y`.
//!
//! Parts are written uncompressed. Mean (RGB) and sigma (one channel), 23.7 MB, then take 28 ms on two cores,
//! against 134 ms with RLE (no smaller) and 1040 ms with ZIP16 (18.1 MB): the low bits of measured f32 values
//! cannot be compressed.

use crate::formats::format::{Format, Reader};
use crate::formats::source::Content;
use std::collections::HashMap;
use std::io::{self, BufReader, Read, Seek, Write};
use std::path::Path;

use exr::block::chunk::Chunk;
use exr::block::reader::ChunksReader;
use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::compression::Compression;
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, ChannelDescription, LineOrder, SampleType, Text};
use exr::meta::header::{Header, LayerAttributes};
use exr::prelude::f16;

use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::brdf::table::{BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H};
use crate::formats::exr::blocks::largest_block;
use crate::formats::read::{NotFinite, open};

/// A baked table as `OpenEXR`.
pub(crate) const FORMAT: Format = Format {
    name: "OpenEXR table",
    file: "table EXR",
    recognises: |head| head.bytes.starts_with(super::MAGIC),
    read: Reader::File(|path| Ok(Content::Table(read_table_exr(path)?))),
};

const WIDTH: usize = N_PHI_D;
const HEIGHT: usize = N_THETA_D * N_THETA_H;

/// Limit on the number of blocks, far above that of any sensible file of this kind.
const MAX_BLOCKS: usize = 1 << 20;

/// The largest block in bytes: nearly three whole tables of three channels in `f32`.
const MAX_BLOCK_BYTES: usize = 48 << 20;

/// The values of one part in MERL order, one per cell of a table.
#[derive(Clone, Copy, Debug)]
pub enum ExrChannels<'a> {
    /// Channels `R`, `G`, `B`.
    Rgb(&'a [[f32; 3]]),
    /// The single channel `Y`.
    Luminance(&'a [f32]),
}

/// One part of an `OpenEXR` file.
#[derive(Clone, Copy, Debug)]
pub struct ExrPart<'a> {
    /// Name of the part, for example `mean`. No two parts of a file have the same name.
    pub name: &'a str,
    /// What the part holds, for people.
    pub description: &'a str,
    /// Unit of the values, for example `sr^-1`.
    pub unit: &'a str,
    /// The values.
    pub channels: ExrChannels<'a>,
}

impl ExrChannels<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Rgb(values) => values.len(),
            Self::Luminance(values) => values.len(),
        }
    }

    /// The bytes of one image row, channel by channel in alphabetical order (B, G, R).
    fn row(&self, y: usize) -> Vec<u8> {
        let cells = y * WIDTH..(y + 1) * WIDTH;
        match self {
            Self::Rgb(values) => {
                let mut row = Vec::with_capacity(12 * WIDTH);
                for channel in [2, 1, 0] {
                    row.extend(values[cells.clone()].iter().flat_map(|rgb| rgb[channel].to_ne_bytes()));
                }
                row
            }
            Self::Luminance(values) => values[cells].iter().flat_map(|value| value.to_ne_bytes()).collect(),
        }
    }
}

/// Writes quantities of a table as the parts of an `OpenEXR` file.
///
/// # Errors
/// [`Error::Io`] when the file cannot be written, there is no part, two parts have the same name, or a part
/// does not have 1,458,000 values; no part of the file is left then.
pub fn write_table_exr(path: impl AsRef<Path>, parts: &[ExrPart<'_>]) -> Result<()> {
    let mut file = AtomicFile::create(path.as_ref())?;
    write_table_exr_to(&mut file, parts).map_err(|source| Error::write(path.as_ref(), source))?;
    file.commit()
}

/// Like [`write_table_exr`], but writes to any writer, row by row. `to` should be buffered.
///
/// # Errors
/// Any error of `to`, or [`io::ErrorKind::InvalidInput`] if the parts are not as described there.
pub fn write_table_exr_to(to: impl Write + Seek, parts: &[ExrPart<'_>]) -> io::Result<()> {
    let unfit = |what: String| io::Error::new(io::ErrorKind::InvalidInput, what);
    if parts.is_empty() {
        return Err(unfit("expected at least one part, found none".to_owned()));
    }
    for (index, part) in parts.iter().enumerate() {
        if part.channels.len() != N_CELLS {
            let found = part.channels.len();
            return Err(unfit(format!("part `{}`: expected {N_CELLS} values, found {found}", part.name)));
        }
        if part.name.is_empty() || parts[..index].iter().any(|other| other.name == part.name) {
            return Err(unfit(format!("expected distinct names of parts, found `{}` again", part.name)));
        }
    }
    exr::block::write(to, parts.iter().map(header).collect(), true, |meta, writer| {
        for (layer, part) in parts.iter().enumerate() {
            for y in 0..HEIGHT {
                let index = BlockIndex {
                    layer,
                    pixel_position: Vec2(0, y),
                    pixel_size: Vec2(WIDTH, 1),
                    level: Vec2(0, 0),
                };
                let block = UncompressedBlock { index, data: part.channels.row(y) };
                writer.write_chunk(y, block.compress_to_chunk(&meta.headers)?)?;
            }
        }
        Ok(())
    })
    .map_err(into_io)
}

/// The header of a part.
fn header(part: &ExrPart<'_>) -> Header {
    let names: &[&str] = match part.channels {
        ExrChannels::Rgb(_) => &["B", "G", "R"],
        ExrChannels::Luminance(_) => &["Y"],
    };
    let channels = names.iter().map(|&name| ChannelDescription::named(name, SampleType::F32)).collect();
    let attributes = LayerAttributes {
        comments: Some(text(part.description)),
        software_name: Some(text(concat!("gpbrdf ", env!("CARGO_PKG_VERSION")))),
        other: one_attribute("unit", part.unit),
        ..LayerAttributes::named(text(part.name))
    };
    let mut header = Header::new(text(part.name), (WIDTH, HEIGHT), channels)
        .with_encoding(Compression::Uncompressed, BlockDescription::ScanLines, LineOrder::Increasing)
        .with_attributes(attributes);
    header.shared_attributes.other = one_attribute(
        "layout",
        "x = phi_d cell of 180 over [0, pi); y = theta_d cell + 90 theta_h cell, theta_d cell of 90 \
         over [0, pi/2], theta_h cell = floor(90 sqrt(theta_h / (pi/2)))",
    );
    header
}

/// A map of one attribute. With two in it, the order in which they are written would change from run to run.
fn one_attribute(name: &str, value: &str) -> HashMap<Text, AttributeValue> {
    HashMap::from([(text(name), AttributeValue::Text(text(value)))])
}

/// `string` in the one-byte characters of `OpenEXR`; others become `?`.
fn text(string: &str) -> Text {
    let latin: String = string.chars().map(|c| if u8::try_from(c).is_ok() { c } else { '?' }).collect();
    Text::new_or_none(latin).unwrap_or_default()
}

fn into_io(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(error) => error,
        other => io::Error::new(io::ErrorKind::InvalidData, other.to_string()),
    }
}

/// Reads a table: the part called `mean`, else the first part with channels `R`, `G`, `B`.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read; [`Error::Format`] when it is damaged, has no RGB part, the
/// part is not an image of 180 x 8100 floating-point pixels, or a value is not finite.
pub fn read_table_exr(path: impl AsRef<Path>) -> Result<BrdfTable> {
    let path = path.as_ref();
    let (file, _) = open(path)?;
    read(BufReader::with_capacity(1 << 18, file), path)
}

/// Whether a file is `OpenEXR` and has a part of the size of a table, as pictures do not.
#[must_use]
pub fn is_table_exr(path: impl AsRef<Path>) -> bool {
    let Ok((file, Some(_))) = open(path.as_ref()) else { return false };
    let reader = exr::block::read(BufReader::new(file), false);
    reader.is_ok_and(|reader| reader.headers().iter().any(|header| header.layer_size == Vec2(WIDTH, HEIGHT)))
}

fn read(from: impl Read + Seek, path: &Path) -> Result<BrdfTable> {
    let wrong = |expected: &str, found: String| Error::Format {
        format: "OpenEXR",
        path: path.to_owned(),
        expected: expected.to_owned(),
        found,
    };
    let damaged = |error: exr::error::Error| match error {
        exr::error::Error::Io(source) => Error::read(path, source),
        other => wrong("a whole OpenEXR file", other.to_string()),
    };
    let reader = exr::block::read(from, true).map_err(damaged)?;

    let headers = reader.headers();
    if let Some(header) = headers.iter().find(|header| header.chunk_count > MAX_BLOCKS) {
        return Err(wrong(
            "an image of 180 x 8100 pixels",
            format!("a part of {} blocks", header.chunk_count),
        ));
    }
    let block = largest_block(headers);
    if block > MAX_BLOCK_BYTES {
        return Err(wrong("blocks of at most 48 MiB", format!("one of {block} bytes")));
    }
    let named = |header: &&(usize, [usize; 3])| {
        headers[header.0].own_attributes.layer_name.as_ref().is_some_and(|name| name.eq("mean"))
    };
    let candidates: Vec<_> = headers
        .iter()
        .enumerate()
        .filter_map(|(index, header)| Some((index, rgb_channels(header)?)))
        .collect();
    let Some(&(layer, channels)) = candidates.iter().find(named).or(candidates.first()) else {
        let names: Vec<_> = headers
            .iter()
            .flat_map(|header| header.channels.list.iter().map(|channel| channel.name.to_string()))
            .take(20)
            .collect();
        return Err(wrong(
            "a part with the floating-point channels R, G and B",
            format!("channels {}", names.join(", ")),
        ));
    };
    let header = headers[layer].clone();
    let Vec2(width, height) = header.layer_size;
    if (width, height) != (WIDTH, HEIGHT) {
        return Err(wrong("an image of 180 x 8100 pixels", format!("{width} x {height}")));
    }

    let mut values = vec![[0.0f32; 3]; N_CELLS];
    let mut filled = 0;
    let chunks = reader
        .filter_chunks(true, |meta, _, block| {
            let wanted = block.layer == layer && block.level == Vec2(0, 0);
            // The last rows of the other parts are read only to check that the file is whole.
            let end = block.pixel_position.y() + block.pixel_size.y();
            wanted || end >= meta.headers[block.layer].layer_size.y()
        })
        .map_err(damaged)?;
    let meta = chunks.meta_data().clone();
    for chunk in chunks {
        let chunk: Chunk = chunk.map_err(damaged)?;
        if chunk.layer_index != layer {
            continue;
        }
        let block = UncompressedBlock::decompress_chunk(chunk, &meta, true).map_err(damaged)?;
        if block.index.layer != layer || block.index.level != Vec2(0, 0) {
            return Err(wrong("blocks where the offset table says", "others".to_owned()));
        }
        for line in block.lines(&header.channels) {
            let Some(channel) = channels.iter().position(|&index| index == line.location.channel) else {
                continue;
            };
            let Vec2(x, y) = line.location.position;
            let start = y * WIDTH + x;
            let Some(cells) = values.get_mut(start..start + line.location.sample_count) else {
                return Err(wrong("blocks within the image", format!("one at ({x}, {y})")));
            };
            match header.channels.list[line.location.channel].sample_type {
                SampleType::F32 => {
                    for (cell, raw) in cells.iter_mut().zip(line.value.as_chunks::<4>().0) {
                        cell[channel] = f32::from_ne_bytes(*raw);
                    }
                }
                _ => {
                    for (cell, raw) in cells.iter_mut().zip(line.value.as_chunks::<2>().0) {
                        cell[channel] = f16::from_ne_bytes(*raw).to_f32();
                    }
                }
            }
            filled += line.location.sample_count;
        }
    }
    if filled != 3 * N_CELLS {
        return Err(wrong("every pixel once", format!("{filled} of {} values", 3 * N_CELLS)));
    }
    let mut not_finite = NotFinite::default();
    for channel in 0..3 {
        not_finite.count_slice(values.iter().map(|rgb| rgb[channel]), 0, channel);
    }
    if let Some(found) = not_finite.found() {
        return Err(wrong("finite numbers", found));
    }
    BrdfTable::from_values(values)
}

/// The places of R, G and B among the channels of a part, if it has all three as floating-point images at
/// full resolution.
fn rgb_channels(header: &Header) -> Option<[usize; 3]> {
    let place = |name: &str| {
        header.channels.list.iter().position(|channel| {
            channel.name.eq(name) && channel.sample_type != SampleType::U32 && channel.sampling == Vec2(1, 1)
        })
    };
    let whole = !header.deep && header.channels.list.iter().all(|channel| channel.sampling == Vec2(1, 1));
    if whole { Some([place("R")?, place("G")?, place("B")?]) } else { None }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::brdf::table::cell_index;
    use crate::formats::exr::blocks::with_tile_width;
    use crate::formats::mutate::mutations;

    fn table() -> BrdfTable {
        BrdfTable::from_fn(|a| [a.theta_h, -a.theta_d, 1e-40 + a.phi_d])
    }

    fn encode(parts: &[ExrPart<'_>]) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        write_table_exr_to(&mut bytes, parts).unwrap();
        bytes.into_inner()
    }

    fn part<'a>(name: &'a str, channels: ExrChannels<'a>) -> ExrPart<'a> {
        ExrPart { name, description: "a test – \u{3c3}", unit: "sr^-1", channels }
    }

    fn decode(bytes: &[u8]) -> Result<BrdfTable> {
        read(Cursor::new(bytes), Path::new("x.exr"))
    }

    fn message(bytes: &[u8]) -> String {
        decode(bytes).unwrap_err().to_string()
    }

    /// The file is read by the library's own high-level reader, with names, positions and attributes.
    #[test]
    fn other_readers_find_the_parts() {
        use exr::prelude::{FlatSamples, ReadChannels, ReadLayers};
        let table = table();
        let sigma: Vec<f32> = (0..N_CELLS).map(|k| k as f32).collect();
        let parts =
            [part("mean", ExrChannels::Rgb(table.values())), part("sigma", ExrChannels::Luminance(&sigma))];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.exr");
        write_table_exr(&path, &parts).unwrap();
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_file(&path)
            .unwrap();
        assert_eq!(image.layer_data.len(), 2);
        for (layer, (name, channels)) in
            image.layer_data.iter().zip([("mean", &["B", "G", "R"][..]), ("sigma", &["Y"])])
        {
            assert!(layer.attributes.layer_name.as_ref().unwrap().eq(name));
            assert!(layer.attributes.comments.as_ref().unwrap().to_string().starts_with("a test"));
            assert!(layer.attributes.other.contains_key(&text("unit")));
            assert_eq!(layer.size, Vec2(180, 8100));
            let found: Vec<_> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
            assert_eq!(found, channels);
        }
        let at = Vec2(17, 5 + 90 * 33).flat_index_for_size(Vec2(180, 8100));
        let FlatSamples::F32(red) = &image.layer_data[0].channel_data.list[2].sample_data else { panic!() };
        assert_eq!(red[at], table.cell(33, 5, 17)[0]);
        let FlatSamples::F32(y) = &image.layer_data[1].channel_data.list[0].sample_data else { panic!() };
        assert_eq!(y[at], cell_index(33, 5, 17) as f32);
        assert_eq!(read_table_exr(&path).unwrap(), table);
        assert_eq!(crate::formats::recognise(&path).unwrap(), &FORMAT);
    }

    #[test]
    fn the_mean_is_read_else_the_first_rgb_part() {
        let (first, second) = (table(), BrdfTable::from_fn(|_| [1.0, 2.0, 3.0]));
        let y = vec![0.0; N_CELLS];
        let sigma = part("sigma", ExrChannels::Luminance(&y));
        let truth = part("truth", ExrChannels::Rgb(first.values()));
        let mean = part("mean", ExrChannels::Rgb(second.values()));
        assert_eq!(decode(&encode(&[sigma, truth, mean])).unwrap(), second);
        assert_eq!(decode(&encode(&[sigma, truth])).unwrap(), first);
        assert!(message(&encode(&[sigma])).ends_with("channels R, G and B, found channels Y"));
    }

    /// Other programs write half floats and compressed tiles.
    #[test]
    fn other_encodings_are_read() {
        use exr::prelude::{Encoding, Image, Layer, SpecificChannels, WritableImage};
        let write = |size: (usize, usize)| {
            let channels = SpecificChannels::rgb(|Vec2(x, y)| {
                (f16::from_f32(x as f32), f16::from_f32((y / 4) as f32), 0.5f32)
            });
            let layer = Layer::new(size, LayerAttributes::named("any"), Encoding::FAST_LOSSLESS, channels);
            let mut bytes = Cursor::new(Vec::new());
            Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
            bytes.into_inner()
        };
        let found = decode(&write((WIDTH, HEIGHT))).unwrap();
        assert_eq!(found.cell(3, 7, 11), [11.0, ((7 + 90 * 3) / 4) as f32, 0.5]);
        let large = message(&with_tile_width(&write((WIDTH, HEIGHT)), 1 << 25));
        assert!(large.contains("expected blocks of at most 48 MiB, found one of "), "{large}");
        let wrong = message(&write((64, 32)));
        assert!(wrong.ends_with("expected an image of 180 x 8100 pixels, found 64 x 32"), "{wrong}");
    }

    #[test]
    fn unfit_parts_and_values_are_refused() {
        let values = vec![[0.0f32; 3]; N_CELLS];
        let mean = part("mean", ExrChannels::Rgb(&values));
        let mut sink = Cursor::new(Vec::new());
        for parts in [&[][..], &[mean, mean], &[part("mean", ExrChannels::Rgb(&values[1..]))]] {
            assert!(write_table_exr_to(&mut sink, parts).is_err());
        }
        let mut values = values;
        values[182][1] = f32::NAN;
        let found = message(&encode(&[part("mean", ExrChannels::Rgb(&values))]));
        assert!(found.contains("1 value that is not, the first in channel G, theta_h 0, theta_d 1, phi_d 2"));
    }

    #[test]
    fn damaged_files_never_panic() {
        let table = table();
        let good = encode(&[part("mean", ExrChannels::Rgb(table.values()))]);
        // All structure is in the header, the offset table and the first blocks.
        let (head, rest) = good.split_at(1 << 17);
        assert!(message(head).contains("OpenEXR"));
        for bytes in mutations(&head[..1 << 12], 1 << 12, 6, 300) {
            let _ = decode(&[&bytes, &head[1 << 12..], rest].concat());
        }
        for bytes in mutations(head, 700, 7, 3000) {
            let _ = decode(&bytes);
        }
        for length in (0..1200).chain([70_000, good.len() - 1]) {
            assert!(decode(&good[..length]).is_err(), "{length}");
        }
    }
}
