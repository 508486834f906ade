//! The matte ground on which an object stands, with its soft shadow.

use glam::Vec3;
use gpbrdf_core::Environment;
use gpbrdf_core::base::{Raster, quasi_random_pair};
use rayon::prelude::*;

use super::colour::luminance;
use super::gbuffer::Geometry;
use super::mesh::Mesh;

/// Texels along each side of the ground.
const TEXELS: usize = 224;
/// Half of a side, in radii of the unit sphere.
const HALF: f32 = 7.0;
/// The share of the light that the ground reflects.
const ALBEDO: f32 = 0.17;
/// How much of the tint of the light that is left in a shadow is shown.
const TINT: f32 = 0.3;
/// Columns and rows of patches to which the environment is averaged.
const PATCHES: (usize, usize) = (96, 48);
/// Triangles that are projected at most, all directions together.
const MOST_TRIANGLES: usize = 12_000_000;

/// A matte ground below an object, as an environment lights it: the object's shadow is on it. Renderers show it behind
/// the object, wherever the camera sees it from above; towards its rim it fades into the environment.
///
/// Its radiance is `albedo / pi` times the irradiance from above, over directions that the object does not hide. These
/// are drawn from the environment by their share of that irradiance, one from each of equally large shares; an object
/// hides a direction from where its projection along it falls. The ground is not reflected by the object.
///
/// Shadows have that luminance, but only three tenths of their own tint: what is left of the light where a warm lamp is
/// hidden may be as blue as the sky, and beside the colour of a material that looks like a stain.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    /// Radiance, rows along z from the far side (-z) to the near one, columns along x.
    radiance: Raster<[f32; 3]>,
    /// Its height, y.
    height: f32,
    horizon: f32,
}

/// Light from a distant direction, as an irradiance of the ground.
struct Beam {
    direction: Vec3,
    irradiance: [f32; 3],
}

impl Ground {
    /// The ground under an object. More `directions` make its shadow smoother; a mesh of many triangles gets fewer.
    /// Takes some milliseconds for a sphere and about one for every 10,000 projected triangles.
    #[must_use]
    pub fn new(geometry: &Geometry, environment: &Environment, directions: usize) -> Self {
        let mesh = match geometry {
            Geometry::Sphere => None,
            Geometry::Mesh(mesh) => Some(mesh),
        };
        let most = mesh.map_or(usize::MAX, |mesh| MOST_TRIANGLES / mesh.triangles().max(1));
        let beams = beams(environment, directions.clamp(1, most.max(8)));
        let height = mesh.map_or(-1.0, |mesh| mesh.positions.iter().map(|p| p.y).fold(1.0, f32::min));
        let sums = beams
            .par_iter()
            .fold(
                || vec![[0.0f32; 3]; TEXELS * TEXELS],
                |mut sums, beam| {
                    let hidden = hidden(mesh, height, beam.direction);
                    for (sum, _) in sums.iter_mut().zip(&hidden).filter(|(_, hidden)| !**hidden) {
                        for c in 0..3 {
                            sum[c] += beam.irradiance[c];
                        }
                    }
                    sums
                },
            )
            .reduce(
                || vec![[0.0; 3]; TEXELS * TEXELS],
                |a, b| std::iter::zip(a, b).map(|(a, b)| add(a, b)).collect(),
            );
        let open = beams.iter().fold([0.0; 3], |sum, beam| add(sum, beam.irradiance));
        let scaled =
            |i: usize, j: usize| toned(open, sums[j * TEXELS + i]).map(|x| x * ALBEDO / std::f32::consts::PI);
        // Neighbours share the noise of the few directions.
        let smooth = |i: usize, j: usize| {
            let near = |k: usize| k.saturating_sub(1)..=(k + 1).min(TEXELS - 1);
            let texels = near(j).flat_map(|y| near(i).map(move |x| (x, y)));
            let (sum, count) =
                texels.fold(([0.0; 3], 0.0), |(sum, count), (x, y)| (add(sum, scaled(x, y)), count + 1.0));
            sum.map(|x| x / count)
        };
        Self { radiance: Raster::from_fn(TEXELS, TEXELS, smooth), height, horizon: 0.0 }
    }

    /// The ground before another horizon: beyond its rim, what the environment shows above the horizon is mirrored at
    /// it up to this height of a unit direction, and goes on from there, in place of what the environment shows below.
    /// With 0 it shows the latter.
    #[must_use]
    pub fn with_horizon(self, horizon: f32) -> Self {
        Self { horizon, ..self }
    }

    /// Up to which height of a unit direction the environment is mirrored at the horizon.
    #[must_use]
    pub fn horizon(&self) -> f32 {
        self.horizon
    }

    /// Its height, y in the world.
    #[must_use]
    pub fn height(&self) -> f32 {
        self.height
    }

    /// Half of its side, in the world.
    #[must_use]
    pub fn half(&self) -> f32 {
        HALF
    }

