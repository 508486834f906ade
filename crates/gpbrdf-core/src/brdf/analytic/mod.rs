//! Analytic BRDF models: one plain struct for each, and the geometry that they share.
//!
//! Every model is zero when a direction is at or below the horizon, finite everywhere above it, and
//! reciprocal to the last bit; only the neural one is not reciprocal. Where a model divides by a cosine, the
//! cosine is held at [`HORIZON_COSINE`] or above.

mod ashikhmin_shirley;
mod blinn;
mod blinn_phong;
#[cfg(test)]
pub(crate) mod checks;
mod cook_torrance;
mod lambert;
mod neural;
mod phong;
mod sgd;
mod ward;

use std::f64::consts::FRAC_1_PI;

use nalgebra::Vector3;

pub use ashikhmin_shirley::AshikhminShirley;
pub use blinn::Blinn;
pub use blinn_phong::BlinnPhong;
pub use cook_torrance::CookTorrance;
pub use lambert::Lambert;
pub use neural::{NEURAL_FLOATS, NeuralBrdf};
pub use phong::Phong;
pub use sgd::Sgd;
pub use ward::Ward;

use crate::brdf::angles::HORIZON_COSINE;
use crate::brdf::{Brdf, Rgb};

/// Any of the analytic models.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum AnalyticBrdf {
    /// Ideal diffuse reflection.
    Lambert(Lambert),
    /// Modified Phong.
    Phong(Phong),
    /// Blinn-Phong.
    BlinnPhong(BlinnPhong),
    /// Ward's Gaussian model.
    Ward(Ward),
    /// Ashikhmin and Shirley's anisotropic Phong model.
    AshikhminShirley(AshikhminShirley),
    /// Blinn's microfacet model.
    Blinn(Blinn),
    /// Cook-Torrance.
    CookTorrance(CookTorrance),
    /// Shifted gamma distribution.
    Sgd(Sgd),
}

impl AnalyticBrdf {
    /// The model's name in lower case, for example `cook-torrance`.
    #[must_use]
    pub fn model_name(&self) -> &'static str {
        match self {
            Self::Lambert(_) => "lambert",
            Self::Phong(_) => "phong",
            Self::BlinnPhong(_) => "blinn-phong",
            Self::Ward(_) => "ward",
            Self::AshikhminShirley(_) => "ashikhmin-shirley",
            Self::Blinn(_) => "blinn",
            Self::CookTorrance(_) => "cook-torrance",
            Self::Sgd(_) => "sgd",
        }
    }
}

impl Brdf for AnalyticBrdf {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        match self {
            Self::Lambert(f) => f.eval(wi, wo),
            Self::Phong(f) => f.eval(wi, wo),
            Self::BlinnPhong(f) => f.eval(wi, wo),
            Self::Ward(f) => f.eval(wi, wo),
            Self::AshikhminShirley(f) => f.eval(wi, wo),
            Self::Blinn(f) => f.eval(wi, wo),
            Self::CookTorrance(f) => f.eval(wi, wo),
            Self::Sgd(f) => f.eval(wi, wo),
        }
    }
}

/// The geometric quantities of a pair of directions from which the models are computed.
#[derive(Clone, Copy, Debug)]
struct Geometry {
    /// `wi . n`, positive.
    cos_i: f64,
    /// `wo . n`, positive.
    cos_o: f64,
    /// The half vector.
    h: Vector3<f64>,
    /// `wi . h = wo . h = |wi + wo| / 2`, in `[0, 1]`.
    cos_d: f64,
}

impl Geometry {
    /// `None` when either direction lies at or below the horizon.
    fn new(wi: &Vector3<f64>, wo: &Vector3<f64>) -> Option<Self> {
        if !(wi.z > 0.0 && wo.z > 0.0) {
            return None;
        }
        let sum = wi + wo;
        let length = sum.norm();
        // Below this h equals the normal to rounding, as in HalfDiff. Opposite directions end up here, too.
        let h = if sum.x.hypot(sum.y) > 1e-15 { sum / length } else { Vector3::z() };
        Some(Self { cos_i: wi.z, cos_o: wo.z, h, cos_d: (0.5 * length).min(1.0) })
    }

    /// `cos theta_h`, in `(0, 1]`.
    fn cos_h(&self) -> f64 {
        self.h.z.min(1.0)
    }

    /// `sin^2 theta_h`, accurate near the normal.
    fn sin2_h(&self) -> f64 {
        self.h.x * self.h.x + self.h.y * self.h.y
    }

    /// `tan^2 theta_h`, at most `1 / HORIZON_COSINE^2`.
    fn tan2_h(&self) -> f64 {
        let cos_h = self.h.z.max(HORIZON_COSINE);
        self.sin2_h() / (cos_h * cos_h)
    }

