//! Fits and conditions the dense process for samples at any directions.

use std::sync::Arc;

use super::DenseGp;
use super::fit::DenseFit;
use super::posterior::DensePosterior;
use crate::base::error::Result;
use crate::gp::hyper::Hyper;
use crate::gp::posterior::Posterior;
use crate::gp::problem::{Fitted, Problem};
use crate::gp::search::UsualValues;
use crate::sample::lattice::LatticeLayout;
use crate::sample::space::InputSpace;

/// Finds hyper-parameters by maximum marginal likelihood and conditions the process at them. The kernels
/// measure the joint distance, so only the shapes of the first axis are used.
pub(crate) fn fit(problem: &Problem<'_>) -> Result<Fitted> {
    problem.refuse_known_noise()?;
    let (space, points) = inputs(problem)?;
    let search = DenseFit {
        x: points.as_flattened(),
        targets: &problem.targets,
        metrics: &space.metrics(),
        shapes: &problem.kernel[0],
        noise: problem.noise,
        priors: problem
            .priors
            .then(|| UsualValues { lengths: space.usual_lengths(), variance: problem.usual_variance }),
        options: problem.optimize,
    };
    let (gp, report) = search.run(&|| problem.watch.evaluation())?;
    Ok((Arc::new(DensePosterior { gp, space }), report))
}

/// Conditions the process at known hyper-parameters. The second value is the log marginal likelihood there.
pub(crate) fn condition(problem: &Problem<'_>, hyper: &Hyper) -> Result<(Arc<dyn Posterior>, f64)> {
    problem.refuse_known_noise()?;
    let (space, points) = inputs(problem)?;
    let targets = &problem.targets;
    let y: Vec<f64> = (0..points.len()).flat_map(|i| targets.iter().map(move |t| t[i])).collect();
    let gp = DenseGp::fit_at(
        points.as_flattened(),
        &y,
        targets.len(),
        hyper.kernel.clone(),
        hyper.noise_variance,
    )?;
    let value = gp.log_marginal_likelihood()?;
    Ok((Arc::new(DensePosterior { gp, space }), value))
}

/// The input space and the coordinates of the samples in it. Samples on a lattice use the space of the
/// lattice.
fn inputs(problem: &Problem<'_>) -> Result<(InputSpace, Vec<[f64; 3]>)> {
    let space = problem
        .lattice
        .map_or(problem.space.unwrap_or(InputSpace::ISOTROPIC[0]), |lattice: &LatticeLayout| {
            lattice.space().into()
        });
    space.validate()?;
    Ok((space, problem.angles.iter().map(|&angles| space.coordinates(angles)).collect()))
}
