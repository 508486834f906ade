//! Ashikhmin and Shirley's anisotropic Phong model.

use std::f64::consts::FRAC_1_PI;

use nalgebra::Vector3;

use super::Geometry;
use crate::brdf::angles::HORIZON_COSINE;
use crate::brdf::{Brdf, Rgb};

/// An anisotropic power of the half vector's cosine with Fresnel reflection, over a diffuse base that
/// receives the light that the coat lets through:
///
/// - lobe: `sqrt((nu+1)(nv+1)) / (8 pi) cos_h^((nu h.x^2 + nv h.y^2) / (1 - cos_h^2))
///   / (cos_d max(cos_i, cos_o)) F`, with Schlick's `F = specular + (1 - specular)(1 - cos_d)^5`;
/// - base: `28 diffuse / (23 pi) (1 - specular) (1 - (1 - cos_i/2)^5) (1 - (1 - cos_o/2)^5)`.
///
/// Source: M. Ashikhmin and P. Shirley, "An Anisotropic Phong BRDF Model" (2000), the specular and the
/// diffuse term. The model is isotropic, as tables require, only where `exponent_u = exponent_v`; otherwise
/// half-difference angles are evaluated with the half vector above the x axis. Reciprocal and energy
/// conserving.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AshikhminShirley {
    /// Albedo of the base (`R_d`).
    pub diffuse: Rgb,
    /// Reflectance of the coat at normal incidence (`R_s`).
    pub specular: Rgb,
    /// The exponent `nu >= 0` along x.
    pub exponent_u: f64,
    /// The exponent `nv >= 0` along y.
    pub exponent_v: f64,
}

impl Default for AshikhminShirley {
    fn default() -> Self {
        Self { diffuse: [0.5; 3], specular: [0.05; 3], exponent_u: 100.0, exponent_v: 100.0 }
    }
}

/// `1 - (1 - cosine / 2)^5`.
fn transmitted(cosine: f64) -> f64 {
    1.0 - (1.0 - 0.5 * cosine).powi(5)
}

impl Brdf for AshikhminShirley {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        let Some(geometry) = Geometry::new(wi, wo) else { return [0.0; 3] };
        let (h, sin2_h) = (geometry.h, geometry.sin2_h());
        // At h = n the exponent has no limit, but the power is 1 for every exponent.
        let power = if sin2_h > 0.0 {
            let exponent = (self.exponent_u * h.x * h.x + self.exponent_v * h.y * h.y) / sin2_h;
            geometry.cos_h().powf(exponent)
        } else {
            1.0
        };
        let spread = 0.125 * FRAC_1_PI * ((self.exponent_u + 1.0) * (self.exponent_v + 1.0)).sqrt();
        let largest = geometry.cos_i.max(geometry.cos_o).max(HORIZON_COSINE);
        let lobe = spread * power / (geometry.cos_d.max(HORIZON_COSINE) * largest);
        let schlick = (1.0 - geometry.cos_d).powi(5);
        let base = 28.0 / 23.0 * FRAC_1_PI * (transmitted(geometry.cos_i) * transmitted(geometry.cos_o));
        std::array::from_fn(|c| {
            let (rd, rs) = (self.diffuse[c], self.specular[c]);
            lobe * (rs + (1.0 - rs) * schlick) + base * rd * (1.0 - rs)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::analytic::checks::{
        assert_conserves_energy, assert_finite_and_reciprocal, assert_pinned, projected_area,
    };

    const SAMPLE: AshikhminShirley = AshikhminShirley {
        diffuse: [0.5, 0.2, 0.0],
        specular: [0.3, 0.04, 0.1],
        exponent_u: 80.0,
        exponent_v: 80.0,
    };

    #[test]
    fn pinned_values() {
        assert_pinned(
            &SAMPLE,
            [
                [0.271_910_927_600_597_2, 0.083_406_368_291_997_56, 0.052_973_111_348_122_01],
                [1.207_323_028_649_878_8, 0.417_510_130_480_096_4, 0.562_344_057_825_049_3],
                [0.099_400_334_237_973_98, 0.054_528_183_353_402_59, 2.216_039_017_228_900_2e-16],
                [1.762_780_988_814_749_4, 0.285_071_759_464_385_6, 0.552_673_017_435_725_4],
            ],
        );
        let anisotropic = AshikhminShirley { exponent_v: 10.0, ..SAMPLE };
        assert_pinned(
            &anisotropic,
            [
                [0.439_900_351_013_443_4, 0.105_931_039_670_434_67, 0.109_066_571_657_576_59],
                [2.103_092_285_316_504_4, 0.718_223_819_343_217_8, 1.000_378_262_335_133_2],
                [0.099_400_334_325_126_77, 0.054_528_183_365_022_964, 2.905_114_938_680_725e-11],
                [0.720_626_755_394_976_9, 0.144_011_077_908_785_9, 0.203_667_670_065_316_55],
            ],
        );
        assert_finite_and_reciprocal(&anisotropic, "ashikhmin-shirley, anisotropic");
    }

    #[test]
    fn energy() {
        for exponent in [5.0, 100.0] {
            let full = AshikhminShirley {
                diffuse: [1.0, 1.0, 0.0],
                specular: [0.0, 0.5, 1.0],
                exponent_u: exponent,
                exponent_v: exponent,
            };
            assert_conserves_energy(&full, "ashikhmin-shirley");
        }
        // 28/23 gives the base an albedo of 1 - (1 - cos_i/2)^5: all light that enters leaves, 31/32 at
        // normal incidence.
        let area = projected_area(|w| 28.0 / 23.0 * FRAC_1_PI * transmitted(w.z));
        assert!((area - 1.0).abs() < 1e-6, "{area}");
    }
}
