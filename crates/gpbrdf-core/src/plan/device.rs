//! The pairs of directions that an instrument reaches.

use std::fmt;

use nalgebra::Vector3;

use super::candidates::Candidates;
use crate::base::error::{Error, Result};
use crate::brdf::angles::{HalfDiff, direction};
use crate::sample::InPlaneScan;

/// The largest angle from the normal that an instrument can be said to reach, degrees.
const MOST_THETA: f64 = 87.0;

/// The range of steps, degrees.
const STEPS: std::ops::RangeInclusive<f64> = 0.5..=45.0;

/// The smallest of coarse steps, degrees.
const COARSE_STEP: f64 = 5.0;

/// What rounding may add to an angle, degrees.
const ROUNDING: f64 = 1e-9;

/// A geometry of measurement: the directions of light and detector, with the light at azimuth 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Geometry {
    /// Angle between light and normal, degrees.
    pub theta_i: f64,
    /// Angle between detector and normal, degrees.
    pub theta_o: f64,
    /// Azimuth between light and detector, degrees: 0 on the side of the light, 180 on that of the mirror direction.
    pub phi_o: f64,
}

impl Geometry {
    /// Whether another one is the same but for rounding.
    pub(super) fn is_at(self, other: Self) -> bool {
        let Self { theta_i, theta_o, phi_o } = other;
        [self.theta_i - theta_i, self.theta_o - theta_o, self.phi_o - phi_o]
            .iter()
            .all(|d| d.abs() < ROUNDING)
    }

    /// The unit directions `[wi, wo]`.
    #[must_use]
    pub fn directions(self) -> [Vector3<f64>; 2] {
        let wi = direction(self.theta_i.to_radians(), 0.0);
        [wi, direction(self.theta_o.to_radians(), self.phi_o.to_radians())]
    }

    /// The half-difference angles.
    #[must_use]
    pub fn angles(self) -> HalfDiff {
        let [wi, wo] = self.directions();
        HalfDiff::from_directions(&wi, &wo)
    }
}

/// The limits of an instrument whose light and detector stand at multiples of a step: polar angles from the normal,
/// azimuths from the mirror direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    /// Step of all angles, degrees, 0.5 to 45.
    pub step: f64,
    /// Angles between light and normal, degrees; `None` for all multiples of the step up to [`Device::theta_max`].
    pub incidences: Option<Vec<f64>>,
    /// The largest angle between detector and normal, degrees, at most 87.
    pub theta_max: f64,
    /// Whether the detector stays in the plane of light and normal.
    pub in_plane: bool,
    /// The smallest angle between the directions of light and detector, degrees: nearer to each other the detector
    /// shadows the light.
    pub min_separation: f64,
}

impl Default for Device {
    /// Steps of 1 degree up to 80 degrees from the normal, with 3 degrees between light and detector.
    fn default() -> Self {
        Self {
            step: 1.0,
            incidences: None,
            theta_max: 80.0,
            in_plane: false,
            min_separation: InPlaneScan::SHADOW,
        }
    }
}

impl Device {
    /// At most `most` geometries within these limits.
    ///
    /// Of two that are alike by symmetry (light and detector swapped, or turned about the normal where one of them
    /// stands there) only one is given, with the smaller angle at the light. Where there are more than `most`, they are
    /// thinned evenly in the warped box, so that many of the fine steps near mirror directions stay; those nearest to
    /// the mirror direction and nearest to the light of each incidence stay all.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for limits out of range, and where nothing is within them.
    pub fn geometries(&self, most: usize) -> Result<Vec<Geometry>> {
        self.validate()?;
        let on_grid = multiples(self.step, self.theta_max);
        let mut incidences = self.incidences.clone().unwrap_or_else(|| on_grid.clone());
        incidences.sort_by(f64::total_cmp);
        incidences.dedup();
        let mut azimuths = vec![0.0, 180.0];
        if !self.in_plane {
            // From the mirror direction, which is reached whatever the step.
            azimuths = multiples(self.step, 180.0).into_iter().rev().map(|turn| 180.0 - turn).collect();
        }
        let has = |list: &[f64], angle: f64| list.iter().any(|other| (other - angle).abs() < ROUNDING);
        let mut reached = Vec::new();
        // Of each incidence: the first geometry and the one after the last.
        let mut runs = Vec::new();
        for &theta_i in &incidences {
            let first = reached.len();
            for &theta_o in &on_grid {
                if theta_o + ROUNDING < theta_i && has(&incidences, theta_o) && has(&on_grid, theta_i) {
                    continue;
                }
                let is_turned = theta_i < ROUNDING || theta_o < ROUNDING;
                for &phi_o in if is_turned { &azimuths[azimuths.len() - 1..] } else { &azimuths[..] } {
                    let geometry = Geometry { theta_i, theta_o, phi_o };
                    let separation = (2.0 * geometry.angles().theta_d).to_degrees();
                    if separation + ROUNDING >= self.min_separation {
                        reached.push(geometry);
                    }
                }
            }
            runs.push(first..reached.len());
        }
        if reached.is_empty() {
            let expected = "at least one pair of directions within them";
            return Err(Error::argument("limits of the instrument", expected, format!("none with {self}")));
        }
        if reached.len() <= most {
            return Ok(reached);
        }
        let mut is_kept = vec![false; reached.len()];
        let to_mirror = |g: &Geometry| g.angles().theta_h;
        let to_light = |g: &Geometry| g.angles().theta_d;
        for run in runs {
            for distance in [&to_mirror as &dyn Fn(&Geometry) -> f64, &to_light] {
                let nearest =
                    run.clone().min_by(|&a, &b| distance(&reached[a]).total_cmp(&distance(&reached[b])));
                nearest.into_iter().for_each(|i| is_kept[i] = true);
            }
        }
        let others: Vec<usize> = (0..reached.len()).filter(|&i| !is_kept[i]).collect();
        let free = most.saturating_sub(reached.len() - others.len());
        let shares = others.iter().map(|&i| self.boxes_per_step(&reached[i]));
        let total: f64 = shares.clone().sum();
        let mut sum = 0.0;
        for (&i, share) in others.iter().zip(shares) {
            let before = (sum / total * free as f64).floor();
            sum += share;
            is_kept[i] = (sum / total * free as f64).floor() > before;
        }
        Ok(reached.into_iter().zip(is_kept).filter_map(|(g, kept)| kept.then_some(g)).collect())
    }

