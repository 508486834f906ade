//! Compression of whole tables.

use anyhow::{Result, bail};
use clap::Args;
use gpbrdf_core::InducingSize;
use gpbrdf_core::model::CellWeights;
use serde::{Deserialize, Serialize};

use super::choices::parse_lattice;

/// How much to store of a whole table, if it is to be compressed.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(next_help_heading = "Model")]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Compression {
    /// Compress the whole table: fit inducing lattices of so many nodes along theta_h, theta_d and phi_d to
    /// all cells, one for each of three colour components.
    #[arg(long, value_name = "HxDxP", value_parser = parse_lattice, conflicts_with_all = EXCLUDED)]
    pub(crate) inducing: Option<[usize; 3]>,
    /// Compress the whole table to at most N stored numbers, all constants included; finds the lattices'
    /// shapes.
    #[arg(long, value_name = "N", conflicts_with_all = EXCLUDED, conflicts_with = "inducing")]
    pub(crate) floats: Option<usize>,
    /// Share of a cell's weight in the compression that goes by how much it shows in pictures, 0 to 1.
    #[arg(
        long,
        value_name = "SHARE",
        default_value_t = Compression::default().picture_weight,
        allow_hyphen_values = true
    )]
    pub(crate) picture_weight: f64,
}

/// Options about measurements, of which a compression takes none.
const EXCLUDED: [&str; 5] = ["lattice", "samples", "node_density", "per_channel", "restarts"];

impl Default for Compression {
    fn default() -> Self {
        Self { inducing: None, floats: None, picture_weight: CellWeights::default().picture }
    }
}

impl Compression {
    /// How much to store, if a compression is asked for.
    pub(crate) fn size(&self) -> Option<InducingSize> {
        self.inducing.map(InducingSize::Shape).or(self.floats.map(InducingSize::Floats))
    }

    /// How much the cells weigh.
    pub(crate) fn weights(&self) -> CellWeights {
        CellWeights { picture: self.picture_weight }
    }
}

/// Refuses an option that a compression does not heed and that is not at its default.
pub(super) fn refuse_others(options: &[(&str, bool)]) -> Result<()> {
    for (option, is_default) in options {
        if !is_default {
            bail!("{option}: expected its default for inducing lattices, found another value");
        }
    }
    Ok(())
}
