//! `sample`: simulated measurements, their recipe, and what is refused.

use gpbrdf_core::SampleSet;
use gpbrdf_core::formats::read_samples_csv;

use crate::harness::{Cli, data_dir};

/// Measures the material and reads the file.
fn measured(cli: &Cli, input: &str, options: &str) -> SampleSet {
    let mut arguments = vec!["sample", input, "-q", "-o", "s.csv"];
    arguments.extend(options.split_whitespace());
    assert_eq!(cli.ok(&arguments), "");
    read_samples_csv(cli.path("s.csv")).unwrap()
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let cli = Cli::new();
    for layout in ["random", "in-plane", "gonio"] {
        let sample = |seed: &str, more: &[&str]| {
            let arguments = ["sample", "phong", "--layout", layout, "--count", "200", "--noise", "0.05"];
            cli.ok(&[&arguments[..], &["--outliers", "7", "--seed", seed], more].concat())
        };
        let text = sample("1", &[]);
        assert_eq!(text, sample("1", &["-o", "-", "--threads", "1"]), "{layout}");
        assert_ne!(text, sample("2", &[]), "{layout}");
        let rows = text.lines().filter(|line| !line.starts_with('#')).count() - 1;
        assert!(if layout == "gonio" { rows.abs_diff(200) < 20 } else { rows == 200 }, "{layout}: {rows}");
        assert_eq!(sample("1", &["-o", "s.csv"]), format!("wrote {rows} samples to s.csv\n"));
        assert_eq!(cli.read("s.csv"), text.as_bytes(), "{layout}");
        // What was read is written again: values to the bit, directions to rounding.
        cli.ok(&["convert", "s.csv", "again.csv"]);
        let [first, second] = ["s.csv", "again.csv"].map(|name| read_samples_csv(cli.path(name)).unwrap());
        for (a, b) in first.iter().zip(second.iter()) {
            assert_eq!(a.value, b.value);
            assert!((a.wi - b.wi).norm() < 1e-14 && (a.wo - b.wo).norm() < 1e-14);
        }
    }
}

#[test]
fn noise_spreads_values_as_stated_and_leaves_directions_alone() {
    let cli = Cli::new();
    for layout in ["random", "in-plane", "gonio"] {
        let of = |options: &str| {
            measured(&cli, "cook-torrance", &format!("--layout {layout} --count 1000 {options}"))
        };
        let clean = of("--seed 3");
        for noise in [0.03, 0.2] {
            let noisy = of(&format!("--seed 3 --noise {noise}"));
            assert_eq!(noisy.angles, clean.angles, "{layout}");
            let logs: Vec<f64> = std::iter::zip(noisy.values.as_flattened(), clean.values.as_flattened())
                .map(|(a, b)| (a / b).ln())
                .collect();
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            let variance = logs.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / logs.len() as f64;
            assert!((variance.sqrt() / noise - 1.0).abs() < 0.1, "{layout} {noise}: {}", variance.sqrt());
            assert!(mean.abs() < 0.1 * noise, "{layout} {noise}: {mean}");
        }
    }
}

#[test]
fn outliers_are_as_many_as_asked_for_on_the_lines_that_the_header_names() {
    let cli = Cli::new();
    for (options, factor) in [("--outliers 15", 10.0), ("--outliers 3 --outlier-factor 0.25", 0.25)] {
        let clean = measured(&cli, "ward", "--count 387 --layout in-plane --seed 5");
        let wrong = measured(&cli, "ward", &format!("--count 387 --layout in-plane --seed 5 {options}"));
        let text = String::from_utf8(cli.read("s.csv")).unwrap();
        let listed = text.lines().find_map(|line| line.split_once(" lines ")).unwrap().1;
        let listed: Vec<usize> = listed.split(", ").map(|number| number.parse().unwrap()).collect();
        let header = text.lines().position(|line| line.starts_with("theta_i")).unwrap();
        let mut found = Vec::new();
        for (i, (a, b)) in std::iter::zip(&wrong.values, &clean.values).enumerate() {
            if a != b {
                assert_eq!(*a, b.map(|x| x * factor));
                // Lines count from 1, and the samples follow the header.
                found.push(header + 2 + i);
            }
        }
        assert_eq!(found, listed);
        assert_eq!(found.len().to_string(), options.split(' ').nth(1).unwrap());
    }
    let all = measured(&cli, "lambert", "--count 20 --outliers 20");
    let none = measured(&cli, "lambert", "--count 20");
    assert!(std::iter::zip(&all.values, &none.values).all(|(a, b)| *a == b.map(|x| x * 10.0)));
    // The longest list leaves the file recognisable.
    let most = measured(&cli, "lambert", "--count 5000 --outliers 5000");
    assert_eq!(cli.json(&["info", "s.csv", "--json"])["details"]["samples"], most.len());
}

