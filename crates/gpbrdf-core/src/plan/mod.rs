//! What to measure next: the directions after which a process is expected to know a material best.
//!
//! The variance of a Gaussian process depends on where it was measured, not on what was found there. The variances that
//! remain after any measurements are therefore known before they are made, as far as the hyper-parameters are.

mod belief;
mod candidates;
mod cells;
mod device;
mod greedy;
mod tour;

pub use belief::Belief;
pub use candidates::Candidates;
pub use cells::Cells;
pub use device::{Device, Geometry};
pub use greedy::{Goal, MOST_MEASURED, Plan, expected_error, plan};
pub use tour::{AxisCosts, tour};

#[cfg(test)]
mod tests;
