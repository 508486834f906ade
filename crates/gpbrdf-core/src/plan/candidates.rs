//! The geometries among which plans choose.

use super::device::{Device, Geometry};
use crate::base::error::Result;

/// The usual number of geometries among which a plan chooses.
const MOST_CANDIDATES: usize = 3000;

/// Geometries among which [`plan`](super::plan) chooses: those at coarse steps for the first measurements and for
/// materials whose highlights are broad, all of them otherwise.
///
/// Fine steps resolve sharp highlights, which costs directions near mirror directions. Few measurements, and those of
/// matte materials, tell more without them, as measured with 17 materials (`docs/results.md`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Candidates {
    pub(super) coarse: Vec<Geometry>,
    pub(super) all: Vec<Geometry>,
}

impl Candidates {
    /// The number of measurements, made and planned, up to which plans choose among those at coarse steps.
    pub const FEW: usize = 20;

    /// Those within the limits of an instrument: at most 3000 at all steps, and as many at coarse ones
    /// ([`Device::coarse_step`]).
    ///
    /// # Errors
    /// Those of [`Device::geometries`].
    pub fn of(device: &Device) -> Result<Self> {
        let all = device.geometries(MOST_CANDIDATES)?;
        let mut coarse = Vec::new();
        if let Some(step) = device.coarse_step() {
            let device = Device { step, ..device.clone() };
            // Limits may leave nothing at the multiples; then there are only fine steps.
            coarse = device.geometries(MOST_CANDIDATES).unwrap_or_default();
        }
        Ok(Self { coarse, all })
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
        Self { coarse: Vec::new(), all }
    }
}
