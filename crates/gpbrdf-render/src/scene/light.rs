//! Lights, and how directions of environment maps are drawn.

use std::f64::consts::{PI, TAU};

use glam::Vec3;
use gpbrdf_core::Environment;
use gpbrdf_core::base::Raster;
use gpbrdf_core::judge::{EnvDirection, POINT_LIGHT};

use super::colour::luminance;
use crate::context::Context;
use crate::error::{Error, Result};

/// The one light of a scene. Nothing casts a shadow, and light is reflected once.
#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    /// Light from infinity.
    Directional {
        /// Direction to the light, of any length but 0.
        direction: Vec3,
        /// Irradiance on a surface that faces the light, RGB.
        irradiance: [f32; 3],
    },
    /// Light from a point, which falls off with the square of the distance.
    Point {
        /// Position of the light.
        position: Vec3,
        /// Radiant intensity, RGB: irradiance at distance 1.
        intensity: [f32; 3],
    },
    /// Light from all directions, by a map in the convention of [`Environment`].
    Environment(EnvironmentLight),
}

impl Light {
    /// The light of the image metrics, `gpbrdf_core::judge::render_point`: white, from [`POINT_LIGHT`], with an
    /// irradiance of pi.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "small constants")]
    pub fn of_metrics() -> Self {
        let direction = Vec3::from_array(POINT_LIGHT.map(|x| x as f32));
        Self::Directional { direction, irradiance: [std::f32::consts::PI; 3] }
    }

    /// Checks that the light's numbers make sense.
    ///
    /// # Errors
    /// [`gpbrdf_core::Error::InvalidArgument`] when a number is not finite, a direction is zero, or a light
    /// is negative.
    pub fn check(&self) -> Result<()> {
        let wrong = |expected: &str, found: String| Err(Error::argument("light", expected, found));
        match self {
            Self::Directional { direction, .. } if direction.try_normalize().is_none() => {
                wrong("a direction", direction.to_string())
            }
            Self::Point { position, .. } if !position.is_finite() => {
                wrong("a finite position", position.to_string())
            }
            Self::Directional { irradiance: rgb, .. } | Self::Point { intensity: rgb, .. }
                if !rgb.iter().all(|&x| x >= 0.0 && x.is_finite()) =>
            {
                wrong("finite light, not negative", format!("{rgb:?}"))
            }
            _ => Ok(()),
        }
    }
}

/// An environment map and the distribution from which its directions are drawn.
///
/// Each pixel is a patch of constant radiance. First a row is drawn by its share of the flux, then a pixel of
/// the row, then a direction uniformly in the solid angle of the pixel. The density, in 1/sr, is the
/// luminance divided by the integral of the luminance. M. Pharr, W. Jakob and G. Humphreys, "Physically Based
/// Rendering", 3rd edition, section 14.2.4, with bands of equal cosine in place of the factor `sin theta`.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentLight {
    /// Radiance and, last, density in 1/sr.
    texels: Raster<[f32; 4]>,
    /// `height + 1` values of rows, then `width + 1` of each row's pixels; each from 0 to 1.
    cumulative: Vec<f32>,
}

/// The most pixels of a map on a device: 8192 x 4096, which take 0.5 GB there.
const MAX_PIXELS: usize = 1 << 25;

impl EnvironmentLight {
    /// Prepares a map for a device. Where the device cannot hold it, or where it has more than 2^25 pixels, means over
    /// 2 x 2, 3 x 3, ... pixels take its place, which keep the flux.
    ///
    /// # Errors
    /// Those of [`Environment::scaled_to`].
    pub fn for_device(context: &Context, environment: &Environment) -> Result<Self> {
        let map = environment.raster();
        let (width, height) = (map.width(), map.height());
        let limits = context.device().limits();
        let side = limits.max_texture_dimension_2d as usize;
        let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let factor = factor_to_fit([width, height], side, bytes);
        if factor == 1 {
            return Ok(Self::new(environment));
        }
        Ok(Self::new(&environment.scaled_to(width.div_ceil(factor), height.div_ceil(factor))?))
    }

    /// Prepares a map. Directions of a black map are drawn uniformly.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "single precision is the shader's")]
    pub fn new(environment: &Environment) -> Self {
        let radiance = environment.raster();
        let (width, height) = (radiance.width(), radiance.height());
        let band = |row: usize| {
            let edge = |i: usize| (PI * i as f64 / height as f64).cos();
            edge(row) - edge(row + 1)
        };
        let rows: Vec<&[[f32; 3]]> = radiance.pixels().chunks_exact(width).collect();
        let flux = |row: &[[f32; 3]]| row.iter().map(luminance).sum::<f64>();
        let black = !rows.iter().any(|row| flux(row) > 0.0);
        let weights = rows.iter().enumerate().map(|(y, row)| band(y) * if black { 1.0 } else { flux(row) });
        let mut cumulative = running_shares(&weights.collect::<Vec<_>>());
        for row in &rows {
            cumulative.extend(running_shares(&row.iter().map(luminance).collect::<Vec<_>>()));
        }
        // The density of the rounded shares, so that estimates stay unbiased.
        let step = |i: usize| f64::from(cumulative[i + 1]) - f64::from(cumulative[i]);
        let texels = Raster::from_fn(width, height, |x, y| {
            let share = step(y) * step(height + 1 + y * (width + 1) + x);
            let [r, g, b] = *radiance.at(x, y);
            [r, g, b, (share / (band(y) * TAU / width as f64)) as f32]
        });
        Self { texels, cumulative }
    }

