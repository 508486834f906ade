//! A sphere seen from afar: the renderer of the image metrics and of the sphere pictures.
//!
//! Camera space: `x` right, `y` up, `z` towards the viewer. The viewer is at infinity, so that `wo = +z`
//! everywhere and the pixel at `(x, y)` of the unit disc has the normal `(x, y, sqrt(1 - x^2 - y^2))`. The
//! sphere touches the edges of the frame. A pixel belongs to the sphere if its centre does.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::base::error::{Error, Result};
use crate::base::raster::Raster;
use crate::base::trigonometry::atan2;
use crate::brdf::Rgb;
use crate::brdf::angles::GRAZING_COSINE;
use crate::brdf::angles::HalfDiff;
use crate::brdf::table::{BrdfTable, Trilinear};
use crate::judge::environment::Environment;
use crate::judge::image::Image;

/// Rows and columns of the images that the metrics compare.
pub const SPHERE_SIZE: usize = 96;
/// Columns and rows of the patches over which an environment is averaged.
pub const ENV_PATCHES: (usize, usize) = (48, 24);
/// Direction to the light of [`render_point`] in camera space, before normalisation.
pub const POINT_LIGHT: [f64; 3] = [1.0, 1.0, 1.5];

/// Rows and columns of a tile of pixels that are shaded together.
const TILE: usize = 8;

/// Light from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistantLight {
    /// Unit direction towards the light, in camera space: `+x` right, `+y` up, `+z` towards the viewer.
    pub direction: Vector3<f64>,
    /// Irradiance on a surface that faces the light.
    pub irradiance: Rgb,
}

/// The lights that represent an environment: one for each of `patches` (columns, rows) that is not black.
#[must_use]
pub fn environment_lights(environment: &Environment, patches: (usize, usize)) -> Vec<DistantLight> {
    environment
        .average_to(patches.0, patches.1)
        .iter()
        .filter(|patch| patch.radiance.iter().any(|&x| x > 0.0))
        .map(|patch| DistantLight {
            direction: patch.direction,
            irradiance: patch.radiance.map(|x| x * patch.solid_angle),
        })
        .collect()
}

/// The sphere of each table under `environment`, whose directions are taken as directions of camera space:
/// `L = sum_k radiance_k f(wi_k, wo) cos theta_k solid_angle_k` over [`ENV_PATCHES`].
///
/// `f` is looked up trilinearly, and all tables share the geometry of a lookup. Directions with a cosine
/// below [`GRAZING_COSINE`] add nothing. `size` is the number of rows and of columns. Parallel over tiles;
/// the result does not depend on the number of threads. Cost: about 4 million lookups at a `size` of 96.
#[must_use]
pub fn render_env(tables: &[&BrdfTable], environment: &Environment, size: usize) -> Vec<Image> {
    let lights = environment_lights(environment, ENV_PATCHES);
    render(tables, &lights, size)
}

/// The sphere of each table under one white light at infinity in the direction [`POINT_LIGHT`]. Its
/// irradiance is pi, so that a white Lambertian surface that faces it has radiance 1.
#[must_use]
pub fn render_point(tables: &[&BrdfTable], size: usize) -> Vec<Image> {
    let light = DistantLight { direction: Vector3::from(POINT_LIGHT).normalize(), irradiance: [PI; 3] };
    render(tables, &[light], size)
}

fn render(tables: &[&BrdfTable], lights: &[DistantLight], size: usize) -> Vec<Image> {
    // Without cancellation there is no error.
    render_sphere(tables, lights, size, &|| false).unwrap_or_default()
}

