//! The search for the hyper-parameters of the dense process, by maximum marginal likelihood.

use crate::base::error::{Error, Result};
use crate::base::random::golden_ratio_subset;
use crate::gp::dense::{DenseEvaluator, DenseGp};
use crate::gp::report::{FitReport, Noise};
use crate::gp::search::{SearchStart, UsualValues, extent};
use crate::gp::{OptimizeOptions, Optimum, maximize};
use crate::kernel::{AxisMetric, Shape};

/// A search for the hyper-parameters of a dense process whose kernel is a sum of ARD kernels, one for each of
/// `shapes`.
#[derive(Clone, Copy, Debug)]
pub struct DenseFit<'a> {
    /// Coordinates of the samples, `n` rows of `metrics.len()`.
    pub x: &'a [f64],
    /// `n` zero-mean targets for each channel; the channels share hyper-parameters.
    pub targets: &'a [Vec<f64>],
    /// How distance is measured along each coordinate.
    pub metrics: &'a [AxisMetric],
    /// Shapes of the ARD kernels that are summed.
    pub shapes: &'a [Shape],
    /// The rule for the noise variance.
    pub noise: Noise,
    /// Weak priors of the hyper-parameters; `None` for maximum likelihood.
    pub priors: Option<UsualValues>,
    /// Settings of the search.
    pub options: &'a OptimizeOptions,
}

impl DenseFit<'_> {
    /// Finds the hyper-parameters and conditions the process at them.
    ///
    /// The search runs over variances, length scales, mixture parameters and, with [`Noise::Optimized`], the
    /// noise variance. It starts from the best of several optima for a subset of 160 samples, or from the
    /// default start if that leads to a larger likelihood. One evaluation costs `n^3 / 2` multiply-adds, and
    /// a search needs some tens of them; [`dense_cost`](crate::gp::dense_cost) gives a forecast. `evaluation`
    /// is called before each evaluation of the likelihood, and an error that it returns ends the search.
    ///
    /// # Errors
    /// Sizes that do not agree, values that are not finite, invalid shapes or noise variance, more samples
    /// than fit in memory, and the errors of `evaluation`.
    pub fn run(&self, evaluation: &dyn Fn() -> Result<()>) -> Result<(DenseGp, FitReport)> {
        let Self { x, targets, metrics, shapes, noise, priors, options } = *self;
        let channels = targets.len();
        let n = targets.first().map_or(0, Vec::len);
        if channels == 0 || targets.iter().any(|t| t.len() != n) {
            return Err(Error::argument("dense targets", "channels of one length, at least one", channels));
        }
        noise.validate()?;
        shapes.iter().try_for_each(|shape| shape.validate())?;
        let y: Vec<f64> = (0..n).flat_map(|i| targets.iter().map(move |t| t[i])).collect();
        let data = Data { x, y: &y, dimension: metrics.len(), channels };
        let usual_variance = priors.and_then(|usual| usual.variance);
        let made = |data: &Data<'_>| {
            let extents: Vec<f64> =
                (0..data.dimension).map(|k| extent(data.x, data.dimension, k, metrics[k])).collect();
            let start =
                SearchStart::new((data.y, usual_variance), data.channels, &extents, metrics, shapes, noise);
            priors.map_or(start.clone(), |usual| start.with_priors(usual.lengths))
        };
        let mut problem = made(&data);
        let mut scouting = 0;
        // A small subset of the samples tells good optima from bad ones at next to no cost.
        let scouts = OptimizeOptions { restarts: options.restarts.max(SCOUT_STARTS), ..*options };
        let found = if n <= SCOUTS || n <= metrics.len() {
            search(&problem, &data, &scouts, evaluation)?
        } else {
            let (x, y) = data.thinned(SCOUTS);
            let thin = Data { x: &x, y: &y, ..data };
            let scout = search(&made(&thin), &thin, &scouts, evaluation)?;
            // The best optimum for the subset may be a worse start for all samples than the default one, so
            // both are tried: to the end where that is quick, else for `LAP` iterations.
            let most = if n <= FEW { u64::MAX } else { LAP };
            let lap =
                OptimizeOptions { max_iterations: most.min(options.max_iterations), restarts: 0, ..*options };
            let usual = search(&problem, &data, &lap, evaluation)?;
            problem.start_from(&scout.log_parameters);
            let scouted = search(&problem, &data, &lap, evaluation)?;
            scouting = scout.evaluations + usual.evaluations + scouted.evaluations;
            let ahead = if usual.value > scouted.value { usual } else { scouted };
            problem.start_from(&ahead.log_parameters);
            search(&problem, &data, options, evaluation)?
        };
        let mut kernel = problem.kernel.clone();
        let noise_variance = problem.set(&mut kernel, &found.log_parameters)?.noise_variance;
        let gp = DenseGp::fit_at(x, &y, channels, kernel, noise_variance)?;
        let report = FitReport {
            log_marginal_likelihood: found.value - found.log_prior,
            evaluations: found.evaluations + scouting,
            converged: found.converged,
            at_bound: found.at_bound,
            ..FitReport::default()
        };
        Ok((gp, report))
    }
}

