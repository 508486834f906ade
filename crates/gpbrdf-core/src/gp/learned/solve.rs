//! Fits and conditions the process with a learned prior.

use std::sync::Arc;

use super::posterior::{LearnedPosterior, Part};
use crate::base::error::{Error, Result};
use crate::gp::LeaveOneOut;
use crate::gp::hyper::Hyper;
use crate::gp::posterior::Posterior;
use crate::gp::problem::{BasisTerm, Fitted, Problem};
use crate::gp::report::FitReport;
use crate::gp::scattered::solve::{Conditioned, condition_process, fit_process};
use crate::prior::{Colour, Prior, from_opponent, to_opponent, variance_of_channels};

/// Finds hyper-parameters of both kinds of colour and conditions their processes. The targets are those of three
/// channels, whose prior mean is the prior's own.
pub(crate) fn fit(problem: &Problem<'_>, prior: &Arc<Prior>) -> Result<Fitted> {
    let mut found = Vec::new();
    // The chromatic colours take the space of the achromatic one.
    let mut space = problem.space;
    for colour in Colour::ALL {
        let features = prior.features(colour, problem.angles);
        let own = Problem { space, ..of_colour(problem, prior, colour, &features) };
        let (conditioned, report) = fit_process(&own)?;
        space = Some(conditioned.space);
        found.push((conditioned, report));
    }
    let (conditioned, reports): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    Ok((posterior(problem, prior, conditioned)?, combined(&reports)))
}

/// Conditions both processes at known hyper-parameters. The second value is the log marginal likelihood there.
pub(crate) fn condition(
    problem: &Problem<'_>,
    prior: &Arc<Prior>,
    hyper: &Hyper,
) -> Result<(Arc<dyn Posterior>, f64)> {
    let Some(chromatic) = &hyper.chromatic else {
        return Err(Error::argument("hyper-parameters", "those of a fit with a learned prior", "others"));
    };
    let (mut found, mut value) = (Vec::new(), 0.0);
    for (colour, hyper) in Colour::ALL.into_iter().zip([hyper, chromatic]) {
        let features = prior.features(colour, problem.angles);
        let (conditioned, own) = condition_process(&of_colour(problem, prior, colour, &features), hyper)?;
        found.push(conditioned);
        value += own;
    }
    Ok((posterior(problem, prior, found)?, value))
}

/// The problem of one kind of colour.
fn of_colour<'a>(problem: &Problem<'a>, prior: &Prior, colour: Colour, features: &'a [f64]) -> Problem<'a> {
    let mean = prior.mean(colour, problem.angles);
    let y = &problem.targets;
    let targets = colour.rows().map(|row| {
        mean.iter()
            .enumerate()
            .map(|(i, mean)| to_opponent([y[0][i], y[1][i], y[2][i]])[row] - mean)
            .collect()
    });
    Problem {
        targets: targets.collect(),
        usual_variance: None,
        basis: Some(BasisTerm { count: prior.n_functions(colour), rows: features, left: prior.left(colour) }),
        ..problem.clone()
    }
}

fn posterior(
    problem: &Problem<'_>,
    prior: &Arc<Prior>,
    conditioned: Vec<Conditioned>,
) -> Result<Arc<dyn Posterior>> {
    let parts: Vec<Part> = conditioned
        .into_iter()
        .map(|Conditioned { gp, space, order }| Part {
            gp,
            space,
            angles: order.into_iter().map(|i| problem.angles[i]).collect(),
        })
        .collect();
    match <[Part; 2]>::try_from(parts) {
        Ok(parts) => Ok(Arc::new(LearnedPosterior::new(Arc::clone(prior), parts))),
        Err(parts) => Err(Error::argument("processes of colours", "2", parts.len())),
    }
}

/// One report for all channels out of those of both kinds of colour.
fn combined(reports: &[FitReport]) -> FitReport {
    let names = ["achromatic", "chromatic"];
    let at_bound = names
        .iter()
        .zip(reports)
        .flat_map(|(name, report)| report.at_bound.iter().map(move |bound| format!("{name} {bound}")));
    let weights = match reports.iter().map(|report| report.weights.as_slice()).collect::<Vec<_>>()[..] {
        [a, c] if !a.is_empty() && !c.is_empty() => a.iter().zip(c).map(|(a, c)| a.min(*c)).collect(),
        [a, c] => if a.is_empty() { c } else { a }.to_vec(),
        _ => Vec::new(),
    };
    FitReport {
        log_marginal_likelihood: reports.iter().map(|report| report.log_marginal_likelihood).sum(),
        evaluations: reports.iter().map(|report| report.evaluations).sum(),
        converged: reports.iter().all(|report| report.converged),
        at_bound: at_bound.collect(),
        leave_one_out: left_out(reports),
        weights,
    }
}

/// Every sample as it is predicted from all others, in the channels.
fn left_out(reports: &[FitReport]) -> Option<LeaveOneOut> {
    let [bright, coloured] = reports else { return None };
    let (bright, coloured) = (bright.leave_one_out.as_ref()?, coloured.leave_one_out.as_ref()?);
    let rows = bright.residuals.iter().zip(coloured.residuals.chunks(2));
    let variances = bright.variances.iter().zip(&coloured.variances);
    Some(LeaveOneOut {
        log_predictive_density: bright.log_predictive_density + coloured.log_predictive_density,
        residuals: rows.flat_map(|(a, c)| from_opponent([*a, c[0], c[1]])).collect(),
        variances: variances.map(|(a, c)| variance_of_channels(*a, *c)).collect(),
    })
}
