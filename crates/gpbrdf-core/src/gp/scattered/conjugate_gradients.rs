//! Preconditioned conjugate gradients for several right-hand sides at once, and the determinant that comes with
//! them.

use rayon::prelude::*;

use super::preconditioner::Preconditioner;
use super::product::Covariance;
use crate::base::error::{Error, Result};
use crate::base::linalg::symmetric_eigen;
use crate::base::random::SplitMix64;
use crate::base::simd::{add_scaled, dot};
use crate::base::watch::Watch;

/// The search ends when every residual, measured by the preconditioner, is this small relative to its
/// right-hand side. That is the error of the solution in standard deviations of the samples given each other.
const TOLERANCE: f64 = 5e-6;

/// The largest number of products with the covariance.
const MOST_ITERATIONS: usize = 400;

/// Number of random right-hand sides from which the determinant is estimated.
const PROBES: usize = 6;

/// Seed of these.
const SEED: u64 = 0x1DE7;

/// The solution of a system with a covariance.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    /// `K^-1 y`, columns like those of `y`.
    pub(super) x: Vec<f64>,
    /// An estimate of `ln det K`.
    pub(super) log_det: f64,
}

/// Solves `K x = y` for the columns of `y`, each of length `n`, with all columns sharing every product, and
/// estimates `ln det K`.
///
/// Source: M. R. Hestenes and E. Stiefel, "Methods of Conjugate Gradients for Solving Linear Systems" (1952),
/// with the preconditioner `M^-1` of [`Preconditioner`]. Residuals are measured by `r^T M^-1 r`. The determinant
/// is `ln det M + tr ln(M^-1 K)`; its second part is a mean over samples `z` of the process with covariance `M`,
/// which are further right-hand sides: the coefficients of their searches are those of the Lanczos process, and
/// `z^T M^-1 z (e_1^T ln(T) e_1)` with its tridiagonal matrix `T` is the quadrature. Source: J. R. Gardner et
/// al., "`GPyTorch`: Blackbox Matrix-Matrix Gaussian Process Inference with GPU Acceleration" (2018), section 4.
///
/// # Errors
/// A residual that is still above 1e-2 after 400 products, and [`Error::Cancelled`] where the observer stops the
/// work.
pub(super) fn solve(
    covariance: &Covariance<'_>,
    preconditioner: &Preconditioner,
    y: &[f64],
    watch: &Watch,
) -> Result<Solution> {
    let n = covariance.points.len();
    let systems = y.len() / n;
    let mut random = SplitMix64::new(SEED);
    let mut r = y.to_vec();
    for _ in 0..PROBES {
        r.extend(preconditioner.sample(&mut || random.next_normal()));
    }
    let mut columns: Vec<Column> = r.par_chunks(n).map(|r| Column::new(r.to_vec(), preconditioner)).collect();
    let mut directions: Vec<f64> = columns.iter().flat_map(|column| &column.z).copied().collect();
    let mut product = vec![0.0; r.len()];
    let residual = |columns: &[Column]| columns[..systems].iter().map(Column::residual).fold(0.0, f64::max);
    let mut iterations = 0;
    while residual(&columns) > TOLERANCE && iterations < MOST_ITERATIONS {
        // Residuals shrink by about the same factor in every product.
        let share = residual(&columns).ln() / TOLERANCE.ln();
        let next = if iterations > 0 { share * (1.0 + (iterations as f64).recip()) } else { 0.05 };
        let watch = watch.part(share.clamp(0.0, 1.0), next.clamp(0.0, 1.0));
        covariance.apply(&directions, &mut product, &watch)?;
        let parts = directions.par_chunks_mut(n).zip(product.par_chunks(n));
        columns.par_iter_mut().zip(parts).for_each(|(column, (p, product))| {
            column.advance(p, product, preconditioner);
        });
        iterations += 1;
    }
    let left = residual(&columns);
    if left.is_nan() || left > 1e-2 {
        let found = format!("{left:.1e} after {iterations} products");
        return Err(Error::argument("residual of the weights", "below 0.01", found));
    }
    let x = columns[..systems].iter().flat_map(|column| &column.x).copied().collect();
    let probes = &columns[systems..];
    let trace = probes.iter().map(Column::log_quadrature).sum::<f64>() / PROBES as f64;
    Ok(Solution { x, log_det: preconditioner.log_det() + trace })
}

/// The search for one right-hand side.
struct Column {
    /// The solution so far, its residual, and `M^-1` times the residual.
    x: Vec<f64>,
    r: Vec<f64>,
    z: Vec<f64>,
    /// `r^T M^-1 r` at the start and now.
    start: f64,
    energy: f64,
    /// Length of each step, and the factor by which the direction was kept for the next one.
    steps: Vec<(f64, f64)>,
}

impl Column {
    fn new(r: Vec<f64>, preconditioner: &Preconditioner) -> Self {
        let mut z = vec![0.0; r.len()];
        preconditioner.apply(&r, &mut z);
        let energy = dot(&r, &z);
        Self { x: vec![0.0; r.len()], r, z, start: energy, energy, steps: Vec::new() }
    }

    /// Goes along the direction `p`, whose product with the covariance is known, and turns it into the next one.
    fn advance(&mut self, p: &mut [f64], product: &[f64], preconditioner: &Preconditioner) {
        let curvature = dot(p, product);
        // A column that is solved stays as it is.
        if self.residual() <= 0.1 * TOLERANCE || curvature <= 0.0 {
            return;
        }
        let step = self.energy / curvature;
        add_scaled(step, p, &mut self.x);
        add_scaled(-step, product, &mut self.r);
        preconditioner.apply(&self.r, &mut self.z);
        let next = dot(&self.r, &self.z);
        let factor = next / self.energy;
        p.iter_mut().zip(&self.z).for_each(|(p, z)| *p = z + factor * *p);
        self.steps.push((step, factor));
        self.energy = next;
    }

    fn residual(&self) -> f64 {
        if self.start > 0.0 { (self.energy / self.start).sqrt() } else { 0.0 }
    }

    /// `z^T M^-1 z (e_1^T ln(T) e_1)` with the tridiagonal matrix of the Lanczos process.
    fn log_quadrature(&self) -> f64 {
        let size = self.steps.len();
        if size == 0 {
            return 0.0;
        }
        let mut tridiagonal = crate::base::linalg::Matrix::zeros(size, size);
        for k in 0..size {
            let (step, factor) = self.steps[k];
            let before = if k > 0 { self.steps[k - 1].1 / self.steps[k - 1].0 } else { 0.0 };
            tridiagonal[(k, k)] = step.recip() + before;
            if k + 1 < size {
                let off = factor.max(0.0).sqrt() / step;
                tridiagonal[(k, k + 1)] = off;
                tridiagonal[(k + 1, k)] = off;
            }
        }
        let Some((values, vectors)) = symmetric_eigen(&tridiagonal) else { return 0.0 };
        let terms = values.iter().enumerate().map(|(k, value)| {
            let first = vectors[(0, k)];
            first * first * value.max(f64::MIN_POSITIVE).ln()
        });
        self.start * terms.sum::<f64>()
    }
}
