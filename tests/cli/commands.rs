//! `fit`, `predict`, `eval`, `slice`, `convert`, `info` and `materials`.

use gpbrdf_core::brdf::{direction, materials};
use gpbrdf_core::formats::{read_merl, read_samples_csv, write_merl};
use gpbrdf_core::{HalfDiff, IntervalOf, Model, Source};
use serde_json::Value;

use crate::harness::{Cli, metric};

#[test]
fn every_kernel_and_option_fits_and_predicts() {
    let cli = Cli::new();
    cli.write("d.csv", "theta_h,theta_d,phi_d\n40,30,90\n");
    let truth = Source::built_in("blinn-phong").unwrap();
    let angles =
        HalfDiff { theta_h: 40f64.to_radians(), theta_d: 30f64.to_radians(), phi_d: 90f64.to_radians() };
    let expected = truth.brdf().unwrap().eval_half_diff(angles);
    for (options, kernel) in [
        ("--kernel se", "se"),
        ("--kernel rq", "rq"),
        ("--kernel matern12", "matern12"),
        ("--kernel matern32", "matern32"),
        ("--kernel matern52", "matern52"),
        ("--kernel matern --nu 1.3", "matern"),
        ("--kernel matern52+rq", "matern52 + rq"),
        ("--transform identity", "matern52"),
        ("--transform cube-root", "matern52"),
        ("--mean zero", "matern52"),
        ("--noise 1e-4", "matern52"),
        ("--per-channel", "matern52"),
        ("--symmetry reciprocal", "matern52"),
        ("--symmetry bilateral", "matern52"),
        ("--node-density 1", "matern52"),
        ("--restarts 2 --seed 5", "matern52"),
        ("--solver dense", "matern52_ard"),
        ("--solver dense --kernel se+rq", "se_ard + rq_ard"),
        ("--solver dense --noise 1e-2", "matern52_ard"),
    ] {
        let mut arguments =
            vec!["fit", "blinn-phong", "--lattice", "10x6x6", "--json", "-o", "m.safetensors"];
        arguments.extend(options.split(' '));
        // The search of a sum may end by its limit, which is a warning.
        let run = cli.run(&arguments);
        assert_eq!(run.code, Some(0), "{options}: {run:?}");
        let report: Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!(run.stderr.is_empty(), report["converged"].as_bool().unwrap(), "{options}: {run:?}");
        assert!(report["kernel"].as_str().unwrap().contains(kernel), "{options}: {}", report["kernel"]);
        let predicted = cli.ok(&["predict", "m.safetensors", "d.csv", "--latent"]);
        let row = predicted.lines().nth(1).unwrap();
        let numbers: Vec<f64> = row.split(',').map(|x| x.parse().unwrap()).collect();
        for c in 0..3 {
            let (mean, low, high) = (numbers[3 + c], numbers[6 + c], numbers[9 + c]);
            assert!(low <= mean && mean <= high, "{options}: {row}");
            let error = (mean / expected[c] - 1.0).abs();
            assert!(error < 0.1, "{options}: {mean} for {}", expected[c]);
        }
    }
}

