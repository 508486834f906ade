//! Where tests find the shared data.

use std::path::{Path, PathBuf};

/// The folder named by `GPBRDF_DATA`, else `../shared/data` beside the workspace; `None`, with a line on
/// standard error, where neither exists.
pub(crate) fn data_dir() -> Option<PathBuf> {
    let named = std::env::var_os("GPBRDF_DATA").map(PathBuf::from);
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let found = named.into_iter().chain([beside]).find(|path| path.is_dir());
    if found.is_none() {
        eprintln!("skipped: no GPBRDF_DATA and no ../shared/data");
    }
    found
}
