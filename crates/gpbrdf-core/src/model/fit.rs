//! Fitting a model to samples, and conditioning one at known hyper-parameters.

use std::sync::Arc;

use crate::base::error::{Error, Result};
use crate::base::watch::{Observer, Watch};
use crate::brdf::Rgb;
use crate::gp::problem::Problem;
use crate::gp::{FitReport, Hyper, Noise, OptimizeOptions, Outliers, Solver};
use crate::kernel::Shape;
use crate::model::Model;
use crate::prior::Prior;
use crate::sample::{InputSpace, MeanFunction, SampleSet, Symmetry, Transform};

/// The largest number of samples for which a learned prior is used. Random directions hardly ever come near the mirror
/// direction: 40 of them give better materials with a prior, 300 do not (`docs/results.md`).
const FEW_SAMPLES: usize = 250;

/// The largest number of samples in the plane of incidence for which it is used: they say nothing of all other
/// directions.
const MANY_SAMPLES: usize = 20_000;

/// The share of the searches of a fit with a prior in the time of these and of one without.
const SHARE_WITH_PRIOR: f64 = 0.75;

/// What is known of other materials.
#[derive(Clone, Debug, Default)]
pub enum PriorChoice {
    /// The prior that comes with this crate, [`Prior::built_in`].
    #[default]
    BuiltIn,
    /// Nothing.
    None,
    /// What was learned from a library.
    Learned(Arc<Prior>),
}

impl PriorChoice {
    /// The prior that was chosen, whether or not a fit would use it.
    #[must_use]
    pub fn prior(&self) -> Option<Arc<Prior>> {
        match self {
            Self::BuiltIn => Some(Prior::built_in()),
            Self::None => None,
            Self::Learned(prior) => Some(Arc::clone(prior)),
        }
    }
}

/// Options of [`fit`].
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// The solver.
    pub solver: Solver,
    /// For each axis, the shapes whose kernels are summed. The lattice solver takes the product of these sums
    /// over the axes. The other solvers sum kernels of the joint distance with one length scale per axis, and
    /// use the shapes of the first axis only.
    pub kernel: [Vec<Shape>; 3],
    /// The map from BRDF values to targets.
    pub transform: Transform,
    /// The rule for the prior mean.
    pub mean: MeanFunction,
    /// The rule for the noise variance.
    pub noise: Noise,
    /// Whether the hyper-parameters of scattered samples have weak priors, which decide what the samples leave
    /// open: length scales, signal variance and noise about those that measured materials usually have.
    /// Without them the likelihood alone decides, as in the paper.
    pub hyper_priors: bool,
    /// What is known of other materials. It is used for samples off a lattice and for those on a lattice of few nodes.
    pub prior: PriorChoice,
    /// What is done about samples that contradict all samples around them.
    pub outliers: Outliers,
    /// Whether each channel gets its own hyper-parameters instead of shared ones.
    pub per_channel: bool,
    /// Input space for samples off a lattice; those on a lattice use its own space. `None` leaves the choice
    /// among [`InputSpace::ISOTROPIC`] to the likelihood, or takes the first of them for the dense solver.
    pub space: Option<InputSpace>,
    /// Settings of the search for hyper-parameters.
    pub optimize: OptimizeOptions,
    /// Called before each evaluation of the likelihood and during other long work; it can cancel the fit.
    pub observer: Observer,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            solver: Solver::Auto,
            kernel: std::array::from_fn(|_| vec![Shape::Matern52]),
            transform: Transform::default(),
            mean: MeanFunction::default(),
            noise: Noise::default(),
            hyper_priors: true,
            prior: PriorChoice::default(),
            outliers: Outliers::default(),
            per_channel: false,
            space: None,
            optimize: OptimizeOptions::default(),
            observer: Observer::default(),
        }
    }
}

impl FitOptions {
    /// These options with the sum of `shapes` as the kernel along every axis.
    #[must_use]
    pub fn with_kernel(self, shapes: &[Shape]) -> Self {
        Self { kernel: std::array::from_fn(|_| shapes.to_vec()), ..self }
    }

