//! What threads do.

pub(crate) mod curves;
pub(crate) mod dialogs;
pub(crate) mod export;
pub(crate) mod fitter;
pub(crate) mod mailbox;
pub(crate) mod quality;
pub(crate) mod scene;
pub(crate) mod slices;
pub(crate) mod spheres;
