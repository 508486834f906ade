//! Kernels between one point and a run of points, one strip at a time, so that all work arrays stay in the
//! first cache.

use std::ops::Range;

use rayon::prelude::*;

use super::axis::Kernel1d;
use super::composite::{AxisMetric, Kernel, KernelBody, KernelTerm};
use super::shape::Shape;
use crate::base::simd::{add_scaled, dot, dots, multiply, scale_into, vectorized};

/// Number of points of a strip.
pub(super) const STRIP: usize = 512;

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

    /// Writes the values of one ARD term between the points of `range` and point `j` of `other`, where there are three
    /// coordinates and all are linear; otherwise returns false.
    fn linear_term(
        &self,
        (variance, shape, length_scale): (f64, Shape, &[f64]),
        range: Range<usize>,
        other: &Self,
        j: usize,
        out: &mut [f64],
    ) -> bool {
        use AxisPoints::Linear;
        let ([Linear(x0), Linear(x1), Linear(x2)], [Linear(y0), Linear(y1), Linear(y2)]) =
            (&self.axes[..], &other.axes[..])
        else {
            return false;
        };
        let from = [&x0[range.clone()], &x1[range.clone()], &x2[range]];
        let scales = [0, 1, 2].map(|k: usize| (length_scale[k] * length_scale[k]).recip());
        shape.fill_between(variance, from, [y0[j], y1[j], y2[j]], scales, out);
        true
    }

    /// Squared distances along axis `k` from the points of `range` to point `j` of `other`.
    pub(super) fn squared_distances(
        &self,
        k: usize,
        range: Range<usize>,
        other: &Self,
        j: usize,
        out: &mut [f64],
    ) {
        match (&self.axes[k], &other.axes[k]) {
            (AxisPoints::Linear(x), AxisPoints::Linear(y)) => {
                let (x, y) = (&x[range], y[j]);
                vectorized(
                    #[inline(always)]
                    || {
                        for (o, x) in out.iter_mut().zip(x) {
                            *o = (x - y) * (x - y);
                        }
                    },
                );
            }
            // sin(x - y) = sin x cos y - cos x sin y.
            (AxisPoints::Chord { sin, cos }, AxisPoints::Chord { sin: sin_y, cos: cos_y }) => {
                let (sin, cos, sin_y, cos_y) = (&sin[range.clone()], &cos[range], sin_y[j], cos_y[j]);
                vectorized(
                    #[inline(always)]
                    || {
                        for ((o, s), c) in out.iter_mut().zip(sin).zip(cos) {
                            let d = s * cos_y - c * sin_y;
                            *o = d * d;
                        }
                    },
                );
            }
            _ => unreachable!("both sets of points are made with one kernel's metric"),
        }
    }
}

/// Work arrays of one thread.
#[derive(Debug)]
pub(crate) struct RowScratch {
    /// Squared distances along each axis.
    pub(super) d2: Vec<[f64; STRIP]>,
    /// Values of each axis' factor of a product.
    pub(super) factors: Vec<[f64; STRIP]>,
    pub(super) r2: [f64; STRIP],
    pub(super) value: [f64; STRIP],
}

impl RowScratch {
    pub(crate) fn new(dimension: usize) -> Self {
        let strip = [0.0; STRIP];
        Self { d2: vec![strip; dimension], factors: vec![strip; dimension], r2: strip, value: strip }
    }
}

/// Number of points whose kernel sums one parallel task computes.
const SUM_BLOCK: usize = 64;

impl Kernel {
    /// `sum_i weights_ic k(x_j, points_i)` at every point `x_j` of `at`: rows with one value per channel.
    /// `weights` has one column of the length of `points` per channel. Cost: one kernel value for each pair.
    pub(crate) fn weighted_sums(&self, points: &Points, weights: &[f64], at: &Points) -> Vec<f64> {
        let n = points.len();
        let channels = weights.len() / n;
        let mut out = vec![0.0; at.len() * channels];
        out.par_chunks_mut(SUM_BLOCK * channels).enumerate().for_each_init(
            || RowScratch::new(self.dimension()),
            |scratch, (block, out)| {
                let mut row = [0.0; STRIP];
                // One strip of points after the other, so that it is in the first cache for the whole block.
                for start in (0..n).step_by(STRIP) {
                    let strip = start..n.min(start + STRIP);
                    let row = &mut row[..strip.len()];
                    for (out, j) in out.chunks_mut(channels).zip(block * SUM_BLOCK..) {
                        self.row(points, strip.clone(), at, j, scratch, row);
                        let column = |c: usize| &weights[c * n..(c + 1) * n][strip.clone()];
                        if let [a, b, c] = out {
                            let sums = dots(row, [column(0), column(1), column(2)]);
                            (*a, *b, *c) = (*a + sums[0], *b + sums[1], *c + sums[2]);
                        } else {
                            out.iter_mut().enumerate().for_each(|(c, out)| *out += dot(row, column(c)));
                        }
                    }
                }
            },
        );
        out
    }

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
            // One ARD term of three linear coordinates is what scattered samples have: everything in one pass.
            if let [KernelTerm { variance, body: KernelBody::Ard { shape, length_scale } }] = &self.terms[..]
                && points.linear_term((*variance, *shape, length_scale), start..start + n, other, j, out)
            {
                continue;
            }
            for (k, d2) in scratch.d2.iter_mut().enumerate() {
                points.squared_distances(k, start..start + n, other, j, &mut d2[..n]);
            }
            self.values_at_distances(scratch, out);
        }
    }

    /// The kernel at the squared distances along each axis in `scratch`, of which there are as many as elements of
    /// `out`, at most those of a strip.
    pub(super) fn values_at_distances(&self, scratch: &mut RowScratch, out: &mut [f64]) {
        let n = out.len();
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

impl RowScratch {
    /// `r2 = sum_k d_k^2 / l_k^2`.
    pub(super) fn joint_distances(&mut self, length_scale: &[f64], n: usize) {
        for (k, (d2, l)) in self.d2.iter().zip(length_scale).enumerate() {
            if k == 0 {
                scale_into((l * l).recip(), &d2[..n], &mut self.r2[..n]);
            } else {
                add_scaled((l * l).recip(), &d2[..n], &mut self.r2[..n]);
            }
        }
    }

    /// The kernel of every axis.
    pub(super) fn fill_factors(&mut self, axes: &[Kernel1d], n: usize) {
        for ((axis, d2), factor) in axes.iter().zip(&self.d2).zip(&mut self.factors) {
            factor[..n].fill(0.0);
            for term in &axis.terms {
                scale_into((term.length_scale * term.length_scale).recip(), &d2[..n], &mut self.r2[..n]);
                term.shape.fill(&mut self.r2[..n]);
                add_scaled(term.weight, &self.r2[..n], &mut factor[..n]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_kernels;
    use super::*;

    #[test]
    fn rows_match_single_pairs() {
        let n = STRIP + 37;
        let x: Vec<f64> = (0..3 * n).map(|i| (0.618_033_988_749_895 * i as f64).fract() * 1.5).collect();
        for kernel in test_kernels() {
            let points = Points::new(&x, &kernel.metric);
            assert_eq!(points.len(), n);
            let mut scratch = RowScratch::new(3);
            let (start, j) = (2, 5);
            let mut row = vec![0.0; n - start];
            kernel.row(&points, start..n, &points, j, &mut scratch, &mut row);
            for i in start..n {
                let value = kernel.value(&x[3 * i..3 * i + 3], &x[3 * j..3 * j + 3]);
                assert!((row[i - start] - value).abs() < 1e-14, "{}: {value}", kernel.name());
            }
        }
    }
}
