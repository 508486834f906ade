//! The program: what is open, what is selected, and what the threads have sent.

mod actions;
mod inbox;
mod opening;
mod requests;

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use anyhow::Result;
use eframe::egui::{self, Context, TextureHandle, Ui};
use gpbrdf_core::Environment;

use crate::viewer::state::document::{Document, DocumentId, Work};
use crate::viewer::state::messages::Messages;
use crate::viewer::state::settings::Settings;
use crate::viewer::ui::panes::plots::PlotCache;
use crate::viewer::ui::shortcuts;
use crate::viewer::work::curves::{Albedo, AlbedoRequest};
use crate::viewer::work::dialogs::Purpose;
use crate::viewer::work::fitter::{Event, Fitter, Outbox};
use crate::viewer::work::mailbox::Sender;
use crate::viewer::work::quality::Quality;
use crate::viewer::work::scene::{SceneKey, SceneRequest};
use crate::viewer::work::slices::{SliceKey, SliceRequest};
use crate::viewer::work::spheres::{SphereKey, SphereRequest};
use crate::viewer::work::{curves, scene, slices, spheres};

/// Slices as textures.
pub(crate) struct ShownSlices {
    pub(crate) key: SliceKey,
    pub(crate) textures: [Option<TextureHandle>; 4],
    pub(crate) limits: [Option<f64>; 4],
}

/// Spheres as textures.
pub(crate) struct ShownSpheres {
    pub(crate) images: Box<spheres::SphereImages>,
    pub(crate) truth: Option<TextureHandle>,
    pub(crate) mean: TextureHandle,
    pub(crate) difference: Option<TextureHandle>,
    pub(crate) sigma: Option<TextureHandle>,
}

/// An object as textures.
pub(crate) struct ShownScene {
    pub(crate) document: DocumentId,
    pub(crate) picture: u64,
    pub(crate) texture: TextureHandle,
    /// The prediction, where `texture` is the truth alone.
    pub(crate) beside: Option<TextureHandle>,
    pub(crate) samples: u32,
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

/// Which small window is open.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Windows {
    pub(crate) open: bool,
    pub(crate) help: bool,
    /// The window that asks for a path to write to.
    pub(crate) save: Option<Purpose>,
    pub(crate) path: String,
}

/// The program without its window: everything but the event loop.
pub struct Viewer {
    pub(crate) settings: Settings,
    pub(crate) documents: Vec<Document>,
    pub(crate) selected: Option<DocumentId>,
    pub(crate) messages: Messages,
    pub(crate) windows: Windows,
    pub(crate) outbox: Outbox,
    pub(crate) events: Receiver<Event>,
    pub(crate) fitter: Fitter,
    pub(crate) slicer: Sender<SliceRequest>,
    pub(crate) integrator: Sender<Vec<AlbedoRequest>>,
    pub(crate) renderer: Sender<SphereRequest>,
    pub(crate) scenery: Option<Sender<SceneRequest>>,
    pub(crate) staged: Option<SceneKey>,
    pub(crate) scene: Option<ShownScene>,
    pub(crate) quality: Option<Quality>,
    /// Why the window's device is gone, once it is.
    pub(crate) lost: Arc<OnceLock<String>>,
    /// Where screenshots go; the current folder unless it is set.
    pub(crate) pictures: Option<PathBuf>,
    /// Pixels of the view of objects.
    pub(crate) scene_size: [u32; 2],
    pub(crate) sliced: Option<SliceKey>,
    pub(crate) rendered: Option<SphereKey>,
    pub(crate) integrated: Vec<(DocumentId, u64, bool)>,
    pub(crate) slices: Option<ShownSlices>,
    pub(crate) spheres: Option<ShownSpheres>,
    pub(crate) albedos: Vec<Albedo>,
    pub(crate) plots: PlotCache,
    pub(crate) environment: (u64, String, Arc<Environment>),
    /// Views go back to what they show at first: in this frame, in the next one.
    pub(crate) reset_views: bool,
    pub(crate) reset_next: bool,
    /// What a session says about the scale, until it is taken over.
    pub(crate) new_zoom: Option<f32>,
    pub(crate) solo: Option<DocumentId>,
    pub(crate) next_id: u64,
    applied_theme: Option<Option<bool>>,
    frames: FrameTimes,
}

impl std::fmt::Debug for Viewer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Viewer").field("documents", &self.documents.len()).finish_non_exhaustive()
    }
}

/// The material of the first second.
const FIRST: &str = "cherry-235";

impl Viewer {
    /// Starts the threads and opens files, or a built-in material where there are none.
    ///
    /// # Errors
    /// The system gives no threads.
    pub fn new(ctx: &Context, settings: Settings, files: &[PathBuf]) -> Result<Self> {
        let mut viewer = Self::empty(ctx, settings)?;
        if let Some(path) = viewer.settings.environment.clone() {
            viewer.open_environment(&path);
        }
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
        let mut viewer = Self::empty(ctx, std::mem::take(&mut old.settings))?;
        viewer.documents = std::mem::take(&mut old.documents);
        for document in viewer.documents.iter_mut().filter(|d| d.is_busy()) {
            // What the old threads have not finished is asked anew.
            (document.asked, document.work) = (None, Work::Waiting);
        }
        viewer.messages = std::mem::take(&mut old.messages);
        if let Some(message) = old.lost.get() {
            viewer.messages.error(format!("{message}; this is a new window"));
        }
        viewer.environment = (old.environment.0, old.environment.1.clone(), Arc::clone(&old.environment.2));
        viewer.pictures = old.pictures.take();
        (viewer.selected, viewer.solo, viewer.next_id) = (old.selected, old.solo, old.next_id);
        Ok(viewer)
    }

