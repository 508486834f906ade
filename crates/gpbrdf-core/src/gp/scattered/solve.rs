//! Fits and conditions the process of scattered samples.

use std::sync::Arc;

use super::fit::{Data, State, search};
use super::posterior::ScatteredPosterior;
use crate::base::error::{Error, Result};
use crate::gp::hyper::Hyper;
use crate::gp::posterior::Posterior;
use crate::gp::problem::{Fitted, Problem};
use crate::gp::report::{FitReport, Noise};

/// Finds hyper-parameters and conditions the process at them. The kernels measure the joint distance, so only
/// the shapes of the first axis are used.
pub(crate) fn fit(problem: &Problem<'_>) -> Result<Fitted> {
    if let Noise::Fixed(variance) = problem.noise
        && !(variance > 0.0 && variance.is_finite())
    {
        return Err(Error::argument("noise variance", "a positive number", variance));
    }
    let data = data(problem)?;
    let (state, mut report) = search(problem, &data)?;
    let (gp, value) = state.condition(problem, &data, &mut report)?;
    report.log_marginal_likelihood = value;
    Ok((Arc::new(ScatteredPosterior { gp, space: problem.space }), report))
}

/// Conditions the process at known hyper-parameters. The second value is the log marginal likelihood there.
pub(crate) fn condition(problem: &Problem<'_>, hyper: &Hyper) -> Result<(Arc<dyn Posterior>, f64)> {
    let data = data(problem)?;
    let state = State::known(hyper.kernel.clone(), hyper.noise_variance, &data);
    let (gp, value) = state.condition(problem, &data, &mut FitReport::default())?;
    Ok((Arc::new(ScatteredPosterior { gp, space: problem.space }), value))
}

fn data(problem: &Problem<'_>) -> Result<Data> {
    problem.space.validate()?;
    let points: Vec<[f64; 3]> =
        problem.angles.iter().map(|&angles| problem.space.coordinates(angles)).collect();
    if let Some(bad) = points.as_flattened().iter().find(|x| !x.is_finite()) {
        return Err(Error::argument("coordinate", "a finite number", bad));
    }
    Ok(Data::new(&points, &problem.targets, problem.known_noise))
}
