//! The viewer over a long time: random actions from a seed, after which no thread has panicked, memory is level and no
//! thread is left; and a process that is killed while it writes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use eframe::egui::accesskit::Role;
use eframe::egui::{self, Key};
use egui_kittest::kittest::{NodeT, Queryable};
use gpbrdf_app::viewer::{Viewer, check_session};
use gpbrdf_core::Model;
use gpbrdf_core::base::SplitMix64;
use gpbrdf_render::{AdapterChoice, Context};

use super::driver::Driver;
use crate::MEMORY;

/// Seconds of random actions, where nothing asks for another number by `GPBRDF_SOAK`.
const SECONDS: f64 = 12.0;

/// How often memory is looked at, with one small material open.
const LOOKS: usize = 8;

/// How often the graphics device is lost, in the first half: drivers keep some of the memory of a lost device.
const LOSSES: usize = 3;

/// MiB that may be held more in the second half: the buffer of 64 MiB that the product of matrices keeps in each
/// thread, for two threads that come to it late, and what lies between one smooth picture for files and another. Ten
/// tables of BRDFs that are left make more.
const HELD_MARGIN: usize = 2 * 64 + 24;

/// MiB that may be more on the device: a truth beside the prediction, of 12 MiB, and an environment.
const DEVICE_MARGIN: usize = 24;

/// Textures that may be more in the window: those of the panes that were not shown before.
const TEXTURES_MARGIN: usize = 6;

/// The fewest actions between two looks, however busy the machine is.
const LEAST_ACTIONS: usize = 7;

/// Actions between two paintings of the whole window.
const PAINTED: usize = 10;

/// A number of the environment.
fn given(name: &str) -> Option<f64> {
    std::env::var(name).ok().and_then(|text| text.parse().ok())
}

/// Runs one of the ignored tests of this program in a process of its own.
fn alone(test: &str) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--ignored", "--exact", "--nocapture", test]).stdin(Stdio::null());
    command
}

#[test]
fn random_actions_leave_no_panic_no_memory_and_no_thread() {
    let output = alone("viewer::long_life::random_actions").output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    said.lines().filter(|line| line.starts_with("after ")).for_each(|line| eprintln!("{line}"));
    assert!(output.status.success(), "{}\n{said}", String::from_utf8_lossy(&output.stdout));
}

/// A number of this process in `/proc/self/status`, 0 where there is no such file.
fn status(key: &str) -> usize {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix(key));
    line.and_then(|rest| rest.split_whitespace().nth(1)?.parse().ok()).unwrap_or(0)
}

/// What the process holds, with one small material open.
#[derive(Clone, Copy, Debug)]
struct Look {
    /// MiB that the system has given to the process, those of the graphics driver and those that are free again in it.
    resident: usize,
    /// MiB that Rust code holds.
    held: usize,
    /// MiB of buffers and textures on the device that lights objects; 0 where the driver does not tell.
    on_device: usize,
    /// Textures of the window.
    textures: usize,
    threads: usize,
}

impl Look {
    fn at(user: &User, driver: &Driver) -> Self {
        let report = user.device.device().generate_allocator_report();
        let on_device = report.map_or(0, |report| report.total_allocated_bytes >> 20);
        Self {
            resident: status("VmRSS") / 1024,
            held: MEMORY.current_usage() >> 20,
            on_device: usize::try_from(on_device).unwrap(),
            textures: driver.harness.ctx.tex_manager().read().num_allocated(),
            threads: threads(),
        }
    }
}

fn threads() -> usize {
    status("Threads")
}

/// Numbers from a seed.
struct Dice(SplitMix64);

impl Dice {
    fn share(&mut self) -> f64 {
        self.0.next_unit()
    }

    fn below(&mut self, bound: usize) -> usize {
        usize::try_from(self.0.next_u64() % bound.max(1) as u64).unwrap()
    }

    fn one<T: Clone>(&mut self, of: &[T]) -> Option<T> {
        of.get(self.below(of.len())).cloned()
    }
}

/// Somebody who does anything that can be done.
struct User {
    dice: Dice,
    folder: PathBuf,
    device: Context,
    /// How often the device may still be lost.
    losses: usize,
    done: BTreeMap<&'static str, usize>,
}

