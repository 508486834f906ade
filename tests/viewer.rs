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

#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|e| e.to_string())
    }
}

#[test]
fn dropped_files_are_opened_once_and_stay_among_the_recent_ones() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dropped.safetensors");
    let table = gpbrdf_core::Source::built_in("red-plastic").unwrap().table().unwrap().into_owned();
    let options = gpbrdf_core::TableFitOptions {
        size: gpbrdf_core::InducingSize::Shape([6, 5, 4]),
        ..gpbrdf_core::TableFitOptions::default()
    };
    let provenance = gpbrdf_core::Provenance { material: "squeezed".into(), ..Default::default() };
    let (model, _) = gpbrdf_core::fit_table(&table, &options, provenance).unwrap();
    std::fs::write(&path, model.to_bytes().unwrap()).unwrap();

    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.fitted();
    driver.harness.input_mut().dropped_files.push(std::sync::Arc::new(Dropped(path.clone())));
    driver.wait("the dropped file", |d| d.harness.query_by_label("Show squeezed").is_some());
    driver.fitted();
    assert!(driver.shows("A fitted model from a file.") && driver.shows("Compressed, on inducing lattices"));
    assert!(driver.harness.query_by_label("Prediction slice").is_some());
    assert!(driver.harness.query_by_label("Truth slice").is_none());
    driver.wait("sigma", |d| d.harness.query_by_label("Sigma slice").is_some());
    driver.click("File");
    driver.harness.get_by_label_contains("Recent").hover();
    driver.harness.run_steps(3);
    driver.harness.get_by_label_contains("Recent").click();
    driver.harness.run_steps(3);
    assert!(driver.shows(&path.display().to_string()));
}

#[test]
fn kernels_are_chosen_per_axis_and_targets_change() {
    let mut driver = Driver::new(&[]);
    driver.slide("Samples", 1500.0);
    driver.fitted();
    let choose = |driver: &mut Driver, what: &str, option: &str| {
        driver.harness.get_by_role_and_label(Role::ComboBox, what).click();
        driver.harness.run_steps(3);
        driver.harness.get_by_label(option).click();
        driver.harness.run_steps(3);
        driver.fitted();
        driver.likelihood()
    };
    let before = driver.likelihood();
    let rough = choose(&mut driver, "Kernel θd", "Matérn 1/2");
    assert!(rough < before, "{rough} {before}");
    choose(&mut driver, "Kernel φd", "Rational quadratic");
    assert!(driver.shows("Mixture α φd"));
    let linear = choose(&mut driver, "Target", "f");
    assert!(linear < rough, "{linear} {rough}");
    choose(&mut driver, "Prior mean", "Zero");
    assert!(driver.shows("Optimised"));
}

#[test]
fn a_long_fit_is_cancelled_and_the_last_result_stays() {
    let mut driver = Driver::new(&[]);
    driver.slide("Samples", 1500.0);
    driver.fitted();
    driver.harness.get_by_role_and_label(Role::ComboBox, "Layout").click();
    driver.harness.run_steps(3);
    driver.harness.get_by_label("Random directions").click();
    driver.harness.run_steps(3);
    driver.slide("Samples", 3000.0);
    driver.wait("a search", |d| d.shows("Fitting"));
    let start = Instant::now();
    driver.harness.key_press(Key::Escape);
    driver.wait("the end", |d| d.shows("Cancelled"));
    assert!(start.elapsed() < Duration::from_secs(5));
    assert!(driver.harness.query_by_label("Prediction slice").is_some());
    // The thread is free for what comes next.
    driver.slide("Samples", 60.0);
    driver.fitted();
    assert!(driver.shows("60 samples"));
}

#[test]
fn a_number_goes_back_to_its_default() {
    let mut driver = Driver::new(&[]);
    driver.slide("φd", 30.0);
    let value = |d: &Driver| {
        let slider = d.harness.get_by_role_and_label(Role::Slider, "φd");
        slider.accesskit_node().numeric_value().unwrap()
    };
    assert!((value(&driver) - 30.0).abs() < 1e-9);
    driver.harness.get_by_role_and_label(Role::Slider, "φd").click_modifiers(Modifiers::COMMAND);
    driver.harness.run_steps(3);
    assert!((value(&driver) - 90.0).abs() < 1e-9, "{}", value(&driver));
}

#[test]
fn every_control_has_a_name() {
    let mut driver = Driver::new(&[PathBuf::from("ward"), PathBuf::from("lambert")]);
    driver.fitted();
    for key in [Key::Num1, Key::Num2, Key::Num3, Key::Num4] {
        driver.harness.key_press(key);
        driver.harness.run_steps(3);
        for node in driver.harness.root().children_recursive() {
            let node = node.accesskit_node();
            if egui::accessibility::is_input(node.role()) {
                let named = node.label().is_some_and(|l| !l.trim().is_empty());
                assert!(named, "{:?} with value {:?}", node.role(), node.value());
            }
        }
    }
}

#[test]
fn large_text_and_small_windows_show_every_view() {
    for size in [[1280.0, 800.0], [800.0, 500.0], [500.0, 300.0]] {
        let mut driver = Driver::sized(&[PathBuf::from("lambert")], size);
        driver.fitted();
        for (key, view) in
            [(Key::Num1, "Lobe plot"), (Key::Num2, "Prediction slice"), (Key::Num3, "Lobe plot")]
        {
            driver.harness.key_press(key);
            driver.harness.run_steps(3);
            let rect = driver.harness.get_by_label(view).rect();
            assert!(rect.width() > 60.0 && rect.height() > 60.0, "{view} {rect} in {size:?}");
        }
    }
}

#[test]
fn the_sphere_is_written_and_curves_of_all_kinds_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.slide("Samples", 1500.0);
    driver.wait("the sphere", |d| d.viewer().is_settled());
    driver.click("File");
    driver.click("Export sphere…");
    let path = folder.path().join("ball.png");
    driver.enter("Path", &path.display().to_string());
    driver.click("Write");
    driver.wait("pictures", |_| exists(&path));
    for name in ["ball-truth.exr", "ball-prediction.exr"] {
        assert!(exists(&folder.path().join(name)), "{name}");
    }
    for name in ["Over θh", "Over θd", "Over φd", "Albedo"] {
        driver.harness.get_by_label(name).click();
        driver.harness.run_steps(4);
        assert!(driver.harness.query_by_label(&format!("{name} plot")).is_some(), "{name}");
    }
}

/// Renew with `UPDATE_SNAPSHOTS=1`; made with lavapipe.
#[test]
fn pictures_are_as_they_were() {
    let mut driver = Driver::sized(&[], [930.0, 660.0]);
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