#[test]
fn fitting_is_repeatable_and_predicting_is_the_library() {
    let cli = Cli::new();
    for layout in [&["--lattice", "10x6x6"][..], &["--layout", "random", "--samples", "80"]] {
        for name in ["a.safetensors", "b.safetensors"] {
            cli.ok(&[&["fit", "ward", "-o", name], layout].concat());
        }
        assert!(cli.read("a.safetensors") == cli.read("b.safetensors"), "{layout:?}");

        let rows = ["30,45,10,0", "0,0,0,0", "80.5,10,80.5,190", "89,0,89,10"];
        cli.write("d.csv", format!("# four\ntheta_i,phi_i,theta_o,phi_o\n{}\n", rows.join("\n")));
        let angles: Vec<HalfDiff> = rows
            .iter()
            .map(|row| {
                let a: Vec<f64> = row.split(',').map(|x| x.parse::<f64>().unwrap().to_radians()).collect();
                HalfDiff::from_directions(&direction(a[0], a[1]), &direction(a[2], a[3]))
            })
            .collect();
        let model = Model::load(cli.path("a.safetensors")).unwrap();
        let mut widths = Vec::new();
        for (flag, of) in [(None, IntervalOf::Observation), (Some("--latent"), IntervalOf::Latent)] {
            let arguments: Vec<&str> =
                ["predict", "a.safetensors", "d.csv"].into_iter().chain(flag).collect();
            let text = cli.ok(&arguments);
            let mut lines = text.lines();
            assert_eq!(
                lines.next(),
                Some("theta_i,phi_i,theta_o,phi_o,r,g,b,r_lower,g_lower,b_lower,r_upper,g_upper,b_upper")
            );
            for ((line, row), p) in lines.by_ref().zip(rows).zip(model.predict(&angles, of).unwrap()) {
                let values = line.strip_prefix(row).unwrap().trim_start_matches(',').split(',');
                let values: Vec<f64> = values.map(|x| x.parse().unwrap()).collect();
                assert_eq!(values, [p.mean, p.lower, p.upper].concat(), "{row}");
                for c in 0..3 {
                    let [mean, low, high] = [values[c], values[3 + c], values[6 + c]];
                    assert!(0.0 <= low && low <= mean && mean <= high && high.is_finite(), "{line}");
                }
                widths.push(values[6] - values[3]);
            }
            assert_eq!(lines.next(), None);
            let said = cli.ok(&[&arguments[..], &["-o", "p.csv"]].concat());
            assert_eq!(said, "wrote 4 predictions to p.csv\n");
            assert_eq!(cli.read("p.csv"), text.as_bytes());
        }
        let (observed, latent) = widths.split_at(rows.len());
        assert!(std::iter::zip(observed, latent).all(|(o, l)| o > l), "{widths:?}");
    }
}

#[test]
fn a_truth_equals_itself() {
    let cli = Cli::new();
    let same = cli.json(&["eval", "cook-torrance", "cook-torrance", "--json"]);
    assert_eq!(
        (metric(&same, "mae"), metric(&same, "mse"), metric(&same, "median_abs_log")),
        (0.0, 0.0, 0.0)
    );
    for name in ["psnr_env", "psnr_point", "psnr_paper_table2"] {
        assert_eq!(metric(&same, name), f64::INFINITY, "{name}");
    }
    assert_eq!(metric(&same, "ssim_env"), 1.0);
    assert_eq!(
        (&same["prediction"], &same["truth"]),
        (&"built-in cook-torrance".into(), &"built-in cook-torrance".into())
    );
    assert!(cli.ok(&["eval", "lambert", "lambert"]).contains("PSNR inf dB"));

    // Lambert against Phong: symmetric in absolute terms, and not zero.
    let (a, b) = (
        cli.json(&["eval", "lambert", "phong", "--json"]),
        cli.json(&["eval", "phong", "lambert", "--json"]),
    );
    assert!((metric(&a, "mae") - metric(&b, "mae")).abs() < 1e-12 && metric(&a, "mae") > 1e-3);
    assert!(metric(&a, "psnr_env") < 60.0);
}

#[test]
fn samples_go_out_come_back_and_judge_a_model() {
    let cli = Cli::new();
    cli.ok(&["convert", "cook-torrance", "s.csv", "--samples", "100"]);
    let written = read_samples_csv(cli.path("s.csv")).unwrap();
    assert!((75..=130).contains(&written.len()), "{}", written.len());
    let truth = Source::built_in("cook-torrance").unwrap();
    for sample in written.iter() {
        let expected =
            truth.brdf().unwrap().eval_half_diff(HalfDiff::from_directions(&sample.wi, &sample.wo));
        for c in 0..3 {
            assert!((sample.value[c] / expected[c] - 1.0).abs() < 1e-6, "{sample:?} {expected:?}");
        }
    }
    // Samples to samples change by rounding only.
    cli.ok(&["convert", "s.csv", "again.csv"]);
    let again = read_samples_csv(cli.path("again.csv")).unwrap();
    assert_eq!(again.len(), written.len());
    assert!(
        again.iter().zip(written.iter()).all(|(a, b)| a.value == b.value && (a.wi - b.wi).norm() < 1e-14)
    );

    let report = cli.json(&["bake", "s.csv", "-o", "out", "--json"]);
    // The brightness is likelier without the prior.
    assert_eq!((&report["solver"], &report["layout"]), (&"scattered".into(), &"samples".into()));
    assert!(report["metrics"].is_null(), "samples have no table to compare with");
    assert_eq!(cli.names("out").len(), 6);
    let against_table = cli.json(&["eval", "out/model.safetensors", "cook-torrance", "--json"]);
    assert!(metric(&against_table, "psnr_env") > 30.0, "{against_table:#}");
    let at_samples = cli.json(&["eval", "out/model.safetensors", "s.csv", "--json"]);
    assert_eq!(at_samples["metrics"]["samples"], written.len());
    assert!(metric(&at_samples, "median_abs_log") < 0.01, "{at_samples:#}");
    assert!(metric(&at_samples, "coverage_95") > 0.9, "{at_samples:#}");
    assert!(cli.ok(&["eval", "out/model.safetensors", "s.csv"]).contains("95 % interval covers"));
}

