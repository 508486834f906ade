//! Pictures against those of `gpbrdf-core`, the CPU twin and closed forms.

use std::f32::consts::PI;

use gpbrdf_core::base::Raster;
use gpbrdf_core::judge::{render_env, render_point};
use gpbrdf_core::{BrdfTable, Environment, SigmaTable};
use gpbrdf_render::twin::{TwinLight, shade_on_cpu};
use gpbrdf_render::{
    Background, BrdfTexture, Camera, Context, Display, Geometry, Ground, Light, LinearPicture, LinearPixel,
    Mesh, Precision, Renderer, Sampling, ShadingOptions, Show, glam,
};

use crate::fixtures::{glossy, rippled, studio, upload};

crate::support::gpu_tests![
    the_sphere_under_a_point_light_is_the_core_s,
    meshes_under_direct_light_are_the_twin_s,
    the_three_strategies_agree_with_quadrature,
    a_white_furnace_returns_one,
    sigma_is_weighted_by_light_and_pictures_show_what_was_asked_for,
    pictures_repeat_and_impossible_sizes_are_refused,
    the_ground_is_seen_where_rays_meet_it,
];

/// The largest and the root of the mean square difference, relative to `scale`.
fn gaps<'a>(found: &[[f32; 3]], expected: impl Iterator<Item = &'a [f64; 3]>, scale: f64) -> (f64, f64) {
    let (mut worst, mut sum, mut count) = (0.0f64, 0.0, 0usize);
    for (a, b) in found.iter().zip(expected) {
        for c in 0..3 {
            let gap = (f64::from(a[c]) - b[c]).abs() / scale;
            worst = worst.max(gap);
            sum += gap * gap;
            count += 1;
        }
    }
    (worst, (sum / count as f64).sqrt())
}

fn widened(pixels: &[[f32; 3]]) -> Vec<[f64; 3]> {
    pixels.iter().map(|p| p.map(f64::from)).collect()
}

fn truth(picture: &LinearPicture) -> Vec<[f32; 3]> {
    picture.raster().pixels().iter().map(|pixel| pixel.truth).collect()
}

fn prediction(picture: &LinearPicture) -> Vec<[f32; 3]> {
    picture.raster().pixels().iter().map(|pixel| pixel.prediction).collect()
}

fn the_sphere_under_a_point_light_is_the_core_s(context: &Context) {
    let tables = [BrdfTable::from_fn(glossy), BrdfTable::from_fn(rippled)];
    let mut renderer = Renderer::new(context, [96, 96]).unwrap();
    renderer.set_shading(ShadingOptions::of_metrics()).unwrap();
    renderer.set_materials(Some(&upload(context, &tables[0])), &upload(context, &tables[1])).unwrap();
    renderer.render_more(1).unwrap();
    let found = renderer.read_linear().unwrap();
    let expected = render_point(&[&tables[0], &tables[1]], 96);
    let mask: Vec<bool> = found.raster().pixels().iter().map(|p| p.coverage > 0.0).collect();
    assert_eq!(mask, expected[0].mask());
    for (found, expected) in [truth(&found), prediction(&found)].iter().zip(&expected) {
        let (worst, rms) = gaps(found, widened(expected.raster().pixels()).iter(), 1.0);
        eprintln!("sphere, point light: worst {worst:.1e}, rms {rms:.1e}");
        assert!(worst < 2e-3, "{worst}");
    }
    // The texture unit's weights are coarser.
    renderer.set_shading(ShadingOptions { exact_lookup: false, ..ShadingOptions::of_metrics() }).unwrap();
    renderer.render_more(1).unwrap();
    let filtered = renderer.read_linear().unwrap();
    let (worst, _) = gaps(&truth(&filtered), widened(expected[0].raster().pixels()).iter(), 1.0);
    assert!(worst < 2e-2, "{worst}");
}

