//! Light from all around: latitude-longitude maps in linear RGB.
//!
//! Convention: right-handed, `+y` up. A pixel at `u` (left to right) and `v` (top to bottom), both in
//! `[0, 1]`, is in the direction `(sin t sin p, cos t, -sin t cos p)` with `t = pi v` and
//! `p = 2 pi (u - 1/2)`: the middle of the map is at `-z`, the middle of its right half at `+x`, its left and
//! right edges at `+z`.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::base::error::{Error, Result};
use crate::base::raster::Raster;
use crate::brdf::Rgb;

/// A latitude-longitude map of radiance, linear RGB, finite and not negative.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    raster: Raster<[f32; 3]>,
}

/// One rectangular patch of an [`Environment`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvDirection {
    /// Unit direction towards the middle of the patch.
    pub direction: Vector3<f64>,
    /// Mean radiance over the patch.
    pub radiance: Rgb,
    /// Solid angle of the patch, sr.
    pub solid_angle: f64,
}

/// A soft light of [`Environment::studio`]: `peak exp(sharpness (d . axis - 1))`, a von Mises-Fisher lobe.
struct SoftLight {
    axis: [f64; 3],
    sharpness: f64,
    peak: Rgb,
}

/// Key, fill and rim light. They fall to half of the peak at an angle of `acos(1 - ln 2 / sharpness)`: 9, 28
/// and 13 degrees.
const STUDIO_LIGHTS: [SoftLight; 3] = [
    SoftLight { axis: [-0.55, 0.65, 0.60], sharpness: 60.0, peak: [50.0, 44.0, 36.0] },
    SoftLight { axis: [0.85, 0.10, 0.45], sharpness: 6.0, peak: [1.2, 1.6, 2.4] },
    SoftLight { axis: [0.60, 0.45, -0.65], sharpness: 28.0, peak: [6.0, 8.0, 11.0] },
];
const STUDIO_ZENITH: Rgb = [0.12, 0.16, 0.26];
const STUDIO_HORIZON: Rgb = [0.42, 0.42, 0.44];
const STUDIO_FLOOR: Rgb = [0.050, 0.042, 0.036];

impl Environment {
    /// A map of radiance.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] when there are no pixels, or a value is negative or not finite.
    pub fn new(raster: Raster<[f32; 3]>) -> Result<Self> {
        let (width, pixels) = (raster.width(), raster.pixels());
        if pixels.is_empty() {
            let found = format!("{width} x {}", raster.height());
            return Err(Error::argument("environment", "at least one pixel", found));
        }
        if let Some(at) = pixels.iter().position(|p| p.iter().any(|&x| !(x >= 0.0 && x.is_finite()))) {
            let found = format!("{:?} at column {} of row {}", pixels[at], at % width, at / width);
            return Err(Error::argument("environment", "finite radiance, not negative", found));
        }
        Ok(Self { raster })
    }

    /// The environment of the image metrics: a studio given by a formula, 192 x 96 pixels.
    ///
    /// With `d` the direction and `s = smoothstep(-0.08, 0.08, d.y)`, the radiance is
    /// `(1 - s) floor + s (horizon + (zenith - horizon) sqrt(max(d.y, 0)))` plus three soft lights
    /// `peak exp(sharpness (d . axis - 1))`: a warm key light above to the left of the viewer, who looks
    /// along `-z` (peak 50), a broad cool fill light from the right, and a cool rim light from behind.
    #[must_use]
    pub fn studio() -> Self {
        let (width, height) = (192, 96);
        let raster = Raster::from_fn(width, height, |column, row| {
            let u = (column as f64 + 0.5) / width as f64;
            let v = (row as f64 + 0.5) / height as f64;
            narrow(studio_radiance(&Self::direction(u, v)))
        });
        Self { raster }
    }

    /// Radiance, linear RGB.
    #[must_use]
    pub fn raster(&self) -> &Raster<[f32; 3]> {
        &self.raster
    }

    /// The unit direction at `(u, v)`, by the convention of this module.
    #[must_use]
    pub fn direction(u: f64, v: f64) -> Vector3<f64> {
        let (sin_t, cos_t) = (PI * v).sin_cos();
        let (sin_p, cos_p) = (TAU * (u - 0.5)).sin_cos();
        Vector3::new(sin_t * sin_p, cos_t, -sin_t * cos_p)
    }

    /// `u` and `v` of a direction of any length, each in `[0, 1]`, by the convention of this module.
    #[must_use]
    pub fn coordinates(direction: &Vector3<f64>) -> [f64; 2] {
        let [x, y, z]: [f64; 3] = (*direction).into();
        [x.atan2(-z) / TAU + 0.5, x.hypot(z).atan2(y) / PI]
    }

