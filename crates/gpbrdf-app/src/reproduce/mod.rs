//! The paper's experiments. Each returns tables and pictures; [`store`] writes those of one experiment
//! together and finds them again.

mod beyond;
mod context;
mod hemisphere;
mod kernels;
mod materials;
mod measures;
mod paper_lattice;
mod pictures;
mod principal;
mod prior;
mod sampling;
mod simulate;
pub(crate) mod store;
mod table;

use anyhow::Result;
use clap::ValueEnum;

use context::Outcome;
pub(crate) use context::{Context, PAPER_MATERIALS, measurements};
pub(crate) use prior::Materials;
pub(crate) use simulate::{BATCHES, Simulation, Trained, Trial};

/// Seconds for a fit on a lattice, its table, pictures and metrics.
const LATTICE: f64 = 4.0;

/// The experiments, in the order of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Experiment {
    /// Analytic models under one light (figure 1 with it).
    Table1,
    /// Error and time against the sampling rate.
    Figure2,
    /// The paper's materials.
    Table2,
    /// Kernels.
    Table3,
    /// Spheres, slices and pixel differences.
    Figures345,
    /// Neural BRDF, sampling curve, calibration.
    Beyond,
    /// Few measurements with a learned prior; needs --library and --data.
    Prior,
}

impl Experiment {
    pub(crate) const ALL: [Self; 7] = [
        Self::Table1,
        Self::Figure2,
        Self::Table2,
        Self::Table3,
        Self::Figures345,
        Self::Beyond,
        Self::Prior,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Table1 => "table1",
            Self::Figure2 => "figure2",
            Self::Table2 => "table2",
            Self::Table3 => "table3",
            Self::Figures345 => "figures345",
            Self::Beyond => "beyond",
            Self::Prior => "prior",
        }
    }

    pub(crate) fn run(self, context: &Context) -> Result<Outcome> {
        match self {
            Self::Table1 => hemisphere::run(context),
            Self::Figure2 => sampling::run(context),
            Self::Table2 => materials::run(context),
            Self::Table3 => kernels::run(context),
            Self::Figures345 => pictures::run(context),
            Self::Beyond => beyond::run(context),
            Self::Prior => prior::run(context),
        }
    }

    /// Whether the experiment has what it needs. One that has not is left out, unless it was asked for.
    pub(crate) fn is_possible(self, context: &Context) -> bool {
        self != Self::Prior || prior::is_possible(context)
    }

    /// The expected time in seconds, right within a factor of three on a machine with two cores. A dense fit
    /// takes its budget, and baking it half as long again; a lattice fit takes [`LATTICE`] with its table,
    /// pictures and metrics.
    pub(crate) fn seconds(self, context: &Context) -> f64 {
        let dense = 1.5 * context.budget + LATTICE;
        let paper = context::PAPER_MATERIALS.len() as f64;
        let paper = if context.only.is_empty() { paper } else { paper.min(context.only.len() as f64) };
        let all = if context.measured.is_empty() { paper } else { context.measured.len() as f64 };
        let quick = context.quick;
        match self {
            Self::Table1 => {
                if quick {
                    8.0
                } else {
                    90.0
                }
            }
            Self::Figure2 => {
                if quick {
                    4.0 * LATTICE + 1.5 * dense
                } else {
                    12.0 * LATTICE + 2.0 * dense
                }
            }
            Self::Table2 => {
                let whole = if quick { 0.0 } else { materials::whole_seconds() };
                paper * (dense + LATTICE + whole)
            }
            Self::Table3 => 6.0 * (dense + 2.0 * LATTICE),
            Self::Figures345 => paper * LATTICE * if quick { 1.0 } else { 3.0 },
            Self::Beyond => {
                if quick {
                    2.0 * 7.0 * LATTICE
                } else {
                    all * 10.0 * LATTICE
                }
            }
            Self::Prior => prior::seconds(context),
        }
    }
}
