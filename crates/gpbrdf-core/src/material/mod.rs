//! A material that renderers call: evaluate, sample, density, albedo.
//!
//! Everything here is single precision, allocates nothing in a call, and uses no operation that a shader does not have.

mod albedo;
mod block;
mod density;
mod half_vector;
mod lookup;

pub use albedo::ALBEDO_VIEWS;
pub use density::{COLUMNS, DirectionDensities, ROWS, VIEWS};

use std::borrow::Cow;

use crate::base::error::{Error, Result};
use crate::base::simd::vectorized;
use crate::brdf::{Brdf, BrdfTable};
use crate::model::{Model, bake_mean};
use albedo::Reflected;
use block::lanes;
use lookup::LANES;

/// Share of sampled directions that are drawn in proportion to the cosine, so that no weight is larger than
/// `pi f / COSINE_SHARE`.
pub const COSINE_SHARE: f32 = 0.1;

/// What a [`Material`] is made to be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaterialOptions {
    /// Whether no more light may leave the surface than falls on it. Where the albedo of a table is larger than 1, `f`
    /// is multiplied by `s(theta_i) s(theta_o)`, a factor of at most 1 that is the same for all channels, so `f` stays
    /// reciprocal and keeps its hue; what is dark enough stays as it is.
    pub energy_conserving: bool,
}

/// An isotropic material that a renderer evaluates and samples.
///
/// Directions are unit vectors in the local frame, whose normal is `+z`; `wi` points to the light and `wo` to the
/// viewer. `f` is the BRDF in sr^-1, **without** the cosine, from a table in half-difference angles by trilinear
/// interpolation; cells without data are filled from their neighbours ([`BrdfTable::filled`]). Such a table is
/// reciprocal by construction, `f(wi, wo) = f(wo, wi)`, and so is the material.
///
/// Sampling follows `luminance(f) cos theta_i` of the table itself. At each of 64 elevations of `wo`, densities are
/// bilinear between 80 x 24 nodes over half vectors ([`DirectionDensities`]), in coordinates in which a lobe keeps its
/// place while the view changes and whose edges are the horizon; between two elevations the density is their mixture. A
/// tenth of all directions is drawn in proportion to the cosine. [`Material::pdf`] is the density of what
/// [`Material::sample`] draws; its integral is 1.
///
/// The coordinates of a square, with `z = 1 - cos theta_h` and `p` the azimuth of the half vector against `wo`:
/// `y = z / (1 - c z)` along rows, where `c = 1 / z_max - 1` and `z_max = 1 - cos(pi/4 + theta_o / 2)`, and
/// `b = |p| / p_max` along columns, where `cos p_max = -cot theta_o cot 2 theta_h`, clamped to `[-1, 1]`. A density
/// `rho` on the square is `rho (1 + c y)^2 / (8 p_max wo.h)` over solid angle.
///
/// Single precision throughout; no call allocates. 17.5 MB for the table and 1.0 MB for sampling.
///
/// ```
/// use gpbrdf_core::{BrdfTable, Material, MaterialOptions};
///
/// # fn main() -> gpbrdf_core::Result<()> {
/// let table = BrdfTable::from_fn(|angles| [0.1 + (-40.0 * angles.theta_h.powi(2)).exp(); 3]);
/// let material = Material::new(table, &MaterialOptions::default())?;
/// let wo = [0.6, 0.0, 0.8];
/// if let Some(drawn) = material.sample(wo, 0.3, 0.7) {
///     let f = material.eval(drawn.wi, wo);
///     assert!((drawn.weight[0] * drawn.pdf / (f[0] * drawn.wi[2]) - 1.0).abs() < 1e-5);
///     assert!((material.pdf(drawn.wi, wo) / drawn.pdf - 1.0).abs() < 1e-3);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Material {
    table: BrdfTable,
    densities: DirectionDensities,
    reflected: Reflected,
}

/// A direction drawn by [`Material::sample`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampledDirection {
    /// Unit direction to the light, above the horizon.
    pub wi: [f32; 3],
    /// `f(wi, wo) cos theta_i / pdf` of each channel: what a path's throughput is multiplied by.
    pub weight: [f32; 3],
    /// Density over solid angle, sr^-1; always positive.
    pub pdf: f32,
}

