//! Samples on a product lattice, and the covariances of its axes.

use crate::base::error::{Error, Result};
use crate::base::linalg::{Matrix, symmetric_eigen};
use crate::kernel::{AxisMetric, Kernel1d};

/// Coordinates and targets on a lattice, to which a lattice process is fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeData {
    /// Kernel coordinates of the nodes along each axis.
    pub coordinates: [Vec<f64>; 3],
    /// How distance is measured along each axis.
    pub metrics: [AxisMetric; 3],
    /// Whether functions along each axis are even; the kernel is then `k(x, y) + k(x, -y)`. With the chord
    /// metric they are even about `pi/2` too, and the process is that of the whole circle given mirrored
    /// targets.
    pub mirrored: [bool; 3],
    /// Zero-mean targets, `[channel][A][B][C]`, last axis fastest.
    pub targets: Vec<f64>,
    /// Number of channels; they share hyper-parameters.
    pub channels: usize,
}

impl LatticeData {
    /// Number of nodes along each axis.
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        [self.coordinates[0].len(), self.coordinates[1].len(), self.coordinates[2].len()]
    }

    /// Number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shape().iter().product()
    }

    /// Whether there is no node.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Checks sizes and finiteness.
    ///
    /// # Errors
    /// An empty axis, a number of targets other than `channels A B C`, a coordinate or target that is not
    /// finite.
    pub fn validate(&self) -> Result<()> {
        if self.is_empty() || self.targets.len() != self.channels * self.len() || self.channels == 0 {
            let expected = format!("{} channels x {} nodes, at least one of each", self.channels, self.len());
            return Err(Error::argument("lattice targets", expected, self.targets.len()));
        }
        if let Some(bad) =
            self.targets.iter().chain(self.coordinates.iter().flatten()).find(|x| !x.is_finite())
        {
            return Err(Error::argument("lattice targets and coordinates", "finite numbers", bad));
        }
        Ok(())
    }

    /// The mirror image of a coordinate along axis `k`, if that axis is mirrored.
    pub(super) fn image(&self, k: usize, x: f64) -> Option<f64> {
        self.mirrored[k].then_some(-x)
    }

    /// Prior variance `k(x, x)` along axis `k`.
    pub(super) fn axis_variance(&self, k: usize, kernel: &Kernel1d, x: f64) -> f64 {
        let image = self.image(k, x).map(|image| kernel.value(self.metrics[k].distance(x, image)));
        kernel.value(0.0) + image.unwrap_or(0.0)
    }

    /// The covariance of the nodes along axis `k` and, if `derivatives` is set, its derivatives with respect
    /// to the kernel's log-parameters.
    pub(super) fn gram(&self, k: usize, kernel: &Kernel1d, derivatives: bool) -> (Matrix, Vec<Matrix>) {
        let (x, metric) = (&self.coordinates[k], self.metrics[k]);
        let n = x.len();
        let count = if derivatives { kernel.n_parameters() } else { 0 };
        let mut gram = Matrix::zeros(n, n);
        let mut slopes = vec![Matrix::zeros(n, n); count];
        let mut row = vec![0.0; count];
        for j in 0..n {
            for i in j..n {
                row.fill(0.0);
                let mut value = 0.0;
                for other in std::iter::once(x[j]).chain(self.image(k, x[j])) {
                    let distance = metric.distance(x[i], other);
                    value += if derivatives {
                        kernel.add_gradient(distance, 1.0, &mut row)
                    } else {
                        kernel.value(distance)
                    };
                }
                gram[(i, j)] = value;
                gram[(j, i)] = value;
                for (slope, &d) in slopes.iter_mut().zip(&row) {
                    slope[(i, j)] = d;
                    slope[(j, i)] = d;
                }
            }
        }
        (gram, slopes)
    }

    /// The eigendecompositions of the covariances along the three axes and, if `derivatives` is set, the
    /// derivatives of these covariances.
    pub(super) fn eigen(
        &self,
        kernels: &[Kernel1d; 3],
        derivatives: bool,
    ) -> Result<([AxisEigen; 3], AxisSlopes)> {
        let axis = |k: usize| -> Result<_> {
            let (gram, slopes) = self.gram(k, &kernels[k], derivatives);
            Ok((AxisEigen::new(&gram)?, slopes))
        };
        let (u, (v, phi)) = rayon::join(|| axis(0), || rayon::join(|| axis(1), || axis(2)));
        let ((u, du), (v, dv), (phi, dphi)) = (u?, v?, phi?);
        Ok(([u, v, phi], [du, dv, dphi]))
    }
}

/// The eigendecomposition of the covariance along one axis.
#[derive(Clone, Debug)]
pub(crate) struct AxisEigen {
    pub(crate) vectors: Matrix,
    pub(crate) values: Vec<f64>,
}

/// For each axis, the derivatives of its covariance with respect to the log-parameters of its kernel.
pub(super) type AxisSlopes = [Vec<Matrix>; 3];

impl AxisEigen {
    pub(super) fn new(gram: &Matrix) -> Result<Self> {
        let (mut values, vectors) = symmetric_eigen(gram).ok_or_else(|| {
            Error::argument("covariance of an axis", "finite entries", "no eigendecomposition")
        })?;
        // Rounding leaves the smallest eigenvalues of smooth kernels slightly negative.
        values.iter_mut().for_each(|x| *x = x.max(0.0));
        Ok(Self { vectors, values })
    }
}
