//! File formats, and which of them a file is.

pub(crate) mod cornell;
pub(crate) mod image_exr;
pub(crate) mod merl;
pub(crate) mod merl_names;
#[cfg(test)]
pub(crate) mod mutate;
pub(crate) mod neural_csv;
pub(crate) mod rgl;
pub(crate) mod samples_csv;
pub(crate) mod source;
pub(crate) mod spectrum;
pub(crate) mod table_exr;
mod tensor_file;

pub use cornell::read_cornell;
pub use image_exr::write_image_exr;
pub use merl::{MERL_BYTES, read_merl, write_merl, write_merl_to};
pub use merl_names::merl_material_name;
pub use neural_csv::read_neural_csv;
pub use rgl::{RglBrdf, read_rgl};
pub use samples_csv::{
    Directions, read_directions_csv, read_samples_csv, write_samples_csv, write_samples_csv_to,
};
pub use source::{Content, Source};
pub use table_exr::{ExrChannels, ExrPart, read_table_exr, write_table_exr, write_table_exr_to};

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::base::error::{Error, Result};
use crate::brdf::table::cell_indices;

/// The kinds of file that this crate reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FileKind {
    /// MERL `.binary` table.
    Merl,
    /// RGL `.bsdf` tensor file.
    Rgl,
    /// Measured samples or directions as CSV.
    SamplesCsv,
    /// Cornell `.brdf` samples.
    Cornell,
    /// Baked table as `OpenEXR`.
    TableExr,
    /// Fitted model (safetensors).
    Model,
}

impl std::fmt::Display for FileKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Merl => "MERL table",
            Self::Rgl => "RGL measurement",
            Self::SamplesCsv => "samples CSV",
            Self::Cornell => "Cornell measurement",
            Self::TableExr => "OpenEXR table",
            Self::Model => "gpbrdf model",
        })
    }
}

/// How much of a file is looked at.
const HEAD_BYTES: u64 = 64 << 10;

/// Bytes at the start of a RGL file.
const TENSOR_FILE_MAGIC: &[u8] = b"tensor_file\0";
/// Bytes at the start of an `OpenEXR` file.
const EXR_MAGIC: &[u8] = &[0x76, 0x2F, 0x31, 0x01];

/// Starts of files that are taken for a measurement by mistake.
const FOREIGN: [(&[u8], &str); 16] = [
    (b"\x89PNG\r\n\x1A\n", "a PNG image"),
    (b"\xFF\xD8\xFF", "a JPEG image"),
    (b"GIF8", "a GIF image"),
    (b"II*\0", "a TIFF image"),
    (b"MM\0*", "a TIFF image"),
    (b"#?RADIANCE", "a Radiance HDR image"),
    (b"#?RGBE", "a Radiance HDR image"),
    (b"%PDF", "a PDF document"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"\x1F\x8B", "a gzip archive"),
    (b"BZh", "a bzip2 archive"),
    (b"\xFD7zXZ\0", "an xz archive"),
    (b"\x28\xB5\x2F\xFD", "a zstd archive"),
    (b"\x7FELF", "an ELF program"),
    (b"\x93NUMPY", "a NumPy array"),
    (b"\x89HDF\r\n\x1A\n", "an HDF5 file"),
];

/// The kind of a file, by its content.
///
/// Damaged files are recognised as long as their start is whole, so that reading them says what is wrong. The
/// name counts in one case only: binary content of no known kind called `*.binary` is taken for a MERL table.
///
/// # Errors
/// [`Error::Io`] when the file is a directory or cannot be read, [`Error::UnknownFormat`] with a description of
/// the content when it is empty or of no known kind.
pub fn recognise(path: impl AsRef<Path>) -> Result<FileKind> {
    let path = path.as_ref();
    let (file, length) = open(path)?;
    let mut head = Vec::new();
    file.take(HEAD_BYTES).read_to_end(&mut head).map_err(|source| Error::read(path, source))?;
    let named_binary = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("binary"));
    let length = length.unwrap_or(head.len() as u64);
    recognise_head(&head, length, named_binary).map_err(|found| Error::UnknownFormat {
        path: path.to_owned(),
        expected: "a MERL .binary, RGL .bsdf, Cornell .brdf, samples CSV, table EXR or gpbrdf model",
        found,
    })
}

