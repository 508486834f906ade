//! Files, built-in materials and sessions: what is open and how it comes to be.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use eframe::egui;
use gpbrdf_core::{Environment, Source, materials};

use crate::viewer::app::Viewer;
use crate::viewer::state::document::{Document, DocumentId};
use crate::viewer::state::messages::naming;
use crate::viewer::state::session::{SavedDocument, Session};
use crate::viewer::state::settings::Settings;
use crate::viewer::work::fitter::Event;

impl Viewer {
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
            let result = Source::open(&path).map(Box::new).map_err(|error| naming(&path, &error));
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

    pub(crate) fn add(&mut self, source: Source, restore: Option<Box<SavedDocument>>) {
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
        match self.settings.environment.clone() {
            Some(path) => self.open_environment(&path),
            None => self.use_studio(),
        }
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

    /// Reads a map off this thread.
    pub(crate) fn open_environment(&mut self, path: &Path) {
        let (outbox, path) = (self.outbox.clone(), path.to_owned());
        let name = path.display().to_string();
        let work = move || {
            let result = Environment::read(&path).map(Arc::new).map_err(|e| e.to_string());
            outbox.send(Event::Environment { result: result.map(|map| (path, map)) });
        };
        if let Err(error) = std::thread::Builder::new().name("reader".into()).spawn(work) {
            self.messages.error(format!("cannot read \"{name}\": {error}"));
        }
    }

    /// Takes the built-in environment.
    pub(crate) fn use_studio(&mut self) {
        self.environment =
            (self.environment.0 + 1, "Studio (built in)".to_owned(), Arc::new(Environment::studio()));
        self.settings.environment = None;
    }
}
