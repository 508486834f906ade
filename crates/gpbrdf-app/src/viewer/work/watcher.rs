//! The thread that notices when open files of measurements change.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, SystemTime};

use super::outbox::Outbox;

/// Between two looks at the files.
const INTERVAL: Duration = Duration::from_millis(300);

/// Size and time of the last change; `None` for a file that is not there.
type Stamp = Option<(u64, Option<SystemTime>)>;

/// The watching thread as the window sees it; the thread ends with it.
#[derive(Debug)]
pub(crate) struct Watcher {
    files: Sender<Vec<PathBuf>>,
    watched: Vec<PathBuf>,
}

impl Watcher {
    /// Starts the thread, which reports each file once it has changed and then stayed the same for two looks, so that
    /// what is still being written is not read.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(crate) fn new(outbox: Outbox<PathBuf>) -> std::io::Result<Self> {
        let (files, changes) = channel();
        std::thread::Builder::new().name("watcher".into()).spawn(move || watch(&changes, &outbox))?;
        Ok(Self { files, watched: Vec::new() })
    }

    /// Watches these files in place of those before.
    pub(crate) fn watch(&mut self, files: &[&PathBuf]) {
        if !self.watched.iter().eq(files.iter().copied()) {
            self.watched = files.iter().copied().cloned().collect();
            // The thread ends only with the watcher.
            let _sent = self.files.send(self.watched.clone());
        }
    }
}

/// What is known of a watched file.
struct Known {
    /// When it was last read.
    read: Stamp,
    /// At the last look.
    seen: Stamp,
}

fn watch(changes: &Receiver<Vec<PathBuf>>, outbox: &Outbox<PathBuf>) {
    let mut files: BTreeMap<PathBuf, Known> = BTreeMap::new();
    loop {
        match changes.recv_timeout(INTERVAL) {
            Ok(wanted) => {
                files.retain(|path, _| wanted.contains(path));
                for path in wanted {
                    let now = stamp(&path);
                    files.entry(path).or_insert(Known { read: now, seen: now });
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        for (path, known) in &mut files {
            let now = stamp(path);
            if now.is_some() && now != known.read && now == known.seen {
                known.read = now;
                outbox.send(path.clone());
            }
            known.seen = now;
        }
    }
}

fn stamp(path: &std::path::Path) -> Stamp {
    let metadata = std::fs::metadata(path).ok()?;
    Some((metadata.len(), metadata.modified().ok()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn a_change_is_reported_once_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let [own, other] = ["a.csv", "b.csv"].map(|name| folder.path().join(name));
        std::fs::write(&own, "1").unwrap();
        std::fs::write(&other, "1").unwrap();
        let (outbox, inbox) = Outbox::channel(&(Arc::new(|| {}) as super::super::outbox::Waker));
        let mut watcher = Watcher::new(outbox).unwrap();
        watcher.watch(&[&own]);
        // The thread has taken the list before the first change.
        assert!(inbox.recv_timeout(4 * INTERVAL).is_err());
        std::fs::write(&other, "22").unwrap();
        std::fs::remove_file(&own).unwrap();
        std::fs::write(&own, "22").unwrap();
        assert_eq!(inbox.recv_timeout(Duration::from_secs(20)).unwrap(), own);
        assert!(inbox.recv_timeout(4 * INTERVAL).is_err());
    }
}
