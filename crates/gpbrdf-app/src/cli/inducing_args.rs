//! Compression of whole tables, as options of `bake` and `fit`.

use clap::Args;
use gpbrdf_core::{CellWeights, InducingSize};

use super::model_args::parse_lattice;

#[derive(Args, Clone, Debug)]
pub(crate) struct InducingArgs {
    /// Compress the whole table: fit inducing lattices of so many nodes along theta_h, theta_d and phi_d to all cells, one
    /// for each of three colour components.
    #[arg(long, value_name = "HxDxP", value_parser = parse_lattice, conflicts_with_all = EXCLUDED)]
    inducing: Option<[usize; 3]>,
    /// Compress the whole table to at most N stored numbers, all constants included; finds the lattices' shapes.
    #[arg(long, value_name = "N", conflicts_with_all = EXCLUDED, conflicts_with = "inducing")]
    floats: Option<usize>,
    /// Share of a cell's weight in the compression that goes by how much it shows in pictures, 0 to 1.
    #[arg(long, value_name = "SHARE", default_value_t = CellWeights::default().picture, allow_hyphen_values = true)]
    picture_weight: f64,
}

/// Options about measurements, of which a compression takes none.
const EXCLUDED: [&str; 5] = ["lattice", "samples", "node_density", "per_channel", "restarts"];

impl InducingArgs {
    /// How much to store, if a compression is asked for.
    pub(crate) fn size(&self) -> Option<InducingSize> {
        self.inducing.map(InducingSize::Shape).or(self.floats.map(InducingSize::Floats))
    }

    /// What cells count for.
    pub(crate) fn weights(&self) -> CellWeights {
        CellWeights { picture: self.picture_weight }
    }
}
