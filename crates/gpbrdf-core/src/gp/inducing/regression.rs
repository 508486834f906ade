//! Weighted regression of gridded data on the values of an inducing lattice, in closed form.
//!
//! The data form a full grid in the coordinates `(u, v, phi)` with a weight for every point, the lattice is a
//! second grid with far fewer nodes `Z`, and the kernel is a product. The sparse process is the subset of
//! regressors (J. Quiñonero-Candela and C. E. Rasmussen 2005, section 4.1) with noise variance
//! `sigma^2 / weight`: `mean(x) = k(x, Z) (rho K_ZZ + K_ZX W K_XZ)^-1 K_ZX W y` with `rho = sigma^2 / s^2`.
//! The system is solved for the values at the nodes, `m`, instead of the weights `K_ZZ^-1 m`. With the
//! cardinal functions `Phi = K_XZ K_ZZ^-1` it reads `(rho K_ZZ^-1 + Phi^T W Phi) m = Phi^T W y`, which is
//! well conditioned and gives numbers as large as the targets.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

use crate::base::error::{Error, Result};
use crate::base::linalg::{factorize, half_log_det, solve};
use crate::gp::inducing::node_covariance::{NodeCovariance, axis_kernel};
use crate::kernel::{AxisMetric, Kernel1d};

/// The cardinal functions along one axis at the points of the grid, and the covariance of the axis's nodes.
#[derive(Clone, Debug)]
pub(crate) struct CardinalAxis {
    /// `Phi`: points x nodes.
    pub(crate) functions: Mat<f64>,
    /// `K_ZZ` with its jitter.
    covariance: Mat<f64>,
    /// `K_ZZ^-1`.
    pub(crate) inverse: Mat<f64>,
    half_log_det: f64,
}

impl CardinalAxis {
    /// Evaluates the cardinal functions of the nodes `z` at the points `x`.
    ///
    /// # Errors
    /// Nodes whose covariance has no Cholesky factor.
    pub(crate) fn new(
        kernel: &Kernel1d,
        metric: AxisMetric,
        mirrored: bool,
        x: &[f64],
        z: &[f64],
    ) -> Result<Self> {
        let nodes = NodeCovariance::new(kernel, metric, mirrored, z)?;
        let inverse = nodes.inverse();
        let functions = axis_kernel(kernel, metric, mirrored, x, z) * &inverse;
        let half_log_det = half_log_det(&nodes.factor, z.len());
        Ok(Self { functions, covariance: nodes.matrix, inverse, half_log_det })
    }

    fn nodes(&self) -> usize {
        self.inverse.nrows()
    }
}

/// The solution of a regression.
#[derive(Clone, Debug)]
pub(crate) struct Regression {
    /// Values at the nodes, `[A][B][C]`.
    pub(crate) values: Vec<f64>,
    /// The weighted squared residual plus the prior's penalty, `y^T (W^-1 + Q / rho)^-1 y` with
    /// `Q = K_XZ K_ZZ^-1 K_ZX`.
    pub(crate) penalised: f64,
    /// `ln det(I + W^1/2 Q W^1/2 / rho)`.
    pub(crate) log_det: f64,
    /// `tr(W Q)`.
    pub(crate) explained: f64,
}

