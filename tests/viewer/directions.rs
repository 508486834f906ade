//! Planned directions, and files of measurements that change while they are open.

use std::path::Path;

use eframe::egui::{self, Key};
use egui_kittest::kittest::Queryable;
use gpbrdf_core::formats::write_samples_csv;
use gpbrdf_core::{Layout, SampleSet, Source};

use super::driver::{Driver, exists};

/// Measurements of a built-in material in random directions.
fn write_samples(path: &Path, count: usize) {
    let source = Source::built_in("ward").unwrap();
    let samples = SampleSet::measure(source.brdf().unwrap(), &Layout::Hemisphere { count, seed: 3 });
    write_samples_csv(path, &samples.unwrap()).unwrap();
}

/// The expected error now and after the plan, in percent.
fn errors(driver: &Driver) -> Option<[f64; 2]> {
    let text = driver.after("expected error ")?;
    let mut numbers = text.split(' ').filter_map(|word| word.parse::<f64>().ok());
    Some([numbers.next()?, numbers.next()?])
}

#[test]
fn what_to_measure_next_is_planned_listed_and_exported() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("measured.csv");
    write_samples(&file, 15);
    let mut driver = Driver::new(&[file]);
    driver.fitted();
    driver.press(Key::Num5);
    driver.wait("a plan", |d| errors(d).is_some() && d.shows("Hemisphere, 10 planned directions"));
    let [now, then] = errors(&driver).unwrap();
    assert!(then < 0.9 * now && then > 0.0, "{now} {then}");
    assert!(driver.shows("What to measure next:") && driver.shows("left out: median error"));

    driver.slide("Plan", 4.0);
    driver.wait("a shorter plan", |d| d.shows("Hemisphere, 4 planned directions"));
    let [_, with_fewer] = errors(&driver).unwrap();
    assert!(with_fewer > then, "{with_fewer} {then}");

    let plan = folder.path().join("plan.csv");
    driver.click("File");
    driver.click("Export planned directions…");
    driver.give_path(&plan, "Write");
    driver.wait("a file", |_| exists(&plan));
    let text = std::fs::read_to_string(&plan).unwrap();
    let rows: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(rows[0], "theta_i,phi_i,theta_o,phi_o");
    assert_eq!(rows.len(), 5, "{text}");
    // With values it is a file of samples.
    let filled: Vec<String> =
        rows.iter().zip(["value", "1", "2", "3", "4"]).map(|(row, v)| format!("{row},{v}")).collect();
    std::fs::write(&plan, filled.join("\n")).unwrap();
    assert_eq!(Source::open(&plan).unwrap().samples().unwrap().len(), 4);
}

#[test]
fn measurements_and_the_lobe_are_shown_with_their_values() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("measured.csv");
    let rows: String = [0, 20, 40, 60]
        .iter()
        .map(|theta| format!("30,0,{theta},180,{}\n50,0,{theta},90,0.5\n", 1.0 + f64::from(*theta) / 100.0))
        .collect();
    std::fs::write(&file, format!("theta_i,phi_i,theta_o,phi_o,f\n{rows}")).unwrap();
    let mut driver = Driver::new(&[file]);
    driver.fitted();
    driver.press(Key::Num6);
    driver.slide("Light θi", 30.0);
    driver.wait("the measurements", |d| d.shows("Measured directions of measured, 4 shown"));
    assert!(driver.shows("Lobe of the prediction"));
    driver.slide("Light θi", 50.0);
    assert!(driver.shows("Measured directions of measured, 4 shown"));
    driver.slide("Light θi", 80.0);
    assert!(driver.shows("Measured directions of measured, 0 shown") && driver.shows("move the light"));
    // In the middle of the lobe there is a direction, whose values are read.
    driver.slide("Light θi", 30.0);
    driver.wait("sigma", |d| d.shows("shell: up to 97.5 %"));
    let rect = driver.harness.get_by_label_contains("Lobe in 3-D").rect();
    let before = driver.picture();
    for share in [0.5, 0.45, 0.4, 0.55] {
        driver.harness.hover_at(rect.lerp_inside(egui::vec2(0.5, share)));
        driver.harness.run_steps(4);
        if driver.shows("f cos θo") && driver.shows("95 %") {
            break;
        }
    }
    assert!(driver.texts().iter().any(|text| text.ends_with(" 1/sr")), "{:?}", driver.texts());
    driver.harness.get_by_label_contains("Lobe in 3-D").focus();
    driver.harness.run_steps(3);
    driver.press(Key::ArrowRight);
    assert!(driver.picture() != before);
}

#[test]
fn a_file_that_changes_is_read_and_fitted_again_and_a_broken_one_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("measured.csv");
    write_samples(&file, 15);
    let mut driver = Driver::new(std::slice::from_ref(&file));
    driver.fitted();
    let before = driver.likelihood();
    write_samples(&file, 18);
    driver.wait("a message", |d| d.shows("measured: read again, 18 samples"));
    driver.fitted();
    assert_ne!(driver.likelihood(), before);

    let known = driver.likelihood();
    std::fs::write(&file, "theta_i,phi_i,theta_o,phi_o,f\n10,0,what,180,1\n").unwrap();
    driver.wait("a message", |d| d.shows("what it said before is kept"));
    driver.fitted();
    assert_eq!(driver.likelihood(), known);
}
