//! What samples leave open.

use std::f64::consts::FRAC_PI_2;

use crate::brdf::angles::HalfDiff;
use crate::sample::SampleSet;

/// Directions within this angle of a plane count as in it, radians.
const IN_PLANE: f64 = 1.0 * FRAC_PI_2 / 90.0;

/// A highlight may be narrower than this: without a sample so near to the mirror direction its height is a
/// guess, degrees.
const NEAR_MIRROR: f64 = 5.0;

/// Samples that end below this polar angle leave grazing directions open, degrees.
const GRAZING: f64 = 60.0;

/// Incidences that differ by less count as one, degrees.
const ONE_INCIDENCE: f64 = 0.5;

impl SampleSet {
    /// Whether there are samples, and all of them lie in the plane of incidence to within a degree.
    #[must_use]
    pub fn is_in_plane(&self) -> bool {
        !self.is_empty() && self.angles.iter().all(|angles| is_in_plane(*angles))
    }

    /// What the directions of the samples leave open, in sentences for users without a full stop. A model
    /// predicts there all the same, from the rest and from its prior.
    #[must_use]
    pub fn blind_spots(&self) -> Vec<String> {
        let mut found = Vec::new();
        if self.is_empty() {
            return found;
        }
        if self.is_in_plane() {
            found.push(
                "all samples lie in the plane of incidence: values outside of it are extrapolated".to_owned(),
            );
        }
        let nearest = self.angles.iter().map(|a| a.theta_h.to_degrees()).fold(f64::INFINITY, f64::min);
        if nearest > NEAR_MIRROR {
            found.push(format!(
                "no sample is nearer to a mirror direction than {nearest:.1} degrees (between normal and half \
                 vector): the height of a highlight is extrapolated"
            ));
        }
        let cosines = || self.iter().map(|sample| (sample.wi.z, sample.wo.z));
        let polar = |cosine: f64| cosine.clamp(-1.0, 1.0).acos().to_degrees();
        let farthest = cosines().map(|(i, o)| polar(i.min(o))).fold(0.0, f64::max);
        if farthest < GRAZING {
            found.push(format!(
                "no sample has a direction beyond {farthest:.1} degrees from the normal: grazing values are \
                 extrapolated"
            ));
        }
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        let lights = range(&mut cosines().map(|(i, _)| polar(i)));
        let viewers = range(&mut cosines().map(|(_, o)| polar(o)));
        if self.len() > 1 {
            for (who, (low, high)) in [("light", lights), ("viewer", viewers)] {
                if high - low < ONE_INCIDENCE {
                    found.push(format!(
                        "all samples have the {who} at {:.1} degrees from the normal: how the material changes \
                         with that angle is extrapolated",
                        0.5 * (low + high)
                    ));
                }
            }
        }
        found
    }
}

/// Whether light, viewer and normal lie in one plane, within a degree.
pub(crate) fn is_in_plane(angles: HalfDiff) -> bool {
    let (wi, wo) = angles.to_directions();
    // The part of the viewer's direction across the plane of light and normal, and the other way round.
    let across = wi.cross(&wo).z.abs();
    let (light, viewer) = (wi.x.hypot(wi.y), wo.x.hypot(wo.y));
    across <= IN_PLANE.sin() * light.max(viewer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::angles::direction;

    fn set(directions: impl IntoIterator<Item = [f64; 4]>) -> SampleSet {
        let sample = |[ti, pi, to, po]: [f64; 4]| crate::Sample {
            wi: direction(ti.to_radians(), pi.to_radians()),
            wo: direction(to.to_radians(), po.to_radians()),
            value: [0.1; 3],
        };
        directions.into_iter().map(sample).collect()
    }

    fn spots(set: &SampleSet) -> String {
        set.blind_spots().join("; ")
    }

    #[test]
    fn every_blind_spot_is_named_and_nothing_else() {
        let steps = || (-75..=75).step_by(5).map(f64::from);
        let scan =
            |light: f64| steps().map(move |to| [light, 40.0, to.abs(), if to < 0.0 { 40.0 } else { 220.0 }]);
        let in_plane = set([10.0, 40.0, 70.0].into_iter().flat_map(scan));
        assert_eq!(
            spots(&in_plane),
            "all samples lie in the plane of incidence: values outside of it are extrapolated"
        );
        let one = spots(&set(scan(30.0)));
        assert!(one.contains("the light at 30.0 degrees") && !one.contains("viewer at"), "{one}");
        let around = |ti: f64| {
            (0..36).flat_map(move |p| [20.0, 45.0, 70.0].map(|to| [ti, 0.0, to, 10.0 * f64::from(p)]))
        };
        assert_eq!(spots(&set([20.0, 45.0, 70.0].into_iter().flat_map(around))), "");
        let flat = set((0..30).map(|k| [f64::from(k % 6) * 10.0, 0.0, 40.0 - f64::from(k), 90.0]));
        let said = spots(&flat);
        assert!(said.contains("no sample has a direction beyond 50.0 degrees"), "{said}");
        let far = spots(&set([[60.0, 0.0, 60.0, 90.0], [50.0, 0.0, 70.0, 80.0], [75.0, 0.0, 20.0, 120.0]]));
        assert!(far.contains("nearer to a mirror direction than"), "{far}");
        assert!(SampleSet::default().blind_spots().is_empty());
    }
}
