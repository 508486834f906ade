//! Sizes and colours that all figures share. Lengths are points.

use crate::figure::picture::Rgb8;

/// Colour of text and curves without one of their own, of what is beside the point, and of grids.
pub(super) const INK: Rgb8 = [0x1a, 0x1a, 0x1c];
pub(super) const FAINT: Rgb8 = [0x5c, 0x5c, 0x63];
pub(super) const GRID: Rgb8 = [0xe3, 0xe3, 0xe6];
pub(super) const PAPER: Rgb8 = [0xff; 3];

/// Sizes of titles, of captions, and of all other text.
pub(super) const TITLE: f64 = 8.5;
pub(super) const TEXT: f64 = 8.0;
pub(super) const SMALL: f64 = 7.0;
/// Distance between lines, as a multiple of their size.
pub(super) const LEADING: f64 = 1.3;

pub(super) const HAIRLINE: f64 = 0.4;
pub(super) const FRAME: f64 = 0.6;
pub(super) const TICK: f64 = 2.5;

/// How many labels fit along a length, each with as much room.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "2 to 10")]
pub(super) fn labels(length: f64, room: f64) -> usize {
    (length / room).clamp(2.0, 10.0) as usize
}
