//! The thread that samples, fits and bakes. The newest request of a document replaces its older ones. The
//! newest of all requests goes first: work on another document is interrupted and begins again later.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use gpbrdf_core::brdf::N_CELLS;
use gpbrdf_core::judge::CellMetrics;
use gpbrdf_core::{
    BrdfTable, Content, Error, FitReport, Hyper, Model, Provenance, SampleSet, SigmaTable, Source, bake_mean,
    bake_sigma, condition, fit_per_axis, interval_95,
};

use super::outbox::Outbox;
use crate::viewer::spec::{ModelSpec, SampleKey};
use crate::viewer::state::document::{Document, DocumentId, Fitted, Stage, Work};

/// What the thread reports about a document.
#[derive(Debug)]
pub(crate) struct Report {
    pub(crate) document: DocumentId,
    pub(crate) news: News,
}

/// One thing to report.
#[derive(Debug)]
pub(crate) enum News {
    /// A stage of the request has begun, or the search has evaluated the likelihood so many times.
    Stage { stage: Stage, evaluations: usize },
    /// A model and its mean.
    Fitted(Box<Fitted>),
    /// Sigma of a result.
    Sigma { version: u64, sigma: Arc<BrdfTable> },
    /// The truth as a table.
    Truth(Arc<BrdfTable>),
    /// Metrics of a result.
    Cells { version: u64, cells: Box<CellMetrics> },
    /// All stages of the request are over.
    Done,
    /// The request ended with an error.
    Failed(String),
}

impl News {
    /// Takes the news into the document that they are about. Once the user has cancelled a request, it stays
    /// cancelled.
    pub(crate) fn apply(self, document: &mut Document) {
        let cancelled = document.work == Work::Cancelled;
        match self {
            Self::Stage { stage, evaluations } if !cancelled => {
                let since = match document.work {
                    Work::Running { since, .. } if stage != Stage::Sampling => since,
                    _ => Instant::now(),
                };
                document.work = Work::Running { stage, since, evaluations };
            }
            Self::Fitted(fitted) => {
                if document.spec.hyper.is_none() {
                    document.optimum = Hyper::of(&fitted.model);
                }
                document.fitted = Some(*fitted);
            }
            Self::Sigma { version, sigma } => {
                if let Some(fitted) = document.result_mut(version) {
                    fitted.sigma = Some(sigma);
                }
            }
            Self::Truth(truth) => document.truth = Some(truth),
            Self::Cells { version, cells } => {
                if let Some(fitted) = document.result_mut(version) {
                    fitted.cells = Some(*cells);
                }
            }
            Self::Done if !cancelled => document.work = Work::Idle,
            Self::Stage { .. } | Self::Done => {}
            Self::Failed(message) => document.work = Work::Failed(message),
        }
    }
}

/// A model to make.
#[derive(Clone, Debug)]
pub(crate) struct Request {
    pub(crate) document: DocumentId,
    pub(crate) source: Arc<Source>,
    pub(crate) truth: Option<Arc<BrdfTable>>,
    pub(crate) spec: ModelSpec,
}

#[derive(Debug, Default)]
struct Queue {
    /// The last one is served next.
    requests: Vec<Request>,
    running: Option<Running>,
    forgotten: Vec<DocumentId>,
    quit: bool,
}

#[derive(Debug)]
struct Running {
    document: DocumentId,
    cancel: Arc<AtomicBool>,
    /// Whether the request goes back into the queue when it is cancelled.
    requeue: bool,
}

#[derive(Debug, Default)]
struct Shared {
    queue: Mutex<Queue>,
    wake: Condvar,
    busy: AtomicBool,
}

/// The fitting thread as the window sees it.
#[derive(Debug)]
pub(crate) struct Fitter {
    shared: Arc<Shared>,
}

/// Why a request ended early: it was cancelled, or there was an error, whose message contains its causes.
enum Stop {
    Cancelled,
    Error(String),
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        if matches!(error, Error::Cancelled) { Self::Cancelled } else { Self::Error(error.to_string()) }
    }
}

