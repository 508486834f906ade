//! Where tests find the shared measurements.

use std::path::{Path, PathBuf};

/// The folder named by `GPBRDF_DATA`, else `../shared/data` beside the workspace; `None`, with a line that
/// says so, where neither exists.
pub(crate) fn data_dir() -> Option<PathBuf> {
    let folder = std::env::var_os("GPBRDF_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("skipped: no GPBRDF_DATA and no ../shared/data");
    None
}
