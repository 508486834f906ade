//! The threads that sample, fit and bake. The newest request of a document replaces its older ones.
//!
//! There are two lanes, so that a large job holds up no other. In the quick one the newest of all requests goes first:
//! work on another document is interrupted and begins again later. In the slow one, where work would be lost by that,
//! the smallest of the jobs that wait follows the one that is done.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use anyhow::Result;
use gpbrdf_core::judge::CellMetrics;
use gpbrdf_core::{BrdfTable, Content, Progress, Source};

use super::outbox::Outbox;
use crate::job::{
    Backend, Baking, Found, Job, Judging, LayoutChoice, Measured, ModelSpec, Observer, Run, Stage, Truth,
    is_cancelled,
};
use crate::message::said_once;
use crate::viewer::state::document::{Document, DocumentId, Fitted, Work};

/// What the thread reports about a document.
#[derive(Debug)]
pub(crate) struct Report {
    pub(crate) document: DocumentId,
    /// The number of the request.
    pub(crate) request: u64,
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
    /// A newer request of another document goes first; this one begins again later.
    Interrupted,
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
            Self::Interrupted if !cancelled => document.work = Work::Waiting,
            Self::Stage(_) | Self::Done | Self::Interrupted => {}
            Self::Failed(message) => document.work = Work::Failed(message),
        }
    }
}

/// A model to make.
#[derive(Clone, Debug)]
pub(crate) struct Request {
    pub(crate) document: DocumentId,
    /// A number that no earlier request had. What older requests still report is for nobody.
    pub(crate) number: u64,
    pub(crate) source: Arc<Source>,
    pub(crate) truth: Option<Arc<BrdfTable>>,
    pub(crate) spec: ModelSpec,
}

/// A job to more scattered samples than this waits in the slow lane; one to fewer takes about a second.
const QUICK_SAMPLES: usize = 400;

impl Request {
    /// Samples off a lattice, which are what takes time; 0 where there are none.
    fn scattered_samples(&self) -> usize {
        match &self.source.content {
            Content::Samples(samples) => samples.len(),
            Content::Model(_) => 0,
            _ if self.spec.layout == LayoutChoice::Lattice => 0,
            _ => self.spec.scattered_samples(),
        }
    }

    fn is_slow(&self) -> bool {
        self.scattered_samples() > QUICK_SAMPLES
    }
}

#[derive(Debug, Default)]
struct Queue {
    /// Those that have waited longest come first.
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
struct Lane {
    is_slow: bool,
    queue: Mutex<Queue>,
    wake: Condvar,
    busy: AtomicBool,
}

impl Lane {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn submit(&self, request: Request) {
        let mut queue = self.lock();
        queue.requests.retain(|r| r.document != request.document);
        if let Some(running) = &mut queue.running
            && (running.document == request.document || !self.is_slow)
        {
            running.cancel.store(true, Ordering::Relaxed);
            running.requeue = running.document != request.document && running.requeue;
        }
        queue.requests.push(request);
        self.busy.store(true, Ordering::Relaxed);
        self.wake.notify_one();
    }