fn meshes_under_direct_light_are_the_twin_s(context: &Context) {
    let table = BrdfTable::from_fn(glossy);
    let texture = upload(context, &table);
    let mut renderer = Renderer::new(context, [80, 60]).unwrap();
    renderer.set_shading(ShadingOptions { min_cosine: 0.0, ..ShadingOptions::of_metrics() }).unwrap();
    renderer.set_materials(None, &texture).unwrap();
    let point = Light::Point { position: glam::vec3(1.5, 1.0, 2.0), intensity: [6.0, 5.0, 4.0] };
    let perspective = Camera::perspective(0.6, 0.9).orbited(0.5, 0.4);
    for (mesh, camera) in [(Mesh::knot(), perspective), (Mesh::rounded_box(), Camera::default())] {
        renderer.set_geometry(&Geometry::Mesh(mesh)).unwrap();
        renderer.set_camera(camera).unwrap();
        for light in [&point, &Light::of_metrics()] {
            renderer.set_light(light.clone()).unwrap();
            renderer.render_more(1).unwrap();
            let found = renderer.read_linear().unwrap();
            let texels = renderer.gbuffer().download(context).unwrap();
            let hits = texels.iter().filter(|t| t.hit).count();
            assert!(hits > 1000, "{hits}");
            for texel in texels.iter().filter(|t| t.hit) {
                let normal = glam::Vec3::from_array(texel.normal);
                assert!((normal.length() - 1.0).abs() < 1e-4, "{texel:?}");
            }
            let expected = shade_on_cpu(&texels, &camera, TwinLight::Direct(light), &[&table], 0.0).remove(0);
            let (worst, rms) = gaps(&prediction(&found), expected.iter(), 1.0);
            eprintln!("mesh: worst {worst:.1e}, rms {rms:.1e}");
            assert!(worst < 2e-3, "{worst}");
        }
    }
}

fn environment_picture(
    context: &Context,
    renderer: &mut Renderer,
    sampling: Sampling,
    samples: u32,
) -> LinearPicture {
    renderer.set_shading(ShadingOptions { sampling, ..ShadingOptions::of_metrics() }).unwrap();
    renderer.restart();
    for _ in 0..samples / 64 {
        renderer.render_more(64).unwrap();
        context.wait("test").unwrap();
    }
    renderer.read_linear().unwrap()
}

fn the_three_strategies_agree_with_quadrature(context: &Context) {
    let table = BrdfTable::from_fn(glossy);
    let mut renderer = Renderer::new(context, [20, 20]).unwrap();
    renderer.set_materials(None, &upload(context, &table)).unwrap();
    renderer.set_light(studio()).unwrap();
    renderer.set_shading(ShadingOptions::of_metrics()).unwrap();
    renderer.render_more(1).unwrap();
    let texels = renderer.gbuffer().download(context).unwrap();
    let environment = Environment::studio();
    let light = TwinLight::Patches { environment: &environment, patches: (192, 96) };
    let fine = shade_on_cpu(&texels, &Camera::default(), light, &[&table], gpbrdf_core::brdf::GRAZING_COSINE)
        .remove(0);
    let coarse = TwinLight::Patches { environment: &environment, patches: gpbrdf_core::judge::ENV_PATCHES };
    let coarse =
        shade_on_cpu(&texels, &Camera::default(), coarse, &[&table], gpbrdf_core::brdf::GRAZING_COSINE)
            .remove(0);
    let core = render_env(&[&table], &environment, 20).remove(0);
    let (worst, _) = gaps(core.raster().pixels(), coarse.iter(), 1.0);
    assert!(worst < 1e-5, "the twin is not the core: {worst}");
    let mut pictures = Vec::new();
    for (sampling, limit) in [(Sampling::Light, 0.01), (Sampling::Brdf, 0.02), (Sampling::Both, 0.008)] {
        let found = environment_picture(context, &mut renderer, sampling, 1024);
        let (worst, rms) = gaps(&prediction(&found), fine.iter(), 1.0);
        eprintln!("{sampling:?}: worst {worst:.1e}, rms {rms:.1e}");
        assert!(rms < limit, "{sampling:?}: worst {worst:e}, rms {rms:e}");
        // No bias: the mean of all pixels is far better than each.
        let mean = |pixels: &[[f64; 3]]| pixels.iter().flatten().sum::<f64>();
        let ratio = mean(&widened(&prediction(&found))) / mean(&fine);
        assert!((ratio - 1.0).abs() < 0.003, "{sampling:?}: {ratio}");
        pictures.push(found);
    }
    for other in &pictures[1..] {
        let (_, rms) = gaps(&prediction(other), widened(&prediction(&pictures[0])).iter(), 1.0);
        assert!(rms < 0.025, "{rms}");
    }
}

