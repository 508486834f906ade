//! Hands the newest request to a thread. The thread never sees an older request that has been replaced.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};

#[derive(Debug)]
struct Slot<T> {
    request: Option<T>,
    closed: bool,
}

/// A place for one request.
#[derive(Debug)]
pub(crate) struct Mailbox<T> {
    slot: Mutex<Slot<T>>,
    filled: Condvar,
    generation: AtomicU64,
}

impl<T: Send + 'static> Mailbox<T> {
    /// Starts a thread that calls `serve` with each request and a test of whether a newer one has come.
    pub(crate) fn spawn(
        name: &str,
        mut serve: impl FnMut(T, &(dyn Fn() -> bool + Sync)) + Send + 'static,
    ) -> std::io::Result<Sender<T>> {
        let mailbox = Arc::new(Self {
            slot: Mutex::new(Slot { request: None, closed: false }),
            filled: Condvar::new(),
            generation: AtomicU64::new(0),
        });
        let theirs = Arc::clone(&mailbox);
        let thread = std::thread::Builder::new().name(name.into()).spawn(move || {
            while let Some((request, generation)) = theirs.take() {
                serve(request, &|| theirs.generation.load(Ordering::Relaxed) != generation);
            }
        })?;
        Ok(Sender { mailbox, thread: Some(thread) })
    }

    fn take(&self) -> Option<(T, u64)> {
        let mut slot = self.slot.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if slot.closed {
                return None;
            }
            if let Some(request) = slot.request.take() {
                return Some((request, self.generation.load(Ordering::Relaxed)));
            }
            slot = self.filled.wait(slot).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// The sending side of a mailbox; the thread ends with it.
#[derive(Debug)]
pub(crate) struct Sender<T> {
    mailbox: Arc<Mailbox<T>>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl<T> Sender<T> {
    /// Leaves a request in place of an older one.
    pub(crate) fn put(&self, request: T) {
        let mut slot = self.mailbox.slot.lock().unwrap_or_else(PoisonError::into_inner);
        slot.request = Some(request);
        self.mailbox.generation.fetch_add(1, Ordering::Relaxed);
        self.mailbox.filled.notify_one();
    }

    fn close(&self) {
        let mut slot = self.mailbox.slot.lock().unwrap_or_else(PoisonError::into_inner);
        slot.closed = true;
        self.mailbox.generation.fetch_add(1, Ordering::Relaxed);
        self.mailbox.filled.notify_all();
    }

    /// Ends the thread and waits for it.
    pub(crate) fn join(mut self) {
        self.close();
        if let Some(thread) = self.thread.take() {
            let _panicked = thread.join();
        }
    }
}

impl<T> Drop for Sender<T> {
    fn drop(&mut self) {
        self.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn the_newest_request_wins_and_older_ones_know() {
        let (began, begun) = channel();
        let (go, gone) = channel::<()>();
        let (done, results) = channel();
        let sender = Mailbox::spawn("test", move |request: u32, stale| {
            began.send(request).unwrap();
            gone.recv().unwrap();
            done.send((request, stale())).unwrap();
        })
        .unwrap();
        sender.put(1);
        assert_eq!(begun.recv(), Ok(1));
        sender.put(2);
        sender.put(3);
        go.send(()).unwrap();
        assert_eq!(results.recv(), Ok((1, true)));
        assert_eq!(begun.recv(), Ok(3));
        go.send(()).unwrap();
        assert_eq!(results.recv(), Ok((3, false)));
    }
}
