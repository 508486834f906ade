//! `gpbrdf-cli`: Gaussian-process BRDFs from the command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    gpbrdf_app::cli::main()
}
