//! The Gaussian process for thousands of samples at any directions.
//!
//! Hyper-parameters come from the nearest-neighbour likelihood (`vecchia.rs`), weights of the exact process
//! from conjugate gradients on products that store no matrix (`product.rs`, `conjugate_gradients.rs`), and
//! variances from the nearest samples and inducing points (`preconditioner.rs`). Memory is linear in the number
//! of samples.

mod conditional;
#[cfg(feature = "fit")]
mod conjugate_gradients;
#[cfg(feature = "fit")]
pub(crate) mod cost;
#[cfg(feature = "fit")]
mod exact;
#[cfg(feature = "fit")]
mod fit;
mod neighbours;
pub(crate) mod posterior;
mod preconditioner;
#[cfg(feature = "fit")]
mod product;
#[cfg(feature = "fit")]
pub(crate) mod solve;
#[cfg(feature = "fit")]
mod vecchia;
mod widening;

use std::sync::OnceLock;

use rayon::prelude::*;

use self::conditional::{Basis, Process, Scratch};
use self::neighbours::Embedded;
use self::preconditioner::{FarField, Preconditioner};
pub(crate) use self::widening::Widening;
use crate::base::error::{Error, Result};
use crate::base::watch::Watch;
use crate::kernel::{Kernel, Points};

/// The number of nearest samples on which variances, leave-one-out predictions and the preconditioner are
/// conditioned. All samples are taken where there are no more than these.
const NEAREST: usize = 48;

/// A Gaussian process conditioned on scattered samples. The channels share kernel and noise.
///
/// The covariance is `k(x, x') + v b(x)^T b(x')`, where `b` may be empty. The mean is that of the exact process,
/// `sum_i alpha_i k(x, x_i) + v b(x)^T sum_i alpha_i b(x_i)` with weights from conjugate gradients. The variance is
/// that given the 48 nearest samples and, through 200 inducing points, all others.
#[derive(Clone, Debug)]
pub(crate) struct ScatteredGp {
    kernel: Kernel,
    /// Noise variance that all samples share, in squared target units.
    noise_variance: f64,
    /// Noise variance of each sample: the shared one over the weight of the sample, plus what is known of it.
    noise: Vec<f64>,
    /// Coordinates of the samples, `n` rows.
    inputs: Vec<f64>,
    basis: Basis,
    basis_variance: f64,
    points: Points,
    embedded: Embedded,
    channels: usize,
    /// `K^-1 y`, one column per channel.
    weights: Vec<f64>,
    /// What regions of samples that are left out say about variances.
    widening: Widening,
    /// What variances need; a process that was loaded from a file computes it when it is first needed.
    far_field: OnceLock<FarField>,
}

impl ScatteredGp {
    /// A process with known weights, one column of `n` per channel.
    ///
    /// # Errors
    /// Sizes that do not agree, no samples, or an invalid kernel or noise variance.
    fn new(
        kernel: Kernel,
        noise_variance: f64,
        noise: Vec<f64>,
        inputs: Vec<f64>,
        (basis, basis_variance): (Basis, f64),
        channels: usize,
        weights: Vec<f64>,
    ) -> Result<Self> {
        kernel.validate()?;
        let n = noise.len();
        let expected = [n * kernel.dimension(), n * channels, n * basis.count];
        if n == 0 || channels == 0 || [inputs.len(), weights.len(), basis.rows.len()] != expected {
            let found =
                format!("{n} noise variances, {} coordinates, {} weights", inputs.len(), weights.len());
            return Err(Error::argument("samples", "at least one, each with coordinates and weights", found));
        }
        let variances = [&noise_variance, &basis_variance].into_iter().chain(&noise);
        let bad = variances.copied().find(|v| !(*v >= 0.0 && v.is_finite()));
        if let Some(bad) = bad {
            return Err(Error::argument("variance", "a number of at least 0", bad));
        }
        let points = Points::new(&inputs, &kernel.metric);
        let embedded = Embedded::new(&inputs, &kernel);
        Ok(Self {
            kernel,
            noise_variance,
            noise,
            inputs,
            basis,
            basis_variance,
            points,
            embedded,
            channels,
            weights,
            widening: Widening::default(),
            far_field: OnceLock::new(),
        })
    }