impl Material {
    /// The material of a table, which it takes over.
    ///
    /// Cost: about 4 million lookups, in parallel.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for a table with an infinite value.
    pub fn new(table: BrdfTable, options: &MaterialOptions) -> Result<Self> {
        let filled = match table.filled() {
            Cow::Borrowed(_) => None,
            Cow::Owned(filled) => Some(filled),
        };
        let table = filled.unwrap_or(table);
        check_finite(&table)?;
        let reflected = Reflected::new(table.values(), options.energy_conserving);
        let densities = albedo::densities(table.values(), |f, i, o| reflected.conserve(f, i, o));
        Ok(Self { table, densities, reflected })
    }

    /// The material of any BRDF: tabulated, and made reciprocal by `(f(wi, wo) + f(wo, wi)) / 2`.
    ///
    /// Cost: 2.9 million evaluations, in parallel, beside that of [`Material::new`].
    ///
    /// # Errors
    /// Those of [`Material::new`].
    pub fn from_brdf(brdf: &dyn Brdf, options: &MaterialOptions) -> Result<Self> {
        let table = BrdfTable::from_fn(|angles| {
            let (wi, wo) = angles.to_directions();
            let (forward, backward) = (brdf.eval(&wi, &wo), brdf.eval(&wo, &wi));
            std::array::from_fn(|c| 0.5 * (forward[c] + backward[c]))
        });
        Self::new(table, options)
    }

    /// The material of a model, baked.
    ///
    /// # Errors
    /// Those of [`Material::new`].
    pub fn from_model(model: &Model, options: &MaterialOptions) -> Result<Self> {
        Self::new(bake_mean(model), options)
    }

    /// `f(wi, wo)` in sr^-1, **without** the cosine. Zero where either direction is at or below the horizon.
    #[inline]
    #[must_use]
    pub fn eval(&self, wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
        if !(wi[2] > 0.0 && wo[2] > 0.0) {
            return [0.0; 3];
        }
        let [f] = self.eval_block(&wi.map(|x| [x]), &wo.map(|x| [x]));
        f
    }

    /// A direction to the light drawn by two numbers that are uniform on `[0, 1)`; `None` where `wo` is at or below the
    /// horizon, and where rounding leaves the direction there, which about one in ten million does.
    #[inline]
    #[must_use]
    pub fn sample(&self, wo: [f32; 3], u1: f32, u2: f32) -> Option<SampledDirection> {
        if !(wo[2] > 0.0) {
            return None;
        }
        let drawn = self.sample_block(&wo.map(|x| [x]), &[[u1], [u2]]);
        let (wi, [weight], [pdf]) = (drawn.wi.map(|[x]| x), drawn.weight, drawn.pdf);
        (wi[2] > 0.0).then_some(SampledDirection { wi, weight, pdf })
    }

    /// The density, sr^-1, with which [`Material::sample`] draws `wi` for this `wo`. Zero where either direction is at
    /// or below the horizon.
    #[inline]
    #[must_use]
    pub fn pdf(&self, wi: [f32; 3], wo: [f32; 3]) -> f32 {
        if !(wi[2] > 0.0 && wo[2] > 0.0) {
            return 0.0;
        }
        let [pdf] = self.pdf_block(&wi.map(|x| [x]), &wo.map(|x| [x]));
        pdf
    }

    /// The directional-hemispherical reflectance: the share of the light from `wo` that leaves the surface, or, by
    /// reciprocity, the radiance towards `wo` under a white sky of radiance 1, for each channel. Linear between 128
    /// elevations. Zero where `wo` is at or below the horizon.
    #[inline]
    #[must_use]
    pub fn albedo(&self, wo: [f32; 3]) -> [f32; 3] {
        if wo[2] > 0.0 { self.reflected.albedo(wo[2]) } else { [0.0; 3] }
    }

