//! The shading shader again on the CPU, in f64: direct light, and environments by quadrature.

use glam::Vec3;
use gpbrdf_core::judge::ShadingFrame;
use gpbrdf_core::{BrdfTable, Environment, Rgb};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::camera::{Camera, Projection};
use super::gbuffer::SurfaceTexel;
use super::light::{Light, lit_patches};

/// A light whose reflection can be computed without random numbers.
#[derive(Clone, Copy, Debug)]
pub enum TwinLight<'a> {
    /// A directional or a point light. [`Light::Environment`] is reflected as black.
    Direct(&'a Light),
    /// An environment, averaged to patches whose light comes from their centres.
    Patches {
        /// The map.
        environment: &'a Environment,
        /// Number of columns and rows of patches.
        patches: (usize, usize),
    },
}

/// The radiance of every pixel of a G-buffer, once for each table, by the lookups and the shading of the
/// sphere in `gpbrdf-core`. Black where no surface is, and where either cosine is under `min_cosine`.
/// Parallel over pixels; the result does not depend on the number of threads.
#[must_use]
pub fn shade_on_cpu(
    texels: &[SurfaceTexel],
    camera: &Camera,
    light: TwinLight<'_>,
    tables: &[&BrdfTable],
    min_cosine: f64,
) -> Vec<Vec<Rgb>> {
    let patches = match light {
        TwinLight::Patches { environment, patches } => lit_patches(environment, patches.0, patches.1),
        TwinLight::Direct(_) => Vec::new(),
    };
    let shaded: Vec<Vec<Rgb>> = texels
        .par_iter()
        .map(|texel| {
            let mut sums = vec![[0.0; 3]; tables.len()];
            if !texel.hit {
                return sums;
            }
            let position = to_f64(Vec3::from_array(texel.position));
            let to_viewer = match camera.projection {
                Projection::Perspective { .. } => to_f64(camera.eye) - position,
                Projection::Orthographic { .. } => to_f64(camera.world_from_view().z_axis),
            };
            let normal = to_f64(Vec3::from_array(texel.normal)).normalize();
            let Some(frame) = ShadingFrame::new(&normal, &to_viewer.normalize(), min_cosine) else {
                return sums;
            };
            match light {
                TwinLight::Direct(Light::Directional { direction, irradiance }) => {
                    let wi = to_f64(*direction).normalize();
                    frame.add_light(tables, &wi, irradiance.map(f64::from), &mut sums);
                }
                TwinLight::Direct(Light::Point { position: at, intensity }) => {
                    let gap = to_f64(*at) - position;
                    let square = gap.norm_squared().max(1e-12);
                    let irradiance = intensity.map(|x| f64::from(x) / square);
                    frame.add_light(tables, &(gap / square.sqrt()), irradiance, &mut sums);
                }
                TwinLight::Direct(Light::Environment(_)) => {}
                TwinLight::Patches { .. } => {
                    for patch in &patches {
                        let irradiance = patch.radiance.map(|x| x * patch.solid_angle);
                        frame.add_light(tables, &patch.direction, irradiance, &mut sums);
                    }
                }
            }
            sums
        })
        .collect();
    (0..tables.len()).map(|t| shaded.iter().map(|sums| sums[t]).collect()).collect()
}

fn to_f64(v: Vec3) -> Vector3<f64> {
    Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}
