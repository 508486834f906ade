//! `plan`: directions to measure, their file, and what is refused.

use gpbrdf_core::formats::{ReadOptions, read_directions_csv, read_samples_csv};

use crate::harness::Cli;

/// A prior of a few built-in materials.
fn with_prior() -> Cli {
    let cli = Cli::new();
    let materials = ["ward", "phong", "blinn", "cook-torrance", "red-plastic", "violet-rubber"];
    cli.ok(&[&["learn"][..], &materials, &["--centres", "150", "--functions", "6,4", "-q", "-o", "p.st"]]
        .concat());
    cli
}

/// The rows of a plan as numbers.
fn rows(text: &str) -> Vec<[f64; 4]> {
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    assert_eq!(lines.next(), Some("theta_i,phi_i,theta_o,phi_o"));
    lines
        .map(|line| {
            let numbers: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
            numbers.try_into().unwrap()
        })
        .collect()
}

/// The expected errors of a plan: before it and after all of it.
fn errors(text: &str) -> [f64; 2] {
    let line = text.lines().find(|line| line.starts_with("# expected error")).unwrap();
    let words: Vec<&str> = line.split_whitespace().collect();
    let now = words.iter().position(|word| *word == "now,").unwrap();
    [words[now - 1], words[words.len() - 3]].map(|number| number.parse().unwrap())
}

#[test]
fn plans_are_the_same_for_any_number_of_threads_and_keep_to_the_limits() {
    let cli = with_prior();
    let options = ["--prior", "p.st", "--theta-i", "10,40,65", "--theta-max", "70", "--step", "10"];
    let plan = |more: &[&str]| cli.ok(&[&["plan"][..], &options, more].concat());
    let text = plan(&[]);
    assert_eq!(text, plan(&["--threads", "1", "-o", "-"]));
    let found = rows(&text);
    assert_eq!(found.len(), 20);
    for [theta_i, phi_i, theta_o, phi_o] in &found {
        assert!([10.0, 40.0, 65.0].contains(theta_i) && *phi_i == 0.0);
        assert!(*theta_o <= 70.0 && theta_o % 10.0 == 0.0 && (0.0..=180.0).contains(phi_o));
    }
    let [now, then] = errors(&text);
    assert!(then < 0.7 * now, "{now} {then}");
    // The same directions by rank, and those in the plane.
    let mut by_rank = rows(&plan(&["--order", "rank"]));
    assert_ne!(by_rank, found);
    let mut sorted = found.clone();
    for list in [&mut by_rank, &mut sorted] {
        list.sort_by(|a, b| a.partial_cmp(b).unwrap());
    }
    assert_eq!(by_rank, sorted);
    let in_plane = rows(&plan(&["--in-plane", "--count", "7", "--min-separation", "25"]));
    assert!(in_plane.len() == 7 && in_plane.iter().all(|row| row[3] == 0.0 || row[3] == 180.0));
    for [theta_i, _, theta_o, phi_o] in in_plane {
        assert!(phi_o > 0.0 && theta_i + theta_o >= 25.0 || (theta_i - theta_o).abs() >= 25.0);
    }
    let error = format!("{}", 0.5 * (now + then));
    let until = plan(&["--until", &error]);
    assert!(rows(&until).len() < 20 && errors(&until)[1] <= 0.5 * (now + then), "{until}");
}

