//! Ward's Gaussian model.

use std::f64::consts::FRAC_1_PI;

use nalgebra::Vector3;

use super::{Geometry, diffuse_plus};
use crate::brdf::angles::HORIZON_COSINE;
use crate::brdf::{Brdf, Rgb};

/// An elliptical Gaussian of surface slopes:
/// `f = diffuse / pi + specular / sqrt(cos_i cos_o) exp(-((h.x/alpha_x)^2 + (h.y/alpha_y)^2) / h.z^2)
/// / (4 pi alpha_x alpha_y)`.
///
/// Source: G. J. Ward, "Measuring and Modeling Anisotropic Reflection" (1992): eq. 5a, and eq. 4 where
/// `alpha_x = alpha_y`. Only in that case is the model isotropic, as tables require; otherwise
/// half-difference angles are evaluated with the half vector above the x axis. Reciprocal. The lobe's albedo
/// is close to `specular` where incidence and slopes are small, and falls towards grazing angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ward {
    /// Diffuse albedo.
    pub diffuse: Rgb,
    /// Weight of the lobe.
    pub specular: Rgb,
    /// Standard deviation of the slope along x, positive; Ward assumes at most about 0.2.
    pub alpha_x: f64,
    /// Standard deviation of the slope along y.
    pub alpha_y: f64,
}

impl Default for Ward {
    fn default() -> Self {
        Self { diffuse: [0.4; 3], specular: [0.2; 3], alpha_x: 0.15, alpha_y: 0.15 }
    }
}

impl Brdf for Ward {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        let Some(geometry) = Geometry::new(wi, wo) else { return [0.0; 3] };
        let h = geometry.h;
        let cos_h = h.z.max(HORIZON_COSINE);
        let (x, y) = (h.x / (self.alpha_x * cos_h), h.y / (self.alpha_y * cos_h));
        let peak = 0.25 * FRAC_1_PI / (self.alpha_x * self.alpha_y);
        let lobe = peak * (-(x * x + y * y)).exp() / geometry.cosine_product().sqrt();
        diffuse_plus(self.diffuse, |c| self.specular[c] * lobe)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::brdf::analytic::checks::{
        albedo, assert_conserves_energy, assert_finite_and_reciprocal, assert_pinned,
    };

    const SAMPLE: Ward =
        Ward { diffuse: [0.5, 0.2, 0.0], specular: [0.3, 0.4, 0.1], alpha_x: 0.2, alpha_y: 0.2 };

    #[test]
    fn pinned_values() {
        assert_pinned(
            &SAMPLE,
            [
                [0.349_059_313_379_964_4, 0.316_867_804_287_516_8, 0.063_301_456_762_689_68],
                [0.654_170_212_971_323_9, 0.723_682_337_075_996_3, 0.165_005_089_959_809_53],
                [0.159_154_943_091_895_68, 0.063_661_977_236_758_61, 1.175_452_590_831_503e-16],
                [0.938_262_528_762_235_9, 1.102_472_091_463_878_8, 0.259_702_528_556_780_17],
            ],
        );
        let anisotropic = Ward { alpha_y: 0.5, ..SAMPLE };
        assert_pinned(
            &anisotropic,
            [
                [0.378_565_639_765_227_6, 0.356_209_572_801_201_14, 0.073_136_898_891_110_75],
                [0.679_511_960_069_782_1, 0.757_471_333_207_273_8, 0.173_452_338_992_628_9],
                [0.159_154_943_123_615_1, 0.063_661_977_279_051_17, 1.057_325_837_577_319e-11],
                [0.470_797_977_360_031_54, 0.479_186_022_927_606_4, 0.103_881_011_422_712_07],
            ],
        );
        assert_finite_and_reciprocal(&anisotropic, "ward, anisotropic");
    }

    #[test]
    fn peak_and_energy() {
        let n = Vector3::z();
        let expected = 0.1 / (4.0 * PI * 0.04);
        assert!((SAMPLE.eval(&n, &n)[2] - expected).abs() < 1e-15);
        let lobe = Ward { diffuse: [0.0; 3], specular: [1.0; 3], alpha_x: 0.05, alpha_y: 0.05 };
        assert!((albedo(&lobe, 0.0, 512)[0] - 1.0).abs() < 0.01);
        let full = Ward { diffuse: [0.0, 0.5, 0.2], specular: [0.98, 0.48, 0.78], ..SAMPLE };
        assert_conserves_energy(&full, "ward");
    }
}
