//! What is written, read back.

use std::path::PathBuf;

use eframe::egui::Key;
use egui_kittest::kittest::Queryable;
use gpbrdf_app::viewer::Settings;
use gpbrdf_core::{HalfDiff, Source};

use super::driver::{Driver, exists, read_exr};

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
    for suffix in ["-truth.exr", "-prediction.exr", "-difference.exr", "-sigma.exr"] {
        assert!(exists(&png.with_file_name(format!("out{suffix}"))), "{suffix}");
    }
    // A figure and a table are written as their names say.
    let figure = std::fs::read(write(&mut driver, "Export slices…", "figure.pdf")).unwrap();
    assert!(figure.starts_with(b"%PDF-"));
    let truth = Source::built_in("ward").unwrap();
    let at = HalfDiff { theta_h: 0.3, theta_d: 0.5, phi_d: 1.0 };
    for name in ["table.binary", "table.exr", "table.bsdf"] {
        let table = Source::open(write(&mut driver, "Export table…", name)).unwrap();
        let (found, expected) =
            (table.brdf().unwrap().eval_half_diff(at)[1], truth.brdf().unwrap().eval_half_diff(at)[1]);
        assert!((found / expected - 1.0).abs() < 0.05, "{name} {found} {expected}");
    }
    write(&mut driver, "Export table…", "table.ktx2");
    let model = write(&mut driver, "Save model…", "out.safetensors");
    driver.press_with_ctrl(Key::S);
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
fn the_picture_is_written_and_curves_of_all_kinds_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::set(&[PathBuf::from("lambert")], [720.0, 480.0], "{\"view\": \"3d\"}");
    driver.slide("Samples", 1500.0);
    driver.wait("a picture", |d| d.after("SSIM ").is_some());
    driver.click("File");
    // It is written once the picture is smooth.
    driver.click("Export picture…");
    let path = folder.path().join("ball.png");
    driver.enter("Path", &path.display().to_string());
    driver.click("Write");
    driver.wait("pictures", |_| exists(&path));
    for name in ["ball-truth.exr", "ball-prediction.exr"] {
        assert!(exists(&folder.path().join(name)), "{name}");
    }
    driver.press(Key::Num3);
    for name in ["Over θh", "Over θd", "Over φd", "Albedo"] {
        driver.harness.get_by_label(name).click();
        driver.harness.run_steps(4);
        assert!(driver.harness.query_by_label(&format!("{name} plot")).is_some(), "{name}");
    }
}

#[test]
fn curves_are_written_with_their_numbers_and_their_picture() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::new(&[PathBuf::from("lambert"), PathBuf::from("ward")]);
    driver.fitted();
    driver.harness.get_by_label("Over θh").click();
    driver.harness.run_steps(4);
    driver.click("File");
    driver.click("Export curves…");
    let path = folder.path().join("curves.csv");
    driver.give_path(&path, "Write");
    driver.wait("a note", |d| d.shows("curves.csv\" and its picture"));
    let text = std::fs::read_to_string(&path).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().skip(2).map(|line| line.split(',').collect()).collect();
    for name in ["lambert", "ward"] {
        let source = Source::built_in(name).unwrap();
        let brdf = source.brdf().unwrap();
        let mine: Vec<_> = rows.iter().filter(|row| row[0] == format!("\"{name}\"")).collect();
        assert!(mine.len() > 100, "{name}: {}", mine.len());
        for row in mine {
            let number = |i: usize| row[i].parse::<f64>().unwrap();
            // The plot cuts at theta_d = 30 and phi_d = 90 degrees; tables are interpolated.
            let [theta_h, theta_d, phi_d] = [number(1), 30.0, 90.0].map(f64::to_radians);
            let rgb = brdf.eval_half_diff(HalfDiff { theta_h, theta_d, phi_d });
            let expected = rgb.iter().sum::<f64>() / 3.0;
            assert!((number(2) - expected).abs() < 0.02 * expected + 1e-3, "{name}: {row:?}, not {expected}");
            assert!(number(4) <= number(3) && number(3) <= number(5), "{row:?}");
        }
    }
    let picture = image::open(path.with_extension("png")).unwrap().into_rgb8();
    let colours: std::collections::HashSet<_> = picture.pixels().collect();
    assert!(picture.width() > 300 && colours.len() > 20, "{:?} {}", picture.dimensions(), colours.len());
}

