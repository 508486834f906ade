//! The tensors of a model file, written and read by posteriors.

use std::collections::BTreeMap;
use std::path::Path;

use safetensors::SafeTensorError;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde_json::Value;

use crate::base::error::{Error, Result};
use crate::base::f16::to_half;

/// Collects the tensors of all posteriors of a model. The name of each tensor is prefixed with the number of
/// its posterior.
#[derive(Debug, Default)]
pub struct TensorWriter {
    tensors: BTreeMap<String, (Dtype, Vec<usize>, Vec<u8>)>,
    posterior: usize,
}

impl TensorWriter {
    /// Starts the posterior with this number: all tensors that are added from now on belong to it.
    pub(crate) fn begin(&mut self, posterior: usize) {
        self.posterior = posterior;
    }

    /// Adds a tensor in double precision.
    pub fn add(&mut self, name: &str, shape: &[usize], values: &[f64]) {
        let bytes = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.insert(name, Dtype::F64, shape, bytes);
    }

    /// Adds a tensor in half precision.
    pub fn add_half(&mut self, name: &str, shape: &[usize], values: &[f64]) {
        let bytes = values.iter().flat_map(|&x| to_half(x).to_le_bytes()).collect();
        self.insert(name, Dtype::F16, shape, bytes);
    }

    fn insert(&mut self, name: &str, dtype: Dtype, shape: &[usize], bytes: Vec<u8>) {
        self.tensors.insert(format!("{}.{name}", self.posterior), (dtype, shape.to_vec(), bytes));
    }

    /// The tensors by name.
    pub(crate) fn views(&self) -> Result<Vec<(&String, TensorView<'_>)>, SafeTensorError> {
        self.tensors
            .iter()
            .map(|(name, (dtype, shape, bytes))| Ok((name, TensorView::new(*dtype, shape.clone(), bytes)?)))
            .collect()
    }
}

/// The header of a posterior as JSON.
///
/// # Errors
/// Numbers that JSON cannot hold.
pub(crate) fn header(header: &impl serde::Serialize) -> Result<Value> {
    let value = serde_json::to_value(header).map_err(|e| Error::argument("model", "finite numbers", e))?;
    // JSON has no NaN and no infinity: they would become null, and the file could not be read.
    if has_null(&value) {
        Err(Error::argument("model", "finite numbers", "NaN or infinity"))
    } else {
        Ok(value)
    }
}

fn has_null(value: &Value) -> bool {
    match value {
        Value::Null => true,
        Value::Array(values) => values.iter().any(has_null),
        Value::Object(values) => values.values().any(has_null),
        _ => false,
    }
}

/// The tensors of one posterior of a model file. Its errors name the file.
#[derive(Clone, Copy, Debug)]
pub struct TensorReader<'a> {
    pub(crate) tensors: &'a SafeTensors<'a>,
    pub(crate) posterior: usize,
    pub(crate) path: &'a Path,
}

impl TensorReader<'_> {
    /// An error that names this file, the content that was expected and the content that was found.
    #[must_use]
    pub fn wrong(&self, expected: impl Into<String>, found: impl Into<String>) -> Error {
        Error::Format {
            format: "model",
            path: self.path.to_owned(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// An error for values that could be read but do not make a valid posterior together.
    #[expect(clippy::needless_pass_by_value, reason = "it is handed to map_err")]
    #[must_use]
    pub fn damaged(&self, error: Error) -> Error {
        self.wrong("a consistent model", error.to_string())
    }

    /// Reads the header of a posterior from JSON.
    ///
    /// # Errors
    /// JSON that does not have the form of `T`.
    pub fn header<T: serde::de::DeserializeOwned>(&self, header: Value) -> Result<T> {
        serde_json::from_value(header).map_err(|e| self.wrong("metadata of a model", e.to_string()))
    }

    /// Reads the values of a tensor, all of which are finite.
    ///
    /// # Errors
    /// A tensor that is missing, is neither f64 nor f16, or holds a number that is not finite.
    pub fn read(&self, name: &str) -> Result<Vec<f64>> {
        let name = format!("{}.{name}", self.posterior);
        let tensor = self
            .tensors
            .tensor(&name)
            .map_err(|e| self.wrong(format!("a tensor \"{name}\""), e.to_string()))?;
        let values: Vec<f64> = match tensor.dtype() {
            Dtype::F64 => {
                let (chunks, _) = tensor.data().as_chunks::<8>();
                chunks.iter().map(|b| f64::from_le_bytes(*b)).collect()
            }
            Dtype::F16 => {
                let (chunks, _) = tensor.data().as_chunks::<2>();
                chunks.iter().map(|b| half::f16::from_le_bytes(*b).to_f64()).collect()
            }
            other => {
                return Err(self.wrong(format!("f64 or f16 in tensor \"{name}\""), format!("{other:?}")));
            }
        };
        match values.iter().position(|x| !x.is_finite()) {
            None => Ok(values),
            Some(i) => {
                Err(self
                    .wrong(format!("finite numbers in tensor \"{name}\""), format!("{} at {i}", values[i])))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_json_cannot_hold_are_refused() {
        assert!(header(&[1.0, 2.0]).is_ok());
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(header(&[1.0, bad]).is_err(), "{bad}");
        }
    }
}
