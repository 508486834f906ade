//! An approximate inverse of the covariance of scattered samples: long-range correlations by inducing points,
//! what is left by nearest neighbours.
//!
//! The covariance is split as `K = B B^T + R`, where `B B^T` is the part that a basis spans, and what the first
//! samples of the order know of all others (Nystrom). The inverse of the rest `R`, noise included, is a sparse
//! product `U U^T` from conditionals on nearest neighbours, and the inverse of the sum follows from Woodbury's
//! formula. Source: T. Gyger, R. Furrer and F. Sigrist, "Vecchia-Inducing-Points Full-Scale Approximations for
//! Gaussian Processes" (2025).

use rayon::prelude::*;

use super::conditional::{JITTER, Process, Scratch};
use super::neighbours::Neighbours;
use crate::base::error::Result;
use crate::base::linalg::{factorize, product_into_slice, solve_lower, view_slice};
#[cfg(feature = "fit")]
use crate::base::linalg::{half_log_det, solve};
use crate::base::simd::{add_scaled, dot};
use crate::base::watch::Watch;

/// The largest number of inducing points, and the number of samples for each of them.
const MOST_POINTS: usize = 200;
const SAMPLES_PER_POINT: usize = 8;

/// Number of samples that are conditioned before somebody may stop the work.
const STEP: usize = 8;

/// A matrix `B B^T` of low rank: `B = [sqrt(v) b(X), k(X, Z) L^-T]` with the basis `b`, the inducing points `Z`, which
/// are the first samples, and the Cholesky factor `L` of `k(Z, Z)`.
#[derive(Clone, Debug)]
struct LowRank {
    /// Number of columns of the basis, which come first.
    basis: usize,
    /// Number of inducing points.
    points: usize,
    factor: Vec<f64>,
    /// Rows of `B`.
    rows: Vec<f64>,
}

impl LowRank {
    /// The part of the first samples of the order; of none where their covariance cannot be factorised.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled) where the observer stops the work.
    fn new(process: &Process<'_>, watch: &Watch) -> Result<Self> {
        let n = process.noise.len();
        let mut points = (n / SAMPLES_PER_POINT).min(MOST_POINTS);
        let mut factor = vec![0.0; points * points];
        for j in 0..points {
            for i in j..points {
                factor[j * points + i] = process.kernel.value(process.point(i), process.point(j));
            }
            // Enough for samples at the same place; what is lost here is left to the neighbours.
            factor[j * points + j] *= 1.0 + 1e-8;
        }
        if !factorize(&mut factor, points) {
            points = 0;
        }
        let mut found = Self { basis: process.basis.count, points, factor, rows: Vec::new() };
        let rank = found.rank();
        if rank > 0 {
            let (mut rows, steps) = (vec![0.0; n * rank], watch.steps(n / STEP));
            rows.par_chunks_mut(rank).enumerate().try_for_each(|(i, row)| {
                if i % STEP == STEP - 1 {
                    steps.take()?;
                }
                row.copy_from_slice(&found.at(process, process.point(i), process.basis.row(i)));
                Ok(())
            })?;
            found.rows = rows;
        }
        Ok(found)
    }

    /// The number of columns of `B`.
    fn rank(&self) -> usize {
        self.basis + self.points
    }

    /// The row of a point with these values of the basis.
    fn at(&self, process: &Process<'_>, point: &[f64], basis: &[f64]) -> Vec<f64> {
        let scale = process.basis_variance.sqrt();
        let inducing = process.x.chunks(process.kernel.dimension()).take(self.points);
        let covariances = inducing.map(|z| process.kernel.value(z, point));
        let mut row: Vec<f64> = basis.iter().map(|b| scale * b).chain(covariances).collect();
        if self.points > 0 {
            solve_lower(&self.factor, self.points, &mut row[self.basis..]);
        }
        row
    }

