//! `render`: pictures without a window. The tests are skipped, and say so, if there is no graphics adapter.

use crate::harness::Cli;

/// Whether a first small picture can be rendered here.
fn has_adapter(cli: &Cli) -> bool {
    let run =
        cli.run(&["render", "lambert", "--show", "truth", "--size", "8x8", "--spp", "1", "-o", "probe.png"]);
    if run.code == Some(0) {
        return true;
    }
    assert!(run.stderr.contains("no graphics adapter"), "{run:?}");
    assert!(run.stderr.contains("mesa-vulkan-drivers") && !cli.path("probe.png").exists(), "{run:?}");
    assert!(std::env::var("GPBRDF_REQUIRE_GPU").is_err(), "{run:?}");
    eprintln!("skipped: {}", run.stderr.trim_end());
    false
}

#[test]
fn a_comparison_has_its_figures_in_json_and_in_the_picture() {
    let cli = Cli::new();
    if !has_adapter(&cli) {
        return;
    }
    let small = ["render", "red-plastic", "--samples", "200", "--size", "48x40", "--spp", "8"];
    let out = cli.ok(&[&small[..], &["--scene", "knot", "--compare", "--json", "-o", "a.png"]].concat());
    let report: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert!(report["psnr"].as_f64().unwrap() > 15.0, "{out}");
    assert!(report["ssim"].as_f64().unwrap() > 0.5 && report["width"] == 48, "{out}");
    assert!(report["pixel_difference"]["median"].as_f64().unwrap() < 0.5, "{out}");
    assert!(cli.read("a.png").starts_with(b"\x89PNG"));
    cli.ok(&[&small[..], &["--compare", "-q", "-o", "a.svg", "-o", "a.pdf", "--width", "85"]].concat());
    let svg = String::from_utf8(cli.read("a.svg")).unwrap();
    assert!(svg.contains("width=\"85mm\"") && svg.contains("predicted from") && svg.contains("difference"));
    assert!(cli.read("a.pdf").starts_with(b"%PDF"));
    let several = ["--show", "sigma", "-o", "s.png", "-o", "s.exr", "-q"];
    cli.ok(&[&small[..], &several].concat());
    assert!(cli.read("s.exr").starts_with(&[0x76, 0x2f, 0x31, 0x01]));
    let light = ["--light", "point", "--light-at", "2,2,3", "--background", "transparent", "-q"];
    cli.ok(&[&small[..], &light, &["--scene", "box", "-o", "t.png"]].concat());
}

#[test]
fn wrong_requests_are_refused_and_leave_nothing() {
    let cli = Cli::new();
    if !has_adapter(&cli) {
        return;
    }
    cli.write("bad.obj", "v 0 0 0\nf 1 2 3\n");
    cli.write("samples.csv", "");
    for (arguments, part) in [
        (&["render", "--scene", "torus"][..], "expected sphere, knot, box or a mesh file, found \"torus\""),
        (&["render", "--scene", "bad.obj"], "OBJ file \"bad.obj\": expected"),
        (&["render", "--scene", "missing.obj"], "cannot read \"missing.obj\""),
        (&["render", "-o", "a.jpg"], "ends in .png, .svg, .pdf or .exr"),
        (&["render", "--compare", "-o", "a.exr"], "expected .png, .svg or .pdf"),
        (&["render", "--size", "99999999x2"], "found 99999999 x 2"),
        (&["render", "--light", "directional", "--light-at", "0,0,0"], "expected a direction"),
        (&["render", "--env", "bad.obj"], "environment map"),
    ] {
        let run = cli.run(arguments);
        assert!(run.code == Some(1) && run.stderr.contains(part), "{arguments:?}: {run:?}");
    }
    assert!(!cli.path("render.png").exists() && !cli.path("a.jpg").exists());
    let usage = cli.run(&["render", "--size", "0x5"]);
    assert!(usage.code == Some(2) && usage.stderr.contains("like 640x480"), "{usage:?}");
}