    /// The radiance at `(u, v)`, linear between the middles of pixels: the map is closed from left to right, and
    /// constant beyond its first and last row.
    #[must_use]
    pub fn interpolated(&self, [u, v]: [f64; 2]) -> Rgb {
        let (width, height) = (self.raster.width() as f64, self.raster.height() as f64);
        let (x, y) = (u * width - 0.5, v * height - 0.5);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "wrapped and clamped to the map"
        )]
        let at = |column: f64, row: f64| {
            let column = (column.rem_euclid(width) as usize).min(self.raster.width() - 1);
            self.raster.at(column, row.clamp(0.0, height - 1.0) as usize).map(f64::from)
        };
        let (left, top) = (x.floor(), y.floor());
        let (across, down) = (x - left, y - top);
        let four = [at(left, top), at(left + 1.0, top), at(left, top + 1.0), at(left + 1.0, top + 1.0)];
        let mix = |a: f64, b: f64, t: f64| a + t * (b - a);
        std::array::from_fn(|c| {
            mix(mix(four[0][c], four[1][c], across), mix(four[2][c], four[3][c], across), down)
        })
    }

    /// The map averaged to `columns x rows` pixels, as by [`Environment::average_to`].
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] when either number is 0.
    pub fn scaled_to(&self, columns: usize, rows: usize) -> Result<Self> {
        if columns == 0 || rows == 0 {
            return Err(Error::argument("environment", "at least one pixel", format!("{columns} x {rows}")));
        }
        let across = self.columns_of(columns);
        let mut pixels = vec![[0.0; 3]; columns * rows];
        pixels.par_chunks_mut(columns).enumerate().for_each(|(row, line)| {
            let down = self.rows_of(row, rows);
            for (pixel, spans) in line.iter_mut().zip(&across) {
                *pixel = narrow(self.mean_over(&down, spans));
            }
        });
        Ok(Self { raster: Raster::new(columns, rows, pixels)? })
    }

    /// The map as `columns x rows` patches, row by row. The radiance of a patch is the mean over its pixels,
    /// weighted by solid angle; a pixel on an edge is shared between patches. The flux
    /// `sum radiance solid_angle` is unchanged.
    #[must_use]
    pub fn average_to(&self, columns: usize, rows: usize) -> Vec<EnvDirection> {
        let across = self.columns_of(columns);
        let mut patches = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            let (top, bottom) = (row as f64 / rows as f64, (row + 1) as f64 / rows as f64);
            let band = (PI * top).cos() - (PI * bottom).cos();
            let down = self.rows_of(row, rows);
            for (column, spans) in across.iter().enumerate() {
                let u = (column as f64 + 0.5) / columns as f64;
                patches.push(EnvDirection {
                    direction: Self::direction(u, 0.5 * (top + bottom)),
                    radiance: self.mean_over(&down, spans),
                    solid_angle: band * TAU / columns as f64,
                });
            }
        }
        patches
    }

    /// The columns of the map that overlap each of `columns`, with both ends of the overlap.
    fn columns_of(&self, columns: usize) -> Vec<Vec<(usize, f64, f64)>> {
        (0..columns).map(|i| overlaps(i, columns, self.raster.width())).collect()
    }

    /// The rows of the map that overlap row `row` of `rows`, with the height of the overlap in `cos t`.
    fn rows_of(&self, row: usize, rows: usize) -> Vec<(usize, f64)> {
        overlaps(row, rows, self.raster.height())
            .into_iter()
            .map(|(y, low, high)| (y, (PI * low).cos() - (PI * high).cos()))
            .collect()
    }

    /// Mean radiance over a patch of rows and columns.
    fn mean_over(&self, down: &[(usize, f64)], across: &[(usize, f64, f64)]) -> Rgb {
        let mut sum = [0.0; 3];
        let mut total = 0.0;
        for &(y, weight_y) in down {
            for &(x, low, high) in across {
                let weight = weight_y * (high - low);
                total += weight;
                let pixel = self.raster.at(x, y);
                for c in 0..3 {
                    sum[c] += weight * f64::from(pixel[c]);
                }
            }
        }
        sum.map(|x| x / total)
    }
}

/// The formula of [`Environment::studio`].
fn studio_radiance(d: &Vector3<f64>) -> Rgb {
    let t = ((d.y + 0.08) / 0.16).clamp(0.0, 1.0);
    let above = t * t * (3.0 - 2.0 * t);
    let height = d.y.max(0.0).sqrt();
    std::array::from_fn(|c| {
        let sky = STUDIO_HORIZON[c] + (STUDIO_ZENITH[c] - STUDIO_HORIZON[c]) * height;
        let lights: f64 = STUDIO_LIGHTS
            .iter()
            .map(|light| {
                let cosine = d.dot(&Vector3::from(light.axis).normalize());
                light.peak[c] * (light.sharpness * (cosine - 1.0)).exp()
            })
            .sum();
        (1.0 - above) * STUDIO_FLOOR[c] + above * sky + lights
    })
}

