//! What a fit will take, said before it starts.

use anyhow::Result;
use gpbrdf_core::Solver;
use gpbrdf_core::gp::{dense_cost, scattered_cost};

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
