//! Blinn's microfacet model.

use std::f64::consts::FRAC_1_PI;

use nalgebra::Vector3;

use super::{Geometry, diffuse_plus, fresnel_dielectric};
use crate::brdf::{Brdf, Rgb};

/// Microfacets distributed like the surface of ellipsoids of revolution:
/// `f = diffuse / pi + specular F D G / (4 cos_i cos_o)` with
/// `D = c^2 / (pi (cos_h^2 (c^2 - 1) + 1)^2)`, the Fresnel reflectance `F` of a dielectric and the shadowing
/// `G = min(1, 2 cos_h cos_i / cos_d, 2 cos_h cos_o / cos_d)` of V-shaped grooves.
///
/// Source: J. F. Blinn, "Models of Light Reflection for Computer Synthesized Pictures" (1977), with the
/// distribution that he calls `D3`, from T. S. Trowbridge and K. P. Reitz (1975). Blinn's `D3` has a peak of
/// 1 and no factor `1/4`. Here `D = D3 / (pi c^2)`, so that its projected area is 1, and the factor is that
/// of Torrance and Sparrow: the lobe then reflects no more light than falls on it. Reciprocal. Keep
/// `diffuse + specular <= 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blinn {
    /// Diffuse albedo.
    pub diffuse: Rgb,
    /// Weight of the lobe; 1 for a surface that consists of facets alone.
    pub specular: Rgb,
    /// The ellipsoids' eccentricity `c` in `(0, 1]`: near 0 a mirror, 1 a sphere.
    pub eccentricity: f64,
    /// Index of refraction.
    pub ior: Rgb,
}

impl Default for Blinn {
    fn default() -> Self {
        Self { diffuse: [0.4; 3], specular: [0.6; 3], eccentricity: 0.2, ior: [1.5; 3] }
    }
}

impl Blinn {
    /// `D`, sr^-1. The bracket is computed as `sin_h^2 + c^2 cos_h^2`, which loses no digits near the normal.
    fn distribution(&self, geometry: &Geometry) -> f64 {
        let c2 = self.eccentricity * self.eccentricity;
        let bracket = geometry.sin2_h() + c2 * geometry.cos_h() * geometry.cos_h();
        FRAC_1_PI * c2 / (bracket * bracket)
    }
}

impl Brdf for Blinn {
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

    const SAMPLE: Blinn = Blinn {
        diffuse: [0.5, 0.2, 0.0],
        specular: [0.3, 0.4, 1.0],
        eccentricity: 0.25,
        ior: [1.5, 1.3, 5.0],
    };

    #[test]
    fn pinned_values() {
        assert_pinned(
            &SAMPLE,
            [
                [0.167_625_382_083_768_56, 0.068_658_836_304_737_2, 0.287_076_278_928_371],
                [0.290_891_588_301_894_93, 0.183_977_424_987_026_18, 1.333_788_766_135_864],
                [0.159_472_967_128_491_5, 0.063_842_331_132_748_38, 0.011_778_668_022_079_38],
                [0.188_923_599_988_827_82, 0.081_650_110_876_762_63, 0.957_809_770_883_667_1],
            ],
        );
    }

    #[test]
    fn distribution_is_normalised_and_energy_conserved() {
        for eccentricity in [0.05, 0.25, 0.7, 1.0] {
            let f = Blinn { eccentricity, ior: [1e6; 3], specular: [0.999; 3], diffuse: [0.0; 3] };
            let area = projected_area(|h| f.distribution(&Geometry::new(h, h).unwrap()));
            assert!((area - 1.0).abs() < 1e-4, "{eccentricity} {area}");
            if eccentricity > 0.1 {
                assert_conserves_energy(&f, "blinn");
            }
        }
        assert_conserves_energy(&SAMPLE, "blinn");
    }
}
