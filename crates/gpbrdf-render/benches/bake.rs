//! What the processor prepares for the bake of a lattice model of 64 x 32 x 18 nodes, which needs no device, with new
//! kernels and with those of a model before; and baking on the device until the texture is written: this model and a
//! dense one, both RGB; and giving two textures to a renderer.
#![allow(missing_docs, reason = "criterion's macros make public items")]

use std::hint::black_box;
use std::ops::ControlFlow;

use criterion::{Criterion, criterion_group, criterion_main};
use gpbrdf_core::gp::OptimizeOptions;
use gpbrdf_core::{FitOptions, LatticeLayout, Layout, Model, Solver, Source, fit};
use gpbrdf_render::{AdapterChoice, Baker, BrdfTexture, Context, Precision, Prepared, Renderer};

fn model(layout: &Layout, solver: Solver) -> Option<Model> {
    let source = Source::built_in("cherry-235").ok()?;
    let samples = source.measure(layout).ok()?;
    let optimize = OptimizeOptions { max_iterations: 8, ..OptimizeOptions::default() };
    let space = LatticeLayout::default().space().into();
    let options = FitOptions { solver, optimize, space: Some(space), ..FitOptions::default() };
    Some(fit(&samples, &options).ok()?.model)
}

fn bake(c: &mut Criterion) {
    let Some(lattice) = model(&Layout::Lattice(LatticeLayout::default()), Solver::Lattice) else { return };
    c.bench_function("prepare_lattice_36864", |b| b.iter(|| Prepared::new(black_box(&lattice)).is_ok()));
    let context = match Context::open(AdapterChoice::Any) {
        Ok(context) => context,
        Err(error) => return eprintln!("skipped: {error}"),
    };
    eprintln!("on {}", context.describe());
    // A software device takes as long for 64 samples as a GPU for thousands.
    let dense_samples = if context.is_hardware() { 4096 } else { 64 };
    let dense = model(&Layout::Random { count: dense_samples, seed: 1 }, Solver::Dense);
    let (Some(dense), Ok(baker)) = (dense, Baker::new(&context)) else { return };
    c.bench_function("prepare_lattice_36864_again", |b| {
        b.iter(|| baker.prepare(black_box(&lattice)).is_ok());
    });
    let Ok(texture) = BrdfTexture::empty(&context, Precision::Half) else { return };
    let mut group = c.benchmark_group("bake");
    group.sample_size(10);
    let dense_name = format!("dense_{dense_samples}");
    for (name, model) in [("lattice_36864", &lattice), (dense_name.as_str(), &dense)] {
        group.bench_function(name, |b| {
            b.iter(|| -> gpbrdf_render::Result<()> {
                baker.bake_into(model, &texture, &mut |_| ControlFlow::Continue(()))?;
                context.wait("bench")
            });
        });
    }
    group.finish();
    // Both textures are read back, and the densities made by which directions are drawn.
    let Ok(mut renderer) = Renderer::new(&context, [64, 64]) else { return };
    c.bench_function("change_two_materials", |b| {
        b.iter(|| renderer.set_materials(Some(&texture), &texture).is_ok());
    });
}

criterion_group!(benches, bake);
criterion_main!(benches);
