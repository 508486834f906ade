//! Many materials: each in its folder with a line of its own, also after a batch was killed.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::harness::Cli;

/// Options of materials that take a fraction of a second.
const SMALL: [&str; 5] = ["--lattice", "10x8x6", "--no-metrics", "--write", "binary,model,report,dds"];
const FILES: [&str; 4] = ["model.safetensors", "report.json", "table.binary", "table.dds"];
const MATERIALS: [&str; 6] = ["lambert", "phong", "ward", "cook-torrance", "red-plastic", "cherry-235"];

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn record(cli: &Cli, path: &str) -> Vec<Value> {
    lines(&String::from_utf8(cli.read(path)).unwrap())
}

fn batch<'a>(inputs: &[&'a str], options: &[&'a str]) -> Vec<&'a str> {
    [&["batch"], inputs, &SMALL[..], options].concat()
}

fn sorted_names(lines: &[Value]) -> Vec<&str> {
    let mut names: Vec<&str> = lines.iter().map(|line| line["name"].as_str().unwrap()).collect();
    names.sort_unstable();
    names
}

/// The files of each material, but for the report, which has times in it.
fn files(cli: &Cli, folder: &str) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for material in cli.names(folder).iter().filter(|name| !name.ends_with(".jsonl")) {
        for name in cli.names(&format!("{folder}/{material}")) {
            let path = format!("{material}/{name}");
            let content =
                if name == "report.json" { Vec::new() } else { cli.read(format!("{folder}/{path}")) };
            files.insert(path, content);
        }
    }
    files
}

#[test]
fn each_material_is_what_bake_makes_of_it() {
    let cli = Cli::new();
    for name in ["phong", "ward"] {
        cli.ok(&["convert", name, &format!("{name}.binary")]);
    }
    // The pattern is not expanded by a shell here.
    let options = ["--lattice", "10x8x6", "-o", "out", "-q"];
    let printed = cli.ok(&[&["batch", "*.binary", "lambert"], &options[..]].concat());
    let found = lines(&printed);
    assert_eq!(sorted_names(&found), ["lambert", "phong", "ward"]);
    let (mut written, mut shown) = (record(&cli, "out/batch.jsonl"), found.clone());
    for lines in [&mut written, &mut shown] {
        lines.sort_by_key(|line| line["name"].to_string());
    }
    assert_eq!(written, shown);
    for line in &found {
        let (name, file) = (line["name"].as_str().unwrap(), line["file"].as_str().unwrap());
        let report: Value = cli.json(&["bake", file, "--lattice", "10x8x6", "--json", "-o", "one"]);
        assert_eq!(line["metrics"], report["metrics"], "{name}");
        let usual: Vec<String> =
            ["model.safetensors", "report.json", "slice.png", "sphere.png", "table.binary", "table.exr"]
                .map(str::to_owned)
                .into();
        assert_eq!(cli.names(&format!("out/{name}")), usual);
        for file in usual.iter().filter(|file| *file != "report.json") {
            assert!(
                cli.read(format!("out/{name}/{file}")) == cli.read(format!("one/{file}")),
                "{name}/{file}"
            );
            let bytes = cli.read(format!("one/{file}")).len();
            assert_eq!(line["outputs"][file], bytes, "{name}/{file}");
        }
        assert!(line["seconds"]["total"].as_f64().unwrap() > 0.0 && line["converged"].is_boolean());
        let info = cli.json(&["info", "--json", file]);
        assert_eq!(line["sha256"].as_str().unwrap_or_default(), info["sha256"].as_str().unwrap(), "{name}");
    }
}

