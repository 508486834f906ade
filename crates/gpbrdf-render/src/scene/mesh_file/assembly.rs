//! Puts the triangles of a file together, in f64, and fits the result into the unit sphere.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use glam::{DVec3, Vec3};

use super::super::mesh::{MAX_TRIANGLES, Mesh, Mismatch, into_unit_sphere};

/// The most triangles without an area that are left out, so that a small file cannot claim work without end.
const MAX_WITHOUT_AREA: usize = 1 << 24;

/// A corner of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// What tells vertices apart: corners with the same key in the same part are one vertex.
    pub(super) key: [u32; 2],
    pub(super) position: DVec3,
    /// Zero where a smooth normal is wanted.
    pub(super) normal: DVec3,
}

/// Triangles as they come.
#[derive(Debug, Default)]
pub(super) struct Assembly {
    vertices: HashMap<[u32; 2], u32>,
    positions: Vec<DVec3>,
    normals: Vec<Vec3>,
    indices: Vec<u32>,
    /// Triangles that were left out.
    without_area: usize,
}

impl Assembly {
    /// Begins a part, whose vertices are not those of earlier ones.
    pub(super) fn begin_part(&mut self) {
        self.vertices.clear();
    }

    /// Adds a triangle, unless it has no area.
    pub(super) fn triangle(&mut self, corners: [Corner; 3]) -> Result<(), Mismatch> {
        let [a, b, c] = corners.map(|corner| corner.position);
        if area_normal(a, b, c).is_none() {
            self.without_area += 1;
            if self.without_area > MAX_WITHOUT_AREA {
                let expected = format!("at most {MAX_WITHOUT_AREA} triangles without an area");
                return Err(Mismatch { expected, found: "more".to_owned() });
            }
            return Ok(());
        }
        if self.indices.len() / 3 >= MAX_TRIANGLES {
            let expected = format!("at most {MAX_TRIANGLES} triangles");
            return Err(Mismatch { expected, found: "more".to_owned() });
        }
        for corner in corners {
            let index = match self.vertices.entry(corner.key) {
                Entry::Occupied(known) => *known.get(),
                Entry::Vacant(new) => {
                    // At most three vertices for each triangle, which are far fewer than 2^32.
                    let index = u32::try_from(self.positions.len()).unwrap_or(u32::MAX);
                    self.positions.push(corner.position);
                    self.normals.push(corner.normal.try_normalize().unwrap_or_default().as_vec3());
                    *new.insert(index)
                }
            };
            self.indices.push(index);
        }
        Ok(())
    }

    /// The mesh, in the unit sphere.
    pub(super) fn finish(self) -> Result<Mesh, Mismatch> {
        if self.indices.is_empty() {
            let found = match self.without_area {
                0 => "none".to_owned(),
                count => format!("none among {count} triangles"),
            };
            return Err(Mismatch { expected: "faces with an area".to_owned(), found });
        }
        let far = |p: &&DVec3| p.abs().max_element() > f64::from(f32::MAX) || !p.is_finite();
        if let Some(position) = self.positions.iter().find(far) {
            return Err(Mismatch {
                expected: "coordinates of single precision".into(),
                found: position.to_string(),
            });
        }
        Mesh::checked(into_unit_sphere(&self.positions), self.normals, self.indices)
    }
}

/// The unit normal of a triangle; none if it has no area.
pub(super) fn area_normal(a: DVec3, b: DVec3, c: DVec3) -> Option<DVec3> {
    let (along, across) = (b - a, c - a);
    // Sides are brought near 1 first, so that no product vanishes or overflows.
    let size = along.abs().max(across.abs()).max_element();
    if !(size > 0.0 && size.is_finite()) {
        return None;
    }
    (along / size).cross(across / size).try_normalize()
}
