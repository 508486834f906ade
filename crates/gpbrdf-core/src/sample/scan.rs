//! Scans: directions that an instrument reaches by turning its arms in even steps.

use nalgebra::Vector3;

use crate::base::error::{Error, Result};
use crate::brdf::angles::direction;
use crate::sample::layout::check_count;

/// The largest incidence of a scan, degrees: its cosine is 0.052.
const MAX_INCIDENCE: f64 = 87.0;

/// Refuses incidences, in degrees, at which no instrument measures.
fn check_incidences(incidences: &[f64]) -> Result<()> {
    let expected = || format!("at least one, each from 0 to {MAX_INCIDENCE} degrees");
    if incidences.is_empty() {
        return Err(Error::argument("incidences", expected(), "none"));
    }
    match incidences.iter().find(|angle| !(0.0..=MAX_INCIDENCE).contains(*angle)) {
        Some(angle) => Err(Error::argument("incidences", expected(), angle)),
        None => Ok(()),
    }
}

/// A scan in the plane of incidence.
///
/// The light stands at each of the incidences in turn, at azimuth 0. The viewer turns in the plane of light
/// and normal, through signed polar angles `a` from [`InPlaneScan::VIEWER_LIMIT`] on the light's side
/// (negative) to the same angle on the side of the mirror direction (positive): `wi = (sin theta_i, 0, cos
/// theta_i)` and `wo = (-sin a, 0, cos a)`. Where the two are closer than [`InPlaneScan::SHADOW`], the
/// detector shadows the light, so that these angles are left out of the range. What remains is divided
/// evenly: of `n` samples of an incidence, the sample `j` is `j / (n - 1)` of the remaining range away from
/// its beginning. With the default, all steps are 2 degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct InPlaneScan {
    /// Angles between light and normal, degrees, each from 0 to 87.
    pub incidences: Vec<f64>,
    /// Number of samples at all incidences together. Where they cannot be shared evenly, the first incidences
    /// have one more than the others.
    pub count: usize,
}

impl Default for InPlaneScan {
    /// Incidences of 10, 25, 40, 55 and 70 degrees, with 76 samples each.
    fn default() -> Self {
        Self { incidences: vec![10.0, 25.0, 40.0, 55.0, 70.0], count: 380 }
    }
}

impl InPlaneScan {
    /// The largest angle between viewer and normal, degrees.
    pub const VIEWER_LIMIT: f64 = 78.0;

    /// The smallest angle between viewer and light, degrees.
    pub const SHADOW: f64 = 3.0;

    /// The pairs `[wi, wo]`, from incidence to incidence and from the light's side to the other.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for an incidence out of range, for fewer than two samples of each
    /// incidence, and for more than [`MAX_DIRECTIONS`](crate::sample::MAX_DIRECTIONS).
    pub fn directions(&self) -> Result<Vec<[Vector3<f64>; 2]>> {
        check_incidences(&self.incidences)?;
        check_count(self.count, self.incidences.len().saturating_mul(2))?;
        let share = self.count / self.incidences.len();
        let left = self.count % self.incidences.len();
        let mut pairs = Vec::with_capacity(self.count);
        for (k, &incidence) in self.incidences.iter().enumerate() {
            let wi = direction(incidence.to_radians(), 0.0);
            pairs.extend(viewer_angles(incidence, share + usize::from(k < left)).map(|angle| {
                let (sine, cosine) = angle.to_radians().sin_cos();
                // A difference, as the negated sine of 0 would be -0, whose azimuth is 180 degrees.
                [wi, Vector3::new(0.0 - sine, 0.0, cosine)]
            }));
        }
        Ok(pairs)
    }
}

