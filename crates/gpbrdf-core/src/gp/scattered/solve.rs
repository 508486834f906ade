//! Fits and conditions the process of scattered samples.

use std::sync::Arc;

use super::ScatteredGp;
use super::fit::{Data, Search, State};
use super::posterior::ScatteredPosterior;
use crate::base::error::{Error, Result};
use crate::gp::hyper::Hyper;
use crate::gp::posterior::Posterior;
use crate::gp::problem::{Fitted, Problem};
use crate::gp::report::FitReport;
use crate::sample::space::InputSpace;

/// Finds hyper-parameters in each of the spaces to choose from, follows those of the largest likelihood while
/// neighbours and weights change with them, and conditions the process. The kernels measure the joint distance,
/// so only the shapes of the first axis are used.
pub(crate) fn fit(problem: &Problem<'_>) -> Result<Fitted> {
    let (Conditioned { gp, space, .. }, report) = fit_process(problem)?;
    Ok((Arc::new(ScatteredPosterior { gp, space }), report))
}

/// A process, its space, and the place of each of its samples in the order that was given.
pub(crate) struct Conditioned {
    pub(crate) gp: ScatteredGp,
    pub(crate) space: InputSpace,
    pub(crate) order: Vec<usize>,
}

/// Like [`fit`], with a basis if the problem has one.
pub(crate) fn fit_process(problem: &Problem<'_>) -> Result<(Conditioned, FitReport)> {
    problem.noise.validate()?;
    let spaces = problem.space.map_or(InputSpace::ISOTROPIC.to_vec(), |space| vec![space]);
    let mut evaluations = 0;
    let mut best: Option<Search<'_>> = None;
    for space in spaces {
        let search = Search::begin(problem, space, data(problem, space)?)?;
        evaluations += search.evaluations;
        if best.as_ref().is_none_or(|known| known.value() < search.value()) {
            best = Some(search);
        }
    }
    let Some(best) = best else {
        return Err(Error::argument("input spaces", "at least one", "none"));
    };
    evaluations -= best.evaluations;
    let space = best.space;
    let (data, state, mut report) = best.finish()?;
    state.report_samples(&data, &mut report);
    let (gp, value) = state.condition(problem, &data)?;
    report.log_marginal_likelihood = value;
    report.evaluations += evaluations;
    Ok((Conditioned { gp, space, order: data.order().collect() }, report))
}

/// Conditions the process at known hyper-parameters. The second value is the log marginal likelihood there.
pub(crate) fn condition(problem: &Problem<'_>, hyper: &Hyper) -> Result<(Arc<dyn Posterior>, f64)> {
    let (Conditioned { gp, space, .. }, value) = condition_process(problem, hyper)?;
    Ok((Arc::new(ScatteredPosterior { gp, space }), value))
}

/// Like [`condition`], with a basis if the problem has one.
pub(crate) fn condition_process(problem: &Problem<'_>, hyper: &Hyper) -> Result<(Conditioned, f64)> {
    let space = problem.space.or(hyper.space).unwrap_or(InputSpace::ISOTROPIC[0]);
    let data = data(problem, space)?;
    let basis_variance = hyper.basis_variance.unwrap_or(1.0);
    let state = State::known(hyper.kernel.clone(), hyper.noise_variance, basis_variance, &data);
    let (gp, value) = state.condition(problem, &data)?;
    Ok((Conditioned { gp, space, order: data.order().collect() }, value))
}

/// The samples in the coordinates of a space.
fn data(problem: &Problem<'_>, space: InputSpace) -> Result<Data> {
    space.validate()?;
    let points: Vec<[f64; 3]> = problem.angles.iter().map(|&angles| space.coordinates(angles)).collect();
    if let Some(bad) = points.as_flattened().iter().find(|x| !x.is_finite()) {
        return Err(Error::argument("coordinate", "a finite number", bad));
    }
    Ok(Data::new(&points, &problem.targets, problem.known_noise, problem.basis))
}
