//! `Baked`: a model in all cells of a table.

use numpy::PyArray4;
use pyo3::{Py, pyclass};

/// A model in all cells of a table: arrays of shape (90, 90, 180, 3) over theta_h (by its square root), theta_d, phi_d
/// and the channels. They are not copied when they are read, so what is written into them stays.
#[pyclass(frozen, get_all, module = "gpbrdf")]
#[derive(Debug)]
pub(crate) struct Baked {
    /// The median of f in 1/sr.
    pub(crate) mean: Py<PyArray4<f32>>,
    /// The standard deviation of the target without noise: of ln(f + epsilon) by default.
    pub(crate) sigma: Py<PyArray4<f32>>,
    /// The noise variance of each channel, in squared units of the target.
    pub(crate) noise_variances: [f64; 3],
}
