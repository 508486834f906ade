//! Pictures against pictures that are kept.

use std::path::Path;

use gpbrdf_core::BrdfTable;
use gpbrdf_render::{Camera, Context, Display, Encoding, Geometry, Mesh, Renderer, Show, ToneCurve};

use crate::fixtures::{glossy, rippled, studio, upload};

crate::support::gpu_tests![pictures_are_those_of_the_goldens];

/// Compares with a picture in `tests/golden`, or renews that if the environment variable `UPDATE_SNAPSHOTS`
/// is 1.
fn compare_with_golden(name: &str, size: [u32; 2], found: &[[u8; 4]]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden").join(name);
    if std::env::var("UPDATE_SNAPSHOTS").is_ok_and(|v| v == "1") {
        image::save_buffer(&path, found.as_flattened(), size[0], size[1], image::ColorType::Rgba8).unwrap();
        assert!(std::fs::metadata(&path).unwrap().len() <= 64 << 10);
        return;
    }
    let golden = image::open(&path).unwrap().into_rgba8();
    assert_eq!([golden.width(), golden.height()], size);
    let gaps: Vec<u8> = golden.iter().zip(found.as_flattened()).map(|(a, b)| a.abs_diff(*b)).collect();
    let mean = gaps.iter().map(|&g| f64::from(g)).sum::<f64>() / gaps.len() as f64;
    let worst = gaps.iter().max().unwrap();
    eprintln!("{name}: mean error {mean:.3}, largest {worst}");
    // Edges may fall to either side of a pixel on another device.
    assert!(mean < 0.5 && gaps.iter().filter(|&&g| g > 8).count() < gaps.len() / 100, "{mean} {worst}");
}

fn pictures_are_those_of_the_goldens(context: &Context) {
    let size = [72, 64];
    let (truth, prediction) = (BrdfTable::from_fn(glossy), BrdfTable::from_fn(rippled));
    let (truth, prediction) = (upload(context, &truth), upload(context, &prediction));
    let mut renderer = Renderer::new(context, size).unwrap();
    renderer.set_materials(Some(&truth), &prediction).unwrap();
    renderer.set_light(studio()).unwrap();
    let camera = Camera::perspective(0.6, 0.9).orbited(0.4, 0.3);
    let show = |show| Display {
        show,
        exposure: 0.7,
        tone: ToneCurve::Filmic,
        encoding: Encoding::Srgb,
        ..Display::default()
    };
    for (name, geometry, shown) in [
        ("sphere.png", Geometry::Sphere, Show::Prediction),
        ("knot.png", Geometry::Mesh(Mesh::knot()), Show::Truth),
        ("box-difference.png", Geometry::Mesh(Mesh::rounded_box()), Show::Difference),
    ] {
        renderer.set_geometry(&geometry).unwrap();
        renderer.set_camera(camera).unwrap();
        renderer.render_more(32).unwrap();
        compare_with_golden(name, size, &renderer.read_display(&show(shown)).unwrap());
    }
}