#[test]
fn broken_files_are_reported_and_the_rest_is_made() {
    let cli = Cli::new();
    cli.write("broken.csv", "theta_i,phi_i,theta_o,phi_o,f\n1,2,3,4\n");
    cli.write("empty.binary", "");
    let inputs = ["lambert", "broken.csv", "empty.binary", "absent", "phong"];
    let run = cli.run(&batch(&inputs, &["-o", "out", "-q"]));
    assert_eq!(run.code, Some(1), "{run:?}");
    let found = lines(&run.stdout);
    assert_eq!(found.len(), inputs.len());
    for (name, said) in [("broken", "broken.csv"), ("empty", "empty.binary"), ("absent", "found neither")] {
        let line = found.iter().find(|line| line["name"] == name).unwrap();
        let error = line["error"].as_str().unwrap();
        assert!(error.contains(said) && !error.contains('\n'), "{error}");
        assert!(run.stderr.contains(&format!("error: {name}: {error}\n")), "{run:?}");
        assert!(!cli.path(format!("out/{name}")).exists());
    }
    let last = run.stderr.lines().last().unwrap();
    assert!(last.starts_with("error: 3 of 5 materials failed, as \"out/batch.jsonl\" says: "), "{last}");
    for name in ["lambert", "phong"] {
        assert_eq!(cli.names(&format!("out/{name}")), FILES);
    }
    // What has failed is tried again; what is finished is not.
    cli.write("empty.binary", std::fs::read(cli.path("out/phong/table.binary")).unwrap());
    let run = cli.run(&batch(&inputs, &["-o", "out"]));
    assert!(run.stderr.contains("note: 2 of 5 materials were finished before"), "{run:?}");
    assert_eq!(record(&cli, "out/batch.jsonl").len(), 8);
    assert_eq!(cli.names("out/empty"), FILES);
}

#[test]
fn only_what_has_changed_is_made_again() {
    let cli = Cli::new();
    cli.ok(&["convert", "phong", "a.binary"]);
    cli.ok(&["convert", "ward", "b.binary"]);
    let inputs = ["a.binary", "b.binary", "lambert"];
    let again = |options: &[&str]| {
        let before = record(&cli, "out/batch.jsonl").len();
        let printed = lines(&cli.ok(&batch(&inputs, &[&["-o", "out", "-q"], options].concat())));
        assert_eq!(sorted_names(&printed), ["a", "b", "lambert"]);
        let made = record(&cli, "out/batch.jsonl");
        sorted_names(&made[before..]).join(" ")
    };
    cli.ok(&batch(&inputs, &["-o", "out", "-q"]));
    assert_eq!(again(&[]), "");
    // A file that is shorter than it was.
    let table = cli.read("out/b/table.binary");
    cli.write("out/b/table.binary", &table[..1000]);
    assert_eq!(again(&[]), "b");
    assert!(cli.read("out/b/table.binary") == table);
    std::fs::remove_file(cli.path("out/lambert/table.dds")).unwrap();
    assert_eq!(again(&[]), "lambert");
    // Another content.
    cli.ok(&["convert", "cook-torrance", "a.binary"]);
    assert_eq!(again(&[]), "a");
    // Other options, and back.
    assert_eq!(again(&["--kernel", "se"]), "a b lambert");
    assert_eq!(again(&["--kernel", "se"]), "");
    // A last line that was cut off.
    let mut text = cli.read("out/batch.jsonl");
    text.truncate(text.len() - 20);
    cli.write("out/batch.jsonl", &text);
    let run = cli.run(&batch(&inputs, &["-o", "out", "--kernel", "se"]));
    assert!(
        run.code == Some(0) && run.stderr.contains("note: out: 1 lines of records were cut off"),
        "{run:?}"
    );
    let text = String::from_utf8(cli.read("out/batch.jsonl")).unwrap();
    assert!(serde_json::from_str::<Value>(text.lines().last().unwrap()).is_ok());
}

