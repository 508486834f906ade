//! The symmetry of a BRDF in `phi_d`.

use std::f64::consts::{FRAC_PI_2, PI};

use serde::{Deserialize, Serialize};

/// The symmetry of `f` in `phi_d` on which a layout and a model rely.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Symmetry {
    /// `f` is the same at `phi_d` and `pi - phi_d`, in addition to reciprocity: `phi` folds to `[0, pi/2]`.
    #[default]
    Bilateral,
    /// `f` is the same only at `phi_d` and `phi_d + pi`: `phi` is on a circle of length `pi`.
    Reciprocal,
}

impl Symmetry {
    /// The length of the axis of `phi`: `pi/2` if it is folded, else `pi`.
    pub(crate) fn phi_extent(self) -> f64 {
        match self {
            Self::Bilateral => FRAC_PI_2,
            Self::Reciprocal => PI,
        }
    }
}
