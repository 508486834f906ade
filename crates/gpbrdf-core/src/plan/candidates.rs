//! The geometries among which plans choose.

use super::device::{Device, Geometry};
use crate::base::error::Result;

/// The usual number of geometries among which a plan chooses.
const MOST_CANDIDATES: usize = 3000;

/// Geometries among which [`plan`](super::plan) chooses: a few for the first measurements, all for those after them.
///
/// Fine steps resolve sharp highlights, which costs directions near mirror directions; with few of them, a plan that
/// leaves them out knows more. Measured with nine difficult materials (`docs/results.md`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Candidates {
    pub(super) first: Vec<Geometry>,
    pub(super) all: Vec<Geometry>,
}

impl Candidates {
    /// The number of measurements, made and planned, up to which plans choose among the first ones.
    pub const FEW: usize = 20;

    /// Those within the limits of an instrument: at most 3000 at all steps, and as many at coarse ones
    /// ([`Device::first_step`]) for the first measurements.
    ///
    /// # Errors
    /// Those of [`Device::geometries`].
    pub fn of(device: &Device) -> Result<Self> {
        let all = device.geometries(MOST_CANDIDATES)?;
        let mut first = Vec::new();
        if let Some(step) = device.first_step() {
            let device = Device { step, ..device.clone() };
            // Limits may leave nothing at the multiples; then there are only fine steps.
            first = device.geometries(MOST_CANDIDATES).unwrap_or_default();
        }
        Ok(Self { first, all })
    }

    /// The number of those at all steps: a plan can have at least as many directions.
    #[must_use]
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }
}

/// The same ones for all measurements.
impl From<Vec<Geometry>> for Candidates {
    fn from(all: Vec<Geometry>) -> Self {
        Self { first: Vec::new(), all }
    }
}
