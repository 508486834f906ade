//! The dense solver: its forecast, and its agreement with the lattice.

use std::time::{Duration, Instant};

use gpbrdf_core::BrdfTable;
use gpbrdf_core::formats::write_merl;

use crate::harness::{Cli, metric};

#[test]
fn both_solvers_learn_the_same_material() {
    let cli = Cli::new();
    let bake = |solver: &str| {
        let lattice = ["--lattice", "8x6x5", "--solver", solver, "--no-images", "--no-sigma", "--json"];
        cli.json(&[&["bake", "blue-rubber", "-o", solver], &lattice[..]].concat())
    };
    let (lattice, dense) = (bake("lattice"), bake("dense"));
    assert_eq!((&lattice["solver"], &dense["solver"]), (&"lattice".into(), &"dense".into()));
    assert_eq!((&lattice["samples"], &dense["samples"]), (&240.into(), &240.into()));
    assert_eq!(lattice["lattice"], dense["lattice"]);
    for report in [&lattice, &dense] {
        assert!(metric(report, "median_abs_log") < 0.1 && metric(report, "psnr_env") > 25.0, "{report:#}");
    }
    // The kernels differ (a product and an ARD one), the samples do not.
    let between = cli.json(&["eval", "dense/table.binary", "lattice/table.binary", "--json"]);
    assert!(metric(&between, "median_abs_log") < 0.1, "{between:#}");
    assert!(metric(&between, "mae") > 0.0);
}

#[test]
fn channels_may_have_their_own_hyper_parameters() {
    let cli = Cli::new();
    for solver in ["dense", "lattice"] {
        let arguments =
            ["--solver", solver, "--lattice", "6x5x4", "--per-channel", "--json", "-o", "m.safetensors"];
        let report = cli.json(&[&["fit", "cook-torrance"], &arguments[..]].concat());
        let channels = report["hyperparameters"]["channels"].as_array().unwrap();
        assert_eq!(channels.len(), 3, "{solver}: {report:#}");
        for channel in channels {
            assert_eq!(channel["length_scale"].as_array().unwrap().len(), 3);
            assert!(channel["noise_variance"].as_f64().unwrap() > 0.0, "{channel}");
        }
        let found = cli.json(&["info", "m.safetensors", "--json"]);
        assert_eq!(found["details"]["hyperparameters"], report["hyperparameters"]);
    }
}

#[test]
fn scattered_layouts_are_seeded() {
    let cli = Cli::new();
    let fit = |layout: &str, seed: &str, name: &str| {
        let arguments = ["--layout", layout, "--samples", "60", "--seed", seed, "-o", name];
        let report = cli.json(&[&["fit", "phong", "--json"], &arguments[..]].concat());
        assert_eq!((&report["samples"], &report["layout"]), (&60.into(), &layout.into()));
        // The brightness is likelier without the prior.
        assert_eq!((&report["solver"], report["lattice"].is_null()), (&"scattered".into(), true));
        cli.read(name)
    };
    for layout in ["random", "cells"] {
        let first = fit(layout, "1", "a.safetensors");
        assert!(first == fit(layout, "1", "b.safetensors"), "{layout}: same seed, other model");
        assert!(first != fit(layout, "2", "c.safetensors"), "{layout}: other seed, same model");
    }
}

#[test]
fn the_symmetry_is_measured_on_every_layout() {
    let cli = Cli::new();
    // phi_d and 180 degrees - phi_d are not alike.
    let skewed =
        BrdfTable::from_fn(|a| [1.0 + 0.5 * a.theta_h.sin() * a.theta_d.sin() * (2.0 * a.phi_d).sin(); 3]);
    write_merl(cli.path("skewed.binary"), &skewed).unwrap();
    let fit = |input: &str, layout: &str, symmetry: &str, name: &str| {
        let options = ["--layout", layout, "--symmetry", symmetry, "--samples", "60", "-o", name];
        let run = cli.run(&[&["-v", "fit", input], &options[..]].concat());
        assert_eq!(run.code, Some(0), "{run:?}");
        let said = run.stderr.lines().find_map(|line| line.strip_prefix("symmetry: ")).unwrap().to_owned();
        (said, cli.read(name))
    };
    for layout in ["lattice", "random", "cells"] {
        assert_eq!(fit("phong", layout, "auto", "a.safetensors").0, "Bilateral", "{layout}");
        let (said, measured) = fit("skewed.binary", layout, "auto", "a.safetensors");
        assert_eq!(said, "Reciprocal", "{layout}");
        let (said, by_hand) = fit("skewed.binary", layout, "bilateral", "b.safetensors");
        assert_eq!(said, "Bilateral", "{layout}");
        assert!(measured != by_hand, "{layout}: the symmetry changes nothing");
        assert!(measured == fit("skewed.binary", layout, "reciprocal", "c.safetensors").1, "{layout}");
    }
}

#[test]
fn what_cannot_fit_is_refused_at_once_with_both_figures() {
    let cli = Cli::new();
    let begin = Instant::now();
    for arguments in [
        &["--solver", "dense", "--lattice", "200x100x200"][..],
        &["--layout", "random", "--solver", "dense", "--samples", "4000000"],
        &["--layout", "random", "--samples", "1000000000000"],
    ] {
        let message = cli.fails(&[&["bake", "cherry-235", "-o", "new/out"], arguments].concat());
        let solver = if arguments.contains(&"dense") { "dense" } else { "scattered" };
        let start = message.starts_with(&format!("a {solver} Gaussian process on "));
        assert!(start && message.contains(" GiB and about ") && message.contains(" s; "), "{message}");
        assert!(message.contains("expected at most "), "{message}");
    }
    assert!(begin.elapsed() < Duration::from_secs(10), "{:?}", begin.elapsed());
}