    /// The prior that a fit to these samples uses, if any: that of the options for targets that it describes, channels
    /// that share hyper-parameters with weak priors, and isotropic bilateral materials. With [`Solver::Auto`] it is
    /// used for at most 250 samples, and for at most 20,000 in the plane of incidence or with a prior of the user's
    /// own; with [`Solver::Scattered`] for any number; with [`Solver::Dense`] for any number off a lattice if it is
    /// one of the user's own; with [`Solver::Lattice`] never.
    #[must_use]
    pub fn prior(&self, samples: &SampleSet) -> Option<Arc<Prior>> {
        let n = samples.len();
        let are_few = match &self.prior {
            PriorChoice::None => return None,
            PriorChoice::BuiltIn => n <= FEW_SAMPLES || samples.is_in_plane() && n <= MANY_SAMPLES,
            PriorChoice::Learned(_) => n <= MANY_SAMPLES,
        };
        let by_solver = match (self.solver, samples.lattice()) {
            (Solver::Scattered, _) => true,
            (Solver::Dense, None) => matches!(self.prior, PriorChoice::Learned(_)),
            (Solver::Auto, None) => are_few,
            (Solver::Auto, Some(lattice)) => n <= FEW_SAMPLES && lattice.symmetry == Symmetry::Bilateral,
            _ => false,
        };
        let is_described = self.transform == Prior::TRANSFORM
            && self.mean == MeanFunction::Constant
            && self.hyper_priors
            && !self.per_channel
            && self.space.is_none_or(InputSpace::is_isotropic);
        if by_solver && is_described { self.prior.prior() } else { None }
    }

    /// These options with the mean of a prior, if there is one.
    fn with_mean_of(&self, prior: Option<&Arc<Prior>>) -> Self {
        let mean = if prior.is_some() { MeanFunction::Learned } else { self.mean };
        Self { mean, ..self.clone() }
    }

    /// The input of a solver for one group of channels that share hyper-parameters.
    fn problem<'a>(
        &'a self,
        samples: &'a SampleSet,
        targets: Vec<Vec<f64>>,
        known_noise: &'a [f64],
        prior: Option<Arc<Prior>>,
        watch: &'a Watch,
    ) -> Problem<'a> {
        Problem {
            angles: &samples.angles,
            lattice: samples.lattice(),
            targets,
            space: self.space,
            kernel: &self.kernel,
            noise: self.noise,
            known_noise,
            priors: self.hyper_priors,
            usual_variance: self.transform.usual_variance(),
            prior,
            basis: None,
            factorises: self.solver == Solver::Dense,
            outliers: self.outliers,
            optimize: &self.optimize,
            watch,
        }
    }
}

/// A fitted model and the reports of its fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// One report for all channels, or one per channel where each has its own hyper-parameters.
    pub reports: Vec<FitReport>,
}

/// A model that was conditioned at given hyper-parameters.
#[derive(Clone, Debug)]
pub struct Conditioned {
    /// The model.
    pub model: Model,
    /// Its log marginal likelihood, summed over the channels.
    pub log_marginal_likelihood: f64,
}

/// Fits a model to samples: transforms their values to targets, finds hyper-parameters by maximum marginal
/// likelihood, and conditions the process at them. Where a prior is to be used ([`FitOptions::prior`]), a model
/// without it is fitted as well. The one with the prior is taken if its marginal likelihood is larger. For samples that
/// are neither on a lattice nor in the plane of incidence that of the brightness alone must be larger, too
/// ([`FitReport::evidence_of_prior`]): channels that are correlated are likelier than independent ones whatever the
/// prior says of highlights. Few nodes and scans say too little of the directions between them.
///
/// # Errors
/// No samples, values that are not finite, invalid options, the lattice solver for samples off a lattice, a
/// dense fit that does not fit in memory, and [`Error::Cancelled`] as soon as the observer stops the search.
pub fn fit(samples: &SampleSet, options: &FitOptions) -> Result<Fit> {
    let watch = Watch::new(&options.observer);
    let Some(prior) = options.prior(samples) else { return fit_with(samples, options, None, &watch) };
    // Both are densities of the same targets, since the rotation of the channels changes no volume. A prior that the
    // samples contradict, of a constant for example, is not taken.
    let own_mean = options.with_mean_of(Some(&prior));
    let with = fit_with(samples, &own_mean, Some(&prior), &watch.part(0.0, SHARE_WITH_PRIOR))?;
    let without = fit_with(samples, options, None, &watch.part(SHARE_WITH_PRIOR, 1.0))?;
    let is_refuted = with.reports.iter().filter_map(|report| report.evidence_of_prior).any(|gain| gain < 0.0);
    let is_better = !is_refuted && with.log_marginal_likelihood() >= without.log_marginal_likelihood();
    Ok(if is_better { with } else { without })
}

impl Fit {
    /// The log marginal likelihood, summed over the channels.
    #[must_use]
    pub fn log_marginal_likelihood(&self) -> f64 {
        self.reports.iter().map(|report| report.log_marginal_likelihood).sum()
    }
}

