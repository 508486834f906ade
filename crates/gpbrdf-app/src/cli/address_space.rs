//! Limits of the address space (`ulimit -v`), as batch systems of clusters set them.
//!
//! Products of matrices reserve buffers for each thread, most of which are never touched: twice the size of the largest
//! cache. Where an allocation fails, the system ends the program, so that it has to be known before whether there is
//! room.

use std::path::Path;

use anyhow::{Result, bail};

/// What the program takes besides those buffers: itself, its tables, the stacks and arenas of threads.
const REST: u64 = 512 << 20;

const MIB: u64 = 1 << 20;

/// What one thread reserves where the size of the largest cache is not known.
const USUAL_BUFFERS: u64 = 128 << 20;

/// How many worker threads fit into the address space of this process, at most `wanted`.
///
/// # Errors
/// There is no room for a single one.
pub(super) fn threads_within_limit(wanted: usize) -> Result<usize> {
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let Some(limit) = limit(&limits) else { return Ok(wanted) };
    let buffers =
        largest_cache(Path::new("/sys/devices/system/cpu/cpu0/cache")).map_or(USUAL_BUFFERS, |size| 2 * size);
    threads_within(limit, buffers, wanted)
}

/// The same for a limit and for the buffers of each thread, in bytes. The main thread computes, too.
fn threads_within(limit: u64, buffers: u64, wanted: usize) -> Result<usize> {
    let fitting = limit.saturating_sub(REST) / buffers.max(1);
    if fitting < 2 {
        bail!(
            "expected an address space of at least {} MiB, found a limit of {} MiB (`ulimit -v`)",
            (REST + 2 * buffers).div_ceil(MIB),
            limit / MIB
        );
    }
    Ok(usize::try_from(fitting - 1).map_or(wanted, |fitting| wanted.min(fitting)))
}

/// The limit in the text of `/proc/self/limits`, in bytes.
fn limit(limits: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Size of the largest cache of a processor, in bytes.
fn largest_cache(folder: &Path) -> Option<u64> {
    let caches = std::fs::read_dir(folder).ok()?.filter_map(Result::ok);
    let sizes = caches.filter_map(|cache| std::fs::read_to_string(cache.path().join("size")).ok());
    sizes.filter_map(|text| Some(1024 * text.trim().strip_suffix('K')?.parse::<u64>().ok()?)).max()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_leaves_fewer_threads_or_none() {
        let text = "Limit                     Soft Limit           Hard Limit           Units     \n\
            Max address space         4294967296           unlimited            bytes     \n";
        assert_eq!(limit(text), Some(4 << 30));
        assert_eq!(limit(&text.replace("4294967296", "unlimited ")), None);
        assert_eq!(limit(""), None);
        // 3.5 GiB for buffers of 0.5 GiB, one of them for the main thread.
        assert_eq!(threads_within(4 << 30, 512 << 20, 16).unwrap(), 6);
        assert_eq!(threads_within(4 << 30, 512 << 20, 4).unwrap(), 4);
        let message = threads_within(200 << 20, 512 << 20, 4).unwrap_err().to_string();
        assert_eq!(
            message,
            "expected an address space of at least 1536 MiB, found a limit of 200 MiB (`ulimit -v`)"
        );
    }

    #[test]
    fn the_largest_cache_is_found() {
        let folder = tempfile::tempdir().unwrap();
        for (name, size) in
            [("index0", "32K\n"), ("index1", "512K\n"), ("index2", "32768K\n"), ("index3", "?\n")]
        {
            std::fs::create_dir(folder.path().join(name)).unwrap();
            std::fs::write(folder.path().join(name).join("size"), size).unwrap();
        }
        assert_eq!(largest_cache(folder.path()), Some(32 << 20));
        assert_eq!(largest_cache(&folder.path().join("none")), None);
    }
}
