//! Where tests find the shared data.

use std::path::PathBuf;

/// The folder named by `GPBRDF_DATA`, else `../shared/data` beside the workspace; `None`, said aloud, without either.
pub(crate) fn data_dir() -> Option<PathBuf> {
    let named = std::env::var_os("GPBRDF_DATA").map(PathBuf::from);
    let dir = named.unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"));
    if dir.is_dir() {
        return Some(dir);
    }
    eprintln!("skipped: no GPBRDF_DATA and no ../shared/data");
    None
}