/// [`fit`] with a given prior, or with none.
fn fit_with(
    samples: &SampleSet,
    options: &FitOptions,
    prior: Option<&Arc<Prior>>,
    watch: &Watch,
) -> Result<Fit> {
    let (targets, offsets) = targets(samples, options)?;
    if options.kernel.iter().any(Vec::is_empty) {
        return Err(Error::argument("kernel", "at least one shape", "none"));
    }
    options.kernel.iter().flatten().try_for_each(|shape| shape.validate())?;
    let groups: &[&[usize]] = if options.per_channel { &[&[0], &[1], &[2]] } else { &[&[0, 1, 2]] };
    let share = |group: usize| group as f64 / groups.len() as f64;
    let fitted = groups.iter().enumerate().map(|(group, channels)| {
        let watch = watch.part(share(group), share(group + 1));
        let noise = known_noise(samples, options.transform, channels);
        let targets = channels.iter().map(|&c| targets[c].clone()).collect();
        options.solver.fit(&options.problem(samples, targets, &noise, prior.cloned(), &watch))
    });
    let (posteriors, reports) = fitted.collect::<Result<Vec<_>>>()?.into_iter().unzip();
    let origin = samples.origin.clone();
    let model = Model::new(origin, options.transform, options.mean, offsets, posteriors)?;
    Ok(Fit { model, reports })
}

/// Conditions a process on samples at given hyper-parameters, which all channels share. Of the options, only
/// `transform`, `mean` and `space` are used.
///
/// On a lattice this takes milliseconds. The dense process factorises its covariance once, which takes
/// `O(n^3)`.
///
/// # Errors
/// No samples, values that are not finite, hyper-parameters out of range, or hyper-parameters of a lattice
/// process for samples off a lattice.
pub fn condition(samples: &SampleSet, options: &FitOptions, hyper: &Hyper) -> Result<Conditioned> {
    let prior = if hyper.chromatic.is_some() { options.prior(samples) } else { None };
    let options = &options.with_mean_of(prior.as_ref());
    let (targets, offsets) = targets(samples, options)?;
    let watch = Watch::new(&options.observer);
    let noise = known_noise(samples, options.transform, &[0, 1, 2]);
    let (posterior, log_marginal_likelihood) =
        Solver::condition(&options.problem(samples, targets, &noise, prior, &watch), hyper)?;
    let origin = samples.origin.clone();
    let model = Model::new(origin, options.transform, options.mean, offsets, vec![posterior])?;
    Ok(Conditioned { model, log_marginal_likelihood })
}

/// The targets of each channel minus their prior mean, and the prior means.
fn targets(samples: &SampleSet, options: &FitOptions) -> Result<(Vec<Vec<f64>>, [f64; 3])> {
    let n = samples.angles.len();
    if n == 0 || samples.values.len() != n {
        return Err(Error::argument("samples", "at least one, with as many values as directions", n));
    }
    if let Some(bad) = samples.values.as_flattened().iter().find(|x| !x.is_finite()) {
        return Err(Error::argument("sample values", "finite numbers", bad));
    }
    let sigma = &samples.sigma;
    if !sigma.is_empty() && sigma.len() != n {
        return Err(Error::argument("standard deviations", "none or one for each sample", sigma.len()));
    }
    if let Some(bad) = sigma.as_flattened().iter().find(|x| !(x.is_finite() && **x >= 0.0)) {
        return Err(Error::argument("standard deviations", "finite numbers of at least 0", bad));
    }
    options.transform.validate()?;
    let mut targets: Vec<Vec<f64>> =
        (0..3).map(|c| samples.values.iter().map(|v| options.transform.forward(v[c])).collect()).collect();
    let mut offsets = [0.0; 3];
    for (offset, targets) in offsets.iter_mut().zip(&mut targets) {
        *offset = options.mean.offset(targets);
        targets.iter_mut().for_each(|y| *y -= *offset);
    }
    Ok((targets, offsets))
}

/// The noise variance of each sample that its given standard deviation leads to, in squared target units and as
/// a mean over the channels: `(sigma dg/df)^2`. Empty if the samples have no standard deviations.
fn known_noise(samples: &SampleSet, transform: Transform, channels: &[usize]) -> Vec<f64> {
    let variance = |(value, sigma): (&Rgb, &Rgb)| {
        let count = channels.len() as f64;
        let square = |&c: &usize| {
            let slope = transform.slope_of_inverse(transform.forward(value[c]));
            // A root has no slope at zero.
            (sigma[c] / slope.max(f64::MIN_POSITIVE)).min(LARGEST_DEVIATION).powi(2)
        };
        channels.iter().map(square).sum::<f64>() / count
    };
    samples.values.iter().zip(&samples.sigma).map(variance).collect()
}

/// A standard deviation of a target that says nothing about it any more.
const LARGEST_DEVIATION: f64 = 1e3;

#[cfg(all(test, feature = "formats"))]
mod tests {
    use super::*;
    use crate::formats::source::Source;
    use crate::kernel::KernelBody;
    use crate::model::{IntervalOf, bake_mean_observed, bake_sigma_observed};
    use crate::sample::{LatticeLayout, Layout, Provenance};
    use std::ops::ControlFlow;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::{Arc, Mutex};

