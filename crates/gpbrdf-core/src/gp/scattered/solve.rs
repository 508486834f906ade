//! Fits and conditions the process of scattered samples.

use std::sync::Arc;

use super::cost::search_share;
use super::fit::{Data, Search, State};
use super::posterior::ScatteredPosterior;
use crate::base::error::{Error, Result};
use crate::gp::hyper::Hyper;
use crate::gp::posterior::Posterior;
use crate::gp::problem::{Fitted, Problem};
use crate::sample::space::InputSpace;

/// The number of samples with which leaving one out takes as long as all products.
const LEFT_OUT: f64 = 3e3;

/// Finds hyper-parameters in each of the spaces to choose from, follows those of the largest likelihood while
/// neighbours and weights change with them, and conditions the process. The kernels measure the joint distance,
/// so only the shapes of the first axis are used.
pub(crate) fn fit(problem: &Problem<'_>) -> Result<Fitted> {
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
    let (searched, n) = (search_share(problem.angles.len()), problem.angles.len() as f64);
    let left_out = searched + (1.0 - searched) * LEFT_OUT / (LEFT_OUT + n);
    state.report_samples(&data, &problem.watch.part(searched, left_out), &mut report)?;
    let (gp, value) = state.condition(&problem.watch.part(left_out, 1.0), &data)?;
    report.log_marginal_likelihood = value;
    report.evaluations += evaluations;
    Ok((Arc::new(ScatteredPosterior { gp, space }), report))
}

/// Conditions the process at known hyper-parameters. The second value is the log marginal likelihood there.
pub(crate) fn condition(problem: &Problem<'_>, hyper: &Hyper) -> Result<(Arc<dyn Posterior>, f64)> {
    let space = problem.space.or(hyper.space).unwrap_or(InputSpace::ISOTROPIC[0]);
    let data = data(problem, space)?;
    let state = State::known(hyper.kernel.clone(), hyper.noise_variance, &data);
    let (gp, value) = state.condition(problem.watch, &data)?;
    Ok((Arc::new(ScatteredPosterior { gp, space }), value))
}

/// The samples in the coordinates of a space.
fn data(problem: &Problem<'_>, space: InputSpace) -> Result<Data> {
    space.validate()?;
    let points: Vec<[f64; 3]> = problem.angles.iter().map(|&angles| space.coordinates(angles)).collect();
    if let Some(bad) = points.as_flattened().iter().find(|x| !x.is_finite()) {
        return Err(Error::argument("coordinate", "a finite number", bad));
    }
    Ok(Data::new(&points, &problem.targets, problem.known_noise))
}
