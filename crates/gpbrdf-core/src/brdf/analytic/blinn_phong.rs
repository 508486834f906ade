//! The Blinn-Phong model.

use std::f64::consts::FRAC_1_PI;

use nalgebra::Vector3;

use super::{Geometry, diffuse_plus};
use crate::brdf::{Brdf, Rgb};

/// A power of the half vector's cosine:
/// `f = diffuse / pi + specular N(n) (h . n)^n`, `N(n) = (n + 2)(n + 4) / (8 pi (n + 2^(-n/2)))`.
///
/// Source: the lobe is the cosine-power distribution of J. F. Blinn, "Models of Light Reflection for Computer
/// Synthesized Pictures" (1977). `N` is the exact normalisation at normal incidence (F. Giesen, "Phong and
/// Blinn-Phong Normalization Factors", 2009), not its approximation `(n + 8) / (8 pi)`: there the albedo is
/// exactly `diffuse + specular`, elsewhere it is less. Keep `diffuse + specular <= 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlinnPhong {
    /// Diffuse albedo.
    pub diffuse: Rgb,
    /// Albedo of the lobe at normal incidence.
    pub specular: Rgb,
    /// The exponent `n >= 0`. It is about four times that of Phong's model for the same lobe.
    pub exponent: f64,
}

impl Default for BlinnPhong {
    fn default() -> Self {
        Self { diffuse: [0.4; 3], specular: [0.2; 3], exponent: 200.0 }
    }
}

impl BlinnPhong {
    /// `N(n)`, sr^-1.
    fn normalization(&self) -> f64 {
        let n = self.exponent;
        0.125 * FRAC_1_PI * (n + 2.0) * (n + 4.0) / (n + (-0.5 * n).exp2())
    }
}

impl Brdf for BlinnPhong {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        let Some(geometry) = Geometry::new(wi, wo) else { return [0.0; 3] };
        let lobe = self.normalization() * geometry.cos_h().powf(self.exponent);
        diffuse_plus(self.diffuse, |c| self.specular[c] * lobe)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::analytic::checks::{albedo, assert_conserves_energy, assert_pinned};

    const SAMPLE: BlinnPhong =
        BlinnPhong { diffuse: [0.5, 0.2, 0.0], specular: [0.3, 0.4, 0.1], exponent: 80.0 };

    #[test]
    fn pinned_values() {
        assert_pinned(
            &SAMPLE,
            [
                [0.277_105_000_189_050_1, 0.220_928_720_032_964_5, 0.039_316_685_699_051_59],
                [0.328_149_587_899_311, 0.288_988_170_313_312_3, 0.056_331_548_269_138_54],
                [0.159_154_943_091_895_8, 0.063_661_977_236_758_75, 1.514_129_538_369_853_2e-16],
                [1.186_897_988_107_797_7, 1.433_986_037_257_961_4, 0.342_581_015_005_300_8],
            ],
        );
    }

    #[test]
    fn albedo_at_normal_incidence_is_the_sum_of_the_weights() {
        for exponent in [0.0, 1.0, 20.0, 300.0] {
            let f = BlinnPhong { exponent, ..SAMPLE };
            let found = albedo(&f, 0.0, 256);
            for c in 0..3 {
                assert!((found[c] - f.diffuse[c] - f.specular[c]).abs() < 1e-3, "{exponent} {found:?}");
            }
            let full = BlinnPhong { diffuse: [0.0, 0.5, 0.2], specular: [0.999, 0.499, 0.799], exponent };
            assert_conserves_energy(&full, "blinn-phong");
        }
    }
}
