//! Contractions of third-order tensors with one small matrix per axis.

use rayon::prelude::*;

use crate::base::linalg::{Matrix, View, product_into, product_into_slice, view, view_slice};

/// Applies `M_u (x) M_v (x) M_phi` to each of `channels` tensors.
///
/// `x` is `[channel][A][B][C]`, last index fastest, with `M_u` of shape `A' x A` and so on; the result is
/// `[channel][A'][B'][C']`. Costs `A B B' C + A B' C C' + A A' B' C'` multiply-adds per channel. Every
/// element is summed in one fixed order, so the result does not depend on the number of threads.
pub(crate) fn apply(matrices: [View<'_>; 3], x: &[f64], channels: usize) -> Vec<f64> {
    let [m_u, m_v, m_phi] = matrices;
    let [a_in, b_in, c_in] = matrices.map(|m| m.ncols());
    let [a_out, b_out, c_out] = matrices.map(|m| m.nrows());
    debug_assert_eq!(x.len(), channels * a_in * b_in * c_in);
    // Slabs of constant (channel, a): contract along v first, then along phi.
    let mut half = vec![0.0; channels * a_in * b_out * c_out];
    half.par_chunks_mut(b_out * c_out).zip(x.par_chunks(b_in * c_in)).for_each_init(
        || Matrix::zeros(c_in, b_out),
        |scratch, (out, slab)| {
            // A row-major B x C slab is a column-major C x B matrix.
            product_into(scratch, view_slice(slab, c_in, b_in), m_v.transpose());
            product_into_slice(out, m_phi, view(scratch));
        },
    );
    // Then along u: one (B' C') x A matrix per channel, from which each task computes a few columns of the
    // result.
    let plane = b_out * c_out;
    let group = a_out.div_ceil(4).max(1);
    let mut out = vec![0.0; channels * a_out * plane];
    out.par_chunks_mut(a_out * plane).zip(half.par_chunks(a_in * plane)).for_each(|(out, half)| {
        let half = view_slice(half, plane, a_in);
        out.par_chunks_mut(group * plane).enumerate().for_each(|(i, out)| {
            let columns = out.len() / plane;
            let rows = m_u.subrows(i * group, columns);
            product_into_slice(out, half, rows.transpose());
        });
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::SplitMix64;

    fn random(rows: usize, columns: usize, random: &mut SplitMix64) -> Matrix {
        Matrix::from_fn(rows, columns, |_, _| random.next_unit() - 0.5)
    }

    #[test]
    fn apply_agrees_with_the_sums_written_out() {
        let mut seed = SplitMix64::new(1);
        let (shape_in, shape_out, channels) = ([4, 3, 5], [6, 2, 3], 2);
        let matrices: [Matrix; 3] = std::array::from_fn(|k| random(shape_out[k], shape_in[k], &mut seed));
        let [a, b, c] = shape_in;
        let x: Vec<f64> = (0..channels * a * b * c).map(|_| seed.next_unit() - 0.5).collect();
        let at = |ch: usize, i: usize, j: usize, k: usize| x[((ch * a + i) * b + j) * c + k];
        let found = apply(matrices.each_ref().map(view), &x, channels);
        for ch in 0..channels {
            for (p, q, r) in itertools(shape_out) {
                let mut sum = 0.0;
                for (i, j, k) in itertools(shape_in) {
                    sum += matrices[0][(p, i)] * matrices[1][(q, j)] * matrices[2][(r, k)] * at(ch, i, j, k);
                }
                let value = found[((ch * shape_out[0] + p) * shape_out[1] + q) * shape_out[2] + r];
                assert!((value - sum).abs() < 1e-14);
            }
        }
    }

    fn itertools(shape: [usize; 3]) -> impl Iterator<Item = (usize, usize, usize)> {
        (0..shape.iter().product())
            .map(move |i| (i / (shape[1] * shape[2]), i / shape[2] % shape[1], i % shape[2]))
    }
}