#[cfg(unix)]
#[test]
fn a_batch_that_was_killed_goes_on() {
    let cli = Cli::new();
    cli.ok(&batch(&MATERIALS, &["-o", "whole", "-q"]));
    let arguments = batch(&MATERIALS, &["-o", "out", "-q", "--jobs", "2"]);
    let mut kills = 0;
    // Killed again and again, after one more material each time.
    for count in 1..MATERIALS.len() {
        let mut child = cli.command(&arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let begin = Instant::now();
        let written = || std::fs::read_to_string(cli.path("out/batch.jsonl")).unwrap_or_default();
        while written().matches('\n').count() < count && child.try_wait().unwrap().is_none() {
            assert!(begin.elapsed() < Duration::from_secs(120));
            std::thread::sleep(Duration::from_millis(1));
        }
        // In the middle of the next ones.
        std::thread::sleep(Duration::from_millis(7 * count as u64));
        kills += usize::from(child.try_wait().unwrap().is_none());
        // SIGKILL.
        child.kill().unwrap();
        child.wait().unwrap();
        for line in record(&cli, "out/batch.jsonl") {
            let (name, outputs) = (line["name"].as_str().unwrap(), line["outputs"].as_object().unwrap());
            for (file, bytes) in outputs {
                assert_eq!(cli.read(format!("out/{name}/{file}")).len() as u64, bytes.as_u64().unwrap());
            }
        }
    }
    assert!(kills > 0, "every batch ended before it was killed");
    cli.write("out/ward/.gpbrdf-1-1.tmp", "what a killed process leaves behind");
    let before = record(&cli, "out/batch.jsonl");
    std::fs::remove_file(cli.path("out/ward/model.safetensors")).unwrap();
    assert_eq!(lines(&cli.ok(&arguments)).len(), MATERIALS.len());
    let after = record(&cli, "out/batch.jsonl");
    assert_eq!(after[..before.len()], before);
    assert_eq!(sorted_names(&after).into_iter().collect::<BTreeSet<_>>().len(), MATERIALS.len());
    assert_eq!(after.len(), MATERIALS.len() + 1, "only ward is made twice");
    assert!(files(&cli, "out") == files(&cli, "whole"));
}

#[test]
fn names_that_collide_are_told_apart_and_parts_are_disjoint() {
    let cli = Cli::new();
    for folder in ["x", "y"] {
        std::fs::create_dir(cli.path(folder)).unwrap();
    }
    for (name, file) in [("phong", "x/a.binary"), ("ward", "y/a.binary"), ("lambert", "b.binary")] {
        cli.ok(&["convert", name, file]);
    }
    let whole = lines(&cli.ok(&batch(&["*/a.binary", "b.binary", "./b.binary"], &["-o", "out", "-q"])));
    assert_eq!(sorted_names(&whole), ["b", "x-a.binary", "y-a.binary"]);
    let mut names = Vec::new();
    for part in ["1/2", "2/2"] {
        let arguments = batch(&["*/a.binary", "b.binary"], &["-o", "parts", "-q", "--part", part]);
        names.extend(
            lines(&cli.ok(&arguments)).into_iter().map(|line| line["name"].as_str().unwrap().to_owned()),
        );
    }
    names.sort();
    assert_eq!(names, ["b", "x-a.binary", "y-a.binary"]);
    assert!(files(&cli, "out") == files(&cli, "parts"));
    assert_eq!(
        record(&cli, "parts/batch-1-of-2.jsonl").len() + record(&cli, "parts/batch-2-of-2.jsonl").len(),
        3
    );
    // The records of all parts count.
    let run = cli.run(&batch(&["*/a.binary", "b.binary"], &["-o", "parts"]));
    assert!(run.stderr.contains("note: 3 of 3 materials were finished before"), "{run:?}");
}

#[test]
fn what_cannot_be_a_batch_is_refused() {
    let cli = Cli::new();
    assert_eq!(
        cli.fails(&["batch", "*.csv", "-o", "out"]),
        "\"*.csv\": expected a pattern that files match, found none"
    );
    assert_eq!(
        cli.fails(&["batch", "-", "-o", "out"]),
        "-: expected files and built-in materials, found standard input"
    );
    for options in [&["--part", "3/2"][..], &["--memory", "0"], &["--jobs", "0"], &["--write", "png"]] {
        cli.misused(&[&["batch", "ward"], options].concat());
    }
    cli.misused(&["batch"]);
}
