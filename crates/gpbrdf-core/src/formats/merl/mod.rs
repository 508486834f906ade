//! MERL `.binary` files.
//!
//! Layout, little-endian: three `i32` dimensions 90, 90, 180; then three planes of 1,458,000 `f64`, red,
//! green and blue, in the order of [`cell_index`](crate::brdf::cell_index). A stored value times 1/1500,
//! 1.15/1500 or 1.66/1500 is `f` in sr^-1; a negative value means that there is no data. Source: W. Matusik
//! et al., "A Data-Driven Reflectance Model" (2003), and the reader published with the database.

mod names;

pub use names::merl_material_name;

use crate::formats::format::{Format, Reader};
use crate::formats::source::Content;
use std::io::{self, Read, Write};
use std::path::Path;

use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::brdf::table::{BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H};
use crate::formats::format::Head;
use crate::formats::read::{NotFinite, open};

/// A table of the MERL database, or another one in its format.
pub(crate) const FORMAT: Format = Format {
    name: "MERL table",
    file: "MERL .binary",
    recognises,
    read: Reader::File(|path| Ok(Content::Table(read_merl(path)?))),
};

/// Size of a MERL file in bytes: 34,992,012.
pub const MERL_BYTES: u64 = 12 + 3 * 8 * N_CELLS as u64;

/// Scale of each plane, sr^-1 per stored unit.
const SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// Number of cells converted at a time: one `theta_h` slab, 130 kB of the file.
const CHUNK: usize = N_THETA_D * N_PHI_D;

/// Reads a MERL `.binary` file. Negative values, which mean that there is no data, are kept.
///
/// Streams the file: apart from the table it takes 130 kB of memory.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read; [`Error::Format`] when the dimensions are not 90 x 90 x 180,
/// the size is not 34,992,012 bytes, or a value is not a finite number.
pub fn read_merl(path: impl AsRef<Path>) -> Result<BrdfTable> {
    let path = path.as_ref();
    let (file, length) = open(path)?;
    read(file, length, path)
}

/// Like [`read_merl`], from any reader; `length` is the size if it is known beforehand.
fn read(mut from: impl Read, length: Option<u64>, path: &Path) -> Result<BrdfTable> {
    let wrong = |expected: String, found: String| Error::Format {
        format: "MERL",
        path: path.to_owned(),
        expected,
        found,
    };
    let wrong_size = |found: String| wrong(format!("{MERL_BYTES} bytes"), found);
    let truncated = |at_least: u64| {
        let found = length.filter(|&length| length < MERL_BYTES).unwrap_or(at_least);
        wrong_size(if found == 0 { "an empty file".to_owned() } else { format!("{found} bytes") })
    };

    let mut header = [0; 12];
    let got = fill(&mut from, &mut header).map_err(|source| Error::read(path, source))?;
    if got < header.len() {
        return Err(truncated(got as u64));
    }
    let dims = dimensions(&header);
    if dims != [90, 90, 180] {
        return Err(wrong(
            "dimensions 90 x 90 x 180".to_owned(),
            format!("dimensions {} x {} x {}", dims[0], dims[1], dims[2]),
        ));
    }
    if let Some(length) = length.filter(|&length| length > MERL_BYTES) {
        return Err(wrong_size(format!("{length} bytes")));
    }
    if length.is_some_and(|length| length < MERL_BYTES) {
        return Err(truncated(0));
    }

    let mut values = vec![[0.0f32; 3]; N_CELLS];
    let mut bytes = vec![0; CHUNK * 8];
    let mut not_finite = NotFinite::default();
    for (channel, scale) in SCALE.into_iter().enumerate() {
        for (slab, cells) in values.chunks_exact_mut(CHUNK).enumerate() {
            let got = fill(&mut from, &mut bytes).map_err(|source| Error::read(path, source))?;
            if got < bytes.len() {
                let before = 12 + (channel * N_CELLS + slab * CHUNK) as u64 * 8;
                return Err(truncated(before + got as u64));
            }
            let mut all_finite = true;
            for (cell, raw) in cells.iter_mut().zip(bytes.as_chunks::<8>().0) {
                #[expect(clippy::cast_possible_truncation, reason = "f32 is the table's precision")]
                let value = (f64::from_le_bytes(*raw) * scale) as f32;
                all_finite &= value.is_finite();
                cell[channel] = value;
            }
            if !all_finite {
                not_finite.count_slice(cells.iter().map(|cell| cell[channel]), slab * CHUNK, channel);
            }
        }
    }
    if let Some(found) = not_finite.found() {
        return Err(wrong("finite numbers within the range of f32".to_owned(), found));
    }
    let more = fill(&mut from, &mut bytes[..1]).map_err(|source| Error::read(path, source))?;
    if more > 0 {
        return Err(wrong_size("more".to_owned()));
    }
    BrdfTable::from_values(values)
}

