//! Model files. [`Model`] reads and writes their content.

use crate::formats::format::{Format, Head, Reader};
use crate::formats::source::Content;
use crate::model::Model;

/// A fitted model, as safetensors.
pub(crate) const FORMAT: Format = Format {
    name: "gpbrdf model",
    file: "gpbrdf model",
    recognises,
    read: Reader::File(|path| Ok(Content::Model(Box::new(Model::load(path)?)))),
};

/// Whether the file starts with a length of eight bytes that fits into the file, followed by JSON.
fn recognises(head: &Head<'_>) -> bool {
    head.bytes.first_chunk::<8>().zip(head.bytes.get(8)).is_some_and(|(size, &first)| {
        first == b'{' && u64::from_le_bytes(*size) <= head.length.saturating_sub(8)
    })
}