    fn samples() -> SampleSet {
        let source = Source::built_in("ward").unwrap();
        let lattice = LatticeLayout { shape: [9, 7, 5], ..LatticeLayout::default() };
        source.measure(&Layout::Lattice(lattice)).unwrap()
    }

    #[test]
    fn conditioning_at_the_optimum_gives_the_fitted_model() {
        for solver in [Solver::Lattice, Solver::Dense] {
            let (samples, options) = (samples(), FitOptions { solver, ..FitOptions::default() });
            let Fit { model: fitted, reports } = fit(&samples, &options).unwrap();
            let hyper = fitted.hyper().unwrap();
            let Conditioned { model, log_marginal_likelihood: value } =
                condition(&samples, &options, &hyper).unwrap();
            let gap = (value - reports[0].log_marginal_likelihood).abs();
            assert!(gap < 1e-6 * value.abs(), "{solver:?} {gap}");
            let at = &samples.angles[..40];
            assert_eq!(
                model.predict(at, IntervalOf::Latent).unwrap(),
                fitted.predict(at, IntervalOf::Latent).unwrap(),
                "{solver:?}"
            );
            assert_eq!(model.provenance.material, "ward");
        }
    }

    #[test]
    fn axes_have_their_own_shapes_and_searches_stop_when_told() {
        let samples = samples();
        let shapes = [Shape::Matern52, Shape::SquaredExponential, Shape::Matern32];
        let options = FitOptions { kernel: shapes.map(|shape| vec![shape]), ..FitOptions::default() };
        let hyper = fit(&samples, &options).unwrap().model.hyper().unwrap();
        let KernelBody::Product(axes) = &hyper.kernel.terms[0].body else { panic!("{hyper:?}") };
        assert_eq!(axes.iter().map(|k| k.terms[0].shape).collect::<Vec<_>>(), shapes);
        for solver in [Solver::Lattice, Solver::Dense] {
            let asked = Arc::new(AtomicUsize::new(0));
            let counter = Arc::clone(&asked);
            let observer = Observer::new(move |progress| {
                assert_eq!(counter.fetch_add(1, Ordering::Relaxed) + 1, progress.evaluations);
                if progress.evaluations == 4 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            let stopped = fit(&samples, &FitOptions { solver, observer, ..options.clone() });
            assert!(matches!(stopped, Err(Error::Cancelled)), "{solver:?}");
            assert_eq!(asked.load(Ordering::Relaxed), 4, "{solver:?}");
        }
        let scattered = SampleSet { origin: Provenance::default(), ..samples };
        assert!(condition(&scattered, &options, &hyper).is_err());
    }

    #[test]
    fn long_work_on_scattered_samples_tells_how_far_it_is_and_stops_anywhere() {
        let source = Source::built_in("ward").unwrap();
        let samples = source.measure(&Layout::Random { count: 300, seed: 1 }).unwrap();
        // An observer that stops at a share, and the shares that it was told.
        let stopping = |at: f64| {
            let shares = Arc::new(Mutex::new(Vec::new()));
            let told = Arc::clone(&shares);
            let observer = Observer::new(move |progress| {
                let share = progress.share.unwrap();
                told.lock().unwrap().push(share);
                if share < at { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            });
            (observer, shares)
        };
        let (observer, shares) = stopping(2.0);
        // Threads may be heard in another order than that in which they have done their work.
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let options = FitOptions { observer, ..FitOptions::default() };
        let fitted = alone.install(|| fit(&samples, &options)).unwrap();
        let shares = shares.lock().unwrap();
        assert!(shares.len() > 100 && shares.is_sorted() && shares[shares.len() - 1] > 0.9, "{shares:?}");
        let plain = fit(&samples, &FitOptions::default()).unwrap();
        let predicted = |fitted: &Fit| fitted.model.predict_mean(&samples.angles[..50]);
        assert_eq!(predicted(&fitted), predicted(&plain));
        for k in [1, 5, 9] {
            let at = shares[k * shares.len() / 10];
            let (observer, told) = stopping(at);
            let stopped = fit(&samples, &FitOptions { observer, ..FitOptions::default() });
            assert!(matches!(stopped, Err(Error::Cancelled)), "{at}");
            // Every thread hears of it at most once.
            let late = told.lock().unwrap().iter().filter(|&&share| share >= at).count();
            assert!(late <= rayon::current_num_threads(), "{at}: {late}");
        }
        let (observer, _) = stopping(0.3);
        assert!(matches!(bake_mean_observed(&plain.model, &observer), Err(Error::Cancelled)));
        assert!(matches!(bake_sigma_observed(&plain.model, &observer), Err(Error::Cancelled)));
    }
}