    fn cancel(&self, document: DocumentId) {
        let mut queue = self.lock();
        queue.requests.retain(|r| r.document != document);
        if let Some(running) = queue.running.as_mut().filter(|r| r.document == document) {
            running.cancel.store(true, Ordering::Relaxed);
            running.requeue = false;
        }
    }
}

impl Queue {
    /// The request that is served next.
    fn next(&mut self, is_slow: bool) -> Option<Request> {
        if !is_slow {
            return self.requests.pop();
        }
        let sizes = self.requests.iter().enumerate();
        let (smallest, _) = sizes.min_by_key(|(_, request)| request.scattered_samples())?;
        Some(self.requests.remove(smallest))
    }
}

/// The fitting threads as the window sees them.
#[derive(Debug)]
pub(crate) struct Fitter {
    quick: Arc<Lane>,
    slow: Arc<Lane>,
    awaited: Arc<AtomicBool>,
}

/// For so long what follows a mean waits for the first picture of it.
const GRACE: Duration = Duration::from_millis(1500);

impl Fitter {
    /// Starts the threads. The slow one computes in a pool of its own, so that the quick one never waits for a part of
    /// its work.
    pub(crate) fn new(outbox: Outbox<Report>) -> std::io::Result<Self> {
        let [quick, slow] = [false, true].map(|is_slow| Arc::new(Lane { is_slow, ..Lane::default() }));
        let pool = rayon::ThreadPoolBuilder::new().build().map_err(std::io::Error::other)?;
        let kept = Kept::default();
        let awaited = Arc::new(AtomicBool::new(false));
        let (lane, samples, out) = (Arc::clone(&quick), Arc::clone(&kept), outbox.clone());
        let picture = Arc::clone(&awaited);
        std::thread::Builder::new()
            .name("fitter".into())
            .spawn(move || serve(&lane, &samples, &out, (None, &picture)))?;
        let (lane, picture) = (Arc::clone(&slow), Arc::clone(&awaited));
        std::thread::Builder::new()
            .name("slow fitter".into())
            .spawn(move || serve(&lane, &kept, &outbox, (Some(&pool), &picture)))?;
        Ok(Self { quick, slow, awaited })
    }

    /// Requests a model.
    pub(crate) fn submit(&self, request: Request) {
        let (own, other) =
            if request.is_slow() { (&self.slow, &self.quick) } else { (&self.quick, &self.slow) };
        other.cancel(request.document);
        own.submit(request);
    }

    /// Cancels the requests of a document.
    pub(crate) fn cancel(&self, document: DocumentId) {
        self.quick.cancel(document);
        self.slow.cancel(document);
    }

    /// Cancels the requests of a document and drops its samples.
    pub(crate) fn forget(&self, document: DocumentId) {
        self.cancel(document);
        for lane in [&self.quick, &self.slow] {
            lane.lock().forgotten.push(document);
            lane.wake.notify_one();
        }
    }

    /// Whether the first picture of an object is awaited. Meanwhile the fitter leaves the processors to it, once there
    /// is a mean.
    pub(crate) fn awaited(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.awaited)
    }

    /// A test of whether there is anything quick to do; pictures wait meanwhile.
    pub(crate) fn busy(&self) -> impl Fn() -> bool + Send + Sync + 'static {
        let quick = Arc::clone(&self.quick);
        move || quick.busy.load(Ordering::Relaxed)
    }
}

impl Drop for Fitter {
    fn drop(&mut self) {
        for lane in [&self.quick, &self.slow] {
            let mut queue = lane.lock();
            queue.quit = true;
            queue.requests.clear();
            if let Some(running) = &queue.running {
                running.cancel.store(true, Ordering::Relaxed);
            }
            lane.wake.notify_all();
        }
    }
}

/// Samples by document, kept while everything on which they depend stays the same.
type Kept = Arc<Mutex<HashMap<DocumentId, Measured>>>;

