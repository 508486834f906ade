//! The distribution of one sample given a few others: the building block of the nearest-neighbour likelihood,
//! of the preconditioner, of variances and of leave-one-out predictions.

use crate::base::simd::{add_scaled, dot};
use crate::kernel::Kernel;

/// Functions `b` that add `v b(x)^T b(x')` to a covariance, by their values at the samples. There may be none.
#[derive(Clone, Debug, Default)]
pub(super) struct Basis {
    /// The number of functions.
    pub(super) count: usize,
    /// One row of values per sample.
    pub(super) rows: Vec<f64>,
}

impl Basis {
    /// The values at sample `i`.
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * self.count..(i + 1) * self.count]
    }

    /// `scale sum_i weights_i b(x_i)`.
    pub(super) fn weighted_sum(&self, scale: f64, weights: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; self.count];
        for (i, weight) in weights.iter().enumerate() {
            add_scaled(scale * weight, self.row(i), &mut sum);
        }
        sum
    }
}

/// A process with the covariance `k(x, x') + v b(x)^T b(x')` at given hyper-parameters, and its samples.
///
/// Source of the second term: C. E. Rasmussen and C. K. I. Williams, "Gaussian Processes for Machine Learning"
/// (2006), section 2.7, with independent standard normal coefficients.
#[derive(Clone, Copy, Debug)]
pub(super) struct Process<'a> {
    pub(super) kernel: &'a Kernel,
    /// Coordinates of the samples, `n` rows.
    pub(super) x: &'a [f64],
    /// Noise variance of each sample.
    pub(super) noise: &'a [f64],
    pub(super) basis: &'a Basis,
    /// `v`, which means nothing where the basis has no functions.
    pub(super) basis_variance: f64,
}

/// Added to the diagonal of covariances, relative to the prior variance, so that samples at the same place
/// without noise do not make them singular.
pub(super) const JITTER: f64 = 1e-12;

impl Process<'_> {
    /// Coordinates of sample `i`.
    pub(super) fn point(&self, i: usize) -> &[f64] {
        let dimension = self.kernel.dimension();
        &self.x[i * dimension..(i + 1) * dimension]
    }

    /// Covariance of two samples, without noise.
    #[cfg(feature = "fit")]
    pub(super) fn covariance(&self, i: usize, j: usize) -> f64 {
        self.kernel.value(self.point(i), self.point(j)) + self.in_basis(self.basis.row(i), self.basis.row(j))
    }

    /// The part of a covariance that is due to the basis, from its values at both points.
    pub(super) fn in_basis(&self, a: &[f64], b: &[f64]) -> f64 {
        if a.is_empty() { 0.0 } else { self.basis_variance * dot(a, b) }
    }

    /// The number of log-parameters: the kernel's and, where there is a basis, that of its variance.
    #[cfg(feature = "fit")]
    pub(super) fn n_parameters(&self) -> usize {
        self.kernel.n_parameters() + usize::from(self.basis.count > 0)
    }

    /// The covariance of two samples, without noise, and its derivative with respect to each log-parameter.
    #[cfg(feature = "fit")]
    pub(super) fn gradient(&self, i: usize, j: usize, out: &mut [f64]) -> f64 {
        let (of_kernel, of_basis) = out.split_at_mut(self.kernel.n_parameters());
        let value = self.kernel.gradient(self.point(i), self.point(j), of_kernel);
        let Some(of_basis) = of_basis.first_mut() else { return value };
        *of_basis = self.in_basis(self.basis.row(i), self.basis.row(j));
        value + *of_basis
    }

    /// The least variance of a measurement of sample `i`, whatever is known.
    pub(super) fn least_variance(&self, i: usize) -> f64 {
        self.noise[i].max(JITTER * self.kernel.prior_variance())
    }

    /// Variance of a measurement of sample `i` before anything is known.
    #[cfg(feature = "fit")]
    pub(super) fn diagonal(&self, i: usize) -> f64 {
        let row = self.basis.row(i);
        self.kernel.prior_variance() * (1.0 + JITTER) + self.in_basis(row, row) + self.noise[i]
    }
}