    /// Its radiance: rows along z from -[`Self::half`] to it, columns along x.
    #[must_use]
    pub fn radiance(&self) -> &Raster<[f32; 3]> {
        &self.radiance
    }
}

fn add(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|c| a[c] + b[c])
}

/// An irradiance with [`TINT`] of its tint and the rest of the tint of the light without an object. Its luminance
/// stays.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of the device")]
fn toned(open: [f32; 3], irradiance: [f32; 3]) -> [f32; 3] {
    let whole = luminance(&open);
    let share = if whole > 0.0 { (luminance(&irradiance) / whole) as f32 } else { 0.0 };
    std::array::from_fn(|c| TINT * irradiance[c] + (1.0 - TINT) * share * open[c])
}

/// Directions above the ground, each of which stands for an equal share of the irradiance.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of the device")]
fn beams(environment: &Environment, count: usize) -> Vec<Beam> {
    let patches = environment.average_to(PATCHES.0, PATCHES.1);
    let above = patches.iter().filter(|patch| patch.direction.y > 0.02).map(|patch| {
        let irradiance = patch.radiance.map(|x| x * patch.direction.y * patch.solid_angle);
        (patch, irradiance, irradiance.iter().sum::<f64>() / 3.0)
    });
    let above: Vec<_> = above.filter(|(_, _, weight)| *weight > 0.0).collect();
    let total: f64 = above.iter().map(|(_, _, weight)| weight).sum();
    let share = total / count as f64;
    let (mut sum, mut next) = (0.0, 0.5 * share);
    let mut found = Vec::with_capacity(count);
    for (patch, irradiance, weight) in &above {
        sum += weight;
        while sum > next && found.len() < count {
            // Within the patch, so that shadows of one patch do not fall on one line.
            let size = std::f64::consts::TAU / PATCHES.0 as f64;
            let [turn, lift] = quasi_random_pair([0.5; 2], found.len()).map(|part| size * (part - 0.5));
            let d = patch.direction;
            let polar = (d.y.clamp(-1.0, 1.0).acos() + lift).clamp(0.0, 1.55);
            let azimuth = d.z.atan2(d.x) + turn;
            let direction = Vec3::new(
                (polar.sin() * azimuth.cos()) as f32,
                polar.cos() as f32,
                (polar.sin() * azimuth.sin()) as f32,
            );
            found.push(Beam { direction, irradiance: irradiance.map(|x| (x * share / weight) as f32) });
            next += share;
        }
    }
    found
}

/// Whether each texel of the ground is hidden from a direction.
fn hidden(mesh: Option<&Mesh>, height: f32, towards: Vec3) -> Vec<bool> {
    let mut hidden = vec![false; TEXELS * TEXELS];
    match mesh {
        None => {
            for (i, texel) in hidden.iter_mut().enumerate() {
                let at = Vec3::new(place(i % TEXELS), height, place(i / TEXELS));
                // The distance of the ray from the centre of the sphere.
                let along = -at.dot(towards);
                *texel = along > 0.0 && at.length_squared() - along * along < 1.0;
            }
        }
        Some(mesh) => {
            let projected: Vec<[f32; 2]> = mesh
                .positions
                .iter()
                .map(|p| {
                    let down = (p.y - height) / towards.y;
                    [column(p.x - down * towards.x), column(p.z - down * towards.z)]
                })
                .collect();
            for triangle in mesh.indices.chunks_exact(3) {
                let corners = [0, 1, 2].map(|k| projected[triangle[k] as usize]);
                fill(&mut hidden, corners);
            }
        }
    }
    hidden
}

/// The middle of a column or row of texels in the world.
#[expect(clippy::cast_precision_loss, reason = "a few texels")]
fn place(i: usize) -> f32 {
    HALF * (2.0 * (i as f32 + 0.5) / TEXELS as f32 - 1.0)
}

/// The column of a place, with its fraction: whole numbers are middles of texels.
#[expect(clippy::cast_precision_loss, reason = "a few texels")]
fn column(x: f32) -> f32 {
    0.5 * (x / HALF + 1.0) * TEXELS as f32 - 0.5
}

