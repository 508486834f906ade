//! Keyboard shortcuts: one list for the keys, the menus and the help.

use eframe::egui::{self, Context, Key, KeyboardShortcut, Modifiers};

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    Open,
    SaveSession,
    Screenshot,
    Quit,
    TogglePanels,
    Help,
    ToggleLog,
    ToggleCosine,
    Optimise,
    Cancel,
    Overview,
    Slices,
    Plots,
    Sphere,
}

/// Every shortcut: action, key, what it says in the help.
pub(crate) const SHORTCUTS: [(Action, KeyboardShortcut, &str); 14] = [
    (Action::Open, KeyboardShortcut::new(Modifiers::COMMAND, Key::O), "Open materials"),
    (Action::SaveSession, KeyboardShortcut::new(Modifiers::COMMAND, Key::S), "Save the session"),
    (Action::Screenshot, KeyboardShortcut::new(Modifiers::COMMAND, Key::P), "Screenshot to PNG and EXR"),
    (Action::Quit, KeyboardShortcut::new(Modifiers::COMMAND, Key::Q), "Quit"),
    (Action::TogglePanels, KeyboardShortcut::new(Modifiers::NONE, Key::F1), "Hide or show the panels"),
    (Action::Help, KeyboardShortcut::new(Modifiers::NONE, Key::H), "This help"),
    (Action::ToggleLog, KeyboardShortcut::new(Modifiers::NONE, Key::L), "Plots: logarithmic or linear"),
    (Action::ToggleCosine, KeyboardShortcut::new(Modifiers::NONE, Key::C), "Plots: times the cosine"),
    (Action::Optimise, KeyboardShortcut::new(Modifiers::NONE, Key::O), "Optimise the hyper-parameters"),
    (
        Action::Cancel,
        KeyboardShortcut::new(Modifiers::NONE, Key::Escape),
        "Close windows, cancel the running work",
    ),
    (Action::Overview, KeyboardShortcut::new(Modifiers::NONE, Key::Num1), "Show everything"),
    (Action::Slices, KeyboardShortcut::new(Modifiers::NONE, Key::Num2), "Show slices only"),
    (Action::Plots, KeyboardShortcut::new(Modifiers::NONE, Key::Num3), "Show plots only"),
    (Action::Sphere, KeyboardShortcut::new(Modifiers::NONE, Key::Num4), "Show 3-D only"),
];

/// What the mouse does, for the help.
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
pub(crate) fn text(ctx: &Context, action: Action) -> String {
    let found = SHORTCUTS.iter().find(|(a, ..)| *a == action);
    found.map_or_else(String::new, |(_, shortcut, _)| ctx.format_shortcut(shortcut))
}

/// The actions whose keys were pressed. Plain letters go to a text field that has the focus.
pub(crate) fn pressed(ctx: &Context) -> Vec<Action> {
    let typing = ctx.text_edit_focused();
    let menu = egui::Popup::is_any_open(ctx);
    let mut found = Vec::new();
    ctx.input_mut(|input| {
        for (action, shortcut, _) in &SHORTCUTS {
            let plain = shortcut.modifiers == Modifiers::NONE && shortcut.logical_key != Key::F1;
            // Escape closes a menu first.
            let taken = plain && typing || menu && *action == Action::Cancel;
            if !taken && input.consume_shortcut(shortcut) {
                found.push(*action);
            }
        }
    });
    found
}
