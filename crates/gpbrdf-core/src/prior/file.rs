//! Files of priors: safetensors in single precision, and the one that is compiled in.

use std::path::Path;

use safetensors::tensor::{Dtype, TensorView};
use serde::{Deserialize, Serialize};

use super::{Calibration, Functions, Prior, Span};
use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::base::tensor_file;
use crate::gp::table::to_f32;
use crate::gp::{TensorReader, TensorWriter};

/// The prior that comes with the crate.
pub(super) const BUILT_IN: &[u8] = include_bytes!("../../assets/prior.safetensors");

/// The key of the description in the file's metadata.
const KEY: &str = "gpbrdf_prior";

/// The version of the format that is written, and the only one that is read.
const VERSION: u32 = 3;

/// What is not a tensor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct PriorHeader {
    version: u32,
    name: String,
    left: [f64; 2],
    /// Of scattered samples, and of samples in the plane of incidence.
    calibration: [[f64; 4]; 2],
    materials: Vec<String>,
}

pub(super) fn built_in() -> Prior {
    match Prior::from_bytes(BUILT_IN, "built-in prior") {
        Ok(prior) => prior,
        Err(error) => unreachable!("{error}"),
    }
}

impl Prior {
    /// Writes the prior. The file appears whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        AtomicFile::write(path.as_ref(), &self.to_bytes()?)
    }

    /// The bytes of a file: the tensors `mean`, `achromatic` and `chromatic` in single precision, with one row per
    /// function: its constant, then the coefficients of the centres; `scores` with one row per material.
    ///
    /// # Errors
    /// Numbers that JSON cannot hold.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let unwritable = |e: String| Error::argument("prior", "tensors and metadata of a file", e);
        let json = serde_json::to_string(&self.header()).map_err(|e| unwritable(e.to_string()))?;
        let tensors = self.tensors().map(|(name, shape, values)| {
            let bytes: Vec<u8> = values.iter().flat_map(|&x| to_f32(x).to_le_bytes()).collect();
            (name, shape, bytes)
        });
        let views: std::result::Result<Vec<_>, _> = tensors
            .iter()
            .map(|(name, shape, bytes)| Ok((*name, TensorView::new(Dtype::F32, shape.to_vec(), bytes)?)))
            .collect();
        let views = views.map_err(|e: safetensors::SafeTensorError| unwritable(e.to_string()))?;
        let metadata = std::iter::once((KEY.to_owned(), json)).collect();
        safetensors::serialize(views, Some(metadata)).map_err(|e| unwritable(e.to_string()))
    }

    fn header(&self) -> PriorHeader {
        PriorHeader {
            version: VERSION,
            name: self.name.clone(),
            left: self.left,
            calibration: self.calibration.factors(),
            materials: self.materials.clone(),
        }
    }

    /// Names, shapes and values of the tensors.
    fn tensors(&self) -> [(&'static str, [usize; 2], Vec<f64>); 4] {
        let n = self.span.len();
        let of = |name, functions: &Functions| {
            let rows = functions.constants.iter().zip(functions.coefficients.chunks(n));
            let values =
                rows.flat_map(|(constant, row)| std::iter::once(constant).chain(row)).copied().collect();
            (name, [functions.count(), 1 + n], values)
        };
        let [bright, coloured] = &self.functions;
        let scores = (NAMES[3], [self.materials.len(), bright.count()], self.scores.clone());
        [of(NAMES[0], &self.mean), of(NAMES[1], bright), of(NAMES[2], coloured), scores]
    }

    /// Adds the tensors to those of a model, and returns the rest.
    pub(crate) fn add_to(&self, tensors: &mut TensorWriter) -> PriorHeader {
        for (name, shape, values) in self.tensors() {
            tensors.add(&format!("prior.{name}"), &shape, &values);
        }
        self.header()
    }

    /// Reads what [`Prior::add_to`] has written.
    pub(crate) fn from_tensors(header: PriorHeader, tensors: &TensorReader<'_>) -> Result<Self> {
        Self::assemble(header, |name| tensors.read(&format!("prior.{name}")))
    }

    /// A prior out of a header and tensors by name.
    fn assemble(header: PriorHeader, read: impl Fn(&str) -> Result<Vec<f64>>) -> Result<Self> {
        let mean = read(NAMES[0])?;
        let width = mean.len();
        let span = Span::new(width.saturating_sub(1))?;
        let functions = |values: Vec<f64>| {
            if !values.len().is_multiple_of(width) {
                let expected = format!("rows of {width}");
                return Err(Error::argument("coefficients of a prior", expected, values.len()));
            }
            let rows = || values.chunks(width);
            Ok(Functions {
                constants: rows().map(|row| row[0]).collect(),
                coefficients: rows().flat_map(|row| &row[1..]).copied().collect(),
            })
        };
        let [bright, coloured] = [read(NAMES[1])?, read(NAMES[2])?].map(functions);
        let names = (header.name, header.materials);
        let (mean, functions, scores) = (functions(mean)?, [bright?, coloured?], read(NAMES[3])?);
        Self::new(names, span, mean, functions, header.left, scores, Calibration::new(header.calibration)?)
    }

    /// Reads a prior.
    ///
    /// # Errors
    /// A file that cannot be read, is no prior of this version, or is damaged.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|e| Error::read(path, e))?;
        Self::from_bytes(&bytes, path)
    }

    /// Reads a prior from the bytes of a file; `path` is only used in error messages.
    ///
    /// # Errors
    /// Bytes that are no prior of this version, or are damaged.
    pub fn from_bytes(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let wrong = |expected: &str, found: String| Error::Format {
            format: "prior",
            path: path.to_owned(),
            expected: expected.to_owned(),
            found,
        };
        let (tensors, json) = tensor_file::open(bytes, (KEY, VERSION), &wrong)?;
        let header: PriorHeader =
            serde_json::from_str(&json).map_err(|e| wrong("metadata of a prior", e.to_string()))?;
        let read = |name: &str| -> Result<Vec<f64>> {
            let tensor =
                tensors.tensor(name).map_err(|e| wrong(&format!("a tensor \"{name}\""), e.to_string()))?;
            if tensor.dtype() != Dtype::F32 {
                return Err(wrong("tensors in single precision", format!("{:?}", tensor.dtype())));
            }
            let (chunks, _) = tensor.data().as_chunks::<4>();
            let values: Vec<f64> = chunks.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect();
            match values.iter().find(|x| !x.is_finite()) {
                None => Ok(values),
                Some(bad) => Err(wrong("finite numbers", format!("{bad} in tensor \"{name}\""))),
            }
        };
        Self::assemble(header, read).map_err(|error| match error {
            Error::Format { .. } => error,
            other => wrong("a consistent prior", other.to_string()),
        })
    }
}

/// Names of the tensors.
const NAMES: [&str; 4] = ["mean", "achromatic", "chromatic", "scores"];
