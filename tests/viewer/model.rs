//! Refits: sliders, choices, cancelling.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use eframe::egui::Key;
use eframe::egui::accesskit::Role;
use egui_kittest::kittest::Queryable;
use gpbrdf_core::formats::write_samples_csv;
use gpbrdf_core::{Layout, SampleSet, Source};

use super::driver::Driver;

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
    assert!(start.elapsed() < Duration::from_secs(15), "{:?}", start.elapsed());
    assert!(driver.harness.query_by_label("Prediction slice").is_some());
    assert!(driver.shows("cherry-235 is cancelled"));
    // It can be tried again, and the thread is free for what comes next.
    driver.click("Try again");
    driver.wait("the search again", |d| d.shows("Fitting"));
    driver.slide("Samples", 60.0);
    driver.fitted();
    assert!(driver.shows("60 samples"));
}

#[test]
fn a_slow_material_holds_up_no_other_and_says_how_far_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let many = folder.path().join("many.csv");
    let source = Source::built_in("ward").unwrap();
    // Its fit alone takes several times as long as everything of the others.
    let layout = Layout::Hemisphere { count: 20_000, seed: 1 };
    let samples = SampleSet::measure(source.brdf().unwrap(), &layout).unwrap();
    write_samples_csv(&many, &samples).unwrap();
    let quick = ["ward", "lambert", "cook-torrance"];
    let mut files: Vec<PathBuf> = quick.iter().map(PathBuf::from).collect();
    files.insert(1, many);
    let mut driver = Driver::new(&files);
    driver.wait("the slow one", |d| d.harness.query_by_label("Show many").is_some());
    driver.wait("the quick ones", |d| d.shows("3 of 4 fitted"));
    // The file is read last, so it is selected.
    driver.wait("its share", |d| d.texts().iter().any(|t| t.starts_with("Fitting") && t.contains('%')));
    driver.wait("the time that is left", |d| d.shows("s left") || d.shows("min left"));
    assert!(driver.shows("3 of 4 fitted"));
    driver.click("Cancel");
    driver.wait("the end", |d| d.shows("Cancelled"));
    // Where there is no picture yet, its place says why and offers to go on.
    driver.harness.get_by_role_and_label(Role::Button, "Fit it again").click();
    driver.wait("the search again", |d| d.shows("Fitting"));
    driver.click("Cancel");
}
