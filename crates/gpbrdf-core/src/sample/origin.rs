//! The origin of samples.

use serde::{Deserialize, Serialize};

use crate::sample::lattice::LatticeLayout;

/// How the directions of samples were chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SampleLayout {
    /// The nodes of a product lattice.
    Lattice,
    /// Directions drawn at random.
    Random,
    /// Centres of table cells drawn at random.
    Cells,
    /// The directions of a file of measurements.
    #[default]
    Samples,
    /// All cells of a table that are above the horizon.
    Table,
    /// Light and viewer drawn uniformly in solid angle.
    Hemisphere,
    /// A scan in the plane of incidence.
    InPlane,
    /// The grid of a goniometer.
    Gonio,
}

impl SampleLayout {
    /// The name in reports and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Lattice => "lattice",
            Self::Random => "random",
            Self::Cells => "cells",
            Self::Samples => "samples",
            Self::Table => "table",
            Self::Hemisphere => "hemisphere",
            Self::InPlane => "in_plane",
            Self::Gonio => "gonio",
        }
    }
}

/// The origin of samples, and of a model that was fitted to them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Name of the material.
    pub material: String,
    /// The file or built-in material that was sampled.
    pub source: String,
    /// SHA-256 sum of that file, hexadecimal; empty for built-in materials.
    pub sha256: String,
    /// How the directions were chosen.
    pub layout: SampleLayout,
    /// The lattice whose nodes are the directions, if there is one.
    pub lattice: Option<LatticeLayout>,
}
