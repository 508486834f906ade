//! Planned directions, and files of measurements that change while they are open.

use std::path::Path;

use eframe::egui::Key;
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
