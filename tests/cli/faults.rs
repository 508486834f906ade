//! A machine that lacks something: room on the disk, a folder to write to, variables of the environment, a graphics
//! adapter, memory. A command does its work, or says in one line what is missing and leaves nothing behind.
#![cfg(target_os = "linux")]

use std::io::Write;
use std::process::{Command, Stdio};

use crate::harness::{Cli, PROGRAM, Run};

/// Says on standard error, uncaptured, that a test is skipped.
fn skipped(why: &str) {
    std::io::stderr().write_all(format!("skipped: {why}\n").as_bytes()).unwrap();
}

/// What the script of [`on_its_own_disk`] ends with where nothing can be mounted.
const UNMOUNTABLE: i32 = 77;

/// Runs a command while the folder `disk` is a file system in memory with these options of `mount`, which goes with
/// the command. Returns how it ended, and the names that it left on the disk; `None` where this user may mount nothing.
fn on_its_own_disk(
    cli: &Cli,
    options: &str,
    prepare: &str,
    arguments: &[&str],
) -> Option<(Run, Vec<String>)> {
    std::fs::create_dir_all(cli.path("disk")).unwrap();
    let script = format!(
        "mount -t tmpfs -o size=8m tmpfs disk || exit {UNMOUNTABLE}\n{prepare}\n\
         mount -o remount,{options} disk || exit {UNMOUNTABLE}\n\
         \"$@\"\ncode=$?\n(cd disk && find . -mindepth 1) >names\nexit $code"
    );
    let mut command = Command::new("unshare");
    command.args(["-rm", "sh", "-c", &script, "sh", PROGRAM]).args(arguments);
    command.current_dir(cli.path(".")).stdin(Stdio::null());
    let output = command.output().ok()?;
    let run = Run::from(output);
    if run.code == Some(UNMOUNTABLE) || run.stderr.starts_with("unshare: ") {
        skipped(&format!("cannot mount a file system: {}", run.stderr.lines().next().unwrap_or_default()));
        return None;
    }
    let names = String::from_utf8(cli.read("names")).unwrap().lines().map(str::to_owned).collect();
    Some((run, names))
}

/// One line on standard error that ends with `end`, and nothing else.
fn said(run: &Run, end: &str) {
    assert!(run.code == Some(1) && run.stdout.is_empty(), "{run:?}");
    let line = run.stderr.strip_suffix('\n').unwrap();
    assert!(line.starts_with("error: ") && line.ends_with(end) && !line.contains('\n'), "{run:?}");
}

/// Commands that write, with what they write to the folder `disk`.
const WRITERS: [&[&str]; 7] = [
    &[
        "-q",
        "bake",
        "phong",
        "--lattice",
        "10x8x6",
        "--no-images",
        "--no-sigma",
        "--no-metrics",
        "-o",
        "disk/out",
    ],
    &["-q", "convert", "phong", "disk/a.binary"],
    &["-q", "convert", "phong", "disk/a.csv", "--samples", "2000"],
    &["-q", "fit", "phong", "--lattice", "32x16x12", "-o", "disk/a.safetensors"],
    &["-q", "sample", "phong", "--count", "2000", "-o", "disk/a.csv"],
    &["-q", "slice", "phong", "--size", "128", "-o", "disk/a.png"],
    &["-q", "man", "-o", "disk/pages"],
];

#[test]
fn a_full_disk_is_named_and_nothing_is_left_on_it() {
    let cli = Cli::new();
    for arguments in WRITERS {
        // Eight kilobytes are left.
        let prepare = "dd if=/dev/zero of=disk/full bs=4k count=2046 2>/dev/null";
        let Some((run, names)) = on_its_own_disk(&cli, "rw", prepare, arguments) else { return };
        said(&run, "No space left on device (os error 28)");
        assert!(run.stderr.contains("disk/"), "{run:?}");
        assert_eq!(names, ["./full"], "{arguments:?}");
    }
    // What was there stays.
    let prepare = "echo old >disk/a.binary; dd if=/dev/zero of=disk/full bs=4k count=2000 2>/dev/null";
    let Some((run, mut names)) = on_its_own_disk(&cli, "rw", prepare, WRITERS[1]) else { return };
    said(&run, "No space left on device (os error 28)");
    names.sort();
    assert_eq!(names, ["./a.binary", "./full"]);
}

