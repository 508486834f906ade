//! Sessions: the open materials and how they are shown, as a JSON file.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use eframe::egui::Color32;
use gpbrdf_core::base::AtomicFile;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::document::Document;
use super::documents::Documents;
use super::portable::PortablePath;
use super::settings::Settings;
use super::unknown::unknown_fields;
use crate::job::ModelSpec;

/// The value of `format` in every session file.
const FORMAT: &str = "gpbrdf session";

/// The version of session files that is written, and the newest one that is read.
const VERSION: u64 = 2;

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
    /// Missing in files of version 1.
    #[serde(default = "first_version")]
    version: u64,
    pub(crate) documents: Vec<SavedDocument>,
    pub(crate) settings: Settings,
    /// All files that the rest names by their absolute paths.
    #[serde(default)]
    files: Vec<PortablePath>,
}

fn first_version() -> u64 {
    1
}

/// What of a file says whether it is a session that can be read.
#[derive(Deserialize)]
struct Heading {
    format: String,
    #[serde(default = "first_version")]
    version: u64,
}

impl Session {
    pub(crate) fn new(documents: &Documents, settings: Settings) -> Self {
        let absolute = |path: &PathBuf| std::path::absolute(path).unwrap_or_else(|_| path.clone());
        let documents = documents.iter().map(|d| SavedDocument {
            path: d.source.path.as_ref().map(absolute),
            built_in: d.source.path.is_none().then(|| d.source.name.clone()),
            name: d.name.clone(),
            colour: [d.colour.r(), d.colour.g(), d.colour.b()],
            visible: d.visible,
            spec: d.spec.clone(),
        });
        let documents = documents.collect();
        // The files of the last runs are no part of a session.
        let settings = Settings { recent: Vec::new(), ..settings };
        Self { format: FORMAT.to_owned(), version: VERSION, documents, settings, files: Vec::new() }
    }

    /// Whether content that starts like this is a session, of any version.
    pub(crate) fn is_session(head: &[u8]) -> bool {
        let text = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head).trim_ascii_start();
        text.starts_with(b"{") && text.windows(FORMAT.len()).any(|part| part == FORMAT.as_bytes())
    }

    /// Reads a session. Its files are looked for as seen from its folder first, and where they were when it was
    /// written next. The text is about what it holds beyond what is known.
    pub(crate) fn read(path: &Path) -> Result<(Self, Option<String>)> {
        let named = || format!("session \"{}\"", path.display());
        let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", named()))?;
        let folder = folder_of(path).with_context(|| format!("cannot read {}", named()))?;
        let (session, unknown) = Self::parse(&bytes, &folder).with_context(named)?;
        Ok((session, unknown.map(|unknown| format!("{}: {unknown}", named()))))
    }

    /// Like [`Session::read`], from the content of a file in `folder`.
    pub(crate) fn parse(bytes: &[u8], folder: &Path) -> Result<(Self, Option<String>)> {
        let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
        let mut given: Value = serde_json::from_slice(bytes).context("expected a gpbrdf session")?;
        let heading = Heading::deserialize(&given).context("expected a gpbrdf session")?;
        if heading.format != FORMAT {
            bail!("expected format \"{FORMAT}\", found \"{}\"", heading.format);
        }
        if !(1..=VERSION).contains(&heading.version) {
            bail!(
                "expected version {VERSION} or older, found version {}, of another gpbrdf",
                heading.version
            );
        }
        let mut files: Vec<PortablePath> = match given.get("files") {
            Some(files) => Vec::deserialize(files).context("expected a gpbrdf session")?,
            None => Vec::new(),
        };
        // Version 1 may name files as seen from wherever the program was started.
        let named =
            given["documents"].as_array().into_iter().flatten().filter_map(|saved| saved["path"].as_str());
        let named = named.filter(|text| Path::new(text).is_relative() && !Path::new(text).exists());
        let named: Vec<PortablePath> = named.map(PortablePath::beside).collect();
        files.extend(named);
        if let Some(members) = given.as_object_mut() {
            for (_, member) in members.iter_mut().filter(|(name, _)| *name != "files") {
                PortablePath::resolve_all(&files, folder, member);
            }
        }
        let session = Self::deserialize(&given).context("expected a gpbrdf session")?;
        let unknown = unknown_fields(&given, &serde_json::to_value(&session)?);
        Ok((session, unknown))
    }

    /// Writes the session, with where its files are as seen from its folder.
    pub(crate) fn write(mut self, path: &Path) -> Result<()> {
        let cannot = || format!("cannot write session \"{}\"", path.display());
        let folder = folder_of(path).with_context(cannot)?;
        let value = serde_json::to_value(&self).with_context(cannot)?;
        let absolute = strings(&value).into_iter().map(PathBuf::from).filter(|path| path.is_absolute());
        self.files = absolute.map(|path| PortablePath::new(&path, &folder)).collect();
        let mut file = AtomicFile::create(path)?;
        serde_json::to_writer_pretty(&mut file, &self).with_context(cannot)?;
        std::io::Write::write_all(&mut file, b"\n").with_context(cannot)?;
        Ok(file.commit()?)
    }
}

