//! The shifted gamma distribution.

use std::f64::consts::FRAC_1_PI;

use nalgebra::Vector3;

use super::Geometry;
use crate::brdf::{Brdf, Rgb};

/// Microfacets with the shifted gamma distribution, every parameter per channel:
///
/// - `f = (diffuse + specular F D G(theta_i) G(theta_o) / (cos_i cos_o)) / pi`;
/// - `D = kappa exp(-x) / (pi x^p cos_h^4)`, `x = alpha + tan^2(theta_h) / alpha`;
/// - `F = f0 - f1 cos_d + (1 - f0)(1 - cos_d)^5`;
/// - `G(t) = 1 + lambda (1 - exp(c max(0, t - theta0)^k))`, clamped to `[0, 1]`, `t` in radians.
///
/// Source: M. M. Bagher, C. Soler and N. Holzschuch, "Accurate Fitting of Measured Reflectances Using a
/// Shifted Gamma Micro-facet Distribution" (2012), in the form of the parameters published with it.
/// Reciprocal. `F` can be negative; a negative value of `f` is replaced by 0. No parameter bounds the albedo:
/// the published fits follow measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sgd {
    /// Diffuse albedo (`rho_d`).
    pub diffuse: Rgb,
    /// Weight of the lobe (`rho_s`).
    pub specular: Rgb,
    /// Width of the distribution, positive.
    pub alpha: Rgb,
    /// Decay of the distribution's tail.
    pub p: Rgb,
    /// Constant part of the Fresnel term: its value at `cos_d = 0` before the last term is added.
    pub f0: Rgb,
    /// Slope of the Fresnel term in `cos_d`.
    pub f1: Rgb,
    /// Normalisation of the distribution; `1 / (alpha Gamma(1 - p, alpha))` makes its projected area 1.
    pub kappa: Rgb,
    /// Depth of the shadowing.
    pub lambda: Rgb,
    /// Scale of the shadowing's exponent.
    pub c: Rgb,
    /// Power of the shadowing's exponent, positive.
    pub k: Rgb,
    /// Polar angle beyond which there is shadowing, radians.
    pub theta0: Rgb,
}

impl Default for Sgd {
    /// A grey glossy material; `kappa` normalises the distribution (`exp(alpha) / alpha` at `p = 0`).
    fn default() -> Self {
        Self {
            diffuse: [0.2; 3],
            specular: [0.2; 3],
            alpha: [0.1; 3],
            p: [0.0; 3],
            f0: [0.05; 3],
            f1: [0.0; 3],
            kappa: [11.051_709_180_756_477; 3],
            lambda: [3.0; 3],
            c: [1e-7; 3],
            k: [24.0; 3],
            theta0: [-0.3; 3],
        }
    }
}

impl Sgd {
    /// `D` of one channel, with `1 / cos_h^4 = (1 + tan_h^2)^2`.
    fn distribution(&self, channel: usize, geometry: &Geometry) -> f64 {
        let alpha = self.alpha[channel];
        let tan2 = geometry.tan2_h();
        let x = alpha + tan2 / alpha;
        let gamma = self.kappa[channel] * (-x).exp() / x.powf(self.p[channel]);
        FRAC_1_PI * gamma * (1.0 + tan2) * (1.0 + tan2)
    }

    /// `F` of one channel.
    fn fresnel(&self, channel: usize, cos_d: f64) -> f64 {
        let (f0, f1) = (self.f0[channel], self.f1[channel]);
        f0 - f1 * cos_d + (1.0 - f0) * (1.0 - cos_d).powi(5)
    }

    /// `G` of one channel at one polar angle.
    fn shadowing(&self, channel: usize, theta: f64) -> f64 {
        let excess = (theta - self.theta0[channel]).max(0.0).powf(self.k[channel]);
        // exp(700) is finite, and the result is clamped anyway.
        let exponent = (self.c[channel] * excess).min(700.0);
        (1.0 - self.lambda[channel] * exponent.exp_m1()).clamp(0.0, 1.0)
    }
}

/// The polar angle of a direction, radians.
fn polar_angle(w: &Vector3<f64>) -> f64 {
    w.x.hypot(w.y).atan2(w.z)
}

impl Brdf for Sgd {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        let Some(geometry) = Geometry::new(wi, wo) else { return [0.0; 3] };
        let (theta_i, theta_o) = (polar_angle(wi), polar_angle(wo));
        std::array::from_fn(|c| {
            let shadowing = self.shadowing(c, theta_i) * self.shadowing(c, theta_o);
            let lobe = self.fresnel(c, geometry.cos_d) * self.distribution(c, &geometry) * shadowing;
            (FRAC_1_PI * (self.diffuse[c] + self.specular[c] * lobe / geometry.cosine_product())).max(0.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::analytic::AnalyticBrdf;
    use crate::brdf::analytic::checks::{assert_pinned, projected_area};

    #[test]
    fn pinned_values() {
        assert_pinned(
            &Sgd::default(),
            [
                [0.074_286_497_816_549_06, 0.074_286_497_816_549_06, 0.074_286_497_816_549_06],
                [0.187_832_367_297_297_1, 0.187_832_367_297_297_1, 0.187_832_367_297_297_1],
                [0.063_662_074_758_252_27, 0.063_662_074_758_252_27, 0.063_662_074_758_252_27],
                [0.081_157_929_512_316_96, 0.081_157_929_512_316_96, 0.081_157_929_512_316_96],
            ],
        );
    }

    #[test]
    fn distribution_is_normalised_by_kappa() {
        let published = crate::brdf::materials::materials().iter().filter_map(|m| match m.brdf {
            AnalyticBrdf::Sgd(f) => Some(f),
            _ => None,
        });
        for f in std::iter::once(Sgd::default()).chain(published) {
            for c in 0..3 {
                let area = projected_area(|h| f.distribution(c, &Geometry::new(h, h).unwrap()));
                assert!((area - 1.0).abs() < 1e-5, "{c} {area}");
            }
        }
    }

    #[test]
    fn shadowing_is_clamped_and_survives_overflow() {
        let f = Sgd { c: [1e300, 0.0, 1e-7], lambda: [0.0, 3.0, -1.0], theta0: [-5.0; 3], ..Sgd::default() };
        for c in 0..3 {
            assert_eq!(f.shadowing(c, 1.5), 1.0);
        }
        let deep = Sgd { c: [1e300; 3], ..f };
        assert_eq!(deep.shadowing(1, 1.5), 0.0);
        assert_eq!(
            Sgd { f0: [-1.0; 3], f1: [1.0; 3], diffuse: [0.0; 3], ..f }.eval(&Vector3::z(), &Vector3::z()),
            [0.0; 3]
        );
    }
}
