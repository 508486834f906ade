//! Metrics of pictures of a lit sphere, as the command line reports them, computed on a thread of their own.

use std::sync::Arc;
use std::time::Duration;

use gpbrdf_core::judge::{
    ENV_PATCHES, ImageMetrics, SPHERE_SIZE, environment_lights, render_point, render_sphere,
};
use gpbrdf_core::{BrdfTable, Environment};

use super::mailbox::{Mailbox, Sender};
use super::outbox::Outbox;
use crate::viewer::state::document::{Document, DocumentId};

/// Pictures to compare.
#[derive(Clone, Debug)]
pub(crate) struct MetricsRequest {
    pub(crate) document: DocumentId,
    /// The number of the result.
    pub(crate) version: u64,
    truth: Arc<BrdfTable>,
    mean: Arc<BrdfTable>,
}

impl MetricsRequest {
    /// The request for an open material; `None` until it is fitted and its truth is a table, and where its metrics are
    /// known.
    pub(crate) fn of(document: &Document) -> Option<Self> {
        let fitted = document.fitted.as_ref().filter(|fitted| fitted.images.is_none())?;
        let truth = document.truth.as_ref().filter(|_| document.source_is_truth())?;
        Some(Self {
            document: document.id,
            version: fitted.version,
            truth: Arc::clone(truth),
            mean: Arc::clone(&fitted.mean),
        })
    }
}

/// Metrics of pictures of a result.
#[derive(Clone, Debug)]
pub(crate) struct SphereMetrics {
    pub(crate) document: DocumentId,
    pub(crate) version: u64,
    pub(crate) images: Box<ImageMetrics>,
}

/// Starts the thread. It has a thread pool of its own, and waits while the fitter is `busy`.
pub(crate) fn spawn(
    outbox: Outbox<SphereMetrics>,
    busy: impl Fn() -> bool + Send + Sync + 'static,
) -> std::io::Result<Sender<MetricsRequest>> {
    let pool = rayon::ThreadPoolBuilder::new().build().map_err(std::io::Error::other)?;
    Mailbox::spawn("spheres", move |request: MetricsRequest, stale| {
        while busy() {
            if stale() {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        if let Some(images) = pool.install(|| metrics(&request, stale)) {
            let (document, version) = (request.document, request.version);
            outbox.send(SphereMetrics { document, version, images: Box::new(images) });
        }
    })
}

type Stale<'a> = &'a (dyn Fn() -> bool + Sync);

fn metrics(request: &MetricsRequest, stale: Stale<'_>) -> Option<ImageMetrics> {
    let tables = [request.truth.as_ref(), request.mean.as_ref()];
    let lights = environment_lights(&Environment::studio(), ENV_PATCHES);
    let env = render_sphere(&tables, &lights, SPHERE_SIZE, stale).ok()?;
    let point = render_point(&tables, SPHERE_SIZE);
    ImageMetrics::new((env.first()?, env.get(1)?), (point.first()?, point.get(1)?)).ok()
}
