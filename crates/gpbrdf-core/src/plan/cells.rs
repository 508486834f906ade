//! The pairs of directions at which a material is to be known, and how much each of them counts.

use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::Vector3;

use super::belief::Highlights;
use super::candidates::Candidates;
use crate::base::error::{Error, Result};
use crate::base::random::quasi_random;
use crate::brdf::angles::{BoxPoint, GRAZING_COSINE, HalfDiff, check_finite, direction, theta_d_max};
use crate::brdf::{LUMINANCE_WEIGHTS, Rgb};
use crate::judge::Environment;
use crate::judge::sphere::{DistantLight, ENV_PATCHES, ShadingFrame, environment_lights};
use crate::model::Model;

/// The share of the energy that a model reflects in the weights of its highlights; the rest is spread evenly.
const OF_ENERGY: f64 = 0.8;

/// Directions with weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells {
    /// The pairs of directions.
    pub(super) angles: Vec<HalfDiff>,
    /// The weight of each of them, not negative; together 1.
    pub(super) weights: Vec<f64>,
    /// How many of the last ones count for materials with sharp highlights only.
    of_highlights: usize,
}

impl Cells {
    /// The usual number of them. With half of it, up to 42 planned directions describe matte materials by 3 to 5 dB
    /// worse.
    pub const COUNT: usize = 4000;

    /// The usual ones: what a picture of a sphere in an environment uses ([`Cells::environment`]), or without one
    /// [`Cells::hemisphere`], and as many of [`Cells::warped_box`], where highlights are. The box alone has 56 % of its
    /// weight where `theta_h` is less than 15 degrees and 22 % beyond 30; the hemisphere has 13 and 56 % there. Plans
    /// for the box leave out much of matte materials, plans for the others miss sharp highlights. Those of the box do
    /// not count for materials without a sharp highlight, and once a few directions of one with a sharp highlight are
    /// measured, those of the box count mostly by the energy that its model reflects there: the same relative error of
    /// `f` is seen least where a highlight ends.
    ///
    /// # Errors
    /// A count of less than 2, and an environment that is black.
    pub fn usual(environment: Option<&Environment>, count: usize) -> Result<Self> {
        let (half, rest) = (count / 2, count - count / 2);
        let of_energy =
            environment.map_or_else(|| Self::hemisphere(half), |map| Self::environment(map, half))?;
        Ok(of_energy.with_highlights(Self::warped_box(rest)?))
    }

    /// Light and viewer spread evenly over the hemisphere, with cosines of at least [`GRAZING_COSINE`], and with the
    /// weight `cos theta_i cos theta_o`: the energy that a surface exchanges in evenly lit surroundings.
    ///
    /// # Errors
    /// A count of 0.
    pub fn hemisphere(count: usize) -> Result<Self> {
        let cosine = |x: f64| GRAZING_COSINE + (1.0 - GRAZING_COSINE) * x;
        let pairs = (0..count).map(|i| {
            let [a, b, c] = quasi_random(i);
            let (cos_i, cos_o) = (cosine(a), cosine(b));
            let angles =
                HalfDiff::from_directions(&direction(cos_i.acos(), 0.0), &direction(cos_o.acos(), PI * c));
            (angles, cos_i * cos_o)
        });
        Self::new(pairs.collect())
    }

    /// Directions spread evenly over the warped box, with the weight `cos theta_i cos theta_o`. Compared with
    /// [`Cells::hemisphere`], many more of them are near the mirror direction, where glossy materials are brightest and
    /// change most.
    ///
    /// # Errors
    /// A count of 0.
    pub fn warped_box(count: usize) -> Result<Self> {
        let pairs = (0..count).map(|i| {
            let [u, v, phi] = quasi_random(i);
            let angles = BoxPoint { u, v, phi: FRAC_PI_2 * phi }.to_half_diff();
            let (cos_i, cos_o) = angles.cosines();
            (angles, cos_i.max(0.0) * cos_o.max(0.0))
        });
        Self::new(pairs.collect())
    }

