//! `check`.

use gpbrdf_core::BrdfTable;
use gpbrdf_core::formats::write_merl;

use crate::harness::Cli;

#[test]
fn a_sound_material_passes() {
    let cli = Cli::new();
    let report = cli.json(&["check", "cherry-235", "--samples", "50000", "--strict", "--json"]);
    assert_eq!(report["failures"].as_array().unwrap().len(), 0, "{report}");
    assert_eq!(report["input"], "built-in cherry-235");
    assert_eq!((&report["bad_values"], &report["missing_cells"]), (&0.into(), &0.into()));
    let energy = report["energy"]["largest_albedo"].as_f64().unwrap();
    assert!(energy > 0.1 && energy < 1.0, "{report}");
    let views = report["sampling"].as_array().unwrap();
    assert_eq!(views.len(), 8);
    for view in views {
        let number = |key: &str| view[key].as_f64().unwrap();
        assert!(number("p_value") > 1e-4 && (number("pdf_integral") - 1.0).abs() < 1e-3, "{view}");
        assert!(number("variance") < 0.2 && number("weight_999") < 2.0, "{view}");
        assert!(number("variance") < number("cosine_variance"), "{view}");
    }
    let text = cli.ok(&["check", "cherry-235", "--samples", "20000"]);
    assert!(text.contains("everything holds") && text.contains("p of chi-square"), "{text}");
}

#[test]
fn what_does_not_hold_is_said_and_strict_fails() {
    let cli = Cli::new();
    // A white that is too bright, with a gap.
    let mut values = BrdfTable::from_fn(|_| [0.5, 0.4, 0.3]).values().to_vec();
    values[1000..1100].fill([-1.0; 3]);
    write_merl(cli.path("t.binary"), &BrdfTable::from_values(values).unwrap()).unwrap();
    let text = cli.ok(&["check", "t.binary", "--samples", "20000"]);
    assert!(text.contains("does not hold: energy: expected albedos of at most 1, found 1.57"), "{text}");
    assert!(text.contains("does not hold: table: expected data in every cell, found 100 without"), "{text}");
    let run = cli.run(&["check", "t.binary", "--samples", "20000", "--strict"]);
    assert_eq!(run.code, Some(1), "{run:?}");
    assert_eq!(
        run.stderr,
        "error: t.binary: expected a material that passes every check, found 2 that do not\n"
    );
    let conserving = cli.json(&["check", "t.binary", "--samples", "20000", "--energy-conserving", "--json"]);
    let albedo = conserving["energy"]["largest_albedo"].as_f64().unwrap();
    assert!(albedo > 0.99 && albedo < 1.001, "{albedo}");
    assert_eq!(conserving["failures"].as_array().unwrap().len(), 1, "{conserving}");
}

#[test]
fn scattered_samples_are_refused() {
    let cli = Cli::new();
    cli.write("s.csv", "theta_h,theta_d,phi_d,r,g,b\n10,20,30,0.1,0.1,0.1\n20,30,40,0.1,0.1,0.1\n");
    let error = cli.fails(&["check", "s.csv", "--strict"]);
    assert!(error.contains("scattered samples; bake them first"), "{error}");
}
