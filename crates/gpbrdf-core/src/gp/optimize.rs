//! Bounded maximisation of a log marginal likelihood by L-BFGS in log-parameters.

use std::cell::RefCell;
use std::rc::Rc;

use argmin::core::TerminationStatus;
use argmin::core::{CostFunction, Error as ArgminError, Executor, Gradient, State, TerminationReason};
use argmin::solver::linesearch::condition::ArmijoCondition;
use argmin::solver::linesearch::{BacktrackingLineSearch, HagerZhangLineSearch, MoreThuenteLineSearch};
use argmin::solver::quasinewton::LBFGS;

use crate::base::error::{Error, Result};
use crate::base::random::SplitMix64;

/// One parameter of a maximisation, on a logarithmic scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name of the parameter in reports, for example `length_scale[0]`.
    pub name: String,
    /// Natural logarithm of the value at which the search starts.
    pub start: f64,
    /// Natural logarithm of the lower bound.
    pub lower: f64,
    /// Natural logarithm of the upper bound.
    pub upper: f64,
    /// What is known of the parameter beforehand; `None` if nothing is.
    pub prior: Option<LogNormal>,
}

/// A log-normal prior of a positive parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogNormal {
    /// Natural logarithm of the median.
    pub log_median: f64,
    /// Standard deviation of the logarithm.
    pub deviation: f64,
}

impl LogNormal {
    /// A prior with this median whose logarithm has this standard deviation.
    #[must_use]
    pub fn new(median: f64, deviation: f64) -> Self {
        Self { log_median: median.ln(), deviation }
    }

    /// The log density of the logarithm without its constant, and its derivative.
    fn log_density(self, log_value: f64) -> (f64, f64) {
        let z = (log_value - self.log_median) / self.deviation;
        (-0.5 * z * z, -z / self.deviation)
    }
}

/// Limits of a search, and the number of its starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OptimizeOptions {
    /// Largest number of L-BFGS iterations per start.
    pub max_iterations: u64,
    /// The search ends when the norm of the gradient of the log-likelihood, divided by the number of targets,
    /// falls below this.
    pub gradient_tolerance: f64,
    /// The search ends when an iteration gains less than this in the log-likelihood divided by the number of
    /// targets.
    pub gain_tolerance: f64,
    /// Number of additional starts, drawn uniformly between the logarithmic bounds.
    pub restarts: usize,
    /// Seed of the random numbers from which the additional starts are drawn.
    pub seed: u64,
}

impl Default for OptimizeOptions {
    fn default() -> Self {
        Self { max_iterations: 100, gradient_tolerance: 1e-4, gain_tolerance: 1e-7, restarts: 0, seed: 0 }
    }
}

/// The outcome of a maximisation.
#[derive(Clone, Debug, PartialEq)]
pub struct Optimum {
    /// Natural logarithms of the best parameters found.
    pub log_parameters: Vec<f64>,
    /// Value of the objective at these parameters, priors included.
    pub value: f64,
    /// The part of the value that is due to priors.
    pub log_prior: f64,
    /// Number of evaluations of the objective and its gradient, over all starts.
    pub evaluations: usize,
    /// Whether the search from the best start ended because it reached one of the tolerances.
    pub converged: bool,
    /// Names of the parameters that ended at one of their bounds.
    pub at_bound: Vec<String>,
}

