//! What the mouse does in the views.

use std::path::PathBuf;

use eframe::egui::{self, Key, Modifiers, PointerButton, Pos2, Vec2};
use egui_kittest::kittest::Queryable;

use super::driver::{Driver, crop};

fn press(driver: &mut Driver, at: Pos2, button: PointerButton, pressed: bool, modifiers: Modifiers) {
    driver
        .harness
        .event_modifiers(egui::Event::PointerButton { pos: at, button, pressed, modifiers }, modifiers);
    driver.harness.run_steps(1);
}

fn drag(driver: &mut Driver, from: Pos2, by: Vec2, button: PointerButton, modifiers: Modifiers) {
    driver.harness.hover_at(from);
    driver.harness.run_steps(1);
    press(driver, from, button, true, modifiers);
    for share in [0.5, 1.0] {
        driver.harness.event_modifiers(egui::Event::PointerMoved(from + share * by), modifiers);
        driver.harness.run_steps(1);
    }
    press(driver, from + by, button, false, modifiers);
    driver.harness.run_steps(2);
}

fn wheel(driver: &mut Driver, at: Pos2, lines: f32) {
    driver.harness.hover_at(at);
    driver.harness.run_steps(1);
    driver.harness.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Line,
        delta: egui::vec2(0.0, lines),
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Unknown,
        modifiers: Modifiers::NONE,
    });
    driver.harness.run_steps(20);
}

fn double_click(driver: &mut Driver, at: Pos2) {
    driver.harness.hover_at(at);
    driver.harness.run_steps(60);
    for _ in 0..2 {
        press(driver, at, PointerButton::Primary, true, Modifiers::NONE);
        press(driver, at, PointerButton::Primary, false, Modifiers::NONE);
    }
    driver.harness.run_steps(2);
}

/// The values of sliders in a menu.
fn read(driver: &mut Driver, menu: &str, names: &[&str]) -> Vec<f64> {
    driver.click(menu);
    let found = names.iter().map(|name| driver.value(name)).collect();
    driver.press(Key::Escape);
    found
}

#[test]
fn the_sphere_turns_zooms_swipes_and_is_reset() {
    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.slide("Samples", 1500.0);
    driver.press(Key::Num4);
    driver.wait("a sphere", |d| d.after("SSIM ").is_some());
    let middle = driver.harness.get_by_label_contains("Sphere view").rect().center();
    drag(&mut driver, middle, egui::vec2(80.0, 40.0), PointerButton::Primary, Modifiers::NONE);
    let turned = read(&mut driver, "Light", &["Turned", "Tilted"]);
    assert!(turned[0] > 10.0 && turned[1] > 5.0, "{turned:?}");
    drag(&mut driver, middle, egui::vec2(60.0, 0.0), PointerButton::Primary, Modifiers::SHIFT);
    assert!(read(&mut driver, "Light", &["Swipe"])[0] > 0.52);
    drag(&mut driver, middle, egui::vec2(60.0, 0.0), PointerButton::Secondary, Modifiers::NONE);
    let zoom = read(&mut driver, "Shape", &["Zoom"])[0];
    assert!(zoom > 1.2, "{zoom}");
    wheel(&mut driver, middle, 3.0);
    let nearer = read(&mut driver, "Shape", &["Zoom"])[0];
    assert!(nearer > 1.05 * zoom, "{nearer} {zoom}");
    double_click(&mut driver, middle);
    let reset = read(&mut driver, "Light", &["Turned", "Tilted", "Swipe"]);
    assert_eq!(reset, [0.0, 0.0, 0.5]);
    assert!((read(&mut driver, "Shape", &["Zoom"])[0] - 1.0).abs() < 1e-6);
}

#[test]
fn an_object_is_orbited_and_its_light_turned_with_ctrl() {
    let settings = "{\"view\": \"3d\", \"panes\": {\"3d\": {\"shape\": \"Knot\"}}}";
    let mut driver = Driver::set(&[PathBuf::from("lambert")], [760.0, 460.0], settings);
    driver.slide("Samples", 1500.0);
    driver.fitted();
    let middle = driver.harness.get_by_label_contains("Object view").rect().center();
    let before = read(&mut driver, "Shape", &["Azimuth", "Elevation"]);
    drag(&mut driver, middle, egui::vec2(60.0, 30.0), PointerButton::Primary, Modifiers::NONE);
    let after = read(&mut driver, "Shape", &["Azimuth", "Elevation"]);
    assert!(after[0] < before[0] - 0.2 && after[1] > before[1] + 0.1, "{before:?} {after:?}");
    drag(&mut driver, middle, egui::vec2(60.0, 0.0), PointerButton::Primary, Modifiers::COMMAND);
    assert!(read(&mut driver, "Light", &["Turned"])[0] > 10.0);
    assert_eq!(read(&mut driver, "Shape", &["Azimuth", "Elevation"]), after);
    double_click(&mut driver, middle);
    assert_eq!(read(&mut driver, "Shape", &["Azimuth", "Elevation"]), before);
}

#[test]
fn slices_pan_and_zoom_together_and_are_reset() {
    let mut driver = Driver::new(&[PathBuf::from("ward")]);
    driver.slide("Samples", 1500.0);
    driver.press(Key::Num2);
    driver.fitted();
    let rect = |d: &Driver, view: &str| d.harness.get_by_label(view).rect();
    let [mine, other] = ["Truth slice", "Sigma slice"].map(|view| rect(&driver, view));
    let shown = |driver: &mut Driver| {
        driver.harness.remove_cursor();
        driver.harness.run_steps(5);
        let picture = driver.picture();
        [mine, other].map(|rect| crop(&picture, rect))
    };
    let gap = |a: &image::RgbaImage, b: &image::RgbaImage| {
        std::iter::zip(a.pixels(), b.pixels()).filter(|(a, b)| a != b).count()
    };
    let whole = shown(&mut driver);
    drag(&mut driver, mine.center(), egui::vec2(50.0, 20.0), PointerButton::Primary, Modifiers::NONE);
    let panned = shown(&mut driver);
    assert!(whole[0] != panned[0] && whole[1] != panned[1], "views are not linked");
    wheel(&mut driver, mine.center(), 4.0);
    let zoomed = shown(&mut driver);
    for (a, b) in std::iter::zip(&zoomed, &panned) {
        assert!(gap(a, b) > 2000, "only {} pixels are not as before", gap(a, b));
    }
    double_click(&mut driver, mine.center());
    let reset = shown(&mut driver);
    for (a, b) in std::iter::zip(&reset, &whole) {
        assert!(gap(a, b) < 200, "{} pixels are not as at first", gap(a, b));
    }
}

#[test]
fn tooltips_tell_the_shortcuts() {
    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.slide("Samples", 1500.0);
    driver.fitted();
    for (label, keys) in [("Optimise", "(O)"), ("Open…", "(Ctrl+O)"), ("Log", "(L)"), ("Plots", "(3)")] {
        let at = driver.harness.get_all_by_label(label).next().unwrap().rect().center();
        driver.harness.hover_at(at);
        driver.harness.run_steps(60);
        driver.wait("a tooltip", |d| d.shows(keys));
        driver.harness.remove_cursor();
        driver.harness.run_steps(5);
    }
}
