//! `gpbrdf-cli`.
fn main() {}
