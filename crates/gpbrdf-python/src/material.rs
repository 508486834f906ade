//! `Material`: what a renderer evaluates and samples.

use gpbrdf_core::{BrdfTable, MaterialOptions, SampledDirection};
use numpy::{PyArray1, PyArray2};
use pyo3::{Bound, PyResult, Python, pyclass, pymethods};

use crate::arrays::{Like, array1, array2, paired, rows, table_cells};
use crate::error::exception;
use crate::work::released;

/// An isotropic material that a renderer evaluates and samples, in single precision.
///
/// Material(table) takes f in 1/sr, shape (90, 90, 180, 3); Source.material() and Model.material() make one as well.
/// With energy_conserving, values are reduced where more light would leave the surface than falls on it. Arrays of
/// float32 are not copied. A single direction stands for all rows of the other argument.
#[pyclass(frozen, module = "gpbrdf")]
#[derive(Debug)]
pub(crate) struct Material {
    pub(crate) inner: gpbrdf_core::Material,
}

#[pymethods]
impl Material {
    #[new]
    #[pyo3(signature = (table, *, energy_conserving=false))]
    fn new(py: Python<'_>, table: Like<'_, f32>, energy_conserving: bool) -> PyResult<Self> {
        let options = MaterialOptions { energy_conserving };
        let table = BrdfTable::from_values(table_cells("table", &table)?).map_err(exception)?;
        Ok(Self { inner: released(py, || gpbrdf_core::Material::new(table, &options))? })
    }

    /// Values f(wi, wo) in 1/sr without the cosine, shape (n, 3). Zero at and below the horizon.
    fn eval<'py>(
        &self,
        py: Python<'py>,
        wi: Like<'py, f32>,
        wo: Like<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (wi, wo) = paired("wi and wo", rows("wi", &wi)?, rows("wo", &wo)?)?;
        let values = released(py, || {
            let mut values = vec![[0.0; 3]; wi.len()];
            self.inner.eval_many(&wi, &wo, &mut values);
            Ok(values)
        })?;
        array2(py, values)
    }

    /// The densities in 1/sr with which sample() draws wi for wo, shape (n,).
    fn pdf<'py>(
        &self,
        py: Python<'py>,
        wi: Like<'py, f32>,
        wo: Like<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let (wi, wo) = paired("wi and wo", rows("wi", &wi)?, rows("wo", &wo)?)?;
        let densities = released(py, || {
            let mut densities = vec![0.0; wi.len()];
            self.inner.pdf_many(&wi, &wo, &mut densities);
            Ok(densities)
        })?;
        Ok(array1(py, densities))
    }

    /// Directions to the light, drawn by pairs u of numbers that are uniform on [0, 1): wi of shape (n, 3), weights
    /// f cos(theta_i) / pdf of shape (n, 3), and pdf in 1/sr of shape (n,). All are zero where nothing could be drawn.
    fn sample<'py>(&self, py: Python<'py>, wo: Like<'py, f32>, u: Like<'py, f32>) -> PyResult<Drawn<'py>> {
        let (wo, u) = paired("wo and u", rows("wo", &wo)?, rows::<f32, 2>("u", &u)?)?;
        let drawn = released(py, || {
            let mut drawn = vec![None; wo.len()];
            self.inner.sample_many(&wo, &u, &mut drawn);
            Ok(drawn.into_iter().map(Option::unwrap_or_default).collect::<Vec<SampledDirection>>())
        })?;
        Ok((
            array2(py, drawn.iter().map(|drawn| drawn.wi).collect())?,
            array2(py, drawn.iter().map(|drawn| drawn.weight).collect())?,
            array1(py, drawn.iter().map(|drawn| drawn.pdf).collect()),
        ))
    }

    /// The directional-hemispherical reflectance for each row of wo, shape (n, 3).
    fn albedo<'py>(&self, py: Python<'py>, wo: Like<'py, f32>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let wo = rows::<f32, 3>("wo", &wo)?;
        let albedos = released(py, || Ok(wo.iter().map(|&wo| self.inner.albedo(wo)).collect()))?;
        array2(py, albedos)
    }
}

/// Directions, weights and densities.
type Drawn<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<f32>>);
