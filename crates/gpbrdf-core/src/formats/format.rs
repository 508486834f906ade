//! File formats, and how the format of a file is recognised.

use std::borrow::Cow;
use std::fmt::{self, Write as _};
use std::io::Read;
use std::path::Path;

use crate::base::error::{Error, Result};
use crate::formats::FORMATS;
use crate::formats::measured::Input;
use crate::formats::measured::text::comment::comment;
use crate::formats::measured::text::encoding::decode_head;
use crate::formats::read::open;
use crate::formats::source::Content;
use crate::sample::SampleSet;

/// A file format that can be read. Each format is a constant beside its reader and is listed in [`FORMATS`].
#[derive(Clone, Copy)]
pub struct Format {
    /// The kind of content, for people, for example `RGL measurement`.
    pub name: &'static str,
    /// The kind of file, for lists of what can be read, for example `RGL .bsdf`.
    pub file: &'static str,
    /// Whether a file that starts like this has the format. A damaged file is recognised as long as its start
    /// is whole; reading it then says what is wrong.
    pub(crate) recognises: fn(&Head<'_>) -> bool,
    /// Reads a file of the format.
    pub(crate) read: Reader,
}

/// How the files of a format are read.
#[derive(Clone, Copy)]
pub(crate) enum Reader {
    /// From a file.
    File(fn(&Path) -> Result<Content>),
    /// Measurements as text, from the whole content of a file. How they are read can be chosen.
    Samples(fn(Input<'_>) -> Result<SampleSet>),
}

impl PartialEq for Format {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Format {}

impl fmt::Debug for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Format").field(&self.name).finish()
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// The start of a file, as it is passed to [`Format::recognises`].
#[derive(Clone, Debug)]
pub(crate) struct Head<'a> {
    /// The first bytes.
    pub(crate) bytes: &'a [u8],
    /// Length of the whole file.
    pub(crate) length: u64,
    /// Whether the file is called `*.binary`.
    pub(crate) named_binary: bool,
    /// The bytes as text without a byte order mark, if they are text.
    pub(crate) text: Option<Cow<'a, str>>,
}

impl<'a> Head<'a> {
    fn new(bytes: &'a [u8], length: u64, named_binary: bool) -> Self {
        Self { bytes, length, named_binary, text: decode_head(bytes) }
    }

    /// The first line of the text that is not a comment.
    pub(crate) fn line(&self) -> Option<&str> {
        let text = self.text.as_deref()?;
        text.split(['\n', '\r']).map(str::trim).find(|line| !line.is_empty() && comment(line).is_none())
    }
}

/// How many bytes of a file are examined.
const HEAD_BYTES: u64 = 64 << 10;

/// Starts of files that are sometimes mistaken for a measurement, and what to call these files.
const FOREIGN: [(&[u8], &str); 22] = [
    (b"\x89PNG\r\n\x1A\n", "a PNG image"),
    (b"\xFF\xD8\xFF", "a JPEG image"),
    (b"GIF8", "a GIF image"),
    (b"II*\0", "a TIFF image"),
    (b"MM\0*", "a TIFF image"),
    (b"#?RADIANCE", "a Radiance HDR image"),
    (b"#?RGBE", "a Radiance HDR image"),
    (b"PF\n", "a PFM image"),
    (b"BM", "a BMP image"),
    (b"RIFF", "a WebP image"),
    (b"DDS ", "a DDS image"),
    (b"\xABKTX ", "a KTX image"),
    (b"glTF", "a glTF mesh"),
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

/// What content is that is often mistaken for something else.
pub(crate) fn foreign(bytes: &[u8]) -> Option<&'static str> {
    FOREIGN.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|(_, what)| *what)
}

/// Recognises the format of a file by its content.
///
/// The name is used in one case only: binary content of no known format in a file called `*.binary` is taken
/// for a MERL table.
///
/// # Errors
/// [`Error::Io`] when the file is a directory or cannot be read; [`Error::UnknownFormat`], which describes
/// the content, when it is empty or has no known format.
pub fn recognise(path: impl AsRef<Path>) -> Result<&'static Format> {
    let path = path.as_ref();
    let (file, length) = open(path)?;
    let mut head = Vec::new();
    file.take(HEAD_BYTES).read_to_end(&mut head).map_err(|source| Error::read(path, source))?;
    let length = length.unwrap_or(head.len() as u64);
    recognise_bytes(&head, length, path)
}

/// Like [`recognise`], from the first bytes of the content that `path` stands for, or more.
pub(crate) fn recognise_bytes(bytes: &[u8], length: u64, path: &Path) -> Result<&'static Format> {
    let head = &bytes[..bytes.len().min(usize::try_from(HEAD_BYTES).unwrap_or(usize::MAX))];
    let named_binary = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("binary"));
    recognise_head(&Head::new(head, length, named_binary)).map_err(|found| Error::UnknownFormat {
        path: path.to_owned(),
        expected: format!("one of {}", FORMATS.map(|format| format.file).join(", ")),
        found,
    })
}

