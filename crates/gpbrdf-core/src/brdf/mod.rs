//! Reflectance: the trait [`Brdf`], angles, tables, analytic models and the built-in materials.

pub mod analytic;
pub(crate) mod angles;
pub(crate) mod materials;
pub(crate) mod sigma;
pub(crate) mod table;

pub use angles::{BoxPoint, GRAZING_COSINE, HORIZON_COSINE, HalfDiff, direction, fold_phi_d, theta_d_max};
pub use materials::{BuiltInMaterial, material, materials};
pub use sigma::SigmaTable;
pub use table::{
    BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H, SLAB, Trilinear, cell_center, cell_index,
    cell_indices, mirrored_column,
};

use nalgebra::Vector3;

/// A linear sRGB triple. For a BRDF its unit is sr^-1.
pub type Rgb = [f64; 3];

/// Weights of red, green and blue in the luminance of linear sRGB (ITU-R BT.709).
pub const LUMINANCE_WEIGHTS: Rgb = [0.2126, 0.7152, 0.0722];

/// A bidirectional reflectance distribution function with three colour channels. Tables, samples and models
/// take it to be isotropic.
pub trait Brdf: Send + Sync {
    /// `f(wi, wo)` in sr^-1, without the cosine. Both are unit directions away from the surface, in the local
    /// frame (normal +z). Zero in every channel when either direction is at or below the horizon.
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb;

    /// The BRDF as it was measured, where this one is made reciprocal from it; `None` otherwise.
    fn as_measured(&self) -> Option<&dyn Brdf> {
        None
    }

    /// `f` at half-difference angles; by default evaluated with the half vector above the x axis.
    fn eval_half_diff(&self, angles: HalfDiff) -> Rgb {
        let (wi, wo) = angles.to_directions();
        self.eval(&wi, &wo)
    }

    /// `f` at many half-difference angles, one value in `out` for each. Tables and samples are filled by this
    /// method, so that a model can evaluate whole blocks of directions without an allocation per direction.
    fn eval_many(&self, angles: &[HalfDiff], out: &mut [Rgb]) {
        for (angles, out) in angles.iter().zip(out) {
            *out = self.eval_half_diff(*angles);
        }
    }
}

/// A BRDF made reciprocal and extended to the horizon: `(f(a, b) + f(b, a)) / 2`, where `a` and `b` are `wi`
/// and `wo` lifted to a cosine of at least `min_cosine`.
///
/// Measurements obey Helmholtz reciprocity only up to noise and are unreliable at grazing angles. Where an
/// RGL measurement or an analytic model is the truth for fits and metrics, it is wrapped in this type.
/// Directions below the horizon are lifted, too: unlike other BRDFs, this one is not zero there.
#[derive(Clone, Debug)]
pub struct Reciprocal<B> {
    /// The wrapped BRDF.
    pub inner: B,
    /// The smallest cosine at which `inner` is evaluated.
    pub min_cosine: f64,
}

impl<B: Brdf> Brdf for Reciprocal<B> {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        let a = lift(wi, self.min_cosine);
        let b = lift(wo, self.min_cosine);
        let forward = self.inner.eval(&a, &b);
        let backward = self.inner.eval(&b, &a);
        std::array::from_fn(|c| 0.5 * (forward[c] + backward[c]))
    }

    fn as_measured(&self) -> Option<&dyn Brdf> {
        Some(&self.inner)
    }
}

/// The unit direction with the azimuth of `w` and a cosine of at least `min_cosine`.
fn lift(w: &Vector3<f64>, min_cosine: f64) -> Vector3<f64> {
    if w.z >= min_cosine {
        return *w;
    }
    let horizontal = w.x.hypot(w.y);
    if horizontal == 0.0 {
        return Vector3::z();
    }
    let scale = (1.0 - min_cosine * min_cosine).sqrt() / horizontal;
    Vector3::new(w.x * scale, w.y * scale, min_cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Skewed;

    impl Brdf for Skewed {
        fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
            [wi.z, 2.0 * wo.z, 1.0]
        }
    }

    #[test]
    fn reciprocal_is_symmetric_and_lifts_grazing_directions() {
        let f = Reciprocal { inner: Skewed, min_cosine: 0.02 };
        let a = Vector3::new(0.6, 0.0, 0.8);
        let b = Vector3::new(0.0, 1.0, 0.0);
        assert_eq!(f.eval(&a, &b), f.eval(&b, &a));
        assert!((f.eval(&a, &b)[0] - 0.5 * (0.8 + 0.02)).abs() < 1e-15);
        assert!((lift(&Vector3::new(0.6, -0.8, -1e-9), 0.02).norm() - 1.0).abs() < 1e-15);
    }
}