/// Whether the file starts with the dimensions of a table, or is called `*.binary` and holds any binary
/// content.
fn recognises(head: &Head<'_>) -> bool {
    let header = head.bytes.first_chunk::<12>();
    header.is_some_and(|header| is_merl(dimensions(header), head.length))
        || (head.text.is_none() && head.named_binary)
}

/// Whether three integers at the start of a file of `length` bytes are the dimensions of a MERL-like table.
fn is_merl(dims: [i32; 3], length: u64) -> bool {
    let [a, b, c] = dims.map(|d| u64::try_from(d).unwrap_or(0));
    let plausible = [a, b, c].iter().all(|d| (1..=4096).contains(d));
    dims == [90, 90, 180] || (plausible && length == 12 + 24 * a * b * c)
}

/// The three dimensions at the start of a MERL file.
fn dimensions(header: &[u8; 12]) -> [i32; 3] {
    let (words, _) = header.as_chunks::<4>();
    std::array::from_fn(|k| i32::from_le_bytes(words[k]))
}

/// Reads until `buffer` is full or the source ends. Returns the number of bytes read.
fn fill(from: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match from.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

/// Writes `table` as a MERL `.binary` file of 34,992,012 bytes. [`read_merl`] reads it back equal to the bit.
///
/// # Errors
/// [`Error::Io`] when the file cannot be written or a value of the table is not finite; no part of the file
/// is left then.
pub fn write_merl(path: impl AsRef<Path>, table: &BrdfTable) -> Result<()> {
    let mut file = AtomicFile::create(path.as_ref())?;
    write_merl_to(&mut file, table).map_err(|source| Error::write(path.as_ref(), source))?;
    file.commit()
}

/// Writes `table` in MERL layout to `to`, in pieces of 130 kB.
///
/// # Errors
/// Any error of `to`, or [`io::ErrorKind::InvalidData`] before the first byte when a value is not finite.
pub fn write_merl_to(mut to: impl Write, table: &BrdfTable) -> io::Result<()> {
    NotFinite::check(table.values())?;
    for dimension in [N_THETA_H, N_THETA_D, N_PHI_D] {
        let dimension = i32::try_from(dimension).map_err(io::Error::other)?;
        to.write_all(&dimension.to_le_bytes())?;
    }
    let mut bytes = vec![0; CHUNK * 8];
    for (channel, scale) in SCALE.into_iter().enumerate() {
        for cells in table.values().chunks(CHUNK) {
            for (raw, cell) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(cells) {
                *raw = (f64::from(cell[channel]) / scale).to_le_bytes();
            }
            to.write_all(&bytes)?;
        }
    }
    to.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::mutate::Random;

    fn bits(table: &BrdfTable) -> Vec<[u32; 3]> {
        table.values().iter().map(|rgb| rgb.map(f32::to_bits)).collect()
    }

    /// Every finite f32 bit pattern is equally likely, so that values are subnormal, huge or negative, too.
    fn wild_table() -> BrdfTable {
        let mut random = Random::new(7);
        let mut values: Vec<[f32; 3]> = (0..N_CELLS)
            .map(|_| {
                std::array::from_fn(|_| {
                    let value = f32::from_bits(random.bits32());
                    if value.is_finite() { value } else { 0.25 }
                })
            })
            .collect();
        values[0] = [0.0, -0.0, f32::MIN_POSITIVE];
        values[1] = [f32::from_bits(1), f32::MAX, f32::MIN];
        values[2] = [-1.0 / 1500.0, -1.0, 1.0];
        BrdfTable::from_values(values).unwrap()
    }

    fn encode(table: &BrdfTable) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_merl_to(&mut bytes, table).unwrap();
        bytes
    }

    fn decode(bytes: &[u8]) -> Result<BrdfTable> {
        read(bytes, Some(bytes.len() as u64), Path::new("x.binary"))
    }

    fn message(bytes: &[u8]) -> String {
        decode(bytes).unwrap_err().to_string()
    }

    #[test]
    fn write_then_read_is_exact_for_every_cell() {
        let table = wild_table();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.binary");
        write_merl(&path, &table).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().len(), 34_992_012);
        assert_eq!(bits(&read_merl(&path).unwrap()), bits(&table));
    }

    #[test]
    fn layout_is_the_published_one() {
        let mut values = vec![[0.0; 3]; N_CELLS];
        values[crate::brdf::table::cell_index(3, 5, 7)] = [1.0, 1.15, 1.66];
        let bytes = encode(&BrdfTable::from_values(values).unwrap());
        assert_eq!(bytes[..12], [90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0]);
        let index = 7 + 180 * (5 + 90 * 3);
        for channel in 0..3 {
            let at = 12 + 8 * (channel * 1_458_000 + index);
            let stored = f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
            assert!((stored - 1500.0).abs() < 1e-4, "{stored}");
        }
        let stored = |at: usize| (at - 12) / 8 % 1_458_000;
        let filled: Vec<_> = (12..bytes.len()).filter(|&at| bytes[at] != 0).map(stored).collect();
        assert!(filled.iter().all(|&cell| cell == index));
    }

    #[test]
    fn wrong_files_are_named() {
        let good = encode(&BrdfTable::from_fn(|_| [0.1, 0.2, 0.3]));
        assert_eq!(
            message(&good[..1024]),
            "MERL file \"x.binary\": expected 34992012 bytes, found 1024 bytes"
        );
        assert!(message(&[]).ends_with("found an empty file"));
        assert!(message(&good[..5]).ends_with("found 5 bytes"));
        assert!(message(&[&good[..], &[0]].concat()).ends_with("found 34992013 bytes"));
        let mut wrong = good.clone();
        wrong[8..12].copy_from_slice(&360i32.to_le_bytes());
        assert!(
            message(&wrong).ends_with("expected dimensions 90 x 90 x 180, found dimensions 90 x 90 x 360")
        );
        let mut wrong = good.clone();
        for index in [180 * 90 + 181, 400_000] {
            wrong[12 + 8 * (N_CELLS + index)..][..8].copy_from_slice(&f64::NAN.to_le_bytes());
        }
        wrong[34_992_004..].copy_from_slice(&f64::INFINITY.to_le_bytes());
        let found = message(&wrong);
        assert!(found.contains("found 3 values that are not"), "{found}");
        assert!(found.contains("channel G, theta_h 1, theta_d 1, phi_d 1"), "{found}");
        // The length is not known beforehand here, as for a pipe.
        let piped = read(&good[..1024], None, Path::new("p")).unwrap_err().to_string();
        assert!(piped.ends_with("found 1024 bytes"), "{piped}");
        assert!(read(&[&good[..], &[0]].concat()[..], None, Path::new("p")).is_err());
    }

    #[test]
    fn tables_with_nan_are_not_written() {
        let mut values = vec![[0.0; 3]; N_CELLS];
        values[5][2] = f32::NAN;
        let table = BrdfTable::from_values(values).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let found = write_merl(folder.path().join("t.binary"), &table).unwrap_err().to_string();
        assert!(found.contains("channel B, theta_h 0, theta_d 0, phi_d 5"), "{found}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
