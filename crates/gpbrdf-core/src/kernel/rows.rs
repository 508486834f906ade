//! Kernels between one point and a run of points, one strip at a time, so that all work arrays stay in the
//! first cache.

use std::ops::Range;

use super::axis::Kernel1d;
use super::composite::{AxisMetric, Kernel, KernelBody, KernelTerm};
use crate::base::simd::{add_scaled, dot, dot3, multiply, scale_into, vectorized};

/// Number of points of a strip.
const STRIP: usize = 512;

/// Points of dimension `d`, stored as one array per coordinate. An angle is stored as its sine and cosine.
#[derive(Clone, Debug)]
pub(crate) struct Points {
    len: usize,
    axes: Vec<AxisPoints>,
}

#[derive(Clone, Debug)]
enum AxisPoints {
    Linear(Vec<f64>),
    Chord { sin: Vec<f64>, cos: Vec<f64> },
}

impl Points {
    /// Points from row-major `x`: `n` rows of `metric.len()` coordinates.
    pub(crate) fn new(x: &[f64], metric: &[AxisMetric]) -> Self {
        let dimension = metric.len().max(1);
        let column = |k: usize| x.iter().skip(k).step_by(dimension);
        let axes = metric
            .iter()
            .enumerate()
            .map(|(k, metric)| match metric {
                AxisMetric::Linear => AxisPoints::Linear(column(k).copied().collect()),
                AxisMetric::Chord => AxisPoints::Chord {
                    sin: column(k).map(|x| x.sin()).collect(),
                    cos: column(k).map(|x| x.cos()).collect(),
                },
            })
            .collect();
        Self { len: x.len() / dimension, axes }
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Squared distances along axis `k` between the points of `range` and point `j` of `other`.
    fn squared_distances(&self, k: usize, range: Range<usize>, other: &Self, j: usize, out: &mut [f64]) {
        match (&self.axes[k], &other.axes[k]) {
            (AxisPoints::Linear(x), AxisPoints::Linear(y)) => {
                let (x, y) = (&x[range], y[j]);
                vectorized(|| {
                    for (o, x) in out.iter_mut().zip(x) {
                        *o = (x - y) * (x - y);
                    }
                });
            }
            // sin(x - y) = sin x cos y - cos x sin y.
            (AxisPoints::Chord { sin, cos }, AxisPoints::Chord { sin: sin_y, cos: cos_y }) => {
                let (sin, cos, sin_y, cos_y) = (&sin[range.clone()], &cos[range], sin_y[j], cos_y[j]);
                vectorized(|| {
                    for ((o, s), c) in out.iter_mut().zip(sin).zip(cos) {
                        let d = s * cos_y - c * sin_y;
                        *o = d * d;
                    }
                });
            }
            _ => unreachable!("both sets of points are made with one kernel's metric"),
        }
    }
}

/// Work arrays of one thread.
#[derive(Debug)]
pub(crate) struct RowScratch {
    /// Squared distances along each axis.
    d2: Vec<[f64; STRIP]>,
    /// Values of each axis's factor of a product.
    factors: Vec<[f64; STRIP]>,
    r2: [f64; STRIP],
    value: [f64; STRIP],
    slope: [f64; STRIP],
    weights: [f64; STRIP],
}

impl RowScratch {
    pub(crate) fn new(dimension: usize) -> Self {
        let strip = [0.0; STRIP];
        Self {
            d2: vec![strip; dimension],
            factors: vec![strip; dimension],
            r2: strip,
            value: strip,
            slope: strip,
            weights: strip,
        }
    }
}

impl Kernel {
    /// `out[i] = k(points[rows.start + i], other[j])`; `out` has the length of `rows`.
    pub(crate) fn row(
        &self,
        points: &Points,
        rows: Range<usize>,
        other: &Points,
        j: usize,
        scratch: &mut RowScratch,
        out: &mut [f64],
    ) {
        for (strip, out) in out.chunks_mut(STRIP).enumerate() {
            let start = rows.start + strip * STRIP;
            let n = out.len();
            for (k, d2) in scratch.d2.iter_mut().enumerate() {
                points.squared_distances(k, start..start + n, other, j, &mut d2[..n]);
            }
            out.fill(0.0);
            for term in &self.terms {
                match &term.body {
                    KernelBody::Ard { shape, length_scale } => {
                        scratch.joint_distances(length_scale, n);
                        shape.fill(&mut scratch.r2[..n]);
                        add_scaled(term.variance, &scratch.r2[..n], out);
                    }
                    KernelBody::Product(axes) => {
                        scratch.fill_factors(axes, n);
                        scratch.value[..n].fill(term.variance);
                        for factor in &scratch.factors {
                            multiply(&factor[..n], &mut scratch.value[..n]);
                        }
                        add_scaled(1.0, &scratch.value[..n], out);
                    }
                }
            }
        }
    }

