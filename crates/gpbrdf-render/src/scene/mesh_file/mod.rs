//! Meshes from files: Wavefront OBJ and glTF 2.0, told apart by their content.

mod accessor;
mod assembly;
mod gltf;
mod obj;
mod polygon;

use std::io::Read;
use std::path::Path;

use super::mesh::{Mesh, Mismatch};
use crate::error::{Error, Result};

/// The largest file that is read: 1 GiB.
const MAX_BYTES: u64 = 1 << 30;

/// What can be read, for messages.
const EXPECTED: &str = "a Wavefront OBJ or glTF 2.0 mesh";

/// Starts of files that hold meshes of other formats or no mesh at all, and what to call these files.
const FOREIGN: [(&[u8], &str); 12] = [
    (b"ply\n", "a PLY mesh"),
    (b"ply\r", "a PLY mesh"),
    (b"solid ", "an STL mesh"),
    (b"Kaydara FBX Binary", "an FBX mesh"),
    (b"; FBX", "an FBX mesh"),
    (b"BLENDER", "a Blender file"),
    (b"<?xml", "an XML file"),
    (b"#usda", "a USD file"),
    (b"PXR-USDC", "a USD file"),
    (b"OFF", "an OFF mesh"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"#?", "a Radiance HDR image"),
];

/// Reads all objects of an OBJ or glTF 2.0 file (`.obj`, `.glb`, `.gltf`) as one mesh. It is moved and scaled
/// into the unit sphere, as by [`Mesh::fitted`], in f64, so that coordinates far from the origin lose nothing. Its
/// `+z` axis, the front of both formats, faces the default [`Camera`](crate::Camera).
///
/// Faces of any number of corners are cut into triangles on their plane, also concave ones; faces without an
/// area are left out. Corners without a normal get smooth ones in OBJ files and those of their triangle in glTF
/// files, as its specification requires. Materials, colours, texture coordinates, points, lines, skins and
/// morph targets are ignored. Buffers of a glTF file are read from files beside it, too.
///
/// # Errors
/// [`gpbrdf_core::Error::Io`] when a file cannot be read, [`gpbrdf_core::Error::UnknownFormat`] when it has
/// another format, [`gpbrdf_core::Error::Format`] when it is over 1 GiB, is damaged, holds no face with an area,
/// requires a glTF extension that changes geometry, or is refused by [`Mesh::new`]. Messages about OBJ files name
/// the line.
pub fn read_mesh(path: impl AsRef<Path>) -> Result<Mesh> {
    let path = path.as_ref();
    parse_mesh(&read_bytes("mesh", path)?, path)
}

/// Like [`read_mesh`], from the content of a file. `path` names it in messages, and buffers of a glTF file are
/// looked for beside it.
///
/// # Errors
/// Those of [`read_mesh`].
pub fn parse_mesh(bytes: &[u8], path: impl AsRef<Path>) -> Result<Mesh> {
    let path = path.as_ref();
    if is_gltf(bytes) {
        return gltf::parse(bytes, path);
    }
    if let Some(found) = foreign(bytes) {
        return Err(gpbrdf_core::Error::UnknownFormat {
            path: path.to_owned(),
            expected: EXPECTED.to_owned(),
            found,
        }
        .into());
    }
    obj::parse(bytes, path)
}

/// Whether content that starts with these bytes is a mesh that [`read_mesh`] reads: glTF by its signature or its
/// JSON, OBJ by its first statement.
#[must_use]
pub fn is_mesh(head: &[u8]) -> bool {
    is_gltf(head) || foreign(head).is_none() && obj::is_obj(head)
}

/// Whether content is glTF: binary, or JSON with an asset.
fn is_gltf(head: &[u8]) -> bool {
    let text = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head).trim_ascii_start();
    let asset = b"\"asset\"";
    head.starts_with(b"glTF") || text.starts_with(b"{") && text.windows(asset.len()).any(|part| part == asset)
}

/// What content of another format is called.
fn foreign(bytes: &[u8]) -> Option<String> {
    if bytes.is_empty() {
        return Some("an empty file".to_owned());
    }
    let known =
        FOREIGN.iter().find(|(start, _)| bytes.starts_with(start)).map(|(_, name)| (*name).to_owned());
    known.or_else(|| {
        // No text without a byte order mark has a zero byte.
        let marked = bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF");
        let binary = !marked && bytes[..bytes.len().min(1024)].contains(&0);
        binary.then(|| "binary data".to_owned())
    })
}

/// The whole content of a regular file of at most [`MAX_BYTES`].
fn read_bytes(format: &'static str, path: &Path) -> Result<Vec<u8>> {
    let io = |source| Error::read(path, source);
    let file = std::fs::File::open(path).map_err(io)?;
    let metadata = file.metadata().map_err(io)?;
    if metadata.is_dir() {
        return Err(io(std::io::ErrorKind::IsADirectory.into()));
    }
    if !metadata.is_file() {
        return Err(Error::format(format, path, "a regular file", "a pipe or a device"));
    }
    let limit = format!("at most {MAX_BYTES} bytes");
    if metadata.len() > MAX_BYTES {
        return Err(Error::format(format, path, limit, format!("{} bytes", metadata.len())));
    }
    // A file that grows meanwhile stays bounded.
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Error::format(format, path, limit, "more"));
    }
    Ok(bytes)
}

/// Turns a refused mesh into an error about a file.
fn refused(format: &'static str, path: &Path) -> impl Fn(Mismatch) -> Error {
    move |Mismatch { expected, found }| Error::format(format, path, expected, found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_files_are_refused_by_what_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        for (bytes, found) in [
            (&b""[..], "an empty file"),
            (b"ply\nformat ascii 1.0\n", "a PLY mesh"),
            (b"solid cube\n", "an STL mesh"),
            (b"PK\x03\x04....", "a ZIP archive"),
            (b"\x01\x02\0\0v 1 2 3", "binary data"),
        ] {
            std::fs::write(&path, bytes).unwrap();
            let message = read_mesh(&path).unwrap_err().to_string();
            assert!(message.ends_with(&format!("a.obj\": expected {EXPECTED}, found {found}")), "{message}");
            assert!(!is_mesh(bytes));
        }
        let message = read_mesh(folder.path()).unwrap_err().to_string();
        assert!(message.starts_with("cannot read") && message.ends_with("is a directory"), "{message}");
        let message = read_mesh("/nowhere/b.obj").unwrap_err().to_string();
        assert!(message.starts_with("cannot read") && message.contains("b.obj"), "{message}");
    }

    #[test]
    fn meshes_are_known_by_their_start() {
        for head in [
            &b"v 0 0 0\nv 1"[..],
            b"# Blender\n\no Cube\nv 1 1 1\n",
            b"\xEF\xBB\xBFmtllib a.mtl\n",
            b"\xFF\xFEv\0 \x001\0",
            b"glTF\x02\0\0\0",
            b" {\"asset\": {\"version\": \"2.0\"}}",
        ] {
            assert!(is_mesh(head), "{head:?}");
        }
        for head in
            [&b"theta_i,phi_i\n1,2\n"[..], b"{\"format\": \"gpbrdf session\"}", b"values 1 2\n", b"v\n"]
        {
            assert!(!is_mesh(head), "{head:?}");
        }
    }
}
