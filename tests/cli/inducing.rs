//! Compression of whole tables to a few stored numbers.

use crate::harness::{Cli, metric};

#[test]
fn a_table_is_compressed_to_so_many_floats() {
    let cli = Cli::new();
    let report = cli.json(&["bake", "red-plastic", "-o", "out", "--floats", "150", "--no-images", "--json"]);
    let floats = report["floats"].as_u64().unwrap();
    assert!((120..=150).contains(&floats), "{floats}");
    assert_eq!(report["samples"], 1_096_216, "all valid cells, another size than what is stored");
    assert_eq!((&report["layout"], &report["solver"]), (&"table".into(), &"inducing".into()));
    assert_eq!(report["hyperparameters"]["components"].as_array().unwrap().len(), 3);
    assert!(report["log_marginal_likelihood"].as_f64().unwrap().is_finite());
    assert!(metric(&report, "psnr_env") > 30.0, "{}", report["metrics"]);
    assert!((0.5..1.0).contains(&metric(&report, "coverage_95")), "{}", report["metrics"]);

    // The model file gives the same table, and says what it is.
    let info = cli.json(&["info", "out/model.safetensors", "--json"]);
    assert_eq!(
        (&info["details"]["floats"], &info["details"]["solver"]),
        (&floats.into(), &"inducing".into())
    );
    cli.ok(&["convert", "out/model.safetensors", "again.binary", "-q"]);
    assert_eq!(cli.read("again.binary"), cli.read("out/table.binary"));
}

#[test]
fn a_shape_gives_three_lattices_of_it() {
    let cli = Cli::new();
    cli.ok(&["fit", "red-plastic", "-o", "m.safetensors", "--inducing", "5x4x2", "-q"]);
    let info = cli.json(&["info", "m.safetensors", "--json"]);
    assert_eq!(info["details"]["floats"], 3 * 5 * 4 * 2 + 3 * 8 + 12);
    for component in info["details"]["hyperparameters"]["components"].as_array().unwrap() {
        assert_eq!(component["shape"], serde_json::json!([5, 4, 2]));
    }
}

#[test]
fn sizes_and_sources_that_do_not_fit_are_refused() {
    let cli = Cli::new();
    let fails = |arguments: &[&str], said: &str| {
        let run = cli.run(arguments);
        assert!(run.code != Some(0) && run.stderr.contains(said), "{arguments:?}: {run:?}");
    };
    fails(&["fit", "red-plastic", "--floats", "20"], "number of floats: expected at least");
    fails(&["fit", "red-plastic", "--inducing", "600x2x2"], "inducing lattice: expected 1 to 512 nodes");
    fails(&["fit", "red-plastic", "--inducing", "0x2x2"], "found 0x2x2");
    fails(&["fit", "red-plastic", "--floats", "99", "--samples", "99"], "cannot be used with");
    fails(&["fit", "red-plastic", "--floats", "99", "--kernel", "se+rq"], "--kernel: expected one shape");
    fails(&["fit", "red-plastic", "--floats", "99", "--solver", "dense"], "--solver: expected its default");
    fails(&["fit", "red-plastic", "--floats", "99", "--picture-weight", "2"], "0 to 1");
    cli.ok(&["convert", "red-plastic", "s.csv", "--samples", "64", "-q"]);
    fails(
        &["fit", "s.csv", "--floats", "99"],
        "expected a BRDF that can be evaluated at any directions, found scattered samples",
    );
    assert!(!cli.path("model.safetensors").exists());
}