/// Work arrays of one thread for conditionals on up to `count` samples.
#[derive(Debug)]
pub(super) struct Scratch {
    count: usize,
    /// Lower triangle of the covariance of the samples, then its Cholesky factor, in rows of `count`.
    factor: Vec<f64>,
    /// Covariances with the point, then the coefficients of the samples in its conditional mean.
    coefficients: Vec<f64>,
}

impl Scratch {
    pub(super) fn new(count: usize) -> Self {
        Self { count, factor: vec![0.0; count * count], coefficients: vec![0.0; count] }
    }

    /// Conditions sample `i` on the samples `given`: the coefficients of these in its mean, and the variance of its
    /// noise-free value. Cost: `m^3 / 6` multiply-adds and `m^2 / 2` kernel evaluations.
    #[cfg(feature = "fit")]
    pub(super) fn condition(&mut self, process: &Process<'_>, i: usize, given: &[u32]) -> (&[f64], f64) {
        let at = |a: usize| given[a] as usize;
        let (coefficients, explained) = self.explain(
            given.len(),
            |a, b| process.covariance(at(a), at(b)),
            |a| process.diagonal(at(a)),
            |a| process.covariance(at(a), i),
        );
        let row = process.basis.row(i);
        let prior = process.kernel.prior_variance() + process.in_basis(row, row);
        (coefficients, (prior - explained).max(0.0))
    }

    /// The coefficients of `m` samples in the mean of a point, and the variance that they explain, from the
    /// covariances of pairs of samples, the variances of their measurements and the covariances with the point.
    pub(super) fn explain(
        &mut self,
        m: usize,
        mut covariance: impl FnMut(usize, usize) -> f64,
        mut diagonal: impl FnMut(usize) -> f64,
        mut with_point: impl FnMut(usize) -> f64,
    ) -> (&[f64], f64) {
        for a in 0..m {
            for b in 0..a {
                self.factor[a * self.count + b] = covariance(a, b);
            }
            self.factor[a * self.count + a] = diagonal(a);
            self.coefficients[a] = with_point(a);
        }
        factorize(&mut self.factor, self.count, m);
        let coefficients = &mut self.coefficients[..m];
        forward(&self.factor, self.count, coefficients);
        let explained = coefficients.iter().map(|x| x * x).sum();
        backward(&self.factor, self.count, coefficients);
        (coefficients, explained)
    }

    /// Solves `K w = y` in place with the covariance of the last call of [`Scratch::explain`].
    #[cfg(feature = "fit")]
    pub(super) fn solve(&self, y: &mut [f64]) {
        forward(&self.factor, self.count, y);
        backward(&self.factor, self.count, y);
    }
}

/// The Cholesky factor of the leading `m x m` block of a matrix in rows of `stride`, in place; only the lower
/// triangle is used. A pivot that rounding has made negative becomes a small positive one.
fn factorize(matrix: &mut [f64], stride: usize, m: usize) {
    for a in 0..m {
        let (above, row) = matrix.split_at_mut(a * stride);
        let diagonal = row[a];
        for b in 0..a {
            let other = &above[b * stride..b * stride + b + 1];
            let known: f64 = row[..b].iter().zip(other).map(|(x, y)| x * y).sum();
            row[b] = (row[b] - known) / other[b];
        }
        let known: f64 = row[..a].iter().map(|x| x * x).sum();
        row[a] = (diagonal - known).max(1e-14 * diagonal).sqrt();
    }
}

/// Solves `L x = y` in place for the factor of [`factorize`].
fn forward(factor: &[f64], stride: usize, y: &mut [f64]) {
    for a in 0..y.len() {
        let row = &factor[a * stride..=a * stride + a];
        let known: f64 = row[..a].iter().zip(&*y).map(|(l, y)| l * y).sum();
        y[a] = (y[a] - known) / row[a];
    }
}

/// Solves `L^T x = y` in place.
fn backward(factor: &[f64], stride: usize, y: &mut [f64]) {
    for a in (0..y.len()).rev() {
        let row = &factor[a * stride..=a * stride + a];
        y[a] /= row[a];
        let value = y[a];
        y[..a].iter_mut().zip(row).for_each(|(y, l)| *y -= l * value);
    }
}
