//! `Plan`: what to measure next.

use numpy::{PyArray1, PyArray2};
use pyo3::{Py, pyclass};

/// Directions to measure next, the most telling first.
#[pyclass(frozen, get_all, module = "gpbrdf")]
#[derive(Debug)]
pub(crate) struct Plan {
    /// Angles between light and normal, degrees.
    pub(crate) theta_i: Py<PyArray1<f64>>,
    /// Angles between detector and normal, degrees.
    pub(crate) theta_o: Py<PyArray1<f64>>,
    /// Azimuths between light and detector, degrees: 0 on the side of the light, 180 on that of the mirror direction.
    pub(crate) phi_o: Py<PyArray1<f64>>,
    /// Unit directions to the light, shape (n, 3).
    pub(crate) wi: Py<PyArray2<f64>>,
    /// Unit directions to the detector, shape (n, 3).
    pub(crate) wo: Py<PyArray2<f64>>,
    /// The expected error of ln f (root mean square) after 0, 1, ... n of the directions, shape (n + 1,).
    pub(crate) errors: Py<PyArray1<f64>>,
    /// The indices of the directions along a short way through all of them, shape (n,).
    pub(crate) tour: Py<PyArray1<usize>>,
}
