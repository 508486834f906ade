//! The device against independent results: tables and pictures of `gpbrdf-core`, the CPU twin, closed forms,
//! and pictures kept in `tests/golden` of the workspace.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations")]

mod bake;
mod fixtures;
mod golden;
mod loss;
mod scene;
#[path = "../support/mod.rs"]
mod support;