/// The `count` signed angles of the viewer at one incidence, degrees, in increasing order.
fn viewer_angles(incidence: f64, count: usize) -> impl Iterator<Item = f64> {
    let limit = InPlaneScan::VIEWER_LIMIT;
    let shadow = [-incidence - InPlaneScan::SHADOW, -incidence + InPlaneScan::SHADOW];
    let before = (shadow[0] + limit).max(0.0);
    let after = shadow[1].max(-limit);
    let length = before + (limit - after);
    (0..count).map(move |j| {
        let way = length * j as f64 / (count - 1) as f64;
        if before > 0.0 && way <= before { way - limit } else { after + (way - before) }
    })
}

/// The grid of a goniometer.
///
/// The light stands at each of the incidences in turn, at azimuth 0. The viewer visits polar angles and
/// azimuths in even steps over the half of the hemisphere that bilateral symmetry leaves: `theta_o = 85 j /
/// A` degrees for `j = 0..=A` and `phi_o = 180 k / B` degrees for `k = 0..=B`, with the normal itself (`j =
/// 0`) only once. Azimuth 0 is the light's side. No direction is left out next to the light.
#[derive(Clone, Debug, PartialEq)]
pub struct GonioGrid {
    /// Angles between light and normal, degrees, each from 0 to 87.
    pub incidences: Vec<f64>,
    /// Number of steps `A` of the polar angle, at least 1.
    pub polar_steps: usize,
    /// Number of steps `B` of the azimuth, at least 1.
    pub azimuth_steps: usize,
}

impl Default for GonioGrid {
    /// Incidences of 0, 15, 30, 45, 60 and 75 degrees; steps of 8.5 degrees of the polar angle and of 10
    /// degrees of the azimuth: 1,146 directions.
    fn default() -> Self {
        Self { incidences: (0..6).map(|k| 15.0 * f64::from(k)).collect(), polar_steps: 10, azimuth_steps: 18 }
    }
}

impl GonioGrid {
    /// The largest angle between viewer and normal, degrees: its cosine is 0.087.
    pub const VIEWER_LIMIT: f64 = 85.0;

    /// A grid of about `count` directions, whose steps of the polar angle are nearly as large as those of the
    /// azimuth: with `n = count / incidences - 1`, `A` is next to the solution of `A (A 180 / 85 + 1) = n`
    /// and `B = n / A - 1`, rounded.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for an incidence out of range, for fewer than three directions of each
    /// incidence, and for more than [`MAX_DIRECTIONS`](crate::sample::MAX_DIRECTIONS).
    pub fn with_count(incidences: Vec<f64>, count: usize) -> Result<Self> {
        check_incidences(&incidences)?;
        check_count(count, incidences.len().saturating_mul(3))?;
        let off_normal = count as f64 / incidences.len() as f64 - 1.0;
        let ratio = 180.0 / Self::VIEWER_LIMIT;
        let ideal = ((1.0 + 4.0 * ratio * off_normal).sqrt() - 1.0) / (2.0 * ratio);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and positive")]
        let steps = |number: f64| number.max(1.0) as usize;
        let [fewer, more] = [ideal.floor(), ideal.ceil()].map(|polar| {
            let polar_steps = steps(polar);
            [polar_steps, steps((off_normal / polar_steps as f64 - 1.0).round())]
        });
        let miss = |[polar, azimuth]: [usize; 2]| (polar as f64 * (azimuth as f64 + 1.0) - off_normal).abs();
        let [polar_steps, azimuth_steps] = if miss(more) < miss(fewer) { more } else { fewer };
        Ok(Self { incidences, polar_steps, azimuth_steps })
    }

    /// Number of directions: `1 + A (B + 1)` at each incidence.
    #[must_use]
    pub fn len(&self) -> usize {
        let off_normal = self.azimuth_steps.saturating_add(1).saturating_mul(self.polar_steps);
        off_normal.saturating_add(1).saturating_mul(self.incidences.len())
    }

