//! `Source`: whatever can be opened.

use std::path::PathBuf;

use gpbrdf_core::formats::{OutputFormat, OutputOptions, RglColours};
use gpbrdf_core::sample::{GonioGrid, InPlaneScan};
use gpbrdf_core::{BrdfTable, Content, LatticeLayout, Layout, MaterialOptions, Symmetry, detect_symmetry};
use numpy::{PyArray2, PyArray4};
use pyo3::{Bound, PyResult, Python, pyclass, pymethods};

use crate::arrays::{Like, array2, direction_pairs, table_array, table_cells};
use crate::error::{exception, wrong};
use crate::material::Material;
use crate::names;
use crate::samples::Samples;
use crate::work::released;

/// A material from a file of any format that can be read, or a built-in material.
///
/// Source(path) recognises the format by the file's content. Where a text file of measurements does not say it itself,
/// values ("brdf", "cosine", "factor"), angles ("degrees", "radians") and zenith ("theta", "phi") say how to read it.
#[pyclass(frozen, module = "gpbrdf")]
#[derive(Debug)]
pub(crate) struct Source {
    pub(crate) inner: gpbrdf_core::Source,
}

/// Writes a source in the format that the name says.
pub(crate) fn write(
    py: Python<'_>,
    source: &gpbrdf_core::Source,
    path: PathBuf,
    samples: usize,
    rgb: bool,
) -> PyResult<()> {
    let colours = if rgb { RglColours::Rgb } else { RglColours::Spectral };
    let options = OutputOptions { colours, samples };
    released(py, || source.write(&path, OutputFormat::of(&path)?, &options))
}

/// A source that comes from no file. Its name stands for the file in messages.
pub(crate) fn source_of(name: String, kind: &str, content: Content) -> gpbrdf_core::Source {
    gpbrdf_core::Source {
        description: name.clone(),
        path: Some(PathBuf::from(&name)),
        name,
        kind: kind.to_owned(),
        sha256: String::new(),
        content,
    }
}

