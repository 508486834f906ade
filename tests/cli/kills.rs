//! Programs that are killed or interrupted at random moments: every file is the old one or the new one, and nothing
//! stays behind. `GPBRDF_KILLS` asks for more moments of each command than the few of the suite.

use std::collections::BTreeMap;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use gpbrdf_core::base::SplitMix64;
use serde_json::Value;

use crate::harness::Cli;

/// Moments of each command.
fn kills(usual: usize) -> usize {
    std::env::var("GPBRDF_KILLS").ok().and_then(|number| number.parse().ok()).unwrap_or(usual)
}

/// Commands that write to the folder `out`, each in about a second.
const BAKE: [&str; 11] = [
    "-q",
    "bake",
    "phong",
    "--lattice",
    "10x8x6",
    "--no-images",
    "--no-metrics",
    "--no-sigma",
    "--backend=cpu",
    "-o",
    "out",
];
const FIT: [&str; 7] = ["-q", "fit", "phong", "--lattice", "32x16x12", "-o", "out/model.safetensors"];
const LEARN: [&str; 10] = [
    "-q",
    "learn",
    "lambert",
    "phong",
    "--centres",
    "20",
    "--functions",
    "1,1",
    "-o",
    "out/prior.safetensors",
];
const REPRODUCE: [&str; 11] = [
    "-q",
    "reproduce",
    "--quick",
    "--only=figures345",
    "--materials=red-plastic",
    "--width",
    "80",
    "--dpi",
    "36",
    "-o",
    "out",
];

/// The files of a folder by name.
fn files(cli: &Cli, folder: &str) -> BTreeMap<String, Vec<u8>> {
    let path = cli.path(folder);
    let names = if path.is_dir() { cli.names(folder) } else { Vec::new() };
    names.into_iter().map(|name| (name.clone(), cli.read(path.join(name)))).collect()
}

/// Whether a file is what a run wrote, whatever the times in it. Of JSON these are its numbers.
fn is_same(name: &str, found: &[u8], written: &[u8]) -> bool {
    fn without_numbers(value: Value) -> Value {
        match value {
            Value::Number(_) => Value::Null,
            Value::Array(values) => values.into_iter().map(without_numbers).collect(),
            Value::Object(members) => {
                members.into_iter().map(|(name, value)| (name, without_numbers(value))).collect()
            }
            other => other,
        }
    }
    let parsed = |bytes| serde_json::from_slice(bytes).ok().map(without_numbers);
    found == written
        || name.ends_with(".json") && parsed(found).is_some_and(|found| Some(found) == parsed(written))
}

fn is_temporary(name: &str) -> bool {
    name.starts_with(".gpbrdf-") && name.ends_with(".tmp")
}

/// The names and sizes of the temporary files in a folder, which may go while they are looked at.
fn temporary_files(cli: &Cli, folder: &str) -> Vec<(String, u64)> {
    let names = cli.names(folder).into_iter().filter(|name| is_temporary(name));
    names
        .map(|name| {
            let bytes = std::fs::metadata(cli.path(folder).join(&name)).map_or(0, |metadata| metadata.len());
            (name, bytes)
        })
        .collect()
}