/// [`recognise`] from the first bytes and the length of the file; else a description of what it is.
fn recognise_head(head: &[u8], length: u64, named_binary: bool) -> Result<FileKind, String> {
    if head.is_empty() {
        return Err("an empty file".to_owned());
    }
    if head.starts_with(TENSOR_FILE_MAGIC) {
        return Ok(FileKind::Rgl);
    }
    if head.starts_with(EXR_MAGIC) {
        return Ok(FileKind::TableExr);
    }
    if let Some((_, what)) = FOREIGN.iter().find(|(magic, _)| head.starts_with(magic)) {
        return Err((*what).to_owned());
    }
    if head.first_chunk::<12>().is_some_and(|header| is_merl(merl::dimensions(header), length)) {
        return Ok(FileKind::Merl);
    }
    if let Some((size, b'{')) = head.first_chunk::<8>().zip(head.get(8).copied())
        && u64::from_le_bytes(*size) <= length.saturating_sub(8)
    {
        return Ok(FileKind::Model);
    }
    if let Some(text) = as_text(head) {
        return recognise_text(text);
    }
    if named_binary {
        return Ok(FileKind::Merl);
    }
    let mut found = "binary data starting 0x".to_owned();
    for byte in head.iter().take(8) {
        // Writing to a string does not fail.
        let _ = write!(found, "{byte:02x}");
    }
    Err(found)
}

/// Whether three integers at the start of a file of `length` bytes are those of a MERL-like table.
fn is_merl(dims: [i32; 3], length: u64) -> bool {
    let [a, b, c] = dims.map(|d| u64::try_from(d).unwrap_or(0));
    let plausible = [a, b, c].iter().all(|d| (1..=4096).contains(d));
    dims == [90, 90, 180] || (plausible && length == 12 + 24 * a * b * c)
}

fn recognise_text(text: &str) -> Result<FileKind, String> {
    if text.trim().is_empty() {
        return Err("an empty text".to_owned());
    }
    let content = text.lines().map(str::trim).find(|line| !line.is_empty() && !line.starts_with('#'));
    let Some(line) = content else { return Err("nothing but comments".to_owned()) };
    if samples_csv::looks_like_samples(line) {
        return Ok(FileKind::SamplesCsv);
    }
    if line.split_whitespace().all(|token| token.parse::<f64>().is_ok()) {
        return Ok(FileKind::Cornell);
    }
    let start: String = line.chars().take(40).filter(|c| !c.is_control()).collect();
    Err(format!("text starting \"{start}\""))
}

/// The start of a file as text without its byte order mark, if it is text. A character cut at the end is
/// left out.
fn as_text(head: &[u8]) -> Option<&str> {
    let text = match std::str::from_utf8(head) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => {
            std::str::from_utf8(&head[..error.valid_up_to()]).ok()?
        }
        Err(_) => return None,
    };
    let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
    let is_text = text.chars().all(|c| !c.is_control() || c.is_whitespace());
    is_text.then_some(text)
}

/// Opens `path` for reading, with its length where it is a regular file.
pub(crate) fn open(path: &Path) -> Result<(File, Option<u64>)> {
    let failed = |source| Error::read(path, source);
    let file = File::open(path).map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    if metadata.is_dir() {
        return Err(failed(io::ErrorKind::IsADirectory.into()));
    }
    Ok((file, metadata.is_file().then_some(metadata.len())))
}

