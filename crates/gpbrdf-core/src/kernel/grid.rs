//! Kernels between two sets of points on a line, in vector instructions.

use super::axis::{Kernel1d, Term1d};
use super::shape::Shape;
use crate::base::simd::{exp_slice, vectorized};

/// Largest exponent, on either side of the middle, for which a separated exponential is in range.
const LARGEST_EXPONENT: f64 = 600.0;

/// Work arrays of [`Kernel1d::fill_grid`].
#[derive(Debug, Default)]
pub(crate) struct GridScratch {
    /// `exp(scale (x - middle))` and its inverse, at the points and at the nodes.
    rising: Vec<f64>,
    falling: Vec<f64>,
    node_rising: Vec<f64>,
    node_falling: Vec<f64>,
    /// The values of one term.
    term: Vec<f64>,
}

impl Kernel1d {
    /// Writes `k(|point - node|)` to `out[node][point]`.
    ///
    /// The Matern shapes of half-integer order need no exponential per pair: `exp(-s |x - y|)` is the smaller
    /// of `exp(-s x) exp(s y)` and `exp(s x) exp(-s y)`, within 1e-13.
    pub(crate) fn fill_grid(
        &self,
        points: &[f64],
        nodes: &[f64],
        scratch: &mut GridScratch,
        out: &mut [f64],
    ) {
        debug_assert_eq!(out.len(), points.len() * nodes.len());
        if let [term] = self.terms.as_slice() {
            fill_term(term, points, nodes, scratch, out);
            return;
        }
        out.fill(0.0);
        let mut values = std::mem::take(&mut scratch.term);
        values.resize(out.len(), 0.0);
        for term in &self.terms {
            fill_term(term, points, nodes, scratch, &mut values);
            out.iter_mut().zip(&values).for_each(|(sum, value)| *sum += value);
        }
        scratch.term = values;
    }
}

fn fill_term(term: &Term1d, points: &[f64], nodes: &[f64], scratch: &mut GridScratch, out: &mut [f64]) {
    if points.is_empty() {
        return;
    }
    // sqrt(2 nu), and the coefficients of the polynomial in s.
    let (root, coefficients) = match term.shape {
        Shape::Matern12 => (1.0, [1.0, 0.0, 0.0]),
        Shape::Matern32 => (3f64.sqrt(), [1.0, 1.0, 0.0]),
        Shape::Matern52 => (5f64.sqrt(), [1.0, 1.0, 1.0 / 3.0]),
        _ => return fill_generic(term, points, nodes, out),
    };
    let scale = root / term.length_scale;
    let range = |values: &[f64]| {
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)))
    };
    let ((a, b), (c, d)) = (range(points), range(nodes));
    let (low, high) = (a.min(c), b.max(d));
    // The condition also sends NaN to the generic form.
    if !(0.5 * scale * (high - low) < LARGEST_EXPONENT) {
        return fill_generic(term, points, nodes, out);
    }
    let middle = 0.5 * (low + high);
    let exponentials = |x: &[f64], sign: f64, out: &mut Vec<f64>| {
        out.clear();
        out.extend(x.iter().map(|x| sign * scale * (x - middle)));
        exp_slice(out);
    };
    exponentials(points, 1.0, &mut scratch.rising);
    exponentials(points, -1.0, &mut scratch.falling);
    exponentials(nodes, 1.0, &mut scratch.node_rising);
    exponentials(nodes, -1.0, &mut scratch.node_falling);
    let polynomial = coefficients.map(|c| term.weight * c);
    vectorized(
        #[inline(always)]
        || separated(points, nodes, scratch, scale, polynomial, out),
    );
}

#[inline(always)]
fn separated(
    points: &[f64],
    nodes: &[f64],
    scratch: &GridScratch,
    scale: f64,
    polynomial: [f64; 3],
    out: &mut [f64],
) {
    let [p0, p1, p2] = polynomial;
    let count = points.len();
    let (rising, falling) = (&scratch.rising[..count], &scratch.falling[..count]);
    for (j, out) in out.chunks_exact_mut(count).enumerate() {
        let (node, up, down) = (nodes[j], scratch.node_rising[j], scratch.node_falling[j]);
        for i in 0..count {
            let s = scale * (points[i] - node).abs();
            let (a, b) = (falling[i] * up, rising[i] * down);
            let e = if a < b { a } else { b };
            out[i] = (p0 + s * (p1 + s * p2)) * e;
        }
    }
}

fn fill_generic(term: &Term1d, points: &[f64], nodes: &[f64], out: &mut [f64]) {
    let scale = term.length_scale.recip();
    for (out, node) in out.chunks_exact_mut(points.len()).zip(nodes) {
        for (out, point) in out.iter_mut().zip(points) {
            *out = ((point - node) * scale).powi(2);
        }
    }
    term.shape.fill(out);
    if term.weight != 1.0 {
        out.iter_mut().for_each(|k| *k *= term.weight);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_agree_with_single_values() {
        let points: Vec<f64> = (0..90).map(|i| f64::from(i) / 89.0).collect();
        let nodes: Vec<f64> = (0..32).map(|i| 0.97 * f64::from(i) / 31.0).collect();
        let term = |weight, shape, length_scale| Term1d { weight, shape, length_scale };
        let sum =
            vec![term(1.0, Shape::Matern52, 0.7), term(0.4, Shape::RationalQuadratic { alpha: 1.4 }, 0.2)];
        let single = |shape, length_scale| vec![term(1.3, shape, length_scale)];
        for terms in [
            single(Shape::Matern12, 0.3),
            single(Shape::Matern32, 0.02),
            single(Shape::Matern52, 0.05),
            single(Shape::Matern52, 1e-4),
            single(Shape::Matern52, 50.0),
            single(Shape::SquaredExponential, 0.2),
            single(Shape::Matern { nu: 0.8 }, 0.2),
            sum,
        ] {
            let kernel = Kernel1d { terms };
            let mut out = vec![0.0; points.len() * nodes.len()];
            kernel.fill_grid(&points, &nodes, &mut GridScratch::default(), &mut out);
            for (j, node) in nodes.iter().enumerate() {
                for (i, point) in points.iter().enumerate() {
                    let expected = kernel.value((point - node).abs());
                    let found = out[j * points.len() + i];
                    assert!(
                        (found - expected).abs() <= 2e-13 * expected + 1e-40,
                        "{kernel:?} {found:e} {expected:e}"
                    );
                }
            }
        }
    }
}
