//! Triangle meshes, two of them made by formula.

use std::collections::HashMap;
use std::f32::consts::{FRAC_PI_4, TAU};

use glam::{DVec3, Vec3, vec3};

use crate::error::{Error, Result};

/// The most triangles that a mesh may have: 8,388,608, whose indices take 96 MiB.
pub const MAX_TRIANGLES: usize = 1 << 23;

/// A triangle mesh with a normal at every vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions of the vertices.
    pub positions: Vec<Vec3>,
    /// Unit normals of the vertices, one for each position.
    pub normals: Vec<Vec3>,
    /// Three indices of vertices for each triangle, counter-clockwise seen from outside.
    pub indices: Vec<u32>,
}

impl Mesh {
    /// A mesh of triangles. Where `normals` is empty or a normal has no direction, smooth ones are computed: at
    /// each position the mean of the normals of the triangles that meet there, weighted by their angles. Vertices
    /// at equal positions share it.
    ///
    /// # Errors
    /// [`gpbrdf_core::Error::InvalidArgument`] when there is no triangle or more than [`MAX_TRIANGLES`], an
    /// index is out of range, a number is not finite, or there are normals but not as many as positions.
    pub fn new(positions: Vec<Vec3>, normals: Vec<Vec3>, indices: Vec<u32>) -> Result<Self> {
        Self::checked(positions, normals, indices)
            .map_err(|Mismatch { expected, found }| Error::argument("mesh", expected, found))
    }

    /// [`Mesh::new`] for readers of files, which say what is wrong in their own words.
    pub(super) fn checked(
        positions: Vec<Vec3>,
        normals: Vec<Vec3>,
        indices: Vec<u32>,
    ) -> Result<Self, Mismatch> {
        let wrong = |expected: String, found: String| Mismatch { expected, found };
        if indices.is_empty() || !indices.len().is_multiple_of(3) || indices.len() / 3 > MAX_TRIANGLES {
            let expected = format!("1 to {MAX_TRIANGLES} triangles of three indices");
            return Err(wrong(expected, format!("{} indices", indices.len())));
        }
        if let Some(index) = indices.iter().find(|&&i| i as usize >= positions.len()) {
            let expected = format!("indices under the {} vertices", positions.len());
            return Err(wrong(expected, index.to_string()));
        }
        if let Some(position) = positions.iter().find(|p| !p.is_finite()) {
            return Err(wrong("finite positions".into(), position.to_string()));
        }
        let mut mesh = Self { positions, normals, indices };
        if mesh.normals.is_empty() {
            mesh.normals = smooth_normals(&mesh.positions, &mesh.indices);
        } else if mesh.normals.len() != mesh.positions.len() {
            let expected = format!("no normals or {}", mesh.positions.len());
            return Err(wrong(expected, mesh.normals.len().to_string()));
        } else {
            let mut smooth = Vec::new();
            for (i, normal) in mesh.normals.iter_mut().enumerate() {
                *normal = normal.try_normalize().unwrap_or_else(|| {
                    if smooth.is_empty() {
                        smooth = smooth_normals(&mesh.positions, &mesh.indices);
                    }
                    smooth[i]
                });
            }
        }
        Ok(mesh)
    }

    /// Moves and scales the mesh so that the middle of its bounding box is the origin and its farthest vertex
    /// is at distance 1. A mesh of a single point is only moved.
    #[must_use]
    pub fn fitted(mut self) -> Self {
        let wide: Vec<DVec3> = self.positions.iter().map(|p| p.as_dvec3()).collect();
        self.positions = into_unit_sphere(&wide);
        self
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.indices.len() / 3
    }

