//! Benchmark of a material on one core: evaluation at random pairs of directions, sampling, density, and beside them a
//! reader that takes the nearest cell of the table, in double precision, as the first programs for MERL tables do, and
//! what reading the cells about each pair costs when their places are known.
#![allow(missing_docs, reason = "criterion's macros make public items")]

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gpbrdf_core::base::SplitMix64;
use gpbrdf_core::brdf::{Reciprocal, cell_index, material};
use gpbrdf_core::{Brdf, BrdfTable, HalfDiff, Material, MaterialOptions};

/// Pairs of directions of one measurement: their cells do not fit the smaller caches.
const PAIRS: usize = 1 << 16;

/// The nearest cell: `theta_h = acos h_z`, `theta_d = acos d_z` and `phi_d = atan2(d_y, d_x)`, where `d` is `wi`
/// turned by `Ry(-theta_h) Rz(-phi_h)`, and truncated indices (W. Matusik et al., "A Data-Driven Reflectance Model",
/// 2003; angles of S. Rusinkiewicz, 1998).
fn nearest_cell(table: &BrdfTable, wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
    let (wi, wo) = (wi.map(f64::from), wo.map(f64::from));
    let sum: [f64; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
    let length = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt();
    let h = sum.map(|x| x / length);
    let (theta_h, phi_h) = (h[2].min(1.0).acos(), h[1].atan2(h[0]));
    let (sin_p, cos_p) = (-phi_h).sin_cos();
    let turned = [cos_p * wi[0] - sin_p * wi[1], sin_p * wi[0] + cos_p * wi[1], wi[2]];
    let (sin_t, cos_t) = (-theta_h).sin_cos();
    let d = [cos_t * turned[0] + sin_t * turned[2], turned[1], cos_t * turned[2] - sin_t * turned[0]];
    let (theta_d, phi_d) = (d[2].clamp(-1.0, 1.0).acos(), d[1].atan2(d[0]));
    let phi_d = if phi_d < 0.0 { phi_d + PI } else { phi_d };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "fractions are not negative")]
    let index = |t: f64, n: usize| ((t * n as f64) as usize).min(n - 1);
    table.values()[cell_index(
        index((theta_h / FRAC_PI_2).max(0.0).sqrt(), 90),
        index(theta_d / FRAC_PI_2, 90),
        index(phi_d / PI, 180),
    )]
}

/// Numbers between neighbours along `theta_d` and along `theta_h`.
const STRIDES: [usize; 2] = [3 * 180, 3 * 180 * 90];

/// Where the first of the eight cells about a pair begins in the table.
fn first_cell(wi: [f32; 3], wo: [f32; 3]) -> usize {
    let wide = |w: [f32; 3]| gpbrdf_core::nalgebra::Vector3::from(w.map(f64::from));
    let angles = HalfDiff::from_directions(&wide(wi), &wide(wo));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "fractions are not negative")]
    let index = |t: f64, n: usize, last: usize| ((t * n as f64 - 0.5).max(0.0) as usize).min(last);
    let h = index((angles.theta_h / FRAC_PI_2).sqrt(), 90, 88);
    3 * cell_index(h, index(angles.theta_d / FRAC_PI_2, 90, 88), index(angles.phi_d / PI, 180, 177))
}

/// The sum of the eight cells, a channel at a time.
fn sum_of_cells(values: &[f32], first: usize) -> [f32; 3] {
    let [d, h] = STRIDES;
    let near = &values[first..first + d + h + 8];
    let sums: [f32; 8] = std::array::from_fn(|i| (near[i] + near[d + i]) + (near[h + i] + near[h + d + i]));
    std::array::from_fn(|c| sums[c] + sums[c + 3])
}

#[expect(clippy::cast_possible_truncation, reason = "materials are in single precision")]
fn hemisphere(random: &mut SplitMix64) -> [f32; 3] {
    let (z, phi) = (random.next_unit(), TAU * random.next_unit());
    let r = (1.0 - z * z).sqrt();
    [(r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32]
}

fn bench(c: &mut Criterion) {
    let Ok(built_in) = material("cherry-235") else { return };
    let brdf = Reciprocal { inner: built_in.brdf, min_cosine: 1e-3 };
    let table = BrdfTable::from_fn(|angles| brdf.eval_half_diff(angles));
    let Ok(material) = Material::new(table, &MaterialOptions::default()) else { return };
    let mut random = SplitMix64::new(1);
    let wi: Vec<_> = (0..PAIRS).map(|_| hemisphere(&mut random)).collect();
    let wo: Vec<_> = (0..PAIRS).map(|_| hemisphere(&mut random)).collect();
    #[expect(clippy::cast_possible_truncation, reason = "materials are in single precision")]
    let u: Vec<[f32; 2]> =
        (0..PAIRS).map(|_| [random.next_unit() as f32, random.next_unit() as f32]).collect();
    let mut group = c.benchmark_group("material");
    group.sample_size(30).throughput(Throughput::Elements(PAIRS as u64));
    let mut values = vec![[0.0; 3]; PAIRS];
    group.bench_function("eval_many", |b| b.iter(|| material.eval_many(black_box(&wi), &wo, &mut values)));
    group.bench_function("eval", |b| {
        b.iter(|| {
            for ((out, &wi), &wo) in values.iter_mut().zip(black_box(&wi)).zip(&wo) {
                *out = material.eval(wi, wo);
            }
        });
    });
    group.bench_function("nearest_cell_in_f64", |b| {
        b.iter(|| {
            for ((out, &wi), &wo) in values.iter_mut().zip(black_box(&wi)).zip(&wo) {
                *out = nearest_cell(material.table(), wi, wo);
            }
        });
    });
    let first: Vec<_> = wi.iter().zip(&wo).map(|(&wi, &wo)| first_cell(wi, wo)).collect();
    let table = material.table().values().as_flattened();
    group.bench_function("reading_alone", |b| {
        b.iter(|| {
            for (out, &first) in values.iter_mut().zip(black_box(&first)) {
                *out = sum_of_cells(table, first);
            }
        });
    });
    let mut densities = vec![0.0; PAIRS];
    group.bench_function("pdf_many", |b| b.iter(|| material.pdf_many(black_box(&wi), &wo, &mut densities)));
    let mut drawn = vec![None; PAIRS];
    group.bench_function("sample_many", |b| b.iter(|| material.sample_many(black_box(&wo), &u, &mut drawn)));
    group.bench_function("sample", |b| {
        b.iter(|| {
            for ((out, &wo), &[u1, u2]) in drawn.iter_mut().zip(black_box(&wo)).zip(&u) {
                *out = material.sample(wo, u1, u2);
            }
        });
    });
    group.finish();
    let mut group = c.benchmark_group("material_new");
    group.sample_size(10);
    group.bench_function("new", |b| {
        b.iter(|| Material::new(black_box(material.table().clone()), &MaterialOptions::default()));
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