#[test]
fn the_header_is_a_recipe_and_the_file_is_a_measurement() {
    let cli = Cli::new();
    let text = cli.ok(&["sample", "ward", "--layout", "in-plane"]);
    let version = env!("CARGO_PKG_VERSION");
    let expected = format!(
        "# simulated measurement by gpbrdf-cli {version}\n\
         # source: built-in ward\n\
         # layout: in-plane, incidences 10, 25, 40, 55, 70 degrees, viewer from -78 to 78 degrees\n\
         # count: 380\n\
         # seed: 0\n\
         # noise: none\n\
         # outliers: none\n\
         theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n"
    );
    assert!(text.starts_with(&expected), "{text}");
    let own = cli.ok(&["sample", "ward", "--layout", "gonio", "--incidences", "20,50", "--count", "60"]);
    assert!(own.contains("# layout: gonio, incidences 20, 50 degrees, viewer in 3 polar steps"), "{own}");

    let options = "--layout random --count 150 --noise 0.03 --outliers 4 --seed 8";
    let samples = measured(&cli, "blue-rubber", options);
    assert!(samples.description.contains("noise: 0.03 (each channel times exp(0.03 g)"), "{samples:?}");
    let report = cli.json(&["fit", "s.csv", "-o", "m.safetensors", "--json"]);
    assert_eq!((&report["samples"], &report["layout"]), (&150.into(), &"samples".into()));
    // A model and a table can be measured like their source.
    cli.ok(&["convert", "blue-rubber", "t.binary"]);
    for (input, tolerance) in [("m.safetensors", 1.0), ("t.binary", 0.2)] {
        let found = measured(&cli, input, "--count 150 --seed 8");
        assert!(found.description.contains("sha256: ") && found.description.contains(input));
        let clean = measured(&cli, "blue-rubber", "--count 150 --seed 8");
        let mut logs: Vec<f64> =
            std::iter::zip(&found.values, &clean.values).map(|(a, b)| (a[1] / b[1]).ln().abs()).collect();
        logs.sort_unstable_by(f64::total_cmp);
        assert!(logs[75] < tolerance, "{input}: {}", logs[75]);
    }
}

#[test]
fn measured_files_can_be_measured_again() {
    let Some(data) = data_dir() else { return };
    let cli = Cli::new();
    let rgl = data.join("rgl/paper_blue_rgb.bsdf");
    let found = measured(&cli, rgl.to_str().unwrap(), "--layout in-plane --count 387");
    assert_eq!(found.len(), 387);
    assert!(found.values.as_flattened().iter().all(|x| *x > 0.0));
    let cornell = data.join("cornell/cayman.brdf");
    let message = cli.fails(&["sample", cornell.to_str().unwrap(), "-o", "c.csv"]);
    assert!(message.ends_with("found scattered samples; bake them first"), "{message}");
}

#[test]
fn what_no_instrument_measures_is_refused() {
    let cli = Cli::new();
    cli.write("one.csv", "theta_i,phi_i,theta_o,phi_o,f\n10,0,20,0,1\n");
    let range = "number of samples: expected";
    for (options, message) in [
        ("phong --count 0", format!("{range} 1 to 10000000, found 0")),
        ("phong --count 10000001", format!("{range} 1 to 10000000, found 10000001")),
        ("phong --layout in-plane --count 0", format!("{range} 10 to 10000000, found 0")),
        ("phong --layout in-plane --count 10000001", format!("{range} 10 to 10000000, found 10000001")),
        ("phong --layout gonio --count 0", format!("{range} 18 to 10000000, found 0")),
        ("phong --layout gonio --count 10000001", format!("{range} 18 to 10000000, found 10000001")),
        ("phong --noise -0.1", "noise: expected a number of at least 0, found -0.1".into()),
        ("phong --noise inf", "noise: expected a number of at least 0, found inf".into()),
        ("phong --noise nan", "noise: expected a number of at least 0, found NaN".into()),
        (
            "phong --count 9 --outliers 10",
            "number of outliers: expected at most 9, the number of samples, found 10".into(),
        ),
        ("phong --outliers 5001", "--outliers: expected at most 5000, found 5001".into()),
        (
            "phong --outliers 1 --outlier-factor -2",
            "outlier factor: expected a positive number, found -2".into(),
        ),
        ("phong --incidences 10", "--incidences: expected --layout in-plane or gonio, found random".into()),
        (
            "phong --layout gonio --incidences 10,90",
            "incidences: expected at least one, each from 0 to 87 degrees, found 90".into(),
        ),
        (
            "one.csv -o t.csv",
            "one.csv: expected a BRDF that can be evaluated at any directions, found scattered samples; bake \
             them first"
                .into(),
        ),
        (
            "absent.bsdf -o t.csv",
            "\"absent.bsdf\": expected a file or a built-in material (`gpbrdf-cli materials` lists them), \
             found neither"
                .into(),
        ),
        (
            "phong -o no/such/t.csv",
            "cannot write \"no/such/t.csv\": No such file or directory (os error 2)".into(),
        ),
        ("phong --noise -1 -o one.csv", "noise: expected a number of at least 0, found -1".into()),
    ] {
        let arguments: Vec<&str> = ["sample"].into_iter().chain(options.split(' ')).collect();
        assert_eq!(cli.fails(&arguments), message);
    }
    for (options, part) in [
        ("--layout cells", "possible values: random, in-plane, gonio"),
        ("--outlier-factor 5", "--outliers <K>"),
        ("--count -3", "-3"),
        ("--outliers many", "invalid digit"),
        ("--incidences 10,x", "invalid float literal"),
    ] {
        let arguments: Vec<&str> = ["sample", "phong"].into_iter().chain(options.split(' ')).collect();
        let message = cli.misused(&arguments);
        assert!(message.contains(part) && !message.contains("panicked"), "{options}: {message}");
    }
}
