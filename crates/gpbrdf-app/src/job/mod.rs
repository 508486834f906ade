//! One job for both programs: measure a source, fit a model to it, bake the model and judge the result.
//!
//! [`ModelSpec`] says how to measure and what to fit; it is read from a command line by clap and from a
//! session of the viewer by serde. [`Run`] does the work and tells an [`Observer`] of its stages and results.
//! [`Report`] is what the command line says about a run, to machines and to people.

#![cfg_attr(
    not(feature = "viewer"),
    allow(
        dead_code,
        unused_imports,
        reason = "results as they come and samples that are kept serve the viewer"
    )
)]

mod backend;
mod choices;
mod compression;
mod figure_kind;
mod forecast;
#[cfg(feature = "viewer")]
mod hyper;
mod judge;
mod kernels;
mod plan_file;
mod portrait;
mod prior;
mod report;
mod run;
mod sample;
mod spec;
mod stage;

pub(crate) use backend::Backend;
pub(crate) use choices::{LayoutChoice, NoiseChoice, SymmetryChoice, TransformChoice};
pub(crate) use figure_kind::FigureKind;
pub(crate) use forecast::{memory_bytes, remaining, samples_within};
#[cfg(feature = "viewer")]
pub(crate) use hyper::{bound_name, hyper_sliders};
pub(crate) use judge::judge;
pub(crate) use kernels::Kernels;
pub(crate) use plan_file::{expected_errors, plan_csv};
pub(crate) use portrait::{Portrait, Subject};
pub(crate) use prior::PriorName;
pub(crate) use report::{Report, metric_lines};
#[cfg(feature = "viewer")]
pub(crate) use run::is_cancelled;
pub(crate) use run::{Baked, Baking, Found, Job, Judging, Observer, Outcome, Run, Truth};
pub(crate) use sample::Measured;
pub(crate) use spec::{ModelSpec, PAPER_SAMPLES};
pub(crate) use stage::Stage;