    /// Adds `sum_i weights[i] dk(points[rows.start + i], points[j])/dp` to `gradient[p]` for every
    /// log-parameter `p`.
    pub(crate) fn add_row_gradient(
        &self,
        points: &Points,
        rows: Range<usize>,
        j: usize,
        weights: &[f64],
        scratch: &mut RowScratch,
        gradient: &mut [f64],
    ) {
        for (strip, weights) in weights.chunks(STRIP).enumerate() {
            let start = rows.start + strip * STRIP;
            let n = weights.len();
            for (k, d2) in scratch.d2.iter_mut().enumerate() {
                points.squared_distances(k, start..start + n, points, j, &mut d2[..n]);
            }
            let mut first = 0;
            for term in &self.terms {
                first += scratch.add_term_gradient(term, weights, &mut gradient[first..]);
            }
        }
    }
}

impl RowScratch {
    /// Computes `r2 = sum_k d_k^2 / l_k^2`.
    fn joint_distances(&mut self, length_scale: &[f64], n: usize) {
        for (k, (d2, l)) in self.d2.iter().zip(length_scale).enumerate() {
            if k == 0 {
                scale_into((l * l).recip(), &d2[..n], &mut self.r2[..n]);
            } else {
                add_scaled((l * l).recip(), &d2[..n], &mut self.r2[..n]);
            }
        }
    }

    /// Computes the kernel of every axis.
    fn fill_factors(&mut self, axes: &[Kernel1d], n: usize) {
        for ((axis, d2), factor) in axes.iter().zip(&self.d2).zip(&mut self.factors) {
            factor[..n].fill(0.0);
            for term in &axis.terms {
                scale_into((term.length_scale * term.length_scale).recip(), &d2[..n], &mut self.r2[..n]);
                term.shape.fill(&mut self.r2[..n]);
                add_scaled(term.weight, &self.r2[..n], &mut factor[..n]);
            }
        }
    }

    /// Adds the derivatives with respect to the log-parameters of one term. Returns their number.
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
                self.joint_distances(length_scale, n);
                shape.fill_with_slope(&self.r2[..n], &mut self.value[..n], &mut self.slope[..n]);
                add(variance * dot(weights, &self.value[..n]));
                for (d2, l) in self.d2.iter().zip(length_scale) {
                    add(variance / (l * l) * dot3(weights, &self.slope[..n], &d2[..n]));
                }
                if shape.has_alpha() {
                    let products = self.r2[..n].iter().zip(weights).map(|(r2, w)| w * shape.d_log_alpha(*r2));
                    add(variance * products.sum::<f64>());
                }
            }
            KernelBody::Product(axes) => {
                self.fill_factors(axes, n);
                for (k, axis) in axes.iter().enumerate() {
                    scale_into(variance, weights, &mut self.weights[..n]);
                    for (_, factor) in self.factors.iter().enumerate().filter(|(j, _)| *j != k) {
                        multiply(&factor[..n], &mut self.weights[..n]);
                    }
                    let others = &self.weights[..n];
                    if k == 0 {
                        add(dot(others, &self.factors[0][..n]));
                    }
                    for (m, term) in axis.terms.iter().enumerate() {
                        let inverse = (term.length_scale * term.length_scale).recip();
                        scale_into(inverse, &self.d2[k][..n], &mut self.r2[..n]);
                        let (value, slope) = (&mut self.value[..n], &mut self.slope[..n]);
                        term.shape.fill_with_slope(&self.r2[..n], value, slope);
                        if m > 0 {
                            add(term.weight * dot(others, value));
                        }
                        add(term.weight * dot3(others, slope, &self.r2[..n]));
                        if term.shape.has_alpha() {
                            let pairs = self.r2[..n].iter().zip(others);
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
    fn rows_and_their_gradients_match_single_pairs() {
        let n = STRIP + 37;
        let x: Vec<f64> = (0..3 * n).map(|i| (0.618_033_988_749_895 * i as f64).fract() * 1.5).collect();
        let weights: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
        for kernel in test_kernels() {
            let points = Points::new(&x, &kernel.metric);
            assert_eq!(points.len(), n);
            let mut scratch = RowScratch::new(3);
            let (start, j) = (2, 5);
            let mut row = vec![0.0; n - start];
            kernel.row(&points, start..n, &points, j, &mut scratch, &mut row);
            let mut gradient = vec![0.0; kernel.n_parameters()];
            kernel.add_row_gradient(&points, start..n, j, &weights[start..], &mut scratch, &mut gradient);

            let mut expected = vec![0.0; gradient.len()];
            let mut pair = expected.clone();
            for i in start..n {
                let value = kernel.gradient(&x[3 * i..3 * i + 3], &x[3 * j..3 * j + 3], &mut pair);
                assert!((row[i - start] - value).abs() < 1e-14, "{}: {value}", kernel.name());
                expected.iter_mut().zip(&pair).for_each(|(e, p)| *e += weights[i] * p);
            }
            for (name, (g, e)) in kernel.parameter_names().iter().zip(gradient.iter().zip(&expected)) {
                assert!((g - e).abs() < 1e-11, "{} {name}: {g} {e}", kernel.name());
            }
        }
    }
}