/// The cells of an axis of `source` cells that overlap cell `i` of an axis of `target` cells. Each comes with
/// both ends of the overlap, in units of the whole axis.
fn overlaps(i: usize, target: usize, source: usize) -> Vec<(usize, f64, f64)> {
    // Positions are multiples of 1 / (target source), held as integers, so that shared edges are exact.
    let (begin, end) = (i * source, (i + 1) * source);
    let whole = (target * source) as f64;
    (begin / target..end.div_ceil(target))
        .map(|j| {
            let low = begin.max(j * target);
            let high = end.min((j + 1) * target);
            (j, low as f64 / whole, high as f64 / whole)
        })
        .collect()
}

#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of a map")]
fn narrow(rgb: Rgb) -> [f32; 3] {
    rgb.map(|x| x as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_fill_the_sphere_and_keep_the_flux() {
        // 50 x 23 pixels are divided evenly by neither 48 columns nor 24 rows.
        let pixels = (0..50 * 23).map(|i| [(i % 7) as f32, (i % 50) as f32, (i / 50) as f32]).collect();
        let map = Environment::new(Raster::new(50, 23, pixels).unwrap()).unwrap();
        let patches = map.average_to(48, 24);
        let whole: f64 = patches.iter().map(|p| p.solid_angle).sum();
        assert!((whole - 4.0 * PI).abs() < 1e-12);
        for c in 0..3 {
            let mut flux = 0.0;
            for (i, pixel) in map.raster().pixels().iter().enumerate() {
                let (top, bottom) = ((i / 50) as f64 / 23.0 * PI, (i / 50 + 1) as f64 / 23.0 * PI);
                flux += f64::from(pixel[c]) * (top.cos() - bottom.cos()) * TAU / 50.0;
            }
            let kept: f64 = patches.iter().map(|p| p.radiance[c] * p.solid_angle).sum();
            assert!((kept / flux - 1.0).abs() < 1e-12, "{kept} {flux}");
        }
        assert!(patches.iter().all(|p| (p.direction.norm() - 1.0).abs() < 1e-14));
        assert!(map.average_to(0, 5).is_empty());
        let small = map.scaled_to(48, 24).unwrap();
        for (pixel, patch) in small.raster().pixels().iter().zip(&patches) {
            assert_eq!(*pixel, narrow(patch.radiance));
        }
        assert!(map.scaled_to(0, 5).is_err());
    }

    #[test]
    fn the_axes_are_where_the_convention_says() {
        let gap = |u, v, x, y, z| (Environment::direction(u, v) - Vector3::new(x, y, z)).norm();
        assert!(gap(0.5, 0.5, 0.0, 0.0, -1.0) < 1e-15);
        assert!(gap(0.75, 0.5, 1.0, 0.0, 0.0) < 1e-15);
        assert!(gap(0.3, 0.0, 0.0, 1.0, 0.0) < 1e-15);
        assert!(gap(0.0, 0.5, 0.0, 0.0, 1.0) < 1e-15);
    }

    #[test]
    fn directions_have_their_coordinates_and_values_are_linear_between_pixels() {
        for (u, v) in [(0.1, 0.2), (0.5, 0.5), (0.93, 0.77)] {
            let [a, b] = Environment::coordinates(&(3.0 * Environment::direction(u, v)));
            assert!((a - u).abs() < 1e-12 && (b - v).abs() < 1e-12, "{a} {b}");
        }
        let map = Environment::new(Raster::from_fn(8, 4, |x, y| [x as f32, y as f32, 1.0])).unwrap();
        let close = |at: [f64; 2], expected: Rgb| {
            let found = map.interpolated(at);
            assert!((0..3).all(|c| (found[c] - expected[c]).abs() < 1e-12), "{at:?}: {found:?}");
        };
        close([2.5 / 8.0, 1.5 / 4.0], [2.0, 1.0, 1.0]);
        close([2.75 / 8.0, 1.75 / 4.0], [2.25, 1.25, 1.0]);
        // Between the last and the first column, and at the poles.
        close([0.0, 0.0], [3.5, 0.0, 1.0]);
        close([1.0, 1.0], [3.5, 3.0, 1.0]);
    }

    #[test]
    fn the_studio_has_its_brightest_light_above_to_the_left_of_the_viewer() {
        let patches = Environment::studio().average_to(48, 24);
        let brightest = patches.iter().max_by(|a, b| a.radiance[0].total_cmp(&b.radiance[0])).unwrap();
        assert!(brightest.radiance[0] > 40.0 && brightest.radiance[0] < 51.0, "{brightest:?}");
        let axis = Vector3::new(-0.55, 0.65, 0.60).normalize();
        assert!(brightest.direction.dot(&axis) > 0.99);
    }
}