#[test]
fn slices_show_what_is_asked_for() {
    let cli = Cli::new();
    let png = |arguments: &[&str]| {
        cli.ok(&[&["slice", "phong", "-o", "s.png", "--size", "64"], arguments].concat());
        let bytes = cli.read("s.png");
        assert!(bytes.starts_with(b"\x89PNG\r\n\x1A\n"), "{arguments:?}");
        bytes
    };
    let plain = png(&[]);
    assert!(plain == png(&["--phi-d", "90", "--exposure", "0"]), "the defaults");
    let mut different = vec![plain];
    for arguments in [
        &["--phi-d", "0"][..],
        &["--phi-d", "-30"],
        &["--exposure", "-1"],
        &["--exposure", "1.5"],
        &["--square-theta-h"],
        &["--difference", "lambert"],
    ] {
        let picture = png(arguments);
        assert!(!different.contains(&picture), "{arguments:?} changes nothing");
        different.push(picture);
    }
    // phi_d folds by 180 degrees.
    for (phi_d, name) in [("-30", "a.exr"), ("150", "b.exr"), ("-3e1", "c.exr")] {
        cli.ok(&["slice", "phong", "--size", "16", "--phi-d", phi_d, "-o", name]);
        assert!(cli.read("a.exr") == cli.read(name), "{phi_d}");
    }
    cli.ok(&["slice", "phong", "-o", "RAW.EXR", "--size", "16"]);
    assert!(cli.read("RAW.EXR").starts_with(&[0x76, 0x2F, 0x31, 0x01]));
    cli.ok(&["slice", "phong", "-o", "gap.exr", "--difference", "phong", "--size", "16"]);
    assert!(cli.read("gap.exr") != cli.read("RAW.EXR"));
}

#[test]
fn merl_files_are_exact_through_the_command_line() {
    let cli = Cli::new();
    let mut values = Source::built_in("ward").unwrap().table().unwrap().values().to_vec();
    // No data, the largest, the smallest.
    (values[0], values[1], values[2]) =
        ([-1.0; 3], [f32::MAX; 3], [f32::from_bits(1), 0.0, f32::MIN_POSITIVE]);
    let table = gpbrdf_core::BrdfTable::from_values(values).unwrap();
    write_merl(cli.path("a.binary"), &table).unwrap();
    for (from, to) in
        [("a.binary", "b.binary"), ("a.binary", "c.exr"), ("c.exr", "d.binary"), ("d.binary", "d.binary")]
    {
        assert_eq!(cli.ok(&["convert", from, to]), format!("wrote {to}\n"));
    }
    assert!(cli.read("a.binary") == cli.read("b.binary") && cli.read("a.binary") == cli.read("d.binary"));
    let back = read_merl(cli.path("d.binary")).unwrap();
    let bits = |table: &gpbrdf_core::BrdfTable| -> Vec<u32> {
        table.values().as_flattened().iter().map(|x| x.to_bits()).collect()
    };
    assert!(bits(&back) == bits(&table));
    let details = cli.json(&["info", "a.binary", "--json"])["details"].clone();
    assert_eq!((&details["cells"], &details["cells_with_data"]), (&1_458_000.into(), &1_457_999.into()));
}

