//! Does what keys, menus and windows ask for.

use std::path::PathBuf;

use eframe::egui::{self, Context};

use crate::viewer::app::{Viewer, Windows};
use crate::viewer::state::document::Work;
use crate::viewer::state::session::Session;
use crate::viewer::state::settings::Arrangement;
use crate::viewer::ui::shortcuts::Action;
use crate::viewer::work::dialogs::{self, Purpose};
use crate::viewer::work::export;
use crate::viewer::work::scene::Shape;

impl Viewer {
    /// Does what a key or a menu asks for.
    pub(crate) fn act(&mut self, ctx: &Context, action: Action) {
        match action {
            Action::Open => {
                self.windows.open = true;
                self.windows.path.clear();
            }
            Action::SaveSession => self.ask_where(Purpose::SaveSession, "session.json"),
            Action::Screenshot => export::screenshot(ctx, self),
            Action::Quit => ctx.send_viewport_cmd(egui::ViewportCommand::Close),
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
            Action::Cancel if self.windows != Windows::default() => self.windows = Windows::default(),
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
            Purpose::Environment => {
                self.settings.light.point = false;
                self.open_environment(first);
            }
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

    /// Asks for a path in the system's dialog.
    pub(crate) fn browse(&self, purpose: Purpose) {
        dialogs::ask(purpose, &self.outbox);
    }
}
