//! Ideal diffuse reflection.

use std::f64::consts::FRAC_1_PI;

use nalgebra::Vector3;

use crate::brdf::{Brdf, Rgb};

/// Lambert's model, the same in every direction: `f = albedo / pi`.
///
/// Source: J. H. Lambert, "Photometria" (1760). Reciprocal; its directional albedo is `albedo`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lambert {
    /// Reflected share of the light in each channel, in `[0, 1]`.
    pub albedo: Rgb,
}

impl Default for Lambert {
    fn default() -> Self {
        Self { albedo: [0.5; 3] }
    }
}

impl Brdf for Lambert {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        if wi.z > 0.0 && wo.z > 0.0 { self.albedo.map(|x| x * FRAC_1_PI) } else { [0.0; 3] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::analytic::checks::{albedo, assert_pinned};

    #[test]
    fn furnace_returns_the_albedo() {
        let f = Lambert { albedo: [1.0, 0.25, 0.0] };
        for theta in [0.0, 0.7, 1.5] {
            let found = albedo(&f, theta, 256);
            for c in 0..3 {
                assert!((found[c] - f.albedo[c]).abs() < 1e-5, "{found:?}");
            }
        }
        let f = Lambert { albedo: [0.5, 0.25, 0.0] };
        assert_pinned(&f, [[0.159_154_943_091_895_35, 0.079_577_471_545_947_67, 0.0]; 4]);
    }
}