/// The sphere of each table under any lights, computed like [`render_env`]. `cancelled` is called once per
/// tile.
///
/// # Errors
/// [`Error::Cancelled`] as soon as `cancelled` returns true.
pub fn render_sphere(
    tables: &[&BrdfTable],
    lights: &[DistantLight],
    size: usize,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Image>> {
    let center = |i: usize| 2.0 * (i as f64 + 0.5) / size as f64 - 1.0;
    let tiles = size.div_ceil(TILE);
    let shaded: Result<Vec<Shaded>> = (0..tiles * tiles)
        .into_par_iter()
        .map(|tile| {
            if cancelled() {
                return Err(Error::Cancelled);
            }
            let (left, top) = (tile % tiles * TILE, tile / tiles * TILE);
            let mut pixels = Vec::with_capacity(TILE * TILE);
            for row in top..(top + TILE).min(size) {
                for column in left..(left + TILE).min(size) {
                    let frame = ShadingFrame::on_disc(center(column), -center(row));
                    pixels.extend(frame.map(|frame| (row * size + column, frame)));
                }
            }
            Ok(shade(tables, lights, &pixels))
        })
        .collect();
    let shaded = shaded?;
    let mask: Vec<bool> = (0..size * size)
        .map(|i| {
            let (x, y) = (center(i % size), center(i / size));
            x * x + y * y < 1.0
        })
        .collect();
    let images = (0..tables.len()).map(|t| {
        let mut raster = Raster::filled(size, size, [0.0; 3]);
        for (i, radiance) in shaded.iter().flatten() {
            raster.pixels_mut()[*i] = narrow(radiance[t]);
        }
        Image { raster, mask: mask.clone() }
    });
    Ok(images.collect())
}

/// The local frame of a point to be shaded: the normal is `+z`, and the viewer is in the plane of `x` and
/// `z`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingFrame {
    /// Tangent towards the viewer: the local x axis.
    e: Vector3<f64>,
    f: Vector3<f64>,
    normal: Vector3<f64>,
    wo: Vector3<f64>,
    min_cosine: f64,
}

impl ShadingFrame {
    /// The frame of a surface with a unit normal, seen from the unit direction `to_viewer`. `None` if the
    /// cosine between them is not positive or is below `min_cosine`: such a surface is shown black.
    #[must_use]
    pub fn new(normal: &Vector3<f64>, to_viewer: &Vector3<f64>, min_cosine: f64) -> Option<Self> {
        let cosine = normal.dot(to_viewer);
        if !(cosine > 0.0) || cosine < min_cosine {
            return None;
        }
        let across = to_viewer - cosine * normal;
        let sine = across.norm();
        let e = if sine > 0.0 { across / sine } else { any_perpendicular(normal) };
        let wo = Vector3::new(sine, 0.0, cosine);
        Some(Self { e, f: normal.cross(&e), normal: *normal, wo, min_cosine })
    }

    /// The frame at `(x, y)` of the unit disc, seen from `+z`; `None` where the sphere is shown black.
    fn on_disc(x: f64, y: f64) -> Option<Self> {
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        if z < GRAZING_COSINE {
            return None;
        }
        let normal = Vector3::new(x, y, z);
        let sine = x.hypot(y);
        let e = if sine > 0.0 { Vector3::new(-x * z / sine, -y * z / sine, sine) } else { Vector3::x() };
        let wo = Vector3::new(sine, 0.0, z);
        Some(Self { e, f: normal.cross(&e), normal, wo, min_cosine: GRAZING_COSINE })
    }

