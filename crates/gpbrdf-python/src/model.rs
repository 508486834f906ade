//! `Model`: a fitted process, and `Prediction`, what it says about directions.

use std::path::PathBuf;

use gpbrdf_core::gp::FitReport;
use gpbrdf_core::{Content, HalfDiff, MaterialOptions, Rgb, bake_mean};
use gpbrdf_core::{model::bake_mean_observed, model::bake_sigma_observed};
use numpy::PyArray2;
use pyo3::{Bound, Py, PyAny, PyResult, Python, pyclass, pymethods};

use crate::arrays::{Like, array2, direction_pairs, half_differences, table_array};
use crate::baked::Baked;
use crate::error::wrong;
use crate::material::Material;
use crate::names;
use crate::source::{source_of, write};
use crate::work::{observed, released};

/// A fitted Gaussian-process BRDF. fit() makes one; Model.load(path) reads one that save(path) has written.
#[pyclass(frozen, module = "gpbrdf")]
#[derive(Debug)]
pub(crate) struct Model {
    pub(crate) inner: gpbrdf_core::Model,
    /// Empty for a model from a file.
    pub(crate) reports: Vec<FitReport>,
}

/// Predictions in 1/sr, arrays of shape (n, 3).
#[pyclass(frozen, get_all, module = "gpbrdf")]
#[derive(Debug)]
pub(crate) struct Prediction {
    /// The median of f.
    mean: Py<PyArray2<f64>>,
    /// The lower end of the 95 % interval.
    lower: Py<PyArray2<f64>>,
    /// The upper end of the 95 % interval.
    upper: Py<PyArray2<f64>>,
}

#[pymethods]
impl Model {
    /// Reads a model from a .safetensors file. It predicts the same bits as the one that was saved.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let inner = released(py, || gpbrdf_core::Model::load(&path))?;
        Ok(Self { inner, reports: Vec::new() })
    }

    /// Writes the model as a .safetensors file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        released(py, || self.inner.save(&path))
    }

    /// Means and 95 % intervals: at the rows of wi and wo, or at those of half_difference. The interval is that of a
    /// new measurement (of="observation"), or of the function without noise (of="latent").
    #[pyo3(signature = (wi=None, wo=None, *, half_difference=None, of="observation"))]
    fn predict(
        &self,
        py: Python<'_>,
        wi: Option<Like<'_, f64>>,
        wo: Option<Like<'_, f64>>,
        half_difference: Option<Like<'_, f64>>,
        of: &str,
    ) -> PyResult<Prediction> {
        let of = names::interval_of(of)?;
        let angles: Vec<HalfDiff> = match (wi, wo, half_difference) {
            (Some(wi), Some(wo), None) => {
                direction_pairs(&wi, &wo)?.iter().map(|[wi, wo]| HalfDiff::from_directions(wi, wo)).collect()
            }
            (None, None, Some(angles)) => half_differences("half_difference", &angles)?,
            _ => {
                let expected = "wi and wo, or half_difference";
                return Err(wrong("directions of predict", expected, "something else"));
            }
        };
        let found = observed(py, None, |_| self.inner.predict(&angles, of))?;
        let array = |of: fn(&gpbrdf_core::Prediction) -> Rgb| {
            array2(py, found.iter().map(of).collect()).map(Bound::unbind)
        };
        Ok(Prediction { mean: array(|p| p.mean)?, lower: array(|p| p.lower)?, upper: array(|p| p.upper)? })
    }

    /// The model in all cells of a table: mean and standard deviation. progress is called with the share that is done
    /// of each of them.
    #[pyo3(signature = (*, progress=None))]
    fn bake(&self, py: Python<'_>, progress: Option<Py<PyAny>>) -> PyResult<Baked> {
        let (mean, sigma) = observed(py, progress.as_ref(), |observer| {
            Ok((bake_mean_observed(&self.inner, observer)?, bake_sigma_observed(&self.inner, observer)?))
        })?;
        Ok(Baked {
            mean: table_array(py, mean.into_values())?.unbind(),
            sigma: table_array(py, sigma.to_table().into_values())?.unbind(),
            noise_variances: self.inner.noise_variances(),
        })
    }

    /// The model as a material that a renderer evaluates and samples.
    #[pyo3(signature = (*, energy_conserving=false))]
    fn material(&self, py: Python<'_>, energy_conserving: bool) -> PyResult<Material> {
        let options = MaterialOptions { energy_conserving };
        let inner = observed(py, None, |_| gpbrdf_core::Material::new(bake_mean(&self.inner), &options))?;
        Ok(Material { inner })
    }

    /// Writes the model in the format that the name's end says: .binary (MERL), .exr, .bsdf (RGL; rgb=True for RGB
    /// variants of Mitsuba 3), .csv (about samples of them), .dds, .ktx2, .npy or .bin (texture; alpha is the standard
    /// deviation).
    #[pyo3(signature = (path, *, samples=3072, rgb=false))]
    fn write(&self, py: Python<'_>, path: PathBuf, samples: usize, rgb: bool) -> PyResult<()> {
        let content = Content::Model(Box::new(self.inner.clone()));
        write(py, &source_of(self.name().to_owned(), "model", content), path, samples, rgb)
    }

    /// The name of the material.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.provenance.material
    }

    /// The name of the solver.
    #[getter]
    fn solver(&self) -> &str {
        self.inner.solver()
    }

    /// The number of measured directions.
    #[getter]
    fn n_samples(&self) -> usize {
        self.inner.n_samples()
    }

    /// The noise variance of each channel, in squared units of the target.
    #[getter]
    fn noise_variances(&self) -> (f64, f64, f64) {
        self.inner.noise_variances().into()
    }

    /// The log marginal likelihood of the fit; None for a model from a file.
    #[getter]
    fn log_marginal_likelihood(&self) -> Option<f64> {
        let all = self.reports.iter().map(|report| report.log_marginal_likelihood);
        (!self.reports.is_empty()).then(|| all.sum())
    }

    /// Whether the search for hyper-parameters has converged; None for a model from a file.
    #[getter]
    fn converged(&self) -> Option<bool> {
        (!self.reports.is_empty()).then(|| self.reports.iter().all(|report| report.converged))
    }

    /// The hyper-parameters as JSON.
    #[getter]
    fn hyper_parameters(&self) -> String {
        self.inner.hyper_report().to_string()
    }

    fn __repr__(&self) -> String {
        let (samples, solver) = (self.inner.n_samples(), self.inner.solver());
        format!("<gpbrdf.Model of {:?}: {samples} samples, {solver} solver>", self.name())
    }
}
