//! What is open and how it is shown.

pub(crate) mod document;
pub(crate) mod messages;
pub(crate) mod session;
pub(crate) mod settings;