/// Number of samples in the subset that is searched first, from several starts.
const SCOUTS: usize = 160;

/// Up to this number of samples a search takes about a second, so searches from both starts run to their end.
const FEW: usize = 1000;

/// With more samples, the number of iterations after which only the better of the two starts continues.
const LAP: u64 = 15;

/// Number of starts of the search on the subset, in addition to the default one.
const SCOUT_STARTS: usize = 4;

/// Samples: rows of coordinates, and values `[sample][channel]`.
#[derive(Clone, Copy)]
struct Data<'a> {
    x: &'a [f64],
    y: &'a [f64],
    dimension: usize,
    channels: usize,
}

impl Data<'_> {
    /// A subset of `count` samples, spread evenly over their order.
    fn thinned(&self, count: usize) -> (Vec<f64>, Vec<f64>) {
        let order = golden_ratio_subset(self.y.len() / self.channels, count);
        let pick = |of: &[f64], width: usize| {
            order.iter().flat_map(|i| of[i * width..(i + 1) * width].iter().copied()).collect()
        };
        (pick(self.x, self.dimension), pick(self.y, self.channels))
    }
}

/// Finds the hyper-parameters of samples from a start.
fn search(
    start: &SearchStart,
    data: &Data<'_>,
    options: &OptimizeOptions,
    evaluation: &dyn Fn() -> Result<()>,
) -> Result<Optimum> {
    let mut evaluator = DenseEvaluator::new(data.x, data.dimension, data.y, data.channels)?;
    let mut kernel = start.kernel.clone();
    maximize(&start.parameters, data.y.len(), options, |p| {
        evaluation()?;
        let noise = start.set(&mut kernel, p)?.noise_variance;
        let mut at = evaluator.evaluate_with_gradient(&kernel, noise)?;
        at.gradient.truncate(p.len());
        Ok((at.log_marginal_likelihood, at.gradient))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::KernelBody;

    /// A smooth function of two coordinates at pseudo-random points, with noise of standard deviation 0.05.
    fn data(n: usize) -> (Vec<f64>, Vec<f64>) {
        let mut random = crate::base::random::SplitMix64::new(2);
        let x: Vec<f64> = (0..2 * n).map(|_| random.next_unit()).collect();
        let noise = |r: &mut crate::base::random::SplitMix64| {
            0.05 * (0..12).map(|_| r.next_unit() - 0.5).sum::<f64>()
        };
        let y = x.chunks(2).map(|p| (4.0 * p[0]).sin() + 0.1 * p[1] + noise(&mut random)).collect();
        (x, y)
    }

    #[test]
    fn recovers_noise_and_relevance() {
        let (x, y) = data(150);
        let metrics = [AxisMetric::Linear; 2];
        let shapes = [Shape::SquaredExponential];
        let options = OptimizeOptions::default();
        let fit = DenseFit {
            x: &x,
            targets: &[y],
            metrics: &metrics,
            shapes: &shapes,
            noise: Noise::Optimized,
            priors: None,
            options: &options,
        };
        let (gp, report) = fit.run(&|| Ok(())).unwrap();
        assert!(report.converged, "{report:?}");
        assert!((gp.noise_variance().sqrt() - 0.05).abs() < 0.01, "{}", gp.noise_variance().sqrt());
        let KernelBody::Ard { length_scale, .. } = &gp.kernel().terms[0].body else { unreachable!() };
        assert!(length_scale[1] > 3.0 * length_scale[0], "{length_scale:?}");
        assert!((gp.log_marginal_likelihood().unwrap() - report.log_marginal_likelihood).abs() < 1e-6);
    }

    #[test]
    fn fixed_noise_stays_and_broken_input_is_refused() {
        let (x, y) = data(40);
        let metrics = [AxisMetric::Linear; 2];
        let options = OptimizeOptions::default();
        let shapes = [Shape::Matern32, Shape::RationalQuadratic { alpha: 1.0 }];
        let both = [y.clone(), y.iter().map(|y| -y).collect()];
        let good = DenseFit {
            x: &x,
            targets: &both,
            metrics: &metrics,
            shapes: &shapes,
            noise: Noise::Fixed(0.01),
            priors: None,
            options: &options,
        };
        let (gp, _) = good.run(&|| Ok(())).unwrap();
        assert_eq!((gp.noise_variance(), gp.channels(), gp.n_samples()), (0.01, 2, 40));
        let y = std::slice::from_ref(&y);
        for broken in [
            DenseFit { targets: &[], noise: Noise::Optimized, ..good },
            DenseFit { targets: y, noise: Noise::Fixed(-1.0), ..good },
            DenseFit { x: &x[1..], targets: y, noise: Noise::Optimized, ..good },
        ] {
            assert!(broken.run(&|| Ok(())).is_err(), "{broken:?}");
        }
    }
}