    /// Radiance and density in 1/sr of every pixel.
    #[must_use]
    pub fn texels(&self) -> &Raster<[f32; 4]> {
        &self.texels
    }

    /// Running shares: `height + 1` of the rows, then `width + 1` of each row's pixels.
    #[must_use]
    pub fn cumulative(&self) -> &[f32] {
        &self.cumulative
    }
}

impl From<&Environment> for EnvironmentLight {
    fn from(environment: &Environment) -> Self {
        Self::new(environment)
    }
}

/// How many pixels become one along each axis, so that a map has at most `side` of them along either, at most
/// [`MAX_PIXELS`] in all, and running shares of at most `bytes`.
fn factor_to_fit([width, height]: [usize; 2], side: usize, bytes: u64) -> usize {
    let fits = |columns: usize, rows: usize| {
        let shares = size_of::<f32>() as u64 * shares_of(columns, rows) as u64;
        columns.max(rows) <= side && columns * rows <= MAX_PIXELS && shares <= bytes
    };
    (1..width.max(height)).find(|&k| fits(width.div_ceil(k), height.div_ceil(k))).unwrap_or(1)
}

/// Numbers of the running shares of a map.
fn shares_of(columns: usize, rows: usize) -> usize {
    rows + 1 + rows * (columns + 1)
}

/// Running sums from 0, divided by the last one; equal steps where all weights are zero.
#[expect(clippy::cast_possible_truncation, reason = "single precision is the shader's")]
fn running_shares(weights: &[f64]) -> Vec<f32> {
    let total: f64 = weights.iter().sum();
    let mut sum = 0.0;
    let mut shares = vec![0.0];
    for (i, weight) in weights.iter().enumerate() {
        sum += weight;
        let share = if total > 0.0 { sum / total } else { (i + 1) as f64 / weights.len() as f64 };
        shares.push(if i + 1 == weights.len() { 1.0 } else { share as f32 });
    }
    shares
}

/// The patches of a map that are not black as directions, for quadrature; see [`Environment::average_to`].
#[must_use]
pub(crate) fn lit_patches(environment: &Environment, columns: usize, rows: usize) -> Vec<EnvDirection> {
    let mut patches = environment.average_to(columns, rows);
    patches.retain(|patch| patch.radiance.iter().any(|&x| x > 0.0));
    patches
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_density_integrates_to_one_and_follows_the_light() {
        let studio = Environment::studio();
        let light = EnvironmentLight::new(&studio);
        let mut whole = 0.0;
        let mut ratio = Vec::new();
        let texels = light.texels();
        for (i, texel) in texels.pixels().iter().enumerate() {
            let edge = |y: usize| (PI * y as f64 / texels.height() as f64).cos();
            let y = i / texels.width();
            let solid_angle = (edge(y) - edge(y + 1)) * TAU / texels.width() as f64;
            whole += f64::from(texel[3]) * solid_angle;
            ratio.push(f64::from(texel[3]) / luminance(&[texel[0], texel[1], texel[2]]));
        }
        assert!((whole - 1.0).abs() < 1e-6, "{whole}");
        let (low, high) = ratio.iter().fold((f64::MAX, 0.0f64), |(a, b), &r| (a.min(r), b.max(r)));
        // Within the rounding of the running shares.
        assert!(high / low < 1.02, "{low} {high}");
        assert_eq!(light.cumulative().len(), shares_of(192, 96));
    }

    #[test]
    fn black_maps_and_black_rows_are_drawn_from_uniformly() {
        let black = EnvironmentLight::new(&Environment::new(Raster::filled(4, 2, [0.0; 3])).unwrap());
        assert!(black.texels().pixels().iter().all(|t| (f64::from(t[3]) * 4.0 * PI - 1.0).abs() < 1e-6));
        let map = Raster::from_fn(4, 2, |x, y| if (x, y) == (2, 1) { [1.0; 3] } else { [0.0; 3] });
        let lamp = EnvironmentLight::new(&Environment::new(map).unwrap());
        assert_eq!(lamp.texels().at(0, 0)[3], 0.0);
        assert!((f64::from(lamp.texels().at(2, 1)[3]) * PI / 2.0 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn large_maps_are_averaged_until_a_device_can_hold_them() {
        // The smallest binding that is common: 128 MiB, which the shares of 8192 x 4096 pixels exceed by a little.
        let modest = 128 << 20;
        assert_eq!(factor_to_fit([4096, 2048], 8192, modest), 1);
        assert_eq!(factor_to_fit([8192, 4096], 8192, modest), 2);
        assert_eq!(factor_to_fit([8192, 4096], 16_384, 1 << 31), 1);
        assert_eq!(factor_to_fit([16_384, 8192], 16_384, 1 << 31), 2);
        assert_eq!(factor_to_fit([20_001, 3], 2048, modest), 10);
        assert_eq!(factor_to_fit([1, 1], 2048, modest), 1);
    }

    #[test]
    fn impossible_lights_are_refused() {
        assert!(Light::of_metrics().check().is_ok());
        let dark = Light::Directional { direction: Vec3::ZERO, irradiance: [1.0; 3] };
        assert!(dark.check().unwrap_err().to_string().contains("a direction"));
        let negative = Light::Point { position: Vec3::ONE, intensity: [-1.0; 3] };
        assert!(negative.check().unwrap_err().to_string().contains("not negative"));
    }
}
