//! Comma-separated values: measured samples and directions, and published weights.

pub(crate) mod neural;
pub(crate) mod samples;
