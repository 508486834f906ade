//! The command line of gpbrdf as a library: the binary only calls [`cli::main`].

pub mod cli;
