//! The command line of gpbrdf as a library: the binary only calls [`cli::main`].

#![expect(clippy::doc_markdown, reason = "descriptions of arguments are shown to people as they are")]

pub mod cli;
