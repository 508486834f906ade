//! Measurements of instruments: how they are read, what is said about it, and what is written of them.

use std::io::Write;
use std::process::Stdio;

use gpbrdf_core::formats::read_samples_csv;
use gpbrdf_core::{HalfDiff, Source};

use crate::harness::{Cli, Run, data_dir};

/// Runs a command with this standard input.
fn fed(cli: &Cli, arguments: &[&str], input: &[u8]) -> Run {
    let mut command = cli.command(arguments);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(input).unwrap();
    Run::from(child.wait_with_output().unwrap())
}

const ROWS: &str = "theta_i;phi_i;theta_o;phi_o;f\n10,5;0;60;180;2\n10,5;0;0;0;1,5\n10,5;0;30;90;-0,001\n";

#[test]
fn samples_come_from_standard_input_and_notices_go_to_standard_error() {
    let cli = Cli::new();
    let run = fed(&cli, &["convert", "-", "s.csv"], ROWS.as_bytes());
    assert_eq!((run.code, run.stdout.as_str()), (Some(0), "wrote s.csv\n"), "{run:?}");
    assert_eq!(
        run.stderr,
        "note: standard input: 1 value is negative, down to -0.001 (line 4); it is kept as noise of a dark signal\n"
    );
    let found = read_samples_csv(cli.path("s.csv")).unwrap();
    assert_eq!(found.values, [[2.0; 3], [1.5; 3], [-0.001; 3]]);
    assert_eq!(fed(&cli, &["convert", "-", "s.csv", "-q"], ROWS.as_bytes()).stderr, "");
    let run = fed(&cli, &["info", "-"], ROWS.as_bytes());
    assert!(run.stdout.contains("samples: 3") && run.stdout.contains("note: 1 value is negative"), "{run:?}");
    assert_eq!(run.stderr, "");

    cli.ok(&["fit", "lambert", "--lattice", "4x4x4", "-o", "m.safetensors", "-q"]);
    let run =
        fed(&cli, &["predict", "m.safetensors", "-"], b"theta_i\tphi_i\ttheta_o\tphi_o\n10,5\t0\t20\t0\n");
    assert!(run.code == Some(0) && run.stdout.lines().nth(1).unwrap().starts_with("10,5,0,20,0,"), "{run:?}");
    for (input, said) in [
        (&b""[..], "found an empty file"),
        (
            b"theta_i,phi_i,theta_o,phi_o,f\n1,2,3,4,x\n",
            "samples CSV file \"standard input\": expected a finite",
        ),
        (
            b"\x76\x2f\x31\x01\x02\0\0\0",
            "measurements as text, or the name of a regular file, found table EXR",
        ),
    ] {
        let run = fed(&cli, &["info", "-"], input);
        assert!(run.code == Some(1) && run.stderr.contains(said), "{run:?}");
    }
}

#[test]
fn options_say_what_a_file_does_not() {
    let cli = Cli::new();
    cli.write("s.csv", "theta_i,phi_i,theta_o,phi_o,f\n10,0,60,180,1\n");
    for (kind, expected) in [("brdf", 1.0), ("cosine", 2.0), ("factor", std::f64::consts::FRAC_1_PI)] {
        cli.ok(&["convert", "s.csv", "o.csv", "--values", kind]);
        let found = read_samples_csv(cli.path("o.csv")).unwrap();
        assert!((found.values[0][0] - expected).abs() < 1e-12, "{kind}");
        assert_eq!(cli.json(&["info", "s.csv", "--json", "--values", kind])["details"]["samples"], 1);
    }
    cli.write("r.csv", "theta_i,phi_i,theta_o,phi_o,f\n0.5,0,0.25,0.1,1\n");
    assert!(cli.fails(&["fit", "r.csv"]).contains("or the option --angles"));
    // One sample leaves much open, which is said on standard error.
    cli.ok(&["fit", "r.csv", "--angles", "radians", "-o", "m.safetensors", "-q"]);
    cli.write("z.csv", "theta_i,phi_i,theta_o,phi_o,f\n180,20,0,30,1\n");
    assert!(cli.fails(&["info", "z.csv"]).ends_with("say --zenith phi"));
    cli.ok(&["eval", "m.safetensors", "z.csv", "--zenith", "phi"]);
    assert!(cli.fails(&["info", "lambert", "--values", "factor"]).starts_with("lambert: expected a file of"));
    assert!(cli.fails(&["info", "m.safetensors", "--values", "factor"]).contains("leaves no choice"));
    assert!(cli.misused(&["info", "s.csv", "--values", "counts"]).contains("factor"));
    cli.write("b.csv", "theta_i,phi_i,theta_o,phi_o,f\n10,0,60,180,1\n10,0,20,180,-0.5\n");
    assert!(cli.fails(&["bake", "b.csv", "-o", "out"]).contains("noise of a dark signal) on line 3"));
}

