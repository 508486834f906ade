//! The fuzzer of the reader that the program is named after.

#![no_main]

#[path = "readers.rs"]
mod readers;

use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    static READER: OnceLock<readers::Reader> = OnceLock::new();
    let reader = READER.get_or_init(|| {
        let name = env!("CARGO_BIN_NAME");
        let found = readers::READERS.iter().find(|(known, _)| *known == name);
        found.unwrap_or_else(|| panic!("no reader is called {name}")).1
    });
    reader(bytes);
});
