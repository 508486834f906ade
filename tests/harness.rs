//! Runs `gpbrdf-cli` in a folder of its own and watches what it leaves there.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// The program under test.
pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_gpbrdf-cli");

/// A temporary folder, and the program run in it.
pub(crate) struct Cli {
    folder: TempDir,
}

/// How one run ended.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Cli {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub(crate) fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file into the folder.
    pub(crate) fn write(&self, name: impl AsRef<Path>, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    pub(crate) fn read(&self, name: impl AsRef<Path>) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// The program with these arguments, in the folder, away from any terminal.
    pub(crate) fn command<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Command {
        let mut command = Command::new(PROGRAM);
        command.args(arguments).current_dir(self.folder.path()).stdin(Stdio::null());
        // Without it a library of the graphics driver complains on standard error.
        if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
            command.env("XDG_RUNTIME_DIR", self.folder.path());
        }
        command
    }

    pub(crate) fn run<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Run {
        Run::from(self.command(arguments).output().unwrap())
    }

    /// Runs a command that must succeed and write nothing to standard error. Returns its standard output.
    pub(crate) fn ok<S: AsRef<OsStr> + std::fmt::Debug>(&self, arguments: &[S]) -> String {
        let run = self.run(arguments);
        assert!(run.code == Some(0) && run.stderr.is_empty(), "{arguments:?}: {run:?}");
        run.stdout
    }

    /// Runs a command that must print one JSON document and nothing else.
    pub(crate) fn json<S: AsRef<OsStr> + std::fmt::Debug>(&self, arguments: &[S]) -> Value {
        serde_json::from_str(&self.ok(arguments)).unwrap()
    }

    /// Runs a command that must fail with exit code 1, one line of error and no change to any file. Returns
    /// that line without `error: `.
    pub(crate) fn fails<S: AsRef<OsStr> + std::fmt::Debug>(&self, arguments: &[S]) -> String {
        let before = self.tree();
        let run = self.run(arguments);
        assert_eq!(run.code, Some(1), "{arguments:?}: {run:?}");
        assert_eq!(run.stdout, "", "{arguments:?}");
        let line = run.stderr.strip_suffix('\n').unwrap_or(&run.stderr);
        assert!(line.starts_with("error: ") && !line.contains('\n'), "{arguments:?}: {line:?}");
        assert_eq!(self.tree(), before, "{arguments:?} left something behind");
        line["error: ".len()..].to_owned()
    }

    /// Runs a command that must be refused with exit code 2 for its usage. Returns the whole message.
    pub(crate) fn misused<S: AsRef<OsStr> + std::fmt::Debug>(&self, arguments: &[S]) -> String {
        let before = self.tree();
        let run = self.run(arguments);
        assert_eq!(run.code, Some(2), "{arguments:?}: {run:?}");
        assert_eq!(run.stdout, "", "{arguments:?}");
        assert_eq!(self.tree(), before, "{arguments:?} left something behind");
        run.stderr
    }

    /// Every file and folder below the folder, with the sizes and times of files.
    fn tree(&self) -> BTreeMap<PathBuf, Option<(u64, std::time::SystemTime)>> {
        let mut found = BTreeMap::new();
        let mut open = vec![self.folder.path().to_owned()];
        while let Some(folder) = open.pop() {
            // A folder that a test has locked cannot be listed.
            for entry in fs::read_dir(&folder).into_iter().flatten() {
                let path = entry.unwrap().path();
                let metadata = fs::symlink_metadata(&path).unwrap();
                if metadata.is_dir() {
                    open.push(path.clone());
                }
                let state = metadata.is_file().then(|| (metadata.len(), metadata.modified().unwrap()));
                found.insert(path, state);
            }
        }
        found
    }

    /// The names in a folder below the folder, sorted.
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl From<Output> for Run {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

/// The shared measurements: `GPBRDF_DATA`, or `../shared/data` beside the workspace. Without them the test is
/// skipped, which a line on standard error says even if the test passes; with `GPBRDF_REQUIRE_DATA=1` it
/// fails.
pub(crate) fn data_dir() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("GPBRDF_DATA").map_or(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    let found = "no GPBRDF_DATA and no ../shared/data";
    assert!(!std::env::var("GPBRDF_REQUIRE_DATA").is_ok_and(|v| v == "1"), "{found}");
    // Not by `eprintln!`, which is captured.
    std::io::stderr().write_all(format!("skipped: {found}\n").as_bytes()).unwrap();
    None
}

/// A metric by its name; one that is infinite is `null`, with a note.
pub(crate) fn metric(report: &Value, name: &str) -> f64 {
    let note = || report["notes"][&format!("metrics.{name}")].as_str()?.parse().ok();
    report["metrics"][name].as_f64().or_else(note).unwrap_or_else(|| panic!("no {name}: {report:#}"))
}