/// With colours as linear sRGB and as spectra, from a material and from a table.
#[test]
fn rgl_files_are_written_for_other_renderers() {
    let cli = Cli::new();
    cli.ok(&["convert", "red-plastic", "t.binary"]);
    for (input, tolerance) in [("red-plastic", 0.02), ("t.binary", 0.04)] {
        cli.ok(&["convert", input, "rgb.bsdf", "--rgb"]);
        cli.ok(&["convert", input, "spectra.bsdf"]);
        let truth = Source::open(cli.path("t.binary")).unwrap();
        let [rgb, spectra] = ["rgb.bsdf", "spectra.bsdf"].map(|name| Source::open(cli.path(name)).unwrap());
        assert_eq!((rgb.kind.as_str(), spectra.kind.as_str()), ("RGL measurement", "RGL measurement"));
        for k in 0..500 {
            let t = f64::from(k) / 500.0;
            let at =
                HalfDiff { theta_h: 1.2 * (7.0 * t).fract(), theta_d: 0.3, phi_d: 3.1 * (31.0 * t).fract() };
            let [truth, rgb, spectra] =
                [&truth, &rgb, &spectra].map(|source| source.brdf().unwrap().eval_half_diff(at));
            for c in 0..3 {
                assert!((rgb[c] - truth[c]).abs() < tolerance * truth[0], "{at:?} {rgb:?} {truth:?}");
                assert!((rgb[c] - spectra[c]).abs() < 1e-3 * truth[0], "{at:?} {rgb:?} {spectra:?}");
            }
        }
    }
    assert!(cli.fails(&["convert", "phong", "p.binary", "--rgb"]).starts_with("--rgb: expected an RGL file"));
    cli.write("s.csv", "theta_i,phi_i,theta_o,phi_o,f\n10,0,60,180,1\n");
    assert!(cli.fails(&["convert", "s.csv", "s.bsdf"]).contains("bake them first"));
    assert!(!cli.path("s.bsdf").exists());
}

#[test]
fn zemax_files_are_written_on_request() {
    let cli = Cli::new();
    cli.ok(&["convert", "phong", "p.bsdf", "--format", "zemax"]);
    let found = Source::open(cli.path("p.bsdf")).unwrap();
    assert_eq!(found.kind, "Zemax measurement");
    let (samples, truth) = (found.samples().unwrap(), Source::built_in("phong").unwrap());
    for (angles, value) in samples.angles.iter().zip(&samples.values) {
        let expected = truth.brdf().unwrap().eval_half_diff(*angles);
        assert!((0..3).all(|c| (value[c] - expected[c]).abs() < 1e-5 * (1.0 + expected[c])), "{angles:?}");
    }
    // Samples on the grid go from file to file as they are.
    let run = cli.run(&["convert", "p.bsdf", "again.bsdf", "--format", "zemax", "-q"]);
    assert_eq!(run.code, Some(0), "{run:?}");
    let again = Source::open(cli.path("again.bsdf")).unwrap();
    let again = again.samples().unwrap();
    assert_eq!(again.len(), samples.len());
    assert!(
        again.values.iter().zip(&samples.values).all(|(a, b)| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-5))
    );
    cli.ok(&["convert", "phong", "s.csv", "--samples", "100"]);
    assert!(cli.fails(&["convert", "s.csv", "s.bsdf", "--format", "zemax"]).contains("fit them and convert"));
}

#[test]
fn measured_files_are_read() {
    let Some(data) = data_dir() else { return };
    let cli = Cli::new();
    for (name, kind, samples) in [
        ("chassis_brdf.csv", "samples CSV", 716),
        ("vegetation_brdf_cars.csv", "samples CSV", 14_434),
        ("retro-gray-tape.dat", "ALTA measurement", 7_319),
        ("zemax_plane.bsdf", "Zemax measurement", 2_043),
    ] {
        let path = data.join("gonio").join(name);
        let found = cli.json(&["info", path.to_str().unwrap(), "--json"]);
        assert_eq!((&found["kind"], &found["details"]["samples"]), (&kind.into(), &samples.into()), "{name}");
        assert!(!found["details"]["notices"].as_array().unwrap().is_empty(), "{name}");
    }
}
