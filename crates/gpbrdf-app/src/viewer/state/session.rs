//! Sessions: the open materials and how they are shown, as a JSON file.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use gpbrdf_core::AtomicFile;
use serde::{Deserialize, Serialize};

use crate::viewer::spec::ModelSpec;
use crate::viewer::state::document::Document;
use crate::viewer::state::settings::Settings;

/// What a session file says that it is.
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

/// A session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Session {
    format: String,
    pub(crate) documents: Vec<SavedDocument>,
    pub(crate) settings: Settings,
}

impl Session {
    pub(crate) fn new(documents: &[Document], settings: &Settings) -> Self {
        let documents = documents.iter().map(|d| SavedDocument {
            path: d.source.path.clone(),
            built_in: d.source.path.is_none().then(|| d.source.name.clone()),
            name: d.name.clone(),
            colour: [d.colour.r(), d.colour.g(), d.colour.b()],
            visible: d.visible,
            spec: d.spec.clone(),
        });
        Self { format: FORMAT.to_owned(), documents: documents.collect(), settings: settings.clone() }
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
        let mut document = Document::new(DocumentId(3), Source::built_in("ward").unwrap());
        document.name = "my wood".into();
        document.spec.shape = [12, 10, 8];
        let session = Session::new(&[document], &Settings::default());
        let path = folder.path().join("a.json");
        session.write(&path).unwrap();
        assert_eq!(Session::read(&path).unwrap(), session);
        std::fs::write(&path, "{\"format\": 3}").unwrap();
        let message = format!("{:#}", Session::read(&path).unwrap_err());
        assert!(message.contains("a.json"), "{message}");
    }
}