    /// The pairs that a picture of a sphere under an environment uses, as
    /// [`render_env`](crate::judge::sphere::render_env) draws it: pixels spread evenly over the disc, lights drawn by
    /// their luminance, and the cosine at the light as the weight.
    ///
    /// # Errors
    /// A count of 0, and an environment that is black.
    pub fn environment(environment: &Environment, count: usize) -> Result<Self> {
        let lights = environment_lights(environment, ENV_PATCHES);
        let mut total = 0.0;
        let cumulative: Vec<f64> = lights
            .iter()
            .map(|DistantLight { irradiance, .. }| {
                total += LUMINANCE_WEIGHTS.iter().zip(irradiance).map(|(weight, x)| weight * x).sum::<f64>();
                total
            })
            .collect();
        if !(total > 0.0) {
            return Err(Error::argument("environment", "light from some direction", "none"));
        }
        let viewer = Vector3::z();
        // About half of all pixels turn away from the light that was drawn.
        let drawn = (0..count.saturating_mul(64)).filter_map(|i| {
            let [a, b, c] = quasi_random(i);
            let (radius, azimuth) = (a.sqrt(), TAU * b);
            let normal =
                Vector3::new(radius * azimuth.cos(), radius * azimuth.sin(), (1.0 - a).max(0.0).sqrt());
            let at = cumulative.partition_point(|sum| *sum <= c * total).min(lights.len() - 1);
            let (wi, wo) =
                ShadingFrame::new(&normal, &viewer, GRAZING_COSINE)?.directions(&lights[at].direction)?;
            Some((HalfDiff::from_directions(&wi, &wo), wi.z))
        });
        Self::new(drawn.take(count).collect())
    }

    /// These directions and those of the warped box, which count only for materials that may have a sharp highlight, as
    /// far as is known: for those either have half of the weight, for the rest these have all of it.
    pub(super) fn with_highlights(mut self, in_box: Self) -> Self {
        self.of_highlights += in_box.len();
        self.angles.extend(in_box.angles);
        self.weights.extend(in_box.weights);
        self.weights.iter_mut().for_each(|weight| *weight *= 0.5);
        self
    }

    /// Those that count for a material of which this number of directions is measured.
    pub(super) fn of_material(&self, highlights: &Highlights, measured: usize) -> Cow<'_, Self> {
        let rest = self.len() - self.of_highlights;
        match highlights {
            Highlights::Broad if self.of_highlights > 0 => {
                let (angles, mut weights) = (self.angles[..rest].to_vec(), self.weights[..rest].to_vec());
                let total: f64 = weights.iter().sum();
                weights.iter_mut().for_each(|weight| *weight /= total);
                Cow::Owned(Self { angles, weights, of_highlights: 0 })
            }
            Highlights::Sharp(model) if measured >= Candidates::FEW => {
                let mut cells = self.clone();
                let (angles, weights) = (&cells.angles[rest..], &mut cells.weights[rest..]);
                let energies = reflected_energies(model, angles, weights);
                let (share, total) = (weights.iter().sum::<f64>(), energies.iter().sum::<f64>());
                if share > 0.0 && total > 0.0 && total.is_finite() {
                    for (weight, energy) in weights.iter_mut().zip(&energies) {
                        *weight = (1.0 - OF_ENERGY) * *weight + OF_ENERGY * share * energy / total;
                    }
                }
                Cow::Owned(cells)
            }
            _ => Cow::Borrowed(self),
        }
    }

    /// Pairs of directions and how much each of them counts, in any unit.
    ///
    /// # Errors
    /// Angles and weights that are not finite, negative weights, and none above 0.
    pub fn new(pairs: Vec<(HalfDiff, f64)>) -> Result<Self> {
        let (angles, weights): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
        check_finite(&angles)?;
        if let Some(bad) = weights.iter().find(|weight| !(**weight >= 0.0 && weight.is_finite())) {
            return Err(Error::argument("weight of a cell", "a finite number of at least 0", bad));
        }
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return Err(Error::argument("cells of a plan", "at least one with a weight", weights.len()));
        }
        let weights = weights.into_iter().map(|weight| weight / total).collect();
        Ok(Self { angles, weights, of_highlights: 0 })
    }

    /// The pairs of directions.
    #[must_use]
    pub fn angles(&self) -> &[HalfDiff] {
        &self.angles
    }

    /// The number of pairs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.angles.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.angles.is_empty()
    }
}

/// The energy that a model reflects about each direction of the warped box in evenly lit surroundings, in any unit, for
/// directions with weights of `cos theta_i cos theta_o`: these times `f`, mean of the channels, and times
/// `dw_i dw_o / (du dv dphi)`, which is proportional to `cos theta_d sin theta_d theta_d_max sin theta_h
/// sqrt(theta_h)`, since `dw_o = 4 cos theta_d dw_h` and `theta_h` goes with the square of `u`.
pub(super) fn reflected_energies(model: &Model, angles: &[HalfDiff], weights: &[f64]) -> Vec<f64> {
    let brightness = model.predict_mean(angles);
    let energy = |((at, weight), f): ((&HalfDiff, &f64), &Rgb)| {
        let (sin_h, (sin_d, cos_d)) = (at.theta_h.sin(), at.theta_d.sin_cos());
        let measure = cos_d * sin_d * theta_d_max(at.theta_h, at.phi_d) * sin_h * at.theta_h.sqrt();
        (weight * measure * f.iter().sum::<f64>()).max(0.0)
    };
    angles.iter().zip(weights).zip(&brightness).map(energy).collect()
}