#[test]
fn a_full_disk_stops_a_batch() {
    let cli = Cli::new();
    let arguments =
        ["-q", "batch", "phong", "lambert", "--lattice", "10x8x6", "--no-metrics", "-o", "disk/out"];
    let Some((run, names)) = on_its_own_disk(&cli, "rw", "", &arguments) else { return };
    // Tables of 35 MB do not fit; the record does, and says so.
    assert_eq!(run.code, Some(1), "{run:?}");
    for name in ["phong", "lambert"] {
        assert!(
            run.stderr.contains(&format!("error: {name}: cannot write \"disk/out/{name}/table.")),
            "{run:?}"
        );
    }
    assert_eq!(names, ["./out", "./out/batch.jsonl"], "{run:?}");
}

#[test]
fn a_disk_that_cannot_be_written_to_is_named() {
    let cli = Cli::new();
    for arguments in WRITERS {
        let Some((run, names)) = on_its_own_disk(&cli, "ro", "echo old >disk/old", arguments) else { return };
        said(&run, "Read-only file system (os error 30)");
        assert!(run.stderr.contains("disk/"), "{run:?}");
        assert_eq!(names, ["./old"], "{arguments:?}");
    }
}

/// The program without any variable of the environment.
fn bare(cli: &Cli, arguments: &[&str]) -> Run {
    let mut command = Command::new(PROGRAM);
    command.args(arguments).env_clear().current_dir(cli.path(".")).stdin(Stdio::null());
    Run::from(command.output().unwrap())
}

#[test]
fn neither_a_home_nor_threads_are_needed() {
    let cli = Cli::new();
    let usual = cli.ok(&["eval", "phong", "lambert", "--json"]);
    let run = bare(&cli, &["eval", "phong", "lambert", "--json", "--threads", "1"]);
    assert!(run.code == Some(0) && run.stderr.is_empty(), "{run:?}");
    assert_eq!(run.stdout, usual);
    let run =
        bare(&cli, &["fit", "phong", "--lattice", "6x4x4", "-o", "m.safetensors", "-q", "--threads", "1"]);
    assert!(run.code == Some(0) && run.stdout.is_empty() && run.stderr.is_empty(), "{run:?}");
}

#[test]
fn without_an_adapter_the_processor_does_what_it_can() {
    let cli = Cli::new();
    let without = |arguments: &[&str]| {
        let mut command = cli.command(arguments);
        for (name, value) in [
            ("VK_DRIVER_FILES", "/dev/null"),
            ("VK_ICD_FILENAMES", "/dev/null"),
            ("__EGL_VENDOR_LIBRARY_FILENAMES", "/dev/null"),
            ("LIBGL_DRIVERS_PATH", "/nowhere"),
            ("GBM_BACKENDS_PATH", "/nowhere"),
        ] {
            command.env(name, value);
        }
        Run::from(command.output().unwrap())
    };
    let run = without(&["render", "phong", "-o", "a.png", "--spp", "1", "--size", "32x32", "-q"]);
    assert!(run.code == Some(1) && run.stdout.is_empty() && !cli.path("a.png").exists(), "{run:?}");
    assert!(run.stderr.starts_with("error: ") && run.stderr.trim_end().lines().count() == 1, "{run:?}");
    assert!(run.stderr.contains("adapter"), "{run:?}");
    let small = ["--lattice", "10x8x6", "--no-metrics", "--no-sigma", "-q"];
    let bake = |backend, folder| {
        without(&[&["bake", "phong", "--backend", backend, "-o", folder], &small[..]].concat())
    };
    // A sphere is drawn by the processor.
    let run = bake("auto", "auto");
    assert!(run.code == Some(0) && run.stdout.is_empty(), "{run:?}");
    assert!(cli.path("auto/sphere.png").is_file());
    let run = bake("gpu", "gpu");
    assert!(run.code == Some(1) && run.stderr.contains("adapter") && !cli.path("gpu").exists(), "{run:?}");
}

