//! The exact Gaussian process on a product lattice.
//!
//! A product kernel `s^2 k_u k_v k_phi` on `A x B x C` nodes has the covariance
//! `s^2 K_u (x) K_v (x) K_phi`. With `K_x = Q_x diag(lambda_x) Q_x^T` and `rho = noise / s^2`, everything that
//! the dense process needs a factorisation of an `n x n` matrix for (`n = A B C`) becomes contractions with
//! three small matrices, `O(n (A + B + C))` each; see Y. Saatci, "Scalable Inference for Structured Gaussian
//! Process Models" (2011), chapter 5.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::{Mat, MatRef, Par};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::gp::kronecker::{apply, weighted_grams};
use crate::kernel::{AxisMetric, Kernel1d};

/// Coordinates and targets on a lattice: what a lattice process is fitted to.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeData {
    /// Kernel coordinates of the nodes along each axis.
    pub coordinates: [Vec<f64>; 3],
    /// How distance is measured along each axis.
    pub metrics: [AxisMetric; 3],
    /// Whether functions of each axis are even: the kernel is then `k(x, y) + k(x, -y)`. With the chord metric they
    /// are even about `pi/2` too, and the process is that of the whole circle given mirrored targets.
    pub mirrored: [bool; 3],
    /// `[channel][A][B][C]`, last axis fastest; zero mean.
    pub targets: Vec<f64>,
    /// Number of channels; they share hyper-parameters.
    pub channels: usize,
}

/// Hyper-parameters of a lattice process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LatticeHyper {
    /// `s^2`, in squared target units.
    pub signal_variance: f64,
    /// Noise variance, in squared target units.
    pub noise_variance: f64,
    /// The kernel of each axis.
    pub kernels: [Kernel1d; 3],
}

/// Log marginal likelihood of a lattice process and its gradient in log-parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeLikelihood {
    /// Summed over channels (paper eq. 16).
    pub value: f64,
    /// With respect to `ln s^2` at fixed noise variance.
    pub d_signal: f64,
    /// With respect to the logarithm of the noise variance at fixed `s^2`.
    pub d_noise: f64,
    /// With respect to the log-parameters of each axis's kernel.
    pub d_axes: [Vec<f64>; 3],
}

/// Eigendecomposition of one axis's covariance.
#[derive(Clone, Debug)]
pub(crate) struct AxisEigen {
    pub(crate) vectors: Mat<f64>,
    pub(crate) values: Vec<f64>,
}

/// For each axis the derivatives of its covariance in the log-parameters of its kernel.
type AxisSlopes = [Vec<Mat<f64>>; 3];

impl AxisEigen {
    fn new(gram: &Mat<f64>) -> Result<Self> {
        let n = gram.nrows();
        let mut vectors = Mat::zeros(n, n);
        let mut values = faer::diag::Diag::zeros(n);
        let scratch =
            self_adjoint_evd_scratch::<f64>(n, ComputeEigenvectors::Yes, Par::Seq, Default::default());
        self_adjoint_evd(
            gram.as_ref(),
            values.as_mut(),
            Some(vectors.as_mut()),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        )
        .map_err(|_| Error::argument("covariance of an axis", "finite entries", "no eigendecomposition"))?;
        // Rounding leaves the smallest eigenvalues of smooth kernels slightly negative.
        let values = values.column_vector().iter().map(|x| x.max(0.0)).collect();
        Ok(Self { vectors, values })
    }
}

