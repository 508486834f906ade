//! Evaluation of a process in every cell of a table.

mod geometry;
pub(crate) mod points;

pub use geometry::TableGeometry;

use crate::sample::target::Transform;

/// The table that a posterior writes its mean into, in sr^-1.
#[derive(Debug)]
pub struct MeanTable<'a> {
    /// All cells in MERL order; the posterior writes its own channels only.
    pub cells: &'a mut [[f32; 3]],
    /// The posterior's first channel.
    pub first_channel: usize,
    /// Prior mean of each channel's target.
    pub offsets: [f64; 3],
    /// The map from BRDF values to targets.
    pub transform: Transform,
}

/// Rounds to the table's precision.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the table's precision")]
pub(crate) fn to_f32(x: f64) -> f32 {
    x as f32
}
