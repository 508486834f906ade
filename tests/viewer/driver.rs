//! The viewer without a window, used by its labels.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use eframe::egui::accesskit::Role;
use eframe::egui::{self, Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};
use gpbrdf_app::viewer::{Settings, Viewer};

/// Longer than any wait on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// The viewer and what drives it.
pub(crate) struct Driver {
    pub(crate) harness: Harness<'static, Option<Viewer>>,
}

impl Driver {
    /// A large window.
    pub(crate) fn new(files: &[PathBuf]) -> Self {
        Self::sized(files, [1440.0, 1000.0])
    }

    /// A window of this size, in points.
    pub(crate) fn sized(files: &[PathBuf], size: [f32; 2]) -> Self {
        Self::set(files, size, "{}")
    }

    /// A window with settings from an earlier run.
    pub(crate) fn with(files: &[PathBuf], size: [f32; 2], settings: Settings) -> Self {
        let files = files.to_vec();
        Self::around(size, move |ctx| Viewer::new(ctx, settings, &files).unwrap())
    }

    /// A window with settings as JSON, whose hint of the first run has been read.
    pub(crate) fn set(files: &[PathBuf], size: [f32; 2], settings: &str) -> Self {
        let mut settings: serde_json::Value = serde_json::from_str(settings).unwrap();
        settings["hint"] = false.into();
        Self::with(files, size, serde_json::from_value(settings).unwrap())
    }

    /// A window around a viewer that `make` makes.
    pub(crate) fn around(size: [f32; 2], make: impl FnOnce(&egui::Context) -> Viewer + 'static) -> Self {
        let mut make = Some(make);
        let builder =
            Harness::builder().with_size(size).with_theme(egui::Theme::Dark).with_step_dt(1.0 / 60.0).wgpu();
        let harness = builder.build_ui_state(
            move |ui, viewer: &mut Option<Viewer>| {
                if let Some(make) = make.take() {
                    *viewer = Some(make(ui.ctx()));
                }
                viewer.as_mut().unwrap().ui(ui);
            },
            None,
        );
        Self { harness }
    }

    pub(crate) fn viewer(&self) -> &Viewer {
        self.harness.state().as_ref().unwrap()
    }

    /// Frames until `done`.
    pub(crate) fn wait(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        self.harness.run_steps(2);
        while !done(self) {
            assert!(start.elapsed() < PATIENCE, "waited in vain: {what}; there is {:?}", self.texts());
            std::thread::sleep(Duration::from_millis(5));
            self.harness.step();
        }
        self.harness.run_steps(2);
    }

    pub(crate) fn fitted(&mut self) {
        self.wait("a fit", |d| d.viewer().is_fitted());
    }

    /// Whether some text on the screen contains `text`.
    pub(crate) fn shows(&self, text: &str) -> bool {
        let contains = |value: Option<String>| value.is_some_and(|v| v.contains(text));
        let mut nodes = self.harness.root().children_recursive();
        nodes.any(|n| contains(n.value()) || contains(n.accesskit_node().label()))
    }

    pub(crate) fn click(&mut self, label: &str) {
        self.harness.get_by_role_and_label(Role::Button, label).click();
        self.harness.run_steps(3);
    }

    pub(crate) fn slide(&mut self, label: &str, value: f64) {
        self.harness.get_by_role_and_label(Role::Slider, label).set_value_accesskit(value);
        self.harness.run_steps(3);
    }

    pub(crate) fn enter(&mut self, label: &str, text: &str) {
        let field = self.harness.get_by_role_and_label(Role::TextInput, label);
        field.set_text_value_accesskit(text);
        self.harness.run_steps(2);
        let field = self.harness.get_by_role_and_label(Role::TextInput, label);
        if field.value().as_deref() != Some(text) {
            field.focus();
            self.harness.run_steps(2);
            self.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
            self.harness.run_steps(1);
            self.harness.get_by_role_and_label(Role::TextInput, label).type_text(text);
            self.harness.run_steps(2);
        }
    }

    /// The log marginal likelihood that is shown.
    pub(crate) fn likelihood(&self) -> f64 {
        let mut labels = self.harness.root().children_recursive().filter_map(|n| n.accesskit_node().label());
        let found = labels.find_map(|l| l.strip_prefix("Log likelihood: ").map(str::to_owned));
        found.unwrap().parse().unwrap()
    }

    pub(crate) fn press(&mut self, key: Key) {
        self.harness.key_press(key);
        self.harness.run_steps(3);
    }

    pub(crate) fn press_with_ctrl(&mut self, key: Key) {
        self.harness.key_press_modifiers(Modifiers::COMMAND, key);
        self.harness.run_steps(3);
    }

    /// All texts of the screen, in order.
    pub(crate) fn texts(&self) -> Vec<String> {
        let nodes = self.harness.root().children_recursive();
        nodes
            .filter(|n| n.accesskit_node().role() == Role::Label)
            .filter_map(|n| n.accesskit_node().label().or_else(|| n.value()))
            .collect()
    }

    /// The text that begins with `start`, without it.
    pub(crate) fn after(&self, start: &str) -> Option<String> {
        self.texts().iter().find_map(|t| t.strip_prefix(start).map(str::to_owned))
    }

    /// The value of a slider.
    pub(crate) fn value(&self, label: &str) -> f64 {
        let slider = self.harness.get_by_role_and_label(Role::Slider, label);
        slider.accesskit_node().numeric_value().unwrap()
    }

    /// The pixels of the window.
    pub(crate) fn picture(&mut self) -> image::RgbaImage {
        self.harness.render().unwrap()
    }

    /// Types a path into the window that asks for one, and lets it be read or written.
    pub(crate) fn give_path(&mut self, path: &Path, button: &str) {
        self.enter("Path", &path.display().to_string());
        self.click(button);
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        if let Some(viewer) = self.harness.state_mut() {
            viewer.close();
        }
    }
}

/// Whether a file is there and holds something.
pub(crate) fn exists(path: &Path) -> bool {
    path.metadata().is_ok_and(|m| m.len() > 0)
}

/// A part of a picture.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the window")]
pub(crate) fn crop(picture: &image::RgbaImage, rect: egui::Rect) -> image::RgbaImage {
    let [x, y, w, h] = [rect.min.x, rect.min.y, rect.width(), rect.height()].map(|v| v as u32);
    image::imageops::crop_imm(picture, x, y, w, h).to_image()
}

/// Width, height and pixels of an EXR file.
pub(crate) fn read_exr(path: &Path) -> (usize, usize, Vec<[f32; 3]>) {
    let raster = gpbrdf_core::formats::read_linear_image(path).unwrap();
    (raster.width(), raster.height(), raster.pixels().to_vec())
}
