//! Damaged files of every kind are accepted or refused: no reader panics, and none takes memory that its file does not
//! account for. With `GPBRDF_CORPUS=FOLDER` it writes the files to start from, for fuzzers, and damages none.
#![allow(clippy::unwrap_used, reason = "tests state exact expectations")]

#[path = "readers/corpus.rs"]
mod corpus;
#[path = "readers/damage.rs"]
mod damage;
#[path = "../fuzz/readers.rs"]
mod functions;

use std::panic::{AssertUnwindSafe, catch_unwind};

use functions::READERS;
use peak_alloc::PeakAlloc;

/// Counts what is allocated by this program.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Bytes beyond the size of a file that a reader may hold while it refuses the file.
const SPARE: usize = 64 << 20;

/// Damaged copies of each file; `GPBRDF_COPIES` asks for another number.
const COPIES: usize = 2000;

/// The first bytes, most of which are headers, are damaged more often.
const HEAD: usize = 400;

/// Calls a reader and checks what it takes. Returns whether the bytes were accepted.
fn check(name: &str, reader: functions::Reader, bytes: &[u8], what: &str) -> bool {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let accepted = catch_unwind(AssertUnwindSafe(|| reader(bytes)));
    let held = MEMORY.peak_usage().saturating_sub(before);
    let keep = || {
        let path = std::env::temp_dir().join(format!("gpbrdf-{name}.bin"));
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let Ok(accepted) = accepted else { panic!("{name}: panic on {what}: {}", keep().display()) };
    let most = 2 * bytes.len() + SPARE;
    assert!(accepted || held <= most, "{name}: {held} bytes on {what}: {}", keep().display());
    accepted
}

/// One test, as it counts the memory of the whole program.
#[test]
fn no_reader_panics_or_takes_more_memory_than_a_file_accounts_for() {
    let given = std::env::var("GPBRDF_COPIES").ok().and_then(|number| number.parse().ok());
    let copies = given.unwrap_or(COPIES);
    let folder = std::env::var_os("GPBRDF_CORPUS").map(std::path::PathBuf::from);
    for (name, reader) in READERS {
        let files = corpus::files(name);
        assert!(!files.is_empty(), "{name}");
        for (i, bytes) in files.iter().enumerate() {
            if let Some(folder) = &folder {
                std::fs::create_dir_all(folder.join(name)).unwrap();
                std::fs::write(folder.join(name).join(format!("{i}")), bytes).unwrap();
            }
            let start = std::time::Instant::now();
            assert!(check(name, reader, bytes, "the whole file"), "{name}: file {i} is refused");
            if folder.is_some() {
                continue;
            }
            let mut refused = 0;
            // A table of 35 MB is not changed as often.
            let copies = if bytes.len() > 1 << 20 { copies.div_ceil(400) } else { copies };
            for (k, copy) in damage::copies(bytes, HEAD, 1 + i as u64, copies).enumerate() {
                refused += usize::from(!check(name, reader, &copy, &format!("copy {k} of file {i}")));
            }
            eprintln!("{name} {i}: {refused} of {copies} refused, {:.2} s", start.elapsed().as_secs_f64());
            assert!(refused > 0, "{name}: no damage to file {i} is found");
        }
    }
}
