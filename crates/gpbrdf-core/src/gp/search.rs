//! The start of a search for the hyper-parameters of samples at any directions: parameters, bounds and priors.

use crate::base::error::Result;
use crate::gp::hyper::MIN_NOISE_RATIO;
use crate::gp::report::Noise;
use crate::gp::{LogNormal, Parameter};
use crate::kernel::{AxisMetric, Kernel, KernelBody, KernelTerm, ParameterKind, Shape};

/// The prior of the noise variance relative to the usual variance of targets: a deviation of about 1 %, within a
/// factor of 10 or so.
const NOISE_PRIOR: (f64, f64) = (2.5e-5, 2.5);

/// The prior of the noise variance of `ln f` where basis functions are learned: measurements are usually good to 1 %,
/// within a factor of 2 or so. It is tighter than the other since a few samples of a highlight that is sharper than any
/// of the library look like noise.
const NOISE_PRIOR_OF_LOG: (f64, f64) = (1e-4, 0.5);

/// Length scales and noise variances of the points from which a search may start, relative to the usual ones.
const LENGTH_FACTORS: [f64; 3] = [1.0, 0.3, 0.1];
const NOISE_FACTORS: [f64; 2] = [1.0, 30.0];

/// Standard deviation of the logarithm of a signal variance about the usual variance of targets.
const VARIANCE_DEVIATION: f64 = 1.2;

/// The prior of the variance of basis functions: they come with variances of their own, so it is about 1.
const BASIS_PRIOR: (f64, f64) = (1.0, 0.3);

/// The least and the largest variance of basis functions.
const BASIS_RANGE: (f64, f64) = (1e-3, 1e2);

/// The prior of the mixture parameter of a rational quadratic kernel.
const ALPHA_PRIOR: (f64, f64) = (1.0, 1.5);

/// What hyper-parameters usually are: the medians of weak log-normal priors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsualValues {
    /// The length scale along each coordinate, and the standard deviation of its logarithm.
    pub lengths: [(f64, f64); 3],
    /// The variance of targets; `None` where only the targets tell.
    pub variance: Option<f64>,
}

/// A kernel that is a sum of ARD kernels, and the parameters of a search: the kernel's, the variance of basis functions
/// where there are any and, where it is optimised, the noise variance.
#[derive(Clone, Debug)]
pub(crate) struct SearchStart {
    pub(crate) kernel: Kernel,
    pub(crate) parameters: Vec<Parameter>,
    noise: Noise,
    has_basis: bool,
    /// The usual variance of what the kernel describes, or the mean square of the targets.
    variance: f64,
    /// The prior of the noise variance.
    noise_prior: (f64, f64),
}

/// The hyper-parameters beside those of a kernel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OtherParameters {
    pub(crate) noise_variance: f64,
    /// Meaningless where there is no basis.
    pub(crate) basis_variance: f64,
}

impl SearchStart {
    /// The usual start for targets of zero mean, `[sample][channel]` or in any other order, whose coordinates
    /// cover `extents`. Very few targets may all be alike, so where the variance that targets usually have is
    /// known, the parameters are not bounded by a hundredth of it.
    pub(crate) fn new(
        (targets, usual_variance): (&[f64], Option<f64>),
        channels: usize,
        extents: &[f64],
        metrics: &[AxisMetric],
        shapes: &[Shape],
        noise: Noise,
    ) -> Self {
        let values = targets.len();
        let found = targets.iter().map(|y| y * y).sum::<f64>() / values.max(1) as f64;
        let variance = found.max(usual_variance.map_or(1e-12, |usual| 0.01 * usual));
        let kernel = starting_kernel(extents, metrics, shapes, variance);
        let mut parameters = parameters(&kernel, extents, values / channels, variance);
        if noise == Noise::Optimized {
            parameters.push(Parameter {
                name: "noise_variance".into(),
                start: (1e-3 * variance).ln(),
                lower: (MIN_NOISE_RATIO * variance).ln(),
                upper: (10.0 * variance).ln(),
                prior: None,
            });
        }
        let variance = usual_variance.unwrap_or(variance);
        let noise_prior = (NOISE_PRIOR.0 * variance, NOISE_PRIOR.1);
        Self { kernel, parameters, noise, has_basis: false, variance, noise_prior }
    }

    /// Adds the variance of learned basis functions of `ln f` to the parameters. The kernel describes what they leave,
    /// which usually has the standard deviation `left`.
    pub(crate) fn with_basis(mut self, left: f64) -> Self {
        self.variance = left * left;
        self.noise_prior = NOISE_PRIOR_OF_LOG;
        let kinds = self.kernel.parameter_kinds();
        let share = self.variance / self.kernel.terms.len() as f64;
        for (parameter, kind) in self.parameters.iter_mut().zip(&kinds) {
            if *kind == ParameterKind::Variance {
                parameter.lower = parameter.lower.min((1e-4 * share).ln());
                parameter.start = share.ln();
            }
        }
        self.parameters.insert(
            kinds.len(),
            Parameter {
                name: "prior_variance".into(),
                start: BASIS_PRIOR.0.ln(),
                lower: BASIS_RANGE.0.ln(),
                upper: BASIS_RANGE.1.ln(),
                prior: None,
            },
        );
        self.has_basis = true;
        self
    }

