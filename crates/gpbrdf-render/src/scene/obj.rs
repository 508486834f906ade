//! Wavefront OBJ files.

use std::io::{BufReader, Read};
use std::path::Path;

use glam::Vec3;

use super::mesh::{Mesh, Mismatch};
use crate::error::{Error, Result};

/// The largest file that is read: 1 GiB.
const MAX_BYTES: u64 = 1 << 30;

/// Reads all objects of an OBJ file as one mesh, moved and scaled into the unit sphere ([`Mesh::fitted`]).
///
/// Polygons are cut into fans of triangles. Materials, texture coordinates, points and lines are ignored. If
/// any object has no normals, smooth ones are computed for all objects.
///
/// # Errors
/// [`gpbrdf_core::Error::Io`] when the file cannot be read, [`gpbrdf_core::Error::Format`] when it is over 1
/// GiB, is no OBJ file, holds no triangle, or is refused by [`Mesh::new`].
pub fn read_obj(path: impl AsRef<Path>) -> Result<Mesh> {
    let path = path.as_ref();
    let io = |source| Error::read(path, source);
    let broken = |expected: &str, found: String| Error::format("OBJ", path, expected, found);
    let file = std::fs::File::open(path).map_err(io)?;
    let metadata = file.metadata().map_err(io)?;
    if !metadata.is_file() {
        return Err(broken("a regular file", "something else".to_owned()));
    }
    if metadata.len() > MAX_BYTES {
        return Err(broken(&format!("at most {MAX_BYTES} bytes"), format!("{} bytes", metadata.len())));
    }
    // A file that grows meanwhile stays bounded.
    let mut reader = BufReader::new(file.take(MAX_BYTES));
    let options =
        tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(&mut reader, &options, no_materials)
        .map_err(|error| broken("vertices and faces as text", error.to_string()))?;
    let (mut positions, mut normals, mut indices) = (Vec::new(), Vec::new(), Vec::new());
    let mut all_have_normals = true;
    for model in &models {
        let mesh = &model.mesh;
        let first = u32::try_from(positions.len())
            .map_err(|_| broken("at most 2^32 vertices", positions.len().to_string()))?;
        positions.extend(mesh.positions.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(*p)));
        normals.extend(mesh.normals.as_chunks::<3>().0.iter().map(|n| Vec3::from_array(*n)));
        all_have_normals &= mesh.normals.len() == mesh.positions.len();
        indices.extend(mesh.indices.iter().map(|i| i.saturating_add(first)));
    }
    if indices.is_empty() {
        return Err(broken("faces", format!("none in {} objects", models.len())));
    }
    if !all_have_normals {
        normals.clear();
    }
    match Mesh::checked(positions, normals, indices) {
        Ok(mesh) => Ok(mesh.fitted()),
        Err(Mismatch { expected, found }) => Err(broken(&expected, found)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO_OBJECTS: &str = "# two squares\nmtllib missing.mtl\no low\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n\
        vn 0 0 1\nusemtl none\nf 1//1 2//1 3//1 4//1\no high\nv 0 0 2\nv 2 0 2\nv 2 2 2\nv 0 2 2\n\
        f -4//1 -3//1 -2//1 -1//1\nl 1 2\np 1\n";

    fn read(text: &[u8]) -> Result<Mesh> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, text).unwrap();
        read_obj(&path)
    }

    #[test]
    fn several_objects_with_normals_become_one_mesh_in_the_unit_sphere() {
        let mesh = read(TWO_OBJECTS.as_bytes()).unwrap();
        assert_eq!((mesh.triangles(), mesh.positions.len()), (4, 8));
        assert!(mesh.normals.iter().all(|n| *n == Vec3::Z));
        assert!(mesh.positions.iter().all(|p| (p.length() - 1.0).abs() < 1e-6));
    }

    #[test]
    fn without_normals_smooth_ones_are_made_across_seams() {
        // A roof; texture coordinates tear the ridge apart.
        let roof = "v 0 1 0\nv 0 1 1\nv 1 0 0\nv 1 0 1\nv -1 0 0\nv -1 0 1\nvt 0 0\nvt 1 1\n\
            f 1/1 2/1 4/1 3/1\nf 2/2 1/2 5/2 6/2\n";
        let mesh = read(roof.as_bytes()).unwrap();
        assert_eq!(mesh.positions.len(), 8);
        let ridge = mesh.normals.iter().filter(|n| n.x.abs() < 1e-6 && n.y > 0.99).count();
        assert_eq!(ridge, 4, "{:?}", mesh.normals);
    }

    #[test]
    fn broken_files_are_refused_by_name() {
        for (text, part) in [
            (&b"v 0 0 0\nf 1 2 3\n"[..], "out of bounds"),
            (b"v 0 0 x\n", "position parse error"),
            (b"hello\n", "found"),
            (b"", "expected faces, found none"),
            (b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "finite positions"),
            (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "none in"),
            (b"\xff\xfe\x00", "OBJ"),
        ] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(part) && message.contains("a.obj"), "{message}");
        }
        let missing = read_obj(Path::new("/nowhere/b.obj")).unwrap_err().to_string();
        assert!(missing.starts_with("cannot read") && missing.contains("b.obj"), "{missing}");
    }

    #[test]
    fn mutated_files_never_panic() {
        let mut state = 1u32;
        let mut next = |n: usize| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as usize % n
        };
        let palette = b"0123456789/-.e vfnlopu\n#";
        for _ in 0..400 {
            let mut text = TWO_OBJECTS.as_bytes().to_vec();
            for _ in 0..1 + next(6) {
                let at = next(text.len());
                text[at] = palette[next(palette.len())];
            }
            let _either = read(&text);
        }
    }
}
