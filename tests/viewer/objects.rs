//! Objects lit by the device, and what becomes of them when it is lost.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use eframe::egui::{self, Key};
use eframe::egui_wgpu::RendererOptions;
use eframe::wgpu::PollType;
use egui_kittest::kittest::Queryable;
use egui_kittest::wgpu::{create_render_state, default_wgpu_setup};
use gpbrdf_app::viewer::Viewer;
use gpbrdf_render::{AdapterChoice, Context};

use super::driver::{Driver, crop};

const SIZE: [f32; 2] = [760.0, 460.0];

/// A window on an object of a material with few samples, so that the prediction is not the truth.
fn object(settings: &str) -> Driver {
    let settings = format!("{{\"view\": \"3d\", \"panes\": {{\"3d\": {{{settings}}}}}}}");
    let mut driver = Driver::set(&[PathBuf::from("ward")], SIZE, &settings);
    driver.slide("Samples", 100.0);
    driver.fitted();
    driver
}

/// The number of samples per pixel of the picture whose metrics are shown; `None` before there are metrics.
fn measured_samples(driver: &Driver) -> Option<u32> {
    let text = driver.after("SSIM ")?;
    text.split_once(" at ")?.1.split(' ').next()?.parse().ok()
}

/// The pixels of the object's view, without captions and metrics.
fn view(driver: &mut Driver) -> image::RgbaImage {
    let rect = driver.harness.get_by_label_contains("Object view").rect().shrink(40.0);
    crop(&driver.picture(), rect)
}

fn mean_gap<'a>(pairs: impl Iterator<Item = (&'a image::Rgba<u8>, &'a image::Rgba<u8>)>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (a, b) in pairs {
        sum += (0..3).map(|c| f64::from(a[c].abs_diff(b[c]))).sum::<f64>() / 3.0;
        count += 1.0;
    }
    sum / count
}

#[test]
fn the_first_picture_is_a_lit_sphere_without_burnt_areas() {
    // The brightest of the built-in materials, and a dark one with a sharp highlight.
    for name in ["silver-paint", "ward"] {
        let mut driver = Driver::set(&[PathBuf::from(name)], SIZE, "{\"view\": \"3d\"}");
        driver.wait("a picture", |d| d.shows("preview") || d.after("SSIM ").is_some());
        let check = |driver: &mut Driver, when: &str| {
            let rect = driver.harness.get_by_label_contains("Sphere view").rect();
            // Within the sphere, without captions and metrics.
            let side = 0.5 * rect.height();
            let part = egui::Rect::from_center_size(rect.center(), egui::Vec2::splat(side));
            let picture = crop(&driver.picture(), part);
            let (width, height) = picture.dimensions();
            // The line between truth and prediction is in the middle.
            let columns = (1..width - 1).filter(|x| x.abs_diff(width / 2) > 5);
            let inside: Vec<(u32, u32)> =
                columns.flat_map(|x| (1..height - 1).map(move |y| (x, y))).collect();
            let count = inside.len() as f64;
            let pixels = || inside.iter().map(|&(x, y)| picture.get_pixel(x, y).0);
            let burnt = pixels().filter(|p| p[..3].iter().all(|&x| x >= 254)).count() as f64;
            assert!(burnt / count < 0.005, "{name} {when}: {} % are burnt out", 100.0 * burnt / count);
            let mean = pixels().map(|p| f64::from(p[1])).sum::<f64>() / count;
            assert!((30.0..215.0).contains(&mean), "{name} {when}: {mean}");
            // Neighbours differ by the shape of the lobe, not by noise.
            let at = |x: u32, y: u32| f64::from(picture.get_pixel(x, y)[1]);
            let gap = |&(x, y): &(u32, u32)| (at(x, y) - 0.5 * (at(x - 1, y) + at(x + 1, y))).abs();
            let noise = inside.iter().map(gap).sum::<f64>() / count;
            assert!(noise < 4.0, "{name} {when}: noise of {noise}");
        };
        check(&mut driver, "at first");
        driver.wait("a smooth picture", |d| d.viewer().is_settled());
        check(&mut driver, "in the end");
    }
}