    /// Adds weak log-normal priors: of length scales about the usual ones, of signal variances about the usual variance
    /// of targets, of the noise variance about 2.5e-5 of it (1e-4 with a basis). What the samples determine they hardly
    /// change; what the samples leave open they decide.
    pub(crate) fn with_priors(mut self, usual_lengths: [(f64, f64); 3]) -> Self {
        let terms = self.kernel.terms.len() as f64;
        let kinds = self.kernel.parameter_kinds();
        for (k, parameter) in self.parameters.iter_mut().enumerate() {
            let (median, deviation) = match kinds.get(k) {
                Some(ParameterKind::LengthScale(axis)) => usual_lengths[(*axis).min(2)],
                Some(ParameterKind::Variance) => (self.variance / terms, VARIANCE_DEVIATION),
                Some(ParameterKind::Alpha) => ALPHA_PRIOR,
                Some(ParameterKind::Weight) => (1.0, VARIANCE_DEVIATION),
                None if self.has_basis && k == kinds.len() => BASIS_PRIOR,
                None => self.noise_prior,
            };
            let prior = LogNormal::new(median, deviation);
            parameter.prior = Some(prior);
            // Terms of a sum start apart from each other.
            if terms == 1.0 && matches!(kinds.get(k), Some(ParameterKind::LengthScale(_))) {
                parameter.start = prior.log_median.clamp(parameter.lower, parameter.upper);
            }
        }
        let starts: Vec<f64> = self.parameters[..kinds.len()].iter().map(|p| p.start).collect();
        // The starts are finite, so they are accepted.
        let _accepted = self.kernel.set_log_parameters(&starts);
        self
    }

    /// Log-parameters from which a search may start: the usual ones, and with shorter length scales and more noise, as
    /// far as the bounds allow.
    pub(crate) fn alternatives(&self) -> Vec<Vec<f64>> {
        let kinds = self.kernel.parameter_kinds();
        let point = |length: f64, noise: f64| {
            let factor = |k: usize| match kinds.get(k) {
                Some(ParameterKind::LengthScale(_)) => length,
                Some(_) => 1.0,
                None if self.has_basis && k == kinds.len() => 1.0,
                None => noise,
            };
            let moved = |(k, p): (usize, &Parameter)| (p.start + factor(k).ln()).clamp(p.lower, p.upper);
            self.parameters.iter().enumerate().map(moved).collect()
        };
        let noises = if self.noise == Noise::Optimized { &NOISE_FACTORS[..] } else { &[1.0] };
        LENGTH_FACTORS
            .iter()
            .flat_map(|&length| noises.iter().map(move |&noise| (length, noise)))
            .map(|(length, noise)| point(length, noise))
            .collect()
    }

    /// Starts from these log-parameters, as far as the bounds allow.
    pub(crate) fn start_from(&mut self, log_parameters: &[f64]) {
        for (parameter, start) in self.parameters.iter_mut().zip(log_parameters) {
            parameter.start = start.clamp(parameter.lower, parameter.upper);
        }
    }

    /// Sets the parameters of a kernel and returns the others.
    ///
    /// # Errors
    /// Log-parameters whose exponential is zero or not finite.
    pub(crate) fn set(&self, kernel: &mut Kernel, log_parameters: &[f64]) -> Result<OtherParameters> {
        let (of_kernel, others) = log_parameters.split_at(kernel.n_parameters());
        kernel.set_log_parameters(of_kernel)?;
        Ok(OtherParameters {
            basis_variance: if self.has_basis { others[0].exp() } else { 0.0 },
            noise_variance: match self.noise {
                Noise::Optimized => others[usize::from(self.has_basis)].exp(),
                Noise::Fixed(variance) => variance,
            },
        })
    }
}

/// The range that coordinate `k` of the samples covers, at least a small positive number.
pub(crate) fn extent(x: &[f64], dimension: usize, k: usize, metric: AxisMetric) -> f64 {
    match metric {
        AxisMetric::Chord => 1.0,
        AxisMetric::Linear => {
            let column = || x.iter().skip(k).step_by(dimension).copied();
            let (low, high) =
                (column().fold(f64::INFINITY, f64::min), column().fold(f64::NEG_INFINITY, f64::max));
            (high - low).max(1e-3)
        }
    }
}

fn starting_kernel(extents: &[f64], metrics: &[AxisMetric], shapes: &[Shape], variance: f64) -> Kernel {
    let share = variance / shapes.len().max(1) as f64;
    let terms = shapes.iter().enumerate().map(|(i, &shape)| {
        // Terms of the same shape must start at different length scales, or they would stay equal.
        let fraction = 0.5 * 0.5f64.powi(i32::try_from(i).unwrap_or(30));
        let length_scale = extents.iter().map(|extent| fraction * extent).collect();
        KernelTerm { variance: share, body: KernelBody::Ard { shape, length_scale } }
    });
    Kernel { terms: terms.collect(), metric: metrics.to_vec() }
}

fn parameters(kernel: &Kernel, extents: &[f64], samples: usize, variance: f64) -> Vec<Parameter> {
    // Samples cannot tell apart length scales that are shorter than their spacing.
    let spacing = (samples as f64).powf(-1.0 / extents.len().max(1) as f64).min(0.5);
    let kinds = kernel.parameter_kinds().into_iter();
    kinds
        .zip(kernel.parameter_names())
        .zip(kernel.log_parameters())
        .map(|((kind, name), start)| {
            let (lower, upper) = match kind {
                ParameterKind::Variance => (1e-4 * variance, 1e6 * variance),
                ParameterKind::LengthScale(k) => (0.5 * spacing * extents[k], 30.0 * extents[k]),
                ParameterKind::Alpha => (0.05, 1e3),
                ParameterKind::Weight => (1e-5, 1e5),
            };
            Parameter { name, start, lower: lower.ln(), upper: upper.ln(), prior: None }
        })
        .collect()
}
