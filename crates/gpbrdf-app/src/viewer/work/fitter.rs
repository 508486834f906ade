//! The thread that samples, fits and bakes. The newest request of a document replaces its older ones. The
//! newest of all requests goes first: work on another document is interrupted and begins again later.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use anyhow::Result;
use gpbrdf_core::judge::CellMetrics;
use gpbrdf_core::{BrdfTable, Progress, Source};

use super::outbox::Outbox;
use crate::job::{
    Backend, Baking, Found, Job, Judging, Measured, ModelSpec, Observer, Run, Stage, Truth, is_cancelled,
};
use crate::viewer::state::document::{Document, DocumentId, Fitted, Work};

/// What the thread reports about a document.
#[derive(Debug)]
pub(crate) struct Report {
    pub(crate) document: DocumentId,
    pub(crate) news: News,
}

/// One thing to report.
#[derive(Debug)]
pub(crate) enum News {
    /// A stage of the request has begun.
    Stage(Stage),
    /// How far the stage has come.
    Progress(Progress),
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
            Self::Stage(stage) if !cancelled => {
                let begun = Instant::now();
                let since = match document.work {
                    Work::Running { since, .. } if stage != Stage::Sample => since,
                    _ => begun,
                };
                document.work = Work::Running { stage, since, begun, progress: Progress::default() };
            }
            Self::Progress(now) => {
                if let Work::Running { progress, .. } = &mut document.work {
                    *progress = now;
                }
            }
            Self::Fitted(fitted) => {
                if document.spec.hyper.is_none() {
                    document.optimum = fitted.model.hyper();
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
            Self::Stage(_) | Self::Done => {}
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
type Kept = Arc<Mutex<HashMap<DocumentId, Measured>>>;

fn serve(shared: &Shared, outbox: &Outbox<Report>) {
    let kept = Kept::default();
    loop {
        let (request, cancel) = {
            let mut queue = lock(shared);
            loop {
                for document in queue.forgotten.split_off(0) {
                    kept.lock().unwrap_or_else(PoisonError::into_inner).remove(&document);
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
        let follower = Follower::new(&request, cancel, Arc::clone(&kept), outbox.clone());
        let result = run(&request, follower);
        let mut queue = lock(shared);
        let requeue = queue.running.take().is_some_and(|r| r.requeue);
        match result {
            Ok(()) => outbox.send(Report { document, news: News::Done }),
            Err(error) if is_cancelled(&error) => {
                if requeue && !queue.requests.iter().any(|r| r.document == document) {
                    queue.requests.insert(0, request);
                }
            }
            Err(error) => outbox.send(Report { document, news: News::Failed(format!("{error:#}")) }),
        }
    }
}

/// The version of the next result.
static VERSION: AtomicU64 = AtomicU64::new(1);

/// Does the job of a request; its results are reported as they come.
fn run(request: &Request, follower: Follower) -> Result<()> {
    let (source, spec) = (&request.source, &request.spec);
    let measured = follower.measured();
    let truth = request.truth.as_ref().map_or(Truth::Tabulated, |truth| Truth::Known(Arc::clone(truth)));
    let job = Job {
        measured,
        keep_model: true,
        baking: Some(Baking { backend: Backend::Cpu, sigma: true }),
        truth,
        judging: Judging::Cells,
        ..Job::new(source, spec)
    };
    Run::new(follower).job(&job)?;
    Ok(())
}

/// Reports the stages and results of one request.
struct Follower {
    document: DocumentId,
    version: u64,
    cancel: Arc<AtomicBool>,
    kept: Kept,
    outbox: Outbox<Report>,
    /// The progress that was last reported.
    told: Mutex<Progress>,
}

/// The progress is reported after so many evaluations, or after such a share.
const EVALUATIONS: usize = 8;
const SHARE: f64 = 0.005;

impl Follower {
    fn new(request: &Request, cancel: Arc<AtomicBool>, kept: Kept, outbox: Outbox<Report>) -> Self {
        let version = VERSION.fetch_add(1, Ordering::Relaxed);
        Self { document: request.document, version, cancel, kept, outbox, told: Mutex::default() }
    }

    fn tell(&self, news: News) {
        self.outbox.send(Report { document: self.document, news });
    }

    /// The samples that an earlier request has left.
    fn measured(&self) -> Option<Measured> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).get(&self.document).cloned()
    }
}

impl Observer for Follower {
    fn begin(&self, stage: Stage) {
        *self.told.lock().unwrap_or_else(PoisonError::into_inner) = Progress::default();
        self.tell(News::Stage(stage));
    }

    fn progress(&self, progress: Progress) {
        // Another thread that is at it reports nearly the same.
        let Ok(mut told) = self.told.try_lock() else { return };
        let share = |progress: &Progress| progress.share.unwrap_or_default();
        if progress.evaluations >= told.evaluations + EVALUATIONS || share(&progress) >= share(&told) + SHARE
        {
            *told = progress;
            self.tell(News::Progress(progress));
        }
    }

    fn found(&self, found: Found<'_>) {
        let version = self.version;
        match found {
            Found::Samples(measured) => {
                let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.insert(self.document, measured.clone());
            }
            Found::Mean { fitted, mean, seconds } => {
                let samples = fitted.measured.as_ref().map(|measured| Arc::clone(&measured.samples));
                self.tell(News::Fitted(Box::new(Fitted {
                    version,
                    model: Arc::clone(&fitted.model),
                    samples: samples.unwrap_or_default(),
                    log_marginal_likelihood: fitted.log_marginal_likelihood,
                    report: fitted.reports.first().cloned(),
                    left_out: fitted.left_out.clone(),
                    mean: Arc::clone(mean),
                    sigma: None,
                    cells: None,
                    images: None,
                    seconds: [Stage::Sample, Stage::Fit, Stage::BakeMean].map(|stage| seconds.of(stage)),
                })));
            }
            Found::Sigma(sigma) => self.tell(News::Sigma { version, sigma: Arc::new(sigma.to_table()) }),
            Found::Truth(truth) => self.tell(News::Truth(Arc::clone(truth))),
            Found::Cells(cells) => self.tell(News::Cells { version, cells: Box::new(cells.clone()) }),
        }
    }

    fn is_cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }
}
