//! Benchmark of the dense Gaussian process with 4096 samples: assembly of the covariance matrix, and one step
//! of an optimisation.
#![allow(missing_docs, reason = "criterion's macros make public items")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use gpbrdf_core::Shape;
use gpbrdf_core::gp::DenseEvaluator;
use gpbrdf_core::kernel::Kernel;

const N: usize = 4096;

/// Points of an additive recurrence in the unit cube, and smooth targets in three channels.
fn samples() -> (Vec<f64>, Vec<f64>) {
    let fraction = |i: usize, ratio: f64| ((i + 1) as f64 * ratio).fract();
    let x: Vec<f64> = (0..N)
        .flat_map(|i| {
            [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_2]
                .map(|r| fraction(i, r))
        })
        .collect();
    let y = x.chunks(3).flat_map(|p| [(6.0 * p[0]).sin(), (5.0 * p[1]).cos() * p[0], p[2] * p[1]]).collect();
    (x, y)
}

fn dense(c: &mut Criterion) {
    let (x, y) = samples();
    let kernel = Kernel::ard(1.0, Shape::Matern52, &[0.3, 0.4, 0.5]);
    let Ok(mut evaluator) = DenseEvaluator::new(&x, 3, &y, 3) else {
        eprintln!("skipped: not enough memory");
        return;
    };
    let mut group = c.benchmark_group("dense_4096");
    group.sample_size(10);
    group.bench_function("assembly", |b| {
        b.iter(|| evaluator.covariance(black_box(&kernel), 1e-3).map(|k| k[N]));
    });
    group.bench_function("log_marginal_likelihood", |b| {
        b.iter(|| evaluator.evaluate(black_box(&kernel), 1e-3));
    });
    group.bench_function("log_marginal_likelihood_and_gradient", |b| {
        b.iter(|| evaluator.evaluate_with_gradient(black_box(&kernel), 1e-3));
    });
    group.finish();
}

criterion_group!(benches, dense);
criterion_main!(benches);