/// Maximises `objective` (its value and gradient in log-parameters) plus the log densities of the priors within
/// bounds. With a log marginal likelihood as the objective, the maximum is the posterior mode of the logarithms
/// of the parameters (maximum a posteriori).
///
/// Bounds enter by the substitution `p = lower + (upper - lower) (1 + sin x) / 2`, and the search runs over
/// the free variable `x`. The objective is divided by the number of targets, so that tolerances
/// mean the same for every amount of data. The method is the L-BFGS of `argmin` with the line search of More
/// and Thuente. Where that line search fails, the search continues from the best point with the one of Hager
/// and Zhang, and after that with backtracking. A point at which the objective fails, for example because a
/// covariance is not positive definite, is treated as infinitely bad.
///
/// # Errors
/// [`Error::Cancelled`] as soon as the objective returns it. Where the objective is finite at no point of any
/// start, the last error that it returned, or [`Error::InvalidArgument`] if it returned none.
pub fn maximize<F>(
    parameters: &[Parameter],
    n_targets: usize,
    options: &OptimizeOptions,
    objective: F,
) -> Result<Optimum>
where
    F: FnMut(&[f64]) -> Result<(f64, Vec<f64>)>,
{
    let scale = 1.0 / n_targets.max(1) as f64;
    let shared = Rc::new(RefCell::new(Shared {
        objective,
        parameters: parameters.to_vec(),
        scale,
        last: None,
        best: None,
        evaluations: 0,
        failure: None,
    }));
    let mut overall: Option<(f64, Vec<f64>, bool)> = None;
    let mut random = SplitMix64::new(options.seed);
    for start in 0..=options.restarts {
        let mut x: Vec<f64> = parameters
            .iter()
            .map(|p| {
                let fraction =
                    if start == 0 { (p.start - p.lower) / (p.upper - p.lower) } else { random.next_unit() };
                // The start is kept away from the bounds, where the substitution has a slope of zero.
                (2.0 * fraction.clamp(0.02, 0.98) - 1.0).asin()
            })
            .collect();
        shared.borrow_mut().best = None;
        let mut converged = false;
        for search in [LineSearchKind::MoreThuente, LineSearchKind::HagerZhang, LineSearchKind::Backtracking]
        {
            let ended = run(search, &shared, x.clone(), options);
            if matches!(shared.borrow().failure, Some(Error::Cancelled)) {
                return Err(Error::Cancelled);
            }
            if let Some((_, best)) = &shared.borrow().best {
                x.clone_from(best);
            }
            if let Some(by_tolerance) = ended {
                converged = by_tolerance;
                break;
            }
        }
        let best = shared.borrow_mut().best.take();
        if let Some((cost, x)) = best
            && overall.as_ref().is_none_or(|(known, ..)| cost < *known)
        {
            overall = Some((cost, x, converged));
        }
    }
    let mut shared = shared.borrow_mut();
    let Some((cost, x, converged)) = overall else {
        return Err(shared.failure.take().unwrap_or_else(|| {
            Error::argument("log marginal likelihood", "a finite value", "none at any start")
        }));
    };
    let log_parameters: Vec<f64> = parameters.iter().zip(&x).map(|(p, &x)| p.at(x)).collect();
    let at_bound = parameters
        .iter()
        .zip(&log_parameters)
        .filter(|(p, v)| {
            let margin = 0.005 * (p.upper - p.lower);
            **v < p.lower + margin || **v > p.upper - margin
        })
        .map(|(p, _)| p.name.clone())
        .collect();
    let log_prior = log_prior(parameters, &log_parameters, &mut []);
    let (value, evaluations) = (-cost / scale, shared.evaluations);
    Ok(Optimum { log_parameters, value, log_prior, evaluations, converged, at_bound })
}

/// The sum of the log densities of all priors at a point; their derivatives are added to `gradient`.
pub(crate) fn log_prior(parameters: &[Parameter], point: &[f64], gradient: &mut [f64]) -> f64 {
    let mut sum = 0.0;
    for (k, (parameter, &value)) in parameters.iter().zip(point).enumerate() {
        if let Some(prior) = parameter.prior {
            let (density, slope) = prior.log_density(value);
            sum += density;
            if let Some(gradient) = gradient.get_mut(k) {
                *gradient += slope;
            }
        }
    }
    sum
}

impl Parameter {
    /// The parameter that belongs to the free variable `x`.
    fn at(&self, x: f64) -> f64 {
        self.lower + (self.upper - self.lower) * 0.5 * (1.0 + x.sin())
    }

    /// The derivative of [`Parameter::at`] in `x`.
    fn slope(&self, x: f64) -> f64 {
        (self.upper - self.lower) * 0.5 * x.cos()
    }
}

#[derive(Clone, Copy)]
enum LineSearchKind {
    MoreThuente,
    HagerZhang,
    Backtracking,
}

/// The objective with a memory of its last and its best point. argmin requests value and gradient in separate
/// calls, so without the memory every point would be evaluated twice.
struct Shared<F> {
    objective: F,
    parameters: Vec<Parameter>,
    scale: f64,
    last: Option<(Vec<f64>, f64, Vec<f64>)>,
    best: Option<(f64, Vec<f64>)>,
    evaluations: usize,
    failure: Option<Error>,
}