    /// Row `i` of `B`.
    fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * self.rank()..(i + 1) * self.rank()]
    }

    /// Row `i` of the columns of the inducing points.
    fn inducing(&self, i: usize) -> &[f64] {
        &self.row(i)[self.basis..]
    }

    /// Takes the part of the inducing points from the covariances of all pairs of samples and, last, a point with this
    /// part of a row, packed like those of [`Pairs`](crate::kernel::Pairs).
    fn take_from(&self, covariances: &mut [f64], samples: &[u32], point: &[f64]) {
        if self.points == 0 {
            return;
        }
        let row = |a: usize| samples.get(a).map_or(point, |&j| self.inducing(j as usize));
        let mut rest = covariances;
        for a in 0..samples.len() {
            let (others, next) = rest.split_at_mut(samples.len() - a);
            for (covariance, b) in others.iter_mut().zip(a + 1..) {
                *covariance -= dot(row(a), row(b));
            }
            rest = next;
        }
    }

    /// The variance of a measurement of a sample that `B B^T` leaves.
    fn rest_variance(&self, process: &Process<'_>, i: usize) -> f64 {
        let (prior, known) = (process.kernel.prior_variance(), dot(self.inducing(i), self.inducing(i)));
        (prior - known).max(0.0) + JITTER * prior + process.noise[i]
    }
}

/// What the inducing points know: their part of every covariance, and their uncertainty given all samples.
#[derive(Clone, Debug)]
pub(super) struct FarField {
    low_rank: LowRank,
    /// Cholesky factor of `I + B^T R^-1 B`.
    capacitance: Vec<f64>,
}

impl FarField {
    /// Variance of the noise-free function at a point with these values of the basis, given its nearest samples and,
    /// through basis and inducing points, all others: `v + c^T S^-1 c` with `c = b(x) - sum_i beta_i b_i`, where
    /// `beta` and `v` are coefficients and variance of the rest given the rests of the nearest samples.
    pub(super) fn variance(
        &self,
        process: &Process<'_>,
        (point, basis): (&[f64], &[f64]),
        nearest: &[u32],
        scratch: &mut Scratch,
    ) -> f64 {
        let low_rank = &self.low_rank;
        let mut known = low_rank.at(process, point, basis);
        let own = &known[low_rank.basis..];
        low_rank.take_from(scratch.covary(process, nearest, point), nearest, own);
        let (b, explained) =
            scratch.explain(nearest.len(), |a| low_rank.rest_variance(process, nearest[a] as usize));
        let rest = process.kernel.prior_variance() - dot(own, own) - explained;
        for (b, &j) in b.iter().zip(nearest) {
            add_scaled(-b, low_rank.row(j as usize), &mut known);
        }
        if low_rank.rank() > 0 {
            solve_lower(&self.capacitance, low_rank.rank(), &mut known);
        }
        // Rounding must not make anything less certain than it was before.
        let prior = process.kernel.prior_variance() + process.in_basis(basis, basis);
        (rest.max(0.0) + dot(&known, &known)).min(prior)
    }
}

/// The approximate inverse.
#[cfg_attr(not(feature = "fit"), expect(dead_code, reason = "only the weights of a fit need it as a whole"))]
#[derive(Debug)]
pub(super) struct Preconditioner {
    neighbours: Neighbours,
    low_rank: LowRank,
    /// Coefficients and variance of each sample's rest given the rests of its neighbours.
    coefficients: Vec<Vec<f64>>,
    variances: Vec<f64>,
    /// `U^T B`, rows like those of `B`.
    whitened: Vec<f64>,
    /// Cholesky factor of `I + B^T R^-1 B`.
    capacitance: Vec<f64>,
}