#[test]
fn info_and_materials_know_everything() {
    let cli = Cli::new();
    let listed = cli.json(&["materials", "--json"]);
    let names: Vec<&str> = listed.as_array().unwrap().iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert!(names.iter().eq(materials().iter().map(|m| &m.name)));
    assert!(names.contains(&"cherry-235") && names.contains(&"cook-torrance") && names.len() >= 14);
    let text = cli.ok(&["materials"]);
    assert_eq!(text.lines().count(), names.len());
    for (line, name) in text.lines().zip(&names) {
        assert!(line.starts_with(name), "{line}");
        assert_eq!(cli.json(&["info", name, "--json"])["kind"], "built-in material");
    }
    cli.write("s.csv", "# a note\ntheta_i,phi_i,theta_o,phi_o,f\n10,0,20,0,1.5\n");
    cli.write("c.brdf", "3\n400 550 700\n0.5 0 0.25 1 0.2 0.2 0.2\n");
    for (name, kind, samples) in [("s.csv", "samples CSV", 1), ("c.brdf", "Cornell measurement", 1)] {
        let found = cli.json(&["info", name, "--json"]);
        assert_eq!((&found["kind"], &found["details"]["samples"]), (&kind.into(), &samples.into()));
        assert!(cli.ok(&["info", name, "--quiet"]).contains(kind), "what was asked for is printed");
    }
    assert!(cli.ok(&["info", "s.csv"]).contains("a note"));
    // A file counts before a built-in material of its name.
    cli.write("lambert", "theta_i,phi_i,theta_o,phi_o,f\n10,0,20,0,1.5\n");
    assert_eq!(cli.json(&["info", "lambert", "--json"])["kind"], "samples CSV");
}

#[test]
fn shells_and_man_know_every_command() {
    let cli = Cli::new();
    let commands = ["bake", "gallery", "reproduce", "completions"];
    for (shell, mark) in
        [("bash", "complete -F"), ("zsh", "#compdef gpbrdf-cli"), ("fish", "complete -c gpbrdf-cli")]
    {
        let script = cli.ok(&["completions", shell]);
        assert!(script.contains(mark) && commands.iter().all(|command| script.contains(command)), "{shell}");
        assert!(script.contains("cherry-235") || script.contains("figures"), "{shell}");
    }
    cli.ok(&["man", "-o", "pages"]);
    let pages = cli.names("pages");
    assert!(pages.contains(&"gpbrdf-cli.1".to_owned()), "{pages:?}");
    for command in commands {
        let page = String::from_utf8(cli.read(format!("pages/gpbrdf-cli-{command}.1"))).unwrap();
        assert!(page.contains(".TH") && page.contains("Examples:"), "{command}: {page}");
    }
}

#[test]
fn help_is_in_groups_and_shows_examples_and_defaults() {
    let cli = Cli::new();
    let help = cli.ok(&["bake", "--help"]);
    let place = |text: &str| help.find(text).unwrap_or_else(|| panic!("no {text}: {help}"));
    let groups = ["Input:", "Sampling:", "Model:", "Output:", "General:", "Examples:"];
    assert!(groups.windows(2).all(|pair| place(pair[0]) < place(pair[1])), "{help}");
    assert!(help.contains("[default: 178]") && help.contains("[default: cherry-235]"), "{help}");
}

#[test]
fn a_gallery_shows_all_its_materials_and_can_move() {
    let cli = Cli::new();
    let out = cli.ok(&["gallery", "lambert", "ward", "--count", "4", "--prior", "none", "-o", "g.svg"]);
    assert_eq!(out.matches("4 samples, PSNR").count(), 2, "{out}");
    let svg = String::from_utf8(cli.read("g.svg")).unwrap();
    assert_eq!(svg.matches("<image").count(), 4);
    for text in [">lambert<", ">ward<", "4 planned measurements", "Prior: none", ">prediction<"] {
        assert!(svg.contains(text), "{text}");
    }
    cli.ok(&["gallery", "lambert", "--count", "3,4", "--prior", "none", "--dpi", "60", "-o", "g.png", "-q"]);
    let png = cli.read("g.png");
    assert!(png.windows(4).any(|chunk| chunk == b"acTL") && png.windows(4).any(|chunk| chunk == b"fdAT"));
    for (arguments, message) in [
        (
            &["gallery", "ward", "--count", "4,6", "-o", "g.pdf"][..],
            "\"g.pdf\": expected .png for several numbers of --count",
        ),
        (&["gallery", "ward", "-o", "g.gif"], "\"g.gif\": expected a name that ends in .png, .svg or .pdf"),
    ] {
        assert_eq!(cli.fails(arguments), message);
    }
    let found = cli.fails(&["gallery", "red_plastic"]);
    assert!(found.ends_with("found neither; did you mean the built-in material red-plastic?"), "{found}");
}