impl<F: FnMut(&[f64]) -> Result<(f64, Vec<f64>)>> Shared<F> {
    /// The negative scaled objective, which argmin minimises, and its gradient in the free variables.
    fn evaluate(&mut self, x: &[f64]) -> Result<(f64, Vec<f64>), ArgminError> {
        if let Some((known, cost, gradient)) = &self.last
            && known.as_slice() == x
        {
            return Ok((*cost, gradient.clone()));
        }
        let point: Vec<f64> = self.parameters.iter().zip(x).map(|(p, &x)| p.at(x)).collect();
        self.evaluations += 1;
        let (cost, gradient) = match (self.objective)(&point) {
            Ok((value, mut gradient)) if value.is_finite() => {
                let value = value + log_prior(&self.parameters, &point, &mut gradient);
                let slopes = self.parameters.iter().zip(x).map(|(p, &x)| p.slope(x));
                let gradient = gradient.iter().zip(slopes).map(|(g, s)| -g * s * self.scale).collect();
                (-value * self.scale, gradient)
            }
            Ok(_) => (f64::MAX.sqrt(), vec![0.0; x.len()]),
            Err(error) => {
                let cancelled = matches!(error, Error::Cancelled);
                self.failure = Some(error);
                if cancelled {
                    return Err(ArgminError::msg("cancelled"));
                }
                (f64::MAX.sqrt(), vec![0.0; x.len()])
            }
        };
        if cost < f64::MAX.sqrt() && self.best.as_ref().is_none_or(|(known, _)| cost < *known) {
            self.best = Some((cost, x.to_vec()));
        }
        self.last = Some((x.to_vec(), cost, gradient.clone()));
        Ok((cost, gradient))
    }
}

struct Problem<F>(Rc<RefCell<Shared<F>>>);

impl<F: FnMut(&[f64]) -> Result<(f64, Vec<f64>)>> CostFunction for Problem<F> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, ArgminError> {
        Ok(self.0.borrow_mut().evaluate(x)?.0)
    }
}

impl<F: FnMut(&[f64]) -> Result<(f64, Vec<f64>)>> Gradient for Problem<F> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, x: &Vec<f64>) -> Result<Vec<f64>, ArgminError> {
        Ok(self.0.borrow_mut().evaluate(x)?.1)
    }
}