#[test]
fn exported_slices_hold_the_values_of_the_material_and_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.fitted();
    driver.click("File");
    driver.click("Export slices…");
    let path = folder.path().join("out.png");
    driver.give_path(&path, "Write");
    driver.wait("a note", |d| d.shows("out.png\" and the linear slices"));
    let source = Source::built_in("lambert").unwrap();
    let brdf = source.brdf().unwrap();
    for which in ["truth", "prediction"] {
        let (width, height, pixels) = read_exr(&folder.path().join(format!("out-{which}.exr")));
        assert_eq!(pixels.len(), width * height);
        let mut compared = 0;
        for (i, pixel) in pixels.iter().enumerate() {
            let share = |k: usize, n: usize| (k as f64 + 0.5) / n as f64 * std::f64::consts::FRAC_PI_2;
            let angles = HalfDiff {
                theta_h: share(i % width, width),
                theta_d: std::f64::consts::FRAC_PI_2 - share(i / width, height),
                phi_d: std::f64::consts::FRAC_PI_2,
            };
            if angles.is_above_horizon() {
                for (a, b) in std::iter::zip(brdf.eval_half_diff(angles), pixel) {
                    assert!((a - f64::from(*b)).abs() < 0.01 * a.max(1e-3), "{which} {angles:?}: {a} {b}");
                }
                compared += 1;
            }
        }
        assert!(compared > pixels.len() / 4, "{compared}");
    }
    let figure = image::open(&path).unwrap().into_rgb8();
    assert!(figure.width() > 256 && figure.pixels().any(|p| p != figure.get_pixel(0, 0)));
}

#[test]
fn a_screenshot_is_what_the_window_shows_as_png_and_exr() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::sized(&[PathBuf::from("lambert")], [700.0, 500.0]);
    driver.slide("Samples", 1500.0);
    driver.fitted();
    driver.harness.state_mut().as_mut().unwrap().set_picture_folder(folder.path().to_owned());
    for i in 1..=2 {
        driver.press_with_ctrl(Key::P);
        let png = folder.path().join(format!("gpbrdf-screenshot-{i}.png"));
        let exr = png.with_extension("exr");
        driver.wait("a note", |d| d.shows(&format!("gpbrdf-screenshot-{i}.png\" and its EXR")));
        let shown = image::open(&png).unwrap().into_rgb8();
        assert_eq!(shown.dimensions(), (700, 500));
        let colours: std::collections::HashSet<_> = shown.pixels().collect();
        assert!(colours.len() > 50, "{}", colours.len());
        let (width, height, linear) = read_exr(&exr);
        assert_eq!((width, height), (700, 500));
        for (a, b) in std::iter::zip(shown.pixels(), &linear) {
            for c in 0..3 {
                // IEC 61966-2-1.
                let x = f64::from(a[c]) / 255.0;
                let expected = if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) };
                assert!((expected - f64::from(b[c])).abs() < 1e-6, "{expected} {}", b[c]);
            }
        }
    }
    let names = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(names, 4, "something else is left behind");
}

#[test]
fn a_folder_that_is_missing_is_named() {
    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.fitted();
    driver.harness.state_mut().as_mut().unwrap().set_picture_folder("/no/such/folder".into());
    driver.press_with_ctrl(Key::P);
    driver.wait("a message", |d| d.shows("/no/such/folder/gpbrdf-screenshot-1.png"));
    driver.click("Dismiss");
    for (item, name) in
        [("Export slices…", "a.png"), ("Save model…", "b.safetensors"), ("Export table…", "c.dds")]
    {
        driver.click("File");
        driver.click(item);
        driver.give_path(&PathBuf::from("/no/such/folder").join(name), "Write");
        driver.wait("a message", |d| d.shows(&format!("/no/such/folder/{name}")) && d.shows("Error"));
        driver.click("Dismiss");
    }
    assert!(driver.harness.query_by_label("Show lambert").is_some());
}

#[test]
fn settings_and_sessions_bring_back_how_it_looked() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::new(&[PathBuf::from("ward"), PathBuf::from("lambert")]);
    driver.slide("Samples", 1500.0);
    driver.fitted();
    driver.slide("φd", 30.0);
    driver.slide("Exposure", -2.0);
    driver.enter("Name", "chalk");
    driver.press(Key::L);
    driver.press(Key::Num2);
    // As eframe keeps them from run to run.
    let kept = serde_json::to_string(&driver.viewer().settings()).unwrap();
    let settings: Settings = serde_json::from_str(&kept).unwrap();
    let mut again = Driver::with(&[PathBuf::from("lambert")], [1440.0, 1000.0], settings);
    again.fitted();
    let same = |d: &Driver| {
        assert!((d.value("φd") - 30.0).abs() < 1e-9 && (d.value("Exposure") + 2.0).abs() < 1e-9);
        assert!(d.harness.query_by_label("Truth slice").is_some());
        assert!(d.harness.query_by_label("Lobe plot").is_none());
    };
    same(&again);
    let session = folder.path().join("all.json");
    driver.press_with_ctrl(Key::S);
    driver.give_path(&session, "Write");
    driver.wait("a note", |d| d.shows("saved session"));
    let mut restored = Driver::new(std::slice::from_ref(&session));
    restored.fitted();
    same(&restored);
    assert!(restored.harness.query_by_label("Show ward").is_some());
    assert!(restored.harness.query_by_label("Show chalk").is_some());
    assert!(restored.viewer().settings() != Settings::default());
    // A session whose file is gone names it and opens the rest.
    let text = std::fs::read_to_string(&session).unwrap();
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    value["documents"][0]["path"] = "/gone/away.bsdf".into();
    std::fs::write(&session, value.to_string()).unwrap();
    let mut partial = Driver::new(&[session]);
    partial.wait("a message", |d| d.shows("/gone/away.bsdf"));
    partial.fitted();
    assert!(partial.harness.query_by_label("Show chalk").is_some());
}