/// A group of processes with a limit of memory, removed with the value.
struct Limited(std::path::PathBuf);

impl Limited {
    /// `None` where this user may make none.
    fn new(bytes: u64) -> Option<Self> {
        let name = format!("gpbrdf-{}-{bytes}", std::process::id());
        let (first, second) =
            (std::path::Path::new("/sys/fs/cgroup/memory"), std::path::Path::new("/sys/fs/cgroup"));
        let (root, limit) =
            if first.is_dir() { (first, "memory.limit_in_bytes") } else { (second, "memory.max") };
        let group = Self(root.join(name));
        std::fs::create_dir(&group.0).ok()?;
        std::fs::write(group.0.join(limit), bytes.to_string()).ok()?;
        Some(group)
    }
}

impl Drop for Limited {
    fn drop(&mut self) {
        // Its processes have ended.
        let _ = std::fs::remove_dir(&self.0);
    }
}

#[test]
fn two_hundred_mebibytes_are_enough_for_a_built_in_material() {
    let cli = Cli::new();
    let Some(group) = Limited::new(200 << 20) else { return skipped("cannot limit the memory of a process") };
    let script = format!("echo $$ >'{}/cgroup.procs' || exit {UNMOUNTABLE}; exec \"$@\"", group.0.display());
    for arguments in [
        &["eval", "phong", "lambert", "--json"][..],
        &["bake", "phong", "--backend", "cpu", "-q", "-o", "out"],
    ] {
        let mut command = Command::new("sh");
        command.args(["-c", &script, "sh", PROGRAM]).args(arguments).current_dir(cli.path("."));
        let run = Run::from(command.output().unwrap());
        if run.code == Some(UNMOUNTABLE) {
            return skipped("cannot limit the memory of a process");
        }
        assert!(run.code == Some(0) && run.stderr.is_empty(), "{arguments:?}: {run:?}");
    }
    assert_eq!(cli.names("out").len(), 6);
}

#[test]
fn a_small_address_space_is_named_and_a_larger_one_takes_fewer_threads() {
    let cli = Cli::new();
    let within = |mebibytes: u64, arguments: &[&str]| {
        let mut command = Command::new("sh");
        command
            .args(["-c", &format!("ulimit -v {}; exec \"$@\"", mebibytes << 10), "sh", PROGRAM])
            .args(arguments);
        Run::from(command.current_dir(cli.path(".")).stdin(Stdio::null()).output().unwrap())
    };
    for arguments in [&["eval", "phong", "lambert"][..], &["bake", "phong", "-o", "out"]] {
        let run = within(200, arguments);
        assert!(run.code == Some(1) && run.stdout.is_empty() && !cli.path("out").exists(), "{run:?}");
        assert!(run.stderr.starts_with("error: expected an address space of at least "), "{run:?}");
        assert!(run.stderr.ends_with(" MiB, found a limit of 200 MiB (`ulimit -v`)\n"), "{run:?}");
    }
    let run = within(200, &["materials"]);
    assert!(run.code == Some(0) && run.stderr.is_empty(), "{run:?}");
    // The least that is enough, which the message says.
    let said = within(200, &["eval", "phong", "lambert"]).stderr;
    let least = said.split_whitespace().find_map(|word| word.parse().ok()).unwrap();
    for arguments in [
        &["eval", "phong", "lambert", "-q"][..],
        &[
            "bake",
            "phong",
            "--lattice",
            "24x16x12",
            "--no-images",
            "--no-metrics",
            "-q",
            "--threads",
            "8",
            "-o",
            "out",
        ],
    ] {
        let run = within(least, arguments);
        assert!(run.code == Some(0) && run.stderr.is_empty(), "{arguments:?} within {least} MiB: {run:?}");
    }
}
