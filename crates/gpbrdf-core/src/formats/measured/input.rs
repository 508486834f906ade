//! A file of measurements in memory, and errors about it.

use std::path::Path;

use crate::base::error::{Error, Result};
use crate::formats::measured::ReadOptions;
use crate::formats::measured::text::encoding::decode;

/// The whole content of a file, and how to read it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Input<'a> {
    /// The name of the format, for messages.
    pub(crate) format: &'static str,
    /// The file, for messages.
    pub(crate) path: &'a Path,
    pub(crate) bytes: &'a [u8],
    pub(crate) options: &'a ReadOptions,
}

impl Input<'_> {
    /// An error about the content.
    pub(crate) fn wrong(&self, expected: impl Into<String>, found: impl Into<String>) -> Error {
        Error::Format {
            format: self.format,
            path: self.path.to_owned(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// The content as text with `\n` at the end of each line.
    ///
    /// # Errors
    /// [`Error::Format`] for content that is not text.
    pub(crate) fn text(&self) -> Result<String> {
        let text =
            decode(self.bytes).map_err(|found| self.wrong("text in UTF-8, UTF-16 or Windows-1252", found))?;
        Ok(if text.contains('\r') {
            text.replace("\r\n", "\n").replace('\r', "\n")
        } else {
            text.into_owned()
        })
    }

    /// The finite number that `text` on a line is.
    ///
    /// # Errors
    /// [`Error::Format`] if it is none.
    pub(crate) fn number(&self, text: &str, line: u64) -> Result<f64> {
        text.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| {
            self.wrong(format!("a finite number on line {line}"), format!("\"{}\"", shortened(text)))
        })
    }
}

/// At most 40 characters of a text, for messages.
pub(crate) fn shortened(text: &str) -> String {
    let mut start: String = text.chars().filter(|c| !c.is_control()).take(40).collect();
    if start.len() < text.len() {
        start.push_str("...");
    }
    start
}