/// Rows of a file of measurements.
fn rows(count: usize) -> String {
    let row = |i: usize| {
        format!("{},0,{},{},{}\n", 5 + 3 * i % 70, 3 + 7 * i % 75, 180 - i % 90, 0.1 + 0.01 * i as f64)
    };
    format!("theta_i,phi_i,theta_o,phi_o,f\n{}", (0..count).map(row).collect::<String>())
}

impl User {
    fn new(seed: u64, folder: &Path, device: Context) -> Self {
        let user = Self {
            dice: Dice(SplitMix64::new(seed)),
            folder: folder.to_owned(),
            device,
            losses: LOSSES,
            done: BTreeMap::new(),
        };
        user.mend();
        user
    }

    /// The files that are opened, whole.
    fn mend(&self) {
        std::fs::write(self.folder.join("samples.csv"), rows(12)).unwrap();
        std::fs::write(self.folder.join("mesh.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let sky = [&b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n"[..], &[90, 80, 70, 128].repeat(32)]
            .concat();
        std::fs::write(self.folder.join("sky.hdr"), sky).unwrap();
        std::fs::write(self.folder.join("broken.binary"), [90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0, 1])
            .unwrap();
    }

    /// One action.
    fn act(&mut self, driver: &mut Driver) {
        let kind = match self.dice.below(100) {
            0..45 => self.press_a_button(driver),
            45..60 => self.move_a_slider(driver),
            60..75 => self.press_a_key(driver),
            75..84 => self.give_a_path(driver),
            84..90 => self.close_a_material(driver),
            90..94 => self.resize(driver),
            94..98 => self.change_a_file(),
            98 if self.losses > 0 => self.lose_the_device(driver),
            _ => self.wait(driver),
        };
        *self.done.entry(kind).or_default() += 1;
    }

    /// What can be used now, of one role.
    fn usable(driver: &Driver, role: Role) -> Vec<(egui::accesskit::NodeId, String)> {
        let nodes = driver.harness.root().children_recursive();
        let usable =
            nodes.filter(|node| node.accesskit_node().role() == role && !node.accesskit_node().is_disabled());
        usable
            .map(|node| (node.accesskit_node().locate().0, node.accesskit_node().label().unwrap_or_default()))
            .collect()
    }

    fn press_a_button(&mut self, driver: &mut Driver) -> &'static str {
        let role = self.dice.one(&[Role::Button, Role::Button, Role::CheckBox, Role::RadioButton]).unwrap();
        let mut buttons = Self::usable(driver, role);
        // The dialog of the system cannot be closed from here.
        buttons.retain(|(_, label)| label != "Browse…");
        let Some((node, _)) = self.dice.one(&buttons) else { return "nothing" };
        let nodes = driver.harness.root().children_recursive();
        if let Some(found) = nodes.into_iter().find(|found| found.accesskit_node().locate().0 == node) {
            found.click_accesskit();
        }
        driver.harness.run_steps(2);
        "button"
    }

