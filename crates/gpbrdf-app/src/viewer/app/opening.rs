//! Opens and restores: files, built-in materials, sessions and settings.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gpbrdf_core::brdf::materials;
use gpbrdf_core::formats::{is_environment, is_table_exr};
use gpbrdf_core::{Content, Source};
use gpbrdf_render::is_mesh;

use super::{Event, FIRST, Found, Opened, Viewer};
use crate::message::said_once;
use crate::viewer::state::document::Document;
use crate::viewer::state::messages::naming;
use crate::viewer::state::session::{SavedDocument, Session};
use crate::viewer::state::settings::Settings;
use crate::viewer::state::unknown::unknown_fields;
use crate::viewer::ui::pane::Shown;
use crate::viewer::work::outbox::in_background;

/// How much of a file is read to tell what it holds.
const HEAD_BYTES: u64 = 64 << 10;

/// Reads a file, as what it is.
fn find(path: PathBuf, restore: Option<Box<SavedDocument>>) -> Result<Found, String> {
    let mut head = Vec::new();
    // What cannot be opened is opened again below, which says why.
    if path.is_file()
        && restore.is_none()
        && let Ok(file) = File::open(&path)
    {
        let _error_is_found_again = file.take(HEAD_BYTES).read_to_end(&mut head);
    }
    if Session::is_session(&head) {
        let (session, note) = Session::read(&path).map_err(|error| said_once(&error))?;
        return Ok(Found::Session(Box::new(session), note));
    }
    if is_mesh(&head) {
        return Ok(Found::Shown(Shown::Mesh(path)));
    }
    if is_environment(&head) && !is_table_exr(&path) {
        return Ok(Found::Shown(Shown::Environment(path)));
    }
    let source = Source::open(&path).map_err(|error| naming(&path, &error))?;
    Ok(Found::Material(Opened { source: Box::new(source), restore }))
}

impl Viewer {
    /// Opens files, whatever they hold: materials, models, sessions, environment maps and meshes. They are read in the
    /// background.
    pub fn open_paths(&mut self, paths: &[PathBuf]) {
        for path in paths {
            if let Some(material) = materials().iter().find(|m| !path.exists() && path.as_os_str() == m.name)
            {
                self.open_built_in(material.name, None);
            } else {
                self.settings.remember(path);
                self.read(path.clone(), None);
            }
        }
    }

    /// Reads a file in the background. What a session says of it is that of a material.
    fn read(&mut self, path: PathBuf, restore: Option<Box<SavedDocument>>) {
        self.reading += 1;
        let cannot = format!("cannot read \"{}\"", path.display());
        in_background(&self.outbox.map(Event::Found), "reader", &cannot, move || find(path, restore));
    }

    /// Takes in what a file was found to hold.
    pub(super) fn take_found(&mut self, found: Result<Found, String>) {
        self.reading = self.reading.saturating_sub(1);
        match found {
            Ok(Found::Material(opened)) => self.open(opened),
            Ok(Found::Session(session, note)) => {
                self.restore(*session);
                if let Some(note) = note {
                    self.context.messages.note(note);
                }
            }
            Ok(Found::Shown(file)) => {
                // One pane shows it, on a material.
                let shown = self.panes.iter_mut().any(|pane| pane.show(&file));
                if shown && self.reading == 0 && self.context.documents.is_empty() {
                    self.open_built_in(FIRST, None);
                }
            }
            Err(message) => self.context.messages.error(message),
        }
    }

    /// Reads a file of measurements again that has changed.
    pub(super) fn reread(&self, path: PathBuf) {
        let cannot = format!("cannot read \"{}\"", path.display());
        let outbox = self.outbox.clone().map({
            let path = path.clone();
            move |result| Event::Reread(path.clone(), result)
        });
        in_background(&outbox, "reader", &cannot, move || {
            let source = Source::open(&path).map_err(|error| naming(&path, &error))?;
            match source.content {
                Content::Samples(_) => Ok(Arc::new(source)),
                _ => Err(format!(
                    "\"{}\": expected measurements as before, found a {}",
                    path.display(),
                    source.kind
                )),
            }
        });
    }

