//! What goes to standard output and standard error.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};

/// The user's wishes about output.
#[derive(Debug)]
pub(crate) struct Terminal {
    quiet: bool,
    verbose: u8,
}

impl Terminal {
    pub(crate) fn new(quiet: bool, verbose: u8) -> Self {
        Self { quiet, verbose }
    }

    /// Writes to standard output what the user asked for.
    pub(crate) fn print(&self, text: &str) -> Result<()> {
        let mut out = io::stdout().lock();
        out.write_all(text.as_bytes()).and_then(|()| out.flush()).context("cannot write to standard output")
    }

    /// Writes a line of a summary to standard output, unless quiet.
    pub(crate) fn summary(&self, text: &str) -> Result<()> {
        if self.quiet { Ok(()) } else { self.print(&format!("{text}\n")) }
    }

    /// Writes a line to standard error with `-v`.
    pub(crate) fn detail(&self, text: &str) {
        if self.verbose > 0 && !self.quiet {
            eprintln!("{text}");
        }
    }

    /// Writes what is good to know beforehand to standard error, unless quiet.
    pub(crate) fn note(&self, text: &str) {
        if !self.quiet {
            eprintln!("note: {text}");
        }
    }

    /// Writes a warning to standard error, unless quiet.
    pub(crate) fn warn(&self, text: &str) {
        if !self.quiet {
            eprintln!("warning: {text}");
        }
    }

    /// Runs `work` under a spinner that shows after half a second, on a terminal only.
    pub(crate) fn stage<T>(&self, what: &'static str, work: impl FnOnce() -> T) -> T {
        if self.quiet || !io::stderr().is_terminal() {
            return work();
        }
        let (done, wait) = std::sync::mpsc::channel::<()>();
        let spinner = std::thread::spawn(move || {
            if wait.recv_timeout(Duration::from_millis(500)).is_ok() {
                return;
            }
            let bar = ProgressBar::new_spinner().with_message(what);
            if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} {elapsed}") {
                bar.set_style(style);
            }
            while wait.recv_timeout(Duration::from_millis(100))
                == Err(std::sync::mpsc::RecvTimeoutError::Timeout)
            {
                bar.tick();
            }
            bar.finish_and_clear();
        });
        let result = work();
        // The receiver may have gone by itself; either way the thread ends.
        let _ = done.send(());
        drop(done);
        let _ = spinner.join();
        result
    }
}

/// Whether an error is a reader that closed our standard output: no failure of ours.
pub(crate) fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<io::Error>())
        .any(|cause| cause.kind() == io::ErrorKind::BrokenPipe)
}