impl LatticeData {
    /// Nodes along each axis.
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        [self.coordinates[0].len(), self.coordinates[1].len(), self.coordinates[2].len()]
    }

    /// Number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shape().iter().product()
    }

    /// Whether there is no node.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Checks sizes and finiteness.
    ///
    /// # Errors
    /// An empty axis, a number of targets other than `channels A B C`, a coordinate or target that is not finite.
    pub fn validate(&self) -> Result<()> {
        if self.is_empty() || self.targets.len() != self.channels * self.len() || self.channels == 0 {
            let expected = format!("{} channels x {} nodes, at least one of each", self.channels, self.len());
            return Err(Error::argument("lattice targets", expected, self.targets.len()));
        }
        if let Some(bad) =
            self.targets.iter().chain(self.coordinates.iter().flatten()).find(|x| !x.is_finite())
        {
            return Err(Error::argument("lattice targets and coordinates", "finite numbers", bad));
        }
        Ok(())
    }

    /// Every second node along each axis: an eighth of the work for a first guess at the hyper-parameters.
    #[must_use]
    pub(crate) fn decimated(&self) -> Self {
        let [_, b, c] = self.shape();
        let coordinates =
            self.coordinates.each_ref().map(|x| x.iter().copied().step_by(2).collect::<Vec<_>>());
        let mut targets = Vec::with_capacity(self.targets.len() / 8 + 1);
        for tensor in self.targets.chunks(self.len()) {
            for plane in tensor.chunks(b * c).step_by(2) {
                for row in plane.chunks(c).step_by(2) {
                    targets.extend(row.iter().step_by(2));
                }
            }
        }
        Self { coordinates, metrics: self.metrics, mirrored: self.mirrored, targets, channels: self.channels }
    }

    /// The mirror image of a coordinate of axis `k`, where there is one.
    fn image(&self, k: usize, x: f64) -> Option<f64> {
        self.mirrored[k].then_some(-x)
    }

    /// `k(x, x)` of axis `k`.
    fn axis_variance(&self, k: usize, kernel: &Kernel1d, x: f64) -> f64 {
        let image = self.image(k, x).map(|image| kernel.value(self.metrics[k].distance(x, image)));
        kernel.value(0.0) + image.unwrap_or(0.0)
    }

    /// The covariance of axis `k` and its derivatives in the kernel's log-parameters.
    fn gram(&self, k: usize, kernel: &Kernel1d, derivatives: bool) -> (Mat<f64>, Vec<Mat<f64>>) {
        let (x, metric) = (&self.coordinates[k], self.metrics[k]);
        let n = x.len();
        let count = if derivatives { kernel.n_parameters() } else { 0 };
        let mut gram = Mat::zeros(n, n);
        let mut slopes = vec![Mat::zeros(n, n); count];
        let mut row = vec![0.0; count];
        for j in 0..n {
            for i in j..n {
                row.fill(0.0);
                let mut value = 0.0;
                for other in std::iter::once(x[j]).chain(self.image(k, x[j])) {
                    let distance = metric.distance(x[i], other);
                    value += if derivatives {
                        kernel.add_gradient(distance, 1.0, &mut row)
                    } else {
                        kernel.value(distance)
                    };
                }
                gram[(i, j)] = value;
                gram[(j, i)] = value;
                for (slope, &d) in slopes.iter_mut().zip(&row) {
                    slope[(i, j)] = d;
                    slope[(j, i)] = d;
                }
            }
        }
        (gram, slopes)
    }

    /// Eigendecompositions of the three axes, and the derivatives of their covariances.
    fn eigen(&self, kernels: &[Kernel1d; 3], derivatives: bool) -> Result<([AxisEigen; 3], AxisSlopes)> {
        let axis = |k: usize| -> Result<_> {
            let (gram, slopes) = self.gram(k, &kernels[k], derivatives);
            Ok((AxisEigen::new(&gram)?, slopes))
        };
        let (u, (v, phi)) = rayon::join(|| axis(0), || rayon::join(|| axis(1), || axis(2)));
        let ((u, du), (v, dv), (phi, dphi)) = (u?, v?, phi?);
        Ok(([u, v, phi], [du, dv, dphi]))
    }

    /// Log marginal likelihood at given hyper-parameters and its gradient.
    ///
    /// With `z = (Q_u (x) Q_v (x) Q_phi)^T y` and `D = 1 / (lambda_u lambda_v lambda_phi + rho)`:
    /// `-1/2 sum z^2 D / s^2 - 1/2 sum ln(s^2 / D) - n/2 ln 2 pi` a channel (paper eq. 16). The derivative in a
    /// parameter of axis `u` is `1/2 tr(Q_u H Q_u^T dK_u)` with
    /// `H[a, a'] = sum_bc lambda_b lambda_c (beta_abc beta_a'bc / s^2 - [a = a'] D_abc)`, `beta = z D` (eq. 17).
    ///
    /// # Errors
    /// Covariances that are not finite.
    pub fn likelihood(&self, hyper: &LatticeHyper) -> Result<LatticeLikelihood> {
        let ratio = hyper.noise_variance / hyper.signal_variance;
        let spectrum = Spectrum::new(self, &hyper.kernels, ratio, true)?;
        Ok(spectrum.likelihood(self, hyper.signal_variance))
    }

    /// [`LatticeData::likelihood`] at the signal variance that maximises it for a given
    /// `ratio = noise / s^2`: `s^2 = sum z^2 D / (channels n)`. The gradient in `ln ratio` is `d_noise`.
    ///
    /// # Errors
    /// Covariances that are not finite.
    pub(crate) fn profile_likelihood(
        &self,
        kernels: &[Kernel1d; 3],
        ratio: f64,
    ) -> Result<(f64, LatticeLikelihood)> {
        let spectrum = Spectrum::new(self, kernels, ratio, true)?;
        let signal_variance = (spectrum.sum_z2_d / self.targets.len() as f64).max(f64::MIN_POSITIVE);
        Ok((signal_variance, spectrum.likelihood(self, signal_variance)))
    }
}

