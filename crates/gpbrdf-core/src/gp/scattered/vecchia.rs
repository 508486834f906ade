//! The likelihood of the nearest-neighbour approximation of a Gaussian process.
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

/// What the derivatives of a likelihood need besides the process.
#[derive(Clone, Copy, Debug)]
pub(super) struct Targets<'a> {
    /// Targets, one column per channel.
    pub(super) y: &'a [Vec<f64>],
    /// The part of each sample's noise variance that is proportional to the shared one.
    pub(super) shared_noise: &'a [f64],
}

/// The sum of the log densities of the samples `subset`, each given its neighbours, over all channels, and the
/// derivatives with respect to the log-parameters of the process and, last, the logarithm of the noise variance that
/// all samples share. Cost: `O(m^3)` per sample.
pub(super) fn log_likelihood(
    process: &Process<'_>,
    targets: &Targets<'_>,
    neighbours: &Neighbours,
    subset: &[u32],
) -> (f64, Vec<f64>) {
    let parameters = process.n_parameters() + 1;
    let count = neighbours.largest();
    let blocks: Vec<(f64, Vec<f64>)> = subset
        .par_chunks(BLOCK)
        .map_init(
            || Conditional::new(count, process.n_parameters()),
            |conditional, block| {
                let mut gradient = vec![0.0; parameters];
                let density = |i: u32| {
                    let i = i as usize;
                    conditional.log_density(process, targets, i, neighbours.of(i), &mut gradient)
                };
                (block.iter().copied().map(density).sum(), gradient)
            },
        )
        .collect();
    // Summed in order, so that the number of threads changes nothing.
    blocks.into_iter().fold((0.0, vec![0.0; parameters]), |(sum, mut total), (value, gradient)| {
        total.iter_mut().zip(gradient).for_each(|(total, g)| *total += g);
        (sum + value, total)
    })
}

/// Work arrays of one thread.
#[derive(Debug)]
struct Conditional {
    scratch: Scratch,
    /// Derivatives of kernel values: of each pair of samples, of each sample with the point, of the point with
    /// itself.
    pairs: Vec<f64>,
    point: Vec<f64>,
    own: Vec<f64>,
    /// Coefficients of the samples in the mean of the point.
    coefficients: Vec<f64>,
    /// `K^-1 y` of one channel, and its sum over the channels times residual over variance.
    weights: Vec<f64>,
    side: Vec<f64>,
}

impl Conditional {
    fn new(count: usize, parameters: usize) -> Self {
        Self {
            scratch: Scratch::new(count),
            pairs: vec![0.0; count * (count + 1) / 2 * parameters],
            point: vec![0.0; count * parameters],
            own: vec![0.0; parameters],
            coefficients: vec![0.0; count],
            weights: vec![0.0; count],
            side: vec![0.0; count],
        }
    }

    /// The log density of the targets of sample `i` given those of the samples `given`, summed over the
    /// channels; its derivatives are added to `gradient`.
    ///
    /// With coefficients `b = K^-1 k`, variance `v` and residual `r = y - b^T y_given`, for a parameter `p`
    /// and `q = dk - dK b`: `dr = -q^T K^-1 y_given` and `dv = dk_ii - b^T dk - b^T q`.
    fn log_density(
        &mut self,
        process: &Process<'_>,
        targets: &Targets<'_>,
        i: usize,
        given: &[u32],
        gradient: &mut [f64],
    ) -> f64 {
        let (m, parameters) = (given.len(), process.n_parameters());
        let at = |a: usize| given[a] as usize;
        // A pair and its place in the lower triangle.
        let place = |a: usize, b: usize| (a * (a + 1) / 2 + b) * parameters;
        let (pairs, with_point) = (&mut self.pairs, &mut self.point);
        let (coefficients, explained) = self.scratch.explain(
            m,
            |a, b| {
                let out = &mut pairs[place(a, b)..place(a, b) + parameters];
                process.gradient(at(a), at(b), out)
            },
            |a| process.diagonal(at(a)),
            |a| {
                let out = &mut with_point[a * parameters..(a + 1) * parameters];
                process.gradient(at(a), i, out)
            },
        );
        self.coefficients[..m].copy_from_slice(coefficients);
        let b = &self.coefficients[..m];
        process.gradient(i, i, &mut self.own);
        let variance = (process.diagonal(i) - explained).max(process.least_variance(i));
        let channels = targets.y.len() as f64;
        let mut density = -0.5 * channels * (std::f64::consts::TAU * variance).ln();
        let mut slope_of_variance = -0.5 * channels / variance;
        self.side[..m].fill(0.0);
        for y in targets.y {
            let weights = &mut self.weights[..m];
            weights.iter_mut().zip(given).for_each(|(w, &j)| *w = y[j as usize]);
            let residual = y[i] - b.iter().zip(&*weights).map(|(b, y)| b * y).sum::<f64>();
            density -= 0.5 * residual * residual / variance;
            slope_of_variance += 0.5 * (residual / variance).powi(2);
            self.scratch.solve(weights);
            for (side, w) in self.side.iter_mut().zip(weights) {
                *side += residual / variance * *w;
            }
        }
        let Some((of_noise, of_kernel)) = gradient.split_last_mut() else { return density };
        // What multiplies q in the derivative of the density.
        let of_q = |a: usize| self.side[a] - slope_of_variance * b[a];
        for (out, own) in of_kernel.iter_mut().zip(&self.own) {
            *out += slope_of_variance * own;
        }
        *of_noise += slope_of_variance * targets.shared_noise[i];
        for a in 0..m {
            process.gradient(at(a), at(a), &mut self.pairs[place(a, a)..place(a, a) + parameters]);
            for l in 0..=a {
                // -dK_al multiplies q_a b_l and q_l b_a.
                let weight = if l == a { of_q(a) * b[a] } else { of_q(a) * b[l] + of_q(l) * b[a] };
                let pair = &self.pairs[place(a, l)..place(a, l) + parameters];
                for (out, d) in of_kernel.iter_mut().zip(pair) {
                    *out -= weight * d;
                }
            }
            let weight = of_q(a) - slope_of_variance * b[a];
            for (out, d) in of_kernel.iter_mut().zip(&self.point[a * parameters..(a + 1) * parameters]) {
                *out += weight * d;
            }
            *of_noise -= of_q(a) * b[a] * targets.shared_noise[given[a] as usize];
        }
        density
    }
}
