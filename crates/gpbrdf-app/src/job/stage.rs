//! The stages of a run: what people read while one goes on, and how long each has taken.

use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;

/// What a run is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    Load,
    Sample,
    Tabulate,
    Fit,
    BakeMean,
    BakeOnDevice,
    BakeSigma,
    Truth,
    Compare,
    Render,
    Write,
}

impl Stage {
    /// What people read.
    pub(crate) fn label(self) -> &'static str {
        match self {
            Self::Load => "Reading",
            Self::Sample => "Sampling",
            Self::Tabulate => "Tabulating",
            Self::Fit => "Fitting",
            Self::BakeMean => "Baking the mean",
            Self::BakeOnDevice => "Baking on the device",
            Self::BakeSigma => "Baking sigma",
            Self::Truth => "Tabulating the truth",
            Self::Compare => "Comparing",
            Self::Render => "Rendering",
            Self::Write => "Writing",
        }
    }

    /// The key of its time in reports; some stages share one.
    fn key(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::Sample | Self::Tabulate => "sample",
            Self::Fit => "fit",
            Self::BakeMean | Self::BakeOnDevice => "bake_mean",
            Self::BakeSigma => "bake_sigma",
            Self::Truth | Self::Compare => "metrics",
            Self::Render => "render",
            Self::Write => "write",
        }
    }
}

/// The keys of every report, in the order of a run.
const KEYS: [&str; 8] = ["load", "sample", "fit", "bake_mean", "bake_sigma", "metrics", "write", TOTAL];
const TOTAL: &str = "total";

/// Wall-clock seconds of each stage; 0 for those that did not run.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub(crate) struct Seconds(BTreeMap<&'static str, f64>);

impl Default for Seconds {
    fn default() -> Self {
        Self(KEYS.into_iter().map(|key| (key, 0.0)).collect())
    }
}

impl Seconds {
    /// Adds the time since `start` to a stage.
    pub(crate) fn add(&mut self, stage: Stage, start: Instant) {
        *self.0.entry(stage.key()).or_default() += start.elapsed().as_secs_f64();
    }

    /// Sets the time of the whole run to that since `start`.
    pub(crate) fn set_total(&mut self, start: Instant) {
        self.0.insert(TOTAL, start.elapsed().as_secs_f64());
    }

    /// The seconds of a stage, together with those that share its key.
    pub(crate) fn of(&self, stage: Stage) -> f64 {
        self.0.get(stage.key()).copied().unwrap_or(0.0)
    }

    /// The stages that took any time, in order, with their milliseconds.
    pub(crate) fn summary(&self) -> String {
        let times = KEYS.iter().filter_map(|key| {
            let seconds = self.0.get(key).copied().filter(|&seconds| seconds > 0.0)?;
            Some(format!("{key} {:.0} ms", 1e3 * seconds))
        });
        times.collect::<Vec<_>>().join(", ")
    }
}
