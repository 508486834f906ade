//! The distribution of one sample given a few others: the building block of the nearest-neighbour likelihood,
//! of the preconditioner, of variances and of leave-one-out predictions.

use crate::base::simd::{add_scaled, dot, vectorized};
use crate::kernel::{Kernel, Pairs};

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

    /// The part of a covariance that is due to the basis, from its values at both points.
    pub(super) fn in_basis(&self, a: &[f64], b: &[f64]) -> f64 {
        if a.is_empty() { 0.0 } else { self.basis_variance * dot(a, b) }
    }

    /// The number of log-parameters: the kernel's and, where there is a basis, that of its variance.
    #[cfg(feature = "fit")]
    pub(super) fn n_parameters(&self) -> usize {
        self.kernel.n_parameters() + usize::from(self.basis.count > 0)
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

/// Work arrays of one thread for conditionals on a few samples.
#[derive(Debug)]
pub(super) struct Scratch {
    pairs: Pairs,
    /// Covariances of all pairs of the samples and, last, the point, packed like those of [`Pairs`].
    covariances: Vec<f64>,
    /// Upper triangle of the covariance of the samples, then its Cholesky factor, rows of the number of samples.
    factor: Vec<f64>,
    /// Variances of the samples.
    diagonal: Vec<f64>,
    /// Covariances with the point, then the coefficients of the samples in its conditional mean.
    coefficients: Vec<f64>,
}

impl Scratch {
    pub(super) fn new(kernel: &Kernel) -> Self {
        Self {
            pairs: Pairs::new(kernel.dimension()),
            covariances: Vec::new(),
            factor: Vec::new(),
            diagonal: Vec::new(),
            coefficients: Vec::new(),
        }
    }

    /// Conditions sample `i` on the samples `given`: the coefficients of these in its mean, and the variance of its
    /// noise-free value. Cost: `m^3 / 6` multiply-adds and `m^2 / 2` kernel evaluations.
    #[cfg(feature = "fit")]
    pub(super) fn condition(&mut self, process: &Process<'_>, i: usize, given: &[u32]) -> (&[f64], f64) {
        self.covary(process, given, process.point(i));
        self.add_basis(process, given, i);
        let row = process.basis.row(i);
        let prior = process.kernel.prior_variance() + process.in_basis(row, row);
        let (coefficients, explained) = self.explain(given.len(), |a| process.diagonal(given[a] as usize));
        (coefficients, (prior - explained).max(0.0))
    }

    /// Takes the kernel of all pairs of the samples `given` and, last, a point, and returns it, packed.
    pub(super) fn covary(&mut self, process: &Process<'_>, given: &[u32], point: &[f64]) -> &mut [f64] {
        let points = given.iter().map(|&j| process.point(j as usize));
        self.pairs.take(points.chain([point]), &process.kernel.metric);
        self.pairs.values(process.kernel, &mut self.covariances);
        &mut self.covariances
    }

    /// Adds what the basis contributes to the covariances of the samples `given` and, last, sample `i`.
    #[cfg(feature = "fit")]
    pub(super) fn add_basis(&mut self, process: &Process<'_>, given: &[u32], i: usize) {
        if process.basis.count > 0 {
            let rows = || given.iter().map(|&j| process.basis.row(j as usize)).chain([process.basis.row(i)]);
            let of_pairs =
                rows().enumerate().flat_map(|(a, row)| rows().skip(a + 1).map(move |other| (row, other)));
            for (value, (a, b)) in self.covariances.iter_mut().zip(of_pairs) {
                *value += process.in_basis(a, b);
            }
        }
    }

    /// Adds the derivatives of the kernel between the pairs of the last call of [`Scratch::covary`], times weights.
    #[cfg(feature = "fit")]
    pub(super) fn add_gradient(&mut self, kernel: &Kernel, weights: &[f64], gradient: &mut [f64]) {
        self.pairs.add_gradient(kernel, weights, gradient);
    }

    /// The coefficients of `m` samples in the mean of a point, and the variance that they explain, from the covariances
    /// of the last call of [`Scratch::covary`], changed since or not, and the variances of the measurements.
    pub(super) fn explain(&mut self, m: usize, diagonal: impl Fn(usize) -> f64) -> (&[f64], f64) {
        self.factor.resize(m * m, 0.0);
        self.diagonal.clear();
        self.diagonal.extend((0..m).map(diagonal));
        self.coefficients.clear();
        let mut rest = &self.covariances[..];
        for a in 0..m {
            let (row, others) = rest.split_at(m - a);
            rest = others;
            let (last, row) = row.split_last().map_or((0.0, row), |(last, row)| (*last, row));
            self.factor[a * m + a] = self.diagonal[a];
            self.factor[a * m + a + 1..(a + 1) * m].copy_from_slice(row);
            self.coefficients.push(last);
        }
        factorize(&mut self.factor, &self.diagonal);
        forward(&self.factor, &mut self.coefficients);
        let explained = self.coefficients.iter().map(|x| x * x).sum();
        backward(&self.factor, &mut self.coefficients);
        (&self.coefficients, explained)
    }

    /// Solves `K w = y` in place with the covariance of the last call of [`Scratch::explain`].
    #[cfg(feature = "fit")]
    pub(super) fn solve(&self, y: &mut [f64]) {
        forward(&self.factor, y);
        backward(&self.factor, y);
    }
}

/// The Cholesky factor `U` of a matrix `U^T U` of which the upper triangle is given, in place, rows of the length of
/// `diagonal`, which holds the diagonal of the matrix. A pivot that rounding has made negative becomes a small positive
/// one.
fn factorize(matrix: &mut [f64], diagonal: &[f64]) {
    let m = diagonal.len();
    vectorized(
        #[inline(always)]
        || {
            for k in 0..m {
                let (above, below) = matrix.split_at_mut((k + 1) * m);
                let row = &mut above[k * m + k..];
                let pivot = row[0].max(1e-14 * diagonal[k]).sqrt();
                row[0] = pivot;
                let inverse = pivot.recip();
                row[1..].iter_mut().for_each(|x| *x *= inverse);
                for (i, other) in below.chunks_exact_mut(m).enumerate() {
                    let factor = row[i + 1];
                    for (x, y) in other[k + 1 + i..].iter_mut().zip(&row[i + 1..]) {
                        *x -= factor * y;
                    }
                }
            }
        },
    );
}

/// Solves `U^T x = y` in place for the factor of [`factorize`].
fn forward(factor: &[f64], y: &mut [f64]) {
    let m = y.len();
    for a in 0..m {
        let row = &factor[a * m + a..(a + 1) * m];
        let (first, rest) = y[a..].split_at_mut(1);
        first[0] /= row[0];
        rest.iter_mut().zip(&row[1..]).for_each(|(y, u)| *y -= u * first[0]);
    }
}

/// Solves `U x = y` in place.
fn backward(factor: &[f64], y: &mut [f64]) {
    let m = y.len();
    for a in (0..m).rev() {
        let row = &factor[a * m + a..(a + 1) * m];
        let known: f64 = row[1..].iter().zip(&y[a + 1..]).map(|(u, y)| u * y).sum();
        y[a] = (y[a] - known) / row[0];
    }
}