    /// The step of the first measurements ([`Candidates::FEW`]) and of those of matte materials, degrees: 5, or the
    /// next multiple of the step; `None` where the step is not smaller.
    #[must_use]
    pub fn coarse_step(&self) -> Option<f64> {
        let multiple = (COARSE_STEP / self.step - ROUNDING).ceil();
        (multiple > 1.0).then_some(multiple * self.step)
    }

    /// The volume of the warped box that belongs to a geometry, up to a factor: `sin theta_i sin theta_o / (cos theta_d
    /// sin theta_d sin theta_h sqrt(theta_h))`, from `d omega_i d omega_o = 4 cos theta_d d omega_h d omega_d` (S.
    /// Rusinkiewicz 1998) and `u = sqrt(theta_h / (pi/2))`. Angles are at least a quarter of a step.
    fn boxes_per_step(&self, geometry: &Geometry) -> f64 {
        let least = 0.25 * self.step.to_radians();
        let HalfDiff { theta_h, theta_d, .. } = geometry.angles();
        let (theta_h, theta_d) = (theta_h.max(least), theta_d.max(least));
        let sine = |degrees: f64| degrees.to_radians().max(least).sin();
        sine(geometry.theta_i) * sine(geometry.theta_o)
            / (theta_d.cos().max(least) * theta_d.sin() * theta_h.sin() * theta_h.sqrt())
    }

    fn validate(&self) -> Result<()> {
        if !STEPS.contains(&self.step) {
            let expected = format!("{} to {} degrees", STEPS.start(), STEPS.end());
            return Err(Error::argument("step of the instrument", expected, self.step));
        }
        let polar = 0.0..=MOST_THETA;
        if !polar.contains(&self.theta_max) {
            let expected = format!("0 to {MOST_THETA} degrees");
            return Err(Error::argument("largest angle from the normal", expected, self.theta_max));
        }
        if !(0.0..=180.0).contains(&self.min_separation) {
            return Err(Error::argument("smallest separation", "0 to 180 degrees", self.min_separation));
        }
        let Some(incidences) = &self.incidences else { return Ok(()) };
        let expected = || format!("at least one, each from 0 to {MOST_THETA} degrees");
        match incidences.iter().find(|angle| !polar.contains(*angle)) {
            Some(angle) => Err(Error::argument("incidences", expected(), angle)),
            None if incidences.is_empty() => Err(Error::argument("incidences", expected(), "none")),
            None => Ok(()),
        }
    }
}

/// The limits in words.
impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { step, theta_max, min_separation, .. } = self;
        let unit = if *step == 1.0 { "degree" } else { "degrees" };
        write!(f, "steps of {step} {unit}")?;
        if let Some(coarse) = self.coarse_step() {
            let coarse = (coarse * 1e6).round() / 1e6;
            write!(f, " ({coarse} for the first {} and for matte materials)", Candidates::FEW)?;
        }
        f.write_str(", light at ")?;
        match &self.incidences {
            None => write!(f, "0 to {theta_max}")?,
            Some(list) => {
                let list: Vec<String> = list.iter().map(ToString::to_string).collect();
                write!(f, "{}", list.join(", "))?;
            }
        }
        let plane = if self.in_plane { " in the plane of incidence" } else { "" };
        write!(
            f,
            " degrees from the normal, detector{plane} up to {theta_max}, at least {min_separation} degrees apart"
        )
    }
}

/// The multiples of a step from 0 to a limit.
fn multiples(step: f64, limit: f64) -> Vec<f64> {
    (0u32..).map(|k| f64::from(k) * step).take_while(|angle| *angle <= limit + ROUNDING).collect()
}
