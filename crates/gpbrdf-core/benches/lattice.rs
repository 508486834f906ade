//! Benchmark of the lattice process with 64 x 32 x 18 = 36,864 nodes and three channels: sampling, a fit that
//! optimises all hyper-parameters, and baking the table's mean and sigma.
#![allow(missing_docs, reason = "criterion's macros make public items")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use gpbrdf_core::{FitOptions, LatticeLayout, Layout, Source, bake_mean, bake_sigma, fit};

fn lattice(c: &mut Criterion) {
    let mut group = c.benchmark_group("lattice_36864_rgb");
    group.sample_size(20);
    // The file named by the environment variable where it is set, else a built-in material.
    let source =
        std::env::var_os("GPBRDF_BENCH_INPUT").map_or_else(|| Source::built_in("cherry-235"), Source::open);
    let Ok(source) = source else {
        eprintln!("skipped: GPBRDF_BENCH_INPUT cannot be read");
        return;
    };
    let layout = Layout::Lattice(LatticeLayout::default());
    let Ok(samples) = source.measure(&layout) else { return };
    let options = FitOptions::default();
    let run = || fit(black_box(&samples), &options);
    let Ok(model) = run().map(|fit| fit.model) else { return };
    group.bench_function("sample", |b| b.iter(|| source.measure(black_box(&layout))));
    group.bench_function("fit", |b| b.iter(run));
    group.bench_function("bake_mean", |b| b.iter(|| bake_mean(black_box(&model))));
    group.bench_function("bake_sigma", |b| b.iter(|| bake_sigma(black_box(&model))));
    group.finish();
}

criterion_group!(benches, lattice);
criterion_main!(benches);
