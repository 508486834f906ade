//! The viewer driven by its labels, as a user or a screen reader would, without a window.
#![allow(clippy::unwrap_used, reason = "a test that finds nothing to unwrap has failed")]

use peak_alloc::PeakAlloc;

/// Counts the memory that Rust code holds; that of the graphics driver is not in it.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

mod viewer {
    mod controls;
    mod directions;
    mod driver;
    mod files;
    mod long_life;
    mod model;
    mod mouse;
    mod objects;
    mod opening;
    mod views;
}
