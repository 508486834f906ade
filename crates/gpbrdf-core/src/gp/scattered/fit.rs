//! The search for hyper-parameters of scattered samples, weights of suspected outliers, and leave-one-out
//! predictions.

use rayon::prelude::*;

use super::conditional::{Basis, JITTER, Process, Scratch};
use super::conjugate_gradients;
use super::cost::{EVALUATIONS, search_share};
use super::exact::{self, Exact};
use super::neighbours::{Embedded, Neighbours, scrambled_order};
use super::preconditioner::Preconditioner;
use super::product::Covariance;
use super::vecchia::{Targets, log_likelihood};
use super::{NEAREST, ScatteredGp, Widening};
use crate::base::error::{Error, Result};
use crate::base::simd::dot;
use crate::base::watch::Watch;
use crate::gp::optimize::log_prior;
use crate::gp::problem::{BasisTerm, Outliers, Problem};
use crate::gp::report::FitReport;
use crate::gp::search::{SearchStart, extent};
use crate::gp::{LeaveOneOut, OptimizeOptions, Optimum, maximize};
use crate::kernel::{Kernel, Points};
use crate::sample::space::InputSpace;

/// Number of earlier samples that each conditional of the likelihood keeps, for few samples and for many. Of 400 to
/// 1,000 samples 40 take twice as long as 24 and predict no better (docs/performance.md).
const FEW: (usize, usize) = (300, 40);
const MANY: usize = 24;

/// The likelihood of a search is summed over at most this number of samples, spread evenly over the order. Each
/// of them is conditioned on the nearest of all samples before it.
const TERMS: usize = 1000;

/// The largest number of iterations after neighbours or weights have changed.
const LATER_ITERATIONS: u64 = 20;

/// The fewest samples without learned functions whose search has several points to start from.
const SEVERAL_STARTS: usize = 1000;

/// How often weights of outliers are renewed at most.
const WEIGHT_ROUNDS: usize = 4;

/// Degrees of freedom of the Student t distribution that gives suspected outliers their weights.
const DEGREES_OF_FREEDOM: f64 = 4.0;

/// A sample is suspected where the mean square of its standardised leave-one-out residuals exceeds this: six
/// standard deviations in every channel.
const SUSPICIOUS: f64 = 36.0;

/// Number of samples that are left out before somebody may stop the work.
const STEP: usize = 8;

/// Number of nearest samples with which a suspected one is compared.
const WITNESSES: usize = 12;

/// Samples in the scrambled order, in which nothing depends on how they were given.
pub(super) struct Data {
    /// The place of each sample in the order that was given.
    order: Vec<u32>,
    /// Coordinates, rows of three.
    x: Vec<f64>,
    /// Targets, one column per channel.
    y: Vec<Vec<f64>>,
    /// What is known of the noise variance of each sample.
    known_noise: Vec<f64>,
    basis: Basis,
}

/// Hyper-parameters and weights of samples.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) kernel: Kernel,
    pub(super) noise_variance: f64,
    pub(super) basis_variance: f64,
    /// The weight of each sample, in the scrambled order.
    weights: Vec<f64>,
}

impl Data {
    /// `basis` are the values of basis functions, one row per sample.
    pub(super) fn new(
        points: &[[f64; 3]],
        targets: &[Vec<f64>],
        known_noise: &[f64],
        basis: Option<BasisTerm<'_>>,
    ) -> Self {
        let order = scrambled_order(points.as_flattened(), 3, targets);
        let sorted = |values: &[f64]| -> Vec<f64> { order.iter().map(|&i| values[i as usize]).collect() };
        let x = order.iter().flat_map(|&i| points[i as usize]).collect();
        let y = targets.iter().map(|t| sorted(t)).collect();
        let known_noise = if known_noise.is_empty() { vec![0.0; order.len()] } else { sorted(known_noise) };
        let basis = basis.map_or_else(Basis::default, |BasisTerm { count, rows, .. }| {
            let row = |&i: &u32| &rows[i as usize * count..(i as usize + 1) * count];
            Basis { count, rows: order.iter().flat_map(row).copied().collect() }
        });
        Self { order, x, y, known_noise, basis }
    }

