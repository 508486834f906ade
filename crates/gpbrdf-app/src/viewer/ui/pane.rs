//! What a pane is: a part of the window that keeps its own state, its own worker and its own results.
//!
//! The program calls a pane in each frame in this order: [`Pane::receive`], [`Pane::ui`] where it is shown,
//! and [`Pane::request`]. Everything else has a default that suits a pane without it.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::Receiver;

use eframe::egui::{Context, KeyboardShortcut, Ui};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::viewer::state::document::DocumentId;
use crate::viewer::state::documents::Documents;
use crate::viewer::state::messages::Messages;
use crate::viewer::work::dialogs::Question;
use crate::viewer::work::export::Saved;
use crate::viewer::work::outbox::{Outbox, Waker};

/// A part of the window. To add one, write its file and name it in the list of panes.
pub(crate) trait Pane {
    /// Its name in settings and sessions, which never changes.
    fn name(&self) -> &'static str;

    /// Its name for people.
    fn title(&self) -> &'static str;

    /// Where it is shown.
    fn place(&self) -> Place;

    /// Offers what it does by a key or by the menu, and does what is wanted of that.
    fn commands(&mut self, _offers: &mut Offers, _cx: &mut PaneContext) {}

    /// What it remembers from run to run and in sessions.
    fn settings(&self) -> serde_json::Value {
        serde_json::Value::Null
    }

    /// Takes over what it remembered; null if there is nothing.
    ///
    /// # Errors
    /// The value is not one that [`Pane::settings`] gives.
    fn restore(&mut self, _settings: &serde_json::Value) -> serde_json::Result<()> {
        Ok(())
    }

    /// Shows what a file holds that is no material; whether this is a pane that does.
    fn show(&mut self, _file: &Shown) -> bool {
        false
    }

    /// Takes in what its worker has sent.
    fn receive(&mut self, _ctx: &Context, _cx: &mut PaneContext) {}

    /// Draws it.
    fn ui(&mut self, ui: &mut Ui, cx: &mut PaneContext);

    /// Sends its worker a request for what has changed.
    fn request(&mut self, _cx: &mut PaneContext) {}

    /// How far its worker is.
    fn progress(&self) -> Progress {
        Progress::Done
    }

    /// The number of the result that it shows, if it is a pane that shows each result at once.
    fn shown_version(&self) -> Option<u64> {
        None
    }

    /// Computes on this device in place of one that it opens.
    ///
    /// # Errors
    /// The system gives no thread.
    fn use_device(&mut self, _device: &gpbrdf_render::Context) -> std::io::Result<()> {
        Ok(())
    }

    /// Ends threads that must not outlive the window.
    fn close(&mut self) {}
}

/// A file that holds no material.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Shown {
    /// An environment map, to light with.
    Environment(PathBuf),
    /// A mesh, to be lit.
    Mesh(PathBuf),
}

/// Where a pane is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// At the side of the window, below the panes that are earlier in the list.
    Side,
    /// In the middle of the window: alone by its key or its entry in the menu, and in the overview where it
    /// has a share of that.
    View(Option<Share>),
}

/// The share of a view in the overview.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Share {
    pub(crate) slot: Slot,
    /// The name of its tab where there is no room for the whole overview.
    pub(crate) tab: &'static str,
}

/// A part of the overview. Several panes in one slot divide its width.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Slot {
    Left,
    Right,
    Below,
}

/// How far a pane's worker is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Progress {
    /// What is shown is older than the last request.
    Waiting,
    /// The last request is shown and will be shown better.
    Refining,
    Done,
}

/// Something that is done by a key or by an entry of the menu "File".
#[derive(Clone, Debug)]
pub(crate) struct Command {
    pub(crate) key: Option<KeyboardShortcut>,
    /// The words of the menu, if the command is in it.
    pub(crate) menu: Option<&'static str>,
    /// The words of the list of shortcuts.
    pub(crate) help: String,
}

impl Command {
    pub(crate) fn key(key: KeyboardShortcut, help: impl Into<String>) -> Self {
        Self { key: Some(key), menu: None, help: help.into() }
    }

    pub(crate) fn menu(words: &'static str) -> Self {
        Self { key: None, menu: Some(words), help: String::new() }
    }
}

/// Collects the commands of a pane, and tells which of them is to be run.
#[derive(Debug, Default)]
pub(crate) struct Offers {
    list: Vec<Command>,
    run: Option<usize>,
}

impl Offers {
    /// Offers that run the command at `index` of the list.
    pub(crate) fn running(index: usize) -> Self {
        Self { list: Vec::new(), run: Some(index) }
    }

    /// Offers a command; whether it is to be run now.
    pub(crate) fn offer(&mut self, command: Command) -> bool {
        self.list.push(command);
        self.run == Some(self.list.len() - 1)
    }

    pub(crate) fn into_list(self) -> Vec<Command> {
        self.list
    }
}

/// What a pane wants from the program.
#[derive(Debug)]
pub(crate) enum Order {
    /// Show the window that opens materials.
    OpenWindow,
    /// Close a material.
    Remove(DocumentId),
    /// Cancel the requests of a material.
    Cancel(DocumentId),
    /// Ask the user for a file.
    Ask(Question),
}

/// What panes share.
pub(crate) struct PaneContext {
    pub(crate) documents: Documents,
    pub(crate) messages: Messages,
    /// What the panes want from the program, which does it at the end of the frame.
    pub(crate) orders: Vec<Order>,
    /// Where reports about written files go.
    pub(crate) saved: Outbox<Saved>,
    /// The window.
    pub(crate) egui: Context,
    /// Whether views go back to what they show at first, in this frame and in the next one.
    pub(crate) reset_views: bool,
    pub(crate) reset_next: bool,
}

impl PaneContext {
    pub(crate) fn new(egui: Context, saved: Outbox<Saved>) -> Self {
        Self {
            documents: Documents::default(),
            messages: Messages::default(),
            orders: Vec::new(),
            saved,
            egui,
            reset_views: false,
            reset_next: false,
        }
    }

    /// Orders something from the program.
    pub(crate) fn order(&mut self, order: Order) {
        self.orders.push(order);
    }
}

/// What a pane needs to start its worker.
#[derive(Clone)]
pub(crate) struct Start {
    pub(crate) wake: Waker,
    /// A test of whether the fitter works; slower work waits meanwhile.
    pub(crate) busy: Arc<dyn Fn() -> bool + Send + Sync>,
    /// Whether the first picture of an object is awaited, for which slower work makes room.
    pub(crate) awaited: Arc<AtomicBool>,
}

impl Start {
    /// A channel for the results of a worker.
    pub(crate) fn channel<T: Send + 'static>(&self) -> (Outbox<T>, Receiver<T>) {
        Outbox::channel(&self.wake)
    }

    /// The test of whether the fitter works.
    pub(crate) fn busy(&self) -> impl Fn() -> bool + Send + Sync + 'static {
        let busy = Arc::clone(&self.busy);
        move || busy()
    }
}

/// The look of a pane as a JSON value; null, which [`restored`] takes as the default, if it cannot be one.
pub(crate) fn saved<T: Serialize>(look: &T) -> serde_json::Value {
    serde_json::to_value(look).unwrap_or_default()
}

/// The look of a pane from a JSON value; the default from null.
///
/// # Errors
/// The value is of another form.
pub(crate) fn restored<T: DeserializeOwned + Default>(value: &serde_json::Value) -> serde_json::Result<T> {
    if value.is_null() { Ok(T::default()) } else { T::deserialize(value) }
}