/// Solves the regression for weights and targets on the grid, `[u][v][phi]`.
///
/// The normal matrix is summed one axis at a time: products of pairs of functions first along `phi`, then
/// along `v`, then along `u`. For `U x V x P` points and `A x B x C` nodes this costs
/// `U V P C^2 + U V B^2 C^2 + U A^2 B^2 C^2` multiply-adds, up to 8 times fewer by symmetry. The Cholesky
/// factor costs `(A B C)^3 / 6`.
///
/// # Errors
/// A normal matrix without a Cholesky factor.
pub(crate) fn regress(
    axes: [&CardinalAxis; 3],
    weights: &[f64],
    targets: &[f64],
    rho: f64,
) -> Result<Regression> {
    let [a, b, c] = axes.map(CardinalAxis::nodes);
    let m = a * b * c;
    let weighted: Vec<f64> = weights.iter().zip(targets).map(|(w, y)| w * y).collect();
    let transposed = axes.map(|axis| axis.functions.transpose());
    let rhs = crate::gp::contract(transposed, &weighted, 1);
    let sums = PairSums::new(axes, weights);

    let mut matrix = vec![0.0; m * m];
    let plane = b * c;
    // tr(K_ZZ Phi^T W Phi), summed column by column so that the order of the sum is fixed.
    let traces: Vec<f64> = matrix
        .par_chunks_mut(m)
        .enumerate()
        .map(|(column, out)| {
            let (i, j, k) = (column / plane, column / c % b, column % c);
            let [ku, kv, kp] = axes.map(|axis| &axis.covariance);
            let [iu, iv, ip] = axes.map(|axis| &axis.inverse);
            let mut trace = 0.0;
            for row in column..m {
                let (p, q, r) = (row / plane, row / c % b, row % c);
                let value = sums.at([i, j, k], [p, q, r]);
                let twice = if row == column { 1.0 } else { 2.0 };
                trace += twice * value * ku[(i, p)] * kv[(j, q)] * kp[(k, r)];
                out[row] = value + rho * iu[(i, p)] * iv[(j, q)] * ip[(k, r)];
            }
            trace
        })
        .collect();
    let diagonal: f64 = matrix.iter().step_by(m + 1).sum::<f64>() / m as f64;
    // For nodes without data the matrix holds little but rounding errors. The jitter that counters them is
    // far below the contribution of anything that was measured.
    matrix.iter_mut().step_by(m + 1).for_each(|x| *x += 1e-13 * diagonal);
    if !factorize(&mut matrix, m) {
        return Err(Error::NotPositiveDefinite { size: m, largest_jitter: 1e-13 });
    }
    let mut values = rhs.clone();
    solve(&matrix, m, &mut values);
    let energy: f64 = weighted.iter().zip(targets).map(|(wy, y)| wy * y).sum();
    let fitted: f64 = rhs.iter().zip(&values).map(|(b, m)| b * m).sum();
    let node_log_det: f64 = axes.iter().map(|axis| 2.0 * axis.half_log_det * (m / axis.nodes()) as f64).sum();
    let log_det = 2.0 * half_log_det(&matrix, m) + node_log_det - m as f64 * rho.ln();
    Ok(Regression { values, penalised: energy - fitted, log_det, explained: traces.iter().sum() })
}

/// `sum_x w(x) phi_i(u) phi_p(u) phi_j(v) phi_q(v) phi_k(phi) phi_r(phi)` for all pairs of nodes.
struct PairSums {
    pairs: [usize; 3],
    /// `[pair of u][pair of v][pair of phi]`.
    sums: Mat<f64>,
}

/// Index of the unordered pair `(i, p)`.
fn pair(i: usize, p: usize) -> usize {
    let (low, high) = (i.min(p), i.max(p));
    high * (high + 1) / 2 + low
}

/// Products of all unordered pairs of columns: points x pairs.
fn pair_products(functions: &Mat<f64>) -> Mat<f64> {
    let n = functions.ncols();
    let mut out = Mat::zeros(functions.nrows(), n * (n + 1) / 2);
    for high in 0..n {
        for low in 0..=high {
            for x in 0..functions.nrows() {
                out[(x, pair(low, high))] = functions[(x, low)] * functions[(x, high)];
            }
        }
    }
    out
}

impl PairSums {
    fn new(axes: [&CardinalAxis; 3], weights: &[f64]) -> Self {
        let [u, v, phi] = axes.map(|axis| pair_products(&axis.functions));
        let pairs = [u.ncols(), v.ncols(), phi.ncols()];
        let (points_v, points_phi) = (v.nrows(), phi.nrows());
        let plane = pairs[1] * pairs[2];
        let mut slabs = vec![0.0; u.nrows() * plane];
        slabs.par_chunks_mut(plane).zip(weights.par_chunks(points_v * points_phi)).for_each_init(
            || Mat::<f64>::zeros(pairs[2], points_v),
            |scratch, (out, weights)| {
                let weights = MatRef::from_column_major_slice(weights, points_phi, points_v);
                matmul(scratch.as_mut(), Accum::Replace, phi.transpose(), weights, 1.0, Par::Seq);
                let out = MatMut::from_column_major_slice_mut(out, pairs[2], pairs[1]);
                matmul(out, Accum::Replace, scratch.as_ref(), v.as_ref(), 1.0, Par::Seq);
            },
        );
        let slabs = MatRef::from_column_major_slice(&slabs, plane, u.nrows());
        let mut sums = Mat::zeros(plane, pairs[0]);
        matmul(sums.as_mut(), Accum::Replace, slabs, u.as_ref(), 1.0, Par::rayon(0));
        Self { pairs, sums }
    }