    /// The place of each sample in the order that was given.
    pub(super) fn order(&self) -> impl Iterator<Item = usize> + '_ {
        self.order.iter().map(|&i| i as usize)
    }

    fn len(&self) -> usize {
        self.order.len()
    }

    /// The samples, for factorisations of their whole covariance with kernels of this metric.
    fn exact(&self, kernel: &Kernel) -> Exact {
        Exact::new(&self.x, &kernel.metric, &self.basis)
    }

    /// The part of each sample's noise variance that is proportional to the shared one, and the whole.
    fn noise(&self, noise_variance: f64, weights: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let shared: Vec<f64> = weights.iter().map(|w| noise_variance / w).collect();
        let all = shared.iter().zip(&self.known_noise).map(|(a, b)| a + b).collect();
        (shared, all)
    }

    /// Values of the scrambled order in the order that was given.
    fn as_given(&self, values: &[f64], width: usize) -> Vec<f64> {
        let mut out = vec![0.0; values.len()];
        for (row, &i) in values.chunks(width).zip(&self.order) {
            out[i as usize * width..(i as usize + 1) * width].copy_from_slice(row);
        }
        out
    }
}

fn conditioned_on(n: usize) -> usize {
    if n <= FEW.0 { FEW.1 } else { MANY }
}

/// A search for hyper-parameters and weights in one space.
pub(super) struct Search<'a> {
    problem: &'a Problem<'a>,
    start: SearchStart,
    found: Optimum,
    state: State,
    pub(super) data: Data,
    pub(super) space: InputSpace,
    pub(super) evaluations: usize,
}

impl<'a> Search<'a> {
    /// Finds hyper-parameters with all samples of weight 1 and with neighbours in the metric of the start.
    pub(super) fn begin(problem: &'a Problem<'a>, space: InputSpace, data: Data) -> Result<Self> {
        let metrics = space.metrics();
        let extents: Vec<f64> = (0..3).map(|k| extent(&data.x, 3, k, metrics[k])).collect();
        let start = SearchStart::new(
            (&data.y.concat(), problem.usual_variance.filter(|_| problem.priors)),
            data.y.len(),
            &extents,
            &metrics,
            &problem.kernel[0],
            problem.noise,
        );
        let start = problem.basis.map_or(start.clone(), |basis| start.with_basis(basis.left));
        let start = if problem.priors { start.with_priors(space.usual_lengths()) } else { start };
        let state = State {
            kernel: start.kernel.clone(),
            noise_variance: 0.0,
            basis_variance: 0.0,
            weights: vec![1.0; data.len()],
        };
        let mut likelihood = Likelihood::new(problem, &data, &start, &state)?;
        // Of few samples the priors decide, unless there are functions that can say the same as the kernel.
        let several = problem.priors && (problem.basis.is_some() || data.len() >= SEVERAL_STARTS);
        let points = if several { start.alternatives() } else { Vec::new() };
        let from = likelihood.likeliest(&points)?;
        let found = likelihood.maximise(from, problem.optimize)?;
        let evaluations = points.len() + found.evaluations;
        Ok(Self { problem, start, found, state, data, space, evaluations })
    }

    /// The log marginal likelihood so far.
    pub(super) fn value(&self) -> f64 {
        self.found.value - self.found.log_prior
    }

    /// Follows the optimum while neighbours and weights change with it.
    pub(super) fn finish(mut self) -> Result<(Data, State, FitReport)> {
        let n = self.data.len();
        let later = OptimizeOptions {
            restarts: 0,
            max_iterations: LATER_ITERATIONS.min(self.problem.optimize.max_iterations),
            ..*self.problem.optimize
        };
        for round in 0..WEIGHT_ROUNDS {
            self.take_optimum()?;
            let changed = self.problem.outliers == Outliers::Downweight
                && self.state.renew_weights(&self.data, self.problem.watch)?;
            // Neighbours are those of the length scales that were found; weights are renewed until they stay.
            if !changed && (round > 0 || n <= conditioned_on(n)) {
                break;
            }
            let converged = self.found.converged;
            self.found = Likelihood::new(self.problem, &self.data, &self.start, &self.state)?
                .maximise(None, &later)?;
            // Later searches only follow what has changed a little.
            self.found.converged |= converged;
            self.evaluations += self.found.evaluations;
        }
        self.take_optimum()?;
        let report = FitReport {
            log_marginal_likelihood: self.value(),
            evaluations: self.evaluations,
            converged: self.found.converged,
            at_bound: self.found.at_bound,
            ..FitReport::default()
        };
        Ok((self.data, self.state, report))
    }

    /// Goes on from the hyper-parameters that were found.
    fn take_optimum(&mut self) -> Result<()> {
        self.start.start_from(&self.found.log_parameters);
        let others = self.start.set(&mut self.state.kernel, &self.found.log_parameters)?;
        self.state.noise_variance = others.noise_variance;
        self.state.basis_variance = others.basis_variance;
        Ok(())
    }
}