/// Runs L-BFGS once. Returns whether the run ended because it reached a tolerance, or `None` where the line
/// search failed.
fn run<F>(
    search: LineSearchKind,
    shared: &Rc<RefCell<Shared<F>>>,
    x: Vec<f64>,
    options: &OptimizeOptions,
) -> Option<bool>
where
    F: FnMut(&[f64]) -> Result<(f64, Vec<f64>)>,
{
    macro_rules! execute {
        ($line_search:expr) => {{
            let solver = LBFGS::new($line_search, 8)
                .with_tolerance_grad(options.gradient_tolerance)
                .and_then(|s| s.with_tolerance_cost(options.gain_tolerance))
                .ok()?;
            let result = Executor::new(Problem(Rc::clone(shared)), solver)
                .configure(|state| state.param(x).max_iters(options.max_iterations))
                .run()
                .ok()?;
            match result.state().get_termination_status() {
                TerminationStatus::Terminated(TerminationReason::MaxItersReached) => Some(false),
                TerminationStatus::Terminated(_) => Some(true),
                TerminationStatus::NotTerminated => None,
            }
        }};
    }
    match search {
        LineSearchKind::MoreThuente => execute!(MoreThuenteLineSearch::new().with_c(1e-4, 0.9).ok()?),
        LineSearchKind::HagerZhang => execute!(HagerZhangLineSearch::new()),
        LineSearchKind::Backtracking => {
            execute!(BacktrackingLineSearch::new(ArmijoCondition::new(1e-4).ok()?))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(name: &str, start: f64, lower: f64, upper: f64) -> Parameter {
        Parameter { name: name.into(), start, lower, upper, prior: None }
    }

    #[test]
    fn finds_the_maximum_of_a_curved_valley() {
        let parameters = [parameter("a", -1.2, -3.0, 3.0), parameter("b", 1.0, -3.0, 3.0)];
        let options =
            OptimizeOptions { gradient_tolerance: 1e-8, gain_tolerance: 1e-14, ..Default::default() };
        let found = maximize(&parameters, 1, &options, |p| {
            let (a, b) = (1.0 - p[0], p[1] - p[0] * p[0]);
            Ok((-(a * a + 100.0 * b * b), vec![2.0 * a + 400.0 * b * p[0], -200.0 * b]))
        })
        .unwrap();
        assert!(found.converged && found.at_bound.is_empty(), "{found:?}");
        assert!((found.log_parameters[0] - 1.0).abs() < 1e-4, "{found:?}");
        assert!(found.evaluations < 100, "{found:?}");
    }

    #[test]
    fn priors_pull_what_the_objective_leaves_open() {
        let prior = Some(LogNormal { log_median: 0.7, deviation: 0.5 });
        let parameters =
            [parameter("known", 0.0, -2.0, 2.0), Parameter { prior, ..parameter("open", 0.0, -2.0, 2.0) }];
        // The first parameter is measured to 0.1; nothing is known of the second one but its prior.
        let objective = |p: &[f64]| Ok((-50.0 * (p[0] - 0.3).powi(2), vec![-100.0 * (p[0] - 0.3), 0.0]));
        let found = maximize(&parameters, 1, &OptimizeOptions::default(), objective).unwrap();
        assert!((found.log_parameters[0] - 0.3).abs() < 1e-3, "{found:?}");
        assert!((found.log_parameters[1] - 0.7).abs() < 1e-3, "{found:?}");
        let both = [Parameter { prior, ..parameter("both", 0.0, -2.0, 2.0) }];
        let measured = |p: &[f64]| Ok((-2.0 * (p[0] - 0.2).powi(2), vec![-4.0 * (p[0] - 0.2)]));
        let found = maximize(&both, 1, &OptimizeOptions::default(), measured).unwrap();
        // Two normal densities of the same width: the mode is half way.
        assert!((found.log_parameters[0] - 0.45).abs() < 1e-3, "{found:?}");
        assert!((found.log_prior + 0.125).abs() < 1e-3 && (found.value + 0.25).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn says_which_parameter_hits_its_bound_and_which_run_did_not_converge() {
        let slope = |p: &[f64]| Ok((p[0] - p[1] * p[1], vec![1.0, -2.0 * p[1]]));
        let parameters = [parameter("up", 0.0, -1.0, 2.0), parameter("mid", 0.5, -2.0, 2.0)];
        let found = maximize(&parameters, 1, &OptimizeOptions::default(), slope).unwrap();
        assert_eq!(found.at_bound, ["up"]);
        assert!((found.value - 2.0).abs() < 1e-2, "{found:?}");
        let short = OptimizeOptions { max_iterations: 1, ..Default::default() };
        assert!(!maximize(&parameters, 1, &short, slope).unwrap().converged);
    }

    #[test]
    fn restarts_are_seeded_and_escape_a_local_maximum() {
        let two_hills = |p: &[f64]| {
            let hill = |c: f64, h: f64| h * (-(p[0] - c).powi(2) * 8.0).exp();
            let slope = |c: f64, h: f64| -16.0 * (p[0] - c) * hill(c, h);
            Ok((hill(-1.0, 1.0) + hill(1.5, 3.0), vec![slope(-1.0, 1.0) + slope(1.5, 3.0)]))
        };
        let parameters = [parameter("p", -1.0, -2.0, 2.0)];
        let stuck = maximize(&parameters, 1, &OptimizeOptions::default(), two_hills).unwrap();
        assert!((stuck.value - 1.0).abs() < 1e-3, "{stuck:?}");
        let options = OptimizeOptions { restarts: 8, seed: 3, ..Default::default() };
        let found = maximize(&parameters, 1, &options, two_hills).unwrap();
        assert!((found.value - 3.0).abs() < 1e-3, "{found:?}");
        assert_eq!(found, maximize(&parameters, 1, &options, two_hills).unwrap());
    }

    #[test]
    fn failures_and_cancellation_come_back_as_errors() {
        let parameters = [parameter("p", 0.0, -1.0, 1.0)];
        let options = OptimizeOptions::default();
        let cancelled = maximize(&parameters, 1, &options, |_| Err(Error::Cancelled));
        assert!(matches!(cancelled, Err(Error::Cancelled)));
        let failing = maximize(&parameters, 1, &options, |_| {
            Err(Error::NotPositiveDefinite { size: 3, largest_jitter: 1e-6 })
        });
        assert!(matches!(failing, Err(Error::NotPositiveDefinite { .. })));
        assert!(maximize(&parameters, 1, &options, |_| Ok((f64::NAN, vec![0.0]))).is_err());
    }
}
