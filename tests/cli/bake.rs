//! `bake` and its report.

use std::fs;

use gpbrdf_core::formats::{MERL_BYTES, read_merl, read_table_exr};
use gpbrdf_core::{BrdfTable, Source};
use serde_json::Value;

use crate::harness::{Cli, metric};

const SMALL: [&str; 2] = ["--lattice", "12x8x6"];

/// The bits of a table, for exact comparison.
fn bits(table: &BrdfTable) -> Vec<[u32; 3]> {
    table.values().iter().map(|rgb| rgb.map(f32::to_bits)).collect()
}

#[test]
fn writes_everything_and_reports_it() {
    let cli = Cli::new();
    let arguments = ["bake", "-o", "made/out", "--json", SMALL[0], SMALL[1]];
    let report = cli.json(&arguments);
    let names = ["model.safetensors", "report.json", "slice.png", "sphere.png", "table.binary", "table.exr"];
    assert_eq!(cli.names("made/out"), names);
    assert_eq!(fs::metadata(cli.path("made/out/table.binary")).unwrap().len(), MERL_BYTES);
    assert_eq!(MERL_BYTES, 34_992_012);
    for picture in ["slice.png", "sphere.png"] {
        assert!(cli.read(format!("made/out/{picture}")).starts_with(b"\x89PNG\r\n\x1A\n"), "{picture}");
    }
    let written: Value = serde_json::from_slice(&cli.read("made/out/report.json")).unwrap();
    assert_eq!(written, report, "standard output is the report");

    assert_eq!(report["material"], "cherry-235");
    assert_eq!(report["source"], "built-in cherry-235");
    assert_eq!(report["layout"], "lattice");
    assert_eq!(report["lattice"]["shape"], serde_json::json!([12, 8, 6]));
    assert_eq!(report["samples"], 576);
    assert_eq!(report["solver"], "lattice");
    assert_eq!(report["backend"], "cpu");
    assert!(report["kernel"].as_str().unwrap().contains("matern52"), "{}", report["kernel"]);
    assert!(report["converged"].as_bool().unwrap());
    assert!(report["evaluations"].as_u64().unwrap() > 3);
    assert!(report["log_marginal_likelihood"].as_f64().unwrap().is_finite());
    let hyper = &report["hyperparameters"];
    assert_eq!(hyper["length_scale"].as_array().unwrap().len(), 3);
    for value in [&hyper["signal_variance"], &hyper["noise_variance"], &hyper["length_scale"][2]] {
        assert!(value.as_f64().unwrap() > 0.0, "{hyper}");
    }
    let seconds = report["seconds"].as_object().unwrap();
    let stages = ["load", "sample", "fit", "bake_mean", "bake_sigma", "metrics", "render", "write"];
    let sum: f64 = stages.iter().map(|stage| seconds[*stage].as_f64().unwrap()).sum();
    let total = seconds["total"].as_f64().unwrap();
    assert!(sum <= total + 1e-9 && sum > 0.5 * total, "{seconds:?}");
    let outputs: Vec<&str> =
        report["outputs"].as_array().unwrap().iter().map(|o| o.as_str().unwrap()).collect();
    assert_eq!(outputs.len(), names.len());
    assert!(outputs.iter().all(|path| cli.path(path).is_file()), "{outputs:?}");

    // 576 samples of a smooth material already look right.
    for (name, low, high) in [
        ("mae", 1e-6, 1.0),
        ("mse", 1e-12, 100.0),
        ("log_rmse", 1e-5, 0.5),
        ("median_abs_log", 1e-6, 0.1),
        ("log1p_cos_l1", 1e-7, 0.1),
        ("psnr_env", 25.0, 100.0),
        ("psnr_point", 15.0, 100.0),
        ("ssim_env", 0.9, 1.0),
        ("coverage_95", 0.3, 1.0),
    ] {
        let value = metric(&report, name);
        assert!(value > low && value <= high, "{name} = {value}");
    }
    let mse = metric(&report, "mse");
    let paper = 10.0 * (255.0f64.powi(2) / mse).log10();
    assert!((metric(&report, "psnr_paper_table2") - paper).abs() < 1e-9);
    let pixels = &report["metrics"]["pixel_difference"];
    assert!(pixels["median"].as_f64().unwrap() <= pixels["percentile_99"].as_f64().unwrap());

    // The three outputs are the same table, and it evaluates as reported.
    let binary = read_merl(cli.path("made/out/table.binary")).unwrap();
    assert_eq!(bits(&binary), bits(&read_table_exr(cli.path("made/out/table.exr")).unwrap()));
    let model = Source::open(cli.path("made/out/model.safetensors")).unwrap();
    assert_eq!(bits(&binary), bits(&model.table().unwrap()));
    for output in ["table.binary", "table.exr", "model.safetensors"] {
        let evaluated = cli.json(&["eval", &format!("made/out/{output}"), "cherry-235", "--json"]);
        for name in
            ["mae", "mse", "log_rmse", "median_abs_log", "log1p_cos_l1", "psnr_env", "psnr_point", "ssim_env"]
        {
            assert_eq!(
                metric(&evaluated, name).to_bits(),
                metric(&report, name).to_bits(),
                "{output} {name}"
            );
        }
        let coverage = evaluated["metrics"].get("coverage_95");
        assert_eq!(coverage.is_some(), output == "model.safetensors", "{output}");
        assert!(coverage.is_none_or(|c| *c == report["metrics"]["coverage_95"]), "{output}");
    }

    // Back and forth between formats nothing changes.
    cli.ok(&["convert", "made/out/table.exr", "again.binary"]);
    assert!(cli.read("again.binary") == cli.read("made/out/table.binary"));
    cli.ok(&["convert", "made/out/model.safetensors", "again.exr"]);
    assert_eq!(bits(&read_table_exr(cli.path("again.exr")).unwrap()), bits(&binary));

    // `info` knows each of them.
    for (name, kind) in [
        ("made/out/table.binary", "MERL table"),
        ("made/out/table.exr", "OpenEXR table"),
        ("made/out/model.safetensors", "gpbrdf model"),
    ] {
        let found = cli.json(&["info", "--json", name]);
        assert_eq!(found["kind"], kind, "{name}");
        assert_eq!(found["sha256"].as_str().unwrap().len(), 64);
        assert!(cli.ok(&["info", name]).contains(kind), "{name}");
    }
    let found = cli.json(&["info", "--json", "made/out/model.safetensors"]);
    assert_eq!(found["name"], "cherry-235");
    assert_eq!(found["details"]["samples"], 576);
    assert_eq!(found["details"]["hyperparameters"], report["hyperparameters"]);
    assert_eq!(found["details"]["provenance"]["lattice"], report["lattice"]);
}