/// The log marginal likelihood of hyper-parameters, with the weights of a state and neighbours in the metric of its
/// kernel.
struct Likelihood<'a> {
    problem: &'a Problem<'a>,
    data: &'a Data,
    start: &'a SearchStart,
    weights: &'a [f64],
    kernel: Kernel,
    /// The whole covariance, where it is factorised. With a basis all samples are correlated, so few samples are not
    /// left to their neighbours.
    exact: Option<Exact>,
    neighbours: Neighbours,
    /// The samples over which the likelihood is summed.
    terms: Vec<u32>,
}

impl<'a> Likelihood<'a> {
    fn new(
        problem: &'a Problem<'a>,
        data: &'a Data,
        start: &'a SearchStart,
        state: &'a State,
    ) -> Result<Self> {
        let n = data.len();
        let is_exact = data.basis.count > 0 && (n <= exact::MOST_SAMPLES || problem.factorises);
        let (exact, neighbours) = if is_exact {
            (Some(data.exact(&state.kernel)), Neighbours::default())
        } else {
            let (count, watch) = (conditioned_on(n), problem.watch.part(0.0, 0.0));
            (None, Embedded::new(&data.x, &state.kernel).nearest_before(count, &watch)?)
        };
        let (kernel, terms) = (state.kernel.clone(), evenly(n, TERMS));
        Ok(Self { problem, data, start, weights: &state.weights, kernel, exact, neighbours, terms })
    }

    /// The value and its gradient at log-parameters.
    fn at(&mut self, log_parameters: &[f64]) -> Result<(f64, Vec<f64>)> {
        let n = self.data.len();
        self.problem.watch.evaluation_towards(EVALUATIONS, search_share(n))?;
        let others = self.start.set(&mut self.kernel, log_parameters)?;
        let (shared, all) = self.data.noise(others.noise_variance, self.weights);
        let process = Process {
            kernel: &self.kernel,
            x: &self.data.x,
            noise: &all,
            basis: &self.data.basis,
            basis_variance: others.basis_variance,
        };
        let targets = Targets { y: &self.data.y, shared_noise: &shared };
        let (value, mut gradient, scale) = if let Some(exact) = &mut self.exact {
            let (value, gradient) = exact.log_likelihood(&process, &targets)?;
            (value, gradient, 1.0)
        } else {
            let (value, gradient) = log_likelihood(&process, &targets, &self.neighbours, &self.terms);
            (value, gradient, n as f64 / self.terms.len() as f64)
        };
        gradient.truncate(log_parameters.len());
        gradient.iter_mut().for_each(|g| *g *= scale);
        Ok((scale * value, gradient))
    }

    /// The most probable one of several points to start from, if there is a likelihood at any: many samples with much
    /// noise have one optimum where they are rough and another, poorer one where nearly all of their variance is noise,
    /// and a search that begins with smooth functions and little noise may end in that one.
    fn likeliest<'p>(&mut self, points: &'p [Vec<f64>]) -> Result<Option<&'p [f64]>> {
        let mut best: Option<(f64, &[f64])> = None;
        for point in points {
            let value = match self.at(point) {
                Ok((value, _)) => value + log_prior(&self.start.parameters, point, &mut []),
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                // Where there is no likelihood, no search begins.
                Err(_) => continue,
            };
            if value.is_finite() && best.is_none_or(|(known, _)| known < value) {
                best = Some((value, point));
            }
        }
        Ok(best.map(|(_, point)| point))
    }

    /// Maximises the likelihood from these log-parameters, or from the usual ones.
    fn maximise(mut self, from: Option<&[f64]>, options: &OptimizeOptions) -> Result<Optimum> {
        let mut parameters = self.start.parameters.clone();
        for (parameter, start) in parameters.iter_mut().zip(from.unwrap_or_default()) {
            parameter.start = *start;
        }
        let targets = self.data.len() * self.data.y.len();
        maximize(&parameters, targets, options, |p| self.at(p))
    }
}

/// At most `count` of the indices `0..n`, evenly spaced, all where there are no more.
fn evenly(n: usize, count: usize) -> Vec<u32> {
    let count = count.min(n);
    (0..count).map(|k| u32::try_from(k * n / count).unwrap_or(u32::MAX)).collect()
}

