//! Models on disk: safetensors files, whose metadata holds everything that is not a tensor as JSON.
//!
//! The metadata entry `gpbrdf` holds provenance, transform, prior means and one header per posterior, which
//! names its solver. Its numbers are read back to the same bits. The names of the tensors of posterior `g`
//! begin with `g.`, followed by:
//!
//! - for a lattice process: `u`, `v`, `phi` (kernel coordinates of the nodes), `targets` and `weights`
//!   (`channels x A x B x C`);
//! - for a dense process: `x` (`n x 3`), `targets` and `weights` (`n x channels`);
//! - for an inducing process: `k.values` (`A x B x C`) for each component `k`, from which nodes and weights
//!   are computed.
//!
//! The values of an inducing process are f16, all other tensors are f64.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::base::tensor_file;
use crate::gp::solver;
use crate::gp::tensors::{TensorReader, TensorWriter};
use crate::model::Model;
use crate::sample::{MeanFunction, Provenance, Transform};

/// The key of the description in the file's metadata.
const KEY: &str = "gpbrdf";

/// The version of the format that is written, and the only one that is read.
const VERSION: u32 = 2;

/// The parts of a model that are not tensors.
#[derive(Serialize, Deserialize)]
struct Header {
    version: u32,
    written_by: String,
    provenance: Provenance,
    transform: Transform,
    mean: MeanFunction,
    offsets: [f64; 3],
    posteriors: Vec<PosteriorHeader>,
}

/// The parts of one posterior that are not tensors.
#[derive(Serialize, Deserialize)]
struct PosteriorHeader {
    solver: String,
    process: Value,
}

impl Model {
    /// Writes a model file. The file appears whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be written, which leaves no part of it behind, and the errors of
    /// [`Model::to_bytes`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        AtomicFile::write(path.as_ref(), &self.to_bytes()?)
    }

    /// The bytes of a model file.
    ///
    /// # Errors
    /// Numbers that JSON cannot hold.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let mut tensors = TensorWriter::default();
        let mut posteriors = Vec::new();
        for (g, (_, posterior)) in self.posteriors().enumerate() {
            tensors.begin(g);
            let process = posterior.save(&mut tensors)?;
            posteriors.push(PosteriorHeader { solver: posterior.solver().to_owned(), process });
        }
        let header = Header {
            version: VERSION,
            written_by: concat!("gpbrdf ", env!("CARGO_PKG_VERSION")).into(),
            provenance: self.provenance.clone(),
            transform: self.transform,
            mean: self.mean,
            offsets: self.offsets,
            posteriors,
        };
        let unwritable = |what: &dyn std::fmt::Display| Error::argument("model", "finite numbers", what);
        let json = serde_json::to_string(&header).map_err(|e| unwritable(&e))?;
        let views = tensors.views().map_err(|e| unwritable(&e))?;
        let metadata = [(KEY.to_owned(), json)].into_iter().collect();
        safetensors::serialize(views, Some(metadata)).map_err(|e| unwritable(&e))
    }

    /// Reads a model file. Predictions of the result equal those of the model that was written, bit for bit.
    /// Nothing is factorised on reading: a factorisation that only variances need is computed when the first
    /// variance is predicted.
    ///
    /// # Errors
    /// A file that cannot be read, is not a model of this version, or is damaged.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|e| Error::read(path, e))?;
        Self::from_bytes(&bytes, path)
    }

    /// Reads a model from the bytes of a file; `path` is only used in error messages.
    ///
    /// # Errors
    /// Bytes that are not a model of this version, or are damaged.
    pub fn from_bytes(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let wrong = |expected: &str, found: String| Error::Format {
            format: "model",
            path: path.to_owned(),
            expected: expected.to_owned(),
            found,
        };
        let (tensors, json) = tensor_file::open(bytes, (KEY, VERSION), &wrong)?;
        let header: Header =
            serde_json::from_str(&json).map_err(|e| wrong("metadata of a model", e.to_string()))?;
        header.transform.validate().map_err(|e| wrong("a consistent model", e.to_string()))?;
        let posteriors = header.posteriors.into_iter().enumerate().map(|(posterior, header)| {
            let tensors = TensorReader { tensors: &tensors, posterior, path };
            solver::load(&header.solver, header.process, &tensors)
        });
        let posteriors = posteriors.collect::<Result<Vec<_>>>()?;
        Self::new(header.provenance, header.transform, header.mean, header.offsets, posteriors)
            .map_err(|e| wrong("a consistent model", e.to_string()))
    }
}