/// Marks the texels whose middle is within half a texel of a triangle's box and inside of the triangle, or, of a small
/// triangle, the one that is nearest.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "clamped"
)]
fn fill(hidden: &mut [bool], [a, b, c]: [[f32; 2]; 3]) {
    let last = (TEXELS - 1) as f32;
    let range = |k: usize| (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
    let ((left, right), (top, bottom)) = (range(0), range(1));
    if !(right >= -0.5 && bottom >= -0.5 && left <= last + 0.5 && top <= last + 0.5) {
        return;
    }
    let clamped = |x: f32| x.clamp(0.0, last);
    if right - left < 1.5 && bottom - top < 1.5 {
        for [x, y] in [a, b, c] {
            hidden[clamped(y.round()) as usize * TEXELS + clamped(x.round()) as usize] = true;
        }
        return;
    }
    let edge =
        |p: [f32; 2], q: [f32; 2], x: f32, y: f32| (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
    for row in clamped(top.ceil()) as usize..=clamped(bottom.floor()) as usize {
        for column in clamped(left.ceil()) as usize..=clamped(right.floor()) as usize {
            let (x, y) = (column as f32, row as f32);
            let sides = [edge(a, b, x, y), edge(b, c, x, y), edge(c, a, x, y)];
            if sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0) {
                hidden[row * TEXELS + column] = true;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uniform() -> Environment {
        Environment::new(Raster::filled(16, 8, [2.0, 1.0, 0.5])).unwrap()
    }

    #[test]
    fn the_shadow_of_a_sphere_under_a_uniform_sky_is_the_form_factor() {
        // A unit sphere that touches the ground hides (1 + r^2)^(-3/2) of the irradiance at distance r.
        let ground = Ground::new(&Geometry::Sphere, &uniform(), 4000);
        let expected = |r: f32| ALBEDO * (1.0 - (1.0 + r * r).powf(-1.5));
        for (i, texel) in ground.radiance().pixels().iter().enumerate() {
            let r = place(i % TEXELS).hypot(place(i / TEXELS));
            let gap = (texel[1] - expected(r)).abs();
            assert!(gap < 0.012, "at {r}: {} and {}", texel[1], expected(r));
            assert!((texel[0] - 2.0 * texel[1]).abs() < 1e-3 && (texel[2] - 0.5 * texel[1]).abs() < 1e-3);
        }
    }

    #[test]
    fn a_mesh_of_the_sphere_has_the_shadow_of_the_sphere() {
        let (rows, columns) = (40u16, 80u16);
        let mut mesh = Mesh::default();
        for i in 0..=rows {
            let polar = std::f32::consts::PI * f32::from(i) / f32::from(rows);
            for j in 0..columns {
                let azimuth = std::f32::consts::TAU * f32::from(j) / f32::from(columns);
                let p = Vec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin());
                mesh.positions.push(p);
                mesh.normals.push(p);
            }
        }
        let at = |i: u16, j: u16| u32::from(i * columns + j % columns);
        for i in 0..rows {
            for j in 0..columns {
                mesh.indices.extend([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
                mesh.indices.extend([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
        let exact = Ground::new(&Geometry::Sphere, &Environment::studio(), 200);
        let found = Ground::new(&Geometry::Mesh(mesh), &Environment::studio(), 200);
        assert!((found.height() + 1.0).abs() < 1e-6);
        let pairs = exact.radiance().pixels().iter().zip(found.radiance().pixels());
        let brightest = exact.radiance().pixels().iter().map(|p| p[1]).fold(0.0, f32::max);
        let gap: f32 = pairs.map(|(a, b)| (a[1] - b[1]).abs()).sum::<f32>() / (TEXELS * TEXELS) as f32;
        assert!(gap < 0.01 * brightest, "{gap} of {brightest}");
    }

    #[test]
    fn shadows_keep_their_luminance_and_little_of_their_tint() {
        let environment = Environment::studio();
        let (open, shadow) = ([4.0, 3.8, 3.6], [0.5, 0.7, 1.1]);
        let found = toned(open, shadow);
        assert!((luminance(&found) / luminance(&shadow) - 1.0).abs() < 1e-6, "{found:?}");
        assert_eq!(toned([0.0; 3], [0.0; 3]), [0.0; 3]);
        let ground = Ground::new(&Geometry::Sphere, &environment, 320);
        let blue = |p: &[f32; 3]| p[2] / p[0];
        // The fill lights of the studio are twice as blue as red; its key light is warm.
        let most = ground.radiance().pixels().iter().map(blue).fold(0.0, f32::max);
        let least = ground.radiance().pixels().iter().map(blue).fold(f32::INFINITY, f32::min);
        assert!(most < 1.35 * least && most > 1.02 * least, "{most} and {least}");
    }

    #[test]
    fn a_black_sky_and_odd_meshes_are_no_trouble() {
        let black = Environment::new(Raster::filled(4, 2, [0.0; 3])).unwrap();
        let ground = Ground::new(&Geometry::Sphere, &black, 10);
        assert!(ground.radiance().pixels().iter().all(|p| *p == [0.0; 3]));
        let far = Mesh {
            positions: vec![Vec3::splat(1e9), Vec3::new(-1e9, 5.0, 0.0), Vec3::ZERO],
            normals: vec![Vec3::Y; 3],
            indices: vec![0, 1, 2],
        };
        let ground = Ground::new(&Geometry::Mesh(far), &uniform(), 10);
        assert!(ground.radiance().pixels().iter().flatten().all(|x| x.is_finite()));
    }
}
