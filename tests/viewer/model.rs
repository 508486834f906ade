//! Refits: sliders, choices, cancelling.

use std::time::{Duration, Instant};

use eframe::egui::Key;
use eframe::egui::accesskit::Role;
use egui_kittest::kittest::Queryable;

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
    assert!(start.elapsed() < Duration::from_secs(5));
    assert!(driver.harness.query_by_label("Prediction slice").is_some());
    // The thread is free for what comes next.
    driver.slide("Samples", 60.0);
    driver.fitted();
    assert!(driver.shows("60 samples"));
}