    fn move_a_slider(&mut self, driver: &mut Driver) -> &'static str {
        let sliders = Self::usable(driver, Role::Slider);
        let Some((node, label)) = self.dice.one(&sliders) else { return "nothing" };
        let mut share = self.dice.share();
        let nodes = driver.harness.root().children_recursive();
        if let Some(found) = nodes.into_iter().find(|found| found.accesskit_node().locate().0 == node) {
            let (low, high) = {
                let data = found.accesskit_node();
                let data = data.data();
                (data.min_numeric_value().unwrap_or(0.0), data.max_numeric_value().unwrap_or(1.0))
            };
            // Large fits would leave time for nothing else.
            if label == "Samples" {
                share *= 0.02;
            }
            found.set_value_accesskit(low + share * (high - low));
        }
        driver.harness.run_steps(2);
        "slider"
    }

    fn press_a_key(&mut self, driver: &mut Driver) -> &'static str {
        let plain = [
            Key::Num1,
            Key::Num2,
            Key::Num3,
            Key::Num4,
            Key::Num5,
            Key::Num6,
            Key::L,
            Key::C,
            Key::O,
            Key::H,
            Key::F1,
            Key::Escape,
            Key::Tab,
            Key::ArrowLeft,
            Key::Plus,
            Key::Home,
        ];
        if let Some(key) = self.dice.one(&plain) {
            driver.press(key);
        }
        "key"
    }

    /// Opens a window that asks for a path, and gives it one that may be whole, broken, or not there.
    fn give_a_path(&mut self, driver: &mut Driver) -> &'static str {
        let key = self.dice.one(&[Key::O, Key::S]).unwrap();
        driver.press_with_ctrl(key);
        let label = if key == Key::O { "Path to open" } else { "Path" };
        let names = [
            "samples.csv",
            "mesh.obj",
            "sky.hdr",
            "broken.binary",
            "absent.csv",
            "session.json",
            "no/folder.json",
        ];
        let name = self.dice.one(if key == Key::O { &names } else { &names[5..] }).unwrap();
        if driver.harness.query_by_role_and_label(Role::TextInput, label).is_some() {
            driver.enter(label, &self.folder.join(name).display().to_string());
            let verb = if key == Key::O { "Open" } else { "Write" };
            let buttons = driver.harness.query_all_by_role_and_label(Role::Button, verb);
            if let Some(button) = buttons.into_iter().find(|button| !button.accesskit_node().is_disabled()) {
                button.click_accesskit();
            }
            driver.harness.run_steps(2);
        }
        driver.press(Key::Escape);
        "path"
    }

    fn close_a_material(&mut self, driver: &mut Driver) -> &'static str {
        let buttons = Self::usable(driver, Role::Button);
        let removers: Vec<String> = buttons
            .into_iter()
            .map(|(_, label)| label)
            .filter(|label| label.starts_with("Remove "))
            .collect();
        // Many materials would be slow, not new.
        for label in removers.iter().skip(3).chain(self.dice.one(&removers).iter()) {
            let nodes = driver.harness.query_all_by_role_and_label(Role::Button, label);
            if let Some(node) = nodes.into_iter().next() {
                node.click_accesskit();
            }
            driver.harness.run_steps(2);
        }
        "close"
    }

    fn resize(&mut self, driver: &mut Driver) -> &'static str {
        let size = [300.0 + 900.0 * self.dice.share(), 200.0 + 700.0 * self.dice.share()];
        #[expect(clippy::cast_possible_truncation, reason = "points of a window")]
        driver.harness.set_size(egui::vec2(size[0] as f32, size[1] as f32));
        driver.harness.run_steps(2);
        "resize"
    }

    /// Damages, removes, changes or mends files that may be open.
    fn change_a_file(&mut self) -> &'static str {
        let path =
            self.folder.join(self.dice.one(&["samples.csv", "sky.hdr", "session.json", "mesh.obj"]).unwrap());
        match self.dice.below(4) {
            0 => drop(std::fs::remove_file(path)),
            1 => std::fs::write(path, b"\xFF\xFEhalf").unwrap(),
            2 => std::fs::write(self.folder.join("samples.csv"), rows(3 + self.dice.below(30))).unwrap(),
            _ => self.mend(),
        }
        "file"
    }

    fn lose_the_device(&mut self, driver: &mut Driver) -> &'static str {
        self.losses -= 1;
        self.device.device().destroy();
        driver.harness.run_steps(5);
        self.device = Context::open(AdapterChoice::Any).unwrap();
        let viewer = driver.harness.state_mut().as_mut().unwrap();
        viewer.use_device(&self.device).unwrap();
        "lost device"
    }

    fn wait(&mut self, driver: &mut Driver) -> &'static str {
        std::thread::sleep(Duration::from_millis(200));
        driver.harness.run_steps(3);
        "wait"
    }

    /// Comes back to one small material in a small window, whatever is open, and waits until nothing is done any more.
    fn rest(&mut self, driver: &mut Driver) {
        for _ in 0..3 {
            driver.press(Key::Escape);
        }
        driver.harness.set_size(egui::vec2(700.0, 360.0));
        driver.press(Key::Num1);
        if driver.harness.query_by_role_and_label(Role::Button, "File").is_none() {
            driver.press(Key::F1);
        }
        loop {
            let buttons = Self::usable(driver, Role::Button);
            let Some((_, label)) = buttons.into_iter().find(|(_, label)| label.starts_with("Remove ")) else {
                break;
            };
            let nodes = driver.harness.query_all_by_role_and_label(Role::Button, &label);
            if let Some(node) = nodes.into_iter().next() {
                node.click_accesskit();
            }
            driver.harness.run_steps(3);
        }
        self.mend();
        driver.press_with_ctrl(Key::O);
        driver.enter("Path to open", &self.folder.join("samples.csv").display().to_string());
        // A message may lie over the button.
        driver.harness.get_by_role_and_label(Role::Button, "Open").click_accesskit();
        driver.harness.run_steps(3);
        // Where no window is open any more, Escape would cancel the fit.
        if driver.harness.query_by_label("Path to open").is_some() {
            driver.press(Key::Escape);
        }
        driver.wait("samples", |d| d.harness.query_by_label("Show samples").is_some());
        if driver.harness.query_by_label("Material").is_some() {
            driver.harness.get_by_label("Material").click();
        }
        driver.wait("rest", |d| d.viewer().is_settled());
    }
}

