//! The viewer driven by its labels, as a user or a screen reader would, without a window.
#![allow(clippy::unwrap_used, reason = "a test that finds nothing to unwrap has failed")]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use eframe::egui::accesskit::Role;
use eframe::egui::{self, Key, Modifiers};
use egui_kittest::kittest::{NodeT, Queryable};
use egui_kittest::{Harness, SnapshotOptions};
use gpbrdf_app::viewer::{Settings, Viewer};

/// Longer than any wait on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

struct Driver {
    harness: Harness<'static, Option<Viewer>>,
}

impl Driver {
    fn new(files: &[PathBuf]) -> Self {
        Self::sized(files, [1440.0, 1000.0])
    }

    fn sized(files: &[PathBuf], size: [f32; 2]) -> Self {
        let files = files.to_vec();
        let harness = Harness::builder().with_size(size).with_theme(egui::Theme::Dark).wgpu().build_ui_state(
            move |ui, viewer: &mut Option<Viewer>| {
                let made = || Viewer::new(ui.ctx(), Settings::default(), &files).unwrap();
                viewer.get_or_insert_with(made).ui(ui);
            },
            None,
        );
        Self { harness }
    }

    fn viewer(&self) -> &Viewer {
        self.harness.state().as_ref().unwrap()
    }

    /// Frames until `done`.
    fn wait(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        self.harness.run_steps(2);
        while !done(self) {
            assert!(start.elapsed() < PATIENCE, "waited in vain: {what}");
            std::thread::sleep(Duration::from_millis(5));
            self.harness.step();
        }
        self.harness.run_steps(2);
    }

    fn fitted(&mut self) {
        self.wait("a fit", |d| d.viewer().is_fitted());
    }

    /// Whether some text on the screen contains `text`.
    fn shows(&self, text: &str) -> bool {
        let contains = |value: Option<String>| value.is_some_and(|v| v.contains(text));
        let mut nodes = self.harness.root().children_recursive();
        nodes.any(|n| contains(n.value()) || contains(n.accesskit_node().label()))
    }

    fn click(&mut self, label: &str) {
        self.harness.get_by_role_and_label(Role::Button, label).click();
        self.harness.run_steps(3);
    }

    fn slide(&mut self, label: &str, value: f64) {
        self.harness.get_by_role_and_label(Role::Slider, label).set_value_accesskit(value);
        self.harness.run_steps(3);
    }

    fn enter(&mut self, label: &str, text: &str) {
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
    fn likelihood(&self) -> f64 {
        let mut labels = self.harness.root().children_recursive().filter_map(|n| n.accesskit_node().label());
        let found = labels.find_map(|l| l.strip_prefix("Log likelihood: ").map(str::to_owned));
        found.unwrap().parse().unwrap()
    }
}

#[test]
fn it_opens_with_a_material_and_refits_when_a_slider_moves() {
    let mut driver = Driver::new(&[]);
    driver.fitted();
    assert!(driver.shows("cherry-235") && driver.shows("36864 samples"));
    let before = driver.viewer().shown_version();
    driver.slide("Samples", 1500.0);
    driver.fitted();
    assert!(driver.viewer().shown_version() > before);
    assert!(!driver.shows("36864 samples"));
    driver.wait("metrics", |d| d.shows(" dB"));

    // By hand: the likelihood falls, and goes back up when it is optimised again.
    let best = driver.likelihood();
    driver.slide("Length scale θh", 3.0);
    driver.fitted();
    assert!(driver.shows("By hand"));
    let worse = driver.likelihood();
    assert!(worse < best, "{worse} {best}");
    driver.click("Optimise");
    driver.fitted();
    assert!(driver.shows("Optimised"));
    let again = driver.likelihood();
    assert!((again - best).abs() < 1e-3 * best.abs(), "{again} {best}");
}

#[test]
fn hovering_a_slice_reads_truth_mean_and_interval() {
    let mut driver = Driver::new(&[]);
    driver.slide("Samples", 1500.0);
    driver.fitted();
    let middle = driver.harness.get_by_label("Prediction slice").rect().center();
    driver.harness.hover_at(middle);
    driver.harness.run_steps(4);
    for name in ["truth", "mean", "95 % from", "95 % to"] {
        assert!(driver.shows(name), "{name}");
    }
    driver.slide("φd", 30.0);
    driver.fitted();
    driver.harness.hover_at(middle + egui::vec2(1.0, 0.0));
    driver.harness.run_steps(4);
    assert!(driver.shows("30.00°"));
}

#[test]
fn a_broken_file_is_named_until_it_is_read_and_nothing_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let broken = folder.path().join("broken.binary");
    std::fs::write(&broken, [90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0, 1, 2, 3]).unwrap();
    let mut driver = Driver::new(&[PathBuf::from("ward"), broken]);
    driver.wait("a message", |d| d.shows("broken.binary"));
    driver.fitted();
    assert!(driver.shows("ward"));
    driver.harness.run_steps(30);
    assert!(driver.shows("broken.binary"));
    driver.click("Dismiss");
    assert!(!driver.shows("broken.binary\": expected"));

