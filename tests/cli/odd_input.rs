//! Input that is right but unusual: few, equal, dark, huge and grazing samples; unusual names and places.

use serde_json::Value;

use crate::harness::Cli;

const HEADER: &str = "theta_i,phi_i,theta_o,phi_o,r,g,b\n";

/// Bakes a CSV file without pictures and returns the report.
fn bake(cli: &Cli, rows: &str) -> Value {
    cli.write("s.csv", format!("{HEADER}{rows}"));
    let run = cli.run(&["bake", "s.csv", "-o", "out", "--no-images", "--json"]);
    assert_eq!(run.code, Some(0), "{rows}: {run:?}");
    assert!(!run.stderr.contains("panicked"), "{run:?}");
    serde_json::from_str(&run.stdout).unwrap()
}

#[test]
fn few_and_degenerate_samples_still_give_a_table() {
    let cli = Cli::new();
    for rows in [
        "10,0,20,180,1,2,3\n",
        "10,0,20,180,1,2,3\n10,0,20,180,1,2,3\n",
        "10,0,20,180,1,2,3\n10,0,20,180,2,4,6\n",
        "10,0,20,180,0,0,0\n30,0,20,180,0,0,0\n30,0,40,180,0,0,0\n",
        "10,0,20,180,1e-300,5e-324,0\n30,0,20,180,1e-308,0,0\n",
        "-0,0,0,0,1,1,1\n0,0,0,0,1,1,2\n89.9999999,0,89.99999,0,1,1,1\n",
    ] {
        let report = bake(&cli, rows);
        assert_eq!(report["samples"], rows.lines().count());
        assert!(report["log_marginal_likelihood"].as_f64().is_some(), "{report:#}");
        let table = gpbrdf_core::formats::read_merl(cli.path("out/table.binary")).unwrap();
        assert!(table.values().as_flattened().iter().all(|x| x.is_finite() && *x >= 0.0), "{rows}");
    }
    // A single value, or nothing but black, is predicted everywhere.
    for (rows, expected) in
        [("10,0,20,180,1,2,3\n", [1.0, 2.0, 3.0]), ("10,0,20,180,0,0,0\n30,0,20,180,0,0,0\n", [0.0; 3])]
    {
        bake(&cli, rows);
        let table = gpbrdf_core::formats::read_merl(cli.path("out/table.binary")).unwrap();
        for value in [table.cell(0, 0, 0), table.cell(45, 45, 90)] {
            for c in 0..3 {
                assert!((value[c] - expected[c]).abs() < 1e-4, "{value:?} for {rows}");
            }
        }
    }
}

#[test]
fn values_beyond_f32_are_refused_by_name() {
    let cli = Cli::new();
    cli.write("s.csv", format!("{HEADER}10,0,20,180,1,1,1e300\n"));
    assert_eq!(
        cli.fails(&["bake", "s.csv", "-o", "new"]),
        "samples CSV file \"s.csv\": expected a value within the range of f32 in column `b` on line 2, found 1e300"
    );
    // Within the range, but the trend leads out of it.
    cli.write(
        "s.csv",
        format!("{HEADER}0,0,0,0,1,1,1\n5,0,5,180,1e19,1e19,1e19\n10,0,10,180,1e38,1e38,1e38\n"),
    );
    for transform in ["log", "identity", "cube-root"] {
        let arguments = ["bake", "s.csv", "-o", "new", "--no-images", "-q", "--transform", transform];
        let run = cli.run(&arguments);
        if run.code == Some(1) {
            let message = cli.fails(&arguments);
            assert!(message.contains("new/table.binary\": expected finite values, found "), "{message}");
        } else {
            assert_eq!(run.code, Some(0), "{run:?}");
        }
    }
}

#[test]
fn an_input_may_be_its_own_output() {
    let cli = Cli::new();
    let arguments = ["--lattice", "6x4x4", "--no-images", "--no-metrics", "-q", "-o", "out"];
    cli.ok(&[&["bake", "phong"], &arguments[..]].concat());
    cli.ok(&[&["bake", "out/table.binary"], &arguments[..]].concat());
    let report: Value = serde_json::from_slice(&cli.read("out/report.json")).unwrap();
    assert_eq!(report["source"], "out/table.binary");
    cli.ok(&["fit", "out/model.safetensors", "--lattice", "4x4x4", "-q", "-o", "out/model.safetensors"]);
    let found = cli.json(&["info", "out/model.safetensors", "--json"]);
    assert_eq!(found["details"]["samples"], 64);
    assert_eq!(cli.names("out"), ["model.safetensors", "report.json", "table.binary", "table.exr"]);
}

#[cfg(unix)]
#[test]
fn any_file_name_will_do() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    use std::os::unix::fs::symlink;
    let cli = Cli::new();
    let odd = |bytes: &'static [u8]| OsStr::from_bytes(bytes);
    cli.write(odd(b"n\xFF.csv"), format!("{HEADER}10,0,20,180,1,2,3\n"));
    cli.ok(&[odd(b"fit"), odd(b"n\xFF.csv"), odd(b"-o"), odd(b"m\xFF.safetensors"), odd(b"-q")]);
    let found = cli.json(&[odd(b"info"), odd(b"m\xFF.safetensors"), odd(b"--json")]);
    assert_eq!(found["details"]["samples"], 1);
    cli.ok(&[
        odd(b"bake"),
        odd(b"m\xFF.safetensors"),
        odd(b"-o"),
        odd(b"o\xFF"),
        odd(b"--lattice"),
        odd(b"4x4x4"),
        odd(b"--no-images"),
    ]);
    assert!(cli.path(odd(b"o\xFF/table.binary")).is_file());

    // The longest name that the system takes; one more is refused by it.
    let long = "y".repeat(255);
    cli.ok(&["fit", "lambert", "--lattice", "4x4x4", "-o", &long]);
    let message = cli.fails(&["fit", "lambert", "--lattice", "4x4x4", "-o", &format!("{long}y")]);
    assert!(
        message.ends_with("File name too long (os error 36)") || cfg!(not(target_os = "linux")),
        "{message}"
    );

    // A link stays a link, also one to nothing yet.
    symlink("real.safetensors", cli.path("link")).unwrap();
    for _ in 0..2 {
        cli.ok(&["fit", "lambert", "--lattice", "4x4x4", "-o", "link"]);
        assert!(cli.path("link").is_symlink() && cli.path("real.safetensors").is_file());
    }
    symlink("loop", cli.path("loop")).unwrap();
    assert!(cli.fails(&["info", "loop"]).starts_with("cannot read \"loop\": "));
}
