//! Questions for files, and the system's file dialogs, which run on threads of their own.

use std::path::PathBuf;

use super::outbox::Outbox;

/// What is to be done with a file.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Access {
    /// Read a file of a kind, which has a name and endings.
    Read { kind: &'static str, endings: &'static [&'static str] },
    /// Read any number of files of a kind, or of any other.
    ReadMany { kind: &'static str, endings: &'static [&'static str] },
    /// Write a file, to which this name is given unless the user chooses another.
    Write { name: &'static str },
}

/// A question for a file.
#[derive(Clone, Debug)]
pub(crate) struct Question {
    /// The title of the window that asks.
    pub(crate) title: &'static str,
    /// What the file is or will be.
    pub(crate) help: &'static str,
    pub(crate) access: Access,
    /// Where the chosen path goes.
    pub(crate) answer: Outbox<PathBuf>,
}

/// Asks a question in the system's dialog. The question and the chosen paths are sent to `outbox`; nothing is
/// sent if the user chooses no file.
pub(crate) fn browse(question: Question, outbox: &Outbox<(Question, Vec<PathBuf>)>) {
    let outbox = outbox.clone();
    let ask = move || {
        let dialog = rfd::FileDialog::new();
        let paths: Vec<PathBuf> = match question.access {
            Access::Read { kind, endings } => {
                dialog.add_filter(kind, endings).pick_file().into_iter().collect()
            }
            Access::ReadMany { kind, endings } => {
                let dialog = dialog.add_filter(kind, endings).add_filter("All files", &["*"]);
                dialog.pick_files().unwrap_or_default()
            }
            Access::Write { name } => dialog.set_file_name(name).save_file().into_iter().collect(),
        };
        if !paths.is_empty() {
            outbox.send((question, paths));
        }
    };
    // Without a thread there is still the field for a path.
    let _no_dialog = std::thread::Builder::new().name("dialog".into()).spawn(ask);
}
