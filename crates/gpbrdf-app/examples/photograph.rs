//! Photographs the viewer without a window:
//! `cargo run --release -p gpbrdf-app --example photograph -- FOLDER [NAME...]`.
//!
//! Each picture is a PNG of that name in the folder; without names, all of them are made. A software adapter will do.
#![expect(clippy::print_stdout, reason = "an example reports to a terminal")]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use eframe::egui;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use gpbrdf_app::viewer::{Settings, Viewer};
use gpbrdf_core::formats::write_samples_csv;
use gpbrdf_core::plan::{Belief, Candidates, Cells, Device, Geometry, Goal, plan};
use gpbrdf_core::prior::Prior;
use gpbrdf_core::{Layout, Sample, SampleSet, Source};

type Result<T = (), E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

/// What is on a picture.
struct Scene {
    name: &'static str,
    /// Size of the window in points, and pixels per point.
    size: [f32; 2],
    scale: f32,
    /// What is open: names of built-in materials and files, and what [`opened`] makes.
    open: &'static [&'static str],
    /// What the viewer would remember from an earlier run; the rest is as at first.
    settings: &'static str,
    /// The label of what the pointer is on.
    hovered: Option<&'static str>,
    /// Whether the picture is taken so long after the start, whatever is going on, and not once everything is over.
    after: Option<Duration>,
}

const PLAIN: Scene = Scene {
    name: "viewer-overview",
    size: [1360.0, 850.0],
    scale: 1.0,
    open: &[],
    settings: "{}",
    hovered: None,
    after: None,
};

/// A file of twenty measurements in planned directions, one of thousands in random ones, which takes a while to fit,
/// and files that do not exist.
const MEASURED: &str = "rough-copper.csv";
const MANY: &str = "many.csv";
const MISSING: [&str; 6] = ["a.bsdf", "b.bsdf", "c.binary", "d.csv", "e.json", "f.exr"];

