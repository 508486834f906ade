//! Properties that every model must have. The tests of this folder and of the built-in materials use them.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Rotation3, Vector3};

use crate::base::random::SplitMix64;
use crate::brdf::angles::{HalfDiff, direction};
use crate::brdf::{Brdf, Rgb};

type Pair = (Vector3<f64>, Vector3<f64>);

/// The pairs at which hand-computed values are pinned: an off-specular one, one near the mirror direction
/// at grazing angles, a retro-reflective one, and the mirror direction itself. Degrees: (30, 0; 45, 150),
/// (70, 20; 65, 190), (50, 40; 50, 40), (40, 10; 40, 190).
pub(crate) fn pinned_pairs() -> [Pair; 4] {
    [
        [30.0, 0.0, 45.0, 150.0],
        [70.0, 20.0, 65.0, 190.0],
        [50.0, 40.0, 50.0, 40.0],
        [40.0, 10.0, 40.0, 190.0f64],
    ]
    .map(|angles| {
        let [ti, pi, to, po] = angles.map(f64::to_radians);
        (direction(ti, pi), direction(to, po))
    })
}

/// Asserts values that were computed elsewhere, one triple for each of [`pinned_pairs`].
pub(crate) fn assert_pinned(brdf: &impl Brdf, expected: [Rgb; 4]) {
    for ((wi, wo), expected) in pinned_pairs().iter().zip(expected) {
        let found = brdf.eval(wi, wo);
        for c in 0..3 {
            let error = (found[c] - expected[c]).abs();
            assert!(error <= 1e-11 * expected[c].abs(), "{found:?} {expected:?} at {wi} {wo}");
        }
    }
}

/// A seeded stream of numbers in `[0, 1)`.
fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut random = SplitMix64::new(seed);
    move || random.next_unit()
}

/// Random pairs above the horizon, uniform in solid angle.
pub(crate) fn random_pairs(seed: u64, count: usize) -> Vec<Pair> {
    let mut next = uniform(seed);
    let mut one = move || direction((1.0 - next()).acos(), TAU * next());
    (0..count).map(|_| (one(), one())).filter(|(a, b)| a.z > 1e-3 && b.z > 1e-3).collect()
}

/// Random pairs and extreme ones: `h = n`, retro-reflection and grazing angles, down to the smallest positive
/// cosine.
pub(crate) fn all_pairs(seed: u64) -> Vec<Pair> {
    let mut pairs = random_pairs(seed, 2000);
    let cosines =
        [1.0, 1.0 - 1e-16, 0.999_999, 0.5, 1e-3, 1e-6, 1e-9, 1e-17, 1e-160, 1e-300, f64::MIN_POSITIVE];
    let at = |cos: f64, phi: f64| {
        let sin = (1.0 - cos * cos).sqrt();
        Vector3::new(sin * phi.cos(), sin * phi.sin(), cos)
    };
    for a in cosines {
        for b in cosines {
            for gap in [0.0, 1e-9, 1.0, FRAC_PI_2, PI - 1e-9, PI] {
                pairs.push((at(a, 0.3), at(b, 0.3 + gap)));
            }
            // Exactly opposite azimuths, without the rounding error of sin(pi).
            let (u, v) = (at(a, 0.3), at(b, 0.3));
            pairs.push((u, Vector3::new(-v.x, -v.y, v.z)));
        }
    }
    pairs
}

/// Asserts that the values are finite, non-negative and reciprocal, and zero at and below the horizon.
pub(crate) fn assert_finite_and_reciprocal(brdf: &impl Brdf, what: &str) {
    for (wi, wo) in all_pairs(1) {
        let f = brdf.eval(&wi, &wo);
        assert!(f.iter().all(|x| x.is_finite() && *x >= 0.0), "{what}: {f:?} at {wi} {wo}");
        assert_eq!(f, brdf.eval(&wo, &wi), "{what}: not reciprocal at {wi} {wo}");
    }
    let tilted = direction(0.4, 1.0);
    for below in [Vector3::x(), -Vector3::z(), direction(2.0, 1.0), Vector3::new(1.0, 0.0, -1e-300)] {
        assert_eq!(brdf.eval(&below, &tilted), [0.0; 3], "{what}");
        assert_eq!(brdf.eval(&tilted, &below), [0.0; 3], "{what}");
    }
}

/// Asserts that the value depends on half-difference angles alone: it is unchanged when both directions turn
/// about the normal.
pub(crate) fn assert_isotropic(brdf: &impl Brdf, what: &str) {
    for (k, (wi, wo)) in random_pairs(2, 2000).into_iter().enumerate() {
        let f = brdf.eval(&wi, &wo);
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.7 + k as f64);
        let turned = brdf.eval(&(turn * wi), &(turn * wo));
        let angles = brdf.eval_half_diff(HalfDiff::from_directions(&wi, &wo));
        for c in 0..3 {
            let scale = f[c].abs() + 1e-12;
            assert!((turned[c] - f[c]).abs() < 1e-9 * scale, "{what}: {f:?} {turned:?}");
            assert!((angles[c] - f[c]).abs() < 1e-9 * scale, "{what}: {f:?} {angles:?}");
        }
    }
}

/// Asserts all of the above.
pub(crate) fn assert_well_behaved(brdf: &impl Brdf, what: &str) {
    assert_finite_and_reciprocal(brdf, what);
    assert_isotropic(brdf, what);
}

/// Directional albedo `integral of f cos(theta_o) dwo` by the midpoint rule, `n x 2n` nodes over the
/// hemisphere.
pub(crate) fn albedo(brdf: &impl Brdf, theta_i: f64, n: u32) -> Rgb {
    let wi = direction(theta_i, 0.0);
    let step = FRAC_PI_2 / f64::from(n);
    let mut sum = [0.0; 3];
    for i in 0..n {
        let theta = (f64::from(i) + 0.5) * step;
        let weight = theta.sin() * theta.cos() * step * 2.0 * step;
        for j in 0..2 * n {
            let f = brdf.eval(&wi, &direction(theta, (f64::from(j) + 0.5) * 2.0 * step));
            for c in 0..3 {
                sum[c] += weight * f[c];
            }
        }
    }
    sum
}

/// Asserts an albedo of at most 1 at every tenth degree, and near the horizon.
pub(crate) fn assert_conserves_energy(brdf: &impl Brdf, what: &str) {
    for degrees in (0..=80).step_by(10).chain([85, 88]) {
        let found = albedo(brdf, f64::from(degrees).to_radians(), 256);
        assert!(found.iter().all(|x| *x <= 1.0), "{what}: albedo {found:?} at {degrees} degrees");
    }
}

/// `integral of D(theta) cos(theta) dw` over the hemisphere, with `D` evaluated at unit half vectors.
pub(crate) fn projected_area(distribution: impl Fn(&Vector3<f64>) -> f64) -> f64 {
    let n = 20_000;
    let step = FRAC_PI_2 / f64::from(n);
    (0..n)
        .map(|i| (f64::from(i) + 0.5) * step)
        .map(|theta| TAU * theta.sin() * theta.cos() * step * distribution(&direction(theta, 0.0)))
        .sum()
}