/// Like [`recognise`], from the start of a file. The error is a description of the content.
fn recognise_head(head: &Head<'_>) -> Result<&'static Format, String> {
    if head.bytes.is_empty() {
        return Err("an empty file".to_owned());
    }
    if let Some(what) = foreign(head.bytes) {
        return Err(what.to_owned());
    }
    if let Some(found) = FORMATS.into_iter().find(|format| (format.recognises)(head)) {
        return Ok(found);
    }
    Err(match (head.text.as_deref(), head.line()) {
        (Some(text), _) if text.trim().is_empty() => "an empty text".to_owned(),
        (Some(_), None) => "nothing but comments".to_owned(),
        (Some(_), Some(line)) => {
            let start: String = line.chars().take(40).filter(|c| !c.is_control()).collect();
            format!("text starting \"{start}\"")
        }
        (None, _) => {
            let mut found = "binary data starting 0x".to_owned();
            for byte in head.bytes.iter().take(8) {
                // Writing to a string cannot fail.
                let _ = write!(found, "{byte:02x}");
            }
            found
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::measured::text::samples;
    use crate::formats::measured::{alta, astm, cornell, zemax};
    use crate::formats::{exr, merl, model, rgl};

    fn head(bytes: &[u8]) -> Result<&'static Format, String> {
        recognise_head(&Head::new(bytes, bytes.len() as u64, false))
    }

    fn dims(a: i32, b: i32, c: i32) -> Vec<u8> {
        [a, b, c].iter().flat_map(|d| d.to_le_bytes()).collect()
    }

    #[test]
    fn kinds_are_told_by_content() {
        assert_eq!(head(b"tensor_file\0\x01\0"), Ok(&rgl::FORMAT));
        assert_eq!(head(b"\x76\x2f\x31\x01\x02\0\0\0"), Ok(&exr::table::FORMAT));
        assert_eq!(head(b"\x02\0\0\0\0\0\0\0{}"), Ok(&model::FORMAT));
        assert_eq!(head(&dims(90, 90, 180)), Ok(&merl::FORMAT));
        let mut other = dims(2, 3, 4);
        assert!(head(&other).is_err());
        other.resize(12 + 24 * 24, 0);
        assert_eq!(head(&other), Ok(&merl::FORMAT));
        assert_eq!(head(b"\xEF\xBB\xBF# note\n\ntheta_i,phi_i,theta_o,phi_o,r,g,b\n"), Ok(&samples::FORMAT));
        assert_eq!(head(b"f, Theta_D_rad,phi_d_rad\n"), Ok(&samples::FORMAT));
        assert_eq!(head(b"# num wls\r\n31\r\n"), Ok(&cornell::FORMAT));
        assert_eq!(head(b"1 2 3"), Ok(&cornell::FORMAT));
        assert_eq!(head(b"# x\n# theta_i phi_i theta_o phi_o f\n1 2 3 4 5\n"), Ok(&samples::FORMAT));
        assert_eq!(head(b"\xFF\xFEt\0h\0e\0t\0a\0_\0i\0;\0f\0\n\0"), Ok(&samples::FORMAT));
        assert_eq!(head(b"#SAMPLE \"x\"\n#PARAM_IN CARTESIAN\n1 2 3 4 5 6 7\n"), Ok(&alta::FORMAT));
        assert_eq!(head(b"# x\nSource Measured\nScatterRadial 2\n"), Ok(&zemax::FORMAT));
        assert_eq!(head(b"LAB x\nVARS theta_i,phi_i,theta_s,phi_s,R,G,B\n"), Ok(&astm::FORMAT));
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
        assert_eq!(recognise_head(&Head::new(&binary, 9, true)), Ok(&merl::FORMAT));
        assert_eq!(recognise_head(&Head::new(b"GIF89a", 6, true)), Err("a GIF image".to_owned()));
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
        assert_eq!(recognise(&path).unwrap(), &merl::FORMAT);
    }

    #[test]
    fn shared_files_are_recognised() {
        let Some(data) = crate::test_data::data_dir() else { return };
        let mut counts = [0; 2];
        for (folder, extension, kind) in
            [("rgl", "bsdf", &rgl::FORMAT), ("cornell", "brdf", &cornell::FORMAT)]
        {
            for entry in std::fs::read_dir(data.join(folder)).unwrap() {
                let path = entry.unwrap().path();
                if path.extension().is_some_and(|e| e == extension) {
                    assert_eq!(recognise(&path).unwrap(), kind, "{}", path.display());
                    counts[usize::from(kind == &cornell::FORMAT)] += 1;
                }
            }
        }
        assert_eq!(counts, [17, 3]);
        let hdr = recognise(data.join("env/brown_photostudio_02_1k.hdr")).unwrap_err().to_string();
        assert!(hdr.ends_with("found a Radiance HDR image"), "{hdr}");
    }

    #[test]
    fn damaged_heads_never_panic() {
        for start in
            [&b"# num\n31\n400 410"[..], b"theta_i,phi_i", b"\x02\0\0\0\0\0\0\0{}", &dims(90, 90, 180)]
        {
            for bytes in crate::formats::mutate::mutations(start, 16, 1, 2000) {
                let _ = head(&bytes);
            }
        }
    }
}
