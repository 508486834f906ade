//! One function for each reader of files: it takes any bytes, and neither panics nor takes memory that the bytes do
//! not account for. Fuzzers call them (`fuzz/README.md`), and so do tests.

use std::path::Path;

use gpbrdf_core::formats::{
    ReadOptions, parse_directions_csv, parse_environment, read_merl, read_neural_csv, read_rgl,
    read_table_exr,
};
use gpbrdf_core::prior::Prior;
use gpbrdf_core::{Model, Source};

/// The function of a reader. It returns whether the bytes were accepted.
pub(crate) type Reader = fn(&[u8]) -> bool;

/// All readers by name.
pub(crate) const READERS: [(&str, Reader); 13] = [
    ("merl", merl),
    ("rgl", rgl),
    ("table_exr", table_exr),
    ("neural", neural),
    ("measured", measured),
    ("directions", directions),
    ("model", model),
    ("prior", prior),
    ("mesh", mesh),
    ("gltf", gltf),
    ("environment", environment),
    ("session", session),
    ("any", any),
];

/// What the bytes are called in messages.
const NAME: &str = "fuzzed";

/// Calls a reader that takes a file only.
fn with_file<T>(bytes: &[u8], read: impl FnOnce(&Path) -> Option<T>) -> bool {
    let Ok(mut file) = tempfile::NamedTempFile::new() else { return false };
    std::io::Write::write_all(&mut file, bytes).is_ok() && read(file.path()).is_some()
}

/// MERL tables.
pub(crate) fn merl(bytes: &[u8]) -> bool {
    with_file(bytes, |path| read_merl(path).ok())
}

/// RGL measurements.
pub(crate) fn rgl(bytes: &[u8]) -> bool {
    with_file(bytes, |path| read_rgl(path).ok())
}

/// Tables as OpenEXR.
pub(crate) fn table_exr(bytes: &[u8]) -> bool {
    with_file(bytes, |path| read_table_exr(path).ok())
}

/// Weights of neural BRDFs.
pub(crate) fn neural(bytes: &[u8]) -> bool {
    with_file(bytes, |path| read_neural_csv(path).ok())
}

/// Measurements as text: CSV and its dialects, Cornell, Zemax, ALTA and ASTM, told apart by their content.
pub(crate) fn measured(bytes: &[u8]) -> bool {
    Source::parse(bytes, NAME, &ReadOptions::default()).is_ok()
}

/// Lists of directions.
pub(crate) fn directions(bytes: &[u8]) -> bool {
    parse_directions_csv(bytes, NAME, &ReadOptions::default()).is_ok()
}

/// Fitted models.
pub(crate) fn model(bytes: &[u8]) -> bool {
    Model::from_bytes(bytes, NAME).is_ok()
}

/// Learned priors.
pub(crate) fn prior(bytes: &[u8]) -> bool {
    Prior::from_bytes(bytes, NAME).is_ok()
}

/// Wavefront OBJ meshes, and glTF ones whose bytes say so.
pub(crate) fn mesh(bytes: &[u8]) -> bool {
    gpbrdf_render::parse_mesh(bytes, NAME).is_ok()
}

/// glTF meshes: the part after the signature of a binary file is fuzzed.
pub(crate) fn gltf(bytes: &[u8]) -> bool {
    let signed = bytes.starts_with(b"glTF") || bytes.trim_ascii_start().starts_with(b"{");
    if signed { mesh(bytes) } else { mesh(&[b"glTF\x02\0\0\0", bytes].concat()) }
}

/// Environment maps, Radiance and OpenEXR.
pub(crate) fn environment(bytes: &[u8]) -> bool {
    parse_environment(bytes, NAME).is_ok()
}

/// Sessions of the viewer.
pub(crate) fn session(bytes: &[u8]) -> bool {
    gpbrdf_app::viewer::check_session(bytes, NAME).is_ok()
}

/// Whatever can be opened, told by its content.
pub(crate) fn any(bytes: &[u8]) -> bool {
    with_file(bytes, |path| Source::open(path).ok())
}
