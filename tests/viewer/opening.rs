//! What is opened, and what becomes of files that are broken.

use std::path::{Path, PathBuf};

use eframe::egui::accesskit::Role;
use eframe::egui::{self, Key};
use egui_kittest::kittest::{NodeT, Queryable};
use gpbrdf_app::viewer::Settings;
use gpbrdf_core::BrdfTable;
use gpbrdf_core::formats::{ExrPart, write_merl, write_table_exr};

use super::driver::{Driver, crop};

#[test]
fn a_broken_file_is_named_until_it_is_read_and_nothing_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let broken = folder.path().join("broken.binary");
    std::fs::write(&broken, [90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0, 1, 2, 3]).unwrap();
    let mut driver = Driver::new(&[PathBuf::from("ward"), broken]);
    driver.wait("a message", |d| d.shows("broken.binary"));
    driver.fitted();
    assert!(driver.shows("ward"));
    driver.harness.run_steps(30);
    assert!(driver.shows("broken.binary"));
    driver.click("Dismiss");
    assert!(!driver.shows("broken.binary\": expected"));

    driver.press_with_ctrl(Key::O);
    driver.enter("Path to open", "no/such/file.bsdf");
    driver.click("Open");
    driver.wait("a message", |d| d.shows("cannot read \"no/such/file.bsdf\""));
    assert!(driver.shows("ward"));
}

#[test]
fn what_is_worth_knowing_about_a_file_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("dark.csv");
    let rows = "10,0,20,180,1\n10,0,30,90,0.5\n10,0,40,90,-0.0005\n";
    std::fs::write(&file, format!("theta_i,phi_i,theta_o,phi_o,f\n{rows}")).unwrap();
    let mut driver = Driver::new(&[file]);
    driver.wait("a message", |d| d.shows("dark: 1 value is negative, down to -0.0005 (line 4)"));
}

#[test]
fn materials_are_opened_shown_and_removed() {
    let mut driver = Driver::new(&[PathBuf::from("ward"), PathBuf::from("lambert")]);
    driver.fitted();
    assert!(driver.harness.query_by_label("Show ward").is_some());
    driver.click("Remove lambert");
    driver.fitted();
    assert!(driver.harness.query_by_label("Show lambert").is_none());
    driver.press_with_ctrl(Key::O);
    driver.click("Rough copper (Cook-Torrance)");
    driver.fitted();
    assert!(driver.harness.query_by_label("Show cook-torrance").is_some());
}

#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|e| e.to_string())
    }
}

#[test]
fn dropped_files_are_opened_once_and_stay_among_the_recent_ones() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dropped.safetensors");
    let table = gpbrdf_core::Source::built_in("red-plastic").unwrap().table().unwrap().into_owned();
    let options = gpbrdf_core::CompressOptions {
        size: gpbrdf_core::InducingSize::Shape([6, 5, 4]),
        ..gpbrdf_core::CompressOptions::default()
    };
    let provenance = gpbrdf_core::Provenance { material: "squeezed".into(), ..Default::default() };
    let model = gpbrdf_core::compress(&table, &options, provenance).unwrap().model;
    std::fs::write(&path, model.to_bytes().unwrap()).unwrap();

    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.fitted();
    driver.harness.input_mut().dropped_files.push(std::sync::Arc::new(Dropped(path.clone())));
    driver.wait("the dropped file", |d| d.harness.query_by_label("Show squeezed").is_some());
    driver.fitted();
    assert!(driver.shows("A fitted model from a file.") && driver.shows("Compressed, on inducing lattices"));
    assert!(driver.harness.query_by_label("Prediction slice").is_some());
    assert!(driver.harness.query_by_label("Truth slice").is_none());
    driver.wait("sigma", |d| d.harness.query_by_label("Sigma slice").is_some());
    driver.click("File");
    driver.harness.get_by_label_contains("Recent").hover();
    driver.harness.run_steps(3);
    driver.harness.get_by_label_contains("Recent").click();
    driver.harness.run_steps(3);
    assert!(driver.shows(&path.display().to_string()));
}

