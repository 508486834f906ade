//! Where samples come from.

use serde::{Deserialize, Serialize};

use crate::sample::lattice::LatticeLayout;

/// How the directions of samples were chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SampleLayout {
    /// They stand on a product lattice.
    Lattice,
    /// They were drawn at random.
    Random,
    /// They are centres of table cells.
    Cells,
    /// They are those of a file of measurements.
    #[default]
    Samples,
    /// They are all valid cells of a table.
    Table,
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
        }
    }
}

/// Where samples, and a model that was fitted to them, come from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Name of the material.
    pub material: String,
    /// File or built-in material that was sampled.
    pub source: String,
    /// sha256 of that file, hexadecimal; empty for built-in materials.
    pub sha256: String,
    /// How the directions were chosen.
    pub layout: SampleLayout,
    /// The lattice that the directions stand on, if they do.
    pub lattice: Option<LatticeLayout>,
}
