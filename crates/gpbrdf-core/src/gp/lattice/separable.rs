//! A lattice process as a sum of products of well-scaled functions of one coordinate each.

use rayon::prelude::*;

use crate::base::error::Result;
use crate::base::linalg::{Matrix, product_into_slice, view};
use crate::gp::lattice::{LatticeGp, Spectrum};

/// An eigenvector whose eigenvalue is below this share of the largest one consists of rounding errors only.
const SMALLEST_SHARE: f64 = 1e-15;

/// The number of points of a parallel task.
const POINTS: usize = 256;

/// A lattice process in the form that single precision can evaluate:
/// `mean(x) = sum_ijk coefficients_ijk a_i(x_0) b_j(x_1) c_k(x_2)`.
///
/// The usual form `k(x, X) w` suffers from cancellation: the weights `w` are larger than the mean by up to
/// the ratio of signal to noise. With the eigendecomposition `K = Q L Q^T` of the covariance along each axis,
/// `a(x) = L^(-1/2) Q^T k(X, x)` is never longer than the prior standard deviation, and the coefficients
/// `L^(1/2) Q^T w` are about as large as the targets.
///
/// The variance is a sum of positive terms in the same functions:
/// `s^2 (r_0 p_1 p_2 + s_0 r_1 p_2 + s_0 s_1 r_2 + sum_ijk unexplained_ijk a_i^2 b_j^2 c_k^2)`, where along
/// each axis `p` is the prior variance, `s = sum_i a_i^2` is the part of it that noise-free nodes explain,
/// and `r = p - s`.
#[derive(Clone, Debug)]
pub struct SeparableForm<'a> {
    gp: &'a LatticeGp,
    coefficients: Vec<f64>,
    unexplained: Vec<f64>,
    /// `Q L^(-1/2)` of each axis.
    whitening: [Matrix; 3],
}

/// The functions of one axis at some points.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisBasis {
    /// Values of the functions, `[point][function]`.
    pub values: Vec<f64>,
    /// Prior variance at each point, without the signal variance.
    pub prior: Vec<f64>,
    /// Variance given noise-free nodes, `prior - sum values^2`, at least 0.
    pub residual: Vec<f64>,
}

impl<'a> SeparableForm<'a> {
    /// Computes the separable form of a process. Costs `O(n)` for each channel, and `O(n (A + B + C))` the first time
    /// for a process that was loaded from a file.
    ///
    /// # Errors
    /// Those of [`LatticeGp::predict_variance_latent`].
    pub fn new(gp: &'a LatticeGp) -> Result<Self> {
        let Spectrum { eigen, precision } = gp.spectrum()?;
        let roots = eigen.each_ref().map(|eigen| {
            let largest = eigen.values.iter().copied().fold(0.0, f64::max);
            let root = |x: &f64| if *x > SMALLEST_SHARE * largest { x.sqrt() } else { 0.0 };
            eigen.values.iter().map(root).collect::<Vec<f64>>()
        });
        let whitening = std::array::from_fn(|k| {
            let (n, vectors) = (roots[k].len(), &eigen[k].vectors);
            let factors: Vec<f64> =
                roots[k].iter().map(|root| if *root > 0.0 { root.recip() } else { 0.0 }).collect();
            Matrix::from_fn(n, n, |i, j| vectors[(i, j)] * factors[j])
        });
        let mut coefficients = gp.spectral_weights()?.to_vec();
        let [a, b, c] = gp.data().shape();
        let products: Vec<f64> =
            (0..a * b * c).map(|n| roots[0][n / (b * c)] * roots[1][n / c % b] * roots[2][n % c]).collect();
        for tensor in coefficients.chunks_mut(a * b * c) {
            tensor.iter_mut().zip(&products).for_each(|(x, root)| *x *= root);
        }
        let noise = gp.hyper().noise_variance / gp.hyper().signal_variance;
        let unexplained = precision.iter().map(|d| noise * d).collect();
        Ok(Self { gp, coefficients, unexplained, whitening })
    }

