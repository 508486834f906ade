//! Sessions: the open materials and how they are shown, as a JSON file.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use eframe::egui::Color32;
use gpbrdf_core::base::AtomicFile;
use serde::{Deserialize, Serialize};

use super::document::Document;
use super::documents::Documents;
use super::settings::Settings;
use crate::job::ModelSpec;

/// The value of `format` in every session file.
const FORMAT: &str = "gpbrdf session";

/// An open material in a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SavedDocument {
    /// The file; none for built-in materials.
    pub(crate) path: Option<PathBuf>,
    /// The name of the built-in material.
    pub(crate) built_in: Option<String>,
    pub(crate) name: String,
    pub(crate) colour: [u8; 3],
    pub(crate) visible: bool,
    pub(crate) spec: ModelSpec,
}

impl SavedDocument {
    /// Makes an open material look as it did when it was saved.
    pub(crate) fn restore(self, document: &mut Document) {
        document.name = self.name;
        let [r, g, b] = self.colour;
        document.colour = Color32::from_rgb(r, g, b);
        document.visible = self.visible;
        document.spec = self.spec;
    }
}

/// A session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Session {
    format: String,
    pub(crate) documents: Vec<SavedDocument>,
    pub(crate) settings: Settings,
}

impl Session {
    pub(crate) fn new(documents: &Documents, settings: Settings) -> Self {
        let documents = documents.iter().map(|d| SavedDocument {
            path: d.source.path.clone(),
            built_in: d.source.path.is_none().then(|| d.source.name.clone()),
            name: d.name.clone(),
            colour: [d.colour.r(), d.colour.g(), d.colour.b()],
            visible: d.visible,
            spec: d.spec.clone(),
        });
        Self { format: FORMAT.to_owned(), documents: documents.collect(), settings }
    }

    /// Whether a file's name is that of a session.
    pub(crate) fn is_named(path: &Path) -> bool {
        path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"))
    }

    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read session \"{}\"", path.display()))?;
        let session: Self = serde_json::from_str(&text)
            .with_context(|| format!("session \"{}\": expected a gpbrdf session", path.display()))?;
        if session.format != FORMAT {
            bail!(
                "session \"{}\": expected format \"{FORMAT}\", found \"{}\"",
                path.display(),
                session.format
            );
        }
        Ok(session)
    }

    pub(crate) fn write(&self, path: &Path) -> Result<()> {
        let mut file = AtomicFile::create(path)?;
        let cannot = || format!("cannot write session \"{}\"", path.display());
        serde_json::to_writer_pretty(&mut file, self).with_context(cannot)?;
        std::io::Write::write_all(&mut file, b"\n").with_context(cannot)?;
        Ok(file.commit()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viewer::state::document::DocumentId;
    use gpbrdf_core::Source;

    #[test]
    fn sessions_come_back_as_they_went_and_others_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let mut documents = Documents::default();
        let document = documents.add(Source::built_in("ward").unwrap());
        document.name = "my wood".into();
        document.spec.lattice = Some([12, 10, 8]);
        let session = Session::new(&documents, Settings::default());
        let path = folder.path().join("a.json");
        session.write(&path).unwrap();
        assert_eq!(Session::read(&path).unwrap(), session);
        let mut again = Document::new(DocumentId(3), Source::built_in("ward").unwrap());
        session.documents[0].clone().restore(&mut again);
        assert_eq!((again.name.as_str(), again.spec.shape()), ("my wood", [12, 10, 8]));
        std::fs::write(&path, "{\"format\": 3}").unwrap();
        let message = format!("{:#}", Session::read(&path).unwrap_err());
        assert!(message.contains("a.json"), "{message}");
    }
}
