//! Benchmark of a fit to scattered samples, hyper-parameters included, and of the mean on the table. The samples
//! are random directions of a glossy material with 3 % noise.
#![allow(missing_docs, reason = "criterion's macros make public items")]

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use gpbrdf_core::brdf::material;
use gpbrdf_core::sample::Disturbance;
use gpbrdf_core::{FitOptions, Layout, SampleSet, bake_mean, fit};

fn samples(count: usize) -> gpbrdf_core::Result<SampleSet> {
    let mut samples = SampleSet::measure(material("purple-paint")?, &Layout::Hemisphere { count, seed: 1 })?;
    Disturbance { noise: 0.03, seed: 1, ..Disturbance::default() }.apply(&mut samples)?;
    Ok(samples)
}

fn scattered(c: &mut Criterion) {
    let mut group = c.benchmark_group("scattered");
    group.sample_size(10).warm_up_time(Duration::from_millis(1));
    for count in [2_000, 6_000, 20_000] {
        let samples = match samples(count) {
            Ok(samples) => samples,
            Err(error) => {
                eprintln!("skipped: {error}");
                return;
            }
        };
        let options = FitOptions::default();
        group.bench_function(format!("fit_{count}"), |b| b.iter(|| fit(black_box(&samples), &options)));
        if let Ok(fitted) = fit(&samples, &options) {
            group.bench_function(format!("mean_{count}"), |b| b.iter(|| bake_mean(black_box(&fitted.model))));
        }
    }
    group.finish();
}

criterion_group!(benches, scattered);
criterion_main!(benches);
