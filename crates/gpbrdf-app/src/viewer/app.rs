//! The program: it joins panes, threads and what is open. Only this file knows all messages of the program.

mod opening;

use std::path::PathBuf;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use anyhow::Result;
use eframe::egui::{self, CentralPanel, Context, Frame, Panel, Ui};
use gpbrdf_core::Source;

use super::state::document::{Document, DocumentId, Work};
use super::state::session::{SavedDocument, Session};
use super::state::settings::Settings;
use super::ui::hint::hint_ui;
use super::ui::layout::{self, Panes};
use super::ui::menu::Menu;
use super::ui::messages::messages_ui;
use super::ui::pane::{Command, Offers, Order, Pane, PaneContext, Progress, Shown, Start};
use super::ui::panes;
use super::ui::shortcuts::{self, Action};
use super::ui::status::status_ui;
use super::ui::theme;
use super::ui::windows::{Reply, Windows};
use super::work::dialogs::{self, Access, Question};
use super::work::export::{self, Saved};
use super::work::fitter::{self, Fitter, News, Report};
use super::work::outbox::{Outbox, Waker};
use super::work::watcher::Watcher;

/// A source that has been read, with what a session says about it.
#[derive(Debug)]
struct Opened {
    source: Box<Source>,
    restore: Option<Box<SavedDocument>>,
}

/// What a file was found to hold.
#[derive(Debug)]
enum Found {
    Material(Opened),
    /// A session, and a note about it.
    Session(Box<Session>, Option<String>),
    Shown(Shown),
}

/// What the program is told; panes are told the rest.
#[derive(Debug)]
enum Event {
    /// The fitter has news.
    Fit(Report),
    /// A file has been read, or not.
    Found(Result<Found, String>),
    /// A file has been written, or not.
    Saved(Saved),
    /// Paths have been chosen in the dialog of the system.
    Browsed((Question, Vec<PathBuf>)),
    /// Open this file.
    Open(PathBuf),
    /// Write the session to this file.
    SaveSession(PathBuf),
    /// An open file of measurements has changed.
    Changed(PathBuf),
    /// It has been read again, or not.
    Reread(PathBuf, Result<Arc<Source>, String>),
}

/// How long the window's own work takes.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameTimes {
    /// The last frame.
    pub last: Duration,
    /// The longest since [`Viewer::reset_frame_times`].
    pub longest: Duration,
    /// Frames since then.
    pub frames: usize,
}

/// The program without its window: everything but the event loop.
pub struct Viewer {
    settings: Settings,
    context: PaneContext,
    panes: Vec<Box<dyn Pane>>,
    windows: Windows,
    fitter: Fitter,
    /// The number of the last request.
    requests: u64,
    watcher: Watcher,
    outbox: Outbox<Event>,
    events: Receiver<Event>,
    /// Files that are being read.
    reading: usize,
    wake: Waker,
    /// Why the device of the window is gone, once it is.
    lost: Arc<OnceLock<String>>,
    /// The folder of screenshots; `None` for the current one.
    pictures: Option<PathBuf>,
    /// The scale that a session asks for, until it is taken over.
    new_zoom: Option<f32>,
    applied_theme: Option<Option<bool>>,
    frames: FrameTimes,
}

impl std::fmt::Debug for Viewer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let open = self.context.documents.iter().count();
        f.debug_struct("Viewer").field("documents", &open).finish_non_exhaustive()
    }
}

/// The material that is open at first.
const FIRST: &str = "cherry-235";

impl Viewer {
    /// Starts the threads and opens files, or a built-in material where there are none.
    ///
    /// # Errors
    /// The system gives no threads.
    pub fn new(ctx: &Context, settings: Settings, files: &[PathBuf]) -> Result<Self> {
        let mut viewer = Self::empty(ctx, settings)?;
        if files.is_empty() {
            viewer.open_built_in(FIRST, None);
        }
        viewer.open_paths(files);
        Ok(viewer)
    }

    /// Goes on in a new window with what was open in another, whose device was lost.
    ///
    /// # Errors
    /// The system gives no threads.
    pub fn reopened(ctx: &Context, mut old: Self) -> Result<Self> {
        old.receive(ctx);
        let mut viewer = Self::empty(ctx, old.settings())?;
        viewer.context.documents = std::mem::take(&mut old.context.documents);
        for document in viewer.context.documents.iter_mut().filter(|d| d.is_busy()) {
            // What the old threads have not finished is requested again.
            (document.requested, document.work) = (None, Work::Waiting);
        }
        viewer.context.messages = std::mem::take(&mut old.context.messages);
        if let Some(message) = old.lost.get() {
            viewer.context.messages.error(format!("{message}; this is a new window"));
        }
        viewer.pictures = old.pictures.take();
        Ok(viewer)
    }