#[test]
fn a_plan_with_values_is_a_measurement_after_which_the_next_one_is_planned() {
    let cli = with_prior();
    for (columns, values) in [("value", "0.25"), ("r,g,b", "0.3,0.2,0.1")] {
        let said = cli.ok(&["plan", "--prior", "p.st", "--count", "12", "-o", "plan.csv"]);
        assert!(said.starts_with("wrote 12 directions to plan.csv: expected error of ln f"), "{said}");
        let directions = read_directions_csv(cli.path("plan.csv"), &ReadOptions::default()).unwrap();
        let text = String::from_utf8(cli.read("plan.csv")).unwrap();
        let mut filled = String::new();
        for line in text.lines() {
            let more = match line.as_bytes()[0] {
                b'#' => String::new(),
                b't' => format!(",{columns}"),
                _ => format!(",{values}"),
            };
            filled.push_str(&format!("{line}{more}\n"));
        }
        cli.write("samples.csv", &filled);
        let samples = read_samples_csv(cli.path("samples.csv")).unwrap();
        assert_eq!(samples.angles, directions.angles);
        assert!(samples.notices.is_empty(), "{:?}", samples.notices);
        cli.ok(&["fit", "samples.csv", "--prior", "p.st", "-q"]);
        let next = cli.ok(&["plan", "--measured", "samples.csv", "--prior", "p.st", "--count", "5"]);
        assert!(next.contains("# measured: 12 samples of samples.csv\n"), "{next}");
        assert!(errors(&next)[0] < errors(&text)[0], "{next}");
        let known = rows(&text);
        assert!(rows(&next).iter().all(|row| !known.contains(row)), "{next}");
        let without = cli.ok(&["plan", "--measured", "samples.csv", "--prior", "none", "--count", "5"]);
        assert!(without.contains("# prior: none\n"), "{without}");
    }
}

#[test]
fn plans_that_cannot_be_are_refused() {
    let cli = Cli::new();
    let fails = |arguments: &[&str]| cli.fails(&[&["plan", "--prior", "none"], arguments].concat());
    let found = fails(&["--theta-max", "30", "--min-separation", "70"]);
    assert!(
        found.starts_with(
            "limits of the instrument: expected at least one pair of directions within them, found none"
        ),
        "{found}"
    );
    let found = fails(&["--step", "40", "--theta-max", "40", "--count", "50"]);
    assert!(found.starts_with("number of directions to plan: expected at most 6, the directions"), "{found}");
    let found = fails(&["--step", "40", "--theta-max", "40", "--until", "0.001"]);
    assert!(found.starts_with("error of a plan: expected at least 1."), "{found}");
    assert!(found.contains(", which 6 directions reach, found 0.001"), "{found}");
    assert_eq!(fails(&["--count", "0"]), "--count: expected at least 1, found 0");
    assert_eq!(fails(&["--axis-cost", "1,2,3"]), "--axis-cost: expected four numbers of at least 0, found 3");
    assert_eq!(
        fails(&["--axis-cost", "1,2,3,-1"]),
        "--axis-cost: expected four numbers of at least 0, found -1"
    );
    let found = fails(&["--measured", "ward"]);
    assert!(
        found.starts_with("--measured \"ward\": expected scattered samples, found a built-in material"),
        "{found}"
    );
    assert!(fails(&["--step", "nan"]).ends_with("expected 0.5 to 45 degrees, found NaN"));
    assert!(fails(&["--simulate", "ward", "--batches", "20,10"]).ends_with("found 20,10"));
    assert!(cli.misused(&["plan", "--count", "3", "--until", "0.1"]).contains("--until"));
    assert!(cli.misused(&["plan", "--batches", "3"]).contains("--simulate"));
}

#[test]
fn a_simulation_compares_plans_with_other_directions() {
    let cli = with_prior();
    let arguments =
        ["plan", "--prior", "p.st", "--simulate", "blinn", "--batches", "6,14", "--json", "-o", "out"];
    let found = cli.json(&arguments);
    assert_eq!(cli.names("out"), ["plan.svg"]);
    let rows = found["rows"].as_array().unwrap();
    let of = |name: &str| rows.iter().filter(|row| row["directions"] == name).collect::<Vec<_>>();
    assert_eq!(
        ["planned", "random", "quasi-random", "product lattice"].map(|name| of(name).len()),
        [2, 2, 2, 1]
    );
    let planned = of("planned");
    assert_eq!([planned[0]["samples"].as_u64(), planned[1]["samples"].as_u64()], [Some(6), Some(14)]);
    let number = |row: &serde_json::Value, name: &str| row[name].as_f64().unwrap();
    assert!(number(planned[1], "expected_error") < 1.0 && number(planned[1], "psnr_env") > 20.0, "{found}");
    let text = cli.ok(&arguments[..7]);
    assert!(text.starts_with("## blinn: few directions\n") && text.contains("| planned | 14 |"), "{text}");
}
