//! What goes to standard output and standard error. Nothing else in the command line prints.

use std::io::{self, IsTerminal, Write};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result};
use gpbrdf_core::Progress;
use gpbrdf_core::base::number::significant;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::json::to_json;
use crate::job::{Found, Observer, Report, Stage, remaining};

/// Standard output and standard error, as the user wants them, with a spinner for what takes long and a bar where it
/// is known how much of it is done.
#[derive(Clone, Debug)]
pub(crate) struct Terminal {
    quiet: bool,
    verbose: u8,
    /// Drawn on standard error if that is a terminal. It stays while one stage follows another and steps
    /// aside for each line that is printed, so that short stages make no flicker.
    spinner: ProgressBar,
    shown: Arc<Mutex<Shown>>,
}

/// What stands beside the spinner.
#[derive(Debug, Default)]
struct Shown {
    stage: &'static str,
    evaluations: usize,
    /// Length of the bar, 0 to [`BAR`]; `None` where there is no bar.
    done: Option<u64>,
}

/// How often the spinner turns.
const TICK: Duration = Duration::from_millis(100);

/// The largest position of a bar.
const BAR: u64 = 200;

const SPINNER_STYLE: &str = "{spinner} {msg} {elapsed}";
const BAR_STYLE: &str = "{spinner} {msg} [{bar:30}] {percent} % {elapsed}{prefix}";

impl Terminal {
    pub(crate) fn new(quiet: bool, verbose: u8) -> Self {
        let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let spinner = ProgressBar::with_draw_target(Some(BAR), target);
        let terminal = Self { quiet, verbose, spinner, shown: Arc::default() };
        terminal.set_style(SPINNER_STYLE);
        terminal
    }

    fn set_style(&self, template: &str) {
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.spinner.set_style(style.progress_chars("=> "));
        }
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
        if json { self.print(&to_json(report)?) } else { self.summary(&report.summary()) }
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
        let before = std::mem::replace(
            &mut *self.shown.lock().unwrap_or_else(PoisonError::into_inner),
            Shown { stage: message, ..Shown::default() },
        );
        if before.done.is_some() {
            self.set_style(SPINNER_STYLE);
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
        // Another thread that is at it shows nearly the same.
        let Ok(mut shown) = self.shown.try_lock() else { return };
        if progress.evaluations != shown.evaluations {
            shown.evaluations = progress.evaluations;
            self.spinner.set_message(format!("{} ({} evaluations)", shown.stage, progress.evaluations));
        }
        let Some(share) = progress.share else { return };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share lies within 0 and 1"
        )]
        let done = (share * BAR as f64) as u64;
        if shown.done != Some(done) {
            if shown.done.is_none() {
                self.set_style(BAR_STYLE);
            }
            shown.done = Some(done);
            self.spinner.set_position(done);
            let left = remaining(self.spinner.elapsed(), share);
            self.spinner.set_prefix(left.map(|left| format!(", {left}")).unwrap_or_default());
        }
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
