//! How threads send results to the window, each in a type of its own.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

/// Wakes the window, so that it takes in what has been sent.
pub(crate) type Waker = Arc<dyn Fn() + Send + Sync>;

/// The sending side: passes a message on and wakes the window.
pub(crate) struct Outbox<T>(Arc<dyn Fn(T) + Send + Sync>);

impl<T> Clone for Outbox<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> std::fmt::Debug for Outbox<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Outbox")
    }
}

impl<T: Send + 'static> Outbox<T> {
    /// A channel whose sending side wakes the window.
    pub(crate) fn channel(wake: &Waker) -> (Self, Receiver<T>) {
        let (sender, receiver) = channel();
        let wake = Arc::clone(wake);
        let send = move |message| {
            // A closing window has dropped its receiver; nobody needs the message then.
            let _closing = sender.send(message);
            wake();
        };
        (Self(Arc::new(send)), receiver)
    }

    /// Sends a message. It is dropped when the window has closed its side.
    pub(crate) fn send(&self, message: T) {
        (self.0)(message);
    }

    /// An outbox for messages of another type, each of which is wrapped into one of this type.
    pub(crate) fn map<U>(&self, wrap: impl Fn(U) -> T + Send + Sync + 'static) -> Outbox<U> {
        let send = Arc::clone(&self.0);
        Outbox(Arc::new(move |message| send(wrap(message))))
    }
}

/// Runs `work` on a thread of its own and sends its result. Where the system gives no thread, an error that
/// begins with `cannot` is sent instead.
pub(crate) fn in_background<T: Send + 'static>(
    outbox: &Outbox<Result<T, String>>,
    thread: &str,
    cannot: &str,
    work: impl FnOnce() -> Result<T, String> + Send + 'static,
) {
    let theirs = outbox.clone();
    let job = move || theirs.send(work());
    if let Err(error) = std::thread::Builder::new().name(thread.into()).spawn(job) {
        outbox.send(Err(format!("{cannot}: {error}")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn messages_are_wrapped_and_wake_the_window() {
        let woken = Arc::new(AtomicUsize::new(0));
        let theirs = Arc::clone(&woken);
        let wake: Waker = Arc::new(move || {
            theirs.fetch_add(1, Ordering::Relaxed);
        });
        let (outbox, inbox) = Outbox::<Option<u32>>::channel(&wake);
        outbox.map(|x: u32| Some(x + 1)).send(2);
        outbox.send(None);
        assert_eq!(inbox.try_iter().collect::<Vec<_>>(), [Some(3), None]);
        assert_eq!(woken.load(Ordering::Relaxed), 2);
        drop(inbox);
        outbox.send(None);
    }

    #[test]
    fn work_in_the_background_sends_its_result() {
        let (outbox, inbox) = Outbox::channel(&(Arc::new(|| ()) as Waker));
        in_background(&outbox, "test", "cannot work", || Ok::<_, String>(7));
        assert_eq!(inbox.recv(), Ok(Ok(7)));
    }
}