    /// [`Material::eval`] at many pairs of directions, in the widest vector instructions of the processor: several
    /// times as fast as single calls. It ends with the shortest of the three slices.
    pub fn eval_many(&self, wi: &[[f32; 3]], wo: &[[f32; 3]], out: &mut [[f32; 3]]) {
        let blocks = wi.chunks(LANES).zip(wo.chunks(LANES)).zip(out.chunks_mut(LANES));
        vectorized(
            #[inline(always)]
            || {
                for ((wi, wo), out) in blocks {
                    let f = self.eval_block(&lanes(wi), &lanes(wo));
                    for (((out, f), wi), wo) in out.iter_mut().zip(f).zip(wi).zip(wo) {
                        *out = if wi[2] > 0.0 && wo[2] > 0.0 { f } else { [0.0; 3] };
                    }
                }
            },
        );
    }

    /// [`Material::pdf`] at many pairs of directions, like [`Material::eval_many`]. It ends with the shortest of the
    /// three slices.
    pub fn pdf_many(&self, wi: &[[f32; 3]], wo: &[[f32; 3]], out: &mut [f32]) {
        let blocks = wi.chunks(LANES).zip(wo.chunks(LANES)).zip(out.chunks_mut(LANES));
        vectorized(
            #[inline(always)]
            || {
                for ((wi, wo), out) in blocks {
                    let pdf = self.pdf_block(&lanes(wi), &lanes(wo));
                    for (((out, pdf), wi), wo) in out.iter_mut().zip(pdf).zip(wi).zip(wo) {
                        *out = if wi[2] > 0.0 && wo[2] > 0.0 { pdf } else { 0.0 };
                    }
                }
            },
        );
    }

    /// [`Material::sample`] at many outgoing directions, each with two random numbers, like [`Material::eval_many`]. It
    /// ends with the shortest of the three slices.
    pub fn sample_many(&self, wo: &[[f32; 3]], u: &[[f32; 2]], out: &mut [Option<SampledDirection>]) {
        let blocks = wo.chunks(LANES).zip(u.chunks(LANES)).zip(out.chunks_mut(LANES));
        vectorized(
            #[inline(always)]
            || {
                for ((wo, u), out) in blocks {
                    let mut numbers = [[0.0; LANES]; 2];
                    for (k, [first, second]) in u.iter().enumerate() {
                        (numbers[0][k], numbers[1][k]) = (*first, *second);
                    }
                    let drawn = self.sample_block(&lanes(wo), &numbers);
                    for (k, ((out, wo), _)) in out.iter_mut().zip(wo).zip(u).enumerate() {
                        let (wi, weight, pdf) = (drawn.wi.map(|lane| lane[k]), drawn.weight[k], drawn.pdf[k]);
                        let above = wo[2] > 0.0 && wi[2] > 0.0;
                        *out = above.then_some(SampledDirection { wi, weight, pdf });
                    }
                }
            },
        );
    }

    /// The table, without gaps. [`Material::eval`] of an energy-conserving material scales its values.
    #[must_use]
    pub fn table(&self) -> &BrdfTable {
        &self.table
    }

    /// The densities of [`Material::sample`], as flat arrays for a device.
    #[must_use]
    pub fn densities(&self) -> &DirectionDensities {
        &self.densities
    }

    /// Albedo of each channel at [`ALBEDO_VIEWS`] elevations, placed like those of [`DirectionDensities`].
    #[must_use]
    pub fn albedos(&self) -> &[[f32; 3]] {
        self.reflected.albedos()
    }

    /// The factors `s` of an energy-conserving material at the elevations of [`Material::albedos`]; `None` where `f`
    /// is that of the table.
    #[must_use]
    pub fn conserving_factors(&self) -> Option<&[f32]> {
        self.reflected.factors()
    }
}

fn check_finite(table: &BrdfTable) -> Result<()> {
    let Some(cell) = table.values().iter().position(|f| f.iter().any(|x| !x.is_finite())) else {
        return Ok(());
    };
    let found = format!("{:?} in cell {cell}", table.values()[cell]);
    Err(Error::argument("values of a table", "finite numbers", found))
}

#[cfg(test)]
mod tests;
