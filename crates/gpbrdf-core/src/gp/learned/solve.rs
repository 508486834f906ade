//! Fits and conditions the process with a learned prior.

use std::sync::Arc;

use super::posterior::{LearnedPosterior, Part};
use crate::base::error::{Error, Result};
use crate::base::linalg::{factorize, solve_lower};
use crate::base::simd::dot;
use crate::brdf::angles::HalfDiff;
use crate::gp::hyper::Hyper;
use crate::gp::posterior::Posterior;
use crate::gp::problem::{BasisTerm, Fitted, Problem};
use crate::gp::report::FitReport;
use crate::gp::scattered::cost::EVALUATIONS;
use crate::gp::scattered::solve::{Conditioned, condition_process, fit_process, spread};
use crate::gp::{FitCost, LeaveOneOut, dense_cost};
use crate::prior::{Colour, Prior, from_opponent, to_opponent, variance_of_channels};
use crate::sample::MeanFunction;

/// Deviation of the brightness by which a material may differ from one of the library that it is like.
const BRIGHTNESS: f64 = 0.5;

/// The least effective number of materials that shape an adapted prior.
const FEWEST_MATERIALS: f64 = 20.0;

/// The largest number of samples with which materials are compared. With 512 of them 1,000 samples take 1.4 times as
/// long to fit and are not predicted better (docs/performance.md).
const MOST_COMPARED: usize = 256;

/// Finds hyper-parameters of both kinds of colour and conditions their processes. The targets are those of three
/// channels, whose prior mean is the prior's own.
///
/// The achromatic colour is fitted twice: with the prior of all materials of the library, to a few hundred samples, and
/// with the one of those that the samples resemble. For samples that are neither on a lattice nor in the plane of
/// incidence, which say most of the directions between them, another fit of it without a prior says what the prior is
/// worth ([`FitReport::evidence_of_prior`]).
pub(crate) fn fit(problem: &Problem<'_>, prior: &Arc<Prior>) -> Result<Fitted> {
    if problem.factorises {
        problem.refuse_known_noise()?;
        // The factor, and the products of the functions.
        let cost = dense_cost(problem.angles.len(), 3, EVALUATIONS);
        FitCost { bytes: 2.0 * cost.bytes, ..cost }.check()?;
    }
    let is_spread = problem.lattice.is_none() && !problem.is_in_plane();
    // Fits of about the same length.
    let fits = if is_spread { 4.0 } else { 3.0 };
    let part = |nth: f64| problem.watch.part(nth / fits, (nth + 1.0) / fits);
    let fit_colour = |nth: f64, problem: &Problem<'_>, prior: &Prior, colour: Colour, space| {
        let features = prior.features(colour, problem.angles);
        let watch = &part(nth);
        fit_process(&Problem { space, watch, ..of_colour(problem, prior, colour, &features) })
    };
    let some = spread(problem, MOST_COMPARED)?;
    let some = some.of(problem);
    let (first, first_report) = fit_colour(0.0, &some, prior, Colour::Achromatic, problem.space)?;
    let weights = library_weights(&some, prior, &first)?;
    let adapted = prior.weighted(&weights)?;
    let (bright, mut bright_report) =
        fit_colour(1.0, problem, &adapted, Colour::Achromatic, Some(first.space))?;
    bright_report.evaluations += first_report.evaluations;
    // The chromatic colours take the space of the achromatic one.
    let (coloured, coloured_report) =
        fit_colour(2.0, problem, &adapted, Colour::Chromatic, Some(bright.space))?;
    let mut evidence_of_prior = None;
    if is_spread {
        let watch = &part(3.0);
        let (_, without) = fit_process(&Problem { watch, ..of_brightness_alone(problem) })?;
        let of_mean = 0.5 * (problem.angles.len() as f64).ln();
        let gain = bright_report.log_marginal_likelihood - without.log_marginal_likelihood;
        evidence_of_prior = Some(gain + of_mean);
    }
    let posterior = posterior(problem, prior, (weights, adapted), vec![bright, coloured])?;
    let report = combined(&[bright_report, coloured_report]);
    Ok((posterior, FitReport { evidence_of_prior, ..report }))
}

