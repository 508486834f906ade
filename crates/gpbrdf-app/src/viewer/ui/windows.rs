//! Small windows: what to open, which file to read or write, the shortcuts.

use std::path::PathBuf;

use eframe::egui::{self, Context, RichText, Ui};
use gpbrdf_core::brdf::materials;

use super::pane::Command;
use super::shortcuts::{Action, MOUSE};
use crate::viewer::work::dialogs::{Access, Question};

/// The small windows that are open.
#[derive(Debug)]
pub(crate) struct Windows {
    /// The question for files to open, which is asked in a window of its own.
    open: Question,
    is_open: bool,
    help: bool,
    /// The question for another file.
    question: Option<Question>,
    /// What has been typed.
    path: String,
}

/// What the user has done in a window.
#[derive(Debug)]
pub(crate) enum Reply {
    /// Chosen a path.
    Path(Question, PathBuf),
    /// Chosen a built-in material.
    BuiltIn(&'static str),
    /// Asked for the dialog of the system.
    Browse(Question),
}

impl Windows {
    /// No window is open. `open` is the question that [`Self::ask_open`] asks.
    pub(crate) fn new(open: Question) -> Self {
        Self { open, is_open: false, help: false, question: None, path: String::new() }
    }

    /// Asks for files to open.
    pub(crate) fn ask_open(&mut self) {
        self.is_open = true;
        self.path.clear();
    }

    /// Asks for a file.
    pub(crate) fn ask(&mut self, question: Question) {
        match question.access {
            Access::Write { name } => name.clone_into(&mut self.path),
            Access::Read { .. } | Access::ReadMany { .. } => self.path.clear(),
        }
        self.question = Some(question);
    }

    /// Closes the window of a question that has been answered.
    pub(crate) fn answered(&mut self, question: &Question) {
        if question.title == self.open.title {
            self.is_open = false;
        } else if self.question.as_ref().is_some_and(|q| q.title == question.title) {
            self.question = None;
        }
    }

    /// Shows or hides the shortcuts.
    pub(crate) fn toggle_help(&mut self) {
        self.help ^= true;
    }

    /// Closes all windows; whether there were any.
    pub(crate) fn close_all(&mut self) -> bool {
        let any = self.is_open || self.help || self.question.is_some();
        (self.is_open, self.help, self.question) = (false, false, None);
        any
    }

    /// Draws the windows that are open.
    pub(crate) fn ui(&mut self, ctx: &Context, commands: &[(Action, Command)]) -> Option<Reply> {
        let opened = self.open_ui(ctx);
        let answered = self.question_ui(ctx);
        self.help_ui(ctx, commands);
        opened.or(answered)
    }

    fn open_ui(&mut self, ctx: &Context) -> Option<Reply> {
        let mut open = self.is_open;
        let mut reply = None;
        let question = self.open.clone();
        let window = egui::Window::new(question.title).open(&mut open).collapsible(false).vscroll(true);
        window.default_width(420.0).show(ctx, |ui| {
            ui.label(question.help);
            reply = self.path_row_ui(ui, "Path to open", "Open", &question);
            ui.add_space(6.0);
            ui.label(RichText::new("Built-in materials").strong());
            ui.horizontal_wrapped(|ui| {
                for material in materials() {
                    if ui.button(material.title).on_hover_text(material.description).clicked() {
                        reply = Some(Reply::BuiltIn(material.name));
                    }
                }
            });
        });
        self.is_open = open && !matches!(reply, Some(Reply::BuiltIn(_)));
        reply
    }

    fn question_ui(&mut self, ctx: &Context) -> Option<Reply> {
        let question = self.question.clone()?;
        let mut open = true;
        let mut reply = None;
        let window = egui::Window::new(question.title).open(&mut open).collapsible(false);
        window.default_width(420.0).show(ctx, |ui| {
            ui.label(question.help);
            let verb = if matches!(question.access, Access::Write { .. }) { "Write" } else { "Load" };
            reply = self.path_row_ui(ui, "Path", verb, &question);
        });
        if !open {
            self.question = None;
        }
        reply
    }

    /// A field for a path, a button with a verb that takes it, and one that opens the dialog of the system.
    fn path_row_ui(&mut self, ui: &mut Ui, label: &str, verb: &str, question: &Question) -> Option<Reply> {
        let mut reply = None;
        ui.horizontal(|ui| {
            let width = ui.available_width() - 150.0;
            let field = egui::TextEdit::singleline(&mut self.path).desired_width(width);
            let field = ui.add(field).accessible_name(label);
            let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
            let path = self.path.trim();
            let given = !path.is_empty();
            if (ui.add_enabled(given, egui::Button::new(verb)).clicked() || entered) && given {
                reply = Some(Reply::Path(question.clone(), PathBuf::from(path)));
            }
            if ui.button("Browse…").on_hover_text("The file dialog of the system").clicked() {
                reply = Some(Reply::Browse(question.clone()));
            }
        });
        reply
    }

    fn help_ui(&mut self, ctx: &Context, commands: &[(Action, Command)]) {
        // All of it where there is room.
        let height = 0.9 * ctx.content_rect().height();
        let window = egui::Window::new("Shortcuts").open(&mut self.help);
        window.collapsible(false).vscroll(true).default_height(height).show(ctx, |ui| {
            egui::Grid::new("shortcuts").num_columns(2).spacing([24.0, 5.0]).striped(true).show(ui, |ui| {
                for (_, command) in commands {
                    let Some(key) = command.key else { continue };
                    ui.label(RichText::new(ctx.format_shortcut(&key)).strong());
                    ui.label(&command.help);
                    ui.end_row();
                }
                for (how, what) in MOUSE {
                    ui.label(RichText::new(how).strong());
                    ui.label(what);
                    ui.end_row();
                }
            });
        });
    }
}