    /// Number of functions along each axis.
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        self.gp.data().shape()
    }

    /// The coefficients, `[channel][i][j][k]`, last index fastest.
    #[must_use]
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// For each product of functions, the share of its variance that the noise leaves unexplained:
    /// `[i][j][k]`, in `[0, 1]`.
    #[must_use]
    pub fn unexplained(&self) -> &[f64] {
        &self.unexplained
    }

    /// Evaluates the functions of axis `k` at `points`, given by their kernel coordinates.
    #[must_use]
    pub fn basis(&self, k: usize, points: &[f64]) -> AxisBasis {
        let count = self.shape()[k];
        let mut values = vec![0.0; count * points.len()];
        values.par_chunks_mut(count * POINTS).zip(points.par_chunks(POINTS)).for_each(|(values, points)| {
            // The values of one point are a column of this.
            let cross = self.gp.cross(k, points);
            product_into_slice(values, view(&self.whitening[k]).transpose(), view(&cross).transpose());
        });
        let prior = self.gp.axis_variances(k, points);
        let explained = values.chunks(count).map(|row| row.iter().map(|x| x * x).sum::<f64>());
        let residual = prior.iter().zip(explained).map(|(p, s)| (p - s).max(0.0)).collect();
        AxisBasis { values, prior, residual }
    }
}

#[cfg(all(test, feature = "fit", feature = "formats"))]
mod tests {
    use super::*;
    use crate::formats::source::Source;
    use crate::gp::DeviceForm;
    use crate::kernel::Shape;
    use crate::model::{FitOptions, fit};
    use crate::sample::{LatticeLayout, Layout, Symmetry};

    #[test]
    fn sums_of_products_are_the_mean_and_variance_of_the_process() {
        let shapes = [Shape::SquaredExponential, Shape::Matern12, Shape::RationalQuadratic { alpha: 1.0 }];
        for (shape, symmetry) in
            shapes.into_iter().zip([Symmetry::Bilateral, Symmetry::Reciprocal, Symmetry::Bilateral])
        {
            let source = Source::built_in("cherry-235").unwrap();
            let layout = LatticeLayout { shape: [9, 7, 6], symmetry, ..LatticeLayout::default() };
            let samples = source.measure(&Layout::Lattice(layout)).unwrap();
            let options = FitOptions::default().with_kernel(&[shape]);
            let model = fit(&samples, &options).unwrap().model;
            let posterior = model.posteriors().next().unwrap().1;
            let DeviceForm::Separable(parts) = posterior.device_form() else { panic!("{model:?}") };
            let gp = parts[0].gp;
            let form = SeparableForm::new(gp).unwrap();
            let points: Vec<[f64; 3]> =
                (0..40).map(|i| [0.61, 0.37, 0.53].map(|g| (f64::from(i) * g).fract())).collect();
            let (means, variances) = (gp.predict_mean(&points), gp.predict_variance_latent(&points).unwrap());
            let [a, b, c] = form.shape();
            let scale = form.coefficients().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            for (n, point) in points.iter().enumerate() {
                let at: Vec<AxisBasis> = (0..3).map(|k| form.basis(k, &[point[k]])).collect();
                let (mut mean, mut variance) = ([0.0; 3], 0.0);
                for i in 0..a * b * c {
                    let value = at[0].values[i / (b * c)] * at[1].values[i / c % b] * at[2].values[i % c];
                    (0..3).for_each(|ch| mean[ch] += value * form.coefficients()[ch * a * b * c + i]);
                    variance += value * value * form.unexplained()[i];
                }
                let [p, r] = [|k: &AxisBasis| k.prior[0], |k: &AxisBasis| k.residual[0]];
                let s = |k: &AxisBasis| p(k) - r(k);
                variance += r(&at[0]) * p(&at[1]) * p(&at[2])
                    + s(&at[0]) * r(&at[1]) * p(&at[2])
                    + s(&at[0]) * s(&at[1]) * r(&at[2]);
                variance *= gp.hyper().signal_variance;
                for ch in 0..3 {
                    let expected = means[n * 3 + ch];
                    assert!(
                        (mean[ch] - expected).abs() < 1e-9 * (1.0 + expected.abs()),
                        "{mean:?} {expected}"
                    );
                }
                assert!(
                    (variance - variances[n]).abs()
                        < 1e-6 * variances[n] + 1e-12 * gp.hyper().signal_variance,
                    "{shape:?} {variance:e} {:e}",
                    variances[n]
                );
            }
            // No coefficient is far larger than the means that the terms add up to.
            let largest = means.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            assert!(scale < 200.0 * largest, "{scale} {largest}");
        }
    }
}
