//! The desktop program: see a material, its prediction and the error, and change the model live.
//!
//! [`Viewer`] is the program without a window, so that tests can drive it; [`main`] puts it into one.
//! `state/` is what is open, `work/` is what threads do, and `ui/` draws. All work that takes longer than a
//! frame runs on threads: one samples, fits and bakes, others make pictures. Each serves the newest request
//! and drops older ones. The window is made of panes (`ui/pane.rs`), each of which keeps its own state and
//! its own worker.

mod app;
mod state;
mod ui;
mod work;

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Parser;
use eframe::egui;

pub use app::{FrameTimes, Viewer};
pub use state::settings::Settings;

/// What `--help` says after the arguments.
const HELP: &str = "\
What to do first:
  gpbrdf-viewer                        a built-in material, lit; everything can be tried on it
  gpbrdf-viewer measured.csv           your measurements: the material that they make, and what to measure next
  gpbrdf-viewer satin.bsdf ward        a file beside a built-in material (Materials in the menu has all names)
  gpbrdf-viewer all.json               a session, as it was saved

In the window: H shows all keys, Ctrl+O opens more, 1 to 6 choose a view, Escape cancels what is running.
Angles are in degrees, BRDF values in 1/sr. Settings are kept from run to run. For work without a window there is
gpbrdf-cli.";

/// A window on measured materials: what a Gaussian process makes of few measurements, lit, with its error bar, beside
/// the truth where that is known. The model can be changed while you look.
#[derive(Debug, Parser)]
#[command(
    name = "gpbrdf-viewer",
    version,
    about = "A window on measured materials: what a Gaussian process makes of them, lit, with its error bar",
    long_about,
    after_help = HELP,
    max_term_width = 120
)]
struct Arguments {
    /// Materials, models, sessions, environment maps and meshes to open, whichever each file holds, or names of
    /// built-in materials; without any, one built-in material.
    files: Vec<PathBuf>,
    /// Whether open files of measurements are read again when they change, so that a measurement that is added to one
    /// is fitted at once.
    #[arg(long, value_name = "true|false", default_value_t = true, action = clap::ArgAction::Set)]
    watch: bool,
}

/// Whether content is a session that the viewer reads; `path` stands for its file.
///
/// # Errors
/// The content is no session, or one of a newer version.
pub fn check_session(bytes: &[u8], path: impl AsRef<Path>) -> anyhow::Result<()> {
    let folder = path.as_ref().parent().unwrap_or(Path::new(""));
    state::session::Session::parse(bytes, folder).map(drop)
}

/// The viewer in a window of eframe.
struct Window {
    viewer: Option<Viewer>,
    /// Where the viewer is put when its window closes for a new one.
    kept: Rc<RefCell<Option<Viewer>>>,
}

/// Where eframe keeps the settings.
const SETTINGS: &str = "gpbrdf-viewer";

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        let Some(viewer) = &mut self.viewer else { return };
        if let Some(state) = frame.wgpu_render_state() {
            // Only polling reports a loss.
            let _status = state.device.poll(eframe::wgpu::PollType::Poll);
        }
        if viewer.has_lost_device() {
            // Painting without a device would end the program.
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        } else {
            viewer.ui(ui);
        }
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        if let Some(viewer) = &self.viewer {
            viewer.settings().store(storage, SETTINGS);
        }
    }

    fn on_exit(&mut self) {
        if let Some(viewer) = &mut self.viewer {
            viewer.close();
        }
        *self.kept.borrow_mut() = self.viewer.take().filter(Viewer::has_lost_device);
    }
}

/// After a device that is lost this soon no other one is opened.
const SOON: Duration = Duration::from_secs(5);

/// Runs the program in a window, and in another one with what was open when the graphics device is lost.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let kept = Rc::new(RefCell::new(None));
    loop {
        let start = Instant::now();
        if let Err(error) = run(&arguments, &kept) {
            eprintln!("error: cannot open a window: {}", cause(&error.to_string()));
            return ExitCode::FAILURE;
        }
        let lost = kept.borrow().as_ref().and_then(Viewer::loss);
        let Some(message) = lost else { return ExitCode::SUCCESS };
        if start.elapsed() < SOON {
            eprintln!("error: {message}");
            return ExitCode::FAILURE;
        }
    }
}

/// What the system said, without the place in the sources of winit where it was heard:
/// `os error at FILE:LINE: CAUSE`.
fn cause(error: &str) -> &str {
    let placed = error.split_once("os error at ").and_then(|(_, rest)| rest.split_once(": "));
    placed.map_or(error, |(_place, cause)| cause).trim_end_matches('.')
}

/// One window, until it is closed. It goes on with the viewer in `kept`, and leaves its own there when its
/// device is lost.
fn run(arguments: &Arguments, kept: &Rc<RefCell<Option<Viewer>>>) -> eframe::Result {
    let viewport = egui::ViewportBuilder::default()
        .with_title("gpbrdf viewer")
        .with_app_id("gpbrdf-viewer")
        .with_inner_size([1440.0, 900.0])
        .with_min_inner_size([720.0, 480.0])
        .with_drag_and_drop(true);
    let mut options = eframe::NativeOptions { viewport, ..eframe::NativeOptions::default() };
    if let eframe::egui_wgpu::WgpuSetup::CreateNew(setup) = &mut options.wgpu_options.wgpu_setup {
        let usual = Arc::clone(&setup.device_descriptor);
        setup.device_descriptor = Arc::new(move |adapter| eframe::wgpu::DeviceDescriptor {
            memory_hints: eframe::wgpu::MemoryHints::MemoryUsage,
            ..usual(adapter)
        });
    }
    let made = |creation: &eframe::CreationContext<'_>| {
        let settings = creation.storage.map(|s| Settings::load(s, SETTINGS)).unwrap_or_default();
        let viewer = match kept.borrow_mut().take() {
            Some(old) => Viewer::reopened(&creation.egui_ctx, old)?,
            None => {
                let settings = Settings { watch: arguments.watch, ..settings };
                Viewer::new(&creation.egui_ctx, settings, &arguments.files)?
            }
        };
        if let Some(state) = &creation.wgpu_render_state {
            viewer.watch_device(state);
        }
        Ok(Box::new(Window { viewer: Some(viewer), kept: Rc::clone(kept) }) as Box<dyn eframe::App>)
    };
    eframe::run_native("gpbrdf-viewer", options, Box::new(made))
}

/// The files that were dropped on the window.
fn dropped_paths(input: &egui::RawInput) -> Vec<PathBuf> {
    input.dropped_files.iter().map(|file| file.path().to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_cause_of_an_error_is_told_without_places_in_sources() {
        let said = "winit EventLoopError: os error at /a b/winit-0.30/mod.rs:765: DISPLAY is not set.";
        assert_eq!(cause(said), "DISPLAY is not set");
        assert_eq!(cause("Found no graphics adapter: none"), "Found no graphics adapter: none");
    }

    #[test]
    fn its_help_is_its_own() {
        let help = Arguments::command().render_long_help().to_string();
        for part in ["gpbrdf-viewer measured.csv", "Ctrl+O", "--watch", "degrees", "1/sr"] {
            assert!(help.contains(part), "{part} is not in {help}");
        }
        assert!(!help.contains("gpbrdf-cli bake"));
        assert!(help.lines().all(|line| line.chars().count() <= 120), "{help}");
    }
}
