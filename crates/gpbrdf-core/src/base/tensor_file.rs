//! Files of tensors: safetensors whose metadata holds everything else as JSON with a version number.

use safetensors::SafeTensorError;
use safetensors::tensor::SafeTensors;
use serde::Deserialize;

use crate::base::error::{Error, Result};

#[derive(Deserialize)]
struct VersionOnly {
    version: u32,
}

/// The tensors of a file, and the metadata entry `key` as JSON. `wrong` makes an error of what was expected and what
/// was found.
///
/// # Errors
/// Bytes that are not safetensors, have no such entry, or are of another version.
pub(crate) fn open<'a>(
    bytes: &'a [u8],
    (key, version): (&str, u32),
    wrong: &dyn Fn(&str, String) -> Error,
) -> Result<(SafeTensors<'a>, String)> {
    let parsed = |e: SafeTensorError| wrong("a safetensors file", e.to_string());
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(parsed)?;
    let tensors = SafeTensors::deserialize(bytes).map_err(parsed)?;
    let entry = metadata.metadata().as_ref().and_then(|entries| entries.get(key));
    let json = entry.ok_or_else(|| wrong(&format!("the metadata entry \"{key}\""), "none".into()))?;
    let found: VersionOnly =
        serde_json::from_str(json).map_err(|e| wrong("a version number", e.to_string()))?;
    if found.version != version {
        return Err(wrong(&format!("version {version}"), format!("version {}", found.version)));
    }
    Ok((tensors, json.clone()))
}
