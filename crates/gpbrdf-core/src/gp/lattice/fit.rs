//! The search for the hyper-parameters of the lattice process, by maximum marginal likelihood.

use crate::base::error::Result;
use crate::gp::hyper::{AXIS_NAMES, MIN_NOISE_RATIO};
use crate::gp::lattice::{LatticeData, LatticeGp, LatticeHyper};
use crate::gp::report::{FitReport, Noise};
use crate::gp::{OptimizeOptions, Optimum, Parameter, maximize};
use crate::kernel::{Kernel1d, ParameterKind};

/// Fits a lattice process; the search starts from the parameters of `kernels`.
///
/// With [`Noise::Optimized`] the signal variance is profiled out, and the search runs over the parameters of
/// the kernels and the ratio of noise to signal variance. With [`Noise::Fixed`] it runs over the parameters
/// of the kernels and the signal variance. A large lattice is first fitted on every second node along each
/// axis, which costs an eighth. One evaluation takes `O(n (A + B + C))`. `evaluation` is called before each
/// evaluation of the likelihood, and an error that it returns ends the search.
///
/// # Errors
/// Invalid data, kernels or noise variance, and the errors of `evaluation`.
pub fn fit_lattice(
    data: LatticeData,
    kernels: &[Kernel1d; 3],
    noise: Noise,
    options: &OptimizeOptions,
    evaluation: &dyn Fn() -> Result<()>,
) -> Result<(LatticeGp, FitReport)> {
    data.validate()?;
    kernels.iter().try_for_each(Kernel1d::validate)?;
    noise.validate()?;
    let variance = data.targets.iter().map(|y| y * y).sum::<f64>() / data.targets.len() as f64;
    let mut problem = Problem { kernels: kernels.clone(), noise };
    let mut parameters = problem.parameters(&data, variance.max(1e-12));
    let mut evaluations = 0;
    if data.len() >= 4096 && data.shape().iter().all(|&n| n >= 12) {
        let coarse = data.decimated();
        let loose = OptimizeOptions { gradient_tolerance: 1e-2, gain_tolerance: 1e-4, ..*options };
        let found = problem.search(&parameters, &coarse, &loose, evaluation)?;
        evaluations += found.evaluations;
        for (parameter, start) in parameters.iter_mut().zip(found.log_parameters) {
            parameter.start = start;
        }
    }
    let single = OptimizeOptions { restarts: if evaluations > 0 { 0 } else { options.restarts }, ..*options };
    let found = problem.search(&parameters, &data, &single, evaluation)?;
    evaluations += found.evaluations;
    let hyper = problem.hyper(&data, &found.log_parameters)?;
    let report = FitReport {
        log_marginal_likelihood: found.value,
        evaluations,
        converged: found.converged,
        at_bound: found.at_bound,
        ..FitReport::default()
    };
    Ok((LatticeGp::new(data, hyper)?, report))
}

impl LatticeData {
    /// The lattice with every second node along each axis, which gives a first guess at the hyper-parameters
    /// for an eighth of the work.
    fn decimated(&self) -> Self {
        let [_, b, c] = self.shape();
        let coordinates =
            self.coordinates.each_ref().map(|x| x.iter().copied().step_by(2).collect::<Vec<_>>());
        let mut targets = Vec::with_capacity(self.targets.len() / 8 + 1);
        for tensor in self.targets.chunks(self.len()) {
            for plane in tensor.chunks(b * c).step_by(2) {
                for row in plane.chunks(c).step_by(2) {
                    targets.extend(row.iter().step_by(2));
                }
            }
        }
        Self { coordinates, metrics: self.metrics, mirrored: self.mirrored, targets, channels: self.channels }
    }
}

/// The kernels with their current log-parameters, and the rule for the noise variance.
struct Problem {
    kernels: [Kernel1d; 3],
    noise: Noise,
}