fn a_white_furnace_returns_one(context: &Context) {
    let lambert = BrdfTable::from_fn(|_| [1.0 / f64::from(PI); 3]);
    let mut renderer = Renderer::new(context, [12, 12]).unwrap();
    renderer.set_materials(None, &upload(context, &lambert)).unwrap();
    let white = Environment::new(Raster::filled(16, 8, [1.0; 3])).unwrap();
    renderer.set_light(Light::Environment((&white).into())).unwrap();
    for sampling in [Sampling::Light, Sampling::Brdf, Sampling::Both] {
        renderer.set_shading(ShadingOptions { sampling, ..ShadingOptions::default() }).unwrap();
        renderer.render_more(512).unwrap();
        let found = renderer.read_linear().unwrap();
        let inside = found.raster().pixels().iter().filter(|p| p.coverage == 1.0);
        let values: Vec<f32> = inside.map(|p| p.prediction[0]).collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let worst = values.iter().map(|x| (x - 1.0).abs()).fold(0.0, f32::max);
        eprintln!("furnace, {sampling:?}: mean {mean:.5}, worst {worst:.1e}");
        assert!((mean - 1.0).abs() < 2e-3 && worst < 0.05, "{sampling:?}: {mean} {worst}");
    }
}

fn sigma_is_weighted_by_light_and_pictures_show_what_was_asked_for(context: &Context) {
    let table = BrdfTable::from_fn(|_| [0.2; 3]);
    let darker = BrdfTable::from_fn(|_| [0.18; 3]);
    let source = gpbrdf_core::Source::built_in("cherry-235").unwrap();
    let layout = gpbrdf_core::Layout::Random { count: 20, seed: 1 };
    let samples = source.measure(&layout).unwrap();
    let model = gpbrdf_core::fit(&samples, &gpbrdf_core::FitOptions::default()).unwrap().model;
    let sigma: SigmaTable = gpbrdf_core::bake_sigma(&model).unwrap();
    let prediction = BrdfTexture::upload(context, &darker, Some(&sigma), Precision::Half).unwrap();
    let mut renderer = Renderer::new(context, [24, 16]).unwrap();
    let black = renderer.read_display(&Display::default()).unwrap();
    assert!(black.iter().all(|p| *p == [0, 0, 0, 255]));
    renderer.set_materials(Some(&upload(context, &table)), &prediction).unwrap();
    renderer.render_more(16).unwrap();
    assert_eq!(renderer.samples(), 16);
    let linear = renderer.read_linear().unwrap();
    let means = linear.raster().pixels();
    assert_eq!(means.len(), 24 * 16);
    let (low, high) = means
        .iter()
        .filter(|p| p.prediction[0] > 0.0)
        .fold((f32::MAX, 0.0f32), |(a, b), p| (a.min(p.sigma), b.max(p.sigma)));
    let all = sigma.planes().iter().flatten().fold((f32::MAX, 0.0f32), |(a, b), &s| (a.min(s), b.max(s)));
    assert!(low >= all.0 * 0.99 && high <= all.1 * 1.01 && high > low, "{low} {high} {all:?}");
    // The prediction is darker by a tenth.
    let differences = linear.difference(2.0);
    for (difference, LinearPixel { truth, .. }) in differences.iter().zip(means) {
        assert!((difference + 0.2 * truth[0]).abs() <= 1e-3 * truth[0], "{difference} {truth:?}");
    }
    let middle = 8 * 24 + 12;
    // Too dark is blue, and halfway to the end of the scale is halfway to its colour.
    let gap = -linear.difference(1.0)[middle];
    assert!(gap > 0.01, "{gap}");
    for (limit, t) in [(0.5 * gap, 0.0), (2.0 * gap, 0.25)] {
        let display = Display { show: Show::Difference, limit: Some(limit), ..Display::default() };
        let expected = gpbrdf_core::figure::Colormap::Diverging.at(t);
        let found = renderer.read_display(&display).unwrap()[middle];
        assert!(found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1), "{found:?} {expected:?}");
    }
    let mut show = |show, background| {
        renderer.read_display(&Display { show, background, ..Display::default() }).unwrap()
    };
    assert_eq!(show(Show::Truth, Background::Transparent)[0][3], 0);
    let (truth, predicted) =
        (show(Show::Truth, Background::Black), show(Show::Prediction, Background::Black));
    let split = show(Show::Split { at: 0.5 }, Background::Black);
    assert_eq!((split[middle - 2], split[middle + 2]), (truth[middle - 2], predicted[middle + 2]));
    // Gamma 2.2, clipped, by hand.
    let value = (means[middle].truth[0].clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0).round();
    assert!((f32::from(truth[middle][0]) - value).abs() <= 1.0, "{:?} {value}", truth[middle]);
    let wrong = renderer.read_display(&Display { exposure: -1.0, ..Display::default() });
    assert!(wrong.unwrap_err().to_string().contains("positive exposure"));
}