impl Preconditioner {
    /// Computes all conditionals. Cost: `O(n m^2 (m + q))` with `m` neighbours and `q` inducing points.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled) where the observer stops the work.
    pub(super) fn new(process: &Process<'_>, neighbours: Neighbours, watch: &Watch) -> Result<Self> {
        let low_rank = LowRank::new(process, &watch.part(0.0, 0.2))?;
        let conditioning = watch.part(0.2, 1.0);
        let steps = conditioning.steps(neighbours.len() / STEP);
        let conditionals: Vec<(Vec<f64>, f64)> = (0..neighbours.len())
            .into_par_iter()
            .map_init(
                || Scratch::new(process.kernel),
                |scratch, i| {
                    if i % STEP == STEP - 1 {
                        steps.take()?;
                    }
                    let given = neighbours.of(i);
                    let covariances = scratch.covary(process, given, process.point(i));
                    low_rank.take_from(covariances, given, low_rank.inducing(i));
                    let (b, explained) =
                        scratch.explain(given.len(), |a| low_rank.rest_variance(process, given[a] as usize));
                    let variance = low_rank.rest_variance(process, i) - explained;
                    Ok((b.to_vec(), variance.max(process.least_variance(i))))
                },
            )
            .collect::<Result<_>>()?;
        let (coefficients, variances): (Vec<Vec<f64>>, Vec<f64>) = conditionals.into_iter().unzip();
        let rank = low_rank.rank();
        let mut whitened = vec![0.0; low_rank.rows.len()];
        let mut capacitance = vec![0.0; rank * rank];
        if rank > 0 {
            whitened.par_chunks_mut(rank).enumerate().for_each(|(i, out)| {
                out.copy_from_slice(low_rank.row(i));
                for (b, &j) in coefficients[i].iter().zip(neighbours.of(i)) {
                    add_scaled(-b, low_rank.row(j as usize), out);
                }
                let scale = variances[i].sqrt().recip();
                out.iter_mut().for_each(|x| *x *= scale);
            });
            let rows = view_slice(&whitened, rank, neighbours.len());
            product_into_slice(&mut capacitance, rows, rows.transpose());
            capacitance.iter_mut().step_by(rank + 1).for_each(|diagonal| *diagonal += 1.0);
            // The identity makes it positive definite.
            factorize(&mut capacitance, rank);
        }
        Ok(Self { neighbours, low_rank, coefficients, variances, whitened, capacitance })
    }

    /// What variances need of this.
    pub(super) fn into_far_field(self) -> FarField {
        FarField { low_rank: self.low_rank, capacitance: self.capacitance }
    }

    /// The logarithm of the determinant of the matrix that this inverts.
    #[cfg(feature = "fit")]
    pub(super) fn log_det(&self) -> f64 {
        let rest: f64 = self.variances.iter().map(|v| v.ln()).sum();
        rest + 2.0 * half_log_det(&self.capacitance, self.low_rank.rank())
    }

    /// A sample of the process whose covariance this inverts, from standard normal numbers.
    #[cfg(feature = "fit")]
    pub(super) fn sample(&self, normal: &mut dyn FnMut() -> f64) -> Vec<f64> {
        let weights: Vec<f64> = (0..self.low_rank.rank()).map(|_| normal()).collect();
        let mut rest = Vec::with_capacity(self.variances.len());
        for (i, (b, v)) in self.coefficients.iter().zip(&self.variances).enumerate() {
            let known: f64 = b.iter().zip(self.neighbours.of(i)).map(|(b, &j)| b * rest[j as usize]).sum();
            rest.push(known + v.sqrt() * normal());
        }
        rest.iter().enumerate().map(|(i, rest)| rest + dot(self.low_rank.row(i), &weights)).collect()
    }

    /// `out = U (I - C S^-1 C^T) U^T r` with `C = U^T B` and `S = I + C^T C`. Cost: `2 n (m + q)` multiply-adds.
    #[cfg(feature = "fit")]
    pub(super) fn apply(&self, r: &[f64], out: &mut [f64]) {
        let rank = self.low_rank.rank();
        let mut white: Vec<f64> = self
            .coefficients
            .iter()
            .zip(&self.variances)
            .enumerate()
            .map(|(i, (b, v))| {
                let known: f64 = b.iter().zip(self.neighbours.of(i)).map(|(b, &j)| b * r[j as usize]).sum();
                (r[i] - known) / v.sqrt()
            })
            .collect();
        if rank > 0 {
            let mut sum = vec![0.0; rank];
            for (white, row) in white.iter().zip(self.whitened.chunks(rank)) {
                add_scaled(*white, row, &mut sum);
            }
            solve(&self.capacitance, rank, &mut sum);
            for (white, row) in white.iter_mut().zip(self.whitened.chunks(rank)) {
                *white -= dot(row, &sum);
            }
        }
        out.fill(0.0);
        for (i, (b, v)) in self.coefficients.iter().zip(&self.variances).enumerate() {
            let scaled = white[i] / v.sqrt();
            out[i] += scaled;
            for (b, &j) in b.iter().zip(self.neighbours.of(i)) {
                out[j as usize] -= b * scaled;
            }
        }
    }
}
