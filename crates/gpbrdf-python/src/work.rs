//! Work with the interpreter's lock released.

use std::ops::ControlFlow;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;

use gpbrdf_core::{Observer, Result};
use pyo3::{Py, PyAny, PyResult, Python};

use crate::error::exception;

/// How often the interpreter's signals are looked at, and progress is told.
const INTERVAL: Duration = Duration::from_millis(50);

/// Does work of up to some milliseconds, or without an observer, while other threads of Python run.
pub(crate) fn released<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    py.detach(work).map_err(exception)
}

/// Does long work while other threads of Python run. The work runs in a thread of its own; the calling one waits for
/// it, runs signal handlers of Python, which only the main thread can, and calls `progress` with the share that is done
/// of each part. An exception of either, such as `KeyboardInterrupt`, makes the work's observer stop it.
pub(crate) fn observed<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Observer) -> Result<T> + Send,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    // The bits of the share.
    let share = Arc::new(AtomicU64::new(0));
    let observer = Observer::new({
        let (stop, share) = (Arc::clone(&stop), Arc::clone(&share));
        move |progress| {
            if let Some(done) = progress.share {
                share.store(done.to_bits(), Ordering::Relaxed);
            }
            if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    });
    let mut raised = None;
    let mut told = 0;
    let outcome = thread::scope(|scope| {
        // The receiver is told that the work has ended by the sender's end.
        let (running, ended) = sync_channel::<()>(0);
        let worker = thread::Builder::new().name("gpbrdf".to_owned()).spawn_scoped(scope, move || {
            let _running = running;
            work(&observer)
        })?;
        // A receiver is not shared between threads, but it may be handed back and forth.
        let mut ended = ended;
        loop {
            let waited;
            (ended, waited) = py.detach(move || {
                let waited = ended.recv_timeout(INTERVAL);
                (ended, waited)
            });
            if waited != Err(RecvTimeoutError::Timeout) {
                break;
            }
            if raised.is_some() {
                continue;
            }
            let found = py.check_signals().and_then(|()| {
                let done = share.load(Ordering::Relaxed);
                match progress {
                    Some(progress) if done != told => {
                        told = done;
                        progress.call1(py, (f64::from_bits(done),)).map(drop)
                    }
                    _ => Ok(()),
                }
            });
            if let Err(error) = found {
                raised = Some(error);
                stop.store(true, Ordering::Relaxed);
            }
        }
        PyResult::Ok(worker.join().unwrap_or_else(|panic| resume_unwind(panic)))
    })?;
    match raised {
        Some(error) => Err(error),
        None => outcome.map_err(exception),
    }
}