#[test]
fn outputs_do_not_depend_on_threads_or_the_run() {
    let cli = Cli::new();
    let bare = ["bake", "phong", SMALL[0], SMALL[1], "--no-images", "--no-metrics", "--quiet"];
    for (threads, folder) in [("1", "one"), ("2", "two"), ("3", "three")] {
        assert_eq!(cli.ok(&[&bare[..], &["--threads", threads, "-o", folder]].concat()), "");
        assert_eq!(cli.names(folder), ["model.safetensors", "report.json", "table.binary", "table.exr"]);
        for name in ["table.binary", "table.exr", "model.safetensors"] {
            let (a, b) = (cli.read(format!("one/{name}")), cli.read(format!("{folder}/{name}")));
            assert!(a == b, "{name} differs with {threads} threads");
        }
    }
    // Nothing was compared, nothing is reported.
    let report: Value = serde_json::from_slice(&cli.read("one/report.json")).unwrap();
    assert!(report["metrics"].is_null() && report["seconds"]["metrics"] == 0.0);
    assert_eq!(report["outputs"].as_array().unwrap().len(), 4);
}

#[test]
fn the_summary_is_short_and_for_people() {
    let cli = Cli::new();
    let text = cli.ok(&["bake", "lambert", "--lattice", "6x6x6", "-o", "out", "--no-sigma"]);
    assert!(text.lines().count() < 20, "{text}");
    assert!(text.starts_with("lambert from built-in lambert\n"), "{text}");
    for part in ["216 samples", "6x6x6", "PSNR", "total", "wrote out/table.binary", "wrote out/report.json"] {
        assert!(text.contains(part), "no {part:?} in {text}");
    }
    assert!(!text.contains("covers"), "no interval without sigma: {text}");
    let report: Value = serde_json::from_slice(&cli.read("out/report.json")).unwrap();
    assert!(report["metrics"].get("coverage_95").is_none());
}

#[test]
fn a_constant_is_learnt_exactly() {
    let cli = Cli::new();
    let report = cli.json(&["bake", "lambert", "--lattice", "6x6x6", "-o", "out", "--json", "--no-images"]);
    assert!(metric(&report, "mae") < 1e-6 && metric(&report, "psnr_env") > 100.0, "{report:#}");
    let bounds = report["at_bound"].as_array().unwrap();
    assert!(bounds.contains(&"noise_ratio".into()), "a constant has no noise: {bounds:?}");
}

/// The texture of a run and that of its model are the same, and each format holds the same texels.
#[test]
fn textures_are_written_with_the_rest() {
    let cli = Cli::new();
    let textures = ["x.dds", "x.ktx2", "x.npy", "x.bin"];
    let mut arguments =
        vec!["bake", "phong", SMALL[0], SMALL[1], "--no-images", "--no-metrics", "-q", "-o", "out"];
    arguments.extend(textures.iter().flat_map(|name| ["--texture", *name]));
    cli.ok(&arguments);
    let texels = cli.read("x.bin");
    assert_eq!(texels.len(), 90 * 90 * 180 * 8);
    for name in textures {
        assert!(cli.read(name).ends_with(&texels), "{name}");
    }
    assert!(cli.path("x.bin.json").is_file());
    cli.ok(&["convert", "out/model.safetensors", "again.dds"]);
    assert!(cli.read("again.dds") == cli.read("x.dds"));
    // A table has no sigma.
    cli.ok(&["convert", "out/table.binary", "table.bin"]);
    let table = cli.read("table.bin");
    for (with, without) in texels.chunks_exact(8).zip(table.chunks_exact(8)) {
        assert!(with[..6] == without[..6] && without[6..] == [0, 0], "{with:?} {without:?}");
    }
    let report: Value = serde_json::from_slice(&cli.read("out/report.json")).unwrap();
    assert!(
        report["outputs"].as_array().unwrap().iter().any(|path| path == "x.ktx2"),
        "{}",
        report["outputs"]
    );
    assert!(cli.misused(&["bake", "phong", "--texture", "x.png"]).contains(".dds, .ktx2, .npy or .bin"));
}