    /// A process with a basis: its values at the samples, the number of its functions, and their variance.
    ///
    /// # Errors
    /// Those of [`ScatteredGp::new`].
    pub(crate) fn with_basis(
        kernel: Kernel,
        noise_variance: f64,
        noise: Vec<f64>,
        inputs: Vec<f64>,
        (rows, count, variance): (Vec<f64>, usize, f64),
        channels: usize,
        weights: Vec<f64>,
    ) -> Result<Self> {
        let basis = (Basis { count, rows }, variance);
        Self::new(kernel, noise_variance, noise, inputs, basis, channels, weights)
    }

    pub(crate) fn kernel(&self) -> &Kernel {
        &self.kernel
    }

    pub(crate) fn noise_variance(&self) -> f64 {
        self.noise_variance
    }

    /// The variance of the basis.
    pub(crate) fn basis_variance(&self) -> f64 {
        self.basis_variance
    }

    /// Noise variance of each sample.
    pub(crate) fn noise(&self) -> &[f64] {
        &self.noise
    }

    /// Coordinates of the samples, `n` rows.
    pub(crate) fn inputs(&self) -> &[f64] {
        &self.inputs
    }

    /// Weights of the samples, one column per channel.
    pub(crate) fn weights(&self) -> &[f64] {
        &self.weights
    }

    fn n_samples(&self) -> usize {
        self.noise.len()
    }

    /// The part of the posterior mean at `x`, rows of coordinates, that is due to the kernel; rows with one value per
    /// channel. Cost: `n` kernel evaluations per point.
    pub(crate) fn mean_at(&self, x: &[f64]) -> Vec<f64> {
        self.kernel.weighted_sums(&self.points, &self.weights, &Points::new(x, &self.kernel.metric))
    }

    /// The coefficients of the basis in the posterior mean of a channel, `v sum_i alpha_i b(x_i)`.
    pub(crate) fn basis_coefficients(&self, channel: usize) -> Vec<f64> {
        let n = self.n_samples();
        self.basis.weighted_sum(self.basis_variance, &self.weights[channel * n..(channel + 1) * n])
    }

    /// The process with wider intervals.
    ///
    /// # Errors
    /// Factors that are not finite numbers of at least 1.
    pub(crate) fn widened(self, widening: Widening) -> Result<Self> {
        if !widening.is_valid() {
            return Err(Error::argument(
                "widening of intervals",
                "factors of at least 1",
                format!("{widening:?}"),
            ));
        }
        Ok(Self { widening, ..self })
    }

    /// How much wider intervals are than without what regions that are left out say.
    pub(crate) fn widening(&self) -> Widening {
        self.widening
    }

    /// Takes what variances need from the search for the weights.
    #[cfg(feature = "fit")]
    fn with_far_field(self, far_field: FarField) -> Self {
        Self { far_field: OnceLock::from(far_field), ..self }
    }

    /// Variance of the noise-free function at `x`, rows of coordinates, where the basis has the values `basis`, a row
    /// per point. The first call on a loaded process
    /// computes the uncertainty of the inducing points. Cost: one distance to every sample, 1,200 kernel values
    /// and 300,000 multiply-adds per point.
    ///
    /// # Errors
    /// None without an observer.
    pub(crate) fn variance_at(&self, x: &[f64], basis: &[f64]) -> Result<Vec<f64>> {
        let (process, watch) = (self.process(), Watch::default());
        let far_field = match self.far_field.get() {
            Some(far_field) => far_field,
            None => {
                let neighbours = self.embedded.nearest_before(NEAREST, &watch)?;
                let far_field = Preconditioner::new(&process, neighbours, &watch)?.into_far_field();
                self.far_field.get_or_init(|| far_field)
            }
        };
        let prior = self.kernel.prior_variance();
        let nearest = self.embedded.nearest_to(&Embedded::new(x, &self.kernel), NEAREST, &watch)?;
        let variances = x
            .par_chunks(self.kernel.dimension())
            .enumerate()
            .map_init(
                || Scratch::new(&self.kernel),
                |scratch, (j, point)| {
                    let own = &basis[j * self.basis.count..(j + 1) * self.basis.count];
                    let variance = far_field.variance(&process, (point, own), nearest.of(j), scratch);
                    self.widening.widened(point[0], variance, prior)
                },
            )
            .collect();
        Ok(variances)
    }

    fn process(&self) -> Process<'_> {
        Process {
            kernel: &self.kernel,
            x: &self.inputs,
            noise: &self.noise,
            basis: &self.basis,
            basis_variance: self.basis_variance,
        }
    }
}

#[cfg(all(test, feature = "fit"))]
mod tests;
