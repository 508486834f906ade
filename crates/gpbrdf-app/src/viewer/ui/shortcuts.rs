//! Keyboard shortcuts: one list of commands for the keys, the menu and the help.

use std::path::PathBuf;

use eframe::egui::{self, Context, Key, KeyboardShortcut, Modifiers};

use super::pane::Command;

/// What a key or an entry of a menu does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    OpenWindow,
    SaveSession,
    Screenshot,
    Quit,
    TogglePanels,
    Help,
    /// Show the hint of the first run.
    Hint,
    /// Close windows, or else cancel the work on the selected material.
    Cancel,
    ResetViews,
    /// Open a file or a session.
    Open(PathBuf),
    OpenBuiltIn(&'static str),
    /// Show all views.
    Overview,
    /// Show the view of this name alone.
    View(&'static str),
    /// Run a command of a pane: the index of the pane and that of its command.
    Pane(usize, usize),
}

const fn plain(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::NONE, key)
}

const fn with_ctrl(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::COMMAND, key)
}

pub(crate) const OPEN: KeyboardShortcut = with_ctrl(Key::O);
pub(crate) const CANCEL: KeyboardShortcut = plain(Key::Escape);
/// Keys of the views, in the order of the panes.
const VIEWS: [Key; 8] =
    [Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9];

/// The commands that belong to no pane. `views` has the name and the title of each view.
pub(crate) fn of_program(views: &[(&'static str, &'static str)]) -> Vec<(Action, Command)> {
    let in_menu = |key, words, help: &str| Command { menu: Some(words), ..Command::key(key, help) };
    let mut all = vec![
        (Action::OpenWindow, in_menu(OPEN, "Open…", "Open materials")),
        (Action::SaveSession, in_menu(with_ctrl(Key::S), "Save session…", "Save the session")),
        (Action::Screenshot, in_menu(with_ctrl(Key::P), "Screenshot", "Screenshot to PNG and EXR")),
        (Action::Quit, Command::key(with_ctrl(Key::Q), "Quit")),
        (Action::TogglePanels, Command::key(plain(Key::F1), "Hide or show the panels")),
        (Action::Help, Command::key(plain(Key::H), "This help")),
        (Action::Cancel, Command::key(CANCEL, "Close windows, cancel the running work")),
        (Action::Overview, Command::key(plain(Key::Num1), "Show everything")),
    ];
    for (&(name, title), key) in std::iter::zip(views, VIEWS) {
        all.push((Action::View(name), Command::key(plain(key), format!("Show the view \"{title}\" alone"))));
    }
    all
}

/// What the mouse and some keys do in views, for the help.
pub(crate) const MOUSE: [(&str, &str); 9] = [
    ("Left drag", "Pan slices and plots, turn the light of the sphere, orbit objects"),
    ("Right drag, wheel", "Zoom"),
    ("Double click", "Reset the view"),
    ("Shift + drag", "3-D: move the line between truth and prediction"),
    ("Ctrl + drag", "Objects: turn the light"),
    ("Ctrl + click", "A number: back to its default"),
    ("Drop files", "Open them"),
    ("Tab; arrows, plus, minus, Home", "Go to a view or control; move, zoom and reset the view"),
    ("Ctrl + plus, minus, 0", "Larger, smaller, normal text and controls"),
];

/// The key of an action as text.
pub(crate) fn text(ctx: &Context, commands: &[(Action, Command)], action: &Action) -> String {
    let found = commands.iter().find(|(a, _)| a == action).and_then(|(_, command)| command.key);
    found.map_or_else(String::new, |key| ctx.format_shortcut(&key))
}

/// The actions whose keys were pressed. Plain keys go to a text field that has the focus.
pub(crate) fn pressed(ctx: &Context, commands: &[(Action, Command)]) -> Vec<Action> {
    let typing = ctx.text_edit_focused();
    let menu = egui::Popup::is_any_open(ctx);
    let mut found = Vec::new();
    ctx.input_mut(|input| {
        for (action, command) in commands {
            let Some(key) = command.key else { continue };
            let plain = key.modifiers == Modifiers::NONE && key.logical_key != Key::F1;
            // Escape closes a menu first.
            let taken = plain && typing || menu && *action == Action::Cancel;
            if !taken && input.consume_shortcut(&key) {
                found.push(action.clone());
            }
        }
    });
    found
}
