//! How fast the viewer answers: `cargo bench -p gpbrdf-app --bench viewer`.
//!
//! Without a window: from a slider's move to the frame that shows the new model at 36,864 samples, the
//! longest frame of the window's own work meanwhile, and memory over 200 refits.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a bench reports to a terminal")]

use std::time::{Duration, Instant};

use eframe::egui::accesskit::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use gpbrdf_app::viewer::{Settings, Viewer};

type Driver = Harness<'static, Option<Viewer>>;

fn viewer(driver: &Driver) -> &Viewer {
    driver.state().as_ref().unwrap()
}

/// Frames at about 60 Hz until `done`; the time it took.
fn until(driver: &mut Driver, done: impl Fn(&Viewer) -> bool) -> Duration {
    let start = Instant::now();
    loop {
        driver.step();
        if done(viewer(driver)) {
            return start.elapsed();
        }
        assert!(start.elapsed() < Duration::from_secs(120), "waited in vain");
        std::thread::sleep(Duration::from_millis(4));
    }
}

fn slide(driver: &Driver, label: &str, value: f64) {
    driver.get_by_role_and_label(Role::Slider, label).set_value_accesskit(value);
}

/// Resident memory, MB; 0 where it is not known.
fn memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmRSS:")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|kb| kb.parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}

fn summary(name: &str, mut times: Vec<Duration>) {
    times.sort();
    let ms = |t: Duration| 1e3 * t.as_secs_f64();
    println!(
        "{name}: median {:.0} ms, longest {:.0} ms of {}",
        ms(times[times.len() / 2]),
        ms(times[times.len() - 1]),
        times.len()
    );
}

fn open(settings: Settings) -> Driver {
    Harness::builder().with_size([1440.0, 900.0]).build_ui_state(
        move |ui, viewer: &mut Option<Viewer>| {
            let made = || Viewer::new(ui.ctx(), settings.clone(), &[]).unwrap();
            viewer.get_or_insert_with(made).ui(ui);
        },
        None,
    )
}

/// Frames while an object is lit and measured and the model refitted.
fn with_an_object() {
    let settings = "{\"hint\": false, \"panes\": {\"3d\": {\"shape\": \"Knot\", \"shown\": \"SideBySide\"}}}";
    let mut driver = open(serde_json::from_str(settings).unwrap());
    until(&mut driver, Viewer::is_fitted);
    driver.state_mut().as_mut().unwrap().reset_frame_times();
    for i in 0..20 {
        let before = viewer(&driver).shown_version();
        slide(&driver, "Length scale θh", 0.03 + 0.001 * f64::from(i));
        until(&mut driver, |v| v.shown_version() != before);
    }
    let frames = viewer(&driver).frame_times();
    let longest = 1e3 * frames.longest.as_secs_f64();
    println!(
        "longest frame of {} while an object is lit and its model fitted: {longest:.1} ms",
        frames.frames
    );
    driver.state_mut().as_mut().unwrap().close();
}

fn main() {
    let mut driver = open(serde_json::from_str("{\"hint\": false}").unwrap());
    let first = until(&mut driver, |v| v.shown_version() > 0);
    println!("first picture after {:.0} ms", 1e3 * first.as_secs_f64());
    until(&mut driver, Viewer::is_settled);

    driver.state_mut().as_mut().unwrap().reset_frame_times();
    let mut hand = Vec::new();
    let mut searched = Vec::new();
    for i in 0..20 {
        let before = viewer(&driver).shown_version();
        let start = Instant::now();
        slide(&driver, "Length scale θh", 0.03 + 0.001 * f64::from(i));
        until(&mut driver, |v| v.shown_version() != before);
        hand.push(start.elapsed());
        until(&mut driver, Viewer::is_fitted);
        let before = viewer(&driver).shown_version();
        let start = Instant::now();
        driver.get_by_role_and_label(Role::Button, "Optimise").click();
        until(&mut driver, |v| v.shown_version() != before);
        searched.push(start.elapsed());
        until(&mut driver, Viewer::is_fitted);
    }
    summary("hyper-parameter by hand, 36,864 samples, to the frame that shows it", hand);
    summary("optimised again, 36,864 samples, to the frame that shows it", searched);
    let frames = viewer(&driver).frame_times();
    println!(
        "longest frame of {} while fitting: {:.1} ms",
        frames.frames,
        1e3 * frames.longest.as_secs_f64()
    );
    for round in 0..=4 {
        println!("memory after {} refits: {:.0} MB", 50 * round, memory());
        for i in 0..if round < 4 { 50 } else { 0 } {
            let before = viewer(&driver).shown_version();
            slide(&driver, "Length scale θh", 0.03 + 0.0005 * f64::from(i + round));
            until(&mut driver, |v| v.shown_version() != before);
        }
    }
    driver.state_mut().as_mut().unwrap().close();
    with_an_object();
}
