//! The record of a batch: one line of JSON for each material that is finished or has failed.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::part::Part;

/// What becomes of one material.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Line {
    /// The name of its folder.
    pub(super) name: String,
    /// The file that it was made from, or the name of a built-in material.
    pub(super) file: String,
    /// SHA-256 sum of that file, in hexadecimal; built-in materials and files that cannot be read have none.
    pub(super) sha256: Option<String>,
    /// The version of the program and the options that decide on the files.
    pub(super) options: Value,
    /// Wall-clock seconds of each stage, and of all.
    pub(super) seconds: Value,
    /// Numbers that JSON cannot hold, by the keys that are null for them.
    #[serde(default, skip_serializing_if = "Value::is_null")]
    pub(super) notes: Value,
    #[serde(flatten)]
    pub(super) end: End,
}

/// How a material ended.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged)]
pub(super) enum End {
    Failed {
        error: String,
    },
    Finished {
        /// Whether the search for hyper-parameters converged.
        converged: bool,
        /// The metrics of `report.json`; null without a truth.
        metrics: Value,
        /// The files in its folder, with their bytes.
        outputs: Map<String, Value>,
    },
}

/// The lines of a folder, and the file for those of this run.
#[derive(Debug)]
pub(super) struct Record {
    folder: PathBuf,
    path: PathBuf,
    file: File,
    /// The last line of each material that earlier runs have written.
    lines: HashMap<String, Line>,
    /// Number of lines that could not be read.
    pub(super) unreadable: usize,
}

impl Record {
    /// Reads the records of all runs that wrote to `folder`, and opens that of this one.
    ///
    /// # Errors
    /// A record that cannot be read, or that another run is writing to.
    pub(super) fn open(folder: &Path, part: Option<Part>) -> Result<Self> {
        let path = folder.join(part.map_or_else(|| "batch.jsonl".to_owned(), Part::record_name));
        let file = OpenOptions::new().read(true).append(true).create(true).open(&path);
        let file = file.with_context(|| format!("cannot write \"{}\"", path.display()))?;
        // Where the file system has no locks, nothing is checked.
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            bail!("\"{}\": expected no other run with this record, found one", path.display());
        }
        let mut record = Self { folder: folder.to_owned(), path, file, lines: HashMap::new(), unreadable: 0 };
        record.read_others()?;
        record.read_own()?;
        Ok(record)
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The line of a material that need not be made again: one of this name, checksum and options, whose files are all
    /// there with the sizes that they had.
    pub(super) fn finished(&self, name: &str, sha256: Option<&str>, options: &Value) -> Option<&Line> {
        let line = self.lines.get(name)?;
        let End::Finished { outputs, .. } = &line.end else { return None };
        let folder = self.folder.join(name);
        let is_whole = |(file, bytes): (&String, &Value)| {
            fs::metadata(folder.join(file))
                .is_ok_and(|found| found.is_file() && Some(found.len()) == bytes.as_u64())
        };
        let is_same = line.sha256.as_deref() == sha256 && &line.options == options;
        (is_same && outputs.iter().all(is_whole)).then_some(line)
    }

    /// Appends a line, in one piece.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn append(&self, line: &str) -> Result<()> {
        (&self.file)
            .write_all(line.as_bytes())
            .with_context(|| format!("cannot write \"{}\"", self.path.display()))
    }

    /// The records of other parts.
    fn read_others(&mut self) -> Result<()> {
        let unread = |path: &Path| format!("cannot read \"{}\"", path.display());
        let entries = fs::read_dir(&self.folder).with_context(|| unread(&self.folder))?;
        let mut paths = Vec::new();
        for entry in entries {
            paths.push(entry.with_context(|| unread(&self.folder))?.path());
        }
        paths.retain(|path| *path != self.path && is_record(path));
        paths.sort();
        for path in paths {
            // Where locks keep readers out, the record of another run that goes on tells nothing.
            if let Ok(bytes) = fs::read(path) {
                self.read_lines(&bytes);
            }
        }
        Ok(())
    }

    /// The record of this run. A last line that was cut off is ended, so that the next one stands alone.
    fn read_own(&mut self) -> Result<()> {
        let mut bytes = Vec::new();
        let read = self.file.seek(SeekFrom::Start(0)).and_then(|_| self.file.read_to_end(&mut bytes));
        read.with_context(|| format!("cannot read \"{}\"", self.path.display()))?;
        self.read_lines(&bytes);
        if bytes.last().is_some_and(|&byte| byte != b'\n') {
            self.append("\n")?;
        }
        Ok(())
    }

    fn read_lines(&mut self, bytes: &[u8]) {
        for text in bytes.split(|&byte| byte == b'\n').filter(|text| !text.is_empty()) {
            match serde_json::from_slice::<Line>(text) {
                Ok(line) => drop(self.lines.insert(line.name.clone(), line)),
                Err(_) => self.unreadable += 1,
            }
        }
    }
}

fn is_record(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    path.is_file() && name.is_some_and(|name| name.starts_with("batch") && name.ends_with(".jsonl"))
}