    /// The directions `(wi, wo)` to a light in the unit direction `light` and to the viewer, in the local frame. `None`
    /// if the cosine at the light is not positive or is below the `min_cosine` of the frame.
    #[inline]
    #[must_use]
    pub fn directions(&self, light: &Vector3<f64>) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let cosine = light.dot(&self.normal);
        if !(cosine > 0.0) || cosine < self.min_cosine {
            return None;
        }
        Some((Vector3::new(light.dot(&self.e), light.dot(&self.f), cosine), self.wo))
    }

    /// The unit direction to the viewer in the local frame.
    #[must_use]
    pub fn to_viewer(&self) -> Vector3<f64> {
        self.wo
    }

    /// The direction of space for one of the local frame.
    #[must_use]
    pub fn to_world(&self, local: &Vector3<f64>) -> Vector3<f64> {
        local.x * self.e + local.y * self.f + local.z * self.normal
    }

    /// Adds the radiance `f(wi, wo) cos theta_i irradiance` that the point reflects towards the viewer to
    /// `sums`, one for each table. The light comes from the unit direction `light`; `irradiance` is that of a
    /// surface that faces it. `f` is looked up trilinearly. Nothing is added if the cosine is not positive or
    /// is below the `min_cosine` of the frame.
    #[inline]
    pub fn add_light(&self, tables: &[&BrdfTable], light: &Vector3<f64>, irradiance: Rgb, sums: &mut [Rgb]) {
        let Some((wi, wo)) = self.directions(light) else { return };
        let cosine = wi.z;
        let at = Trilinear::new(half_diff(&wi, &wo));
        for (table, sum) in tables.iter().zip(sums) {
            let value = table.lookup(&at);
            for c in 0..3 {
                sum[c] += irradiance[c] * cosine * f64::from(value[c]);
            }
        }
    }
}

/// A unit vector that is perpendicular to a unit vector.
fn any_perpendicular(normal: &Vector3<f64>) -> Vector3<f64> {
    let axis = if normal.x.abs() < 0.5 { Vector3::x() } else { Vector3::y() };
    (axis - axis.dot(normal) * normal).normalize()
}

/// Pixels of a tile: the index of each, and its radiance for each table.
type Shaded = Vec<(usize, Vec<Rgb>)>;

/// Shades a tile light by light, since neighbouring pixels then read neighbouring cells.
fn shade(tables: &[&BrdfTable], lights: &[DistantLight], pixels: &[(usize, ShadingFrame)]) -> Shaded {
    let mut radiance: Vec<_> = pixels.iter().map(|&(i, _)| (i, vec![[0.0; 3]; tables.len()])).collect();
    for light in lights {
        for ((_, frame), (_, sums)) in pixels.iter().zip(&mut radiance) {
            frame.add_light(tables, &light.direction, light.irradiance, sums);
        }
    }
    radiance
}

/// [`HalfDiff::from_directions`] with an error of at most 5e-8 radians, for unit directions above the
/// horizon. The sine and cosine of `theta_h` are taken from `h` itself, and the three arctangents from a
/// polynomial.
fn half_diff(wi: &Vector3<f64>, wo: &Vector3<f64>) -> HalfDiff {
    let sum = wi + wo;
    let length = sum.norm();
    let horizontal = (sum.x * sum.x + sum.y * sum.y).sqrt();
    let theta_d = atan2((wi - wo).norm(), length);
    let (theta_h, cos_phi_h, sin_phi_h) = if horizontal <= 1e-15 {
        (0.0, 1.0, 0.0)
    } else {
        (atan2(horizontal, sum.z), sum.x / horizontal, sum.y / horizontal)
    };
    let (sin_theta_h, cos_theta_h) = (horizontal / length, sum.z / length);
    let x = cos_theta_h * (cos_phi_h * wi.x + sin_phi_h * wi.y) - sin_theta_h * wi.z;
    let y = cos_phi_h * wi.y - sin_phi_h * wi.x;
    let azimuth = atan2(y, x);
    let folded = if azimuth < 0.0 { azimuth + PI } else { azimuth };
    let phi_d = if theta_d < 1e-12 || folded >= PI { 0.0 } else { folded };
    HalfDiff { theta_h: theta_h.min(FRAC_PI_2), theta_d: theta_d.min(FRAC_PI_2), phi_d }
}