/// The achromatic colour as a stationary process about its mean over the samples.
fn of_brightness_alone<'a>(problem: &Problem<'a>) -> Problem<'a> {
    let n = problem.angles.len();
    let mut brightness: Vec<f64> = (0..n).map(|i| colours_of(problem, i)[0]).collect();
    let mean = MeanFunction::Constant.offset(&brightness);
    brightness.iter_mut().for_each(|y| *y -= mean);
    // The sum of three alike channels over the root of 3.
    let usual_variance = problem.usual_variance.map(|of_channel| 3.0 * of_channel);
    Problem { targets: vec![brightness], usual_variance, basis: None, ..problem.clone() }
}

/// How much the samples resemble each material of the library, as weights with a sum of 1: the likelihood of the
/// samples if the material were that one but for its brightness, noise and the rest that the kernel describes, to a
/// power of at most 1 at which no fewer than 20 materials count.
fn library_weights(problem: &Problem<'_>, prior: &Prior, found: &Conditioned) -> Result<Vec<f64>> {
    let angles: Vec<HalfDiff> = found.order.iter().map(|&i| problem.angles[i]).collect();
    let features = prior.features(Colour::Achromatic, &angles);
    let mean = prior.mean(Colour::Achromatic, &angles);
    let (n, count) = (angles.len(), prior.n_functions(Colour::Achromatic));
    if count == 0 {
        return Ok(Vec::new());
    }
    let kernel = found.gp.kernel();
    let x: Vec<[f64; 3]> = angles.iter().map(|&at| found.space.coordinates(at)).collect();
    let mut factor = vec![0.0; n * n];
    for j in 0..n {
        for i in j..n {
            factor[j * n + i] = kernel.value(&x[i], &x[j]) + BRIGHTNESS * BRIGHTNESS;
        }
        factor[j * n + j] += found.gp.noise()[j];
    }
    if !factorize(&mut factor, n) {
        return Ok(Vec::new());
    }
    let log_likelihoods: Vec<f64> = prior
        .scores()
        .map(|z| {
            let rest = |(k, &i): (usize, &usize)| {
                colours_of(problem, i)[0] - mean[k] - dot(&features[k * count..(k + 1) * count], z)
            };
            let mut white: Vec<f64> = found.order.iter().enumerate().map(rest).collect();
            solve_lower(&factor, n, &mut white);
            -0.5 * dot(&white, &white)
        })
        .collect();
    Ok(tempered(&log_likelihoods))
}

/// `exp(t l) / sum exp(t l)` with the largest `t` of at most 1 for which the effective number `1 / sum w^2` is large
/// enough.
fn tempered(log_likelihoods: &[f64]) -> Vec<f64> {
    let largest = log_likelihoods.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights = |t: f64| {
        let mut weights: Vec<f64> = log_likelihoods.iter().map(|l| (t * (l - largest)).exp()).collect();
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
        weights
    };
    let effective = |t: f64| weights(t).iter().map(|w| w * w).sum::<f64>().recip();
    let wanted = FEWEST_MATERIALS.min(0.5 * log_likelihoods.len() as f64);
    let (mut low, mut high) = (0.0, 1.0);
    if effective(high) >= wanted {
        return weights(high);
    }
    // The effective number falls with t.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if effective(middle) >= wanted { low = middle } else { high = middle }
    }
    weights(low)
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
    let adapted = prior.weighted(&hyper.library_weights)?;
    let (mut found, mut value) = (Vec::new(), 0.0);
    for (colour, hyper) in Colour::ALL.into_iter().zip([hyper, chromatic]) {
        let features = adapted.features(colour, problem.angles);
        let (conditioned, own) = condition_process(&of_colour(problem, &adapted, colour, &features), hyper)?;
        found.push(conditioned);
        value += own;
    }
    Ok((posterior(problem, prior, (hyper.library_weights.clone(), adapted), found)?, value))
}

/// The three colours of the targets of sample `i`.
fn colours_of(problem: &Problem<'_>, i: usize) -> [f64; 3] {
    to_opponent(std::array::from_fn(|channel| problem.targets[channel][i]))
}

/// The problem of one kind of colour.
fn of_colour<'a>(problem: &Problem<'a>, prior: &Prior, colour: Colour, features: &'a [f64]) -> Problem<'a> {
    let mean = prior.mean(colour, problem.angles);
    let targets = colour
        .rows()
        .map(|row| mean.iter().enumerate().map(|(i, mean)| colours_of(problem, i)[row] - mean).collect());
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
    adapted: (Vec<f64>, Arc<Prior>),
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
        Ok(parts) => Ok(Arc::new(LearnedPosterior::new(Arc::clone(prior), adapted, parts))),
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
        evidence_of_prior: None,
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
