//! Finds the shared measurements for tests.

use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The folder named by `GPBRDF_DATA`, else `../shared/data` beside the workspace. If neither exists, prints a
/// line that says so and returns `None`.
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
    // Not printed by `eprintln!`, whose output the test harness captures.
    let _ = std::io::stderr().write_all(format!("skipped: {found}\n").as_bytes());
    None
}
