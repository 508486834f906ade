//! A run of everything, in which neither wgpu nor the validation layer of the driver logs a warning.
//!
//! This is a process of its own, because the logger and the debugging flags of the instance are global. The
//! layer is in Debian's package vulkan-validationlayers; without it, the validation of wgpu itself remains.
#![expect(clippy::unwrap_used, reason = "a test")]

use std::ops::ControlFlow;
use std::sync::Mutex;

use gpbrdf_core::{
    BrdfTable, CompressOptions, Environment, FitOptions, InducingSize, LatticeLayout, Layout, Model,
    Provenance, Solver, Source, bake_mean, bake_sigma, compress, fit,
};
use gpbrdf_render::{
    Background, Baker, BrdfTexture, Camera, Context, Display, Geometry, Light, Mesh, Precision, Renderer,
    Sampling, ShadingOptions, Show, ToneCurve, evaluate, glam,
};

#[path = "support/mod.rs"]
mod support;

/// Messages at the level of a warning or above.
static WARNINGS: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Parts of messages that are not about this crate: there is no layer, the layer is older than the number of
/// WGSL among the languages in the debug information of SPIR-V (`WGPU_DEBUG=0` leaves that out), and wgpu
/// tries graphics libraries that it then does not use.
const FOREIGN: [&str; 4] = [
    "unable to find layer",
    "Invalid source language operand: 10",
    "wgpu_hal::gles::egl",
    // The second half of a message.
    "\tobjects: ",
];

struct Logger;

impl log::Log for Logger {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            let text = format!("{} {}: {}", record.level(), record.target(), record.args());
            WARNINGS.lock().unwrap().push(text);
        }
    }

    fn flush(&self) {}
}

fn fitted(layout: &Layout, options: FitOptions) -> Model {
    let source = Source::built_in("cherry-235").unwrap();
    let samples = source.measure(layout).unwrap();
    let options = FitOptions { space: Some(LatticeLayout::default().space().into()), ..options };
    fit(&samples, &options).unwrap().model
}

/// One model of each kind of process.
fn models() -> Vec<Model> {
    let lattice = Layout::Lattice(LatticeLayout { shape: [10, 8, 6], ..LatticeLayout::default() });
    let scattered = Layout::Random { count: 24, seed: 3 };
    let table = BrdfTable::from_fn(|a| [0.1 + a.theta_h.cos().powi(40); 3]);
    let size = InducingSize::Shape([5, 4, 3]);
    let options = CompressOptions { size, ..CompressOptions::default() };
    vec![
        fitted(&lattice, FitOptions::default()),
        fitted(&lattice, FitOptions { per_channel: true, ..FitOptions::default() }),
        fitted(&scattered, FitOptions { solver: Solver::Dense, ..FitOptions::default() }),
        fitted(&scattered, FitOptions::default()),
        compress(&table, &options, Provenance::default()).unwrap().model,
    ]
}

fn bake_all(context: &Context, models: &[Model]) {
    let baker = Baker::new(context).unwrap();
    for model in models {
        for precision in [Precision::Half, Precision::Single] {
            let baked = baker.bake(model, precision, &mut |_| ControlFlow::Continue(()));
            match baked {
                Ok(texture) => drop(texture.to_tables(context).unwrap()),
                // A dense model on a device without f64.
                Err(error) => assert!(matches!(error, gpbrdf_render::Error::NoShader { .. }), "{error}"),
            }
        }
    }
}

fn render_all(context: &Context, model: &Model) {
    let (mean, sigma) = (bake_mean(model), bake_sigma(model).unwrap());
    let prediction = BrdfTexture::upload(context, &mean, Some(&sigma), Precision::Half).unwrap();
    let truth = BrdfTexture::upload(context, &mean, None, Precision::Half).unwrap();
    let direction = [0.3, 0.2, 0.93, 0.0];
    evaluate(context, &prediction, &[[direction; 2]; 3]).unwrap();
    let mut renderer = Renderer::new(context, [40, 24]).unwrap();
    renderer.set_materials(Some(&truth), &prediction).unwrap();
    let lights = [
        Light::of_metrics(),
        Light::Point { position: glam::vec3(2.0, 1.0, 2.0), intensity: [3.0; 3] },
        Light::Environment((&Environment::studio()).into()),
    ];
    let scenes = [Geometry::Sphere, Geometry::Mesh(Mesh::knot()), Geometry::Mesh(Mesh::rounded_box())];
    for geometry in &scenes {
        renderer.set_geometry(geometry).unwrap();
        for camera in [Camera::default(), Camera::perspective(0.6, 0.9)] {
            renderer.set_camera(camera).unwrap();
            for light in &lights {
                renderer.set_light(light.clone()).unwrap();
                for sampling in [Sampling::Light, Sampling::Brdf, Sampling::Both] {
                    renderer.set_shading(ShadingOptions { sampling, ..ShadingOptions::default() }).unwrap();
                    renderer.render_more(2).unwrap();
                }
            }
        }
    }
    renderer.read_linear().unwrap();
    for show in [Show::Truth, Show::Prediction, Show::Sigma, Show::Difference, Show::Split { at: 0.5 }] {
        for background in [Background::Environment, Background::Black, Background::Transparent] {
            for tone in [ToneCurve::Clip, ToneCurve::Reinhard, ToneCurve::Filmic] {
                renderer.read_display(&Display { show, background, tone, ..Display::default() }).unwrap();
            }
        }
    }
    renderer.resize([16, 32]).unwrap();
    renderer.render_more(1).unwrap();
    renderer.read_display(&Display::default()).unwrap();
}

#[test]
fn a_run_of_everything_raises_no_warning() {
    log::set_logger(&Logger).unwrap();
    log::set_max_level(log::LevelFilter::Warn);
    support::on_device("a_run_of_everything_raises_no_warning", run_everything);
}

fn run_everything(context: &Context) {
    let models = models();
    bake_all(context, &models);
    render_all(context, &models[0]);
    context.wait("test").unwrap();
    let all = std::mem::take(&mut *WARNINGS.lock().unwrap());
    let (known, raised): (Vec<String>, Vec<String>) =
        all.into_iter().partition(|text| FOREIGN.iter().any(|part| text.contains(part)));
    known.iter().for_each(|text| eprintln!("{text}"));
    assert!(raised.is_empty(), "{}", raised.join("\n"));
}
