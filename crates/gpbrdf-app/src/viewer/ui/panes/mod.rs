//! The panes.

pub(crate) mod materials;
pub(crate) mod model;
pub(crate) mod plots;
pub(crate) mod slices;
pub(crate) mod three_d;
