//! Results on disk: the files of an experiment are written together, and a later run finds them again.

use std::fs;
use std::io::Write;
use std::path::Path;

use anyhow::{Context as _, Result};
use gpbrdf_core::base::AtomicFile;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::context::Outcome;
use super::table::Table;
use crate::output::OutputFolder;

/// `NAME.json`: an experiment's tables, what they depend on, and the files beside it.
#[derive(Debug, Deserialize, Serialize)]
struct Record {
    experiment: String,
    key: Value,
    seconds: f64,
    tables: Vec<Table>,
    files: Vec<String>,
}

/// Whether `folder` holds the result of an experiment of this key, with all its files.
pub(crate) fn is_done(folder: &Path, name: &str, key: &Value) -> bool {
    let Ok(text) = fs::read_to_string(folder.join(format!("{name}.json"))) else { return false };
    let Ok(record) = serde_json::from_str::<Record>(&text) else { return false };
    record.experiment == name
        && &record.key == key
        && record.files.iter().all(|file| folder.join(file).is_file())
}

/// Writes all files of an experiment, or none, and returns how many there are.
///
/// # Errors
/// If a folder or file cannot be written.
pub(crate) fn write(folder: &Path, name: &str, key: &Value, seconds: f64, outcome: Outcome) -> Result<usize> {
    let target = OutputFolder::create(folder)?;
    let mut contents: Vec<(String, Vec<u8>)> = outcome.figures;
    for table in &outcome.tables {
        contents.push((format!("{}.csv", table.name), table.csv().into_bytes()));
    }
    let markdown: Vec<String> = outcome.tables.iter().map(Table::markdown).collect();
    contents.push((format!("{name}.md"), markdown.join("\n").into_bytes()));
    let record = Record {
        experiment: name.to_owned(),
        key: key.clone(),
        seconds,
        tables: outcome.tables,
        files: contents.iter().map(|(file, _)| file.clone()).collect(),
    };
    // The record comes last, so that the other files are there where it is.
    let mut json = serde_json::to_vec_pretty(&record)?;
    json.push(b'\n');
    contents.push((format!("{name}.json"), json));
    let mut files = Vec::with_capacity(contents.len());
    for (file, bytes) in contents {
        let mut out = AtomicFile::create(target.join(&file))?;
        out.write_all(&bytes).with_context(|| format!("cannot write \"{}\"", out.target().display()))?;
        files.push(out);
    }
    let count = files.len();
    AtomicFile::commit_all(files)?;
    Ok(count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_result_is_found_again_only_whole_and_under_its_key() {
        let folder = tempfile::tempdir().unwrap();
        let outcome = || Outcome {
            tables: vec![Table::new("a", "A", &["x"])],
            figures: vec![("a.svg".into(), b"<svg/>".to_vec())],
        };
        let (key, other) = (json!({ "quick": true }), json!({ "quick": false }));
        assert!(!is_done(folder.path(), "a", &key));
        assert_eq!(write(folder.path(), "a", &key, 1.0, outcome()).unwrap(), 4);
        assert!(is_done(folder.path(), "a", &key));
        assert!(!is_done(folder.path(), "a", &other) && !is_done(folder.path(), "b", &key));
        fs::remove_file(folder.path().join("a.svg")).unwrap();
        assert!(!is_done(folder.path(), "a", &key));
        fs::write(folder.path().join("a.json"), "{").unwrap();
        assert!(!is_done(folder.path(), "a", &key));
    }
}
