//! Reading bytes and checking values, for all formats.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::base::error::{Error, Result};
use crate::brdf::table::cell_indices;

/// Opens `path` for reading. Returns its length, too, if it is a regular file.
pub(crate) fn open(path: &Path) -> Result<(File, Option<u64>)> {
    let failed = |source| Error::read(path, source);
    let file = File::open(path).map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    if metadata.is_dir() {
        return Err(failed(io::ErrorKind::IsADirectory.into()));
    }
    Ok((file, metadata.is_file().then_some(metadata.len())))
}

/// The whole content of a file of at most `limit` bytes.
pub(crate) fn read_bytes(path: &Path, format: &'static str, limit: u64) -> Result<Vec<u8>> {
    let (file, length) = open(path)?;
    let too_large = |found: String| Error::Format {
        format,
        path: path.to_owned(),
        expected: format!("at most {limit} bytes"),
        found,
    };
    if let Some(length) = length.filter(|&length| length > limit) {
        return Err(too_large(format!("{length} bytes")));
    }
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes).map_err(|source| Error::read(path, source))?;
    if bytes.len() as u64 > limit {
        return Err(too_large("more".to_owned()));
    }
    Ok(bytes)
}

/// Counts the values of a table that are not finite, and remembers the place of the first.
#[derive(Debug, Default)]
pub(crate) struct NotFinite {
    count: usize,
    first: Option<(usize, usize)>,
}

impl NotFinite {
    /// Counts among the values of one channel, the first of which belongs to cell `start`.
    pub(crate) fn count_slice(&mut self, values: impl Iterator<Item = f32>, start: usize, channel: usize) {
        for (offset, value) in values.enumerate() {
            if !value.is_finite() {
                self.count += 1;
                self.first.get_or_insert((start + offset, channel));
            }
        }
    }

    /// A description of what was found; `None` if all values are finite.
    pub(crate) fn found(&self) -> Option<String> {
        let (cell, channel) = self.first?;
        let (h, d, p) = cell_indices(cell);
        let name = ["R", "G", "B"].get(channel).copied().unwrap_or("Y");
        Some(format!(
            "{} value{} that {} not, the first in channel {name}, theta_h {h}, theta_d {d}, phi_d {p}",
            self.count,
            if self.count == 1 { "" } else { "s" },
            if self.count == 1 { "is" } else { "are" },
        ))
    }

    /// Returns an error of kind [`io::ErrorKind::InvalidData`] unless all values of a table are finite.
    pub(crate) fn check(values: &[[f32; 3]]) -> io::Result<()> {
        if values.as_flattened().iter().all(|value| value.is_finite()) {
            return Ok(());
        }
        let mut found = Self::default();
        for channel in 0..3 {
            found.count_slice(values.iter().map(|rgb| rgb[channel]), 0, channel);
        }
        let found = found.found().unwrap_or_default();
        Err(io::Error::new(io::ErrorKind::InvalidData, format!("expected finite values, found {found}")))
    }
}
