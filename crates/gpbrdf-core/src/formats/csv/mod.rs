//! Comma-separated values: measured samples, directions, and published weights.

pub(crate) mod neural;
pub(crate) mod samples;