#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of an image")]
fn narrow(rgb: Rgb) -> [f32; 3] {
    rgb.map(|x| x as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Brdf;
    use crate::brdf::angles::direction;

    #[test]
    fn fast_angles_agree_with_the_exact_ones() {
        for i in 1..40_000 {
            let i = f64::from(i);
            let [a, b, c, d] =
                [0.819_172_513, 0.671_043_606, 0.549_700_477, 0.450_307_53].map(|g| (i * g).fract());
            let wi = direction(a * 1.49, b * 6.2);
            let wo = if i < 500.0 { wi + 1e-3 * direction(1.5, d) } else { direction(c * 1.49, d * 6.2) };
            let wo = wo.normalize();
            let exact = HalfDiff::from_directions(&wi, &wo);
            let fast = half_diff(&wi, &wo);
            assert!((exact.theta_h - fast.theta_h).abs() < 5e-8, "{exact:?} {fast:?}");
            assert!((exact.theta_d - fast.theta_d).abs() < 5e-8, "{exact:?} {fast:?}");
            let gap = (exact.phi_d - fast.phi_d).abs();
            assert!(gap.min(PI - gap) < 1e-7, "{exact:?} {fast:?}");
        }
        let n = Vector3::z();
        assert_eq!(half_diff(&n, &n), HalfDiff::default());
        let mirror = half_diff(&direction(0.7, 0.5), &direction(0.7, 0.5 + PI));
        assert!(mirror.theta_h < 1e-14 && (mirror.phi_d - 0.5).abs() < 1e-7);
    }

    #[test]
    fn a_lambert_sphere_in_constant_light_has_the_closed_form() {
        let table = BrdfTable::from_fn(|_| [0.5 / PI, 0.25 / PI, 0.0]);
        let white = Environment::new(Raster::filled(4, 2, [2.0; 3])).unwrap();
        let images = render_env(&[&table, &table], &white, SPHERE_SIZE);
        assert_eq!(images.len(), 2);
        assert_eq!(images[0], images[1]);
        let inside = images[0].mask().iter().filter(|&&m| m).count();
        assert!((7230..7250).contains(&inside), "{inside}");
        // integral of cos over cos > 0.08 is pi (1 - 0.08^2); the patches are 7.5 degrees wide.
        let expected = 2.0 * 0.5 * (1.0 - GRAZING_COSINE * GRAZING_COSINE);
        let mut worst: f64 = 0.0;
        let (mut mean, mut lit) = (0.0, 0usize);
        for pixel in images[0].sphere_pixels() {
            if pixel[0] > 0.0 {
                worst = worst.max((f64::from(pixel[0]) / expected - 1.0).abs());
                mean += f64::from(pixel[0]) / expected;
                lit += 1;
                assert!((pixel[1] / pixel[0] - 0.5).abs() < 1e-5 && pixel[2] == 0.0);
            }
        }
        assert!(worst < 0.02, "{worst}");
        assert!((mean / lit as f64 - 1.0).abs() < 2e-3);
        assert!((10..200).contains(&(inside - lit)), "{inside} {lit}");
    }

    #[test]
    fn the_point_light_picture_is_f_cos_pi_right_way_up() {
        let blinn = |a: HalfDiff| [0.1 + 2.0 * a.theta_h.cos().powi(20), 0.1, 0.2 * a.theta_d];
        let table = BrdfTable::from_fn(blinn);
        let image = render_point(&[&table], SPHERE_SIZE).remove(0);
        let light = Vector3::from(POINT_LIGHT).normalize();
        for (row, column) in [(20, 60), (40, 50), (48, 48), (30, 75)] {
            let x = (column as f64 + 0.5) / 48.0 - 1.0;
            let y = 1.0 - (row as f64 + 0.5) / 48.0;
            let normal = Vector3::new(x, y, (1.0 - x * x - y * y).sqrt());
            let turn = nalgebra::Rotation3::rotation_between(&normal, &Vector3::z()).unwrap();
            let (wi, wo) = (turn * light, turn * Vector3::z());
            let f = table.eval(&wi, &wo);
            for (f, found) in f.iter().zip(image.raster().at(column, row)) {
                let expected = PI * f * normal.dot(&light);
                let found = f64::from(*found);
                assert!((found / expected - 1.0).abs() < 1e-5, "{row} {column}: {found} {expected}");
            }
        }
        assert_eq!(*image.raster().at(15, 80), [0.0; 3]);
    }
}
