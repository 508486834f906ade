//! The desktop program: see a material, its prediction and the error, and change the model live.
//!
//! [`Viewer`] is the program without a window, so that tests can drive it; [`main`] puts it into one. All work that
//! takes longer than a frame runs on threads: `fitter` samples, fits and bakes, `slices`, `curves` and `spheres` make
//! pictures. Each takes the newest request and gives up older ones; results come back as events.

mod app;
mod curves;
mod dialogs;
mod document;
mod export;
mod fitter;
mod layout;
mod mailbox;
mod materials_panel;
mod messages;
mod model_panel;
mod plots_panel;
mod scene;
mod session;
mod settings;
mod shortcuts;
mod slices;
mod slices_panel;
mod spec;
mod sphere_panel;
mod spheres;
mod status;
mod widgets;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use eframe::egui;

pub use app::{FrameTimes, Viewer};
pub use settings::Settings;

/// See a measured material, its Gaussian-process prediction and the error, and change the model live.
#[derive(Debug, Parser)]
#[command(name = "gpbrdf-viewer", version, about, max_term_width = 100)]
struct Arguments {
    /// Materials, models and sessions to open: files, or names of built-in materials.
    files: Vec<PathBuf>,
}

/// The viewer in a window of eframe.
struct Window {
    viewer: Viewer,
}

/// Where eframe keeps the settings.
const SETTINGS: &str = "gpbrdf-viewer";

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        self.viewer.ui(ui);
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        eframe::set_value(storage, SETTINGS, self.viewer.settings());
    }
}

/// Runs the program in a window.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let viewport = egui::ViewportBuilder::default()
        .with_title("gpbrdf viewer")
        .with_app_id("gpbrdf-viewer")
        .with_inner_size([1440.0, 900.0])
        .with_min_inner_size([720.0, 480.0])
        .with_drag_and_drop(true);
    let options = eframe::NativeOptions { viewport, ..eframe::NativeOptions::default() };
    let made = eframe::run_native(
        "gpbrdf-viewer",
        options,
        Box::new(move |creation| {
            let settings = creation.storage.and_then(|s| eframe::get_value(s, SETTINGS)).unwrap_or_default();
            let mut viewer = Viewer::new(&creation.egui_ctx, settings, &arguments.files)?;
            if let Some(state) = &creation.wgpu_render_state {
                viewer.use_device(state)?;
            }
            Ok(Box::new(Window { viewer }))
        }),
    );
    match made {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: cannot open a window: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The files that were dropped on the window.
fn dropped_paths(input: &egui::RawInput) -> Vec<PathBuf> {
    input.dropped_files.iter().map(|file| file.path().to_owned()).collect()
}