    fn empty(ctx: &Context, settings: Settings) -> Result<Self> {
        let repaint = ctx.clone();
        let wake: Waker = Arc::new(move || repaint.request_repaint());
        let (outbox, events) = Outbox::channel(&wake);
        let fitter = Fitter::new(outbox.map(Event::Fit))?;
        let watcher = Watcher::new(outbox.map(Event::Changed))?;
        let start =
            Start { wake: Arc::clone(&wake), busy: Arc::new(fitter.busy()), awaited: fitter.awaited() };
        let open = Question {
            title: "Open materials",
            help: "A MERL .binary, RGL .bsdf, samples CSV, OpenEXR table, model, session, environment map or mesh:",
            access: Access::ReadMany {
                kind: "Materials",
                endings: &[
                    "binary",
                    "bsdf",
                    "csv",
                    "txt",
                    "dat",
                    "tsv",
                    "astm",
                    "exr",
                    "safetensors",
                    "brdf",
                    "json",
                    "hdr",
                    "obj",
                    "glb",
                    "gltf",
                ],
            },
            answer: outbox.map(Event::Open),
        };
        ctx.set_zoom_factor(settings.zoom.clamp(0.5, 3.0));
        let mut viewer = Self {
            settings,
            context: PaneContext::new(ctx.clone(), outbox.map(Event::Saved)),
            panes: panes::all(&start)?,
            windows: Windows::new(open),
            fitter,
            requests: 0,
            watcher,
            outbox,
            events,
            reading: 0,
            wake,
            lost: Arc::default(),
            pictures: None,
            new_zoom: None,
            applied_theme: None,
            frames: FrameTimes::default(),
        };
        viewer.restore_panes();
        Ok(viewer)
    }

    /// Listens for the loss of the window's device.
    pub fn watch_device(&self, state: &eframe::egui_wgpu::RenderState) {
        let (wake, adapter) = (Arc::clone(&self.wake), state.adapter.get_info().name);
        let lost = Arc::clone(&self.lost);
        state.device.set_device_lost_callback(move |reason, message| {
            let reason = format!("{reason:?} {message}");
            let message =
                format!("the window's graphics device \"{adapter}\" was lost: {}", reason.trim_end());
            let _first_reason_stays = lost.set(message);
            wake();
        });
    }

