//! The paper's experiments at their smallest, against recorded figures.

use serde_json::Value;

use crate::harness::Cli;

/// The rows of a table of an experiment's JSON as objects by column.
fn rows(cli: &Cli, experiment: &str, table: usize) -> Vec<serde_json::Map<String, Value>> {
    let record: Value = serde_json::from_slice(&cli.read(format!("out/{experiment}.json"))).unwrap();
    let table = &record["tables"][table];
    let columns = table["columns"].as_array().unwrap();
    let object = |row: &Value| {
        let cells = row.as_array().unwrap();
        assert_eq!(cells.len(), columns.len());
        columns.iter().zip(cells).map(|(c, v)| (c.as_str().unwrap().to_owned(), v.clone())).collect()
    };
    table["rows"].as_array().unwrap().iter().map(object).collect()
}

#[track_caller]
fn close(found: &Value, recorded: f64, tolerance: f64) {
    let found = found.as_f64().unwrap();
    assert!((found - recorded).abs() <= tolerance, "{found}, recorded {recorded}");
}

#[test]
fn table_1_reaches_its_recorded_errors_and_is_taken_up_again() {
    let cli = Cli::new();
    let run = cli.run(&["reproduce", "--quick", "--only", "table1", "-o", "out"]);
    assert_eq!(run.code, Some(0), "{run:?}");
    assert!(run.stderr.contains("what is done is kept"), "{run:?}");
    assert!(run.stdout.contains("## Table 1") && run.stdout.contains("| phong |"), "{run:?}");
    let rows = rows(&cli, "table1", 0);
    assert_eq!(rows.len(), 6);
    for row in &rows {
        let name = row["model"].as_str().unwrap();
        let picture = cli.read(format!("out/figure1-{name}.png"));
        assert!(picture.starts_with(b"\x89PNG"), "{name}");
        // Recorded: a tenth of the paper's MAE for all it gives, at 100 to 500 samples.
        let recorded = RECORDED.iter().find(|(of, ..)| *of == name).unwrap();
        assert!(row["samples"].as_u64().unwrap() <= recorded.1, "{row:?}");
        assert!(row["MAE"].as_f64().unwrap() < recorded.2, "{row:?}");
        let paper = row["paper MAE"].as_f64();
        assert_eq!(row["a tenth reached"], if paper.is_some() { "yes" } else { "no" }, "{row:?}");
    }
    // A second run finds it, another budget does not, nor a run that lost a file.
    let before = cli.read("out/table1.json");
    let again = cli.ok(&["reproduce", "--quick", "--only", "table1", "-o", "out"]);
    assert!(again.contains("table1: taken from"), "{again}");
    assert_eq!(cli.read("out/table1.json"), before);
    let csv = String::from_utf8(cli.read("out/table1.csv")).unwrap();
    assert_eq!(csv.lines().count(), 7);
    assert!(csv.starts_with("model,samples,MAE,MSE,"));
}

/// Number of samples, and MAE with some room for other processors.
const RECORDED: [(&str, u64, f64); 6] = [
    ("phong", 500, 1.72e-5),
    ("bank-phong", 150, 2.1e-4),
    ("blinn-phong", 300, 8.99e-5),
    ("ward", 300, 1.18e-5),
    ("blinn", 300, 4.31e-5),
    ("cook-torrance", 500, 3.0e-4),
];

#[test]
fn table_2_holds_the_paper_s_figures_and_ours() {
    let cli = Cli::new();
    let options = ["--materials", "blue-rubber", "--budget", "0.02", "-o", "out", "-q"];
    cli.ok(&[&["reproduce", "--quick", "--only", "table2"], &options[..]].concat());
    let rows = rows(&cli, "table2", 0);
    assert_eq!(rows.len(), 3);
    let [paper, thinned, ours] = &rows[..] else { unreachable!() };
    assert_eq!((&paper["MAE"], &paper["samples"]), (&0.0049.into(), &37_616.into()));
    close(&paper["paper's PSNR"], 63.9993, 1e-9);
    assert!(thinned["samples"].as_u64().unwrap() < 1000, "{thinned:?}");
    let (theirs, mae) = (thinned["MAE"].as_f64().unwrap(), ours["MAE"].as_f64().unwrap());
    assert!(mae < theirs, "{theirs} {mae}");
    close(&ours["samples"], 37_440.0, 0.0);
    close(&ours["PSNR env"], 109.6, 5.0);
    close(&ours["MAE"], 4.87e-4, 0.8e-4);
    close(&ours["median ln"], 5.0e-6, 3.0e-6);
    let said = 10.0 * (255.0f64.powi(2) / ours["MSE"].as_f64().unwrap()).log10();
    close(&ours["paper's PSNR"], said, 1e-9);
}

#[test]
fn table_3_has_every_kernel_in_both_settings() {
    let cli = Cli::new();
    let options = ["--materials", "blue-rubber", "--budget", "0.02", "-o", "out", "-q"];
    cli.ok(&[&["reproduce", "--quick", "--only", "table3"], &options[..]].concat());
    let rows = rows(&cli, "table3", 0);
    let of = |setting: &str| rows.iter().filter(|r| r["setting"] == setting).collect::<Vec<_>>();
    let (dense, lattice) = (of("dense"), of("lattice"));
    assert_eq!((dense.len(), lattice.len()), (6, 6));
    for row in dense {
        // About 100 samples; a search that ends at the prior mean has 0.64.
        assert!(row["MAE"].as_f64().unwrap() < 0.2, "{row:?}");
    }
    for row in lattice {
        let recorded = if row["kernel"] == "Matern" { 1.96e-3 } else { 0.8e-4 };
        close(&row["MAE"], recorded, 0.3 * recorded);
        assert!(row["MAE"].as_f64() < row["paper MAE"].as_f64(), "{row:?}");
    }
}

