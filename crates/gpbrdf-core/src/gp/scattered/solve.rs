//! Fits and conditions the process of scattered samples.

use std::sync::Arc;

use super::cost::search_share;
use super::fit::{Data, Search, State};
use super::posterior::ScatteredPosterior;
use super::{ScatteredGp, Widening, exact};
use crate::base::error::{Error, Result};
use crate::base::simd::dot;
use crate::gp::hyper::Hyper;
use crate::gp::posterior::Posterior;
use crate::gp::problem::{BasisTerm, Fitted, Problem, Subset};
use crate::gp::report::FitReport;
use crate::sample::space::InputSpace;

/// The number of samples with which leaving one out takes as long as all products.
const LEFT_OUT: f64 = 3e3;

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
    let Found { data, state, space, widening, mut report } = match problem.basis {
        Some(basis) if problem.angles.len() > exact::MOST_SAMPLES && !problem.factorises => {
            search_with_basis(problem, basis)?
        }
        _ => search(problem)?,
    };
    let (gp, value) = state.condition(&problem.watch.part(left_out_share(problem), 1.0), &data)?;
    report.log_marginal_likelihood = value;
    Ok((Conditioned { gp: gp.widened(widening)?, space, order: data.order().collect() }, report))
}

/// Hyper-parameters and weights, what was searched, and how.
struct Found {
    data: Data,
    state: State,
    space: InputSpace,
    widening: Widening,
    report: FitReport,
}

/// The share of a fit that is done before its process is conditioned.
fn left_out_share(problem: &Problem<'_>) -> f64 {
    let (searched, n) = (search_share(problem.angles.len()), problem.angles.len() as f64);
    searched + (1.0 - searched) * LEFT_OUT / (LEFT_OUT + n)
}

/// Finds hyper-parameters in each of the spaces to choose from and follows those of the largest likelihood.
fn search(problem: &Problem<'_>) -> Result<Found> {
    // What a basis leaves of samples in the plane of incidence is best taken out of it as it is.
    let spaces = match problem.space {
        Some(space) => vec![space],
        None if problem.basis.is_some() && problem.is_in_plane() => vec![InputSpace::PlaneOfIncidence],
        None => InputSpace::ISOTROPIC.to_vec(),
    };
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
    let searched = search_share(problem.angles.len());
    let watch = problem.watch.part(searched, left_out_share(problem));
    let widening = state.widening(&data, space, &watch.part(0.0, 0.1))?;
    state.report_samples(&data, widening, &watch.part(0.1, 1.0), &mut report)?;
    report.evaluations += evaluations;
    Ok(Found { data, state, space, widening, report })
}

/// Like [`search`] for many samples with a basis, which correlates all of them, so that neighbours do not tell its
/// coefficients: these, the variance of the basis and the space come from 512 samples, kernel and noise from what they
/// leave of all samples.
fn search_with_basis(problem: &Problem<'_>, basis: BasisTerm<'_>) -> Result<Found> {
    let some = spread(problem, exact::MOST_SAMPLES)?;
    let halves = [(0.0, 0.5), (0.5, 1.0)].map(|(from, to)| {
        let end = left_out_share(problem);
        problem.watch.part(from * end, to * end)
    });
    let few = search(&Problem { watch: &halves[0], ..some.of(problem) })?;
    let coefficients = few.state.basis_coefficients(&few.data)?;
    let row = |i: usize| &basis.rows[i * basis.count..(i + 1) * basis.count];
    let left =
        |(y, z): (&Vec<f64>, &Vec<f64>)| y.iter().enumerate().map(|(i, y)| y - dot(row(i), z)).collect();
    let rest = search(&Problem {
        watch: &halves[1],
        targets: problem.targets.iter().zip(&coefficients).map(left).collect(),
        space: Some(few.space),
        basis: None,
        ..problem.clone()
    })?;
    let data = data(problem, rest.space)?;
    let state = rest.state.moved(&rest.data, &data, few.state.basis_variance);
    let evaluations = rest.report.evaluations + few.report.evaluations;
    let report = FitReport { evaluations, ..rest.report };
    Ok(Found { data, state, space: rest.space, widening: rest.widening, report })
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
    let widening = state.widening(&data, space, &problem.watch.part(0.0, 0.1))?;
    let (gp, value) = state.condition(&problem.watch.part(0.1, 1.0), &data)?;
    Ok((Conditioned { gp: gp.widened(widening)?, space, order: data.order().collect() }, value))
}

/// At most `count` samples that are spread like all of them, whatever their order.
pub(crate) fn spread(problem: &Problem<'_>, count: usize) -> Result<Subset> {
    let space = problem.space.unwrap_or(InputSpace::ISOTROPIC[0]);
    let indices: Vec<usize> = data(problem, space)?.order().take(count).collect();
    Ok(Subset::new(problem, &indices))
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
