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
    close(&ours["PSNR env"], 76.27, 1.0);
    close(&ours["MAE"], 0.005_22, 0.000_4);
    close(&ours["median ln"], 1.19e-4, 0.2e-4);
    let said = 10.0 * (255.0f64.powi(2) / ours["MSE"].as_f64().unwrap()).log10();
    close(&ours["paper's PSNR"], said, 1e-9);
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
