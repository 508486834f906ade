//! What is open and how it is shown: plain data, which threads and panes read.

pub(crate) mod document;
pub(crate) mod documents;
pub(crate) mod look;
pub(crate) mod messages;
pub(crate) mod portable;
pub(crate) mod session;
pub(crate) mod settings;
pub(crate) mod unknown;
