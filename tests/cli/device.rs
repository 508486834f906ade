//! `--backend` and `shader`.

use gpbrdf_core::Metrics;
use gpbrdf_core::formats::read_merl;

use crate::harness::Cli;

/// Whether there is a device. Without one it says so, or panics if `GPBRDF_REQUIRE_GPU` is 1.
fn has_device() -> bool {
    match gpbrdf_render::Context::open(gpbrdf_render::AdapterChoice::Any) {
        Ok(_) => true,
        Err(error) if std::env::var("GPBRDF_REQUIRE_GPU").is_ok_and(|v| v == "1") => panic!("{error}"),
        Err(error) => {
            eprintln!("skipped: {error}");
            false
        }
    }
}

#[test]
fn the_device_bakes_the_same_table() {
    if !has_device() {
        return;
    }
    let cli = Cli::new();
    let small = ["bake", "red-plastic", "--lattice", "12x8x6", "--no-images", "--no-metrics", "--json"];
    let run = |backend: &str| {
        let mut arguments = small.to_vec();
        arguments.extend(["--backend", backend, "-o", backend]);
        let report = cli.json(&arguments);
        (
            report["backend"].as_str().unwrap().to_owned(),
            read_merl(cli.path(backend).join("table.binary").as_path()).unwrap(),
        )
    };
    let (name, cpu) = run("cpu");
    assert_eq!(name, "cpu");
    let (name, gpu) = run("gpu");
    assert_ne!(name, "cpu");
    // A lattice model is baked before a device is open.
    let (name, auto) = run("auto");
    assert_eq!((name.as_str(), &auto), ("cpu", &cpu));
    let environment = gpbrdf_core::Environment::studio();
    let metrics = Metrics::new(&cpu, &gpu, &environment, None).unwrap();
    assert!(metrics.cells.log_rmse < 1e-5, "{metrics:?}");
}

#[test]
fn a_device_that_is_asked_for_refuses_a_model_without_a_shader() {
    if !has_device() {
        return;
    }
    let cli = Cli::new();
    let error = cli.fails(&[
        "bake",
        "red-plastic",
        "--samples",
        "20",
        "--layout",
        "random",
        "--kernel",
        "matern",
        "--backend",
        "gpu",
        "--no-images",
        "--no-metrics",
        "--no-sigma",
        "--json",
        "-o",
        "out",
    ]);
    assert!(error.contains("no shader for the kernel matern; use --backend auto or cpu"), "{error}");
    assert!(!cli.path("out").exists());
}

#[test]
fn the_lookup_comes_in_every_language() {
    let cli = Cli::new();
    for (language, mark) in [
        ("wgsl", "fn gpbrdf_lookup("),
        ("glsl", "#ifndef GPBRDF_LOOKUP_INCLUDED"),
        ("hlsl", "Texture3D<float4>"),
        ("msl", "metal::texture3d<float"),
    ] {
        let text = cli.ok(&["shader", "--lang", language]);
        assert!(text.contains(mark), "{language}: {text}");
        cli.ok(&["-q", "shader", "--lang", language, "-o", "lookup.txt"]);
        assert_eq!(cli.read("lookup.txt"), text.as_bytes());
    }
    let whole = cli.ok(&["shader", "--lang", "glsl", "--compute"]);
    assert!(whole.starts_with("#version 450") && whole.contains("void main()"), "{whole}");
    cli.ok(&["shader", "--lang", "spirv", "-o", "lookup.spv"]);
    assert_eq!(cli.read("lookup.spv")[..4], 0x0723_0203u32.to_le_bytes());
}