    /// `cos_i cos_o`, with each cosine held at [`HORIZON_COSINE`] or above.
    fn cosine_product(&self) -> f64 {
        self.cos_i.max(HORIZON_COSINE) * self.cos_o.max(HORIZON_COSINE)
    }

    /// `G / (4 cos_i cos_o)` with the shadowing and masking of V-shaped grooves,
    /// `G = min(1, 2 cos_h cos_i / cos_d, 2 cos_h cos_o / cos_d)`: K. E. Torrance and E. M. Sparrow, "Theory
    /// for Off-Specular Reflection from Roughened Surfaces" (1967), as written by Blinn (1977).
    fn torrance_sparrow(&self) -> f64 {
        let groove = 2.0 * self.cos_h() * self.cos_i.min(self.cos_o) / self.cos_d.max(HORIZON_COSINE);
        groove.min(1.0) / (4.0 * self.cosine_product())
    }
}

/// `diffuse / pi + lobe` per channel, sr^-1.
fn diffuse_plus(diffuse: Rgb, lobe: impl Fn(usize) -> f64) -> Rgb {
    std::array::from_fn(|c| diffuse[c] * FRAC_1_PI + lobe(c))
}

/// Reflectance of a smooth dielectric in unpolarised light, in `[0, 1]`.
///
/// With `u = cos theta_d` and `g = sqrt(ior^2 + u^2 - 1)`:
/// `F = 1/2 ((g-u)/(g+u))^2 (1 + ((u(g+u)-1)/(u(g-u)+1))^2)`; 1 under total reflection (`ior < 1`).
fn fresnel_dielectric(cos_d: f64, ior: f64) -> f64 {
    let g_squared = ior * ior + cos_d * cos_d - 1.0;
    if g_squared < 0.0 {
        return 1.0;
    }
    let g = g_squared.sqrt();
    let sum = g + cos_d;
    if sum <= 0.0 {
        // This is grazing incidence without an interface (ior = 1), where nothing is reflected.
        return 0.0;
    }
    let perpendicular = (g - cos_d) / sum;
    let ratio = (cos_d * sum - 1.0) / (cos_d * (g - cos_d) + 1.0);
    0.5 * perpendicular * perpendicular * (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::checks::{all_pairs, assert_well_behaved};
    use super::*;

    #[test]
    fn fresnel_matches_snell_s_law_and_its_limits() {
        assert!((fresnel_dielectric(1.0, 1.5) - 0.04).abs() < 1e-15);
        assert!((fresnel_dielectric(0.0, 1.5) - 1.0).abs() < 1e-15);
        assert_eq!(fresnel_dielectric(0.0, 1.0), 0.0);
        assert!(fresnel_dielectric(0.3, 1.0) < 1e-30);
        assert_eq!(fresnel_dielectric(0.1, 0.7), 1.0);
        for i in 0..=90 {
            let theta = f64::from(i).to_radians();
            for ior in [1.1, 1.5, 2.4, 20.0] {
                // The two polarisations, computed from the refracted angle.
                let (ci, ct) = (theta.cos(), (theta.sin() / ior).asin().cos());
                let s = (ci - ior * ct) / (ci + ior * ct);
                let p = (ior * ci - ct) / (ior * ci + ct);
                let expected = 0.5 * (s * s + p * p);
                assert!((fresnel_dielectric(ci, ior) - expected).abs() < 1e-12, "{i} {ior}");
            }
        }
    }

    #[test]
    fn every_model_is_well_behaved_at_its_default() {
        let models = [
            AnalyticBrdf::Lambert(Lambert::default()),
            AnalyticBrdf::Phong(Phong::default()),
            AnalyticBrdf::BlinnPhong(BlinnPhong::default()),
            AnalyticBrdf::Ward(Ward::default()),
            AnalyticBrdf::AshikhminShirley(AshikhminShirley::default()),
            AnalyticBrdf::Blinn(Blinn::default()),
            AnalyticBrdf::CookTorrance(CookTorrance::default()),
            AnalyticBrdf::Sgd(Sgd::default()),
        ];
        for model in models {
            assert_well_behaved(&model, model.model_name());
        }
    }

    #[test]
    fn geometry_agrees_with_half_difference_angles() {
        for (wi, wo) in all_pairs(3) {
            let geometry = Geometry::new(&wi, &wo).unwrap();
            let angles = crate::brdf::angles::HalfDiff::from_directions(&wi, &wo);
            assert!((geometry.cos_h() - angles.theta_h.cos()).abs() < 1e-12);
            assert!((geometry.cos_d - angles.theta_d.cos()).abs() < 1e-12);
        }
        assert!(Geometry::new(&Vector3::x(), &Vector3::z()).is_none());
        assert!(Geometry::new(&Vector3::z(), &-Vector3::z()).is_none());
    }
}
