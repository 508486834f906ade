//! Tables as text, of any instrument: samples, directions, and samples written as CSV.

mod angles;
mod colours;
pub(crate) mod columns;
pub(crate) mod comment;
pub(crate) mod directions;
pub(crate) mod encoding;
pub(crate) mod name;
mod number;
pub(crate) mod samples;
mod separator;
pub(crate) mod table;
mod values;
pub(crate) mod write;