    driver.harness.key_press_modifiers(Modifiers::COMMAND, Key::O);
    driver.harness.run_steps(3);
    driver.enter("Path to open", "no/such/file.bsdf");
    driver.click("Open");
    driver.wait("a message", |d| d.shows("cannot read \"no/such/file.bsdf\""));
    assert!(driver.shows("ward"));
}

#[test]
fn materials_are_opened_shown_and_removed() {
    let mut driver = Driver::new(&[PathBuf::from("ward"), PathBuf::from("lambert")]);
    driver.fitted();
    assert!(driver.harness.query_by_label("Show ward").is_some());
    driver.click("Remove lambert");
    driver.fitted();
    assert!(driver.harness.query_by_label("Show lambert").is_none());
    driver.harness.key_press_modifiers(Modifiers::COMMAND, Key::O);
    driver.harness.run_steps(3);
    driver.click("Rough copper (Cook-Torrance)");
    driver.fitted();
    assert!(driver.harness.query_by_label("Show cook-torrance").is_some());
}

fn exists(path: &Path) -> bool {
    path.metadata().is_ok_and(|m| m.len() > 0)
}

#[test]
fn slices_models_and_sessions_are_written_and_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::new(&[PathBuf::from("ward")]);
    driver.slide("Samples", 1500.0);
    driver.fitted();
    let write = |driver: &mut Driver, menu: &str, name: &str| {
        let path = folder.path().join(name);
        driver.click("File");
        driver.click(menu);
        driver.enter("Path", &path.display().to_string());
        driver.click("Write");
        driver.wait("a file", |_| exists(&path));
        driver.wait("a note", |d| d.shows(name));
        path
    };
    let png = write(&mut driver, "Export slices…", "out.png");
    for suffix in ["-truth.exr", "-prediction.exr", "-sigma.exr"] {
        assert!(exists(&png.with_file_name(format!("out{suffix}"))), "{suffix}");
    }
    let model = write(&mut driver, "Save model…", "out.safetensors");
    driver.harness.key_press_modifiers(Modifiers::COMMAND, Key::S);
    driver.harness.run_steps(3);
    let session = folder.path().join("out.json");
    driver.enter("Path", &session.display().to_string());
    driver.click("Write");
    driver.wait("a session", |_| exists(&session));

    let mut driver = Driver::new(&[session]);
    driver.fitted();
    assert!(driver.harness.query_by_label("Show ward").is_some() && !driver.shows("36864 samples"));
    let mut driver = Driver::new(&[model]);
    driver.wait("a model", |d| d.harness.query_by_label("Show ward").is_some());
    driver.fitted();
    assert!(driver.shows("A fitted model from a file."));
}

#[test]
fn keys_hide_panels_and_show_help() {
    let mut driver = Driver::new(&[]);
    driver.fitted();
    driver.harness.key_press(Key::H);
    driver.harness.run_steps(3);
    assert!(driver.shows("Screenshot to PNG and EXR") && driver.shows("Ctrl + click"));
    driver.harness.key_press(Key::H);
    driver.harness.key_press(Key::F1);
    driver.harness.run_steps(3);
    assert!(driver.harness.query_by_label("Optimise").is_none());
    driver.harness.key_press(Key::F1);
    driver.harness.run_steps(3);
    for (key, view) in [(Key::Num3, "Lobe plot"), (Key::Num2, "Truth slice")] {
        driver.harness.key_press(key);
        driver.harness.run_steps(3);
        assert!(driver.harness.query_by_label(view).is_some(), "{view}");
    }
}

/// Renew with `UPDATE_SNAPSHOTS=1`; made with lavapipe.
#[test]
fn pictures_are_as_they_were() {
    let mut driver = Driver::sized(&[], [500.0, 380.0]);
    let options = SnapshotOptions::new().output_path("../../tests/golden").max_failed_pixels(40);
    driver.harness.key_press(Key::F1);
    driver.wait("everything", |d| d.viewer().is_settled());
    driver.harness.run_steps(20);
    driver.harness.snapshot_options("viewer-overview", &options);
    driver.harness.key_press(Key::Num2);
    driver.wait("slices", |d| d.viewer().is_settled());
    driver.harness.run_steps(20);
    driver.harness.snapshot_options("viewer-slices", &options);
}