#[test]
fn files_of_every_kind_are_opened_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let grey = BrdfTable::from_fn(|_| [0.1; 3]);
    write_merl(path("merl.binary"), &grey).unwrap();
    let mean = ExrPart {
        name: "mean",
        description: "test",
        unit: "sr^-1",
        channels: gpbrdf_core::formats::ExrChannels::Rgb(grey.values()),
    };
    write_table_exr(path("layers.exr"), &[mean]).unwrap();
    let rows = (0..60).map(|i| format!("{},{},{},0.1,0.2,0.3\n", i % 30, (7 * i) % 50, (13 * i) % 180));
    std::fs::write(
        path("scattered.csv"),
        format!("theta_h,theta_d,phi_d,r,g,b\n{}", rows.collect::<String>()),
    )
    .unwrap();
    let mut files: Vec<PathBuf> = ["merl.binary", "layers.exr", "scattered.csv"].map(path).to_vec();
    files.push("lambert".into());
    let mut names = vec!["merl", "layers", "scattered", "lambert"];
    let measured = std::env::var_os("GPBRDF_DATA").map(|d| Path::new(&d).join("rgl/satin_purple_rgb.bsdf"));
    match measured.filter(|p| p.is_file()) {
        Some(measured) => {
            files.push(measured);
            names.push("satin_purple");
        }
        None => eprintln!("skipped a .bsdf file: no GPBRDF_DATA"),
    }
    let mut driver = Driver::new(&files);
    let listed = |d: &Driver, name: &str| {
        d.harness
            .query_all_by_role(Role::CheckBox)
            .any(|n| n.accesskit_node().label().is_some_and(|l| l.starts_with(&format!("Show {name}"))))
    };
    for name in names {
        driver.wait(name, |d| listed(d, name));
    }
    driver.fitted();
    assert!(driver.harness.query_by_label("Dismiss").is_none(), "{:?}", driver.texts());
}

#[test]
fn materials_are_renamed_hidden_and_drawn_alone() {
    let mut driver = Driver::new(&[PathBuf::from("ward"), PathBuf::from("lambert")]);
    driver.fitted();
    driver.press(Key::Num3);
    driver.enter("Name", "chalk");
    assert!(driver.harness.query_by_label("Show chalk").is_some());
    let drawn = |driver: &mut Driver| {
        driver.harness.run_steps(3);
        let rect = driver.harness.get_by_label("Lobe plot").rect();
        crop(&driver.picture(), rect)
    };
    let both = drawn(&mut driver);
    driver.harness.get_by_label("Show ward").click();
    let one = drawn(&mut driver);
    assert!(both != one);
    driver.harness.get_by_label("Show ward").click();
    driver.harness.get_by_label("Solo chalk").click();
    let alone = drawn(&mut driver);
    assert!(both != alone);
    driver.harness.get_by_label("Solo chalk").click();
    drawn(&mut driver);
    driver.click("Remove ward");
    assert!(driver.harness.query_by_label("Show ward").is_none());
}

#[test]
fn many_errors_all_stay_until_they_are_read() {
    let files: Vec<PathBuf> = (0..9).map(|i| format!("missing-{i}.bsdf").into()).collect();
    let mut driver = Driver::new(&[&files[..], &[PathBuf::from("lambert")]].concat());
    for i in 0..9 {
        driver.wait("a message", |d| d.shows(&format!("missing-{i}.bsdf")));
    }
    driver.fitted();
    for left in (0..9).rev() {
        driver.harness.query_all_by_role_and_label(Role::Button, "Dismiss").next().unwrap().click_accesskit();
        driver.harness.run_steps(3);
        let shown = driver.harness.query_all_by_role_and_label(Role::Button, "Dismiss").count();
        assert_eq!(shown, left);
    }
    assert!(driver.harness.query_by_label("Show lambert").is_some());
}