impl State {
    /// Every sample as it is predicted from the nearest others, in the scrambled order: residuals, rows with one
    /// value per channel, and variances of a measurement of weight 1.
    fn leave_one_out(&self, data: &Data, watch: &Watch) -> Result<(Vec<f64>, Vec<f64>, Neighbours)> {
        let (_, all) = data.noise(self.noise_variance, &self.weights);
        let process = self.process(data, &all);
        let nearest = Embedded::new(&data.x, &self.kernel).nearest_others(NEAREST, &watch.part(0.0, 0.2))?;
        let of_measurement = |i: usize, latent: f64| latent + self.noise_variance + data.known_noise[i];
        if data.basis.count > 0
            && data.len() <= exact::MOST_SAMPLES
            && let Ok((residuals, variances)) = data.exact(&self.kernel).leave_one_out(&process, &data.y)
        {
            let latent = variances.iter().zip(&all).map(|(v, noise)| (v - noise).max(0.0));
            let variances = latent.enumerate().map(|(i, latent)| of_measurement(i, latent)).collect();
            return Ok((residuals, variances, nearest));
        }
        let left_out = watch.part(0.2, 1.0);
        let steps = left_out.steps(data.len() / STEP);
        let rows: Vec<(Vec<f64>, f64)> = (0..data.len())
            .into_par_iter()
            .map_init(
                || Scratch::new(&self.kernel),
                |scratch, i| {
                    if i % STEP == STEP - 1 {
                        steps.take()?;
                    }
                    let given = nearest.of(i);
                    let (b, latent) = scratch.condition(&process, i, given);
                    let residual = |y: &Vec<f64>| {
                        y[i] - b.iter().zip(given).map(|(b, &j)| b * y[j as usize]).sum::<f64>()
                    };
                    let residuals = data.y.iter().map(residual).collect();
                    Ok((residuals, of_measurement(i, latent)))
                },
            )
            .collect::<Result<_>>()?;
        let (residuals, variances): (Vec<Vec<f64>>, Vec<f64>) = rows.into_iter().unzip();
        Ok((residuals.concat(), variances, nearest))
    }

    /// Gives suspected outliers the weights of Student's t distribution, all others the weight 1. Returns whether
    /// any weight has changed by more than a factor of 2.
    fn renew_weights(&mut self, data: &Data, watch: &Watch) -> Result<bool> {
        let channels = data.y.len();
        let (residuals, variances, nearest) = self.leave_one_out(data, &watch.part(0.0, 0.0))?;
        let square = |i: usize| {
            let row = &residuals[i * channels..(i + 1) * channels];
            row.iter().map(|r| r * r).sum::<f64>() / variances[i]
        };
        let mean =
            |i: usize| residuals[i * channels..(i + 1) * channels].iter().sum::<f64>() / channels as f64;
        let level = |i: usize| data.y.iter().map(|y| y[i]).sum::<f64>() / channels as f64;
        let mut changed = false;
        for i in 0..data.len() {
            let witnesses: Vec<usize> = nearest.of(i).iter().take(WITNESSES).map(|&j| j as usize).collect();
            // Around a highlight the nearest samples differ from each other, too, and a highlight is brightest
            // where no other sample is as near to the mirror direction.
            let mut levels: Vec<f64> = witnesses.iter().map(|&j| level(j)).collect();
            levels.sort_unstable_by(f64::total_cmp);
            let spread = if levels.len() > 3 { levels[levels.len() - 2] - levels[1] } else { f64::INFINITY };
            let first = |i: usize| data.x[3 * i];
            let is_top = mean(i) > 0.0 && witnesses.iter().all(|&j| first(j) > first(i));
            let suspected = square(i) > SUSPICIOUS * channels as f64 && mean(i).abs() > spread && !is_top;
            let weight = if suspected {
                (DEGREES_OF_FREEDOM + channels as f64) / (DEGREES_OF_FREEDOM + square(i))
            } else {
                1.0
            };
            let ratio = weight / self.weights[i];
            changed |= !(0.5..=2.0).contains(&ratio);
            self.weights[i] = weight;
        }
        Ok(changed)
    }

    /// How much wider intervals must be than the process says. Not with a basis, which correlates all samples: a
    /// learned prior knows from other materials how wide they must be.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled) where the observer stops the work.
    pub(super) fn widening(&self, data: &Data, space: InputSpace, watch: &Watch) -> Result<Widening> {
        if data.basis.count > 0 {
            return Ok(Widening::default());
        }
        let (_, all) = data.noise(self.noise_variance, &self.weights);
        Widening::measured(&self.process(data, &all), &data.y, &self.weights, space, watch)
    }

