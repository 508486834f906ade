//! The pairs of directions at which a material is to be known, and how much each of them counts.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::Vector3;

use crate::base::error::{Error, Result};
use crate::brdf::angles::{BoxPoint, GRAZING_COSINE, HalfDiff, direction};
use crate::judge::Environment;
use crate::judge::sphere::{DistantLight, ENV_PATCHES, environment_lights};

/// Steps of an additive recurrence in three dimensions. Source: M. Roberts, "The Unreasonable Effectiveness of
/// Quasirandom Sequences" (2018).
const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_900_4];

/// Luminance of linear sRGB.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Directions with weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells {
    /// The pairs of directions.
    pub angles: Vec<HalfDiff>,
    /// The weight of each of them, not negative; together 1.
    pub weights: Vec<f64>,
}

impl Cells {
    /// The usual number of them.
    pub const COUNT: usize = 2000;

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
    /// change most: plans for these directions describe glossy materials better.
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
                total += LUMINANCE.iter().zip(irradiance).map(|(weight, x)| weight * x).sum::<f64>();
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
            let light = lights[at].direction;
            let cosine = light.dot(&normal);
            (cosine.min(normal.z) > GRAZING_COSINE).then(|| (in_frame(&normal, &light, &viewer), cosine))
        });
        Self::new(drawn.take(count).collect())
    }

    fn new(pairs: Vec<(HalfDiff, f64)>) -> Result<Self> {
        let total: f64 = pairs.iter().map(|(_, weight)| weight).sum();
        if !(total > 0.0) {
            return Err(Error::argument("cells of a plan", "at least one with a weight", pairs.len()));
        }
        let (angles, weights): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
        Ok(Self { angles, weights: weights.into_iter().map(|weight| weight / total).collect() })
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

/// Point `i` of the additive recurrence in the unit cube.
fn quasi_random(i: usize) -> [f64; 3] {
    STEPS.map(|step| (0.5 + step * i as f64).fract())
}

/// The angles of two directions about a unit normal.
fn in_frame(normal: &Vector3<f64>, light: &Vector3<f64>, viewer: &Vector3<f64>) -> HalfDiff {
    let axis = if normal.x.abs() < 0.5 { Vector3::x() } else { Vector3::y() };
    let e = (axis - axis.dot(normal) * normal).normalize();
    let f = normal.cross(&e);
    let local = |w: &Vector3<f64>| Vector3::new(w.dot(&e), w.dot(&f), w.dot(normal));
    HalfDiff::from_directions(&local(light), &local(viewer))
}