/// The absolute folder of a file.
fn folder_of(path: &Path) -> std::io::Result<PathBuf> {
    let absolute = std::path::absolute(path)?;
    Ok(absolute.parent().map_or_else(PathBuf::new, Path::to_owned))
}

/// All texts in a value, each once.
fn strings(value: &Value) -> BTreeSet<String> {
    match value {
        Value::String(text) => BTreeSet::from([text.clone()]),
        Value::Array(values) => values.iter().flat_map(strings).collect(),
        Value::Object(members) => members.values().flat_map(strings).collect(),
        _ => BTreeSet::new(),
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
        session.clone().write(&path).unwrap();
        assert_eq!(Session::read(&path).unwrap(), (session.clone(), None));
        let mut again = Document::new(DocumentId(3), Source::built_in("ward").unwrap());
        session.documents[0].clone().restore(&mut again);
        assert_eq!((again.name.as_str(), again.spec.shape()), ("my wood", [12, 10, 8]));
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(Session::is_session(text.as_bytes()) && !Session::is_session(b"{\"format\": \"other\"}"));
        for (from, to, part) in [
            ("\"gpbrdf session\"", "3", "a.json"),
            ("\"gpbrdf session\"", "\"x\"", "expected format \"gpbrdf session\", found \"x\""),
            ("\"version\": 2", "\"version\": 3", "expected version 2 or older, found version 3"),
            ("\"visible\"", "\"vizible\"", "visible"),
        ] {
            assert!(text.contains(from));
            std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
            let message = format!("{:#}", Session::read(&path).unwrap_err());
            assert!(message.contains(part) && message.contains("a.json"), "{message}");
        }
        std::fs::write(&path, text.replacen("\"zoom\"", "\"night\": 1, \"zoom\"", 1)).unwrap();
        let (found, unknown) = Session::read(&path).unwrap();
        assert_eq!(found, session);
        assert!(unknown.unwrap().ends_with("a.json\": \"settings.night\" not known, and ignored"));
    }

    #[test]
    fn a_session_that_is_moved_with_its_files_finds_them() {
        let folder = tempfile::tempdir().unwrap();
        let [here, there] = ["here", "there"].map(|name| folder.path().join(name));
        std::fs::create_dir(&here).unwrap();
        let file = here.join("a.csv");
        std::fs::write(&file, "theta_i,phi_i,theta_o,phi_o,f\n10,0,20,180,1\n").unwrap();
        let mut documents = Documents::default();
        documents.add(Source::open(&file).unwrap());
        let mut settings = Settings::default();
        let look =
            serde_json::json!({"environment": here.join("sky.hdr"), "shape": {"File": here.join("b.obj")}});
        settings.panes.insert("3d".to_owned(), look);
        for name in ["sky.hdr", "b.obj"] {
            std::fs::write(here.join(name), "x").unwrap();
        }
        Session::new(&documents, settings).write(&here.join("s.json")).unwrap();
        std::fs::rename(&here, &there).unwrap();
        let (session, unknown) = Session::read(&there.join("s.json")).unwrap();
        assert_eq!(unknown, None);
        assert_eq!(session.documents[0].path.as_deref(), Some(&*there.join("a.csv")));
        let look = &session.settings.panes["3d"];
        assert_eq!(look["environment"], there.join("sky.hdr").to_str().unwrap());
        assert_eq!(look["shape"]["File"], there.join("b.obj").to_str().unwrap());
        // A session of version 1 with a name beside it.
        let text = r#"{"format": "gpbrdf session", "settings": {}, "documents": [{"path": "a.csv", "built_in": null,
            "name": "a", "colour": [1, 2, 3], "visible": true, "spec": {}}]}"#;
        std::fs::write(there.join("old.json"), text).unwrap();
        let (session, _) = Session::read(&there.join("old.json")).unwrap();
        assert_eq!(session.documents[0].path.as_deref(), Some(&*there.join("a.csv")));
    }
}
