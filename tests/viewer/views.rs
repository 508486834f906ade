//! What the views say and how they share the window.

use std::path::PathBuf;

use eframe::egui::{self, Key};
use egui_kittest::SnapshotOptions;
use egui_kittest::kittest::{NodeT, Queryable};
use gpbrdf_core::{Content, HalfDiff, IntervalOf, Source};

use super::driver::{Driver, exists};

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
fn hovered_values_are_those_of_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ward.safetensors");
    let mut driver = Driver::new(&[PathBuf::from("ward")]);
    driver.fitted();
    driver.click("File");
    driver.click("Save model…");
    driver.give_path(&path, "Write");
    driver.wait("a note", |d| exists(&path) && d.shows("saved model"));
    let source = Source::open(&path).unwrap();
    let Content::Model(model) = &source.content else { panic!("{:?}", source.content) };
    let truth = Source::built_in("ward").unwrap();
    let slice = driver.harness.get_by_label("Prediction slice").rect();
    for shares in [[0.5, 0.5], [0.62, 0.3], [0.4, 0.7]] {
        driver.harness.hover_at(slice.lerp_inside(egui::Vec2::from(shares)));
        driver.harness.run_steps(4);
        let texts = driver.texts();
        // The values are the last texts; other texts may have the same names.
        let texts_from = texts.iter().rposition(|t| t == "θh").unwrap();
        let texts = &texts[texts_from..];
        let read = |name: &str| -> Vec<f64> {
            let at = texts.iter().position(|t| t == name).unwrap_or_else(|| panic!("no {name} in {texts:?}"));
            let numbers = texts[at + 1].split_whitespace();
            numbers.map(|x| x.trim_end_matches('°').parse().unwrap()).collect()
        };
        let angle = |name: &str| -> f64 {
            let at = texts.iter().position(|t| t == name).unwrap();
            texts[at + 1].trim_end_matches('°').parse::<f64>().unwrap().to_radians()
        };
        let angles = HalfDiff { theta_h: angle("θh"), theta_d: angle("θd"), phi_d: angle("φd") };
        let expected = model.predict(&[angles], IntervalOf::Observation).unwrap()[0];
        let pairs = [
            ("truth", truth.brdf().unwrap().eval_half_diff(angles)),
            ("mean", expected.mean),
            ("95 % from", expected.lower),
            ("95 % to", expected.upper),
        ];
        for (name, expected) in pairs {
            for (a, b) in std::iter::zip(read(name), expected) {
                // Tables are interpolated, angles and values rounded.
                assert!((a - b).abs() < 0.01 * b.abs() + 1e-5, "{name} at {angles:?}: {a}, not {b}");
            }
        }
    }
}

#[test]
fn nothing_is_cut_in_small_windows_and_with_large_text() {
    // 1600 x 1000 pixels at 125 % and at 200 %, a laptop, and the smallest window.
    for size in [[1280.0, 800.0], [800.0, 500.0], [1152.0, 720.0], [720.0, 480.0]] {
        let mut driver = Driver::sized(&[PathBuf::from("lambert")], size);
        driver.slide("Samples", 1500.0);
        driver.fitted();
        let window = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::Vec2::from(size));
        let whole = |driver: &Driver, view: &str| {
            let rect = driver.harness.get_by_label_contains(view).rect();
            assert!(window.contains_rect(rect), "{view} at {rect} in {size:?}");
            assert!(rect.width().min(rect.height()) > 80.0, "{view} at {rect} in {size:?}");
            for node in driver.harness.root().children_recursive() {
                let node = node.accesskit_node();
                let Some(bounds) = node.bounding_box() else { continue };
                let input = egui::accessibility::is_input(node.role());
                assert!(
                    !input || bounds.x1 <= f64::from(size[0]) + 0.5,
                    "{:?} at {bounds:?} in {size:?}",
                    node.label()
                );
            }
        };
        driver.press(Key::Num1);
        let tabs = [("Material", "Sphere view"), ("Curves", "Lobe plot"), ("Images", "Prediction slice")];
        if driver.harness.query_by_label("Curves").is_some() {
            for (tab, view) in tabs {
                driver.harness.get_by_label(tab).click();
                driver.harness.run_steps(3);
                whole(&driver, view);
            }
        } else {
            for (_, view) in tabs {
                whole(&driver, view);
            }
        }
        for (key, view) in [(Key::Num2, "Sigma slice"), (Key::Num3, "Lobe plot"), (Key::Num4, "Sphere view")]
        {
            driver.press(key);
            whole(&driver, view);
        }
    }
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
    let mut driver = Driver::sized(&[], [930.0, 660.0]);
    let options = SnapshotOptions::new().output_path("../../tests/golden").max_failed_pixels(40);
    let compare = |driver: &mut Driver, name: &str| {
        driver.wait("everything", |d| d.viewer().is_settled());
        driver.harness.run_steps(20);
        // A smaller picture shows the layout and every image, and takes few bytes in the repository.
        let picture = driver.picture();
        let size = [picture.width() * 2 / 5, picture.height() * 2 / 5];
        let filter = image::imageops::FilterType::Triangle;
        let small = image::imageops::resize(&picture, size[0], size[1], filter);
        egui_kittest::image_snapshot_options(&small, name, &options);
        let golden = format!("{}/../../tests/golden/{name}.png", env!("CARGO_MANIFEST_DIR"));
        assert!(std::fs::metadata(golden).unwrap().len() < 64 << 10, "{name} is too large");
    };
    driver.press(Key::F1);
    compare(&mut driver, "viewer-overview");
    driver.press(Key::Num2);
    compare(&mut driver, "viewer-slices");
}
