//! The covariance of the nodes of an inducing lattice along one axis.

use crate::base::error::{Error, Result};
use crate::base::linalg::{Matrix, factorize, solve};
use crate::kernel::{AxisMetric, Kernel1d};

/// The jitter that is added to the variance of every node, relative to the mean variance. It makes up for
/// rounding errors of smooth kernels.
pub(crate) const NODE_JITTER: f64 = 1e-9;

/// Kernel values `[x][z]` along one axis; a mirrored axis has the kernel `k(x, z) + k(x, -z)`.
pub(crate) fn axis_kernel(
    kernel: &Kernel1d,
    metric: AxisMetric,
    mirrored: bool,
    x: &[f64],
    z: &[f64],
) -> Matrix {
    Matrix::from_fn(x.len(), z.len(), |i, j| {
        let image = if mirrored { kernel.value(metric.distance(x[i], -z[j])) } else { 0.0 };
        kernel.value(metric.distance(x[i], z[j])) + image
    })
}

/// `K_ZZ` of one axis and its Cholesky factor.
#[derive(Clone, Debug)]
pub(crate) struct NodeCovariance {
    /// `K_ZZ` with its jitter.
    pub(crate) matrix: Matrix,
    /// Its Cholesky factor, column-major.
    pub(crate) factor: Vec<f64>,
}

impl NodeCovariance {
    /// Computes the covariance of the nodes `z` and factorises it.
    ///
    /// # Errors
    /// Nodes whose covariance has no Cholesky factor.
    pub(crate) fn new(kernel: &Kernel1d, metric: AxisMetric, mirrored: bool, z: &[f64]) -> Result<Self> {
        let n = z.len();
        let mut matrix = axis_kernel(kernel, metric, mirrored, z, z);
        let jitter = NODE_JITTER * (0..n).map(|i| matrix[(i, i)]).sum::<f64>() / n as f64;
        (0..n).for_each(|i| matrix[(i, i)] += jitter);
        let mut factor: Vec<f64> = (0..n * n).map(|at| matrix[(at % n, at / n)]).collect();
        if !factorize(&mut factor, n) {
            return Err(Error::NotPositiveDefinite { size: n, largest_jitter: NODE_JITTER });
        }
        Ok(Self { matrix, factor })
    }

    /// `K_ZZ^-1`.
    pub(crate) fn inverse(&self) -> Matrix {
        let n = self.matrix.nrows();
        let mut inverse = vec![0.0; n * n];
        inverse.iter_mut().step_by(n + 1).for_each(|x| *x = 1.0);
        solve(&self.factor, n, &mut inverse);
        Matrix::from_fn(n, n, |i, j| inverse[j * n + i])
    }
}