#[test]
fn metrics_follow_the_picture_from_its_first_samples_on() {
    let mut driver = object("\"shape\": \"Knot\"");
    driver.wait("metrics", |d| measured_samples(d).is_some());
    let first = measured_samples(&driver).unwrap();
    assert!(first < 64, "the first metrics are those of {first} samples");
    let psnr =
        |d: &Driver| -> f64 { d.after("PSNR ").unwrap().strip_suffix(" dB").unwrap().parse().unwrap() };
    assert!((10.0..80.0).contains(&psnr(&driver)), "{}", psnr(&driver));
    driver.wait("more samples", |d| measured_samples(d).is_some_and(|n| n > first));
    driver.wait("a smooth picture", |d| measured_samples(d) >= Some(192));
    let last = psnr(&driver);
    let text = driver.after("SSIM ").unwrap();
    let ssim: f64 = text.split(' ').next().unwrap().parse().unwrap();
    assert!((10.0..80.0).contains(&last) && (0.3..1.0).contains(&ssim), "{last} {ssim}");
    // A better model is closer.
    driver.slide("Samples", 30_000.0);
    driver.fitted();
    driver.wait("a closer picture", |d| psnr(d) > last + 3.0);
}

#[test]
fn side_by_side_shows_two_whole_objects_and_a_swipe_one() {
    let mut driver = object("\"shape\": \"Knot\", \"shown\": \"SideBySide\"");
    driver.wait("a picture", |d| measured_samples(d) >= Some(16));
    let halves = |driver: &mut Driver| {
        let rect = driver.harness.get_by_label_contains("Object view").rect().shrink(6.0);
        let picture = driver.picture();
        let half = egui::vec2((0.5 * rect.width()).floor() - 2.0, rect.height() - 70.0);
        let left = rect.min + egui::vec2(0.0, 30.0);
        let right = left + egui::vec2(half.x + 4.0, 0.0);
        [left, right].map(|at| crop(&picture, egui::Rect::from_min_size(at, half)))
    };
    let [truth, prediction] = halves(&mut driver);
    // The same object from the same side, but not the same material.
    let gap = mean_gap(std::iter::zip(truth.pixels(), prediction.pixels()));
    assert!(gap > 0.05 && gap < 12.0, "{gap}");
    let flat = mean_gap(truth.pixels().map(|p| (p, truth.get_pixel(0, 0))));
    assert!(flat > 10.0, "there is no object: {flat}");
    driver.harness.get_by_label("Swipe").click();
    let start = Instant::now();
    loop {
        driver.harness.run_steps(3);
        let [left, right] = halves(&mut driver);
        if mean_gap(std::iter::zip(left.pixels(), right.pixels())) > 15.0 {
            break;
        }
        assert!(start.elapsed().as_secs() < 60, "a swipe shows halves of one object");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn difference_and_sigma_and_turning_change_the_picture() {
    let mut driver = object("\"shape\": \"RoundedBox\"");
    driver.wait("a picture", |d| measured_samples(d) >= Some(1));
    let mut before = view(&mut driver);
    for (what, meaning) in [
        ("Difference", "Difference: exposure × (prediction − truth)"),
        ("Sigma", "Sigma: standard deviation of the target"),
    ] {
        driver.harness.get_by_label(what).click();
        driver.harness.run_steps(3);
        let mut now = view(&mut driver);
        let start = Instant::now();
        while mean_gap(std::iter::zip(before.pixels(), now.pixels())) < 5.0 {
            assert!(start.elapsed().as_secs() < 60, "{what} looks like what was before it");
            std::thread::sleep(Duration::from_millis(20));
            driver.harness.run_steps(1);
            now = view(&mut driver);
        }
        assert!(driver.shows(meaning), "{what} has no formula");
        before = now;
    }
    // Keys orbit.
    driver.harness.get_by_label_contains("Object view").focus();
    driver.harness.run_steps(3);
    for _ in 0..4 {
        driver.press(Key::ArrowRight);
    }
    driver.click("Shape");
    assert!((driver.value("Azimuth") - 0.1f64.to_degrees()).abs() < 0.1, "{}", driver.value("Azimuth"));
}

#[test]
fn object_files_and_maps_are_read_and_broken_ones_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(
        path("corner.obj"),
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    )
    .unwrap();
    std::fs::write(path("broken.obj"), "v 0 0\nf 1 2 9\n").unwrap();
    std::fs::write(path("broken.hdr"), "#?RADIANCE\nnothing").unwrap();
    let mut map = std::io::Cursor::new(Vec::new());
    gpbrdf_core::formats::write_image_exr(&mut map, 16, 8, &[[0.4, 0.5, 0.6]; 128]).unwrap();
    std::fs::write(path("sky.exr"), map.into_inner()).unwrap();
    let mut driver = object("\"shape\": \"Knot\"");
    driver.wait("a picture", |d| measured_samples(d) >= Some(1));
    let load = |driver: &mut Driver, menu: &str, item: &str, name: &str| {
        driver.click(menu);
        driver.click(item);
        driver.give_path(&path(name), "Load");
    };
    load(&mut driver, "Shape", "Mesh file…", "corner.obj");
    driver.wait("the object", |d| measured_samples(d) >= Some(8));
    load(&mut driver, "Light", "Environment map…", "sky.exr");
    driver.click("Light");
    driver.wait("the map", |d| d.harness.query_by_label("Environment: sky.exr").is_some());
    driver.press(Key::Escape);
    load(&mut driver, "Light", "Environment map…", "broken.hdr");
    driver.wait("a message", |d| d.shows("broken.hdr\": expected"));
    driver.click("Dismiss");
    load(&mut driver, "Shape", "Mesh file…", "broken.obj");
    driver.wait("a message", |d| d.shows("broken.obj"));
    // The sphere is shown in its place, and objects can be chosen again.
    driver.wait("a sphere", |d| d.harness.query_by_label_contains("Sphere view").is_some());
    driver.click("Shape");
    driver.harness.get_by_label("Knot").click();
    driver.press(Key::Escape);
    driver.wait("a knot", |d| d.harness.query_by_label_contains("Object view").is_some());
    driver.wait("its metrics", |d| measured_samples(d) >= Some(1));
    assert!(driver.shows("broken.obj") && driver.harness.query_by_label("Show ward").is_some());
}

#[test]
fn a_lost_device_is_reported_and_opened_anew() {
    let context = Context::open(AdapterChoice::Any).unwrap();
    let theirs = context.clone();
    let mut driver = Driver::around(SIZE, move |ctx| {
        let settings = "{\"hint\": false, \"view\": \"3d\", \"panes\": {\"3d\": {\"shape\": \"Knot\"}}}";
        let settings = serde_json::from_str(settings).unwrap();
        let mut viewer = Viewer::new(ctx, settings, &[PathBuf::from("ward")]).unwrap();
        viewer.use_device(&theirs).unwrap();
        viewer
    });
    driver.slide("Samples", 100.0);
    driver.fitted();
    driver.wait("metrics", |d| measured_samples(d).is_some());
    context.device().destroy();
    driver.wait("a message", |d| d.shows("is lost"));
    assert!(driver.shows(&format!("the graphics device \"{}\" is lost", context.info().name)));
    // The object is lit on another device, and nothing else is lost.
    driver.wait("a smooth picture", |d| measured_samples(d) >= Some(192));
    assert!(driver.harness.query_by_label_contains("Object view").is_some());
    assert!(driver.harness.query_by_label("Show ward").is_some() && driver.shows("is lost"));
    driver.click("Dismiss");
    assert!(!driver.shows("is lost"));
}

#[test]
fn a_window_whose_device_is_lost_goes_on_in_another_one() {
    let mut driver = object("\"shape\": \"Knot\"");
    let state = create_render_state(default_wgpu_setup(), RendererOptions::PREDICTABLE);
    driver.viewer().watch_device(&state);
    state.device.destroy();
    let _told = state.device.poll(PollType::Poll);
    driver.wait("the loss", |d| d.viewer().has_lost_device());
    let old = driver.harness.state_mut().take().unwrap();
    let mut driver = Driver::around(SIZE, move |ctx| Viewer::reopened(ctx, old).unwrap());
    driver.wait("metrics", |d| measured_samples(d).is_some());
    let name = state.adapter.get_info().name;
    assert!(driver.shows(&format!("the window's graphics device \"{name}\" was lost")));
    assert!(!driver.viewer().has_lost_device());
    assert!(driver.harness.query_by_label("Show ward").is_some());
    assert!(driver.value("Samples") < 200.0, "{}", driver.value("Samples"));
    driver.slide("Samples", 400.0);
    driver.fitted();
    driver.click("Dismiss");
    assert!(!driver.shows("was lost"));
}