fn spawn(cli: &Cli, arguments: &[&str]) -> Child {
    cli.command(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Random moments of a run that takes this long: every other one near its end, where files are written.
fn moments(seed: u64, count: usize, length: Duration) -> impl Iterator<Item = Duration> {
    let mut random = SplitMix64::new(seed);
    (0..count).map(move |i| {
        let share = random.next_unit();
        length.mul_f64(if i % 2 == 0 { share } else { 0.7 + 0.35 * share })
    })
}

/// What became of the runs.
#[derive(Debug, Default)]
struct Tally {
    /// Moments before anything was written, while temporary files were begun or renamed, and after the end.
    before: usize,
    writing: usize,
    ended: usize,
    /// Runs that left some files old and others new, each of them whole.
    mixed: usize,
}

/// What an old file holds.
const OLD: &[u8] = b"old";

/// Kills a command at random moments, each time over old files, and checks what is left.
fn kill_over_old_files(name: &str, arguments: &[&str], seed: u64, count: usize) {
    let cli = Cli::new();
    std::fs::create_dir(cli.path("out")).unwrap();
    let begin = Instant::now();
    cli.ok(arguments);
    let length = begin.elapsed();
    let new = files(&cli, "out");
    let mut tally = Tally::default();
    for (i, moment) in moments(seed, count, length).enumerate() {
        new.keys().for_each(|file| cli.write(format!("out/{file}"), OLD));
        // What the last kill has left stays there.
        let before = temporary_files(&cli, "out");
        let mut child = spawn(&cli, arguments);
        if i % 3 == 2 {
            // As soon as files are begun, or a little later.
            while child.try_wait().unwrap().is_none() && temporary_files(&cli, "out") == before {}
            std::thread::sleep(Duration::from_millis(5 * (i as u64 % 4)));
        } else {
            std::thread::sleep(moment);
        }
        let ended = child.try_wait().unwrap().is_some();
        // SIGKILL.
        child.kill().unwrap();
        child.wait().unwrap();
        let found = files(&cli, "out");
        let after = temporary_files(&cli, "out");
        assert!(after.len() <= new.len(), "{name}, kill {i}: temporary files pile up: {after:?}");
        assert_eq!(found.len(), new.len() + after.len(), "{name}, kill {i}: {:?}", found.keys());
        let renewed = new.iter().filter(|(file, bytes)| is_same(file, &found[*file], bytes)).count();
        let kept = new.keys().filter(|file| found[*file] == OLD).count();
        assert_eq!(
            renewed + kept,
            new.len(),
            "{name}, kill {i} after {moment:?}: a file is neither old nor new"
        );
        tally.mixed += usize::from(renewed > 0 && kept > 0);
        *(if ended {
            &mut tally.ended
        } else if renewed == 0 && after == before {
            &mut tally.before
        } else {
            &mut tally.writing
        }) += 1;
    }
    // The next run leaves its files only.
    cli.ok(arguments);
    let found = files(&cli, "out");
    assert_eq!(
        found.keys().collect::<Vec<_>>(),
        new.keys().collect::<Vec<_>>(),
        "{name}: something stays behind"
    );
    assert!(new.iter().all(|(file, bytes)| is_same(file, &found[file], bytes)), "{name}");
    eprintln!("{name}: {count} kills within {length:?}: {tally:?}");
}

#[test]
fn bake_that_is_killed_leaves_old_files_or_new_ones() {
    kill_over_old_files("bake", &BAKE, 1, kills(6));
}

#[test]
fn fit_that_is_killed_leaves_the_old_model_or_the_new_one() {
    kill_over_old_files("fit", &FIT, 2, kills(10));
}

#[test]
fn learn_that_is_killed_leaves_the_old_prior_or_the_new_one() {
    kill_over_old_files("learn", &LEARN, 3, kills(1));
}

#[test]
fn reproduce_that_is_killed_leaves_old_results_or_new_ones() {
    kill_over_old_files("reproduce", &REPRODUCE, 4, kills(2));
}

/// A batch is killed again and again and goes on each time.
#[test]
fn batch_that_is_killed_at_any_moment_goes_on_without_doing_anything_twice() {
    const MATERIALS: [&str; 4] = ["lambert", "phong", "ward", "red-plastic"];
    const OPTIONS: [&str; 8] = [
        "--lattice",
        "10x8x6",
        "--no-metrics",
        "--no-sigma",
        "--write",
        "binary,model,report",
        "--jobs",
        "2",
    ];
    let cli = Cli::new();
    let batch = [&["batch", "-q", "-o", "out"], &MATERIALS[..], &OPTIONS[..]].concat();
    let begin = Instant::now();
    cli.ok(&batch);
    let length = begin.elapsed();
    std::fs::rename(cli.path("out"), cli.path("whole")).unwrap();
    let lines = || -> Vec<Value> {
        let text = String::from_utf8(std::fs::read(cli.path("out/batch.jsonl")).unwrap_or_default()).unwrap();
        // A last line without an end was cut off.
        let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
        whole.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    };
    let check = |finished: &[Value]| {
        for line in finished {
            let (material, outputs) = (line["name"].as_str().unwrap(), line["outputs"].as_object().unwrap());
            for (file, bytes) in outputs {
                let found = cli.read(format!("out/{material}/{file}"));
                assert_eq!(found.len() as u64, bytes.as_u64().unwrap(), "{material}/{file}");
                assert!(
                    is_same(file, &found, &cli.read(format!("whole/{material}/{file}"))),
                    "{material}/{file}"
                );
            }
        }
    };
    let (mut ended, mut rounds) = (0, 0);
    for moment in moments(5, kills(6), length) {
        let before = lines();
        let mut child = spawn(&cli, &batch);
        std::thread::sleep(moment);
        ended += usize::from(child.try_wait().unwrap().is_some());
        child.kill().unwrap();
        child.wait().unwrap();
        let after = lines();
        assert_eq!(after[..before.len()], before);
        let names: std::collections::BTreeSet<_> = after.iter().map(|line| line["name"].as_str()).collect();
        assert_eq!(names.len(), after.len(), "a material is made twice: {after:?}");
        check(&after);
        if after.len() == MATERIALS.len() {
            // All is there; it begins anew.
            rounds += 1;
            std::fs::remove_dir_all(cli.path("out")).unwrap();
        }
    }
    cli.ok(&batch);
    assert_eq!(lines().len(), MATERIALS.len());
    check(&lines());
    for material in MATERIALS {
        assert_eq!(cli.names(&format!("out/{material}")), cli.names(&format!("whole/{material}")));
    }
    eprintln!("batch: {} kills within {length:?}, {ended} after the end, {rounds} rounds", kills(6));
}

/// Ctrl-C is gentler than a kill: besides whole files it leaves no temporary ones and no empty folder.
#[cfg(unix)]
#[test]
fn an_interruption_at_any_moment_leaves_all_files_or_no_folder() {
    use std::os::unix::process::ExitStatusExt;
    for (name, arguments) in [("bake", &BAKE[..]), ("fit", &FIT)] {
        let cli = Cli::new();
        let is_folder = name == "bake";
        if !is_folder {
            std::fs::create_dir(cli.path("out")).unwrap();
        }
        let begin = Instant::now();
        cli.ok(arguments);
        let length = begin.elapsed();
        let whole = files(&cli, "out");
        let (mut interrupted, mut ended) = (0, 0);
        for moment in moments(6, kills(6), length) {
            if is_folder {
                std::fs::remove_dir_all(cli.path("out")).unwrap_or_default();
            } else {
                std::fs::remove_file(cli.path("out/model.safetensors")).unwrap_or_default();
            }
            let mut child = spawn(&cli, arguments);
            std::thread::sleep(moment);
            // It fails where the program has ended.
            Command::new("kill")
                .args(["-INT", &child.id().to_string()])
                .stderr(Stdio::null())
                .status()
                .unwrap();
            let status = child.wait().unwrap();
            let found = files(&cli, "out");
            match (status.code(), status.signal()) {
                (Some(0), _) => ended += 1,
                // By its handler, or by the system before there was one.
                (Some(130), _) | (_, Some(2)) => interrupted += 1,
                other => panic!("{name} after {moment:?}: {other:?}"),
            }
            if found.is_empty() {
                assert_ne!(status.code(), Some(0), "{name} after {moment:?}");
                assert!(
                    !is_folder || !cli.path("out").exists(),
                    "{name} after {moment:?}: an empty folder is left"
                );
                continue;
            }
            assert_eq!(
                found.keys().collect::<Vec<_>>(),
                whole.keys().collect::<Vec<_>>(),
                "{name} after {moment:?}"
            );
            for (file, bytes) in &found {
                assert!(is_same(file, bytes, &whole[file]), "{name} after {moment:?}: {file}");
            }
        }
        eprintln!("{name}: {interrupted} interruptions within {length:?}, {ended} after the end");
    }
}