/// The whole content of a file of at most `limit` bytes.
pub(crate) fn read_bytes(path: &Path, format: &'static str, limit: u64) -> Result<Vec<u8>> {
    let (file, length) = open(path)?;
    let too_large = |found: String| Error::Format {
        format,
        path: path.to_owned(),
        expected: format!("at most {limit} bytes"),
        found,
    };
    if let Some(length) = length.filter(|&length| length > limit) {
        return Err(too_large(format!("{length} bytes")));
    }
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes).map_err(|source| Error::read(path, source))?;
    if bytes.len() as u64 > limit {
        return Err(too_large("more".to_owned()));
    }
    Ok(bytes)
}

/// Counts values that are not finite in a table, and remembers where the first stands.
#[derive(Debug, Default)]
pub(crate) struct NotFinite {
    count: usize,
    first: Option<(usize, usize)>,
}

impl NotFinite {
    /// Counts in the values of one channel from cell `start` on.
    pub(crate) fn count_slice(&mut self, values: impl Iterator<Item = f32>, start: usize, channel: usize) {
        for (offset, value) in values.enumerate() {
            if !value.is_finite() {
                self.count += 1;
                self.first.get_or_insert((start + offset, channel));
            }
        }
    }

    /// What was found, in words; `None` where all values are finite.
    pub(crate) fn found(&self) -> Option<String> {
        let (cell, channel) = self.first?;
        let (h, d, p) = cell_indices(cell);
        let name = ["R", "G", "B"].get(channel).copied().unwrap_or("Y");
        Some(format!(
            "{} value{} that {} not, the first in channel {name}, theta_h {h}, theta_d {d}, phi_d {p}",
            self.count,
            if self.count == 1 { "" } else { "s" },
            if self.count == 1 { "is" } else { "are" },
        ))
    }

    /// An error of kind [`io::ErrorKind::InvalidData`] unless all values of a table are finite.
    pub(crate) fn check(values: &[[f32; 3]]) -> io::Result<()> {
        if values.as_flattened().iter().all(|value| value.is_finite()) {
            return Ok(());
        }
        let mut found = Self::default();
        for channel in 0..3 {
            found.count_slice(values.iter().map(|rgb| rgb[channel]), 0, channel);
        }
        let found = found.found().unwrap_or_default();
        Err(io::Error::new(io::ErrorKind::InvalidData, format!("expected finite values, found {found}")))
    }
}

/// The SHA-256 sum of `bytes`, in lower-case hexadecimal.
#[must_use]
pub fn sha256_hex(bytes: &[u8]) -> String {
    hex(Sha256::digest(bytes).as_slice())
}

