//! glTF 2.0 files, binary or as JSON: Khronos Group, "glTF 2.0 Specification" (2021).

use std::borrow::Cow;
use std::cell::OnceCell;
use std::path::{Component, Path, PathBuf};

use ::gltf::json;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::{DMat3, DMat4, DQuat, DVec3, Vec3};
use json::mesh::{Mode, Primitive, Semantic};
use json::validation::Checked;
use percent_encoding::percent_decode_str;
use serde_json::Value;

use super::super::mesh::Mesh;
use super::accessor::Elements;
use super::assembly::{Assembly, Corner, area_normal};
use super::{read_bytes, refused};
use crate::error::{Error, Result};

/// The format's name in messages.
const FORMAT: &str = "glTF";

/// The members of a file that say something about its shape. Others are not even looked at.
const MEMBERS: [&str; 7] = ["accessors", "buffers", "bufferViews", "meshes", "nodes", "scenes", "scene"];

/// How deep nodes may be nested.
const MAX_DEPTH: usize = 256;

/// Nodes that are visited; a node may be the child of one other only, but files may claim more.
const MAX_VISITS: usize = 1 << 20;

/// Bytes of the header of a binary file.
const HEADER_BYTES: u32 = 12;

/// A file whose geometry is being put together.
struct Reader<'a> {
    path: &'a Path,
    root: json::Root,
    /// The content of each buffer, once it is needed.
    buffers: Vec<OnceCell<Vec<u8>>>,
    /// The binary part of the file.
    binary: Option<&'a [u8]>,
    assembly: Assembly,
    visits: usize,
}

/// Reads the content of a glTF file.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let wrong = |expected: &str, found: String| Error::format(FORMAT, path, expected, found);
    let (text, binary) = split(bytes, path)?;
    let text = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&text);
    let mut document: Value =
        serde_json::from_slice(text).map_err(|error| wrong("JSON", error.to_string()))?;
    let version = document["asset"]["version"].as_str().unwrap_or("none");
    if version.split('.').next() != Some("2") {
        return Err(wrong("version 2", format!("version {version}")));
    }
    let required = document["extensionsRequired"].as_array().into_iter().flatten();
    let unknown: Vec<&str> =
        required.filter_map(Value::as_str).filter(|name| changes_geometry(name)).collect();
    if !unknown.is_empty() {
        return Err(wrong("no extension that changes geometry", format!("a need of {}", unknown.join(", "))));
    }
    if let Some(members) = document.as_object_mut() {
        members.retain(|name, _| name == "asset" || MEMBERS.contains(&name.as_str()));
    }
    let root: json::Root = json::deserialize::from_value(document)
        .map_err(|error| wrong("meshes of glTF 2.0", error.to_string()))?;
    let buffers = root.buffers.iter().map(|_| OnceCell::new()).collect();
    let mut reader = Reader { path, root, buffers, binary, assembly: Assembly::default(), visits: 0 };
    reader.scene()?;
    reader.assembly.finish().map_err(refused(FORMAT, path))
}

/// The JSON of a file and its binary part, if it has one.
type Parts<'a> = (Cow<'a, [u8]>, Option<&'a [u8]>);

fn split<'a>(bytes: &'a [u8], path: &Path) -> Result<Parts<'a>> {
    if !bytes.starts_with(b"glTF") {
        return Ok((Cow::Borrowed(bytes), None));
    }
    let wrong = |found: String| Error::format(FORMAT, path, "a binary file of version 2 in whole", found);
    let word = |at: usize| bytes.get(at..)?.first_chunk().copied().map(u32::from_le_bytes);
    let whole = match (word(4), word(8)) {
        (Some(2), Some(length)) if length >= HEADER_BYTES && length as usize <= bytes.len() => {
            &bytes[..length as usize]
        }
        (Some(2), Some(length)) => return Err(wrong(format!("{} of {length} bytes", bytes.len()))),
        (Some(version), _) => return Err(wrong(format!("version {version}"))),
        (None, _) => return Err(wrong(format!("{} bytes", bytes.len()))),
    };
    let parts = ::gltf::Glb::from_slice(whole).map_err(|error| wrong(error.to_string()))?;
    // Both parts are borrowed, as the file is a slice.
    let binary = match parts.bin {
        Some(Cow::Borrowed(binary)) => Some(binary),
        _ => None,
    };
    Ok((parts.json, binary))
}

