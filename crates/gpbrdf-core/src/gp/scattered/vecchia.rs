//! The nearest-neighbour approximation of a Gaussian process: its likelihood, and a sparse factor of the
//! inverse covariance.
//!
//! The joint density is written as a product of conditionals in some order, and each conditional keeps the
//! nearest of the samples before it: `p(y) = prod_i p(y_i | y_c(i))`. Source: A. V. Vecchia, "Estimation and
//! Model Identification for Continuous Spatial Processes", J. R. Stat. Soc. B 50 (1988); for random orders
//! J. Guinness, "Permutation and Grouping Methods for Sharpening Gaussian Process Approximations",
//! Technometrics 60 (2018).

use rayon::prelude::*;

use super::conditional::{Process, Scratch};
use super::neighbours::Neighbours;

/// Number of conditionals of a parallel task.
const BLOCK: usize = 32;

/// The sum of the log densities of the samples `subset`, each given its neighbours, over all channels, and the
/// derivatives with respect to the kernel's log-parameters and, last, the logarithm of the noise variance that
/// all samples share. `y` has one column per channel. Cost: `O(m^3)` per sample.
pub(super) fn log_likelihood(
    process: &Process<'_>,
    y: &[Vec<f64>],
    neighbours: &Neighbours,
    subset: &[u32],
) -> (f64, Vec<f64>) {
    let parameters = process.kernel.n_parameters() + 1;
    let count = largest(neighbours);
    let blocks: Vec<(f64, Vec<f64>)> = subset
        .par_chunks(BLOCK)
        .map_init(
            || Scratch::new(count, process.kernel),
            |scratch, block| {
                let mut gradient = vec![0.0; parameters];
                let value = block
                    .iter()
                    .map(|&i| i as usize)
                    .map(|i| scratch.log_density(process, y, i, neighbours.of(i), &mut gradient));
                (value.sum(), gradient)
            },
        )
        .collect();
    // Summed in order, so that the number of threads changes nothing.
    blocks.into_iter().fold((0.0, vec![0.0; parameters]), |(sum, mut total), (value, gradient)| {
        total.iter_mut().zip(gradient).for_each(|(total, g)| *total += g);
        (sum + value, total)
    })
}

fn largest(neighbours: &Neighbours) -> usize {
    (0..neighbours.len()).map(|i| neighbours.of(i).len()).max().unwrap_or(0).max(1)
}

/// A sparse factor of the inverse covariance, `K^-1 ~ sum_i u_i u_i^T` with `u_i = (e_i - b_i) / sqrt(v_i)`,
/// where `b_i` and `v_i` are the coefficients and the variance of sample `i` given its neighbours.
#[derive(Debug)]
pub(super) struct InverseFactor<'a> {
    neighbours: &'a Neighbours,
    coefficients: Vec<Vec<f64>>,
    variances: Vec<f64>,
}

impl<'a> InverseFactor<'a> {
    /// Computes all conditionals. Cost: `O(n m^3)`.
    pub(super) fn new(process: &Process<'_>, neighbours: &'a Neighbours) -> Self {
        let count = largest(neighbours);
        let (coefficients, variances) = (0..neighbours.len())
            .into_par_iter()
            .map_init(
                || Scratch::new(count, process.kernel),
                |scratch, i| {
                    let (b, latent) = scratch.condition(process, process.point(i), neighbours.of(i));
                    let floor = super::conditional::JITTER * process.kernel.prior_variance();
                    (b.to_vec(), latent.max(floor) + process.noise[i])
                },
            )
            .unzip();
        Self { neighbours, coefficients, variances }
    }

    /// The logarithm of the determinant of the covariance that this factor is exact for: `sum_i ln v_i`.
    pub(super) fn log_det(&self) -> f64 {
        self.variances.iter().map(|v| v.ln()).sum()
    }

    /// A sample of the process with that covariance, from standard normal numbers.
    pub(super) fn sample(&self, normal: &mut dyn FnMut() -> f64) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.variances.len());
        for (i, (b, v)) in self.coefficients.iter().zip(&self.variances).enumerate() {
            let known: f64 = b.iter().zip(self.neighbours.of(i)).map(|(b, &j)| b * out[j as usize]).sum();
            out.push(known + v.sqrt() * normal());
        }
        out
    }

    /// `out = sum_i u_i u_i^T r` for one column. Cost: `2 n m` multiply-adds.
    pub(super) fn apply(&self, r: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (i, (b, v)) in self.coefficients.iter().zip(&self.variances).enumerate() {
            let given = self.neighbours.of(i);
            let known: f64 = b.iter().zip(given).map(|(b, &j)| b * r[j as usize]).sum();
            let scaled = (r[i] - known) / v;
            out[i] += scaled;
            for (b, &j) in b.iter().zip(given) {
                out[j as usize] -= b * scaled;
            }
        }
    }
}
