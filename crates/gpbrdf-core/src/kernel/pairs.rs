//! Kernels between all pairs of a few points, in vector instructions.

use super::composite::{AxisMetric, Kernel};
#[cfg(feature = "fit")]
use super::row_gradient::GradientScratch;
use super::rows::{RowScratch, STRIP};
use crate::base::simd::vectorized;

/// Squared distances between all pairs of a few points, and work arrays.
///
/// Pairs `(a, b)` with `a < b` are packed in rows: all with `a = 0`, then all with `a = 1`, and so on.
#[derive(Debug)]
pub(crate) struct Pairs {
    /// The number of points.
    len: usize,
    /// Coordinates, one array per axis.
    x: Vec<Vec<f64>>,
    /// Squared distances along each axis, packed.
    d2: Vec<Vec<f64>>,
    #[cfg(feature = "fit")]
    scratch: GradientScratch,
    #[cfg(not(feature = "fit"))]
    scratch: RowScratch,
}

/// The number of pairs of `len` points.
fn n_pairs(len: usize) -> usize {
    len * len.saturating_sub(1) / 2
}

impl Pairs {
    pub(crate) fn new(dimension: usize) -> Self {
        Self {
            len: 0,
            x: vec![Vec::new(); dimension],
            d2: vec![Vec::new(); dimension],
            #[cfg(feature = "fit")]
            scratch: GradientScratch::new(dimension),
            #[cfg(not(feature = "fit"))]
            scratch: RowScratch::new(dimension),
        }
    }

    /// Takes the distances of the pairs of these points, rows of coordinates.
    pub(crate) fn take<'a>(&mut self, points: impl Iterator<Item = &'a [f64]>, metric: &[AxisMetric]) {
        self.x.iter_mut().for_each(Vec::clear);
        for point in points {
            self.x.iter_mut().zip(point).for_each(|(column, x)| column.push(*x));
        }
        self.len = self.x.first().map_or(0, Vec::len);
        for ((x, d2), metric) in self.x.iter().zip(&mut self.d2).zip(metric) {
            d2.resize(n_pairs(x.len()), 0.0);
            match metric {
                AxisMetric::Linear => squared_differences(x, d2),
                AxisMetric::Chord => {
                    let pairs =
                        x.iter().enumerate().flat_map(|(a, p)| x[a + 1..].iter().map(move |q| (p, q)));
                    let squares = pairs.map(|(p, q)| metric.distance(*p, *q).powi(2));
                    d2.iter_mut().zip(squares).for_each(|(out, d2)| *out = d2);
                }
            }
        }
    }

    /// The kernel of every pair, packed.
    pub(crate) fn values(&mut self, kernel: &Kernel, out: &mut Vec<f64>) {
        out.resize(n_pairs(self.len), 0.0);
        for (start, out) in (0..).step_by(STRIP).zip(out.chunks_mut(STRIP)) {
            kernel.values_at_distances(self.strip(start, out.len()), out);
        }
    }

    /// Adds `sum_i weights[i] dk_i/dp` over all pairs `i`, packed, to `gradient[p]` for every log-parameter `p`.
    #[cfg(feature = "fit")]
    pub(crate) fn add_gradient(&mut self, kernel: &Kernel, weights: &[f64], gradient: &mut [f64]) {
        for (start, weights) in (0..).step_by(STRIP).zip(weights.chunks(STRIP)) {
            self.strip(start, weights.len());
            kernel.add_gradient_at_distances(weights, &mut self.scratch, gradient);
        }
    }

    /// The work arrays of rows, with the distances of `n` pairs from `start` on.
    fn strip(&mut self, start: usize, n: usize) -> &mut RowScratch {
        #[cfg(feature = "fit")]
        let row = &mut self.scratch.row;
        #[cfg(not(feature = "fit"))]
        let row = &mut self.scratch;
        for (to, from) in row.d2.iter_mut().zip(&self.d2) {
            to[..n].copy_from_slice(&from[start..start + n]);
        }
        row
    }
}

/// The squared differences of all pairs, packed.
fn squared_differences(x: &[f64], out: &mut [f64]) {
    vectorized(
        #[inline(always)]
        || {
            let mut rest = out;
            for (a, p) in x.iter().enumerate() {
                let others = &x[a + 1..];
                let (row, next) = rest.split_at_mut(others.len());
                for (out, q) in row.iter_mut().zip(others) {
                    *out = (p - q) * (p - q);
                }
                rest = next;
            }
        },
    );
}

#[cfg(all(test, feature = "fit"))]
mod tests {
    use super::super::test_kernels;
    use super::*;

    #[test]
    fn pairs_have_the_values_and_gradients_of_the_kernel() {
        // More pairs than fit into one strip.
        let n = 37;
        let x: Vec<f64> = (0..3 * n).map(|i| (0.618_033_988_749_895 * i as f64).fract() * 1.5).collect();
        let weights: Vec<f64> = (0..n_pairs(n)).map(|i| (i as f64).sin()).collect();
        assert!(weights.len() > STRIP);
        for kernel in test_kernels() {
            let mut pairs = Pairs::new(3);
            // Fewer points before leave nothing behind.
            pairs.take(x[..60].chunks(3), &kernel.metric);
            pairs.take(x.chunks(3), &kernel.metric);
            let mut values = Vec::new();
            pairs.values(&kernel, &mut values);
            let mut gradient = vec![0.0; kernel.n_parameters()];
            pairs.add_gradient(&kernel, &weights, &mut gradient);
            let (mut expected, mut pair) = (vec![0.0; gradient.len()], vec![0.0; gradient.len()]);
            let mut at = 0;
            for a in 0..n {
                for b in a + 1..n {
                    let value = kernel.gradient(&x[3 * a..3 * a + 3], &x[3 * b..3 * b + 3], &mut pair);
                    assert!((values[at] - value).abs() < 1e-14, "{}: {value}", kernel.name());
                    expected.iter_mut().zip(&pair).for_each(|(e, p)| *e += weights[at] * p);
                    at += 1;
                }
            }
            assert_eq!(values.len(), at);
            for (g, e) in gradient.iter().zip(&expected) {
                assert!((g - e).abs() < 1e-11, "{}: {g} {e}", kernel.name());
            }
        }
    }
}
