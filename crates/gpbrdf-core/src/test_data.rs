//! Where tests find the shared measurements.

use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The folder named by `GPBRDF_DATA`, else `../shared/data` beside the workspace; `None`, with a line that says so, where
/// neither exists.
///
/// # Panics
/// If neither exists and the environment variable `GPBRDF_REQUIRE_DATA` is 1.
pub(crate) fn data_dir() -> Option<PathBuf> {
    let folder = std::env::var_os("GPBRDF_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    let found = "no GPBRDF_DATA and no ../shared/data";
    assert!(!std::env::var("GPBRDF_REQUIRE_DATA").is_ok_and(|value| value == "1"), "{found}");
    // Not by `eprintln!`, which is captured.
    let _ = std::io::stderr().write_all(format!("skipped: {found}\n").as_bytes());
    None
}