/// The SHA-256 sum of a file, in lower-case hexadecimal. Streams the file.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read.
pub fn sha256_file(path: impl AsRef<Path>) -> Result<String> {
    let path = path.as_ref();
    let (mut file, _) = open(path)?;
    let mut digest = Sha256::new();
    let mut bytes = vec![0; 1 << 18];
    loop {
        match file.read(&mut bytes) {
            Ok(0) => return Ok(hex(digest.finalize().as_slice())),
            Ok(count) => digest.update(&bytes[..count]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(source) => return Err(Error::read(path, source)),
        }
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string does not fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(bytes: &[u8]) -> Result<FileKind, String> {
        recognise_head(bytes, bytes.len() as u64, false)
    }

    fn dims(a: i32, b: i32, c: i32) -> Vec<u8> {
        [a, b, c].iter().flat_map(|d| d.to_le_bytes()).collect()
    }

    #[test]
    fn kinds_are_told_by_content() {
        assert_eq!(head(b"tensor_file\0\x01\0"), Ok(FileKind::Rgl));
        assert_eq!(head(b"\x76\x2f\x31\x01\x02\0\0\0"), Ok(FileKind::TableExr));
        assert_eq!(head(b"\x02\0\0\0\0\0\0\0{}"), Ok(FileKind::Model));
        assert_eq!(head(&dims(90, 90, 180)), Ok(FileKind::Merl));
        let mut other = dims(2, 3, 4);
        assert!(head(&other).is_err());
        other.resize(12 + 24 * 24, 0);
        assert_eq!(head(&other), Ok(FileKind::Merl));
        assert_eq!(
            head(b"\xEF\xBB\xBF# note\n\ntheta_i,phi_i,theta_o,phi_o,r,g,b\n"),
            Ok(FileKind::SamplesCsv)
        );
        assert_eq!(head(b"f, Theta_D_rad,phi_d_rad\n"), Ok(FileKind::SamplesCsv));
        assert_eq!(head(b"# num wls\r\n31\r\n"), Ok(FileKind::Cornell));
        assert_eq!(head(b"1 2 3"), Ok(FileKind::Cornell));
    }

    #[test]
    fn other_content_is_described() {
        assert_eq!(head(b""), Err("an empty file".to_owned()));
        assert_eq!(head(b" \n\n"), Err("an empty text".to_owned()));
        assert_eq!(head(b"# only\n# this"), Err("nothing but comments".to_owned()));
        assert_eq!(head(b"\x89PNG\r\n\x1A\n..."), Err("a PNG image".to_owned()));
        assert_eq!(head(b"#?RADIANCE\n"), Err("a Radiance HDR image".to_owned()));
        assert_eq!(head(b"\n hello, world\n"), Err("text starting \"hello, world\"".to_owned()));
        assert_eq!(head(b"caf\xC3"), Err("text starting \"caf\"".to_owned()));
        let binary = [0xDE, 0xAD, 0xBE, 0xEF, 0, 1, 2, 3, 4];
        assert_eq!(head(&binary), Err("binary data starting 0xdeadbeef00010203".to_owned()));
        assert_eq!(recognise_head(&binary, 9, true), Ok(FileKind::Merl));
        assert_eq!(recognise_head(b"GIF89a", 6, true), Err("a GIF image".to_owned()));
    }

    #[test]
    fn errors_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let found = recognise(folder.path()).unwrap_err().to_string();
        assert!(found.starts_with("cannot read") && found.ends_with("is a directory"), "{found}");
        let path = folder.path().join("x.csv");
        assert!(recognise(&path).unwrap_err().to_string().contains("x.csv"));
        std::fs::write(&path, "").unwrap();
        let found = recognise(&path).unwrap_err().to_string();
        assert!(found.contains("x.csv") && found.ends_with("found an empty file"), "{found}");
        std::fs::write(&path, dims(90, 90, 180)).unwrap();
        assert_eq!(recognise(&path).unwrap(), FileKind::Merl);
    }

    #[test]
    fn shared_files_are_recognised() {
        let Some(data) = crate::test_data::data_dir() else { return };
        let mut counts = [0; 2];
        for (folder, extension, kind) in
            [("rgl", "bsdf", FileKind::Rgl), ("cornell", "brdf", FileKind::Cornell)]
        {
            for entry in std::fs::read_dir(data.join(folder)).unwrap() {
                let path = entry.unwrap().path();
                if path.extension().is_some_and(|e| e == extension) {
                    assert_eq!(recognise(&path).unwrap(), kind, "{}", path.display());
                    counts[usize::from(kind == FileKind::Cornell)] += 1;
                }
            }
        }
        assert_eq!(counts, [17, 3]);
        let hdr = recognise(data.join("env/brown_photostudio_02_1k.hdr")).unwrap_err().to_string();
        assert!(hdr.ends_with("found a Radiance HDR image"), "{hdr}");
    }

    #[test]
    fn sums_are_those_of_the_standard() {
        // FIPS 180-2, appendix B.1.
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256_hex(b"abc"), expected);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").unwrap();
        assert_eq!(sha256_file(&path).unwrap(), expected);
    }

    #[test]
    fn damaged_heads_never_panic() {
        for start in
            [&b"# num\n31\n400 410"[..], b"theta_i,phi_i", b"\x02\0\0\0\0\0\0\0{}", &dims(90, 90, 180)]
        {
            for bytes in mutate::mutations(start, 16, 1, 2000) {
                let _ = head(&bytes);
            }
        }
    }
}
