//! Polygons cut into triangles.

use earcut::Earcut;
use glam::{DVec2, DVec3};

/// Cuts polygons into triangles; its memory is used again.
#[derive(Default)]
pub(super) struct Cutter {
    earcut: Earcut<f64>,
    plane: Vec<[f64; 2]>,
    triangles: Vec<u32>,
}

impl Cutter {
    /// The triangles of a polygon, as indices of its corners, in its sense of rotation. They are a fan from the
    /// first corner where no triangle of it is turned over, which is the case for every convex polygon. Others are
    /// cut by their ears, on the plane of their mean normal (M. E. Newell's): D. Eberly, "Triangulation by Ear
    /// Clipping" (2002). A polygon that crosses itself is cut in some way.
    pub(super) fn cut(&mut self, corners: &[DVec3]) -> &[u32] {
        self.triangles.clear();
        let count = u32::try_from(corners.len()).unwrap_or(u32::MAX);
        if count < 3 {
            return &self.triangles;
        }
        let fan = (1..count - 1).flat_map(|i| [0, i, i + 1]);
        if count == 3 || !self.project(corners) || self.is_fan() {
            self.triangles.extend(fan);
            return &self.triangles;
        }
        self.earcut.earcut_slice(&self.plane, &[], &mut self.triangles);
        if self.triangles.is_empty() {
            self.triangles.extend(fan);
        }
        for triangle in self.triangles.as_chunks_mut::<3>().0 {
            let [a, b, c] = triangle.map(|i| DVec2::from(self.plane[i as usize]));
            if (b - a).perp_dot(c - a) < 0.0 {
                triangle.swap(1, 2);
            }
        }
        &self.triangles
    }

    /// Corners on the plane of the polygon's mean normal, which is then counter-clockwise; about 1 in size.
    /// False where there is no such plane.
    fn project(&mut self, corners: &[DVec3]) -> bool {
        let first = corners[0];
        let size = corners.iter().map(|p| (*p - first).abs().max_element()).fold(0.0, f64::max);
        if !(size > 0.0 && size.is_finite()) {
            return false;
        }
        let local = |i: usize| (corners[i % corners.len()] - first) / size;
        let normal: DVec3 = (0..corners.len()).map(|i| local(i).cross(local(i + 1))).sum();
        let Some(normal) = normal.try_normalize() else { return false };
        let (right, up) = normal.any_orthonormal_pair();
        let sense = right.cross(up).dot(normal).signum();
        self.plane.clear();
        self.plane.extend((0..corners.len()).map(|i| [local(i).dot(right), sense * local(i).dot(up)]));
        true
    }

    /// Whether no triangle of the fan from the first corner is turned over.
    fn is_fan(&self) -> bool {
        let first = DVec2::from(self.plane[0]);
        self.plane[1..].windows(2).all(|pair| {
            let [a, b] = [pair[0], pair[1]].map(|p| DVec2::from(p) - first);
            // Within the rounding of coordinates that are about 1.
            a.perp_dot(b) >= -1e-12
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, dvec3};

    /// Area of a polygon of the plane `z = 0` by the shoelace formula.
    fn area(corners: &[DVec3]) -> f64 {
        let next = |i: usize| corners[(i + 1) % corners.len()];
        0.5 * corners.iter().enumerate().map(|(i, p)| p.truncate().perp_dot(next(i).truncate())).sum::<f64>()
    }

    #[test]
    fn the_triangles_of_a_polygon_have_its_area_and_none_is_turned_over() {
        // A star with more and more rays is as concave as can be.
        for rays in [2u32, 3, 5, 50, 2000] {
            let at = |i: u32| {
                let angle = std::f64::consts::PI * f64::from(i) / f64::from(rays);
                let radius = if i.is_multiple_of(2) { 1.0 } else { 0.3 };
                dvec3(radius * angle.cos(), radius * angle.sin(), 0.0)
            };
            let flat: Vec<DVec3> = (0..2 * rays).map(at).collect();
            for turn in [DMat3::IDENTITY, DMat3::from_rotation_x(1.0) * DMat3::from_rotation_y(2.5)] {
                for (scale, shift) in [(1.0, 0.0), (1e-9, 0.0), (3.0, 1e6)] {
                    let placed: Vec<DVec3> =
                        flat.iter().map(|p| turn * (scale * *p) + DVec3::splat(shift)).collect();
                    let mut cutter = Cutter::default();
                    let triangles = cutter.cut(&placed).to_vec();
                    assert_eq!(triangles.len(), 3 * (flat.len() - 2));
                    let mut sum = 0.0;
                    for triangle in triangles.as_chunks::<3>().0 {
                        let part = area(&triangle.map(|i| flat[i as usize]));
                        assert!(part >= -1e-9, "{rays} {part}");
                        sum += part;
                    }
                    assert!((sum / area(&flat) - 1.0).abs() < 1e-9, "{rays} {scale} {sum}");
                }
            }
        }
    }

    #[test]
    fn convex_polygons_are_fans_and_no_polygon_is_too_strange() {
        let mut cutter = Cutter::default();
        let square = [dvec3(0.0, 0.0, 1.0), dvec3(1.0, 0.0, 1.0), dvec3(1.0, 1.0, 1.0), dvec3(0.0, 1.0, 1.0)];
        assert_eq!(cutter.cut(&square), [0, 1, 2, 0, 2, 3]);
        let bow = [square[0], square[2], square[1], square[3]];
        assert!(cutter.cut(&bow).len() <= 6);
        assert_eq!(cutter.cut(&[DVec3::ZERO; 5]).len(), 9);
        assert!(cutter.cut(&square[..2]).is_empty());
    }
}