#[test]
fn beyond_the_paper_stand_the_rival_and_the_curve_of_samples() {
    let Some(data) = crate::harness::data_dir() else { return };
    let cli = Cli::new();
    let (folder, weights) = (data.join("rgl"), data.join("rgl/nbrdf_weights.csv"));
    let mut command: Vec<&std::ffi::OsStr> =
        vec!["reproduce".as_ref(), "--data".as_ref(), folder.as_os_str()];
    command.extend(["--nbrdf".as_ref(), weights.as_os_str()]);
    let options = ["--quick", "--only", "beyond", "--materials", "satin_purple_rgb", "-o", "out", "-q"];
    command.extend(options.map(std::ffi::OsStr::new));
    cli.ok(&command);
    let rivals = rows(&cli, "beyond", 0);
    let [neural, ours, lattice] = &rivals[..] else { panic!("{rivals:?}") };
    assert_eq!((&neural["floats"], &neural["PSNR env"].as_f64().unwrap().round()), (&675.into(), &39.0));
    assert!(ours["floats"].as_u64().unwrap() <= 675);
    close(&ours["PSNR env"], 52.6, 1.5);
    close(&ours["median ln"], 0.0137, 0.002);
    assert_eq!(lattice["model"], "lattice of 198 measurements");
    assert!(lattice["floats"].as_u64().unwrap() <= 675);
    close(&lattice["PSNR env"], 42.7, 2.0);
    let curve = rows(&cli, "beyond", 1);
    let counts: Vec<u64> = curve.iter().map(|r| r["samples"].as_u64().unwrap()).collect();
    assert_eq!(counts, [20, 165, 1000, 36_864]);
    for (row, recorded) in curve.iter().zip([17.2, 41.4, 48.9, 69.8]) {
        close(&row["PSNR env"], recorded, 2.0);
        close(&row["coverage 95 %"], 0.96, 0.03);
    }
    for plot in ["beyond-samples.svg", "beyond-coverage.svg"] {
        assert!(String::from_utf8(cli.read(format!("out/{plot}"))).unwrap().contains("satin_purple_rgb"));
    }
}

#[test]
fn figures_show_their_curves_and_pictures() {
    let cli = Cli::new();
    let options = ["--materials", "blue-rubber", "--budget", "0.02", "-o", "out", "-q"];
    cli.ok(&[&["reproduce", "--quick", "--only", "figure2,figures345"], &options[..]].concat());
    let svg = String::from_utf8(cli.read("out/figure2-error.svg")).unwrap();
    for text in ["<text", "sampling rate, %", "lattice", "dense, random cells", "<polyline"] {
        assert!(svg.contains(text), "{text}");
    }
    let lattice: Vec<_> = rows(&cli, "figure2", 0).into_iter().filter(|r| r["solver"] == "lattice").collect();
    assert_eq!(lattice.len(), 4);
    let errors: Vec<f64> = lattice.iter().map(|r| r["median ln"].as_f64().unwrap()).collect();
    assert!(errors.is_sorted_by(|a, b| a > b), "more samples, less error: {errors:?}");
    let differences = rows(&cli, "figures345", 0);
    assert_eq!(differences.len(), 2);
    for row in differences {
        assert!(row["99th percentile"].as_f64().unwrap() < 0.01, "{row:?}");
    }
    for file in ["figure4-slice-blue-rubber.png", "figure5-point-blue-rubber.png"] {
        assert!(cli.read(format!("out/{file}")).starts_with(b"\x89PNG"), "{file}");
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_keeps_what_is_done_and_goes_on_from_there() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let cli = Cli::new();
    // Minutes of dense fits after table 1.
    let options = ["reproduce", "--quick", "--only", "table1,table2", "--budget", "30", "-o", "out"];
    let mut child = cli.command(&options).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begin = Instant::now();
    while !cli.path("out/table1.json").exists() {
        assert!(begin.elapsed() < Duration::from_secs(240) && child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(50));
    }
    std::thread::sleep(Duration::from_millis(500));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let names = cli.names("out");
    assert!(
        names.iter().all(|name| name.starts_with("table1.") || name.starts_with("figure1-")),
        "{names:?}"
    );
    // The same command takes table 1 from there and begins table 2.
    let child = cli.command(&options).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_secs(2));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert!(String::from_utf8(output.stdout).unwrap().starts_with("table1: taken from"));
    assert_eq!(cli.names("out"), names);
}

#[test]
fn bad_options_are_refused_before_any_work() {
    let cli = Cli::new();
    cli.misused(&["reproduce", "--only", "table9"]);
    for (option, value, said) in [
        ("--budget", "-1", "--budget: expected a positive number"),
        ("--materials", "unobtainium", "found \"unobtainium\""),
        ("--data", "absent", "cannot read folder \"absent\""),
        ("--nbrdf", "absent.csv", "absent.csv"),
        ("--env", "absent.hdr", "absent.hdr"),
    ] {
        let message = cli.fails(&["reproduce", "--only", "table1", option, value]);
        assert!(message.contains(said), "{message}");
    }
    std::fs::create_dir(cli.path("empty")).unwrap();
    let message = cli.fails(&["reproduce", "--data", "empty"]);
    assert!(message.contains("expected .bsdf files"), "{message}");
}