/// Panics of any thread of this process.
static PANICS: AtomicUsize = AtomicUsize::new(0);

/// A window on a device that can be lost.
fn window(device: &Context) -> Driver {
    let device = device.clone();
    Driver::around([900.0, 700.0], move |ctx| {
        // Damaged files hold characters that no font has; a window shows boxes, and tests panic unless told.
        ctx.set_missing_glyph_policy(egui::MissingGlyphPolicy::Tofu);
        let settings = serde_json::from_str("{\"hint\": false}").unwrap();
        let mut viewer = Viewer::new(ctx, settings, &[PathBuf::from("lambert")]).unwrap();
        viewer.use_device(&device).unwrap();
        viewer
    })
}

#[test]
#[ignore = "the test above runs it in a process of its own"]
fn random_actions() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        PANICS.fetch_add(1, Ordering::Relaxed);
        usual(info);
    }));
    let folder = tempfile::tempdir().unwrap();
    // Where names without a folder are written to.
    std::env::set_current_dir(folder.path()).unwrap();
    let mut user = User::new(1, folder.path(), Context::open(AdapterChoice::Any).unwrap());
    // Threads that stay for the whole process are there after the first window.
    let mut first = window(&user.device);
    user.rest(&mut first);
    drop(first);
    std::thread::sleep(Duration::from_secs(1));
    let few = threads();

    let seconds = given("GPBRDF_SOAK").unwrap_or(SECONDS);
    let (start, mut looks) = (Instant::now(), Vec::new());
    let mut driver = window(&user.device);
    let viewer = driver.harness.state_mut().as_mut().unwrap();
    viewer.set_picture_folder(folder.path().to_owned());
    let mut actions = 0;
    for look in 1..=LOOKS {
        let end = Duration::from_secs_f64(seconds * look as f64 / LOOKS as f64);
        let least = actions + LEAST_ACTIONS;
        while start.elapsed() < end || actions < least {
            user.act(&mut driver);
            actions += 1;
            if actions % PAINTED == 0 {
                // What is written to textures is kept until something is painted, which a window does all the time.
                driver.picture();
            }
            assert_eq!(PANICS.load(Ordering::Relaxed), 0, "after {actions} actions");
        }
        user.rest(&mut driver);
        driver.picture();
        looks.push(Look::at(&user, &driver));
        eprintln!(
            "after {:.0} s and {actions} actions: {:?}",
            start.elapsed().as_secs_f64(),
            looks[looks.len() - 1]
        );
    }
    eprintln!("after all: {:?}", user.done);
    assert_eq!(PANICS.load(Ordering::Relaxed), 0);
    assert!(actions > 50, "{actions} actions");
    // The second half against the first: what is kept for the next use is there by then.
    let (first, second) = looks.split_at(LOOKS / 2);
    let most = |looks: &[Look], of: fn(&Look) -> usize| looks.iter().map(of).max().unwrap();
    let grown = |of| most(second, of).saturating_sub(most(first, of));
    assert!(grown(|look| look.held) <= HELD_MARGIN, "what is held grows: {looks:?}");
    assert!(grown(|look| look.on_device) <= DEVICE_MARGIN, "what is on the device grows: {looks:?}");
    assert!(grown(|look| look.textures) <= TEXTURES_MARGIN, "textures pile up: {looks:?}");
    assert!(grown(|look| look.threads) <= 2, "threads pile up: {looks:?}");
    // What none of these sees, in drivers and libraries.
    let margin = most(first, |look| look.resident) / 4 + 64;
    assert!(grown(|look| look.resident) <= margin, "memory grows: {looks:?}");
    drop(driver);
    let start = Instant::now();
    while threads() > few {
        assert!(start.elapsed() < Duration::from_secs(30), "{} threads are left, not {few}", threads());
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// What is written again and again until the process is killed.
const SAVED: [(&str, &str); 3] = [
    ("Save model…", "model.safetensors"),
    ("Export slices…", "slices.png"),
    ("Export curves…", "curves.csv"),
];

#[test]
#[ignore = "the test below runs it in a process of its own, and kills it"]
fn saves_without_end() {
    let Some(folder) = std::env::var_os("GPBRDF_SAVES").map(PathBuf::from) else { return };
    let mut driver = Driver::new(&[PathBuf::from("lambert")]);
    driver.slide("Samples", 100.0);
    driver.fitted();
    loop {
        for (item, name) in SAVED {
            driver.click("File");
            driver.click(item);
            driver.give_path(&folder.join(name), "Write");
        }
        driver.press_with_ctrl(Key::S);
        driver.give_path(&folder.join("session.json"), "Write");
        let all = || SAVED.iter().map(|(_, name)| *name).chain(["session.json"]);
        driver.wait("files", |_| all().all(|name| folder.join(name).exists()));
        std::fs::write(folder.join("ready"), "").unwrap();
    }
}

/// Whether a file holds all that its kind should.
fn is_whole(path: &Path) -> bool {
    let bytes = std::fs::read(path).unwrap();
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("json") => check_session(&bytes, path).is_ok(),
        Some("safetensors") => Model::from_bytes(&bytes, path).is_ok(),
        Some("png") => image::load_from_memory(&bytes).is_ok(),
        Some("exr") => gpbrdf_core::formats::read_linear_image(path).is_ok(),
        Some("csv") => bytes.ends_with(b"\n") && bytes.len() > 100,
        _ => bytes.is_empty(),
    }
}