    /// Whether there is no direction.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The pairs `[wi, wo]`. The azimuth varies fastest, then the polar angle, then the incidence.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for an incidence out of range, for no steps along an axis, and for more
    /// than [`MAX_DIRECTIONS`](crate::sample::MAX_DIRECTIONS).
    pub fn directions(&self) -> Result<Vec<[Vector3<f64>; 2]>> {
        check_incidences(&self.incidences)?;
        let (polar_steps, azimuth_steps) = (self.polar_steps, self.azimuth_steps);
        if polar_steps == 0 || azimuth_steps == 0 {
            let found = format!("{polar_steps} and {azimuth_steps}");
            return Err(Error::argument("steps of polar angle and azimuth", "at least 1 each", found));
        }
        check_count(self.len(), 1)?;
        let mut pairs = Vec::with_capacity(self.len());
        for incidence in &self.incidences {
            let wi = direction(incidence.to_radians(), 0.0);
            pairs.push([wi, Vector3::z()]);
            for j in 1..=polar_steps {
                let theta = (Self::VIEWER_LIMIT * j as f64 / polar_steps as f64).to_radians();
                pairs.extend((0..=azimuth_steps).map(|k| {
                    let phi = (180.0 * k as f64 / azimuth_steps as f64).to_radians();
                    [wi, direction(theta, phi)]
                }));
            }
        }
        Ok(pairs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::layout::{MAX_DIRECTIONS, MIN_DRAWN_COSINE};

    /// The signed angle of the viewer in the plane of incidence, degrees.
    fn signed(wo: &Vector3<f64>) -> f64 {
        (-wo.x).atan2(wo.z).to_degrees()
    }

    #[test]
    fn in_plane_scans_stay_in_the_plane_and_out_of_the_shadow() {
        for count in [10, 380, 387, 388, 5000] {
            let scan = InPlaneScan { count, ..InPlaneScan::default() };
            let pairs = scan.directions().unwrap();
            assert_eq!(pairs.len(), count);
            for [wi, wo] in &pairs {
                assert!(wi.y == 0.0 && wo.y == 0.0 && wi.x > 0.0);
                assert!(wi.z >= MIN_DRAWN_COSINE && wo.z >= MIN_DRAWN_COSINE);
                assert!((wi.norm() - 1.0).abs() < 1e-15 && (wo.norm() - 1.0).abs() < 1e-15);
                assert!(signed(wo).abs() <= 78.0 + 1e-9);
                let apart = wi.cross(wo).norm().atan2(wi.dot(wo)).to_degrees();
                assert!(apart >= 3.0 - 1e-9, "{apart}");
            }
            for (k, incidence) in scan.incidences.iter().enumerate() {
                let of = |wi: &Vector3<f64>| (wi.x.atan2(wi.z).to_degrees() - incidence).abs() < 1e-9;
                let angles: Vec<f64> =
                    pairs.iter().filter(|[wi, _]| of(wi)).map(|[_, wo]| signed(wo)).collect();
                assert_eq!(angles.len(), count / 5 + usize::from(k < count % 5));
                assert!((angles[0] + 78.0).abs() < 1e-9 && (angles[angles.len() - 1] - 78.0).abs() < 1e-9);
                let step = 150.0 / (angles.len() - 1) as f64;
                for pair in angles.windows(2) {
                    let expected =
                        if pair[0] <= -incidence && pair[1] > -incidence { step + 6.0 } else { step };
                    assert!((pair[1] - pair[0] - expected).abs() < 1e-9, "{incidence}: {pair:?}");
                }
            }
        }
    }

    #[test]
    fn the_default_scan_takes_whole_degrees() {
        let pairs = InPlaneScan::default().directions().unwrap();
        for [_, wo] in &pairs {
            let angle = signed(wo);
            assert!((angle - 2.0 * (angle / 2.0).round()).abs() < 1e-9, "{angle}");
        }
        // The light is at -10 degrees: -12, -10 and -8 are in its shadow.
        let around: Vec<f64> = pairs[31..35].iter().map(|[_, wo]| signed(wo).round()).collect();
        assert_eq!(around, [-16.0, -14.0, -6.0, -4.0]);
    }

    #[test]
    fn scans_at_the_ends_of_the_incidences_are_whole() {
        for incidence in [0.0, 74.0, 75.0, 76.0, 80.0, 81.0, 84.0, 87.0] {
            let scan = InPlaneScan { incidences: vec![incidence], count: 50 };
            for [wi, wo] in scan.directions().unwrap() {
                let apart = wi.cross(&wo).norm().atan2(wi.dot(&wo)).to_degrees();
                assert!(apart >= 3.0 - 1e-9 && signed(&wo).abs() <= 78.0 + 1e-9, "{incidence}: {apart}");
            }
        }
    }

    #[test]
    fn goniometers_cover_one_half_of_the_hemisphere() {
        let grid = GonioGrid::default();
        let pairs = grid.directions().unwrap();
        assert_eq!((pairs.len(), grid.len()), (1146, 1146));
        for [wi, wo] in &pairs {
            assert!(wi.y == 0.0 && wi.x >= 0.0 && wo.y >= 0.0);
            assert!(wi.z >= MIN_DRAWN_COSINE && wo.z >= MIN_DRAWN_COSINE);
        }
        // Mirrored in the plane of x and z the grid is the other half: it is even in x.
        let mirrored = |a: &Vector3<f64>, b: &Vector3<f64>| (a.x + b.x).abs() + (a.y - b.y).abs() < 1e-12;
        let viewers: Vec<_> = pairs[..191].iter().map(|pair| pair[1]).collect();
        for wo in &viewers {
            assert!(viewers.iter().any(|other| mirrored(wo, other)), "{wo:?}");
        }
        for (i, a) in viewers.iter().enumerate() {
            assert!(viewers[..i].iter().all(|b| (a - b).norm() > 1e-3), "{a:?} twice");
        }
        // The mirror direction is in the plane of incidence.
        assert!(viewers.iter().filter(|wo| wo.y < 1e-12).count() == 21);
    }

    #[test]
    fn a_count_gives_a_grid_near_it() {
        let incidences = GonioGrid::default().incidences;
        for count in [18, 60, 200, 387, 1000, 1146, 4096, 100_000, MAX_DIRECTIONS] {
            let grid = GonioGrid::with_count(incidences.clone(), count).unwrap();
            let ratio = grid.len() as f64 / count as f64;
            let tolerance = if count < 100 { 0.3 } else { 0.1 };
            assert!((ratio - 1.0).abs() < tolerance, "{count}: {grid:?}");
            if count < MAX_DIRECTIONS {
                assert_eq!(grid.directions().unwrap().len(), grid.len());
            }
        }
        assert_eq!(GonioGrid::with_count(incidences, 1146).unwrap(), GonioGrid::default());
    }

    #[test]
    fn scans_that_no_instrument_makes_are_refused() {
        let scan = |incidences: &[f64], count| {
            InPlaneScan { incidences: incidences.to_vec(), count }.directions().unwrap_err().to_string()
        };
        assert_eq!(scan(&[], 9), "incidences: expected at least one, each from 0 to 87 degrees, found none");
        assert!(scan(&[10.0, 88.0], 9).ends_with("found 88"));
        assert!(scan(&[f64::NAN], 9).ends_with("found NaN"));
        assert!(scan(&[-1.0], 9).ends_with("found -1"));
        assert_eq!(scan(&[1.0; 5], 9), "number of samples: expected 10 to 10000000, found 9");
        assert!(scan(&[1.0], MAX_DIRECTIONS + 1).ends_with("found 10000001"));
        assert!(GonioGrid::with_count(vec![1.0], 2).is_err());
        assert!(GonioGrid::with_count(vec![90.0], 20).is_err());
        for (polar_steps, azimuth_steps) in [(0, 3), (3, 0), (usize::MAX, usize::MAX), (10_000, 10_000)] {
            let grid = GonioGrid { polar_steps, azimuth_steps, ..GonioGrid::default() };
            assert!(grid.directions().is_err(), "{grid:?}");
        }
    }
}