/// Whether a file that requires this extension cannot be read without it.
fn changes_geometry(extension: &str) -> bool {
    const KNOWN: [&str; 3] = ["KHR_mesh_quantization", "KHR_lights_punctual", "KHR_node_visibility"];
    const OF_SURFACES: [&str; 6] =
        ["KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_xmp", "EXT_lights_"];
    !KNOWN.contains(&extension) && !OF_SURFACES.iter().any(|start| extension.starts_with(start))
}

impl Reader<'_> {
    fn wrong(&self, expected: &str, found: impl std::fmt::Display) -> Error {
        Error::format(FORMAT, self.path, expected, found)
    }

    /// Takes in the default scene, or the first one, or all nodes that are no children where there is none.
    fn scene(&mut self) -> Result<()> {
        let index = self.root.scene.map_or(0, |scene| scene.value());
        let roots: Vec<usize> = match self.root.scenes.get(index) {
            Some(scene) => scene.nodes.iter().map(|node| node.value()).collect(),
            None if self.root.scenes.is_empty() => {
                let mut is_child = vec![false; self.root.nodes.len()];
                for child in self.root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
                    if let Some(known) = is_child.get_mut(child.value()) {
                        *known = true;
                    }
                }
                (0..is_child.len()).filter(|&node| !is_child[node]).collect()
            }
            None => return Err(self.wrong("a scene", format!("no scene {index}"))),
        };
        let mut open: Vec<(usize, DMat4, usize)> =
            roots.into_iter().rev().map(|n| (n, DMat4::IDENTITY, 0)).collect();
        while let Some((index, parent, depth)) = open.pop() {
            self.visits += 1;
            if depth > MAX_DEPTH || self.visits > MAX_VISITS {
                return Err(
                    self.wrong("a tree of nodes", format!("node {index} within itself, or too many nodes"))
                );
            }
            let Some(node) = self.root.nodes.get(index) else {
                return Err(self.wrong("nodes that exist", format!("no node {index}")));
            };
            let world = parent * transform(node);
            let mesh = node.mesh.map(|mesh| mesh.value());
            // In the order of the file, as the last one is taken first.
            let children = node.children.iter().flatten().rev();
            open.extend(children.map(|child| (child.value(), world, depth + 1)));
            if let Some(mesh) = mesh {
                self.mesh(mesh, world)?;
            }
        }
        Ok(())
    }

    /// Takes in a mesh at a place in the world.
    fn mesh(&mut self, index: usize, world: DMat4) -> Result<()> {
        let Some(mesh) = self.root.meshes.get(index) else {
            return Err(self.wrong("meshes that exist", format!("no mesh {index}")));
        };
        // Primitives are looked up again, since taking one in changes the reader.
        for k in 0..mesh.primitives.len() {
            let Some(primitive) = self.root.meshes[index].primitives.get(k).cloned() else { break };
            self.load_buffers(&primitive)?;
            let mut assembly = std::mem::take(&mut self.assembly);
            assembly.begin_part();
            self.primitive(&primitive, world, &mut assembly)
                .map_err(|found| self.wrong("whole meshes", format!("mesh {index}: {found}")))?
                .map_err(refused(FORMAT, self.path))?;
            self.assembly = assembly;
        }
        Ok(())
    }

    /// Adds the triangles of a primitive. The outer error describes the file, the inner one the mesh.
    fn primitive(
        &self,
        primitive: &Primitive,
        world: DMat4,
        assembly: &mut Assembly,
    ) -> Result<Result<(), super::Mismatch>, String> {
        let Checked::Valid(mode) = primitive.mode else {
            return Err("an unknown kind of primitive".to_owned());
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(Ok(()));
        }
        let elements = |index: usize| Elements::new(&self.root, index, &|buffer| self.bytes(buffer));
        let attribute = |semantic: Semantic| {
            let found = primitive.attributes.get(&Checked::Valid(semantic));
            found.map(|accessor| elements(accessor.value())).transpose()
        };
        let Some(positions) = attribute(Semantic::Positions)? else { return Ok(Ok(())) };
        let normals = attribute(Semantic::Normals)?;
        let indices = primitive.indices.map(|accessor| elements(accessor.value())).transpose()?;
        let count = indices.as_ref().map_or(positions.count(), Elements::count);
        let linear = DMat3::from_mat4(world);
        let mirrored = linear.determinant() < 0.0;
        // The transposed inverse up to a factor, which flat transforms have as well.
        let cofactors = DMat3::from_cols(
            linear.y_axis.cross(linear.z_axis),
            linear.z_axis.cross(linear.x_axis),
            linear.x_axis.cross(linear.y_axis),
        );
        let corner = |at: usize| {
            let index = match &indices {
                Some(indices) => indices.index(at).ok_or("indices that are no whole numbers")?,
                None => u32::try_from(at).map_err(|_| "too many vertices")?,
            };
            let position = positions.vector(index as usize).map(DVec3::from_array);
            let position = position.ok_or_else(|| format!("vertex {index} of {}", positions.count()))?;
            let normal = match &normals {
                Some(normals) => {
                    let normal = normals.vector(index as usize).map(DVec3::from_array);
                    let normal = normal.ok_or_else(|| format!("normal {index} of {}", normals.count()))?;
                    if mirrored { -(cofactors * normal) } else { cofactors * normal }
                }
                None => DVec3::ZERO,
            };
            Ok::<_, String>(Corner { key: [index, 0], position: world.transform_point3(position), normal })
        };
        let triangles = match mode {
            Mode::Triangles => count / 3,
            _ => count.saturating_sub(2),
        };
        for t in 0..triangles {
            let mut at = match mode {
                Mode::Triangles => [3 * t, 3 * t + 1, 3 * t + 2],
                Mode::TriangleStrip => [t, t + 1 + t % 2, t + 2 - t % 2],
                _ => [0, t + 1, t + 2],
            };
            if mirrored {
                at.swap(1, 2);
            }
            let mut corners = [corner(at[0])?, corner(at[1])?, corner(at[2])?];
            if normals.is_none() {
                let [a, b, c] = corners.map(|corner| corner.position);
                let normal = area_normal(a, b, c).unwrap_or_default();
                let triangle = u32::try_from(t).map_err(|_| "too many triangles")?;
                for (k, corner) in (0u32..).zip(&mut corners) {
                    (corner.key, corner.normal) = ([triangle, 1 + k], normal);
                }
            }
            if let Err(mismatch) = assembly.triangle(corners) {
                return Ok(Err(mismatch));
            }
        }
        Ok(Ok(()))
    }

    /// The content of a buffer that has been loaded.
    fn bytes(&self, buffer: usize) -> &[u8] {
        match (self.binary, self.root.buffers.get(buffer)) {
            (Some(binary), Some(json::Buffer { uri: None, .. })) if buffer == 0 => binary,
            _ => self.buffers.get(buffer).and_then(OnceCell::get).map_or(&[], Vec::as_slice),
        }
    }

    /// Loads the buffers that a primitive needs.
    fn load_buffers(&self, primitive: &Primitive) -> Result<()> {
        let wanted = [Semantic::Positions, Semantic::Normals].map(Checked::Valid);
        let attributes = wanted.iter().filter_map(|semantic| primitive.attributes.get(semantic));
        for accessor in attributes.chain(&primitive.indices) {
            let Some(accessor) = self.root.accessors.get(accessor.value()) else { continue };
            let sparse = accessor.sparse.as_ref().map(|s| [s.indices.buffer_view, s.values.buffer_view]);
            for view in accessor.buffer_view.into_iter().chain(sparse.into_iter().flatten()) {
                if let Some(view) = self.root.buffer_views.get(view.value()) {
                    self.load_buffer(view.buffer.value())?;
                }
            }
        }
        Ok(())
    }

    /// Loads a buffer from its data URI or from its file.
    fn load_buffer(&self, index: usize) -> Result<()> {
        let (Some(buffer), Some(cell)) = (self.root.buffers.get(index), self.buffers.get(index)) else {
            return Err(self.wrong("buffers that exist", format!("no buffer {index}")));
        };
        if cell.get().is_some() {
            return Ok(());
        }
        let bytes = match &buffer.uri {
            None if index == 0 && self.binary.is_some() => return Ok(()),
            None => return Err(self.wrong("a binary part", format!("none for buffer {index}"))),
            Some(uri) => match uri.strip_prefix("data:") {
                Some(data) => self.decode(data)?,
                None => read_bytes("glTF buffer", &self.beside(uri)?)?,
            },
        };
        if (bytes.len() as u64) < buffer.byte_length.0 {
            let expected = format!("{} bytes of buffer {index}", buffer.byte_length.0);
            return Err(self.wrong(&expected, bytes.len()));
        }
        // It has just been found empty.
        let _ = cell.set(bytes);
        Ok(())
    }

    /// The content of a data URI after `data:`. RFC 2397.
    fn decode(&self, data: &str) -> Result<Vec<u8>> {
        let Some((kind, content)) = data.split_once(',') else {
            return Err(self.wrong("a comma in each data URI", "none"));
        };
        let content: Cow<'_, [u8]> = percent_decode_str(content).into();
        if !kind.ends_with(";base64") {
            return Ok(content.into_owned());
        }
        STANDARD.decode(&content).map_err(|error| self.wrong("data in base 64", error))
    }

    /// The file that a relative URI names.
    fn beside(&self, uri: &str) -> Result<PathBuf> {
        let name = percent_decode_str(uri).decode_utf8_lossy();
        let relative = Path::new(name.as_ref());
        let inside = |part: Component<'_>| {
            matches!(part, Component::Normal(_) | Component::CurDir | Component::ParentDir)
        };
        if name.contains("://") || name.is_empty() || !relative.components().all(inside) {
            return Err(self.wrong("buffers in files beside it", format!("\"{name}\"")));
        }
        Ok(self.path.parent().unwrap_or(Path::new("")).join(relative))
    }
}