#[test]
fn a_viewer_that_is_killed_while_it_saves_leaves_whole_files() {
    let count = given("GPBRDF_KILLS").unwrap_or(2.0);
    let mut dice = Dice(SplitMix64::new(7));
    let folder = tempfile::tempdir().unwrap();
    let (mut kills, mut writing) = (0.0, 0);
    while kills < count {
        let _ = std::fs::remove_file(folder.path().join("ready"));
        let mut command = alone("viewer::long_life::saves_without_end");
        command.env("GPBRDF_SAVES", folder.path()).stdout(Stdio::null()).stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        let start = Instant::now();
        while !folder.path().join("ready").exists() {
            assert!(child.try_wait().unwrap().is_none() && start.elapsed() < Duration::from_secs(240));
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(Duration::from_secs_f64(2.0 * dice.share()));
        let paths = || std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
        let is_temporary = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "tmp");
        // Files take a short while only; every other time it is one in which something is written.
        let start = Instant::now();
        while kills % 2.0 > 0.5 && !paths().any(|path| is_temporary(&path)) {
            assert!(start.elapsed() < Duration::from_secs(60), "nothing is written");
        }
        // SIGKILL.
        child.kill().unwrap();
        child.wait().unwrap();
        kills += 1.0;
        let (temporary, whole): (Vec<_>, Vec<_>) = paths().partition(is_temporary);
        let temporary = temporary.len();
        for path in whole {
            assert!(is_whole(&path), "kill {kills}: {} is not whole", path.display());
        }
        assert!(temporary <= 8, "kill {kills}: temporary files pile up");
        writing += usize::from(temporary > 0);
    }
    eprintln!("viewer: {kills} kills, {writing} of them while files were written");
}
