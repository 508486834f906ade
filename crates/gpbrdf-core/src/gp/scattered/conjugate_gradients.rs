//! Preconditioned conjugate gradients for several right-hand sides at once.

use super::product::Covariance;
use super::vecchia::InverseFactor;
use crate::base::error::{Error, Result};
use crate::base::simd::dot;

/// The search ends when every residual, measured by the preconditioner, is this small relative to its
/// right-hand side.
const TOLERANCE: f64 = 1e-3;

/// The largest number of products with the covariance.
const MOST_ITERATIONS: usize = 400;

/// How a solution was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Convergence {
    /// Number of products with the covariance.
    pub(super) iterations: usize,
    /// The largest residual of a channel relative to its right-hand side.
    pub(super) residual: f64,
}

/// Solves `K x = y` for the columns of `y`, each of length `n`, with all columns sharing every product.
/// `watch` is called before each product; an error that it returns ends the search.
///
/// Source: M. R. Hestenes and E. Stiefel, "Methods of Conjugate Gradients for Solving Linear Systems" (1952),
/// with the preconditioner of [`InverseFactor`]. Norms are `r^T M^-1 r`, which for a good preconditioner is the
/// squared error of the solution in the norm of `K`.
///
/// # Errors
/// A residual that is still above 1e-2 after 400 products, and the errors of `watch`.
pub(super) fn solve(
    covariance: &Covariance<'_>,
    preconditioner: &InverseFactor<'_>,
    y: &[f64],
    watch: &mut dyn FnMut(Convergence) -> Result<()>,
) -> Result<(Vec<f64>, Convergence)> {
    let n = covariance.points.len();
    let columns = y.len() / n;
    let (mut x, mut r) = (vec![0.0; y.len()], y.to_vec());
    let mut z = vec![0.0; y.len()];
    let precondition = |r: &[f64], z: &mut [f64]| {
        r.chunks(n).zip(z.chunks_mut(n)).for_each(|(r, z)| preconditioner.apply(r, z));
    };
    precondition(&r, &mut z);
    let mut p = z.clone();
    let mut kp = vec![0.0; y.len()];
    let energies =
        |r: &[f64], z: &[f64]| -> Vec<f64> { r.chunks(n).zip(z.chunks(n)).map(|(r, z)| dot(r, z)).collect() };
    let mut energy = energies(&r, &z);
    let start = energy.clone();
    let residual = |energy: &[f64]| {
        energy
            .iter()
            .zip(&start)
            .map(|(e, s)| if *s > 0.0 { (e / s).sqrt() } else { 0.0 })
            .fold(0.0, f64::max)
    };
    let mut best = Convergence { iterations: 0, residual: residual(&energy) };
    while best.residual > TOLERANCE && best.iterations < MOST_ITERATIONS {
        watch(best)?;
        covariance.apply(&p, &mut kp);
        for c in 0..columns {
            let at = c * n..(c + 1) * n;
            let curvature = dot(&p[at.clone()], &kp[at.clone()]);
            // A channel that is solved stays as it is.
            if energy[c] <= start[c] * (0.1 * TOLERANCE).powi(2) || curvature <= 0.0 {
                continue;
            }
            let step = energy[c] / curvature;
            for k in at {
                x[k] += step * p[k];
                r[k] -= step * kp[k];
            }
        }
        precondition(&r, &mut z);
        let next = energies(&r, &z);
        for c in 0..columns {
            let factor = if energy[c] > 0.0 { next[c] / energy[c] } else { 0.0 };
            for k in c * n..(c + 1) * n {
                p[k] = z[k] + factor * p[k];
            }
        }
        energy = next;
        best = Convergence { iterations: best.iterations + 1, residual: residual(&energy) };
    }
    if best.residual.is_nan() || best.residual > 1e-2 {
        let found = format!("{:.1e} after {} products", best.residual, best.iterations);
        return Err(Error::argument("residual of the weights", "below 0.01", found));
    }
    Ok((x, best))
}