/// Targets and noise in the eigenbasis.
struct Spectrum {
    eigen: [AxisEigen; 3],
    slopes: AxisSlopes,
    ratio: f64,
    /// Targets in the eigenbasis.
    z: Vec<f64>,
    /// `1 / (lambda_u lambda_v lambda_phi + rho)`.
    d: Vec<f64>,
    sum_z2_d: f64,
}

impl Spectrum {
    fn new(data: &LatticeData, kernels: &[Kernel1d; 3], ratio: f64, derivatives: bool) -> Result<Self> {
        let (eigen, slopes) = data.eigen(kernels, derivatives)?;
        let z = apply(eigen.each_ref().map(|e| e.vectors.transpose()), &data.targets, data.channels);
        let mut d = Vec::with_capacity(data.len());
        for &u in &eigen[0].values {
            for &v in &eigen[1].values {
                d.extend(eigen[2].values.iter().map(|&phi| 1.0 / (u * v * phi + ratio)));
            }
        }
        let sum_z2_d = z.chunks(d.len()).map(|z| z.iter().zip(&d).map(|(z, d)| z * z * d).sum::<f64>()).sum();
        Ok(Self { eigen, slopes, ratio, z, d, sum_z2_d })
    }

    fn likelihood(&self, data: &LatticeData, signal_variance: f64) -> LatticeLikelihood {
        let [a, b, c] = data.shape();
        let (n, channels) = (self.d.len() as f64, data.channels as f64);
        // ln of products of eight: an eighth of the logarithms, and no overflow at any sensible scale.
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
        // Traces: sums of D weighted by the eigenvalues of the other two axes.
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

/// A lattice process conditioned on its targets.
#[derive(Clone, Debug)]
pub struct LatticeGp {
    data: LatticeData,
    hyper: LatticeHyper,
    /// `(K + rho I)^-1 y`, laid out like the targets.
    weights: Vec<f64>,
    pub(crate) eigen: [AxisEigen; 3],
    /// `1 / (lambda_u lambda_v lambda_phi + rho)`, laid out like one channel.
    pub(crate) precision: Vec<f64>,
}

impl LatticeGp {
    /// Conditions the process on `data` (paper eqs. 12 and 13). `O(n (A + B + C))` time a channel.
    ///
    /// # Errors
    /// Data of the wrong size or not finite, hyper-parameters out of range.
    pub fn new(data: LatticeData, hyper: LatticeHyper) -> Result<Self> {
        data.validate()?;
        hyper.validate()?;
        let ratio = hyper.noise_variance / hyper.signal_variance;
        let Spectrum { eigen, mut z, d, .. } = Spectrum::new(&data, &hyper.kernels, ratio, false)?;
        for tensor in z.chunks_mut(d.len()) {
            tensor.iter_mut().zip(&d).for_each(|(z, d)| *z *= d);
        }
        let weights = apply(eigen.each_ref().map(|e| e.vectors.as_ref()), &z, data.channels);
        Ok(Self { data, hyper, weights, eigen, precision: d })
    }

    /// A process whose weights are known already, from a file: predictions of the mean use them as they are.
    ///
    /// # Errors
    /// As [`LatticeGp::new`], and weights of the wrong number.
    pub(crate) fn from_weights(data: LatticeData, hyper: LatticeHyper, weights: Vec<f64>) -> Result<Self> {
        let gp = Self::new(data, hyper)?;
        if weights.len() != gp.weights.len() {
            return Err(Error::argument("lattice weights", gp.weights.len().to_string(), weights.len()));
        }
        Ok(Self { weights, ..gp })
    }

    /// Coordinates and targets.
    #[must_use]
    pub fn data(&self) -> &LatticeData {
        &self.data
    }

    /// Hyper-parameters.
    #[must_use]
    pub fn hyper(&self) -> &LatticeHyper {
        &self.hyper
    }

    /// `(K + rho I)^-1 y`, laid out like the targets: the predictive mean is `k(x, X) . weights`.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Kernel values between `points` (coordinates along axis `k`) and the nodes: `points x nodes`, stored
    /// column by column.
    #[must_use]
    pub(crate) fn cross(&self, k: usize, points: &[f64]) -> Mat<f64> {
        let mut out = Mat::zeros(points.len(), self.data.coordinates[k].len());
        let (kernel, metric) = (&self.hyper.kernels[k], self.data.metrics[k]);
        let (mut sums, mut values) = (vec![0.0; points.len()], vec![0.0; points.len()]);
        for (column, &node) in out.col_iter_mut().zip(&self.data.coordinates[k]) {
            sums.fill(0.0);
            for other in std::iter::once(node).chain(self.data.image(k, node)) {
                values.iter_mut().zip(points).for_each(|(d, &x)| *d = metric.distance(x, other).powi(2));
                kernel.fill(&mut values);
                sums.iter_mut().zip(&values).for_each(|(sum, value)| *sum += value);
            }
            column.iter_mut().zip(&sums).for_each(|(out, sum)| *out = *sum);
        }
        out
    }

    /// Predictive mean (paper eq. 12) at points given by their three kernel coordinates:
    /// `[point][channel]`. `O(n)` a point, in parallel.
    #[must_use]
    pub fn predict_mean(&self, points: &[[f64; 3]]) -> Vec<f64> {
        let channels = self.data.channels;
        let [a, b, c] = self.data.shape();
        points
            .par_chunks(64)
            .flat_map_iter(|points| {
                let [ku, kv, kp] = self.cross_rows(points);
                // All points and channels: contract u by one product.
                let mut out = Vec::with_capacity(points.len() * channels);
                let mut contracted = Mat::zeros(b * c, points.len());
                let mut sums = vec![0.0; points.len() * channels];
                for (ch, weights) in self.weights.chunks(a * b * c).enumerate() {
                    let weights = MatRef::from_column_major_slice(weights, b * c, a);
                    faer::linalg::matmul::matmul(
                        contracted.as_mut(),
                        faer::Accum::Replace,
                        weights,
                        ku.transpose(),
                        1.0,
                        Par::Seq,
                    );
                    for p in 0..points.len() {
                        let mut sum = 0.0;
                        for j in 0..b {
                            let mut row = 0.0;
                            for k in 0..c {
                                row += contracted[(j * c + k, p)] * kp[(p, k)];
                            }
                            sum += row * kv[(p, j)];
                        }
                        sums[p * channels + ch] = sum;
                    }
                }
                out.append(&mut sums);
                out
            })
            .collect()
    }

    /// Latent predictive variance (paper eq. 13) at points given by their three kernel coordinates, the same for
    /// every channel: `s^2 (k(x, x) - sum D (k Q)^2)`. `O(n)` a point, in parallel. Add the noise variance for
    /// that of a new observation.
    #[must_use]
    pub fn predict_variance_latent(&self, points: &[[f64; 3]]) -> Vec<f64> {
        let [a, b, c] = self.data.shape();
        points
            .par_chunks(64)
            .flat_map_iter(|points| {
                let crosses = self.cross_rows(points);
                let [mut su, mut sv, mut sp]: [Mat<f64>; 3] =
                    std::array::from_fn(|k| &crosses[k] * &self.eigen[k].vectors);
                for m in [&mut su, &mut sv, &mut sp] {
                    square(m);
                }
                let precision = MatRef::from_column_major_slice(&self.precision, b * c, a);
                let contracted = precision * su.transpose();
                (0..points.len())
                    .map(|p| {
                        let mut explained = 0.0;
                        for j in 0..b {
                            let row: f64 = (0..c).map(|k| contracted[(j * c + k, p)] * sp[(p, k)]).sum();
                            explained += row * sv[(p, j)];
                        }
                        (self.hyper.signal_variance * (self.prior_variance(points[p]) - explained)).max(0.0)
                    })
                    .collect::<Vec<_>>()
            })
            .collect()
    }

    /// `k(x, x)` without the signal variance, at kernel coordinates `x`.
    #[must_use]
    pub(crate) fn prior_variance(&self, x: [f64; 3]) -> f64 {
        (0..3).map(|k| self.axis_variance(k, x[k])).product()
    }

    /// `k(x, x)` of axis `k` at its coordinate `x`.
    pub(crate) fn axis_variance(&self, k: usize, x: f64) -> f64 {
        self.data.axis_variance(k, &self.hyper.kernels[k], x)
    }

    fn cross_rows(&self, points: &[[f64; 3]]) -> [Mat<f64>; 3] {
        std::array::from_fn(|k| self.cross(k, &points.iter().map(|p| p[k]).collect::<Vec<_>>()))
    }

    /// Leave-one-out residuals `y_i - mean_-i(x_i)`, laid out like the targets
    /// (Rasmussen and Williams 2006, eq. 5.12): `w_i / [(K + rho I)^-1]_ii`. `O(n (A + B + C))`.
    #[must_use]
    pub fn leave_one_out_residuals(&self) -> Vec<f64> {
        let squares = self.eigen.each_ref().map(|e| {
            let mut m = e.vectors.clone();
            square(&mut m);
            m
        });
        let diagonal = apply(squares.each_ref().map(Mat::as_ref), &self.precision, 1);
        let per_channel = self.weights.chunks(diagonal.len());
        per_channel.flat_map(|w| w.iter().zip(&diagonal).map(|(w, d)| w / d)).collect()
    }
}

/// Squares every entry.
pub(crate) fn square(m: &mut Mat<f64>) {
    for column in m.col_iter_mut() {
        for x in column.iter_mut() {
            *x *= *x;
        }
    }
}

impl LatticeHyper {
    /// Checks every value.
    ///
    /// # Errors
    /// A variance that is not positive and finite, or a broken kernel.
    pub fn validate(&self) -> Result<()> {
        for (what, value) in
            [("signal variance", self.signal_variance), ("noise variance", self.noise_variance)]
        {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::argument(what, "a positive number", value));
            }
        }
        self.kernels.iter().try_for_each(Kernel1d::validate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gp::optimize::SplitMix64;
    use crate::kernel::{Shape, Term1d};
    use nalgebra::{DMatrix, DVector};

    /// The kinds of third axis: metric, and whether it is mirrored.
    const AXES: [(AxisMetric, bool); 3] =
        [(AxisMetric::Linear, false), (AxisMetric::Chord, false), (AxisMetric::Chord, true)];

    /// Every closed and general shape in some axis, and sums.
    fn cases() -> Vec<LatticeHyper> {
        let single = Kernel1d::new;
        let sum = Kernel1d {
            terms: vec![
                Term1d { weight: 1.0, shape: Shape::Matern52, length_scale: 0.9 },
                Term1d { weight: 0.4, shape: Shape::RationalQuadratic { alpha: 1.1 }, length_scale: 0.3 },
            ],
        };
        let axes = [
            [single(Shape::Matern52, 0.6), single(Shape::Matern52, 0.8), single(Shape::Matern52, 0.7)],
            [
                single(Shape::SquaredExponential, 0.3),
                single(Shape::Matern12, 0.8),
                single(Shape::Matern32, 0.7),
            ],
            [sum.clone(), single(Shape::RationalQuadratic { alpha: 0.6 }, 0.5), sum],
            [
                single(Shape::Matern { nu: 1.3 }, 0.5),
                single(Shape::Matern32, 1.0),
                single(Shape::Matern12, 0.4),
            ],
        ];
        axes.map(|kernels| LatticeHyper { signal_variance: 1.7, noise_variance: 0.01, kernels }).into()
    }

    fn data((metric, mirrored): (AxisMetric, bool)) -> LatticeData {
        let mut random = SplitMix64(5);
        let mut axis = |n: usize, extent: f64| -> Vec<f64> {
            (0..n).map(|i| extent * (i as f64 + 0.6 * random.next_unit()) / n as f64).collect()
        };
        let coordinates = [axis(5, 1.0), axis(4, 1.0), axis(3, 3.0)];
        let channels = 2;
        let targets = (0..channels * 60).map(|_| 2.0 * random.next_unit() - 1.0).collect();
        LatticeData {
            coordinates,
            metrics: [AxisMetric::Linear, AxisMetric::Linear, metric],
            mirrored: [false, false, mirrored],
            targets,
            channels,
        }
    }

    fn points(data: &LatticeData) -> Vec<[f64; 3]> {
        let [u, v, phi] = &data.coordinates;
        let grid = |&u: &f64| v.iter().flat_map(move |&v| phi.iter().map(move |&phi| [u, v, phi]));
        u.iter().flat_map(grid).collect()
    }

    /// The textbook dense process, by nalgebra.
    struct Oracle {
        inverse: DMatrix<f64>,
        log_det: f64,
    }

    fn kernel(data: &LatticeData, hyper: &LatticeHyper, a: &[f64; 3], b: &[f64; 3]) -> f64 {
        let one = |k: usize, b: f64| hyper.kernels[k].value(data.metrics[k].distance(a[k], b));
        let factor = |k: usize| one(k, b[k]) + if data.mirrored[k] { one(k, -b[k]) } else { 0.0 };
        hyper.signal_variance * factor(0) * factor(1) * factor(2)
    }

    fn oracle(data: &LatticeData, hyper: &LatticeHyper) -> Oracle {
        let x = points(data);
        let mut k = DMatrix::from_fn(x.len(), x.len(), |i, j| kernel(data, hyper, &x[i], &x[j]));
        k += DMatrix::identity(x.len(), x.len()) * hyper.noise_variance;
        let cholesky = k.cholesky().unwrap();
        let log_det = 2.0 * cholesky.l().diagonal().map(f64::ln).sum();
        Oracle { inverse: cholesky.inverse(), log_det }
    }

    #[test]
    fn agrees_with_the_dense_process_written_out() {
        for axis in AXES {
            let data = data(axis);
            let n = data.len();
            let x = points(&data);
            for hyper in cases() {
                let oracle = oracle(&data, &hyper);
                let gp = LatticeGp::new(data.clone(), hyper.clone()).unwrap();
                let mut lml = 0.0;
                let queries: Vec<[f64; 3]> = (0..40)
                    .map(|i| [0.02 * f64::from(i), 0.7 - 0.01 * f64::from(i), 0.07 * f64::from(i)])
                    .collect();
                let (means, variances) = (gp.predict_mean(&queries), gp.predict_variance_latent(&queries));
                let residuals = gp.leave_one_out_residuals();
                for channel in 0..2 {
                    let y = DVector::from_column_slice(&data.targets[channel * n..][..n]);
                    let alpha = &oracle.inverse * &y;
                    lml -=
                        0.5 * (y.dot(&alpha) + oracle.log_det + n as f64 * (2.0 * std::f64::consts::PI).ln());
                    for (i, q) in queries.iter().enumerate() {
                        let k = DVector::from_fn(n, |j, _| kernel(&data, &hyper, q, &x[j]));
                        let (mean, found) = (k.dot(&alpha), means[2 * i + channel]);
                        assert!((mean - found).abs() < 1e-8 * mean.abs().max(1e-3), "{mean} {found}");
                        let variance = kernel(&data, &hyper, q, q) - k.dot(&(&oracle.inverse * &k));
                        assert!((variance / variances[i] - 1.0).abs() < 1e-8, "{variance} {}", variances[i]);
                    }
                    for i in 0..n {
                        let left_out = alpha[i] / oracle.inverse[(i, i)];
                        assert!((left_out - residuals[channel * n + i]).abs() < 1e-10);
                    }
                }
                let found = data.likelihood(&hyper).unwrap().value;
                assert!((found / lml - 1.0).abs() < 1e-9, "{found} {lml}");
            }
        }
    }

    #[test]
    fn agrees_with_the_dense_solver() {
        for axis in &AXES[..2] {
            let data = data(*axis);
            let n = data.len();
            let x = points(&data);
            for hyper in cases() {
                let axes = hyper.kernels.iter().cloned().zip(data.metrics).collect();
                let kernel = crate::kernel::Kernel::product(hyper.signal_variance, axes);
                let y: Vec<f64> = (0..n).flat_map(|i| [data.targets[i], data.targets[n + i]]).collect();
                let noise = hyper.noise_variance;
                let dense = crate::gp::DenseGp::fit_at(x.as_flattened(), &y, 2, kernel, noise).unwrap();
                let lattice = LatticeGp::new(data.clone(), hyper.clone()).unwrap();
                let queries: Vec<[f64; 3]> =
                    (0..30).map(|i| [0.03 * f64::from(i), 0.5, 0.08 * f64::from(i)]).collect();
                let means = dense.predict_mean(queries.as_flattened()).unwrap();
                for (a, b) in lattice.predict_mean(&queries).iter().zip(&means) {
                    assert!((a - b).abs() < 1e-8 * b.abs().max(1e-3), "{a} {b}");
                }
                let variances = dense.predict_variance_latent(queries.as_flattened()).unwrap();
                for (a, b) in lattice.predict_variance_latent(&queries).iter().zip(&variances) {
                    assert!((a / b - 1.0).abs() < 1e-8, "{a} {b}");
                }
                let (a, b) = (data.likelihood(&hyper).unwrap().value, dense.log_marginal_likelihood());
                assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
            }
        }
    }

    #[test]
    fn gradients_agree_with_finite_differences() {
        for axis in AXES {
            let data = data(axis);
            for hyper in cases() {
                let at = data.likelihood(&hyper).unwrap();
                let check = |slope: f64, move_by: &dyn Fn(f64) -> LatticeHyper| {
                    let step = 1e-4;
                    let value = |s: f64| data.likelihood(&move_by(s)).unwrap().value;
                    // Fourth order, so that the step can be large.
                    let numeric = (8.0 * (value(step) - value(-step))
                        - (value(2.0 * step) - value(-2.0 * step)))
                        / (12.0 * step);
                    assert!((slope - numeric).abs() < 1e-6 * (1.0 + slope.abs()), "{slope} {numeric}");
                };
                check(at.d_signal, &|s| LatticeHyper {
                    signal_variance: hyper.signal_variance * s.exp(),
                    ..hyper.clone()
                });
                check(at.d_noise, &|s| LatticeHyper {
                    noise_variance: hyper.noise_variance * s.exp(),
                    ..hyper.clone()
                });
                for k in 0..3 {
                    let start: Vec<f64> = hyper.kernels[k].log_parameters();
                    assert_eq!(at.d_axes[k].len(), start.len());
                    for (i, &slope) in at.d_axes[k].iter().enumerate() {
                        check(slope, &|s| {
                            let mut moved = hyper.clone();
                            let mut p = start.clone();
                            p[i] += s;
                            moved.kernels[k].set_log_parameters(&p).unwrap();
                            moved
                        });
                    }
                }
            }
        }
    }

    #[test]
    fn the_profiled_signal_variance_is_the_best_one() {
        let data = data(AXES[0]);
        let hyper = &cases()[0];
        let (signal_variance, best) = data.profile_likelihood(&hyper.kernels, 0.05).unwrap();
        assert!((best.d_signal + best.d_noise).abs() < 1e-9);
        for factor in [0.9, 1.1] {
            let signal_variance = signal_variance * factor;
            let kernels = hyper.kernels.clone();
            let other = LatticeHyper { signal_variance, noise_variance: 0.05 * signal_variance, kernels };
            assert!(data.likelihood(&other).unwrap().value < best.value);
        }
    }

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let data = data(AXES[1]);
        let hyper = &cases()[2];
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let gp = LatticeGp::new(data.clone(), hyper.clone()).unwrap();
                (gp.weights().to_vec(), data.likelihood(hyper).unwrap())
            })
        };
        assert_eq!(run(1), run(3));
    }

    #[test]
    fn a_mirrored_lattice_is_the_whole_circle_with_mirrored_targets() {
        let half = data(AXES[2]);
        let [u, v, phi] = half.coordinates.clone();
        let c = phi.len();
        // Nodes at phi and pi - phi; their targets are the same.
        let circle: Vec<f64> =
            phi.iter().copied().chain(phi.iter().rev().map(|x| std::f64::consts::PI - x)).collect();
        let mirror = |row: &[f64]| row.iter().chain(row.iter().rev()).copied().collect::<Vec<_>>();
        let targets = half.targets.chunks(c).flat_map(mirror).collect();
        let whole =
            LatticeData { coordinates: [u, v, circle], mirrored: [false; 3], targets, ..half.clone() };
        let hyper = cases()[0].clone();
        // Each pair of mirrored measurements counts as two, so each has twice the noise.
        let noisy = LatticeHyper { noise_variance: 2.0 * hyper.noise_variance, ..hyper.clone() };
        // The process of the half has the covariance of the sum over both images: twice the average.
        let halved = LatticeHyper {
            signal_variance: 0.5 * hyper.signal_variance,
            noise_variance: hyper.noise_variance,
            ..hyper
        };
        let points: Vec<[f64; 3]> =
            (0..20).map(|i| [0.05 * f64::from(i), 0.4, 0.15 * f64::from(i)]).collect();
        let a = LatticeGp::new(half, halved).unwrap().predict_mean(&points);
        let b = LatticeGp::new(whole, noisy).unwrap().predict_mean(&points);
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn broken_data_is_refused() {
        let good = data(AXES[0]);
        let hyper = cases()[0].clone();
        let mut short = good.clone();
        short.targets.pop();
        assert!(LatticeGp::new(short, hyper.clone()).is_err());
        let mut nan = good.clone();
        nan.targets[3] = f64::NAN;
        assert!(LatticeGp::new(nan, hyper.clone()).is_err());
        assert!(LatticeGp::new(good, LatticeHyper { noise_variance: 0.0, ..hyper }).is_err());
    }
}
