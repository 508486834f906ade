//! What goes to standard output and standard error. Nothing else in the command line prints.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use anyhow::{Context, Result};
use gpbrdf_core::base::number::significant;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::job::{Found, Observer, Progress, Report, Stage};

/// Standard output and standard error, as the user wants them, with a spinner for what takes long.
#[derive(Clone, Debug)]
pub(crate) struct Terminal {
    quiet: bool,
    verbose: u8,
    /// Drawn on standard error if that is a terminal. It stays while one stage follows another and steps
    /// aside for each line that is printed, so that short stages make no flicker.
    spinner: ProgressBar,
}

/// How often the spinner turns.
const TICK: Duration = Duration::from_millis(100);

impl Terminal {
    pub(crate) fn new(quiet: bool, verbose: u8) -> Self {
        let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let spinner = ProgressBar::with_draw_target(None, target);
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} {elapsed}") {
            spinner.set_style(style);
        }
        Self { quiet, verbose, spinner }
    }

    /// Writes to standard output what the user asked for.
    pub(crate) fn print(&self, text: &str) -> Result<()> {
        self.print_bytes(text.as_bytes())
    }

    /// Writes bytes to standard output.
    pub(crate) fn print_bytes(&self, bytes: &[u8]) -> Result<()> {
        self.aside(|| {
            let mut out = io::stdout().lock();
            out.write_all(bytes).and_then(|()| out.flush()).context("cannot write to standard output")
        })
    }

    /// Whether standard output is a terminal, which shows no binary data.
    pub(crate) fn is_terminal(&self) -> bool {
        io::stdout().is_terminal()
    }

    /// Writes a line of a summary to standard output, unless quiet.
    pub(crate) fn summary(&self, text: &str) -> Result<()> {
        if self.quiet { Ok(()) } else { self.print(&format!("{text}\n")) }
    }

    /// Writes a report to standard output: JSON, or a summary for people.
    pub(crate) fn report(&self, report: &Report, json: bool) -> Result<()> {
        if !report.converged {
            self.warn("the search for hyper-parameters did not converge");
        }
        if json {
            self.print(&format!("{}\n", serde_json::to_string_pretty(report)?))
        } else {
            self.summary(&report.summary())
        }
    }

    /// Writes an error to standard error.
    pub(crate) fn error(&self, text: &str) {
        self.line(&format!("error: {text}"));
    }

    /// Shows `what` beside a spinner while `work` goes on.
    pub(crate) fn stage<T>(&self, what: &'static str, work: impl FnOnce() -> T) -> T {
        self.turn(what);
        work()
    }

    /// Turns the spinner beside a new message.
    fn turn(&self, message: &'static str) {
        if self.spinner.is_hidden() {
            return;
        }
        self.spinner.set_message(message);
        self.spinner.reset_elapsed();
        self.spinner.enable_steady_tick(TICK);
    }

    fn line(&self, text: &str) {
        self.aside(|| eprintln!("{text}"));
    }

    /// Prints without the spinner, if it was ever shown.
    fn aside<T>(&self, print: impl FnOnce() -> T) -> T {
        if self.spinner.message().is_empty() { print() } else { self.spinner.suspend(print) }
    }
}

impl Observer for Terminal {
    fn begin(&self, stage: Stage) {
        self.turn(stage.label());
    }

    fn progress(&self, progress: Progress) {
        if self.spinner.is_hidden() {
            return;
        }
        self.spinner.set_message(match progress {
            Progress::Evaluations(count) => format!("{} ({count} evaluations)", Stage::Fit.label()),
            Progress::Share(share) => format!("{} ({:.0} %)", Stage::BakeOnDevice.label(), 100.0 * share),
        });
    }

    fn found(&self, found: Found<'_>) {
        if self.verbose < 2 {
            return;
        }
        match found {
            Found::Samples(measured) => self.detail(&format!("{} samples", measured.samples.angles.len())),
            Found::Cells(cells) => {
                self.detail(&format!("mean absolute error {} /sr", significant(cells.mae, 4)));
            }
            Found::Mean { fitted, .. } => {
                if let Some(value) = fitted.log_marginal_likelihood {
                    self.detail(&format!("log marginal likelihood {value:.1}"));
                }
            }
            Found::Sigma(_) | Found::Truth(_) => {}
        }
    }

    fn detail(&self, text: &str) {
        if self.verbose > 0 && !self.quiet {
            self.line(text);
        }
    }

    fn note(&self, text: &str) {
        if !self.quiet {
            self.line(&format!("note: {text}"));
        }
    }

    fn warn(&self, text: &str) {
        if !self.quiet {
            self.line(&format!("warning: {text}"));
        }
    }
}

/// Whether an error says that the reader of our standard output has closed it, which is no failure of ours.
pub(crate) fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<io::Error>())
        .any(|cause| cause.kind() == io::ErrorKind::BrokenPipe)
}
