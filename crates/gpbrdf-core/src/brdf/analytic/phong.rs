//! The modified Phong model.

use std::f64::consts::FRAC_1_PI;

use nalgebra::Vector3;

use super::diffuse_plus;
use crate::brdf::{Brdf, Rgb};

/// Phong's model in its reciprocal, energy-normalised form:
/// `f = diffuse / pi + specular (n + 2) / (2 pi) max(0, r . wo)^n`, with `r = 2 (wi . n) n - wi` the mirrored
/// light direction.
///
/// Source: E. P. Lafortune and Y. D. Willems, "Using the Modified Phong Reflectance Model for Physically
/// Based Rendering" (1994); the lobe is that of B. T. Phong, "Illumination for Computer Generated Pictures"
/// (1975). At normal incidence the albedo is exactly `diffuse + specular`, elsewhere it is less: keep
/// `diffuse + specular <= 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phong {
    /// Diffuse albedo.
    pub diffuse: Rgb,
    /// Albedo of the lobe at normal incidence.
    pub specular: Rgb,
    /// The exponent `n >= 0`; larger is shinier.
    pub exponent: f64,
}

impl Default for Phong {
    fn default() -> Self {
        Self { diffuse: [0.4; 3], specular: [0.2; 3], exponent: 50.0 }
    }
}

impl Brdf for Phong {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        if !(wi.z > 0.0 && wo.z > 0.0) {
            return [0.0; 3];
        }
        // r . wo with the normal along z.
        let cosine = wi.z * wo.z - (wi.x * wo.x + wi.y * wo.y);
        let lobe = if cosine > 0.0 {
            0.5 * FRAC_1_PI * (self.exponent + 2.0) * cosine.min(1.0).powf(self.exponent)
        } else {
            0.0
        };
        diffuse_plus(self.diffuse, |c| self.specular[c] * lobe)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::analytic::checks::{albedo, assert_conserves_energy, assert_pinned};

    const SAMPLE: Phong = Phong { diffuse: [0.5, 0.2, 0.0], specular: [0.3, 0.4, 0.1], exponent: 20.0 };

    #[test]
    fn pinned_values() {
        assert_pinned(
            &SAMPLE,
            [
                [0.351_243_690_948_163_4, 0.319_780_307_711_782_2, 0.064_029_582_618_756],
                [0.908_527_913_686_981_2, 1.062_825_938_030_205_9, 0.249_790_990_198_361_93],
                [0.159_154_943_091_895_35, 0.063_661_977_236_758_14, 0.0],
                [1.209_577_567_498_404_6, 1.464_225_476_445_437, 0.350_140_874_802_169_77],
            ],
        );
    }

    #[test]
    fn albedo_at_normal_incidence_is_the_sum_of_the_weights() {
        for exponent in [0.0, 1.0, 20.0, 300.0] {
            let f = Phong { exponent, ..SAMPLE };
            let found = albedo(&f, 0.0, 256);
            for c in 0..3 {
                assert!((found[c] - f.diffuse[c] - f.specular[c]).abs() < 1e-3, "{exponent} {found:?}");
            }
            let full = Phong { diffuse: [0.0, 0.5, 0.2], specular: [0.999, 0.499, 0.799], exponent };
            assert_conserves_energy(&full, "phong");
        }
    }
}
