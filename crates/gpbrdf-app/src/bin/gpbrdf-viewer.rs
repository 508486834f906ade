//! `gpbrdf-viewer`: see a material, its prediction and the error, and change the model live.

use std::process::ExitCode;

fn main() -> ExitCode {
    gpbrdf_app::viewer::main()
}
