//! The program: what is open, what is selected, and what the threads have sent.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use anyhow::Result;
use eframe::egui::{self, Context, TextureHandle, Ui};
use gpbrdf_core::{Environment, Hyper, Source, materials};

use super::curves::{Albedo, AlbedoRequest};
use super::dialogs::{self, Purpose};
use super::document::{Document, DocumentId, Work};
use super::fitter::{Event, Fitter, Outbox, Request};
use super::mailbox::Sender;
use super::messages::Messages;
use super::plots_panel::PlotCache;
use super::scene::{SceneImage, SceneKey, SceneRequest, Shape};
use super::session::{SavedDocument, Session};
use super::settings::{Arrangement, Settings};
use super::shortcuts::{self, Action};
use super::slices::{SliceKey, SliceRequest, Surface};
use super::spheres::{SphereKey, SphereRequest};
use super::{curves, export, scene, slices, spheres};

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
    events: Receiver<Event>,
    pub(crate) fitter: Fitter,
    slicer: Sender<SliceRequest>,
    integrator: Sender<Vec<AlbedoRequest>>,
    renderer: Sender<SphereRequest>,
    sceneries: Option<Sender<SceneRequest>>,
    staged: Option<SceneKey>,
    pub(crate) scene: Option<SceneImage>,
    /// Pixels of the view of objects.
    pub(crate) scene_size: [u32; 2],
    sliced: Option<SliceKey>,
    rendered: Option<SphereKey>,
    integrated: Vec<(DocumentId, u64, bool)>,
    pub(crate) slices: Option<ShownSlices>,
    pub(crate) spheres: Option<ShownSpheres>,
    pub(crate) albedos: Vec<Albedo>,
    pub(crate) plots: PlotCache,
    pub(crate) environment: (u64, String, Arc<Environment>),
    pub(crate) reset_views: bool,
    /// What a session says about the scale, until it is taken over.
    new_zoom: Option<f32>,
    pub(crate) solo: Option<DocumentId>,
    next_id: u64,
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
        let (sender, events) = channel();
        let waker = ctx.clone();
        let outbox = Outbox { events: sender, wake: Arc::new(move || waker.request_repaint()) };
        let fitter = Fitter::new(outbox.clone())?;
        let busy = fitter.busy();
        ctx.set_zoom_factor(settings.zoom.clamp(0.5, 3.0));
        let mut viewer = Self {
            settings,
            documents: Vec::new(),
            selected: None,
            messages: Messages::default(),
            windows: Windows::default(),
            slicer: slices::spawn(outbox.clone())?,
            integrator: curves::spawn(outbox.clone())?,
            renderer: spheres::spawn(outbox.clone(), busy)?,
            fitter,
            outbox,
            events,
            sceneries: None,
            staged: None,
            scene: None,
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
            new_zoom: None,
            solo: None,
            next_id: 0,
            applied_theme: None,
            frames: FrameTimes::default(),
        };
        if files.is_empty() {
            viewer.open_built_in(FIRST, None);
        }
        viewer.open_paths(files);
        Ok(viewer)
    }

    /// Lights objects on the window's device.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn use_device(&mut self, state: &eframe::egui_wgpu::RenderState) -> Result<()> {
        self.sceneries = Some(scene::spawn(self.outbox.clone(), state.clone())?);
        Ok(())
    }

    /// Whether there is a device for objects.
    pub(crate) fn has_device(&self) -> bool {
        self.sceneries.is_some()
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

    /// Opens files and sessions; they are read off this thread.
    pub fn open_paths(&mut self, paths: &[PathBuf]) {
        for path in paths {
            if let Some(material) = materials().iter().find(|m| !path.exists() && path.as_os_str() == m.name)
            {
                self.open_built_in(material.name, None);
            } else if Session::is_named(path) {
                match Session::read(path) {
                    Ok(session) => {
                        self.restore(session);
                        self.settings.remember(path);
                    }
                    Err(error) => self.messages.error(format!("{error:#}")),
                }
            } else {
                self.settings.remember(path);
                self.read(path, None);
            }
        }
    }

    fn read(&mut self, path: &Path, restore: Option<Box<SavedDocument>>) {
        let (outbox, path) = (self.outbox.clone(), path.to_owned());
        let name = path.display().to_string();
        let work = move || {
            let named = |e: gpbrdf_core::Error| {
                let (text, name) = (e.to_string(), path.display().to_string());
                if text.contains(&name) { text } else { format!("\"{name}\": {text}") }
            };
            let result = Source::open(&path).map(Box::new).map_err(named);
            outbox.send(Event::Opened { result, restore });
        };
        if let Err(error) = std::thread::Builder::new().name("reader".into()).spawn(work) {
            self.messages.error(format!("cannot read \"{name}\": {error}"));
        }
    }

    /// Opens a built-in material.
    pub(crate) fn open_built_in(&mut self, name: &str, restore: Option<Box<SavedDocument>>) {
        match Source::built_in(name) {
            Ok(source) => self.add(source, restore),
            Err(error) => self.messages.error(error.to_string()),
        }
    }

    fn add(&mut self, source: Source, restore: Option<Box<SavedDocument>>) {
        let id = DocumentId(self.next_id);
        self.next_id += 1;
        let mut document = Document::new(id, source);
        if let Some(saved) = restore {
            document.name = saved.name;
            let [r, g, b] = saved.colour;
            document.colour = egui::Color32::from_rgb(r, g, b);
            document.visible = saved.visible;
            document.spec = saved.spec;
        }
        self.documents.push(document);
        self.selected = Some(id);
    }

    fn restore(&mut self, session: Session) {
        for id in self.documents.iter().map(|d| d.id).collect::<Vec<_>>() {
            self.remove(id);
        }
        let recent = std::mem::take(&mut self.settings.recent);
        self.settings = Settings { recent, ..session.settings };
        self.new_zoom = Some(self.settings.zoom);
        for saved in session.documents {
            match (&saved.path, &saved.built_in) {
                (Some(path), _) => {
                    let path = path.clone();
                    self.read(&path, Some(Box::new(saved)));
                }
                (None, Some(name)) => {
                    let name = name.clone();
                    self.open_built_in(&name, Some(Box::new(saved)));
                }
                (None, None) => self.messages.error(format!("session: \"{}\" has no source", saved.name)),
            }
        }
    }

    /// Closes a material.
    pub(crate) fn remove(&mut self, id: DocumentId) {
        self.fitter.forget(id);
        self.documents.retain(|d| d.id != id);
        self.albedos.retain(|a| a.document != id);
        self.plots.clear();
        self.solo = self.solo.filter(|solo| *solo != id);
        if self.selected == Some(id) {
            self.selected = self.documents.last().map(|d| d.id);
        }
        if self.documents.is_empty() {
            (self.slices, self.sliced, self.spheres, self.rendered) = (None, None, None, None);
        }
    }

    /// Takes in what the threads have sent.
    fn receive(&mut self, ctx: &Context) {
        while let Ok(event) = self.events.try_recv() {
            match event {
                Event::Opened { result: Ok(source), restore } => self.add(*source, restore),
                Event::Opened { result: Err(message), .. } | Event::Environment { result: Err(message) } => {
                    self.messages.error(message);
                }
                Event::Environment { result: Ok((name, map)) } => {
                    self.environment = (self.environment.0 + 1, name, map);
                    self.settings.light.point = false;
                }
                Event::Saved { result: Ok(what) } => self.messages.note(what),
                Event::Saved { result: Err(message) } => self.messages.error(message),
                Event::Chosen { purpose, paths } => self.chosen(purpose, &paths),
                Event::Slices(images) => self.take_slices(ctx, *images),
                Event::Spheres(images) => self.take_spheres(ctx, images),
                Event::Scene(image) => self.scene = Some(image),
                Event::SceneFailed(message) => {
                    // The processor's sphere is always there; choosing an object again opens the device anew.
                    self.settings.shape = Shape::Sphere;
                    (self.scene, self.staged) = (None, None);
                    self.messages.error(message);
                }
                Event::Albedo(albedos) => self.albedos = albedos,
                other => self.take_stage(other),
            }
        }
    }

    fn take_stage(&mut self, event: Event) {
        let (Event::Stage { document: id, .. }
        | Event::Fitted { document: id, .. }
        | Event::Sigma { document: id, .. }
        | Event::Truth { document: id, .. }
        | Event::Cells { document: id, .. }
        | Event::Images { document: id, .. }
        | Event::Done { document: id }
        | Event::Failed { document: id, .. }) = event
        else {
            return;
        };
        let Some(document) = self.documents.iter_mut().find(|d| d.id == id) else { return };
        let cancelled = document.work == Work::Cancelled;
        let current = |version: u64| move |f: &&mut super::document::Fitted| f.version == version;
        match event {
            Event::Stage { stage, evaluations, .. } if !cancelled => {
                let since = match document.work {
                    Work::Running { since, .. } if stage != "Sampling" => since,
                    _ => Instant::now(),
                };
                document.work = Work::Running { stage, since, evaluations };
            }
            Event::Fitted { fitted, .. } => {
                if document.spec.hyper.is_none() {
                    document.optimum = Hyper::of(&fitted.model);
                }
                document.fitted = Some(*fitted);
            }
            Event::Sigma { version, sigma, .. } => {
                if let Some(fitted) = document.fitted.as_mut().filter(current(version)) {
                    fitted.sigma = Some(sigma);
                }
            }
            Event::Truth { truth, .. } => document.truth = Some(truth),
            Event::Cells { version, cells, .. } => {
                if let Some(fitted) = document.fitted.as_mut().filter(current(version)) {
                    fitted.cells = Some(*cells);
                }
            }
            Event::Images { version, images, .. } => {
                if let Some(fitted) = document.fitted.as_mut().filter(current(version)) {
                    fitted.images = Some(*images);
                }
            }
            Event::Done { .. } if !cancelled => document.work = Work::Idle,
            Event::Failed { message, .. } => {
                self.messages.error(format!("{}: {message}", document.name));
                document.work = Work::Failed(message);
            }
            _ => {}
        }
    }

    fn take_slices(&mut self, ctx: &Context, images: slices::SliceImages) {
        let limits = images.panels.each_ref().map(|p| p.as_ref().and_then(|p| p.limit));
        let mut old = self.slices.take().map(|s| s.textures).unwrap_or_default();
        let mut textures = [None, None, None, None];
        for (i, panel) in images.panels.into_iter().enumerate() {
            let Some(panel) = panel else { continue };
            textures[i] = Some(upload(ctx, &mut old[i], format!("slice {i}"), panel.image));
        }
        self.slices = Some(ShownSlices { key: images.key, textures, limits });
    }

    fn take_spheres(&mut self, ctx: &Context, images: Box<spheres::SphereImages>) {
        let load = |name: &str, image: &egui::ColorImage| {
            upload(ctx, &mut None, format!("sphere {name}"), image.clone())
        };
        let truth = images.truth.as_ref().map(|i| load("truth", i));
        let difference = images.difference.as_ref().map(|(i, _)| load("difference", i));
        let sigma = images.sigma.as_ref().map(|(i, _)| load("sigma", i));
        let mean = load("prediction", &images.mean);
        self.spheres = Some(ShownSpheres { images, truth, mean, difference, sigma });
    }

    /// Asks the threads for what has changed.
    fn request(&mut self) {
        for document in &mut self.documents {
            if document.asked.as_ref() == Some(&document.spec) {
                continue;
            }
            document.asked = Some(document.spec.clone());
            if !document.is_busy() {
                document.work = Work::Waiting;
            }
            self.fitter.submit(Request {
                document: document.id,
                source: Arc::clone(&document.source),
                truth: document.truth.clone(),
                spec: document.spec.clone(),
            });
        }
        self.request_slices();
        self.request_spheres();
        self.request_albedos();
        self.request_scene();
    }

    fn request_scene(&mut self) {
        let Some(sender) = self.sceneries.as_ref().filter(|_| self.settings.shape != Shape::Sphere) else {
            return;
        };
        let views = [Arrangement::All, Arrangement::Sphere];
        if !views.contains(&self.settings.arrangement) || self.scene_size.contains(&0) {
            return;
        }
        let Some(document) = self.document() else { return };
        let Some(fitted) = &document.fitted else { return };
        let exposure = self.spheres.as_ref().map_or(1.0, |s| s.images.exposure);
        let key = SceneKey {
            document: document.id,
            version: fitted.version,
            has_truth: document.truth.is_some(),
            has_sigma: fitted.sigma.is_some(),
            shape: self.settings.shape.clone(),
            orbit: self.settings.orbit,
            light: self.settings.light,
            environment: self.environment.0,
            exposure: super::widgets::narrow(exposure),
            size: self.scene_size,
            shown: self.settings.sphere,
            swipe: self.settings.swipe,
        };
        if self.staged.as_ref() == Some(&key) {
            return;
        }
        sender.put(SceneRequest {
            key: key.clone(),
            truth: document.truth.clone(),
            mean: Arc::clone(&fitted.mean),
            sigma: fitted.sigma.clone(),
            environment: Arc::clone(&self.environment.2),
        });
        self.staged = Some(key);
    }

    fn request_slices(&mut self) {
        let Some(document) = self.document() else { return };
        let Some(fitted) = &document.fitted else { return };
        let key = SliceKey {
            document: document.id,
            version: fitted.version,
            look: self.settings.slices,
            truth_is_table: document.truth.is_some(),
            has_sigma: fitted.sigma.is_some(),
        };
        if self.sliced == Some(key) {
            return;
        }
        let truth = match (&document.truth, document.has_truth()) {
            (Some(table), _) => Some(Surface::Table(Arc::clone(table))),
            (None, true) => Some(Surface::Source(Arc::clone(&document.source))),
            (None, false) => None,
        };
        let (mean, sigma) = (Arc::clone(&fitted.mean), fitted.sigma.clone());
        self.slicer.put(SliceRequest { key, truth, mean, sigma });
        self.sliced = Some(key);
    }

    fn request_spheres(&mut self) {
        let Some(document) = self.document() else { return };
        let Some(fitted) = &document.fitted else { return };
        let key = SphereKey {
            document: document.id,
            version: fitted.version,
            light: self.settings.light,
            environment: self.environment.0,
            has_truth: document.truth.is_some(),
            has_sigma: fitted.sigma.is_some(),
        };
        if self.rendered == Some(key) {
            return;
        }
        self.renderer.put(SphereRequest {
            key,
            truth: document.truth.clone(),
            mean: Arc::clone(&fitted.mean),
            sigma: fitted.sigma.clone(),
            environment: Arc::clone(&self.environment.2),
            wants_metrics: document.has_truth() && fitted.images.is_none(),
        });
        self.rendered = Some(key);
    }

    fn request_albedos(&mut self) {
        if self.settings.curves.kind != curves::CurveKind::Albedo {
            return;
        }
        let requests: Vec<_> = self.visible().filter_map(AlbedoRequest::of).collect();
        let keys: Vec<_> = requests.iter().map(|r| (r.document, r.version, r.truth.is_some())).collect();
        if keys != self.integrated {
            self.integrated = keys;
            self.integrator.put(requests);
        }
    }

    /// Does what a key or a menu asks for.
    pub(crate) fn act(&mut self, ctx: &Context, action: Action) {
        match action {
            Action::Open => {
                self.windows.open = true;
                self.windows.path.clear();
            }
            Action::SaveSession => self.ask_where(Purpose::SaveSession, "session.json"),
            Action::Screenshot => export::screenshot(ctx, &self.outbox),
            Action::TogglePanels => self.settings.panels ^= true,
            Action::Help => self.windows.help ^= true,
            Action::ToggleLog => self.settings.curves.log ^= true,
            Action::ToggleCosine => self.settings.curves.times_cosine ^= true,
            Action::Optimise => {
                if let Some(document) = self.documents.iter_mut().find(|d| Some(d.id) == self.selected) {
                    document.spec.hyper = None;
                    document.asked = None;
                }
            }
            Action::Cancel => {
                if let Some(document) = self.documents.iter_mut().find(|d| Some(d.id) == self.selected)
                    && document.is_busy()
                {
                    self.fitter.cancel(document.id);
                    document.work = Work::Cancelled;
                }
            }
            Action::Overview => self.settings.arrangement = Arrangement::All,
            Action::Slices => self.settings.arrangement = Arrangement::Slices,
            Action::Plots => self.settings.arrangement = Arrangement::Plots,
            Action::Sphere => self.settings.arrangement = Arrangement::Sphere,
        }
    }

    /// Opens the window that asks for a path to write to.
    pub(crate) fn ask_where(&mut self, purpose: Purpose, name: &str) {
        self.windows.save = Some(purpose);
        name.clone_into(&mut self.windows.path);
    }

    /// Uses paths that were chosen.
    pub(crate) fn chosen(&mut self, purpose: Purpose, paths: &[PathBuf]) {
        let Some(first) = paths.first() else { return };
        match purpose {
            Purpose::Open => {
                self.windows.open = false;
                self.open_paths(paths);
            }
            Purpose::Environment => self.open_environment(first),
            Purpose::Object => self.settings.shape = Shape::File(first.clone()),
            Purpose::SaveSession => match Session::new(&self.documents, &self.settings).write(first) {
                Ok(()) => {
                    self.settings.remember(first);
                    self.messages.note(format!("saved session \"{}\"", first.display()));
                }
                Err(error) => self.messages.error(format!("{error:#}")),
            },
            Purpose::ExportSlices => export::slices(self, first),
            Purpose::ExportSphere => export::sphere(self, first),
            Purpose::SaveModel => export::model(self, first),
        }
        if purpose != Purpose::Open {
            self.windows.save = None;
        }
    }

    fn open_environment(&mut self, path: &Path) {
        let (outbox, path) = (self.outbox.clone(), path.to_owned());
        let work = move || {
            let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
            let result = Environment::read(&path).map(|map| (name, Arc::new(map)));
            outbox.send(Event::Environment { result: result.map_err(|e| e.to_string()) });
        };
        if let Err(error) = std::thread::Builder::new().name("reader".into()).spawn(work) {
            self.messages.error(format!("cannot read the environment: {error}"));
        }
    }

    /// Asks for a path in the system's dialog.
    pub(crate) fn browse(&self, purpose: Purpose) {
        dialogs::ask(purpose, &self.outbox);
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
        for action in shortcuts::pressed(&ctx) {
            self.act(&ctx, action);
        }
        self.window_ui(ui);
        self.request();
        self.reset_views = false;
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
        });
    }
}

/// Puts an image where another was, or in a new texture.
fn upload(
    ctx: &Context,
    old: &mut Option<TextureHandle>,
    name: String,
    image: egui::ColorImage,
) -> TextureHandle {
    match old.take() {
        Some(mut texture) => {
            texture.set(image, egui::TextureOptions::LINEAR);
            texture
        }
        None => ctx.load_texture(name, image, egui::TextureOptions::LINEAR),
    }
}
