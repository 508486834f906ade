//! What is refused before any work: usage with exit code 2, values out of range with exit code 1.

use std::time::{Duration, Instant};

use crate::harness::Cli;

#[test]
fn usage_errors_have_exit_code_2() {
    let cli = Cli::new();
    for (arguments, part) in [
        (&["bake", "--no-such-option"][..], "--no-such-option"),
        (&["boil"], "boil"),
        (&["bake", "--lattice", "12x8"], "expected three numbers like 48x32x24"),
        (&["bake", "--lattice", "12x8x6x4"], "expected three numbers like 48x32x24"),
        (&["bake", "--lattice", "12xax6"], "expected three numbers like 48x32x24"),
        (&["bake", "--lattice", "6x6x6", "--samples", "100"], "cannot be used with"),
        (&["bake", "--samples", "many"], "invalid digit"),
        (&["bake", "--noise", "0"], "expected auto or a positive number"),
        (&["bake", "--noise", "-1"], "expected auto or a positive number"),
        (&["bake", "--noise", "nan"], "expected auto or a positive number"),
        (&["bake", "--layout", "spiral"], "possible values: lattice, random, cells"),
        (&["bake", "--threads", "0"], "0 is not in 1..=1024"),
        (&["slice", "lambert", "--size", "4"], "4 is not in 8..=4096"),
        (&["slice", "lambert", "--exposure", "--square-theta-h"], "--exposure"),
        (&["predict", "model.safetensors"], "<DIRECTIONS>"),
        (&["eval", "lambert"], "<TRUTH>"),
        (&["fit"], "<INPUT>"),
    ] {
        let message = cli.misused(arguments);
        assert!(message.contains(part) && !message.contains("panicked"), "{arguments:?}: {message}");
    }
    assert_eq!(cli.run::<&str>(&[]).code, Some(2));
    for arguments in [&["--help"][..], &["--version"], &["bake", "--help"]] {
        let run = cli.run(arguments);
        assert!(run.code == Some(0) && run.stderr.is_empty() && !run.stdout.is_empty(), "{run:?}");
    }
}

#[test]
fn values_out_of_range_are_refused() {
    let cli = Cli::new();
    cli.write("one.csv", "theta_i,phi_i,theta_o,phi_o,f\n10,0,20,0,1\n");
    let begin = Instant::now();
    for (arguments, message) in [
        (&["--samples", "0"][..], "number of samples: expected at least 12, found 0"),
        (&["--samples", "11"], "number of samples: expected at least 12, found 11"),
        (&["--lattice", "0x6x6"], "lattice shape: expected 2 to 512 nodes along each axis, found 0x6x6"),
        (&["--lattice", "6x6x513"], "lattice shape: expected 2 to 512 nodes along each axis, found 6x6x513"),
        (
            &["--lattice", "512x512x512"],
            "--lattice: expected at most 4194304 nodes, found 512x512x512 = 134217728",
        ),
        (&["--node-density", "0"], "node density: expected 0.25 to 4, found 0"),
        (&["--node-density", "-1"], "node density: expected 0.25 to 4, found -1"),
        (&["--node-density", "nan"], "node density: expected 0.25 to 4, found NaN"),
        (
            &["--lattice", "4x4x4", "--epsilon", "0"],
            "epsilon of the logarithmic transform: expected a positive number, found 0",
        ),
        (
            &["--lattice", "4x4x4", "--epsilon", "-1e-3"],
            "epsilon of the logarithmic transform: expected a positive number, found -0.001",
        ),
        (
            &["--lattice", "4x4x4", "--kernel", "matern", "--nu", "-1"],
            "nu of the Matern kernel: expected a number from 0.05 to 50, found -1",
        ),
        (
            &["--lattice", "4x4x4", "--kernel", "matern52+cubic"],
            "--kernel: expected shapes out of se, rq, matern12, matern32, matern52, matern joined by +, \
             found \"cubic\"",
        ),
        (
            &["--layout", "random", "--samples", "0"],
            "samples: expected at least one, with as many values as directions, found 0",
        ),
        (
            &["--layout", "cells", "--lattice", "4x4x4"],
            "--lattice: expected --layout lattice, found another layout",
        ),
        (
            &["--layout", "random", "--solver", "lattice"],
            "--solver lattice: expected --layout lattice, found another layout",
        ),
        (
            &["--lattice", "4x4x4", "--env", "absent.hdr"],
            "cannot read \"absent.hdr\": No such file or directory (os error 2)",
        ),
        (
            &["--lattice", "4x4x4", "-o", "one.csv"],
            "cannot create folder \"one.csv\": expected a folder, found the file \"one.csv\"",
        ),
        (
            &["--lattice", "4x4x4", "-o", "one.csv/a/b"],
            "cannot create folder \"one.csv/a/b\": expected a folder, found the file \"one.csv\"",
        ),
    ] {
        assert_eq!(cli.fails(&[&["bake", "phong"], arguments].concat()), message);
    }
    let message = cli.fails(&["bake", "phong", "--samples", "1000000000000"]);
    assert!(
        message.starts_with("lattice shape: expected 2 to 512 nodes along each axis, found "),
        "{message}"
    );
    assert_eq!(
        cli.fails(&["bake", "one.csv", "--samples", "20"]),
        "one.csv: expected no --lattice and no --samples for scattered measurements, found one: all 1 are used"
    );
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
}

#[test]
fn names_of_outputs_choose_their_format() {
    let cli = Cli::new();
    cli.write("s.csv", "theta_i,phi_i,theta_o,phi_o,f\n10,0,20,0,1\n");
    std::fs::create_dir(cli.path("folder.csv")).unwrap();
    for (arguments, message) in [
        (
            &["convert", "lambert", "t.ply"][..],
            "\"t.ply\": expected a name that ends in .binary, .exr, .bsdf, .csv, .dds, .ktx2, .npy or .bin, \
             found .ply",
        ),
        (
            &["slice", "lambert", "-o", "t.jpg"],
            "\"t.jpg\": expected a name that ends in .png, .svg, .pdf or .exr",
        ),
        (&["slice", "lambert", "--phi-d", "nan"], "--phi-d: expected a finite number, found NaN"),
        (
            &["convert", "s.csv", "t.binary"],
            "s.csv: expected a BRDF that can be evaluated at any directions, found scattered samples; bake them first",
        ),
        (
            &["slice", "s.csv", "-o", "t.png"],
            "s.csv: expected a BRDF that can be evaluated at any directions, found scattered samples; bake them first",
        ),
        (
            &["eval", "s.csv", "lambert"],
            "s.csv: expected a BRDF that can be evaluated at any directions, found scattered samples; bake them first",
        ),
        (&["convert", "lambert", "folder.csv"], "cannot write \"folder.csv\": is a directory"),
        (
            &["convert", "lambert", "no/such/t.csv"],
            "cannot write \"no/such/t.csv\": No such file or directory (os error 2)",
        ),
        (
            &["fit", "lambert", "--lattice", "4x4x4", "-o", "folder.csv"],
            "cannot write \"folder.csv\": is a directory",
        ),
    ] {
        assert_eq!(cli.fails(arguments), message);
    }
}
