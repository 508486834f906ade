//! What a dense fit will take, said before it starts.

use anyhow::Result;
use gpbrdf_core::{DenseCost, dense_cost};

/// Evaluations of likelihood and gradient that a dense search usually takes.
pub(crate) const DENSE_EVALUATIONS: usize = 40;

/// A fit that takes longer than this is announced, seconds.
const LONG: f64 = 10.0;

/// Fewer samples than this take a second and a few MB; measuring the machine's speed would take longer.
const SHORT_RUN: usize = 1000;

/// Memory and time of one dense fit to `samples` samples.
fn cost(samples: usize, per_channel: bool) -> DenseCost {
    let mut cost = dense_cost(samples, 3, DENSE_EVALUATIONS);
    if per_channel {
        cost.seconds *= 3.0;
    }
    cost
}

/// A sentence about a dense fit to `samples` samples, if it will take long.
///
/// # Errors
/// More memory than is available.
pub(crate) fn forecast(samples: usize, per_channel: bool) -> Result<Option<String>> {
    if samples < SHORT_RUN {
        return Ok(None);
    }
    let cost = cost(samples, per_channel);
    cost.check()?;
    let gib = cost.bytes / (1u64 << 30) as f64;
    let seconds = cost.seconds;
    Ok((seconds > LONG)
        .then(|| format!("a dense fit to {samples} samples takes {gib:.1} GiB and about {seconds:.0} s")))
}