    fn empty(ctx: &Context, settings: Settings) -> Result<Self> {
        let (sender, events) = channel();
        let waker = ctx.clone();
        let outbox = Outbox { events: sender, wake: Arc::new(move || waker.request_repaint()) };
        let fitter = Fitter::new(outbox.clone())?;
        let busy = fitter.busy();
        ctx.set_zoom_factor(settings.zoom.clamp(0.5, 3.0));
        Ok(Self {
            settings,
            documents: Vec::new(),
            selected: None,
            messages: Messages::default(),
            windows: Windows::default(),
            slicer: slices::spawn(outbox.clone())?,
            integrator: curves::spawn(outbox.clone())?,
            renderer: spheres::spawn(outbox.clone(), busy)?,
            scenery: Some(scene::spawn(outbox.clone(), None, fitter.busy())?),
            fitter,
            outbox,
            events,
            staged: None,
            scene: None,
            quality: None,
            lost: Arc::default(),
            pictures: None,
            scene_size: [0; 2],
            sliced: None,
            rendered: None,
            integrated: Vec::new(),
            slices: None,
            spheres: None,
            albedos: Vec::new(),
            plots: PlotCache::default(),
            environment: (0, "Studio (built in)".to_owned(), Arc::new(Environment::studio())),
            reset_views: false,
            reset_next: false,
            new_zoom: None,
            solo: None,
            next_id: 0,
            applied_theme: None,
            frames: FrameTimes::default(),
        })
    }

    /// Listens for the loss of the window's device.
    pub fn watch_device(&self, state: &eframe::egui_wgpu::RenderState) {
        let (wake, adapter) = (Arc::clone(&self.outbox.wake), state.adapter.get_info().name);
        let lost = Arc::clone(&self.lost);
        state.device.set_device_lost_callback(move |reason, message| {
            let reason = format!("{reason:?} {message}");
            let message =
                format!("the window's graphics device \"{adapter}\" was lost: {}", reason.trim_end());
            let _first_reason_stays = lost.set(message);
            wake();
        });
    }

    /// Lights objects on this device in place of one of its own.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn use_device(&mut self, context: gpbrdf_render::Context) -> Result<()> {
        self.scenery = Some(scene::spawn(self.outbox.clone(), Some(context), self.fitter.busy())?);
        self.staged = None;
        Ok(())
    }

    /// Takes leave of the graphics driver, which must not be unloaded under a thread.
    pub fn close(&mut self) {
        if let Some(scenery) = self.scenery.take() {
            scenery.join();
        }
    }

    /// Whether the window's device is gone, so that the window shows nothing any more: time for [`Self::reopened`].
    #[must_use]
    pub fn has_lost_device(&self) -> bool {
        self.lost.get().is_some()
    }

    /// Sets where screenshots go: the current folder unless this is called.
    pub fn set_picture_folder(&mut self, folder: PathBuf) {
        self.pictures = Some(folder);
    }

    /// What is remembered from run to run.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
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
        let drawn = self.spheres.as_ref().map(|s| (s.images.key, s.images.fine));
        let drawn = drawn == self.rendered.map(|key| (key, true));
        self.is_fitted() && drawn
    }

    /// Whether nothing is being read or fitted, and the slices show it; spheres may still be refined.
    #[must_use]
    pub fn is_fitted(&self) -> bool {
        let fitted = |d: &Document| match &d.work {
            Work::Failed(_) | Work::Cancelled => true,
            Work::Idle => d.fitted.is_some() && d.asked.as_ref() == Some(&d.spec),
            _ => false,
        };
        self.documents.iter().all(fitted) && self.slices.as_ref().map(|s| s.key) == self.sliced
    }

    /// A number that changes with every result that is shown.
    #[must_use]
    pub fn shown_version(&self) -> u64 {
        self.slices.as_ref().map_or(0, |s| s.key.version)
    }

    /// The selected material.
    pub(crate) fn document(&self) -> Option<&Document> {
        self.documents.iter().find(|d| Some(d.id) == self.selected)
    }

    /// The materials that are drawn in the plots.
    pub(crate) fn visible(&self) -> impl Iterator<Item = &Document> {
        self.documents.iter().filter(|d| self.solo.map_or(d.visible, |solo| solo == d.id))
    }

    /// One frame.
    pub fn ui(&mut self, ui: &mut Ui) {
        let start = Instant::now();
        let ctx = ui.ctx().clone();
        self.apply_theme(&ctx);
        self.receive(&ctx);
        // A frame may be laid out twice; files are dropped once.
        if ctx.current_pass_index() == 0 {
            let dropped = ctx.input(|i| crate::viewer::dropped_paths(&i.raw));
            self.open_paths(&dropped);
        }
        for action in shortcuts::pressed(&ctx) {
            self.act(&ctx, action);
        }
        self.window_ui(ui);
        self.request();
        self.reset_views = std::mem::take(&mut self.reset_next);
        match self.new_zoom.take() {
            Some(zoom) => ctx.set_zoom_factor(zoom.clamp(0.5, 3.0)),
            None => self.settings.zoom = ctx.zoom_factor(),
        }
        if self.documents.iter().any(Document::is_busy) {
            // The seconds count on.
            ctx.request_repaint_after(Duration::from_millis(100));
        }
        self.frames.last = start.elapsed();
        self.frames.longest = self.frames.longest.max(self.frames.last);
        self.frames.frames += 1;
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
        ctx.all_styles_mut(|style| {
            style.spacing.item_spacing = egui::vec2(8.0, 5.0);
            style.spacing.button_padding = egui::vec2(7.0, 3.0);
            if let Some(small) = style.text_styles.get_mut(&egui::TextStyle::Small) {
                small.size = 11.0;
            }
        });
    }
}