/// The transform from the frame of a node into that of its parent.
fn transform(node: &json::Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let [x, y, z, w] = node.rotation.unwrap_or_default().0.map(f64::from);
    let rotation = DQuat::from_xyzw(x, y, z, w);
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    let vector =
        |value: Option<[f32; 3]>, other: Vec3| Vec3::from_array(value.unwrap_or(other.to_array())).as_dvec3();
    let (scale, translation) = (vector(node.scale, Vec3::ONE), vector(node.translation, Vec3::ZERO));
    DMat4::from_scale_rotation_translation(scale, rotation, translation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Positions of a right triangle in the plane `z = 0`, and indices 0, 1, 2 as bytes.
    fn triangle_bytes() -> Vec<u8> {
        let positions = [[0.0f32, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mut bytes: Vec<u8> = positions.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        bytes.extend([0, 1, 2]);
        bytes
    }

    fn uri(bytes: &[u8]) -> String {
        format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes))
    }

    /// A file of one triangle.
    fn triangle() -> Value {
        let bytes = triangle_bytes();
        json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                {"bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR"},
            ],
            "bufferViews": [
                {"buffer": 0, "byteLength": 36},
                {"buffer": 0, "byteOffset": 36, "byteLength": 3},
            ],
            "buffers": [{"byteLength": bytes.len(), "uri": uri(&bytes)}],
        })
    }

    fn read(document: &Value) -> Result<Mesh> {
        parse(document.to_string().as_bytes(), Path::new("a.gltf"))
    }

    fn binary(mut document: Value, bytes: &[u8]) -> Vec<u8> {
        document["buffers"][0].as_object_mut().unwrap().remove("uri");
        let json = document.to_string().into_bytes();
        ::gltf::Glb {
            header: ::gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 },
            json: json.into(),
            bin: Some(bytes.into()),
        }
        .to_vec()
        .unwrap()
    }

    /// The normal that the order of a triangle's corners implies.
    fn sense(mesh: &Mesh, triangle: usize) -> Vec3 {
        let [a, b, c] = [0, 1, 2].map(|k| mesh.positions[mesh.indices[3 * triangle + k] as usize]);
        (b - a).cross(c - a).normalize()
    }

    #[test]
    fn all_ways_to_store_a_triangle_are_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let expected = read(&triangle()).unwrap();
        assert_eq!((expected.triangles(), &expected.normals[..]), (1, &[Vec3::Z; 3][..]));
        let longest = expected.positions[1].distance(expected.positions[2]);
        assert!((longest - 2.0).abs() < 1e-6, "{longest}");
        assert_eq!(parse(&binary(triangle(), &triangle_bytes()), Path::new("a.glb")).unwrap(), expected);

        std::fs::write(folder.path().join("a b.bin"), triangle_bytes()).unwrap();
        let mut beside = triangle();
        beside["buffers"][0]["uri"] = json!("a%20b.bin");
        let path = folder.path().join("a.gltf");
        std::fs::write(&path, beside.to_string()).unwrap();
        assert_eq!(super::super::read_mesh(&path).unwrap(), expected);

        let mut without_scene = triangle();
        let members = without_scene.as_object_mut().unwrap();
        members.remove("scene");
        members.remove("scenes");
        assert_eq!(read(&without_scene).unwrap(), expected);

        // What has no shape may be anything.
        let mut with_more = triangle();
        with_more["materials"] = json!([{"nonsense": []}]);
        with_more["extensionsRequired"] = json!(["KHR_materials_unlit", "KHR_mesh_quantization"]);
        assert_eq!(read(&with_more).unwrap(), expected);
        for mode in [5, 6] {
            let mut strip = triangle();
            strip["meshes"][0]["primitives"][0]["mode"] = json!(mode);
            assert_eq!(read(&strip).unwrap(), expected, "{mode}");
        }
    }

    #[test]
    fn nodes_are_placed_and_mirrors_keep_the_outside() {
        let mut document = triangle();
        // A quarter turn about z in the parent, a mirrored child, and the mesh twice.
        document["nodes"] = json!([
            {"children": [1, 2], "rotation": [0, 0, 0.5f64.sqrt(), 0.5f64.sqrt()], "scale": [2, 2, 2]},
            {"mesh": 0, "translation": [0, 0, 1]},
            {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -1, 1]},
        ]);
        let mesh = read(&document).unwrap();
        assert_eq!(mesh.triangles(), 2);
        // (2, 0, 1) goes to (0, 4, 2), (0, 1, 1) to (-2, 0, 2); mirrored, (2, 0, -1) goes to (0, -4, -2).
        let edge = |from: usize, to: usize| mesh.positions[to] - mesh.positions[from];
        let scale = edge(0, 1).length() / 4.0;
        assert!((edge(0, 1) / scale - Vec3::new(0.0, 4.0, 0.0)).length() < 1e-5);
        assert!((edge(0, 2) / scale - Vec3::new(-2.0, 0.0, 0.0)).length() < 1e-5);
        assert!((edge(0, 3) / scale - Vec3::new(0.0, 0.0, -4.0)).length() < 1e-5);
        for t in 0..2 {
            assert!((sense(&mesh, t) - Vec3::Z).length() < 1e-6);
            assert!((mesh.normals[3 * t] - Vec3::Z).length() < 1e-6);
        }
    }

    #[test]
    fn normals_follow_uneven_scales() {
        let mut document = triangle();
        let mut bytes = triangle_bytes();
        bytes.push(0);
        // Bytes that stand for [-1, 1], four apart.
        let normal = [0i8, 90, 90, 0].map(i8::cast_unsigned);
        bytes.extend([normal; 3].as_flattened());
        document["buffers"][0] = json!({"byteLength": bytes.len(), "uri": uri(&bytes)});
        let views = document["bufferViews"].as_array_mut().unwrap();
        views.push(json!({"buffer": 0, "byteOffset": 40, "byteLength": 12, "byteStride": 4}));
        let accessor = json!(
            {"bufferView": 2, "componentType": 5120, "normalized": true, "count": 3, "type": "VEC3"}
        );
        document["accessors"].as_array_mut().unwrap().push(accessor);
        document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(2);
        document["nodes"][0]["scale"] = json!([1, 2, 1]);
        let mesh = read(&document).unwrap();
        let expected = Vec3::new(0.0, 0.5, 1.0).normalize();
        assert!(mesh.normals.iter().all(|n| (*n - expected).length() < 1e-6), "{:?}", mesh.normals);
    }

    #[test]
    fn replaced_elements_and_zeros_are_read() {
        let mut document = triangle();
        let bytes = [&[1u8, 2][..], &triangle_bytes()[12..36]].concat();
        document["buffers"]
            .as_array_mut()
            .unwrap()
            .push(json!({"byteLength": bytes.len(), "uri": uri(&bytes)}));
        let views = document["bufferViews"].as_array_mut().unwrap();
        views.push(json!({"buffer": 1, "byteLength": 2}));
        views.push(json!({"buffer": 1, "byteOffset": 2, "byteLength": 24}));
        document["accessors"][0] = json!({
            "componentType": 5126, "count": 3, "type": "VEC3",
            "sparse": {
                "count": 2, "indices": {"bufferView": 2, "componentType": 5121}, "values": {"bufferView": 3},
            },
        });
        assert_eq!(read(&document).unwrap(), read(&triangle()).unwrap());
        document["accessors"][0]["count"] = json!(u64::MAX);
        assert_eq!(read(&document).unwrap(), read(&triangle()).unwrap());
        // Zeros without end are not gone through.
        document["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
        let message = read(&document).unwrap_err().to_string();
        assert!(message.contains("triangles without an area, found more"), "{message}");
    }

    #[test]
    fn broken_files_are_refused_by_what_is_wrong() {
        let change = |at: &str, value: Value| {
            let mut document = triangle();
            let (place, member) = at.rsplit_once('/').unwrap();
            match document.pointer_mut(place).unwrap() {
                Value::Array(list) => list[member.parse::<usize>().unwrap()] = value,
                other => other[member] = value,
            }
            document
        };
        let mut draco = triangle();
        draco["extensionsRequired"] = json!(["KHR_materials_ior", "KHR_draco_mesh_compression"]);
        for (document, part) in [
            (draco, "found a need of KHR_draco_mesh_compression"),
            (change("/asset/version", json!("1.0")), "expected version 2, found version 1.0"),
            (change("/nodes/0", json!({"children": [0]})), "node 0 within itself"),
            (change("/scenes/0/nodes/0", json!(7)), "no node 7"),
            (change("/scene", json!(3)), "no scene 3"),
            (change("/nodes/0/mesh", json!(2)), "no mesh 2"),
            (change("/meshes/0/primitives/0/indices", json!(9)), "mesh 0: no accessor 9"),
            (
                change("/accessors/0/count", json!(4)),
                "accessor 0: 4 elements of 12 bytes in a view of 36 bytes",
            ),
            (change("/accessors/0/count", json!(1u64 << 62)), "accessor 0"),
            (change("/accessors/0/count", json!(2)), "vertex 2 of 2"),
            (change("/accessors/1/componentType", json!(5126)), "accessor 1"),
            (change("/bufferViews/0/byteLength", json!(1000)), "buffer view 0: 1000 bytes from 0 of the 39"),
            (
                change("/bufferViews/1/byteOffset", json!(u64::MAX)),
                "buffer view 1: 3 bytes from 18446744073709551615",
            ),
            (change("/buffers/0/byteLength", json!(1000)), "1000 bytes of buffer 0, found 39"),
            (change("/buffers/0/uri", json!("data:;base64,!!")), "base 64"),
            (change("/buffers/0/uri", json!("https://x.org/a.bin")), "https://x.org/a.bin"),
            (change("/buffers/0/uri", json!("/etc/passwd")), "buffers in files beside it"),
            (change("/buffers/0/uri", json!("absent.bin")), "absent.bin"),
            (change("/meshes/0/primitives/0/mode", json!(1)), "faces with an area, found none"),
            (json!({"asset": {"version": "2.0"}}), "faces with an area, found none"),
        ] {
            let Err(error) = read(&document) else { panic!("{part}") };
            let message = error.to_string();
            assert!(message.contains(part), "{message}");
        }
        let whole = binary(triangle(), &triangle_bytes());
        for length in 0..whole.len() {
            let cut = parse(&whole[..length], Path::new("a.glb")).unwrap_err().to_string();
            assert!(cut.starts_with("glTF file \"a.glb\""), "{cut}");
        }
        for length in [0u32, 11, 13, u32::MAX] {
            let mut changed = whole.clone();
            changed[8..12].copy_from_slice(&length.to_le_bytes());
            assert!(parse(&changed, Path::new("a.glb")).is_err());
        }
    }
}