    /// Lets panes compute on this device in place of one that they open.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn use_device(&mut self, device: &gpbrdf_render::Context) -> Result<()> {
        for pane in &mut self.panes {
            pane.use_device(device)?;
        }
        Ok(())
    }

    /// Ends the threads that use the graphics driver, which must not be unloaded while they run.
    pub fn close(&mut self) {
        for pane in &mut self.panes {
            pane.close();
        }
    }

    /// Whether the window's device is gone, so that the window shows nothing any more: time for
    /// [`Self::reopened`].
    #[must_use]
    pub fn has_lost_device(&self) -> bool {
        self.lost.get().is_some()
    }

    /// Why the window's device is gone, once it is.
    pub(super) fn loss(&self) -> Option<String> {
        self.lost.get().cloned()
    }

    /// Sets the folder of screenshots, which is the current one unless this is called.
    pub fn set_picture_folder(&mut self, folder: PathBuf) {
        self.pictures = Some(folder);
    }

    /// What is remembered from run to run.
    #[must_use]
    pub fn settings(&self) -> Settings {
        let kept = self.panes.iter().map(|pane| (pane.name().to_owned(), pane.settings()));
        let panes = kept.filter(|(_, kept)| !kept.is_null()).collect();
        Settings { panes, ..self.settings.clone() }
    }

    /// How long the window's own work takes.
    #[must_use]
    pub fn frame_times(&self) -> FrameTimes {
        self.frames
    }

    /// Forgets the longest frame.
    pub fn reset_frame_times(&mut self) {
        self.frames = FrameTimes::default();
    }

    /// Whether nothing is being read, fitted or drawn.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.has_come_to(Progress::Done)
    }

    /// Whether nothing is being read or fitted, and the views show it; pictures may still be refined.
    #[must_use]
    pub fn is_fitted(&self) -> bool {
        self.has_come_to(Progress::Refining)
    }

    fn has_come_to(&self, progress: Progress) -> bool {
        let fitted = self.reading == 0 && self.context.documents.iter().all(Document::is_fitted);
        fitted && self.panes.iter().all(|pane| pane.progress() >= progress)
    }

    /// A number that changes with every result that is shown.
    #[must_use]
    pub fn shown_version(&self) -> u64 {
        self.panes.iter().filter_map(|pane| pane.shown_version()).min().unwrap_or(0)
    }

    /// One frame.
    pub fn ui(&mut self, ui: &mut Ui) {
        let start = Instant::now();
        let ctx = ui.ctx().clone();
        self.apply_theme(&ctx);
        self.receive(&ctx);
        // A frame may be laid out twice; files are dropped once.
        if ctx.current_pass_index() == 0 {
            let dropped = ctx.input(|i| super::dropped_paths(&i.raw));
            self.open_paths(&dropped);
        }
        let commands = self.commands();
        for action in shortcuts::pressed(&ctx, &commands) {
            self.act(&ctx, action);
        }
        self.window_ui(ui, &commands);
        self.do_orders();
        self.request();
        self.context.reset_views = std::mem::take(&mut self.context.reset_next);
        match self.new_zoom.take() {
            Some(zoom) => ctx.set_zoom_factor(zoom.clamp(0.5, 3.0)),
            None => self.settings.zoom = ctx.zoom_factor(),
        }
        if self.context.documents.iter().any(Document::is_busy) {
            // The seconds count on.
            ctx.request_repaint_after(Duration::from_millis(100));
        }
        self.frames.last = start.elapsed();
        self.frames.longest = self.frames.longest.max(self.frames.last);
        self.frames.frames += 1;
    }

    /// Takes in what the threads have sent.
    fn receive(&mut self, ctx: &Context) {
        while let Ok(event) = self.events.try_recv() {
            match event {
                Event::Fit(report) => self.take(report),
                Event::Found(found) => self.take_found(found),
                Event::Saved(Ok(note)) => self.context.messages.success(note),
                Event::Saved(Err(message)) => self.context.messages.error(message),
                Event::Browsed((question, paths)) => self.answer(&question, paths),
                Event::Open(path) => self.open_paths(&[path]),
                Event::SaveSession(path) => self.save_session(&path),
                Event::Changed(path) => self.reread(path),
                Event::Reread(path, result) => self.renew(&path, result),
            }
        }
        for pane in &mut self.panes {
            pane.receive(ctx, &mut self.context);
        }
    }

    /// Takes in what the fitter reports about a document, unless that has been closed or has requested something else.
    fn take(&mut self, report: Report) {
        let document = self.context.documents.get_mut(report.document);
        let Some(document) = document.filter(|d| d.request == report.request) else { return };
        if let News::Failed(message) = &report.news {
            self.context.messages.error(format!("{}: {message}", document.name));
        }
        report.news.apply(document);
    }

    /// Passes chosen paths on to whoever has asked for them.
    fn answer(&mut self, question: &Question, paths: Vec<PathBuf>) {
        self.windows.answered(question);
        for path in paths {
            question.answer.send(path);
        }
    }

    /// Everything that keys and the menu do.
    fn commands(&mut self) -> Vec<(Action, Command)> {
        let mut all = shortcuts::of_program(&layout::views(&self.panes));
        for (i, pane) in self.panes.iter_mut().enumerate() {
            let mut offers = Offers::default();
            pane.commands(&mut offers, &mut self.context);
            let offered = offers.into_list().into_iter().enumerate();
            all.extend(offered.map(|(j, command)| (Action::Pane(i, j), command)));
        }
        all
    }

    fn act(&mut self, ctx: &Context, action: Action) {
        match action {
            Action::OpenWindow => self.windows.ask_open(),
            Action::SaveSession => self.windows.ask(Question {
                title: "Save session",
                help: "The open materials and how they are shown, as JSON.",
                access: Access::Write { name: "session.json" },
                answer: self.outbox.map(Event::SaveSession),
            }),
            Action::Screenshot => export::screenshot(ctx, self.pictures.clone(), &self.context.saved),
            Action::Quit => ctx.send_viewport_cmd(egui::ViewportCommand::Close),
            Action::TogglePanels => self.settings.panels ^= true,
            Action::Help => self.windows.toggle_help(),
            Action::Hint => self.settings.hint = true,
            Action::Cancel => {
                let selected = self.context.documents.selected_id();
                if let Some(id) = selected.filter(|_| !self.windows.close_all()) {
                    self.cancel(id);
                }
            }
            Action::ResetViews => self.context.reset_next = true,
            Action::Open(path) => self.open_paths(&[path]),
            Action::OpenBuiltIn(name) => self.open_built_in(name, None),
            Action::Overview => self.settings.view = None,
            Action::View(name) => self.settings.view = Some(name.to_owned()),
            Action::Pane(pane, command) => {
                self.panes[pane].commands(&mut Offers::running(command), &mut self.context);
            }
        }
    }

    /// Does what the panes have ordered.
    fn do_orders(&mut self) {
        for order in std::mem::take(&mut self.context.orders) {
            match order {
                Order::OpenWindow => self.windows.ask_open(),
                Order::Remove(id) => self.remove(id),
                Order::Cancel(id) => self.cancel(id),
                Order::Ask(question) => self.windows.ask(question),
            }
        }
    }

    /// Cancels the requests of a material.
    fn cancel(&mut self, id: DocumentId) {
        if let Some(document) = self.context.documents.get_mut(id).filter(|d| d.is_busy()) {
            self.fitter.cancel(id);
            document.work = Work::Cancelled;
        }
    }

    /// Closes a material.
    fn remove(&mut self, id: DocumentId) {
        self.fitter.forget(id);
        self.context.documents.remove(id);
    }

    /// Requests models and pictures for what has changed.
    fn request(&mut self) {
        for document in self.context.documents.iter_mut() {
            if document.requested.as_ref() == Some(&document.spec) {
                continue;
            }
            document.requested = Some(document.spec.clone());
            self.requests += 1;
            document.request = self.requests;
            if !document.is_busy() {
                document.work = Work::Waiting;
            }
            self.fitter.submit(fitter::Request {
                document: document.id,
                number: self.requests,
                source: Arc::clone(&document.source),
                truth: document.truth.clone(),
                spec: document.spec.clone(),
            });
        }
        for pane in &mut self.panes {
            pane.request(&mut self.context);
        }
        let watched = self.context.documents.iter().filter(|d| self.settings.watch && d.is_scattered());
        self.watcher.watch(&watched.filter_map(|document| document.source.path.as_ref()).collect::<Vec<_>>());
    }

    /// The whole window.
    fn window_ui(&mut self, ui: &mut Ui, commands: &[(Action, Command)]) {
        let ctx = ui.ctx().clone();
        if self.settings.panels {
            let views = layout::views(&self.panes);
            let mut menu = Menu { settings: &mut self.settings, commands, views: &views };
            let chosen = Panel::top("menu").show(ui, |ui| menu.ui(ui)).inner;
            if let Some(action) = chosen {
                self.act(&ctx, action);
            }
        }
        if self.settings.panels {
            let last = self.frames.last;
            Panel::bottom("status").show(ui, |ui| status_ui(ui, &self.context.documents, last));
        }
        let mut panes = Panes { list: &mut self.panes, cx: &mut self.context, settings: &mut self.settings };
        if panes.settings.panels {
            panes.side_ui(ui);
        }
        let frame = Frame::central_panel(ui.style()).inner_margin(10);
        CentralPanel::default().frame(frame).show(ui, |ui| panes.views_ui(ui));
        if self.settings.hint {
            self.settings.hint = !hint_ui(&ctx);
        }
        messages_ui(&ctx, &mut self.context.messages);
        match self.windows.ui(&ctx, commands) {
            Some(Reply::Path(question, path)) => self.answer(&question, vec![path]),
            Some(Reply::BuiltIn(name)) => self.open_built_in(name, None),
            Some(Reply::Browse(question)) => dialogs::browse(question, &self.outbox.map(Event::Browsed)),
            None => {}
        }
    }

    fn apply_theme(&mut self, ctx: &Context) {
        if self.applied_theme == Some(self.settings.dark) {
            return;
        }
        self.applied_theme = Some(self.settings.dark);
        ctx.set_theme(match self.settings.dark {
            None => egui::ThemePreference::System,
            Some(true) => egui::ThemePreference::Dark,
            Some(false) => egui::ThemePreference::Light,
        });
        theme::apply(ctx);
    }
}
