//! The Cook-Torrance model.

use std::f64::consts::FRAC_1_PI;

use nalgebra::Vector3;

use super::{Geometry, diffuse_plus, fresnel_dielectric};
use crate::brdf::{Brdf, Rgb};

/// Microfacets with Beckmann's distribution of slopes:
/// `f = diffuse / pi + specular F D G / (4 cos_i cos_o)` with
/// `D = exp(-(tan theta_h / m)^2) / (pi m^2 cos_h^4)`, the full Fresnel reflectance `F` from the index of
/// refraction, and the shadowing `G = min(1, 2 cos_h cos_i / cos_d, 2 cos_h cos_o / cos_d)`.
///
/// Source: R. L. Cook and K. E. Torrance, "A Reflectance Model for Computer Graphics" (1982). The paper
/// writes `F D G / (pi cos_i cos_o)` with `D = exp(..) / (m^2 cos_h^4)`: four times this lobe, and more light
/// than falls on it. Here `D` has a projected area of 1 and the factor is that of Torrance and Sparrow. As in
/// the paper a metal is given by the real index that has its reflectance `F0` at normal incidence,
/// `ior = (1 + sqrt F0) / (1 - sqrt F0)`. Reciprocal. Keep `diffuse + specular <= 1` (the paper's
/// `d + s = 1`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CookTorrance {
    /// Diffuse albedo.
    pub diffuse: Rgb,
    /// Weight of the lobe; 1 for a surface that consists of facets alone.
    pub specular: Rgb,
    /// Root mean square slope `m` of the facets, positive.
    pub roughness: f64,
    /// Index of refraction.
    pub ior: Rgb,
}

impl Default for CookTorrance {
    fn default() -> Self {
        Self { diffuse: [0.4; 3], specular: [0.6; 3], roughness: 0.25, ior: [1.5; 3] }
    }
}

impl CookTorrance {
    /// `D`, sr^-1, with `1 / cos_h^4 = (1 + tan_h^2)^2`.
    fn distribution(&self, geometry: &Geometry) -> f64 {
        let m2 = self.roughness * self.roughness;
        let tan2 = geometry.tan2_h();
        FRAC_1_PI * (1.0 + tan2) * (1.0 + tan2) * (-tan2 / m2).exp() / m2
    }
}

impl Brdf for CookTorrance {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        let Some(geometry) = Geometry::new(wi, wo) else { return [0.0; 3] };
        let lobe = self.distribution(&geometry) * geometry.torrance_sparrow();
        diffuse_plus(self.diffuse, |c| {
            self.specular[c] * lobe * fresnel_dielectric(geometry.cos_d, self.ior[c])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::analytic::checks::{assert_conserves_energy, assert_pinned, projected_area};

    const SAMPLE: CookTorrance = CookTorrance {
        diffuse: [0.5, 0.2, 0.0],
        specular: [0.3, 0.4, 1.0],
        roughness: 0.3,
        ior: [1.5, 1.3, 5.0],
    };

    #[test]
    fn pinned_values() {
        assert_pinned(
            &SAMPLE,
            [
                [0.170_479_419_991_999_4, 0.070_342_482_833_067_3, 0.383_804_038_068_305_26],
                [0.324_730_144_156_259_56, 0.214_882_273_006_727_44, 1.676_392_645_177_006_4],
                [0.159_154_960_508_047_12, 0.063_661_987_113_592_79, 6.450_426_588_203_28e-7],
                [0.179_827_621_492_542_9, 0.076_153_736_708_983_48, 0.665_145_674_224_768_8],
            ],
        );
    }

    #[test]
    fn distribution_is_normalised_and_energy_conserved() {
        for roughness in [0.05, 0.3, 1.0] {
            let f = CookTorrance { roughness, ior: [1e6; 3], specular: [0.999; 3], diffuse: [0.0; 3] };
            let area = projected_area(|h| f.distribution(&Geometry::new(h, h).unwrap()));
            assert!((area - 1.0).abs() < 1e-4, "{roughness} {area}");
            if roughness > 0.1 {
                assert_conserves_energy(&f, "cook-torrance");
            }
        }
        assert_conserves_energy(&SAMPLE, "cook-torrance");
    }
}
