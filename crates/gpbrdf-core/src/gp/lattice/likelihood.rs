//! The log marginal likelihood of a lattice process and its gradient.

use faer::MatRef;

use super::data::{AxisEigen, AxisSlopes, LatticeData};
use super::grams::weighted_grams;
use super::kronecker::apply;
use super::{LatticeHyper, precision};
use crate::base::error::Result;
use crate::kernel::Kernel1d;

/// Log marginal likelihood of a lattice process and its gradient with respect to logarithms of the
/// parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeLikelihood {
    /// Log marginal likelihood, summed over the channels (paper eq. 16).
    pub value: f64,
    /// Derivative with respect to `ln s^2` at fixed noise variance.
    pub d_signal: f64,
    /// Derivative with respect to the logarithm of the noise variance at fixed `s^2`.
    pub d_noise: f64,
    /// Derivatives with respect to the log-parameters of the kernel of each axis.
    pub d_axes: [Vec<f64>; 3],
}

impl LatticeData {
    /// Evaluates the log marginal likelihood and its gradient at the given hyper-parameters.
    ///
    /// With `z = (Q_u (x) Q_v (x) Q_phi)^T y` and `D = 1 / (lambda_u lambda_v lambda_phi + rho)`, each
    /// channel contributes `-1/2 sum z^2 D / s^2 - 1/2 sum ln(s^2 / D) - n/2 ln 2 pi` (paper eq. 16). The
    /// derivative with respect to a log-parameter of axis `u` is `1/2 tr(Q_u H Q_u^T dK_u)` with
    /// `H[a, a'] = sum_bc lambda_b lambda_c (beta_abc beta_a'bc / s^2 - [a = a'] D_abc)` and `beta = z D`
    /// (eq. 17).
    ///
    /// # Errors
    /// Covariances that are not finite.
    pub fn likelihood(&self, hyper: &LatticeHyper) -> Result<LatticeLikelihood> {
        let ratio = hyper.noise_variance / hyper.signal_variance;
        let spectrum = TargetSpectrum::new(self, &hyper.kernels, ratio, true)?;
        Ok(spectrum.likelihood(self, hyper.signal_variance))
    }

    /// Evaluates [`LatticeData::likelihood`] at the signal variance that maximises it for a given
    /// `ratio = noise / s^2`: `s^2 = sum z^2 D / (channels n)`. Returns that signal variance and the
    /// likelihood, whose `d_noise` is the derivative with respect to `ln ratio`.
    ///
    /// # Errors
    /// Covariances that are not finite.
    pub(crate) fn profile_likelihood(
        &self,
        kernels: &[Kernel1d; 3],
        ratio: f64,
    ) -> Result<(f64, LatticeLikelihood)> {
        let spectrum = TargetSpectrum::new(self, kernels, ratio, true)?;
        let signal_variance = (spectrum.sum_z2_d / self.targets.len() as f64).max(f64::MIN_POSITIVE);
        Ok((signal_variance, spectrum.likelihood(self, signal_variance)))
    }
}

/// The covariance and the targets in the eigenbasis.
struct TargetSpectrum {
    eigen: [AxisEigen; 3],
    slopes: AxisSlopes,
    ratio: f64,
    /// Targets in the eigenbasis.
    z: Vec<f64>,
    /// `1 / (lambda_u lambda_v lambda_phi + rho)`.
    d: Vec<f64>,
    sum_z2_d: f64,
}

impl TargetSpectrum {
    fn new(data: &LatticeData, kernels: &[Kernel1d; 3], ratio: f64, derivatives: bool) -> Result<Self> {
        let (eigen, slopes) = data.eigen(kernels, derivatives)?;
        let z = apply(eigen.each_ref().map(|e| e.vectors.transpose()), &data.targets, data.channels);
        let d = precision(&eigen, ratio);
        let sum_z2_d = z.chunks(d.len()).map(|z| z.iter().zip(&d).map(|(z, d)| z * z * d).sum::<f64>()).sum();
        Ok(Self { eigen, slopes, ratio, z, d, sum_z2_d })
    }

    fn likelihood(&self, data: &LatticeData, signal_variance: f64) -> LatticeLikelihood {
        let [a, b, c] = data.shape();
        let (n, channels) = (self.d.len() as f64, data.channels as f64);
        // The logarithm is taken of products of eight factors: an eighth of the logarithms, and no overflow
        // at any sensible scale.
        let log_det: f64 = -self.d.chunks(8).map(|d| d.iter().product::<f64>().ln()).sum::<f64>();
        let value = -0.5 * self.sum_z2_d / signal_variance
            - 0.5 * channels * (n * (signal_variance.ln() + (2.0 * std::f64::consts::PI).ln()) + log_det);
        let mut beta = self.z.clone();
        let mut sum_beta2 = 0.0;
        for tensor in beta.chunks_mut(self.d.len()) {
            for (x, d) in tensor.iter_mut().zip(&self.d) {
                *x *= d;
                sum_beta2 += *x * *x;
            }
        }
        let sum_d: f64 = self.d.iter().sum();
        let d_noise = 0.5 * self.ratio * (sum_beta2 / signal_variance - channels * sum_d);
        let d_scale = 0.5 * (self.sum_z2_d / signal_variance - channels * n);
        let [lu, lv, lp] = self.eigen.each_ref().map(|e| e.values.as_slice());
        // The traces are sums of D weighted by the eigenvalues of the other two axes.
        let mut traces = [vec![0.0; a], vec![0.0; b], vec![0.0; c]];
        for (i, plane) in self.d.chunks(b * c).enumerate() {
            for (j, row) in plane.chunks(c).enumerate() {
                let mut along_phi = 0.0;
                let uv = lu[i] * lv[j];
                for ((d, &phi), trace) in row.iter().zip(lp).zip(&mut traces[2]) {
                    along_phi += d * phi;
                    *trace += d * uv;
                }
                traces[0][i] += along_phi * lv[j];
                traces[1][j] += along_phi * lu[i];
            }
        }
        let roots: [Vec<f64>; 3] = [lu, lv, lp].map(|l| l.iter().map(|x| x.sqrt()).collect());
        let grams = weighted_grams([&roots[0], &roots[1], &roots[2]], &beta, data.channels);
        let d_axes = std::array::from_fn(|k| {
            let mut h = faer::Scale(0.5 / signal_variance) * &grams[k];
            for (i, trace) in traces[k].iter().enumerate() {
                h[(i, i)] -= 0.5 * channels * trace;
            }
            let q = &self.eigen[k].vectors;
            let w = q * h * q.transpose();
            self.slopes[k].iter().map(|slope| inner_product(w.as_ref(), slope.as_ref())).collect()
        });
        LatticeLikelihood { value, d_signal: d_scale - d_noise, d_noise, d_axes }
    }
}

/// `sum_ij x_ij y_ij`.
fn inner_product(x: MatRef<'_, f64>, y: MatRef<'_, f64>) -> f64 {
    x.col_iter().zip(y.col_iter()).map(|(x, y)| x.iter().zip(y.iter()).map(|(x, y)| x * y).sum::<f64>()).sum()
}