    /// A tube of constant radius about the (2, 3) torus knot
    /// `((2 + cos 3t) cos 2t, (2 + cos 3t) sin 2t, 0.95 sin 3t)`, with exact normals, in the unit sphere.
    /// 49,152 triangles.
    #[must_use]
    pub fn knot() -> Self {
        const ALONG: u16 = 512;
        const AROUND: u16 = 48;
        const RADIUS: f32 = 0.55;
        let curve = |t: f32| {
            let (s3, c3) = (3.0 * t).sin_cos();
            let (s2, c2) = (2.0 * t).sin_cos();
            vec3((2.0 + c3) * c2, (2.0 + c3) * s2, 0.95 * s3)
        };
        let tangent = |t: f32| {
            let (s3, c3) = (3.0 * t).sin_cos();
            let (s2, c2) = (2.0 * t).sin_cos();
            let wide = 2.0 + c3;
            vec3(-3.0 * s3 * c2 - 2.0 * wide * s2, -3.0 * s3 * s2 + 2.0 * wide * c2, 2.85 * c3).normalize()
        };
        let mut mesh = Self::default();
        for i in 0..ALONG {
            let t = TAU * f32::from(i) / f32::from(ALONG);
            let along = tangent(t);
            // The knot never runs along the radius of its torus, so this frame turns smoothly and closes.
            let (s2, c2) = (2.0 * t).sin_cos();
            let across = along.cross(vec3(c2, s2, 0.0)).normalize();
            let outward = across.cross(along);
            for j in 0..AROUND {
                let (s, c) = (TAU * f32::from(j) / f32::from(AROUND)).sin_cos();
                let normal = c * outward + s * across;
                mesh.positions.push(curve(t) + RADIUS * normal);
                mesh.normals.push(normal);
            }
        }
        let at = |i: u16, j: u16| u32::from(i % ALONG) * u32::from(AROUND) + u32::from(j % AROUND);
        for i in 0..ALONG {
            for j in 0..AROUND {
                let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                mesh.indices.extend([0, 2, 1, 0, 3, 2].map(|k: usize| corners[k]));
            }
        }
        mesh.fitted()
    }

    /// A cube with rounded edges, whose radius is a quarter of half its side, with exact normals, in the unit
    /// sphere. 6,912 triangles.
    #[must_use]
    pub fn rounded_box() -> Self {
        const ROUND: u8 = 16;
        const RADIUS: f32 = 0.25;
        const FLAT: f32 = 1.0 - RADIUS;
        // Along a side of a face: how far out of the flat part, in units of the radius, and where on it.
        let mut steps = Vec::new();
        for i in (0..=ROUND).rev() {
            steps.push((-FLAT, -(FRAC_PI_4 * f32::from(i) / f32::from(ROUND)).tan()));
        }
        steps.push((0.0, 0.0));
        for i in 0..=ROUND {
            steps.push((FLAT, (FRAC_PI_4 * f32::from(i) / f32::from(ROUND)).tan()));
        }
        let mut mesh = Self::default();
        for (axis, side) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
            let first = mesh.positions.len();
            let turned = |x: f32, y: f32, z: f32| {
                // A right-handed frame whose third axis points out of the face.
                let [x, z] = [x * side, z * side];
                match axis {
                    0 => vec3(z, x, y),
                    1 => vec3(y, z, x),
                    _ => vec3(x, y, z),
                }
            };
            for &(y, out_y) in &steps {
                for &(x, out_x) in &steps {
                    let normal = vec3(out_x, out_y, 1.0).normalize();
                    let p = vec3(x, y, FLAT) + RADIUS * normal;
                    mesh.positions.push(turned(p.x, p.y, p.z));
                    mesh.normals.push(turned(normal.x, normal.y, normal.z));
                }
            }
            let n = steps.len();
            for row in 0..n - 1 {
                for column in 0..n - 1 {
                    let at = first + row * n + column;
                    for corner in [at, at + 1, at + n + 1, at, at + n + 1, at + n] {
                        mesh.indices.push(u32::try_from(corner).unwrap_or(0));
                    }
                }
            }
        }
        mesh.fitted()
    }
}

/// Positions moved and scaled as by [`Mesh::fitted`]. They are in f64, as corners may be near the largest f32 or
/// close together far from the origin.
pub(super) fn into_unit_sphere(positions: &[DVec3]) -> Vec<Vec3> {
    let low = positions.iter().fold(DVec3::INFINITY, |a, b| a.min(*b));
    let high = positions.iter().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
    let middle = 0.5 * (low + high);
    let radius = positions.iter().map(|p| (*p - middle).length()).fold(0.0, f64::max);
    let scale = if radius > 0.0 { 1.0 / radius } else { 1.0 };
    positions.iter().map(|p| ((*p - middle) * scale).as_vec3()).collect()
}

/// Why numbers are no mesh.
#[derive(Debug)]
pub(super) struct Mismatch {
    pub(super) expected: String,
    pub(super) found: String,
}