fn lock(shared: &Shared) -> MutexGuard<'_, Queue> {
    shared.queue.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Fitter {
    /// Starts the thread.
    pub(crate) fn new(outbox: Outbox<Report>) -> std::io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let theirs = Arc::clone(&shared);
        std::thread::Builder::new().name("fitter".into()).spawn(move || serve(&theirs, &outbox))?;
        Ok(Self { shared })
    }

    /// Requests a model, which is fitted before all that were requested earlier.
    pub(crate) fn submit(&self, request: Request) {
        let mut queue = lock(&self.shared);
        queue.requests.retain(|r| r.document != request.document);
        if let Some(running) = &mut queue.running {
            running.cancel.store(true, Ordering::Relaxed);
            running.requeue = running.document != request.document && running.requeue;
        }
        queue.requests.push(request);
        self.shared.busy.store(true, Ordering::Relaxed);
        self.shared.wake.notify_one();
    }

    /// Cancels the requests of a document.
    pub(crate) fn cancel(&self, document: DocumentId) {
        let mut queue = lock(&self.shared);
        queue.requests.retain(|r| r.document != document);
        if let Some(running) = queue.running.as_mut().filter(|r| r.document == document) {
            running.cancel.store(true, Ordering::Relaxed);
            running.requeue = false;
        }
    }

    /// Cancels the requests of a document and drops its samples.
    pub(crate) fn forget(&self, document: DocumentId) {
        self.cancel(document);
        lock(&self.shared).forgotten.push(document);
        self.shared.wake.notify_one();
    }

    /// A test of whether there is anything to do; slower work waits meanwhile.
    pub(crate) fn busy(&self) -> impl Fn() -> bool + Send + Sync + 'static {
        let shared = Arc::clone(&self.shared);
        move || shared.busy.load(Ordering::Relaxed)
    }
}

impl Drop for Fitter {
    fn drop(&mut self) {
        let mut queue = lock(&self.shared);
        queue.quit = true;
        queue.requests.clear();
        if let Some(running) = &queue.running {
            running.cancel.store(true, Ordering::Relaxed);
        }
        self.shared.wake.notify_all();
    }
}

/// Samples by document, kept while everything on which they depend stays the same.
type Kept = HashMap<DocumentId, (SampleKey, Arc<SampleSet>)>;

fn serve(shared: &Shared, outbox: &Outbox<Report>) {
    let mut kept = Kept::new();
    loop {
        let (request, cancel) = {
            let mut queue = lock(shared);
            loop {
                for document in queue.forgotten.split_off(0) {
                    kept.remove(&document);
                }
                if queue.quit {
                    return;
                }
                if let Some(request) = queue.requests.pop() {
                    let cancel = Arc::new(AtomicBool::new(false));
                    queue.running = Some(Running {
                        document: request.document,
                        cancel: Arc::clone(&cancel),
                        requeue: true,
                    });
                    break (request, cancel);
                }
                shared.busy.store(false, Ordering::Relaxed);
                queue = shared.wake.wait(queue).unwrap_or_else(PoisonError::into_inner);
            }
        };
        let document = request.document;
        let result = run(&request, &cancel, &mut kept, outbox);
        let mut queue = lock(shared);
        let requeue = queue.running.take().is_some_and(|r| r.requeue);
        match result {
            Ok(()) => outbox.send(Report { document, news: News::Done }),
            Err(Stop::Cancelled) if requeue && !queue.requests.iter().any(|r| r.document == document) => {
                queue.requests.insert(0, request);
            }
            Err(Stop::Cancelled) => {}
            Err(Stop::Error(message)) => outbox.send(Report { document, news: News::Failed(message) }),
        }
    }
}

/// The version of the next result.
static VERSION: AtomicU64 = AtomicU64::new(1);

