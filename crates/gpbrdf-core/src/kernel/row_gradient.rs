//! Derivatives of kernels between one point and a run of points.

use std::ops::Range;

use super::composite::{Kernel, KernelBody, KernelTerm};
use super::rows::{Points, RowScratch, STRIP};
use crate::base::simd::{dot, dot3, multiply, scale_into};

/// Working arrays of one thread.
#[derive(Debug)]
pub(crate) struct GradientScratch {
    pub(super) row: RowScratch,
    slope: [f64; STRIP],
    weights: [f64; STRIP],
}

impl GradientScratch {
    pub(crate) fn new(dimension: usize) -> Self {
        Self { row: RowScratch::new(dimension), slope: [0.0; STRIP], weights: [0.0; STRIP] }
    }
}

impl Kernel {
    /// Adds `sum_i weights[i] dk(points[rows.start + i], points[j])/dp` to `gradient[p]` for every log-parameter
    /// `p`.
    pub(crate) fn add_row_gradient(
        &self,
        points: &Points,
        rows: Range<usize>,
        j: usize,
        weights: &[f64],
        scratch: &mut GradientScratch,
        gradient: &mut [f64],
    ) {
        for (strip, weights) in weights.chunks(STRIP).enumerate() {
            let start = rows.start + strip * STRIP;
            let n = weights.len();
            for (k, d2) in scratch.row.d2.iter_mut().enumerate() {
                points.squared_distances(k, start..start + n, points, j, &mut d2[..n]);
            }
            self.add_gradient_at_distances(weights, scratch, gradient);
        }
    }

    /// Adds `sum_i weights[i] dk_i/dp` to `gradient[p]`, where `k_i` is the kernel at the squared distances along each
    /// axis in `scratch`, at most those of a strip.
    pub(super) fn add_gradient_at_distances(
        &self,
        weights: &[f64],
        scratch: &mut GradientScratch,
        gradient: &mut [f64],
    ) {
        let mut first = 0;
        for term in &self.terms {
            first += scratch.add_term_gradient(term, weights, &mut gradient[first..]);
        }
    }
}

impl GradientScratch {
    /// Adds the derivatives by the log-parameters of one term; returns their number.
    fn add_term_gradient(&mut self, term: &KernelTerm, weights: &[f64], gradient: &mut [f64]) -> usize {
        let n = weights.len();
        let variance = term.variance;
        let mut next = 0;
        let mut add = |amount: f64| {
            gradient[next] += amount;
            next += 1;
        };
        match &term.body {
            KernelBody::Ard { shape, length_scale } => {
                self.row.joint_distances(length_scale, n);
                shape.fill_with_slope(&self.row.r2[..n], &mut self.row.value[..n], &mut self.slope[..n]);
                add(variance * dot(weights, &self.row.value[..n]));
                for (d2, l) in self.row.d2.iter().zip(length_scale) {
                    add(variance / (l * l) * dot3(weights, &self.slope[..n], &d2[..n]));
                }
                if shape.has_alpha() {
                    let products =
                        self.row.r2[..n].iter().zip(weights).map(|(r2, w)| w * shape.d_log_alpha(*r2));
                    add(variance * products.sum::<f64>());
                }
            }
            KernelBody::Product(axes) => {
                self.row.fill_factors(axes, n);
                for (k, axis) in axes.iter().enumerate() {
                    scale_into(variance, weights, &mut self.weights[..n]);
                    for (_, factor) in self.row.factors.iter().enumerate().filter(|(j, _)| *j != k) {
                        multiply(&factor[..n], &mut self.weights[..n]);
                    }
                    let others = &self.weights[..n];
                    if k == 0 {
                        add(dot(others, &self.row.factors[0][..n]));
                    }
                    for (m, term) in axis.terms.iter().enumerate() {
                        let inverse = (term.length_scale * term.length_scale).recip();
                        scale_into(inverse, &self.row.d2[k][..n], &mut self.row.r2[..n]);
                        let (value, slope) = (&mut self.row.value[..n], &mut self.slope[..n]);
                        term.shape.fill_with_slope(&self.row.r2[..n], value, slope);
                        if m > 0 {
                            add(term.weight * dot(others, value));
                        }
                        add(term.weight * dot3(others, slope, &self.row.r2[..n]));
                        if term.shape.has_alpha() {
                            let pairs = self.row.r2[..n].iter().zip(others);
                            let sum: f64 = pairs.map(|(r2, w)| w * term.shape.d_log_alpha(*r2)).sum();
                            add(term.weight * sum);
                        }
                    }
                }
            }
        }
        next
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_kernels;
    use super::*;

    #[test]
    fn gradients_of_rows_match_single_pairs() {
        let n = STRIP + 37;
        let x: Vec<f64> = (0..3 * n).map(|i| (0.618_033_988_749_895 * i as f64).fract() * 1.5).collect();
        let weights: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
        for kernel in test_kernels() {
            let points = Points::new(&x, &kernel.metric);
            let mut scratch = GradientScratch::new(3);
            let (start, j) = (2, 5);
            let mut gradient = vec![0.0; kernel.n_parameters()];
            kernel.add_row_gradient(&points, start..n, j, &weights[start..], &mut scratch, &mut gradient);

            let mut expected = vec![0.0; gradient.len()];
            let mut pair = expected.clone();
            for i in start..n {
                kernel.gradient(&x[3 * i..3 * i + 3], &x[3 * j..3 * j + 3], &mut pair);
                expected.iter_mut().zip(&pair).for_each(|(e, p)| *e += weights[i] * p);
            }
            for (name, (g, e)) in kernel.parameter_names().iter().zip(gradient.iter().zip(&expected)) {
                assert!((g - e).abs() < 1e-11, "{} {name}: {g} {e}", kernel.name());
            }
        }
    }
}