const SCENES: [Scene; 18] = [
    PLAIN,
    Scene {
        name: "viewer-slices",
        settings: r#"{"view": "slices"}"#,
        hovered: Some("Prediction slice"),
        ..PLAIN
    },
    Scene {
        name: "viewer-curves",
        settings: r#"{"view": "plots", "dark": false, "panes": {"plots": {"kind": "ThetaH", "log": true}}}"#,
        ..PLAIN
    },
    Scene {
        name: "viewer-object",
        settings: r#"{"view": "3d", "panes": {"3d": {"shape": "Knot", "shown": "SideBySide"}}}"#,
        ..PLAIN
    },
    Scene { name: "viewer-directions", open: &[MEASURED], settings: r#"{"view": "directions"}"#, ..PLAIN },
    Scene { name: "viewer-large-text", size: [800.0, 500.0], scale: 2.0, ..PLAIN },
    // To look at while the viewer is changed; no document shows them.
    Scene {
        name: "check-first-second",
        settings: r#"{"hint": true}"#,
        after: Some(Duration::from_secs(2)),
        ..PLAIN
    },
    // Says when the first picture of the object was there.
    Scene { name: "check-start", after: Some(Duration::from_secs(10)), ..PLAIN },
    Scene { name: "viewer-data", open: &[MEASURED], settings: r#"{"view": "data"}"#, ..PLAIN },
    Scene { name: "check-glossy", open: &["silver-paint"], ..PLAIN },
    Scene {
        name: "check-five-materials",
        open: &["ward", "lambert", MANY, "red-plastic", "cook-torrance"],
        after: Some(Duration::from_secs(8)),
        ..PLAIN
    },
    Scene { name: "check-errors", open: &MISSING, ..PLAIN },
    Scene { name: "check-light", open: &["purple-paint", "ward"], settings: r#"{"dark": false}"#, ..PLAIN },
    Scene {
        name: "check-sigma",
        open: &["purple-paint"],
        settings: r#"{"view": "3d", "panes": {"3d": {"shape": "Knot", "shown": "Sigma"}}}"#,
        ..PLAIN
    },
    Scene {
        name: "check-difference",
        open: &["purple-paint"],
        settings: r#"{"view": "3d", "panes": {"3d": {"shape": "Knot", "shown": "Difference"}}}"#,
        ..PLAIN
    },
    Scene {
        name: "check-sigma-sphere",
        settings: r#"{"view": "3d", "panes": {"3d": {"shown": "Sigma"}}}"#,
        ..PLAIN
    },
    Scene { name: "check-small", size: [1024.0, 700.0], ..PLAIN },
    Scene {
        name: "check-large-text",
        size: [680.0, 425.0],
        scale: 2.0,
        settings: r#"{"view": "plots"}"#,
        ..PLAIN
    },
];

/// The empty margin that the harness leaves around the viewer, in points.
const MARGIN: f32 = 8.0;

/// Longer than any fit takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

fn main() -> Result {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or("expected a folder for the pictures")?);
    let names: Vec<String> = arguments.collect();
    std::fs::create_dir_all(&folder)?;
    if let Some(unknown) = names.iter().find(|name| SCENES.iter().all(|scene| scene.name != **name)) {
        let known = SCENES.map(|scene| scene.name).join(", ");
        return Err(format!("expected pictures out of {known}, found {unknown}").into());
    }
    for scene in &SCENES {
        let chosen = if names.is_empty() {
            scene.name.starts_with("viewer-")
        } else {
            names.iter().any(|name| name == scene.name)
        };
        if chosen {
            photograph(scene, &folder.join(scene.name).with_extension("png"))?;
        }
    }
    Ok(())
}

/// A built-in material by its name, or a file of this name in the folder, which is made where it is one that can be.
fn opened(name: &str, folder: &Path) -> Result<PathBuf> {
    let path = folder.join(name);
    match name {
        MEASURED => write_samples_csv(&path, &planned_measurements("cook-torrance", 20)?)?,
        MANY => {
            let source = Source::built_in("blue-metallic-paint")?;
            let layout = Layout::Hemisphere { count: 6000, seed: 1 };
            write_samples_csv(&path, &SampleSet::measure(source.brdf()?, &layout)?)?;
        }
        _ if MISSING.contains(&name) => {}
        _ => return Ok(PathBuf::from(name)),
    }
    Ok(path)
}

fn photograph(scene: &Scene, file: &Path) -> Result {
    let mut settings: serde_json::Value = serde_json::from_str(scene.settings)?;
    if settings.get("hint").is_none() {
        settings["hint"] = false.into();
    }
    let settings: Settings = serde_json::from_value(settings)?;
    let folder = tempfile::tempdir()?;
    let files: Result<Vec<PathBuf>> = scene.open.iter().map(|name| opened(name, folder.path())).collect();
    let files = files?;
    let mut first_error = None;
    let mut harness = Harness::builder()
        .with_size(scene.size)
        .with_pixels_per_point(scene.scale)
        .with_theme(egui::Theme::Dark)
        .wgpu()
        .build_ui_state(
            move |ui, viewer: &mut Option<Viewer>| {
                if viewer.is_none() && first_error.is_none() {
                    match Viewer::new(ui.ctx(), settings.clone(), &files) {
                        Ok(made) => *viewer = Some(made),
                        Err(error) => first_error = Some(error),
                    }
                }
                if let Some(viewer) = viewer {
                    viewer.ui(ui);
                } else if let Some(error) = &first_error {
                    ui.label(format!("{error:#}"));
                }
            },
            None,
        );
    let start = Instant::now();
    match scene.after {
        Some(after) => {
            let mut is_lit = false;
            while start.elapsed() < after {
                harness.step();
                std::thread::sleep(Duration::from_millis(5));
                if !is_lit && harness.query_by_label("preview").is_some() {
                    is_lit = true;
                    println!("lit after {} ms", start.elapsed().as_millis());
                }
            }
        }
        None => wait(&mut harness, |viewer| viewer.is_some_and(Viewer::is_settled))?,
    }
    if let Some(label) = scene.hovered {
        let middle = harness.get_by_label(label).rect().center();
        harness.hover_at(middle);
    }
    harness.run_steps(if scene.after.is_some() { 1 } else { 20 });
    let picture = harness.render()?;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few pixels")]
    let margin = (MARGIN * scene.scale) as u32;
    let [width, height] = [picture.width(), picture.height()].map(|side| side - 2 * margin);
    let inner = image::imageops::crop_imm(&picture, margin, margin, width, height).to_image();
    image::DynamicImage::from(inner).into_rgb8().save(file)?;
    println!("{}", file.display());
    if let Some(viewer) = harness.state_mut() {
        viewer.close();
    }
    Ok(())
}

/// A built-in material at the directions that are planned before anything is known of it.
fn planned_measurements(name: &str, count: usize) -> Result<SampleSet> {
    let source = Source::built_in(name)?;
    let brdf = source.brdf()?;
    let candidates = Candidates::of(&Device::default())?;
    let belief = Belief::before(Some(&Prior::built_in()));
    let cells = Cells::usual(None, Cells::COUNT)?;
    let planned = plan(&belief, &[], &candidates, &cells, Goal::Count(count))?;
    let sample = |geometry: &Geometry| {
        let [wi, wo] = geometry.directions();
        Sample { wi, wo, value: brdf.eval(&wi, &wo) }
    };
    Ok(planned.geometries.iter().map(sample).collect())
}

/// Frames until `done`.
fn wait(harness: &mut Harness<'_, Option<Viewer>>, done: impl Fn(Option<&Viewer>) -> bool) -> Result {
    let start = Instant::now();
    while !done(harness.state().as_ref()) {
        if start.elapsed() > PATIENCE {
            return Err("the viewer is still busy after two minutes".into());
        }
        harness.step();
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}