fn run(request: &Request, cancel: &AtomicBool, kept: &mut Kept, outbox: &Outbox<Report>) -> Result<(), Stop> {
    let document = request.document;
    let cancelled = || cancel.load(Ordering::Relaxed);
    let tell = |news: News| outbox.send(Report { document, news });
    let begin = |stage: Stage| {
        if cancelled() {
            return Err(Stop::Cancelled);
        }
        tell(News::Stage { stage, evaluations: 0 });
        Ok(())
    };
    let mut seconds = [0.0; 3];
    let mut start = Instant::now();
    let mut lap = |slot: usize| {
        seconds[slot] = start.elapsed().as_secs_f64();
        start = Instant::now();
    };
    begin(Stage::Sampling)?;
    let (samples, model, value, report) = if let Content::Model(model) = &request.source.content {
        (Arc::new(SampleSet::default()), (**model).clone(), f64::NAN, None)
    } else {
        let samples = sample(request, kept)?;
        lap(0);
        begin(Stage::Fitting)?;
        let told = |evaluations: usize| {
            if evaluations.is_multiple_of(8) {
                tell(News::Stage { stage: Stage::Fitting, evaluations });
            }
        };
        let (model, value, report) = fit(request, &samples, &cancelled, &told)?;
        (samples, model, value, report)
    };
    lap(1);
    begin(Stage::BakingMean)?;
    let mean = Arc::new(bake_mean(&model));
    lap(2);
    let version = VERSION.fetch_add(1, Ordering::Relaxed);
    let model = Arc::new(model);
    tell(News::Fitted(Box::new(Fitted {
        version,
        model: Arc::clone(&model),
        samples,
        log_marginal_likelihood: value,
        report,
        mean: Arc::clone(&mean),
        sigma: None,
        cells: None,
        images: None,
        seconds,
    })));
    begin(Stage::BakingSigma)?;
    let sigma = bake_sigma(&model);
    if let Some(table) = sigma_as_table(&sigma) {
        tell(News::Sigma { version, sigma: Arc::new(table) });
    }
    if matches!(request.source.content, Content::Model(_) | Content::Samples(_)) {
        return Ok(());
    }
    let truth = if let Some(truth) = &request.truth {
        Arc::clone(truth)
    } else {
        begin(Stage::Tabulating)?;
        let Some(truth) = request.source.table() else { return Ok(()) };
        let truth = Arc::new(truth.into_owned());
        tell(News::Truth(Arc::clone(&truth)));
        truth
    };
    begin(Stage::Comparing)?;
    let noise = model.noise_variances();
    let interval = |cell: usize| {
        let ends: [(f64, f64); 3] = std::array::from_fn(|c| {
            let latent = f64::from(sigma.value(cell, c));
            let mean = f64::from(mean.values()[cell][c]);
            interval_95(model.transform, mean, (latent * latent + noise[c]).sqrt())
        });
        (ends.map(|e| e.0), ends.map(|e| e.1))
    };
    let cells = Box::new(CellMetrics::new(&truth, &mean, Some(&interval))?);
    tell(News::Cells { version, cells });
    Ok(())
}

/// The samples of a request, measured unless they are kept.
fn sample(request: &Request, kept: &mut Kept) -> Result<Arc<SampleSet>, Stop> {
    let key = request.spec.sample_key();
    if let Some((known, samples)) = kept.get(&request.document)
        && *known == key
    {
        return Ok(Arc::clone(samples));
    }
    let samples = request.spec.measure(&request.source).map_err(|error| Stop::Error(format!("{error:#}")))?;
    let samples = Arc::new(samples);
    kept.insert(request.document, (key, Arc::clone(&samples)));
    Ok(samples)
}

/// The model of a request, its log marginal likelihood and how a search went.
fn fit(
    request: &Request,
    samples: &SampleSet,
    cancelled: &dyn Fn() -> bool,
    told: &dyn Fn(usize),
) -> Result<(Model, f64, Option<FitReport>), Stop> {
    let (spec, source) = (&request.spec, &request.source);
    let provenance = Provenance {
        material: source.name.clone(),
        source: source.origin(),
        sha256: source.sha256.clone(),
        ..Provenance::default()
    };
    let options = spec.options();
    // Hyper-parameters of a lattice do not suit scattered samples, nor the other way round.
    let given = spec.hyper.as_ref().filter(|h| matches!(h, Hyper::Lattice(_)) == samples.lattice.is_some());
    if let Some(hyper) = given {
        let (model, value) = condition(samples, &options, hyper, provenance)?;
        return Ok((model, value, None));
    }
    let shapes = spec.shapes();
    let count = std::cell::Cell::new(0);
    let ask = || {
        count.set(count.get() + 1);
        told(count.get());
        cancelled()
    };
    let (model, mut reports) =
        fit_per_axis(samples, &options, shapes.each_ref().map(|s| s.as_slice()), provenance, &ask)?;
    let report = reports.pop();
    let value = report.as_ref().map_or(f64::NAN, |r| r.log_marginal_likelihood);
    Ok((model, value, report))
}

/// Sigma of each channel as a table, to be looked up like one.
fn sigma_as_table(sigma: &SigmaTable) -> Option<BrdfTable> {
    let values = match sigma.planes() {
        [plane] => plane.iter().map(|&s| [s; 3]).collect(),
        _ => (0..N_CELLS).map(|cell| std::array::from_fn(|c| sigma.value(cell, c))).collect(),
    };
    BrdfTable::from_values(values)
}
