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
    let blocks: Vec<(f64, Vec<f64>)> = subset
        .par_chunks(BLOCK)
        .map_init(
            || Conditional::new(process),
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
    /// What multiplies the derivative of each pair's covariance.
    pairs: Vec<f64>,
    /// Derivatives of the kernel between a point and itself.
    own: Vec<f64>,
    /// Coefficients of the samples in the mean of the point.
    coefficients: Vec<f64>,
    /// `K^-1 y` of one channel, and its sum over the channels times residual over variance.
    weights: Vec<f64>,
    side: Vec<f64>,
}

impl Conditional {
    fn new(process: &Process<'_>) -> Self {
        let mut own = vec![0.0; process.kernel.n_parameters()];
        let origin = vec![0.0; process.kernel.dimension()];
        process.kernel.gradient(&origin, &origin, &mut own);
        Self {
            scratch: Scratch::new(process.kernel),
            pairs: Vec::new(),
            own,
            coefficients: Vec::new(),
            weights: Vec::new(),
            side: Vec::new(),
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
        let m = given.len();
        self.scratch.covary(process, given, process.point(i));
        self.scratch.add_basis(process, given, i);
        let (b, explained) = self.scratch.explain(m, |a| process.diagonal(given[a] as usize));
        self.coefficients.clear();
        self.coefficients.extend_from_slice(b);
        let b = &self.coefficients;
        let variance = (process.diagonal(i) - explained).max(process.least_variance(i));
        let channels = targets.y.len() as f64;
        let mut density = -0.5 * channels * (std::f64::consts::TAU * variance).ln();
        let mut slope_of_variance = -0.5 * channels / variance;
        self.side.clear();
        self.side.resize(m, 0.0);
        for y in targets.y {
            self.weights.clear();
            self.weights.extend(given.iter().map(|&j| y[j as usize]));
            let residual = y[i] - b.iter().zip(&self.weights).map(|(b, y)| b * y).sum::<f64>();
            density -= 0.5 * residual * residual / variance;
            slope_of_variance += 0.5 * (residual / variance).powi(2);
            self.scratch.solve(&mut self.weights);
            for (side, w) in self.side.iter_mut().zip(&self.weights) {
                *side += residual / variance * *w;
            }
        }
        // What multiplies q in the derivative of the density.
        let of_q: &mut Vec<f64> = &mut self.side;
        of_q.iter_mut().zip(b).for_each(|(side, b)| *side -= slope_of_variance * b);
        self.pairs.clear();
        for a in 0..m {
            // -dK_al multiplies q_a b_l and q_l b_a.
            let others = of_q[a + 1..].iter().zip(&b[a + 1..]);
            self.pairs.extend(others.map(|(of_q_l, b_l)| -(of_q[a] * b_l + of_q_l * b[a])));
            self.pairs.push(of_q[a] - slope_of_variance * b[a]);
        }
        let Some((of_noise, of_process)) = gradient.split_last_mut() else { return density };
        let (of_kernel, of_basis) = of_process.split_at_mut(self.own.len());
        self.scratch.add_gradient(process.kernel, &self.pairs, of_kernel);
        let of_own: f64 = slope_of_variance - of_q.iter().zip(b).map(|(q, b)| q * b).sum::<f64>();
        for (out, own) in of_kernel.iter_mut().zip(&self.own) {
            *out += of_own * own;
        }
        *of_noise += slope_of_variance * targets.shared_noise[i];
        for ((of_q, b), &j) in of_q.iter().zip(b).zip(given) {
            *of_noise -= of_q * b * targets.shared_noise[j as usize];
        }
        if let Some(of_basis) = of_basis.first_mut() {
            *of_basis += self.of_basis(process, i, given, slope_of_variance);
        }
        density
    }

    /// The derivative of the log density with respect to the logarithm of the variance of the basis.
    fn of_basis(&self, process: &Process<'_>, i: usize, given: &[u32], slope_of_variance: f64) -> f64 {
        let row = |a: usize| process.basis.row(given.get(a).map_or(i, |&j| j as usize));
        let all = 0..=given.len();
        let pairs = all.clone().flat_map(|a| all.clone().skip(a + 1).map(move |b| (a, b)));
        let of_pairs =
            pairs.zip(&self.pairs).map(|((a, b), weight)| weight * process.in_basis(row(a), row(b)));
        let of_samples = self.side.iter().zip(&self.coefficients).enumerate();
        let of_samples = of_samples.map(|(a, (q, b))| q * b * process.in_basis(row(a), row(a)));
        slope_of_variance * process.in_basis(row(given.len()), row(given.len())) + of_pairs.sum::<f64>()
            - of_samples.sum::<f64>()
    }
}