impl Problem {
    /// All parameters with their starts and bounds: those of the three kernels, then the noise ratio or the
    /// signal variance.
    fn parameters(&self, data: &LatticeData, variance: f64) -> Vec<Parameter> {
        let mut parameters = Vec::new();
        for (k, kernel) in self.kernels.iter().enumerate() {
            let x = &data.coordinates[k];
            let extent = x.iter().copied().fold(f64::NEG_INFINITY, f64::max)
                - x.iter().copied().fold(f64::INFINITY, f64::min);
            let extent = extent.max(f64::MIN_POSITIVE.sqrt());
            let kinds = kernel.parameter_kinds(k).into_iter();
            for ((kind, name), start) in kinds.zip(kernel.parameter_names()).zip(kernel.log_parameters()) {
                let (lower, upper) = match kind {
                    // Nodes cannot tell apart length scales that are shorter than their spacing.
                    ParameterKind::LengthScale(_) => (0.7 * extent / x.len() as f64, 20.0 * extent),
                    ParameterKind::Alpha => (0.05, 1e3),
                    ParameterKind::Weight | ParameterKind::Variance => (1e-5, 1e5),
                };
                let name = format!("{}.{name}", AXIS_NAMES[k]);
                parameters.push(Parameter { name, start, lower: lower.ln(), upper: upper.ln(), prior: None });
            }
        }
        parameters.push(match self.noise {
            Noise::Optimized => Parameter {
                name: "noise_ratio".into(),
                start: 1e-4f64.ln(),
                lower: MIN_NOISE_RATIO.ln(),
                upper: 10f64.ln(),
                prior: None,
            },
            Noise::Fixed(noise) => Parameter {
                name: "signal_variance".into(),
                start: variance.ln(),
                lower: (1e-4 * variance).max(noise * 1e-1).ln(),
                upper: (1e6 * variance).max(noise * 1e1).min(noise / MIN_NOISE_RATIO).ln(),
                prior: None,
            },
        });
        parameters
    }

    /// Writes log-parameters into the kernels and returns the last one, which does not belong to a kernel.
    fn set(&mut self, log_parameters: &[f64]) -> Result<f64> {
        let mut rest = log_parameters;
        for kernel in &mut self.kernels {
            let (own, others) = rest.split_at(kernel.n_parameters());
            kernel.set_log_parameters(own)?;
            rest = others;
        }
        Ok(rest[0])
    }

    fn search(
        &mut self,
        parameters: &[Parameter],
        data: &LatticeData,
        options: &OptimizeOptions,
        evaluation: &dyn Fn() -> Result<()>,
    ) -> Result<Optimum> {
        maximize(parameters, data.targets.len(), options, |p| {
            evaluation()?;
            let last = self.set(p)?.exp();
            let (likelihood, slope) = match self.noise {
                Noise::Optimized => {
                    let (_, l) = data.profile_likelihood(&self.kernels, last)?;
                    let slope = l.d_noise;
                    (l, slope)
                }
                Noise::Fixed(noise_variance) => {
                    let kernels = self.kernels.clone();
                    let l =
                        data.likelihood(&LatticeHyper { signal_variance: last, noise_variance, kernels })?;
                    let slope = l.d_signal;
                    (l, slope)
                }
            };
            let mut gradient: Vec<f64> = likelihood.d_axes.into_iter().flatten().collect();
            gradient.push(slope);
            Ok((likelihood.value, gradient))
        })
    }

    /// The hyper-parameters at the optimum that a search has found.
    fn hyper(&mut self, data: &LatticeData, log_parameters: &[f64]) -> Result<LatticeHyper> {
        let last = self.set(log_parameters)?.exp();
        let (signal_variance, noise_variance) = match self.noise {
            Noise::Optimized => {
                let (signal_variance, _) = data.profile_likelihood(&self.kernels, last)?;
                (signal_variance, last * signal_variance)
            }
            Noise::Fixed(noise) => (last, noise),
        };
        Ok(LatticeHyper { signal_variance, noise_variance, kernels: self.kernels.clone() })
    }
}
