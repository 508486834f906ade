//! `Samples`: measured values at known directions.

use std::path::PathBuf;

use gpbrdf_core::{Content, HalfDiff, Rgb, SampleSet};
use numpy::PyArray2;
use pyo3::exceptions::PyIndexError;
use pyo3::{Bound, PyErr, PyResult, Python, pyclass, pymethods};

use crate::arrays::{Like, angle_rows, array2, colours, direction_pairs, half_differences};
use crate::error::wrong;
use crate::source::{source_of, write};

/// Measured values of a BRDF at known directions.
#[pyclass(frozen, module = "gpbrdf")]
#[derive(Debug)]
pub(crate) struct Samples {
    pub(crate) inner: SampleSet,
}

impl Samples {
    fn new(mut inner: SampleSet, values: Vec<Rgb>, sigma: Option<Vec<Rgb>>, name: &str) -> PyResult<Self> {
        let count = inner.angles.len();
        let same_length = |what: &str, found: usize| {
            if found == count {
                Ok(())
            } else {
                Err(wrong(what, &format!("{count} rows, one a direction"), found))
            }
        };
        same_length("values", values.len())?;
        check("values", &values, "finite numbers", |value| value.is_finite())?;
        if let Some(sigma) = &sigma {
            same_length("sigma", sigma.len())?;
            check("sigma", sigma, "finite numbers of at least 0", |value| value.is_finite() && value >= 0.0)?;
        }
        inner.values = values;
        inner.sigma = sigma.unwrap_or_default();
        name.clone_into(&mut inner.origin.material);
        "arrays".clone_into(&mut inner.origin.source);
        Ok(Self { inner })
    }

    /// The directions as measured, or with the half vector above the x axis.
    fn directions(&self, which: usize) -> Vec<[f64; 3]> {
        self.inner.iter().map(|sample| [sample.wi, sample.wo][which].into()).collect()
    }
}

/// Refuses values that are not what they should be.
fn check(what: &str, values: &[Rgb], expected: &str, holds: impl Fn(f64) -> bool) -> PyResult<()> {
    match values.iter().position(|value| !value.iter().all(|&x| holds(x))) {
        Some(row) => Err(wrong(&format!("{what}, row {row}"), expected, format_args!("{:?}", values[row]))),
        None => Ok(()),
    }
}

#[pymethods]
impl Samples {
    /// Samples at directions: wi to the light and wo to the viewer, unit vectors in rows. values are f in 1/sr, shape
    /// (n, 3), or (n,) for a single channel that stands for all three; sigma are their standard deviations.
    #[staticmethod]
    #[pyo3(signature = (wi, wo, values, *, sigma=None, name="samples"))]
    fn from_directions(
        wi: Like<'_, f64>,
        wo: Like<'_, f64>,
        values: Like<'_, f64>,
        sigma: Option<Like<'_, f64>>,
        name: &str,
    ) -> PyResult<Self> {
        let directions = direction_pairs(&wi, &wo)?;
        let angles = directions.iter().map(|[wi, wo]| HalfDiff::from_directions(wi, wo)).collect();
        let sigma = sigma.map(|sigma| colours("sigma", &sigma)).transpose()?;
        let set = SampleSet { angles, directions, ..SampleSet::default() };
        Self::new(set, colours("values", &values)?, sigma, name)
    }

    /// Samples at half-difference angles: rows (theta_h, theta_d, phi_d) in radians. values and sigma are those of
    /// from_directions.
    #[staticmethod]
    #[pyo3(signature = (angles, values, *, sigma=None, name="samples"))]
    fn from_half_difference(
        angles: Like<'_, f64>,
        values: Like<'_, f64>,
        sigma: Option<Like<'_, f64>>,
        name: &str,
    ) -> PyResult<Self> {
        let angles = half_differences("angles", &angles)?;
        let sigma = sigma.map(|sigma| colours("sigma", &sigma)).transpose()?;
        Self::new(SampleSet { angles, ..SampleSet::default() }, colours("values", &values)?, sigma, name)
    }

    /// Unit directions to the light, shape (n, 3). A new array, like all that attributes of samples return.
    #[getter]
    fn wi<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array2(py, self.directions(0))
    }

    /// Unit directions to the viewer, shape (n, 3).
    #[getter]
    fn wo<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array2(py, self.directions(1))
    }

    /// Half-difference angles, rows (theta_h, theta_d, phi_d) in radians.
    #[getter]
    fn half_difference<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array2(py, angle_rows(&self.inner.angles))
    }

    /// Values f in 1/sr, shape (n, 3).
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array2(py, self.inner.values.clone())
    }

    /// Standard deviations of the values in 1/sr, shape (n, 3), or None.
    #[getter]
    fn sigma<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        if self.inner.sigma.is_empty() {
            return Ok(None);
        }
        array2(py, self.inner.sigma.clone()).map(Some)
    }

    /// What the user should know about how the samples were read.
    #[getter]
    fn notices(&self) -> Vec<String> {
        self.inner.notices.clone()
    }

    /// The samples with these indices, in this order, with everything that is known about each.
    fn subset(&self, indices: Vec<usize>) -> PyResult<Self> {
        let count = self.inner.len();
        if let Some(index) = indices.iter().find(|&&index| index >= count) {
            let message = format!("indices: expected less than {count}, found {index}");
            return Err(PyErr::new::<PyIndexError, _>(message));
        }
        Ok(Self { inner: self.inner.subset(&indices) })
    }

    /// Writes the samples as .csv, with their standard deviations where they are known.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let content = Content::Samples(Box::new(self.inner.clone()));
        write(py, &source_of(self.inner.origin.material.clone(), "samples", content), path, 0, false)
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }

    fn __repr__(&self) -> String {
        format!("<gpbrdf.Samples: {} samples of {:?}>", self.inner.len(), self.inner.origin.material)
    }
}