#[pymethods]
impl Source {
    #[new]
    #[pyo3(signature = (path, *, values=None, angles=None, zenith=None))]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        values: Option<&str>,
        angles: Option<&str>,
        zenith: Option<&str>,
    ) -> PyResult<Self> {
        let options = names::reading(values, angles, zenith)?;
        let inner = released(py, || gpbrdf_core::Source::open_with(&path, &options))?;
        Ok(Self { inner })
    }

    /// The built-in material with this name; built_in_materials() lists them.
    #[staticmethod]
    fn built_in(name: &str) -> PyResult<Self> {
        Ok(Self { inner: gpbrdf_core::Source::built_in(name).map_err(exception)? })
    }

    /// A table of f in 1/sr, shape (90, 90, 180, 3), in the order of MERL files. A negative channel means no data.
    #[staticmethod]
    #[pyo3(signature = (table, *, name="table"))]
    fn from_table(table: Like<'_, f32>, name: &str) -> PyResult<Self> {
        let table = BrdfTable::from_values(table_cells("table", &table)?).map_err(exception)?;
        Ok(Self { inner: source_of(name.to_owned(), "table", Content::Table(table)) })
    }

    /// The name of the material.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// The kind of source, for example "RGL measurement".
    #[getter]
    fn kind(&self) -> &str {
        &self.inner.kind
    }

    /// What the source says about itself.
    #[getter]
    fn description(&self) -> &str {
        &self.inner.description
    }

    /// The SHA-256 sum of the file, hexadecimal; empty for what comes from no file.
    #[getter]
    fn sha256(&self) -> &str {
        &self.inner.sha256
    }

    /// What the user should know about how the file was read.
    #[getter]
    fn notices(&self) -> Vec<String> {
        self.inner.notices().to_vec()
    }

    /// Whether the source holds scattered samples, which samples() returns, instead of a BRDF known everywhere.
    #[getter]
    fn is_scattered(&self) -> bool {
        matches!(self.inner.content, Content::Samples(_))
    }

    /// The scattered measurements of the source. ValueError for a source that is known everywhere: measure() it.
    fn samples(&self) -> PyResult<Samples> {
        Ok(Samples { inner: self.inner.samples().map_err(exception)?.clone() })
    }

    /// Values f in 1/sr, shape (n, 3), for the rows of wi and wo.
    fn eval<'py>(
        &self,
        py: Python<'py>,
        wi: Like<'py, f64>,
        wo: Like<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let pairs = direction_pairs(&wi, &wo)?;
        let values = released(py, || {
            let brdf = self.inner.brdf()?;
            Ok(pairs.iter().map(|[wi, wo]| brdf.eval(wi, wo)).collect())
        })?;
        array2(py, values)
    }

    /// Measures the source at the directions of a layout:
    ///
    /// "lattice": a product lattice of about count nodes (default 37616), or of a shape such as (48, 32, 24);
    /// "random", "cells": count random half-difference angles or table cells (default 2000);
    /// "hemisphere": count pairs of directions drawn uniformly in solid angle (default 2000);
    /// "in-plane": a scan in the plane of incidence (default 380); "gonio": the grid of a goniometer (default 1146).
    /// The last two take incidences in degrees. symmetry is "auto", "bilateral" or "reciprocal", for lattices.
    #[pyo3(signature = (layout="lattice", *, count=None, shape=None, incidences=None, symmetry="auto", seed=0))]
    fn measure(
        &self,
        py: Python<'_>,
        layout: &str,
        count: Option<usize>,
        shape: Option<[usize; 3]>,
        incidences: Option<Vec<f64>>,
        symmetry: &str,
        seed: u64,
    ) -> PyResult<Samples> {
        if shape.is_some() && (layout != "lattice" || count.is_some()) {
            return Err(wrong(
                "shape",
                "layout \"lattice\" and no count",
                format_args!("layout \"{layout}\""),
            ));
        }
        if incidences.is_some() && !matches!(layout, "in-plane" | "gonio") {
            let found = format!("\"{layout}\"");
            return Err(wrong("incidences", "layout \"in-plane\" or \"gonio\"", found));
        }
        let scattered = count.unwrap_or(SCATTERED_SAMPLES);
        let layout = match layout {
            "lattice" => {
                let symmetry = self.symmetry(py, symmetry)?;
                Layout::Lattice(match shape {
                    Some(shape) => LatticeLayout::with_shape(shape, symmetry),
                    None => LatticeLayout::with_samples(count.unwrap_or(LATTICE_SAMPLES), symmetry)
                        .map_err(exception)?,
                })
            }
            "random" => Layout::Random { count: scattered, seed },
            "cells" => Layout::Cells { count: scattered, seed },
            "hemisphere" => Layout::Hemisphere { count: scattered, seed },
            "in-plane" => {
                let usual = InPlaneScan::default();
                Layout::InPlane(InPlaneScan {
                    incidences: incidences.unwrap_or(usual.incidences),
                    count: count.unwrap_or(usual.count),
                })
            }
            "gonio" => {
                let usual = GonioGrid::default();
                let incidences = incidences.unwrap_or_else(|| usual.incidences.clone());
                Layout::Gonio(match count {
                    Some(count) => GonioGrid::with_count(incidences, count).map_err(exception)?,
                    None => GonioGrid { incidences, ..usual },
                })
            }
            other => {
                let known =
                    "one of \"lattice\", \"random\", \"cells\", \"hemisphere\", \"in-plane\", \"gonio\"";
                return Err(wrong("layout", known, format_args!("\"{other}\"")));
            }
        };
        let nodes = match &layout {
            Layout::Lattice(lattice) => lattice
                .shape
                .iter()
                .try_fold(1usize, |product, side| product.checked_mul(*side))
                .unwrap_or(usize::MAX),
            Layout::Random { count, .. } | Layout::Cells { count, .. } => *count,
            // The core limits the others.
            _ => 0,
        };
        if nodes > MAX_SAMPLES {
            return Err(wrong("number of samples", &format!("at most {MAX_SAMPLES}"), nodes));
        }
        Ok(Samples { inner: released(py, || self.inner.measure(&layout))? })
    }

    /// The source as a table: f in 1/sr, shape (90, 90, 180, 3). A new array.
    fn table<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray4<f32>>> {
        let table = released(py, || Ok(self.inner.table()?.into_owned()))?;
        table_array(py, table.into_values())
    }

    /// The source as a material that a renderer evaluates and samples.
    #[pyo3(signature = (*, energy_conserving=false))]
    fn material(&self, py: Python<'_>, energy_conserving: bool) -> PyResult<Material> {
        let options = MaterialOptions { energy_conserving };
        Ok(Material { inner: released(py, || self.inner.material(&options))? })
    }

    /// Writes the source in the format that the name's end says: .binary (MERL), .exr, .bsdf (RGL; rgb=True for RGB
    /// variants of Mitsuba 3), .csv (about samples of them), .dds, .ktx2, .npy or .bin (texture).
    #[pyo3(signature = (path, *, samples=3072, rgb=false))]
    fn write(&self, py: Python<'_>, path: PathBuf, samples: usize, rgb: bool) -> PyResult<()> {
        write(py, &self.inner, path, samples, rgb)
    }

    fn __repr__(&self) -> String {
        format!("<gpbrdf.Source {:?}: {}>", self.inner.name, self.inner.kind)
    }
}

/// Samples on a lattice: those of the paper, 2.58 % of a table.
const LATTICE_SAMPLES: usize = 37_616;

/// Samples at random directions.
const SCATTERED_SAMPLES: usize = 2_000;

/// A table has 1,458,000 cells, so more samples hold nothing new, and take gigabytes.
const MAX_SAMPLES: usize = 1 << 22;

impl Source {
    fn symmetry(&self, py: Python<'_>, name: &str) -> PyResult<Symmetry> {
        match name {
            "auto" => released(py, || Ok(detect_symmetry(self.inner.brdf()?))),
            "bilateral" => Ok(Symmetry::Bilateral),
            "reciprocal" => Ok(Symmetry::Reciprocal),
            _ => Err(wrong(
                "symmetry",
                "one of \"auto\", \"bilateral\", \"reciprocal\"",
                format_args!("\"{name}\""),
            )),
        }
    }
}