/// Normals weighted by angle, shared between vertices at equal positions. `+z` where no triangle has an area.
fn smooth_normals(positions: &[Vec3], indices: &[u32]) -> Vec<Vec3> {
    let mut shared: HashMap<[u32; 3], usize> = HashMap::with_capacity(positions.len());
    let group: Vec<usize> = positions
        .iter()
        .map(|p| {
            let next = shared.len();
            // Adding zero makes one of -0 and 0.
            *shared.entry((*p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(next)
        })
        .collect();
    let mut sums = vec![Vec3::ZERO; shared.len()];
    for triangle in indices.chunks_exact(3) {
        let corners = [0, 1, 2].map(|k| triangle[k] as usize);
        let [a, b, c] = corners.map(|i| positions[i]);
        let Some(normal) = (b - a).as_dvec3().cross((c - a).as_dvec3()).try_normalize() else { continue };
        for k in 0..3 {
            let here = positions[corners[k]];
            let to = |other: usize| (positions[corners[other % 3]] - here).as_dvec3();
            let angle = to(k + 1).angle_between(to(k + 2));
            sums[group[corners[k]]] += (normal * angle).as_vec3();
        }
    }
    group.into_iter().map(|g| sums[g].try_normalize().unwrap_or(Vec3::Z)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: positive when all triangles face outwards.
    fn volume(mesh: &Mesh) -> f32 {
        let at = |i: u32| mesh.positions[i as usize];
        mesh.indices.chunks_exact(3).map(|t| at(t[0]).dot(at(t[1]).cross(at(t[2]))) / 6.0).sum()
    }

    #[test]
    fn built_in_meshes_are_closed_face_outwards_and_touch_the_unit_sphere() {
        for (mesh, triangles) in [(Mesh::knot(), 49_152), (Mesh::rounded_box(), 6 * 2 * 34 * 34)] {
            assert_eq!(mesh.triangles(), triangles);
            assert!(volume(&mesh) > 0.1, "{}", volume(&mesh));
            let farthest = mesh.positions.iter().map(|p| p.length()).fold(0.0, f32::max);
            assert!((farthest - 1.0).abs() < 1e-5, "{farthest}");
            // Every edge, by position, is run through as often in one direction as in the other.
            let mut edges: HashMap<_, i32> = HashMap::new();
            let key = |i: u32| (mesh.positions[i as usize] * 1e5).round().as_ivec3();
            for t in mesh.indices.chunks_exact(3) {
                for k in 0..3 {
                    let (a, b) = (key(t[k]), key(t[(k + 1) % 3]));
                    *edges.entry((a.to_array(), b.to_array())).or_default() += 1;
                    *edges.entry((b.to_array(), a.to_array())).or_default() -= 1;
                }
            }
            assert!(edges.values().all(|&count| count == 0));
            // Made normals agree with the exact ones up to the size of a triangle.
            let made = Mesh::new(mesh.positions.clone(), Vec::new(), mesh.indices.clone()).unwrap();
            let worst = made.normals.iter().zip(&mesh.normals).map(|(a, b)| a.dot(*b)).fold(1.0, f32::min);
            assert!(worst > 0.99, "{worst}");
        }
    }

    #[test]
    fn the_box_has_the_volume_of_a_rounded_cube() {
        // Cube, slabs, quarter cylinders, eighths of a sphere, before the scale to the unit sphere.
        let (flat, r) = (0.75f32, 0.25f32);
        let exact = 8.0 * flat.powi(3)
            + 6.0 * 4.0 * flat * flat * r
            + 12.0 * 2.0 * flat * r * r * std::f32::consts::FRAC_PI_4
            + 4.0 / 3.0 * std::f32::consts::PI * r.powi(3);
        let scale = flat * 3.0f32.sqrt() + r;
        let found = volume(&Mesh::rounded_box()) * scale.powi(3);
        assert!((found / exact - 1.0).abs() < 1e-3, "{found} {exact}");
    }

    #[test]
    fn wrong_meshes_are_refused_with_both_sides() {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let refused = |p: Vec<Vec3>, n: Vec<Vec3>, i: Vec<u32>| Mesh::new(p, n, i).unwrap_err().to_string();
        let text = refused(corners.clone(), vec![], vec![0, 1, 3]);
        assert_eq!(text, "mesh: expected indices under the 3 vertices, found 3");
        assert!(refused(corners.clone(), vec![], vec![]).contains("found 0 indices"));
        assert!(refused(corners.clone(), vec![Vec3::Z], vec![0, 1, 2]).contains("no normals or 3, found 1"));
        let far = vec![Vec3::ZERO, Vec3::X, vec3(f32::NAN, 0.0, 0.0)];
        assert!(refused(far, vec![], vec![0, 1, 2]).contains("finite positions"));
        let flat = Mesh::new(vec![Vec3::ONE; 3], vec![], vec![0, 1, 2]).unwrap().fitted();
        assert_eq!(flat.normals, [Vec3::Z; 3]);
        assert_eq!(flat.positions, [Vec3::ZERO; 3]);
    }
}