    fn at(&self, [i, j, k]: [usize; 3], [p, q, r]: [usize; 3]) -> f64 {
        self.sums[(pair(j, q) * self.pairs[2] + pair(k, r), pair(i, p))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::SplitMix64;
    use crate::gp::lattice::{LatticeData, LatticeGp, LatticeHyper};
    use crate::kernel::Shape;
    use nalgebra::{DMatrix, DVector};

    const METRICS: [AxisMetric; 3] = [AxisMetric::Linear, AxisMetric::Linear, AxisMetric::Chord];
    const MIRRORED: [bool; 3] = [false, false, true];

    fn kernels() -> [Kernel1d; 3] {
        [(Shape::Matern52, 0.4), (Shape::Matern32, 0.7), (Shape::SquaredExponential, 0.6)]
            .map(|(shape, length)| Kernel1d::new(shape, length))
    }

    fn even(n: usize, end: f64) -> Vec<f64> {
        (0..n).map(|i| (i as f64 + 0.3) / n as f64 * end).collect()
    }

    fn axes(points: &[Vec<f64>; 3], nodes: &[Vec<f64>; 3]) -> [CardinalAxis; 3] {
        let kernels = kernels();
        std::array::from_fn(|k| {
            CardinalAxis::new(&kernels[k], METRICS[k], MIRRORED[k], &points[k], &nodes[k]).unwrap()
        })
    }

    /// The Kronecker product of the kernel matrices along the three axes, between the points of two grids.
    fn product(x: &[Vec<f64>; 3], z: &[Vec<f64>; 3]) -> DMatrix<f64> {
        let kernels = kernels();
        let [u, v, phi] = std::array::from_fn(|k| {
            let m = axis_kernel(&kernels[k], METRICS[k], MIRRORED[k], &x[k], &z[k]);
            DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)])
        });
        u.kronecker(&v).kronecker(&phi)
    }

    #[test]
    fn values_are_those_of_the_dense_subset_of_regressors() {
        let points = [even(6, 1.0), even(5, 1.0), even(7, 1.5)];
        let nodes = [even(3, 1.0), even(2, 1.1), even(3, 1.5)];
        let n = 6 * 5 * 7;
        let mut random = SplitMix64::new(3);
        let y: Vec<f64> = (0..n).map(|_| random.next_unit() - 0.5).collect();
        let w: Vec<f64> = (0..n).map(|i| if i % 11 == 0 { 0.0 } else { 3.0 * random.next_unit() }).collect();
        let rho = 0.05;
        let axes = axes(&points, &nodes);
        let found = regress(axes.each_ref(), &w, &y, rho).unwrap();

        let (k_zx, k_zz) = (product(&nodes, &points), product(&nodes, &nodes));
        let (y, w) = (DVector::from_vec(y), DMatrix::from_diagonal(&DVector::from_vec(w)));
        let normal = &k_zz * rho + &k_zx * &w * k_zx.transpose();
        let weights = normal.clone().lu().solve(&(&k_zx * &w * &y)).unwrap();
        let values = &k_zz * &weights;
        for (a, b) in found.values.iter().zip(values.iter()) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
        let q = k_zx.transpose() * k_zz.clone().lu().solve(&k_zx).unwrap();
        let root = w.map(f64::sqrt);
        let inner = DMatrix::identity(n, n) + &root * &q * &root / rho;
        assert!((found.log_det / inner.clone().lu().determinant().ln() - 1.0).abs() < 1e-6);
        assert!((found.explained / (&w * &q).trace() - 1.0).abs() < 1e-6);
        let z = &root * &y;
        let penalised = z.dot(&inner.lu().solve(&z).unwrap());
        assert!((found.penalised / penalised - 1.0).abs() < 1e-6, "{} {penalised}", found.penalised);
    }

    #[test]
    fn a_lattice_equal_to_the_data_is_the_exact_process() {
        let nodes = [even(5, 1.0), even(4, 1.0), even(3, 1.5)];
        let mut random = SplitMix64::new(5);
        let targets: Vec<f64> = (0..60).map(|_| random.next_unit() - 0.5).collect();
        let rho = 0.02;
        let solved = regress(axes(&nodes, &nodes).each_ref(), &[1.0; 60], &targets, rho).unwrap();
        let data = LatticeData {
            coordinates: nodes.clone(),
            metrics: METRICS,
            mirrored: MIRRORED,
            targets,
            channels: 1,
        };
        let hyper = LatticeHyper { signal_variance: 1.0, noise_variance: rho, kernels: kernels() };
        let exact = LatticeGp::new(data, hyper).unwrap();
        let points = [vec![0.13, 0.9], vec![0.2, 0.55], vec![0.4, 1.2]];
        let functions = axes(&points, &nodes);
        let means =
            crate::gp::contract(functions.each_ref().map(|f| f.functions.as_ref()), &solved.values, 1);
        for (at, mean) in means.iter().enumerate() {
            let point = [points[0][at / 4], points[1][at / 2 % 2], points[2][at % 2]];
            let expected = exact.predict_mean(&[point])[0];
            assert!((mean - expected).abs() < 1e-6, "{mean} {expected}");
        }
    }
}
