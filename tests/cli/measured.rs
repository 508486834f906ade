//! Measured files, where the shared data is at hand.

use crate::harness::{Cli, data_dir, metric};

#[test]
fn every_rgl_file_bakes() {
    let Some(data) = data_dir() else { return };
    let cli = Cli::new();
    let mut count = 0;
    for entry in std::fs::read_dir(data.join("rgl")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "bsdf") {
            continue;
        }
        let path = path.to_str().unwrap();
        let report = cli.json(&[
            "bake",
            path,
            "-o",
            "out",
            "--lattice",
            "16x10x8",
            "--no-images",
            "--no-sigma",
            "--json",
        ]);
        let (psnr, median) = (metric(&report, "psnr_env"), metric(&report, "median_abs_log"));
        assert!(psnr > 20.0 && psnr < 100.0, "{path}: {psnr} dB");
        assert!(median > 1e-4 && median < 0.2, "{path}: {median}");
        assert!(path.contains(report["material"].as_str().unwrap()));
        count += 1;
    }
    assert_eq!(count, 17);
}

#[test]
fn cornell_files_load_and_fit() {
    let Some(data) = data_dir() else { return };
    let cli = Cli::new();
    for name in ["acryl_blue", "cayman", "garnet_red"] {
        let path = data.join(format!("cornell/{name}.brdf"));
        let path = path.to_str().unwrap();
        let found = cli.json(&["info", path, "--json"]);
        assert_eq!(found["kind"], "Cornell measurement");
        assert_eq!((&found["name"], &found["details"]["samples"]), (&name.into(), &1439.into()));
        cli.ok(&["convert", path, "s.csv", "-q"]);
        assert_eq!(cli.json(&["info", "s.csv", "--json"])["details"]["samples"], 1439);
    }
}