    /// Takes what a changed file says into all materials of that file. What was open stays where it cannot be read.
    pub(super) fn renew(&mut self, path: &Path, result: Result<Arc<Source>, String>) {
        let source = match result {
            Ok(source) => source,
            Err(message) => {
                self.context.messages.error(format!("{message}; what it said before is kept"));
                return;
            }
        };
        let same = |d: &&mut Document| d.is_scattered() && d.source.path.as_deref() == Some(path);
        for document in self.context.documents.iter_mut().filter(same) {
            self.fitter.forget(document.id);
            document.renew(Arc::clone(&source));
        }
        let count = source.samples().map_or(0, gpbrdf_core::SampleSet::len);
        self.context.messages.success(format!("{}: read again, {count} samples", source.name));
    }

    /// Opens a built-in material.
    pub(super) fn open_built_in(&mut self, name: &str, restore: Option<Box<SavedDocument>>) {
        match Source::built_in(name) {
            Ok(source) => self.open(Opened { source: Box::new(source), restore }),
            Err(error) => self.context.messages.error(error.to_string()),
        }
    }

    /// Opens a material that has been read.
    fn open(&mut self, opened: Opened) {
        for notice in opened.source.notices() {
            self.context.messages.note(format!("{}: {notice}", opened.source.name));
        }
        if let Content::Samples(samples) = &opened.source.content {
            for spot in samples.blind_spots() {
                self.context.messages.note(format!("{}: {spot}", opened.source.name));
            }
        }
        let document = self.context.documents.add(*opened.source);
        if let Some(saved) = opened.restore {
            saved.restore(document);
        }
    }

    /// Replaces everything that is open, and how it is shown, by a session.
    fn restore(&mut self, session: Session) {
        for id in self.context.documents.iter().map(|d| d.id).collect::<Vec<_>>() {
            self.remove(id);
        }
        let recent = std::mem::take(&mut self.settings.recent);
        self.settings = Settings { recent, hint: self.settings.hint, ..session.settings };
        self.new_zoom = Some(self.settings.zoom);
        self.restore_panes();
        for saved in session.documents {
            match (saved.path.clone(), saved.built_in.clone()) {
                (Some(path), _) => self.read(path, Some(Box::new(saved))),
                (None, Some(name)) => self.open_built_in(&name, Some(Box::new(saved))),
                (None, None) => {
                    self.context.messages.error(format!("session: \"{}\" has no source", saved.name));
                }
            }
        }
    }

    /// Hands each pane what it remembered.
    pub(super) fn restore_panes(&mut self) {
        for notice in std::mem::take(&mut self.settings.notices) {
            self.context.messages.note(notice);
        }
        let names: Vec<&str> = self.panes.iter().map(|pane| pane.name()).collect();
        let unknown: Vec<&str> =
            self.settings.panes.keys().map(String::as_str).filter(|n| !names.contains(n)).collect();
        if !unknown.is_empty() {
            self.context
                .messages
                .note(format!("settings of panes that do not exist: {}", unknown.join(", ")));
        }
        for pane in &mut self.panes {
            let kept = self.settings.panes.get(pane.name()).unwrap_or(&serde_json::Value::Null);
            if let Err(error) = pane.restore(kept) {
                let message = format!("settings of the pane \"{}\": {error}", pane.title());
                self.context.messages.error(message);
            } else if let Some(unknown) = unknown_fields(kept, &pane.settings()) {
                self.context.messages.note(format!("settings of the pane \"{}\": {unknown}", pane.title()));
            }
        }
    }

    /// Writes what is open to a session file.
    pub(super) fn save_session(&mut self, path: &Path) {
        match Session::new(&self.context.documents, self.settings()).write(path) {
            Ok(()) => {
                self.settings.remember(path);
                self.context.messages.success(format!("saved session \"{}\"", path.display()));
            }
            Err(error) => self.context.messages.error(said_once(&error)),
        }
    }
}