fn serve(
    lane: &Lane,
    kept: &Kept,
    outbox: &Outbox<Report>,
    (pool, awaited): (Option<&rayon::ThreadPool>, &Arc<AtomicBool>),
) {
    loop {
        let (request, cancel) = {
            let mut queue = lane.lock();
            loop {
                for document in queue.forgotten.split_off(0) {
                    kept.lock().unwrap_or_else(PoisonError::into_inner).remove(&document);
                }
                if queue.quit {
                    return;
                }
                if let Some(request) = queue.next(lane.is_slow) {
                    let cancel = Arc::new(AtomicBool::new(false));
                    queue.running = Some(Running {
                        document: request.document,
                        cancel: Arc::clone(&cancel),
                        requeue: true,
                    });
                    break (request, cancel);
                }
                lane.busy.store(false, Ordering::Relaxed);
                queue = lane.wake.wait(queue).unwrap_or_else(PoisonError::into_inner);
            }
        };
        let (document, number) = (request.document, request.number);
        let report = |news| outbox.send(Report { document, request: number, news });
        let follower =
            Follower::new(&request, cancel, (Arc::clone(kept), Arc::clone(awaited)), outbox.clone());
        let result = match pool {
            Some(pool) => pool.install(|| run(&request, follower)),
            None => run(&request, follower),
        };
        let mut queue = lane.lock();
        let requeue = queue.running.take().is_some_and(|r| r.requeue);
        match result {
            Ok(()) => report(News::Done),
            Err(error) if is_cancelled(&error) => {
                if requeue && !queue.requests.iter().any(|r| r.document == document) {
                    report(News::Interrupted);
                    queue.requests.insert(0, request);
                }
            }
            Err(error) => report(News::Failed(said_once(&error))),
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
    request: u64,
    version: u64,
    cancel: Arc<AtomicBool>,
    kept: Kept,
    awaited: Arc<AtomicBool>,
    outbox: Outbox<Report>,
    /// The progress that was last reported.
    told: Mutex<Progress>,
}

/// The progress is reported after so many evaluations, or after such a share.
const EVALUATIONS: usize = 8;
const SHARE: f64 = 0.005;

impl Follower {
    fn new(
        request: &Request,
        cancel: Arc<AtomicBool>,
        (kept, awaited): (Kept, Arc<AtomicBool>),
        outbox: Outbox<Report>,
    ) -> Self {
        let version = VERSION.fetch_add(1, Ordering::Relaxed);
        let (document, request) = (request.document, request.number);
        Self { document, request, version, cancel, kept, awaited, outbox, told: Mutex::default() }
    }

    fn tell(&self, news: News) {
        self.outbox.send(Report { document: self.document, request: self.request, news });
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
        let start = Instant::now();
        while matches!(stage, Stage::BakeSigma | Stage::Truth)
            && self.awaited.load(Ordering::Relaxed)
            && start.elapsed() < GRACE
            && !self.is_cancelled()
        {
            std::thread::sleep(Duration::from_millis(5));
        }
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

#[cfg(test)]
mod tests {
    use gpbrdf_core::{Layout, SampleSet};

    use super::*;
    use crate::viewer::work::outbox::Waker;

    fn request(id: u64, scattered: usize) -> Request {
        let mut source = Source::built_in("lambert").unwrap();
        if scattered > 0 {
            let layout = Layout::Hemisphere { count: scattered, seed: id };
            let samples = SampleSet::measure(source.brdf().unwrap(), &layout).unwrap();
            source.content = Content::Samples(Box::new(samples));
        }
        let spec = ModelSpec { lattice: Some([8, 6, 4]), ..ModelSpec::interactive() };
        Request { document: DocumentId(id), number: id, source: Arc::new(source), truth: None, spec }
    }

    #[test]
    fn the_slow_lane_serves_small_jobs_first_and_the_quick_one_new_ones() {
        let requests = || vec![request(0, 900), request(1, 500), request(2, 700)];
        let mut queue = Queue { requests: requests(), ..Queue::default() };
        let order: Vec<u64> =
            std::iter::from_fn(|| queue.next(true)).map(|request| request.document.0).collect();
        assert_eq!(order, [1, 2, 0]);
        let mut queue = Queue { requests: requests(), ..Queue::default() };
        assert_eq!(queue.next(false).unwrap().document, DocumentId(2));
        assert!(request(3, 900).is_slow() && !request(3, 60).is_slow() && !request(3, 0).is_slow());
    }

    #[test]
    fn quick_materials_do_not_wait_for_a_slow_one() {
        let (outbox, inbox) = Outbox::channel(&(Arc::new(|| {}) as Waker));
        let fitter = Fitter::new(outbox).unwrap();
        // Its fit alone takes several times as long as everything of the others.
        fitter.submit(request(0, 20_000));
        for id in 1..4 {
            fitter.submit(request(id, 0));
        }
        let mut done = Vec::new();
        while done.len() < 3 {
            let report: Report = inbox.recv_timeout(std::time::Duration::from_secs(120)).unwrap();
            if matches!(report.news, News::Done) {
                done.push(report.document.0);
            }
        }
        done.sort_unstable();
        assert_eq!(done, [1, 2, 3], "the slow one was waited for");
        fitter.cancel(DocumentId(0));
    }
}
