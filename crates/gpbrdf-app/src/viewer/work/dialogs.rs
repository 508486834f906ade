//! The system's file dialogs, off the window's thread.

use crate::viewer::work::fitter::{Event, Outbox};

/// What a chosen file is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    Open,
    Environment,
    Object,
    SaveSession,
    ExportSlices,
    ExportSphere,
    SaveModel,
}

/// Asks for files; an answer comes as an event, none if the user gives up.
pub(crate) fn ask(purpose: Purpose, outbox: &Outbox) {
    let outbox = outbox.clone();
    let asked = move || {
        let dialog = rfd::FileDialog::new();
        let paths = match purpose {
            Purpose::Open => dialog
                .add_filter("Materials", &["binary", "bsdf", "csv", "exr", "safetensors", "brdf", "json"])
                .add_filter("All files", &["*"])
                .pick_files()
                .unwrap_or_default(),
            Purpose::Environment => {
                dialog.add_filter("Environment maps", &["hdr", "exr"]).pick_file().into_iter().collect()
            }
            Purpose::Object => dialog.add_filter("Wavefront OBJ", &["obj"]).pick_file().into_iter().collect(),
            Purpose::SaveSession => save(dialog, "session.json"),
            Purpose::ExportSlices => save(dialog, "slices.png"),
            Purpose::ExportSphere => save(dialog, "sphere.png"),
            Purpose::SaveModel => save(dialog, "model.safetensors"),
        };
        if !paths.is_empty() {
            outbox.send(Event::Chosen { purpose, paths });
        }
    };
    // Without a thread there is still the path field.
    let _no_dialog = std::thread::Builder::new().name("dialog".into()).spawn(asked);
}

fn save(dialog: rfd::FileDialog, name: &str) -> Vec<std::path::PathBuf> {
    dialog.set_file_name(name).save_file().into_iter().collect()
}