fn pictures_repeat_and_impossible_sizes_are_refused(context: &Context) {
    let texture = upload(context, &BrdfTable::from_fn(glossy));
    let mut renderer = Renderer::new(context, [16, 16]).unwrap();
    renderer.set_materials(None, &texture).unwrap();
    renderer.set_light(studio()).unwrap();
    renderer.render_more(8).unwrap();
    let first = renderer.read_linear().unwrap();
    renderer.resize([17, 9]).unwrap();
    renderer.render_more(4).unwrap();
    renderer.resize([16, 16]).unwrap();
    renderer.render_more(4).unwrap();
    renderer.render_more(4).unwrap();
    assert_eq!(renderer.read_linear().unwrap(), first);
    let message = renderer.resize([0, 5]).unwrap_err().to_string();
    assert!(message.contains("found 0 x 5"), "{message}");
    assert!(renderer.resize([1 << 20, 1]).is_err());
    assert_eq!(renderer.size(), [16, 16]);
    renderer.render_more(1).unwrap();
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "places on the ground")]
fn the_ground_is_seen_where_rays_meet_it(context: &Context) {
    let environment = Environment::new(Raster::filled(16, 8, [0.6; 3])).unwrap();
    let ground = Ground::new(&Geometry::Sphere, &environment, 400);
    let camera = Camera::perspective(0.9, 0.5).orbited(0.4, 0.5);
    let size = [90u32, 60];
    let mut renderer = Renderer::new(context, size).unwrap();
    renderer.set_camera(camera).unwrap();
    renderer.set_light(Light::Environment((&environment).into())).unwrap();
    renderer.set_materials(None, &upload(context, &BrdfTable::from_fn(|_| [0.1; 3]))).unwrap();
    renderer.set_ground(Some(&ground)).unwrap();
    renderer.set_shading(ShadingOptions { antialias: false, ..ShadingOptions::default() }).unwrap();
    renderer.render_more(1).unwrap();
    let shown = renderer.read_display(&Display::default()).unwrap();
    let linear = renderer.read_linear().unwrap();
    let axes = camera.world_from_view();
    let (half_x, half_y) = camera.half_extents(1.5);
    let radiance = ground.radiance();
    let texels = radiance.width();
    let mut compared = 0;
    for (i, pixel) in shown.iter().enumerate().filter(|(i, _)| linear.raster().pixels()[*i].coverage == 0.0) {
        let (column, row) = ((i % 90) as f32 + 0.5, (i / 90) as f32 + 0.5);
        let across = axes.x_axis * (2.0 * column / 90.0 - 1.0) * half_x
            + axes.y_axis * (1.0 - 2.0 * row / 60.0) * half_y;
        let along = across - axes.z_axis;
        let mut expected = 0.6;
        if along.y < -1e-3 {
            let met = camera.eye + (ground.height() - camera.eye.y) / along.y * along;
            let share = met.x.hypot(met.z) / ground.half();
            let t = ((share - 0.25) / 0.75).clamp(0.0, 1.0);
            let fade = t * t * (3.0 - 2.0 * t);
            let place = |x: f32| {
                let at = (0.5 * x / ground.half() + 0.5) * texels as f32;
                (at.max(0.0) as usize).min(texels - 1)
            };
            let value = radiance.at(place(met.x), place(met.z))[1];
            expected = value + fade * (0.6 - value);
        }
        let found = (f32::from(pixel[1]) / 255.0).powf(2.2);
        // The nearest texel stands for the interpolation.
        assert!((found - expected).abs() < 0.02, "pixel {i}: {found}, not {expected}");
        compared += 1;
    }
    assert!(compared > 2000, "{compared}");
    // A map that is black below the horizon: the ground fades into what is above it.
    let half = Raster::from_fn(16, 8, |_, y| if y < 4 { [0.6; 3] } else { [0.0; 3] });
    renderer.set_light(Light::Environment((&Environment::new(half).unwrap()).into())).unwrap();
    renderer.set_camera(Camera::perspective(0.9, 0.5).orbited(0.4, 0.15)).unwrap();
    let mut darkest = |ground: Ground| {
        renderer.set_ground(Some(&ground)).unwrap();
        renderer.render_more(1).unwrap();
        let shown = renderer.read_display(&Display::default()).unwrap();
        // From the horizon down, at the left of the object.
        (20..40).flat_map(|row| &shown[90 * row..90 * row + 10]).map(|pixel| pixel[1]).min().unwrap()
    };
    let plain = darkest(ground.clone());
    let mirrored = darkest(ground.clone().with_horizon(0.5));
    assert!(mirrored > 2 * plain, "{plain} {mirrored}");
    // Without a ground there is the map.
    renderer.set_ground(None).unwrap();
    let plain = renderer.read_display(&Display::default()).unwrap();
    assert!(plain.iter().zip(&shown).any(|(a, b)| a != b));
}
