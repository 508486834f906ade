//! What a fit will take, said before it starts and while it goes on.

use std::time::Duration;

use anyhow::Result;
use gpbrdf_core::gp::{dense_cost, scattered_cost};
use gpbrdf_core::{Content, Solver, Source};

use super::choices::LayoutChoice;
use super::spec::{ModelSpec, PAPER_SAMPLES};

/// Evaluations of likelihood and gradient that a dense search usually takes.
const DENSE_EVALUATIONS: usize = 40;

/// A fit that takes longer than this is announced, seconds.
const LONG: f64 = 10.0;

/// Fewer samples than this take a second and a few MB; measuring the machine's speed would take longer.
const SHORT_RUN: usize = 1000;

/// A sentence about a fit to `samples` samples off a lattice, if it will take long.
///
/// # Errors
/// More memory than is available.
pub(crate) fn forecast(samples: usize, solver: Solver, per_channel: bool) -> Result<Option<String>> {
    if samples < SHORT_RUN {
        return Ok(None);
    }
    // Each channel has a search of its own.
    let searches = if per_channel { 3.0 } else { 1.0 };
    if solver != Solver::Dense {
        let cost = scattered_cost(samples);
        cost.check()?;
        let seconds = searches * cost.seconds;
        return Ok((seconds > LONG).then(|| format!("a fit to {samples} samples takes about {seconds:.0} s")));
    }
    let cost = dense_cost(samples, 3, DENSE_EVALUATIONS);
    cost.check()?;
    let gib = cost.bytes / (1u64 << 30) as f64;
    let seconds = searches * cost.seconds;
    Ok((seconds > LONG)
        .then(|| format!("a dense fit to {samples} samples takes {gib:.1} GiB and about {seconds:.0} s")))
}

/// Memory of a job besides that of its solver, in bytes: its tables, those of the source and what is written of them.
const TABLES: f64 = 400e6;

/// Memory that a job takes, in bytes, with all its files.
pub(crate) fn memory_bytes(source: &Source, spec: &ModelSpec) -> f64 {
    let samples = match &source.content {
        Content::Samples(samples) => samples.len(),
        _ if spec.layout != LayoutChoice::Lattice => spec.scattered_samples(),
        _ => spec.lattice.map_or(spec.samples.unwrap_or(PAPER_SAMPLES), |shape| shape.iter().product()),
    };
    let is_scattered = matches!(source.content, Content::Samples(_)) || spec.layout != LayoutChoice::Lattice;
    let solver = match spec.solver {
        Solver::Dense => dense_cost(samples, 3, DENSE_EVALUATIONS).bytes,
        _ if is_scattered => scattered_cost(samples).bytes,
        _ => 0.0,
    };
    TABLES + solver
}

/// What is said of the time that is left of work of which a share was done in `elapsed`: nothing in its first second
/// and before a twentieth of it is done.
pub(crate) fn remaining(elapsed: Duration, share: f64) -> Option<String> {
    let seconds = elapsed.as_secs_f64();
    let left = seconds * (1.0 - share) / share;
    match left {
        _ if seconds < 1.0 || share < 0.05 => None,
        left if left < 100.0 => Some(format!("about {left:.0} s left")),
        left => Some(format!("about {:.0} min left", left / 60.0)),
    }
}

/// The largest number of samples, of at most `limit`, whose dense fit with `terms` kernels is expected to
/// take no more than `seconds`.
pub(crate) fn samples_within(seconds: f64, terms: usize, limit: usize) -> usize {
    let fits = |n: usize| {
        let cost = dense_cost(n, 3, DENSE_EVALUATIONS * terms);
        cost.seconds <= seconds && cost.check().is_ok()
    };
    let (mut low, mut high) = (64, limit);
    while low + 1 < high {
        let middle = usize::midpoint(low, high);
        if fits(middle) { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_said_once_it_is_known() {
        let at = |seconds: f64, share| remaining(Duration::from_secs_f64(seconds), share);
        assert_eq!(at(0.5, 0.5), None);
        assert_eq!(at(10.0, 0.01), None);
        assert_eq!(at(10.0, 0.25).unwrap(), "about 30 s left");
        assert_eq!(at(100.0, 0.1).unwrap(), "about 15 min left");
        assert_eq!(at(3.0, 1.0).unwrap(), "about 0 s left");
    }
}