    /// Adds what the samples say about themselves to a report: predictions from all others, and weights.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled) where the observer stops the work.
    pub(super) fn report_samples(
        &self,
        data: &Data,
        widening: Widening,
        watch: &Watch,
        report: &mut FitReport,
    ) -> Result<()> {
        let (residuals, mut variances, _) = self.leave_one_out(data, watch)?;
        let prior = self.kernel.prior_variance();
        for (i, variance) in variances.iter_mut().enumerate() {
            let noise = self.noise_variance + data.known_noise[i];
            *variance = widening.widened(data.x[3 * i], (*variance - noise).max(0.0), prior) + noise;
        }
        let density = residuals.chunks(data.y.len()).zip(&variances).map(|(row, v)| {
            row.iter().map(|r| -0.5 * ((std::f64::consts::TAU * v).ln() + r * r / v)).sum::<f64>()
        });
        report.leave_one_out = Some(LeaveOneOut {
            log_predictive_density: density.sum(),
            residuals: data.as_given(&residuals, data.y.len()),
            variances: data.as_given(&variances, 1),
        });
        if self.weights.iter().any(|&w| w != 1.0) {
            report.weights = data.as_given(&self.weights, 1);
        }
        Ok(())
    }

    /// Conditions the process. The second value is the log likelihood over all samples.
    pub(super) fn condition(self, watch: &Watch, data: &Data) -> Result<(ScatteredGp, f64)> {
        let n = data.len();
        let embedded = Embedded::new(&data.x, &self.kernel);
        let neighbours = embedded.nearest_before(NEAREST, &watch.part(0.0, 0.02))?;
        let (_, all) = data.noise(self.noise_variance, &self.weights);
        let process = self.process(data, &all);
        let preconditioner = Preconditioner::new(&process, neighbours, &watch.part(0.02, 0.1))?;
        let points = Points::new(&data.x, &self.kernel.metric);
        let jitter = JITTER * self.kernel.prior_variance();
        let diagonal: Vec<f64> = all.iter().map(|noise| noise + jitter).collect();
        let covariance = Covariance {
            kernel: &self.kernel,
            points: &points,
            diagonal: &diagonal,
            basis: &data.basis,
            basis_variance: self.basis_variance,
        };
        let y = data.y.concat();
        let solution = conjugate_gradients::solve(&covariance, &preconditioner, &y, &watch.part(0.1, 1.0))?;
        let channels = data.y.len();
        let constant = channels as f64 * (n as f64 * std::f64::consts::TAU.ln() + solution.log_det);
        let value = -0.5 * (dot(&y, &solution.x) + constant);
        let far_field = preconditioner.into_far_field();
        let (noise, x) = (all, data.x.clone());
        let basis = (data.basis.clone(), self.basis_variance);
        let gp = ScatteredGp::new(self.kernel, self.noise_variance, noise, x, basis, channels, solution.x)?;
        Ok((gp.with_far_field(far_field), value))
    }

    /// Known hyper-parameters, with all samples of weight 1.
    pub(super) fn known(kernel: Kernel, noise_variance: f64, basis_variance: f64, data: &Data) -> Self {
        Self { kernel, noise_variance, basis_variance, weights: vec![1.0; data.len()] }
    }

    /// The posterior mean of the coefficients of the basis, `v b(X)^T K^-1 y`, of each channel, for few samples.
    ///
    /// # Errors
    /// A covariance that is not positive definite.
    pub(super) fn basis_coefficients(&self, data: &Data) -> Result<Vec<Vec<f64>>> {
        let (_, all) = data.noise(self.noise_variance, &self.weights);
        let weights = data.exact(&self.kernel).weights(&self.process(data, &all), &data.y)?;
        let of_channel = |weights: &[f64]| data.basis.weighted_sum(self.basis_variance, weights);
        Ok(weights.chunks(data.len().max(1)).map(of_channel).collect())
    }

    /// The same hyper-parameters and weights for other data of the same samples, with a variance of the basis.
    pub(super) fn moved(self, from: &Data, to: &Data, basis_variance: f64) -> Self {
        let given = from.as_given(&self.weights, 1);
        Self { weights: to.order().map(|i| given[i]).collect(), basis_variance, ..self }
    }

    /// The process with this noise variance of each sample.
    fn process<'a>(&'a self, data: &'a Data, noise: &'a [f64]) -> Process<'a> {
        Process {
            kernel: &self.kernel,
            x: &data.x,
            noise,
            basis: &data.basis,
            basis_variance: self.basis_variance,
        }
    }
}