#[test]
fn messages_float_and_move_nothing() {
    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.fitted();
    let places = |driver: &Driver| {
        ["Sphere view", "Lobe plot", "Prediction slice"]
            .map(|view| driver.harness.get_by_label_contains(view).rect())
    };
    let before = places(&driver);
    for i in 0..6 {
        driver.press_with_ctrl(Key::O);
        driver.enter("Path to open", &format!("/no/such/folder/with/a/long/name/measurement-{i}.bsdf"));
        driver.click("Open");
        driver.wait("a message", |d| d.shows(&format!("measurement-{i}.bsdf")));
        driver.press(Key::Escape);
    }
    assert_eq!(places(&driver), before);
    // All six can be read: each is whole, within the window, and none is over another.
    let texts: Vec<egui::Rect> = (0..6)
        .map(|i| driver.harness.get_by_label_contains(&format!("measurement-{i}.bsdf")).rect())
        .collect();
    for (i, rect) in texts.iter().enumerate() {
        assert!(rect.min.y > 0.0 && rect.max.y < 1000.0 && rect.max.x < 1440.0, "{rect}");
        assert!(texts[..i].iter().all(|other| !rect.shrink(1.0).intersects(*other)), "{texts:?}");
    }
    driver.click("Dismiss all");
    assert!(driver.harness.query_by_label("Dismiss").is_none());
}

#[test]
fn the_first_run_has_a_hint_that_stays_away_once_it_is_read() {
    let files = [PathBuf::from("lambert")];
    let mut driver = Driver::with(&files, [1440.0, 1000.0], Settings::default());
    driver.fitted();
    assert!(driver.shows("H shows all keys"));
    driver.click("Got it");
    assert!(!driver.shows("H shows all keys"));
    let kept = serde_json::to_string(&driver.viewer().settings()).unwrap();
    let mut again = Driver::with(&files, [1440.0, 1000.0], serde_json::from_str(&kept).unwrap());
    again.fitted();
    assert!(!again.shows("H shows all keys"));
    again.click("Help");
    again.click("First steps");
    assert!(again.shows("H shows all keys"));
}

#[test]
fn files_are_taken_by_what_they_hold_and_sessions_keep_them() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path().join("here");
    std::fs::create_dir(&here).unwrap();
    // Names say nothing.
    let [sky, mesh, session] = ["sky.dat", "mesh.txt", "session.x"].map(|name| here.join(name));
    let pixels = [128u8, 128, 128, 129].repeat(8);
    std::fs::write(&sky, [&b"#?RADIANCE\n\n-Y 2 +X 4\n"[..], &pixels].concat()).unwrap();
    std::fs::write(&mesh, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let mut driver = Driver::new(&[sky, mesh]);
    driver.fitted();
    let shown = |driver: &mut Driver, menu: &str, label: &str| {
        driver.click(menu);
        driver.wait(label, |d| d.harness.query_by_label(label).is_some());
        driver.press(Key::Escape);
    };
    shown(&mut driver, "Light", "Environment: sky.dat");
    shown(&mut driver, "Shape", "mesh");
    driver.press_with_ctrl(Key::S);
    driver.enter("Path", &session.display().to_string());
    driver.click("Write");
    driver.wait("a session", |_| super::driver::exists(&session));

    let there = folder.path().join("there");
    std::fs::rename(&here, &there).unwrap();
    let text = std::fs::read_to_string(there.join("session.x")).unwrap();
    std::fs::write(there.join("session.x"), text.replacen("\"swipe\"", "\"sweep\": 1, \"swipe\"", 1))
        .unwrap();
    let mut driver = Driver::new(&[there.join("session.x")]);
    driver.wait("a note", |d| d.shows("\"sweep\" not known"));
    driver.fitted();
    shown(&mut driver, "Light", "Environment: sky.dat");
    shown(&mut driver, "Shape", "mesh");
    assert!(!driver.shows("cannot read"), "{:?}", driver.texts());
}

#[cfg(target_os = "linux")]
#[test]
fn without_a_display_there_is_one_line_and_no_window() {
    use std::process::Command;
    for display in [None, Some(":4095")] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gpbrdf-viewer"));
        command.env_clear().arg("ward").envs(display.map(|name| ("DISPLAY", name)));
        let output = command.output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.starts_with("error: cannot open a window: ") && said.ends_with('\n'), "{said}");
        assert!(said.lines().count() == 1 && !said.contains(".rs:"), "{said}");
        assert!(display.is_some() || said.contains("DISPLAY is set"), "{said}");
        assert!(output.stdout.is_empty());
    }
}
