//! Every control: named, reached by keys, back to its default.

use std::path::PathBuf;

use eframe::egui::accesskit::Role;
use eframe::egui::{self, Key, Modifiers};
use egui_kittest::kittest::{NodeT, Queryable};

use super::driver::Driver;

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
    for key in [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6] {
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

/// Everything that opens out of a button, with the key that shows where the button is.
const OPENED: [(Key, &[&str]); 6] = [
    (Key::Num1, &["File"]),
    (Key::Num1, &["Materials"]),
    (Key::Num1, &["View"]),
    (Key::Num2, &["Show"]),
    (Key::Num4, &["Shape"]),
    (Key::Num4, &["Light"]),
];

/// The controls that can be used: node, role and name.
fn controls(driver: &Driver) -> Vec<(String, Role, String)> {
    let nodes = driver.harness.root().children_recursive();
    let used = nodes.filter(|n| {
        let node = n.accesskit_node();
        egui::accessibility::is_input(node.role()) && !node.is_disabled()
    });
    used.map(|n| {
        let node = n.accesskit_node();
        (format!("{:?}", node.id()), node.role(), node.label().unwrap_or_default())
    })
    .collect()
}

#[test]
fn menus_and_windows_have_names_too_and_escape_closes_them() {
    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.slide("Samples", 1500.0);
    driver.fitted();
    let named = |driver: &Driver, least: usize, what: &str| {
        let all = controls(driver);
        assert!(all.len() >= least, "{what}: {}", all.len());
        for (_, role, label) in &all {
            assert!(!label.trim().is_empty(), "{what}: {role:?} has no name");
        }
        all.len()
    };
    for (key, path) in OPENED {
        driver.press(key);
        let before = named(&driver, 10, "view");
        for button in path {
            driver.click(button);
        }
        named(&driver, before + 2, path[0]);
        driver.press(Key::Escape);
        assert_eq!(named(&driver, 10, "view"), before, "{path:?} is open still");
    }
    for key in [Key::O, Key::S] {
        let before = controls(&driver).len();
        driver.press_with_ctrl(key);
        named(&driver, before + 2, "window");
        driver.press(Key::Escape);
        driver.harness.run_steps(10);
        assert_eq!(controls(&driver).len(), before, "{key:?}");
    }
}

#[test]
fn tab_reaches_every_control() {
    let mut driver = Driver::new(&[PathBuf::from("ward"), PathBuf::from("lambert")]);
    driver.slide("Samples", 1500.0);
    driver.fitted();
    for key in [Key::Num1, Key::Num2, Key::Num3, Key::Num4] {
        driver.press(key);
        let wanted = controls(&driver);
        let mut reached = std::collections::HashSet::new();
        let views = ["Sphere view", "Prediction slice", "Lobe plot"];
        let mut seen = [false; 3];
        for _ in 0..2 * wanted.len() + 40 {
            driver.harness.key_press(Key::Tab);
            driver.harness.run_steps(2);
            let focused =
                driver.harness.root().children_recursive().find(|n| n.accesskit_node().is_focused());
            let Some(focused) = focused else { continue };
            let node = focused.accesskit_node();
            reached.insert(format!("{:?}", node.id()));
            let label = node.label().unwrap_or_default();
            for (seen, view) in std::iter::zip(&mut seen, views) {
                *seen |= label.starts_with(view);
            }
        }
        // A button to cancel work goes with the work.
        let lasting: std::collections::HashSet<_> =
            controls(&driver).into_iter().map(|(id, ..)| id).collect();
        let missed: Vec<_> =
            wanted.iter().filter(|(id, ..)| lasting.contains(id) && !reached.contains(id)).collect();
        assert!(missed.is_empty(), "{key:?}: {missed:?}");
        if key == Key::Num1 {
            assert_eq!(seen, [true; 3], "views have no keys");
        }
    }
}

/// Moves every slider that is shown and resets it by Ctrl + click.
fn restore_all(driver: &mut Driver, skip: &[&str]) -> usize {
    let sliders = |driver: &Driver| -> Vec<(String, f64, f64, f64)> {
        let nodes = driver.harness.root().children_recursive();
        let sliders = nodes.filter(|n| n.accesskit_node().role() == Role::Slider);
        let found = sliders.filter_map(|n| {
            let node = n.accesskit_node();
            Some((
                node.label()?,
                node.numeric_value()?,
                node.data().min_numeric_value()?,
                node.data().max_numeric_value()?,
            ))
        });
        found.collect()
    };
    let all: Vec<_> =
        sliders(driver).into_iter().filter(|(label, ..)| !skip.contains(&label.as_str())).collect();
    for (label, default, low, high) in &all {
        let other = if (default - low).abs() > (high - default).abs() {
            0.5 * (low + default)
        } else {
            0.5 * (high + default)
        };
        driver.slide(label, other);
        let moved = driver.value(label);
        assert!((moved - default).abs() > 1e-6 * default.abs().max(1e-9), "{label} stays at {moved}");
        driver.harness.get_by_role_and_label(Role::Slider, label).click_modifiers(Modifiers::COMMAND);
        driver.harness.run_steps(3);
        let back = driver.value(label);
        assert!((back - default).abs() <= 1e-6 * default.abs(), "{label}: {back}, not {default}");
    }
    all.len()
}

#[test]
fn ctrl_click_restores_every_number() {
    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.fitted();
    // The panel, slices and the lobe; hyper-parameters begin at what the search has found.
    let model = ["Samples", "Length scale θh", "Length scale θd", "Length scale φd"];
    assert!(restore_all(&mut driver, &["Noise variance", "Signal variance"]) >= 8);
    for label in model {
        assert!(driver.harness.query_by_role_and_label(Role::Slider, label).is_some(), "{label}");
    }
    driver.press(Key::Num3);
    for kind in ["Over θh", "Over θd", "Over φd"] {
        driver.harness.get_by_label(kind).click();
        driver.harness.run_steps(3);
        let known = ["Samples", "ε (1/sr)", "Noise variance", "Signal variance"];
        assert_eq!(restore_all(&mut driver, &[&known[..], &model[1..]].concat()), 2, "{kind}");
    }
    driver.press(Key::Num4);
    let panel: Vec<String> = {
        let nodes = driver.harness.root().children_recursive();
        let sliders = nodes.filter(|n| n.accesskit_node().role() == Role::Slider);
        sliders.filter_map(|n| n.accesskit_node().label()).collect()
    };
    let panel: Vec<&str> = panel.iter().map(String::as_str).collect();
    for (menu, count) in [("Shape", 3), ("Light", 4)] {
        driver.click(menu);
        assert_eq!(restore_all(&mut driver, &panel), count, "{menu}");
        driver.press(Key::Escape);
    }
    driver.click("Light");
    driver.harness.get_by_label("Point light").click();
    driver.harness.run_steps(3);
    assert_eq!(restore_all(&mut driver, &panel), 4);
    driver.press(Key::Escape);
    // Numbers without a slider.
    for (label, default) in [("Nodes along θh", 64.0), ("Nodes along θd", 32.0), ("Nodes along φd", 18.0)]
    {
        let value = |driver: &Driver| {
            let node = driver.harness.get_by_role_and_label(Role::SpinButton, label);
            node.accesskit_node().numeric_value().unwrap()
        };
        driver.harness.get_by_role_and_label(Role::SpinButton, label).set_value_accesskit(9.0);
        driver.harness.run_steps(3);
        assert!((value(&driver) - 9.0).abs() < 1e-9, "{label}");
        let number = driver.harness.get_by_role_and_label(Role::SpinButton, label);
        number.click_modifiers(Modifiers::COMMAND);
        driver.harness.run_steps(3);
        assert!((value(&driver) - default).abs() < 1e-9, "{label}: {}", value(&driver));
    }
}

#[test]
fn arrow_keys_move_a_view_that_has_the_focus() {
    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.slide("Samples", 1500.0);
    driver.fitted();
    driver.press(Key::Num4);
    driver.wait("a sphere", |d| d.after("SSIM ").is_some());
    let focus = |driver: &mut Driver, view: &str| {
        driver.harness.get_by_label_contains(view).focus();
        driver.harness.run_steps(3);
    };
    focus(&mut driver, "Sphere view");
    driver.press(Key::ArrowRight);
    driver.press(Key::Plus);
    driver.click("Light");
    assert!((driver.value("Turned") - 0.1f64.to_degrees()).abs() < 0.1, "{}", driver.value("Turned"));
    driver.press(Key::Escape);
    driver.click("Shape");
    assert!((driver.value("Zoom") - 1.15).abs() < 1e-3, "{}", driver.value("Zoom"));
    driver.press(Key::Escape);
    focus(&mut driver, "Sphere view");
    driver.press(Key::Home);
    driver.click("Shape");
    assert!((driver.value("Zoom") - 1.0).abs() < 1e-6);
    driver.press(Key::Escape);
    // A plot moves by pixels.
    driver.press(Key::Num3);
    focus(&mut driver, "Lobe plot");
    let before = driver.picture();
    driver.press(Key::ArrowLeft);
    let moved = driver.picture();
    assert!(before != moved);
}
