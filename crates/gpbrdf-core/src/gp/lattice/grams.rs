//! Inner products of the slices of third-order tensors.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;

/// For each axis, the matrix of inner products of a tensor's slices, weighted along the other two axes:
/// `G_u[a, a'] = sum_bc w_v[b] w_phi[c] x[a, b, c] x[a', b, c]`, and likewise for `v` and `phi`, summed over
/// the channels. `roots` holds the square roots of the weights along each axis.
pub(crate) fn weighted_grams(roots: [&[f64]; 3], x: &[f64], channels: usize) -> [Mat<f64>; 3] {
    let [a, b, c] = roots.map(<[f64]>::len);
    let mut tasks: Vec<(usize, &[f64])> = Vec::with_capacity(3 * channels);
    for axis in 0..3 {
        tasks.extend(x.chunks(a * b * c).map(|tensor| (axis, tensor)));
    }
    let partial: Vec<Mat<f64>> = tasks
        .into_par_iter()
        .map(|(axis, tensor)| {
            let size = [a, b, c][axis];
            let mut gram = Mat::zeros(size, size);
            let mut scaled = tensor.to_vec();
            for (i, plane) in scaled.chunks_mut(b * c).enumerate() {
                let s_u = if axis == 0 { 1.0 } else { roots[0][i] };
                for (j, row) in plane.chunks_mut(c).enumerate() {
                    let s_uv = if axis == 1 { s_u } else { s_u * roots[1][j] };
                    if axis == 2 {
                        row.iter_mut().for_each(|x| *x *= s_uv);
                    } else {
                        row.iter_mut().zip(roots[2]).for_each(|(x, s_phi)| *x *= s_uv * s_phi);
                    }
                }
            }
            match axis {
                0 => {
                    let m = MatRef::from_column_major_slice(&scaled, b * c, a);
                    matmul(gram.as_mut(), Accum::Replace, m.transpose(), m, 1.0, Par::Seq);
                }
                1 => {
                    for plane in scaled.chunks(b * c) {
                        let m = MatRef::from_column_major_slice(plane, c, b);
                        matmul(gram.as_mut(), Accum::Add, m.transpose(), m, 1.0, Par::Seq);
                    }
                }
                _ => {
                    let m = MatRef::from_column_major_slice(&scaled, c, a * b);
                    matmul(gram.as_mut(), Accum::Replace, m, m.transpose(), 1.0, Par::Seq);
                }
            }
            gram
        })
        .collect();
    let mut sums = [Mat::zeros(a, a), Mat::zeros(b, b), Mat::zeros(c, c)];
    for (i, gram) in partial.into_iter().enumerate() {
        sums[i / channels] += gram;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::SplitMix64;

    #[test]
    fn grams_agree_with_the_sums_written_out() {
        let mut seed = SplitMix64::new(1);
        let (shape_in, channels) = ([4, 3, 5], 2);
        let [a, b, c] = shape_in;
        let x: Vec<f64> = (0..channels * a * b * c).map(|_| seed.next_unit() - 0.5).collect();
        let at = |ch: usize, i: usize, j: usize, k: usize| x[((ch * a + i) * b + j) * c + k];
        let weights: [Vec<f64>; 3] = shape_in.map(|n| (0..n).map(|_| seed.next_unit()).collect());
        let roots = weights.clone().map(|w| w.iter().map(|w| w.sqrt()).collect::<Vec<_>>());
        let grams = weighted_grams([&roots[0], &roots[1], &roots[2]], &x, channels);
        let mut expected = shape_in.map(|n| Mat::<f64>::zeros(n, n));
        for ch in 0..channels {
            for (i, j, k) in itertools(shape_in) {
                for m in 0..a {
                    expected[0][(i, m)] += weights[1][j] * weights[2][k] * at(ch, i, j, k) * at(ch, m, j, k);
                }
                for m in 0..b {
                    expected[1][(j, m)] += weights[0][i] * weights[2][k] * at(ch, i, j, k) * at(ch, i, m, k);
                }
                for m in 0..c {
                    expected[2][(k, m)] += weights[0][i] * weights[1][j] * at(ch, i, j, k) * at(ch, i, j, m);
                }
            }
        }
        for (found, expected) in grams.iter().zip(&expected) {
            assert!((found - expected).norm_max() < 1e-13);
        }
    }

    fn itertools(shape: [usize; 3]) -> impl Iterator<Item = (usize, usize, usize)> {
        (0..shape.iter().product())
            .map(move |i| (i / (shape[1] * shape[2]), i / shape[2] % shape[1], i % shape[2]))
    }
}
