//! From a source to a model, its tables and how they compare with the truth, in stages that somebody follows.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use gpbrdf_core::judge::{CellMetrics, Interval, LeftOut};
use gpbrdf_core::model::Conditioned;
use gpbrdf_core::model::bake_sigma_observed;
use gpbrdf_core::{
    BrdfTable, CompressOptions, Content, Environment, Error, Fit, FitOptions, FitReport, Hyper, Metrics,
    Model, Progress, SigmaTable, Source, compress, condition, fit,
};

use super::backend::Backend;
use super::judge::{intervals, judge};
use super::sample::{Measured, symmetry};
use super::spec::ModelSpec;
use super::stage::{Seconds, Stage};

/// Follows a run, from the threads that do the work.
pub(crate) trait Observer: Send + Sync {
    /// A stage begins.
    fn begin(&self, _stage: Stage) {}
    /// How far the stage has come; called many times a second, by any thread.
    fn progress(&self, _progress: Progress) {}
    /// A result is there, before the run goes on.
    fn found(&self, _found: Found<'_>) {}
    /// Whether to give up: the run then ends with [`Error::Cancelled`].
    fn is_cancelled(&self) -> bool {
        false
    }
    /// Something for those who want to know more.
    fn detail(&self, _text: &str) {}
    /// Something good to know beforehand.
    fn note(&self, _text: &str) {}
    /// Something that is not as it was asked for.
    fn warn(&self, _text: &str) {}
}

/// A result of a run.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Found<'a> {
    /// The samples, which the next run of the same source may reuse.
    Samples(&'a Measured),
    /// The model and its mean, and the time so far.
    Mean { fitted: &'a Fitted, mean: &'a Arc<BrdfTable>, seconds: &'a Seconds },
    /// The standard deviation of the target.
    Sigma(&'a Arc<SigmaTable>),
    /// The source as a table.
    Truth(&'a Arc<BrdfTable>),
    /// The comparison of mean and truth.
    Cells(&'a CellMetrics),
}

/// What to do with one source.
#[derive(Debug)]
pub(crate) struct Job<'a> {
    pub(crate) source: &'a Source,
    pub(crate) spec: &'a ModelSpec,
    /// Samples of an earlier job of this source: used if `spec` still asks for them.
    pub(crate) measured: Option<Measured>,
    /// A source that is a model already is taken as it is; else it is measured like any other.
    pub(crate) keep_model: bool,
    pub(crate) baking: Option<Baking>,
    pub(crate) truth: Truth,
    pub(crate) judging: Judging<'a>,
}

impl<'a> Job<'a> {
    /// A job that ends with the model.
    pub(crate) fn new(source: &'a Source, spec: &'a ModelSpec) -> Self {
        Self {
            source,
            spec,
            measured: None,
            keep_model: false,
            baking: None,
            truth: Truth::Unwanted,
            judging: Judging::Nothing,
        }
    }
}

/// How to bake the model.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Baking {
    pub(crate) backend: Backend,
    /// Whether the standard deviation is baked too.
    pub(crate) sigma: bool,
}

/// Where the table of the truth comes from. Scattered samples and, with [`Job::keep_model`], models have
/// none.
#[derive(Clone, Debug)]
pub(crate) enum Truth {
    Unwanted,
    Tabulated,
    Known(Arc<BrdfTable>),
}

/// What is compared with the truth.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Judging<'a> {
    Nothing,
    /// The cells alone, which are found but are no part of the outcome.
    Cells,
    /// Cells, and pictures under an environment.
    All(&'a Environment),
}

/// A model and how it was found.
#[derive(Clone, Debug)]
pub(crate) struct Fitted {
    pub(crate) model: Arc<Model>,
    /// Its samples; a model from a file and a compressed table have none.
    pub(crate) measured: Option<Measured>,
    /// How the search went, for each channel with hyper-parameters of its own; empty without a search.
    pub(crate) reports: Vec<FitReport>,
    /// Every sample as it is predicted from all others, where the solver leaves samples out.
    pub(crate) left_out: Option<LeftOut>,
    /// Log marginal likelihood, all channels together; unknown for a model from a file.
    pub(crate) log_marginal_likelihood: Option<f64>,
}

impl Fitted {
    /// A model of which nothing else is known.
    fn from_file(model: Arc<Model>) -> Self {
        Self { model, measured: None, reports: Vec::new(), left_out: None, log_marginal_likelihood: None }
    }

    fn searched(fit: Fit, measured: Option<Measured>) -> Result<Self> {
        let left_out = match &measured {
            Some(measured) => LeftOut::new(&measured.samples, &fit)?,
            None => None,
        };
        let Fit { model, reports } = fit;
        let value = reports.iter().map(|report| report.log_marginal_likelihood).sum();
        Ok(Self { model: Arc::new(model), measured, reports, left_out, log_marginal_likelihood: Some(value) })
    }
}

/// Tables of a model.
#[derive(Clone, Debug)]
pub(crate) struct Baked {
    pub(crate) mean: Arc<BrdfTable>,
    pub(crate) sigma: Option<Arc<SigmaTable>>,
    /// What made them: `cpu`, or the name of the adapter.
    pub(crate) backend: String,
}

/// All that a job has led to.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    pub(crate) fitted: Fitted,
    pub(crate) baked: Option<Baked>,
    pub(crate) truth: Option<Arc<BrdfTable>>,
    pub(crate) metrics: Option<Metrics>,
}

/// The stages of one command or request: their clock, and who follows them.
pub(crate) struct Run {
    observer: Arc<dyn Observer>,
    seconds: Seconds,
    start: Instant,
}

impl Run {
    /// Starts the clock.
    pub(crate) fn new(observer: impl Observer + 'static) -> Self {
        Self { observer: Arc::new(observer), seconds: Seconds::default(), start: Instant::now() }
    }

    pub(crate) fn observer(&self) -> Arc<dyn Observer> {
        Arc::clone(&self.observer)
    }

    /// The observer of long work, which tells that of the run and hears from it whether to give up.
    pub(super) fn watch(&self) -> gpbrdf_core::Observer {
        let observer = self.observer();
        gpbrdf_core::Observer::new(move |progress| {
            observer.progress(progress);
            if observer.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
    }

    /// Does `work` as a stage.
    ///
    /// # Errors
    /// Those of `work`, and [`Error::Cancelled`] where the observer gives up before it begins.
    pub(crate) fn stage<T>(&mut self, stage: Stage, work: impl FnOnce() -> Result<T>) -> Result<T> {
        if self.observer.is_cancelled() {
            return Err(Error::Cancelled.into());
        }
        self.observer.begin(stage);
        let start = Instant::now();
        let result = work();
        self.seconds.add(stage, start);
        result
    }

    /// The time of each stage, and that of all since the start.
    pub(crate) fn seconds(&mut self) -> Seconds {
        self.seconds.set_total(self.start);
        self.seconds.clone()
    }

    /// Does a job.
    ///
    /// # Errors
    /// Those of its stages, and [`Error::Cancelled`] once the observer gives up.
    pub(crate) fn job(&mut self, job: &Job<'_>) -> Result<Outcome> {
        let (fitted, is_kept) = match &job.source.content {
            Content::Model(model) if job.keep_model => {
                let model = Arc::new((**model).clone());
                (Fitted::from_file(model), true)
            }
            _ => (self.fit(job)?, false),
        };
        let Some(baking) = job.baking else {
            return Ok(Outcome { fitted, baked: None, truth: None, metrics: None });
        };
        let baked = self.bake(&fitted, baking)?;
        let truth = if is_kept { None } else { self.truth(job)? };
        let metrics = match &truth {
            Some(truth) => self.judge(job.judging, truth, &fitted.model, &baked)?,
            None => None,
        };
        Ok(Outcome { fitted, baked: Some(baked), truth, metrics })
    }

    /// The model of a source, by compression of its table or from samples.
    fn fit(&mut self, job: &Job<'_>) -> Result<Fitted> {
        let (source, spec) = (job.source, job.spec);
        if let Some(options) = spec.compress_options()? {
            return self.compress(source, spec, options);
        }
        let observer = self.observer();
        let measured = self.stage(Stage::Sample, || match &job.measured {
            Some(measured) if measured.serves(spec) => Ok(measured.clone()),
            _ => Measured::new(source, spec, &*observer),
        })?;
        observer.found(Found::Samples(&measured));
        let samples = Arc::clone(&measured.samples);
        let options = FitOptions { observer: self.watch(), ..spec.fit_options(measured.symmetry)? };
        self.stage(Stage::Fit, || {
            // Hyper-parameters of one solver mean nothing to another.
            let solver = options.solver.resolve(samples.lattice().is_some());
            // Those of a learned prior fit where one is used, on a lattice of few nodes as well.
            let learned = options.prior(&samples).is_some();
            let fits = |hyper: &Hyper| match hyper.chromatic {
                Some(_) => learned,
                None => hyper.solver == solver,
            };
            if let Some(hyper) = spec.hyper.as_ref().filter(|hyper| fits(hyper)) {
                let Conditioned { model, log_marginal_likelihood } = condition(&samples, &options, hyper)?;
                let log_marginal_likelihood = Some(log_marginal_likelihood);
                let fitted = Fitted::from_file(Arc::new(model));
                return Ok(Fitted { measured: Some(measured), log_marginal_likelihood, ..fitted });
            }
            Fitted::searched(fit(&samples, &options)?, Some(measured))
        })
    }

    /// Fits inducing lattices to the whole table of a source.
    fn compress(&mut self, source: &Source, spec: &ModelSpec, options: CompressOptions) -> Result<Fitted> {
        let table = self.stage(Stage::Tabulate, || Ok(source.table()?))?;
        let options =
            CompressOptions { symmetry: symmetry(spec, source.brdf()?, &*self.observer), ..options };
        let fit = self.stage(Stage::Fit, || Ok(compress(&table, &options, source.provenance())?))?;
        Fitted::searched(fit, None)
    }

    /// The tables of a model.
    fn bake(&mut self, fitted: &Fitted, baking: Baking) -> Result<Baked> {
        let mut baked = baking.backend.bake_mean(self, &fitted.model)?;
        self.observer.found(Found::Mean { fitted, mean: &baked.mean, seconds: &self.seconds });
        if baking.sigma && baked.sigma.is_none() {
            let watch = self.watch();
            let sigma = self.stage(Stage::BakeSigma, || Ok(bake_sigma_observed(&fitted.model, &watch)?))?;
            baked.sigma = Some(Arc::new(sigma));
        }
        baked.sigma = baked.sigma.filter(|_| baking.sigma);
        if let Some(sigma) = &baked.sigma {
            self.observer.found(Found::Sigma(sigma));
        }
        Ok(baked)
    }

    /// The table of the truth, if it is wanted and the source has one.
    fn truth(&mut self, job: &Job<'_>) -> Result<Option<Arc<BrdfTable>>> {
        match &job.truth {
            Truth::Unwanted => Ok(None),
            Truth::Known(truth) => Ok(Some(Arc::clone(truth))),
            Truth::Tabulated if matches!(job.source.content, Content::Samples(_)) => Ok(None),
            Truth::Tabulated => {
                let truth = self.stage(Stage::Truth, || Ok(job.source.table()?.into_owned()))?;
                let truth = Arc::new(truth);
                self.observer.found(Found::Truth(&truth));
                Ok(Some(truth))
            }
        }
    }

    /// Compares what was baked with the truth.
    fn judge(
        &mut self,
        judging: Judging<'_>,
        truth: &BrdfTable,
        model: &Model,
        baked: &Baked,
    ) -> Result<Option<Metrics>> {
        let (mean, sigma) = (&baked.mean, baked.sigma.as_deref());
        match judging {
            Judging::Nothing => Ok(None),
            Judging::Cells => {
                let cells = self.stage(Stage::Compare, || {
                    let intervals = sigma.map(|sigma| intervals(model, mean, sigma));
                    let cell = intervals.as_ref().map(|intervals| |cell| intervals.cell(cell));
                    let interval = cell.as_ref().map(|cell| cell as &Interval<'_>);
                    Ok(CellMetrics::new(truth, mean, interval)?)
                })?;
                self.observer.found(Found::Cells(&cells));
                Ok(None)
            }
            Judging::All(environment) => {
                let metrics =
                    self.stage(Stage::Compare, || Ok(judge(truth, model, mean, sigma, environment)?))?;
                self.observer.found(Found::Cells(&metrics.cells));
                Ok(Some(metrics))
            }
        }
    }
}

impl std::fmt::Debug for Run {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Run").field("seconds", &self.seconds).finish_non_exhaustive()
    }
}

/// Whether an error says that the observer gave up.
#[cfg(feature = "viewer")]
pub(crate) fn is_cancelled(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref::<Error>(), Some(Error::Cancelled))
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::job::PriorName;

    /// Keeps what it is told, and gives up at a stage.
    #[derive(Default)]
    struct Witness {
        told: Arc<Mutex<Vec<String>>>,
        samples: Arc<Mutex<Option<Measured>>>,
        gives_up_at: Option<Stage>,
        now: Mutex<Option<Stage>>,
    }

    impl Observer for Witness {
        fn begin(&self, stage: Stage) {
            *self.now.lock().unwrap() = Some(stage);
            self.told.lock().unwrap().push(stage.label().to_owned());
        }

        fn found(&self, found: Found<'_>) {
            let what = match found {
                Found::Samples(measured) => {
                    *self.samples.lock().unwrap() = Some(measured.clone());
                    "samples"
                }
                Found::Mean { .. } => "mean",
                Found::Sigma(_) => "sigma",
                Found::Truth(_) => "truth",
                Found::Cells(_) => "cells",
            };
            self.told.lock().unwrap().push(what.to_owned());
        }

        fn is_cancelled(&self) -> bool {
            self.gives_up_at.is_some() && *self.now.lock().unwrap() == self.gives_up_at
        }
    }

    fn small() -> ModelSpec {
        ModelSpec { lattice: Some([6, 5, 4]), ..ModelSpec::default() }
    }

    fn whole<'a>(source: &'a Source, spec: &'a ModelSpec) -> Job<'a> {
        Job {
            baking: Some(Baking { backend: Backend::Cpu, sigma: true }),
            truth: Truth::Tabulated,
            judging: Judging::Cells,
            ..Job::new(source, spec)
        }
    }

    #[test]
    fn results_come_in_order_and_samples_are_kept_for_the_next_run() {
        let (source, spec) = (Source::built_in("ward").unwrap(), small());
        let witness = Witness::default();
        let (told, samples) = (Arc::clone(&witness.told), Arc::clone(&witness.samples));
        let mut run = Run::new(witness);
        let outcome = run.job(&whole(&source, &spec)).unwrap();
        let expected = [
            "Sampling",
            "samples",
            "Fitting",
            "Baking the mean",
            "mean",
            "Baking sigma",
            "sigma",
            "Tabulating the truth",
            "truth",
            "Comparing",
            "cells",
        ];
        assert_eq!(*told.lock().unwrap(), expected);
        let seconds = run.seconds();
        assert!(seconds.of(Stage::Fit) > 0.0 && seconds.of(Stage::Load) == 0.0, "{seconds:?}");

        let kept = samples.lock().unwrap().clone().unwrap();
        let truth = Truth::Known(outcome.truth.unwrap());
        let other = ModelSpec { kernel: "se".parse().unwrap(), ..spec.clone() };
        let job = Job { measured: Some(kept.clone()), truth, ..whole(&source, &other) };
        let again = Run::new(Witness::default()).job(&job).unwrap();
        assert!(Arc::ptr_eq(&again.fitted.measured.unwrap().samples, &kept.samples));
        let other = ModelSpec { lattice: Some([5, 5, 4]), ..spec };
        let job = Job { measured: Some(kept.clone()), ..Job::new(&source, &other) };
        let again = Run::new(Witness::default()).job(&job).unwrap();
        assert_eq!(again.fitted.measured.unwrap().samples.angles.len(), 100);
    }

    #[test]
    fn hyper_parameters_set_by_hand_are_taken_where_they_fit() {
        let source = Source::built_in("ward").unwrap();
        // With a prior the same samples would not need the lattice.
        let spec = ModelSpec { prior: PriorName::None, ..small() };
        let found = Run::new(Witness::default()).job(&Job::new(&source, &spec)).unwrap().fitted;
        let spec = ModelSpec { hyper: found.model.hyper(), ..spec };
        let by_hand = Run::new(Witness::default()).job(&Job::new(&source, &spec)).unwrap().fitted;
        assert!(by_hand.reports.is_empty());
        let gap = by_hand.log_marginal_likelihood.unwrap() - found.log_marginal_likelihood.unwrap();
        assert!(gap.abs() < 1e-6 * found.log_marginal_likelihood.unwrap().abs(), "{gap}");
        let spec = ModelSpec {
            layout: super::super::LayoutChoice::Random,
            samples: Some(30),
            lattice: None,
            ..spec
        };
        let searched = Run::new(Witness::default()).job(&Job::new(&source, &spec)).unwrap().fitted;
        assert_eq!(searched.reports.len(), 1);
    }

    #[test]
    fn a_run_ends_where_its_observer_gives_up() {
        let (source, spec) = (Source::built_in("ward").unwrap(), small());
        for stage in [Stage::Sample, Stage::Fit, Stage::BakeMean, Stage::Truth] {
            let witness = Witness { gives_up_at: Some(stage), ..Witness::default() };
            let told = Arc::clone(&witness.told);
            let error = Run::new(witness).job(&whole(&source, &spec)).unwrap_err();
            assert!(matches!(error.downcast_ref(), Some(Error::Cancelled)), "{error:?}");
            let told = told.lock().unwrap();
            let mut stages = told.iter().filter(|t| t.starts_with(char::is_uppercase));
            assert_eq!(stages.next_back().unwrap(), stage.label());
        }
    }
}
