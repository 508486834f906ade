//! What holds for every model, with random samples, kernels and directions.
#![cfg(all(feature = "fit", feature = "formats"))]
#![allow(clippy::unwrap_used, reason = "tests state exact expectations")]

use std::f64::consts::{PI, TAU};

use gpbrdf_core::brdf::BoxPoint;
use gpbrdf_core::kernel::{AxisMetric, Kernel, Kernel1d};
use gpbrdf_core::model::Conditioned;
use gpbrdf_core::nalgebra::{DMatrix, Vector3};
use gpbrdf_core::{
    FitOptions, HalfDiff, Hyper, IntervalOf, LatticeLayout, Layout, Model, Rgb, SampleSet, Shape, Solver,
    Source, Symmetry, condition, fit,
};
use proptest::prelude::*;

/// The metrics along the axes of the warped box.
const AXES: [AxisMetric; 3] = [AxisMetric::Linear, AxisMetric::Linear, AxisMetric::Chord];

fn shape() -> impl Strategy<Value = Shape> {
    prop_oneof![
        Just(Shape::SquaredExponential),
        (0.1..10.0f64).prop_map(|alpha| Shape::RationalQuadratic { alpha }),
        Just(Shape::Matern12),
        Just(Shape::Matern32),
        Just(Shape::Matern52),
        (0.3..4.0f64).prop_map(|nu| Shape::Matern { nu }),
    ]
}

fn symmetry() -> impl Strategy<Value = Symmetry> {
    prop_oneof![Just(Symmetry::Bilateral), Just(Symmetry::Reciprocal)]
}

/// Angles of directions above the horizon.
fn angles() -> impl Strategy<Value = HalfDiff> {
    (0.0..1.0f64, 0.0..0.99f64, 0.0..PI).prop_map(|(u, v, phi)| BoxPoint { u, v, phi }.to_half_diff())
}

fn direction() -> impl Strategy<Value = Vector3<f64>> {
    (0.05..1.0f64, 0.0..TAU).prop_map(|(z, phi)| {
        let r = (1.0 - z * z).sqrt();
        Vector3::new(r * phi.cos(), r * phi.sin(), z)
    })
}

/// Samples of a built-in material in random directions.
fn scattered(count: usize, seed: u64) -> SampleSet {
    Source::built_in("red-plastic").unwrap().measure(&Layout::Random { count, seed }).unwrap()
}

fn dense_hyper(shape: Shape, variance: f64, length: f64) -> Hyper {
    let kernel = Kernel::ard(variance, shape, &[length, 1.3 * length, 2.0 * length]);
    Hyper::new(Solver::Dense, kernel, 1e-3 * variance, None)
}

fn lattice_hyper(shape: Shape, variance: f64, length: f64) -> Hyper {
    let axes = AXES.map(|metric| (Kernel1d::new(shape, length), metric));
    let kernel = Kernel::product(variance, axes.to_vec());
    Hyper::new(Solver::Lattice, kernel, 1e-3 * variance, None)
}

/// A model on a small lattice and one of scattered samples, each with its largest prior variance.
fn models(shape: Shape, variance: f64, length: f64, symmetry: Symmetry, seed: u64) -> [(Model, f64); 2] {
    let source = Source::built_in("red-plastic").unwrap();
    let lattice = LatticeLayout { shape: [6, 5, 4], symmetry, ..LatticeLayout::default() };
    let on_lattice = source.measure(&Layout::Lattice(lattice)).unwrap();
    let hyper = lattice_hyper(shape, variance, length);
    let lattice_model = condition(&on_lattice, &FitOptions::default(), &hyper).unwrap().model;
    let space = LatticeLayout { symmetry, ..LatticeLayout::default() }.space().into();
    let options = FitOptions { space: Some(space), ..FitOptions::default() };
    let hyper = dense_hyper(shape, variance, length);
    let dense_model = condition(&scattered(30, seed), &options, &hyper).unwrap().model;
    // Where phi is mirrored, k(x, x) is up to twice the variance.
    let mirrored = if symmetry == Symmetry::Bilateral { 2.0 } else { 1.0 };
    [(lattice_model, mirrored * variance), (dense_model, variance)]
}

/// Whether two values are the same but for rounding.
fn alike(a: &Rgb, b: &Rgb) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6 * (1e-3 + a.abs()))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_order_of_samples_changes_nothing(
        seed in 0..1000u64,
        shape in shape(),
        order in Just((0..40).collect::<Vec<usize>>()).prop_shuffle(),
        at in prop::collection::vec(angles(), 8),
    ) {
        let samples = scattered(40, seed);
        let all: Vec<_> = samples.iter().collect();
        let shuffled: SampleSet = order.iter().map(|&i| all[i]).collect();
        let predict = |samples: &SampleSet| {
            let hyper = dense_hyper(shape, 2.0, 0.4);
            let Conditioned { model, log_marginal_likelihood } =
                condition(samples, &FitOptions::default(), &hyper).unwrap();
            (model.predict(&at, IntervalOf::Latent).unwrap(), log_marginal_likelihood)
        };
        let ((a, value_a), (b, value_b)) = (predict(&samples), predict(&shuffled));
        prop_assert!((value_a - value_b).abs() < 1e-7 * (1.0 + value_a.abs()), "{value_a} {value_b}");
        for (a, b) in a.iter().zip(&b) {
            prop_assert!(alike(&a.mean, &b.mean), "{a:?} {b:?}");
            prop_assert!(alike(&a.lower, &b.lower) && alike(&a.upper, &b.upper), "{a:?} {b:?}");
        }
    }

    #[test]
    fn variance_is_never_above_the_prior_nor_below_zero(
        seed in 0..1000u64,
        shape in shape(),
        variance in 0.1..10.0f64,
        length in 0.1..2.0f64,
        symmetry in symmetry(),
        at in prop::collection::vec(angles(), 20),
    ) {
        for (model, prior) in models(shape, variance, length, symmetry, seed) {
            let latent = model.predict_variance(&at, IntervalOf::Latent).unwrap();
            let observed = model.predict_variance(&at, IntervalOf::Observation).unwrap();
            let noise = model.noise_variances();
            for (latent, observed) in latent.iter().zip(&observed) {
                for c in 0..3 {
                    let range = 0.0..=prior * (1.0 + 1e-9);
                    prop_assert!(range.contains(&latent[c]), "{} {latent:?} {prior}", model.solver());
                    prop_assert!((observed[c] - latent[c] - noise[c]).abs() < 1e-12 * prior);
                }
            }
        }
    }

    #[test]
    fn predictions_are_reciprocal_and_those_of_bilateral_models_mirrored(
        seed in 0..1000u64,
        shape in shape(),
        symmetry in symmetry(),
        (wi, wo) in (direction(), direction()),
        at in angles(),
    ) {
        for (model, _) in models(shape, 1.0, 0.5, symmetry, seed) {
            // Swapping the directions turns phi_d by pi; the angles are the same but for rounding.
            let mut pairs = vec![[HalfDiff::from_directions(&wi, &wo), HalfDiff::from_directions(&wo, &wi)]];
            if symmetry == Symmetry::Bilateral {
                pairs.push([at, HalfDiff { phi_d: PI - at.phi_d, ..at }]);
            }
            for pair in pairs {
                let found = model.predict_mean(&pair);
                prop_assert!(alike(&found[0], &found[1]), "{} {pair:?} {found:?}", model.solver());
            }
        }
    }

    #[test]
    fn kernels_are_positive_definite(
        shapes in prop::array::uniform3(shape()),
        length in 0.05..3.0f64,
        points in prop::collection::vec(prop::array::uniform3(0.0..3.0f64), 25),
        product in any::<bool>(),
    ) {
        let kernel = if product {
            let axes = shapes.into_iter().zip(AXES).map(|(shape, metric)| (Kernel1d::new(shape, length), metric));
            Kernel::product(1.7, axes.collect())
        } else {
            Kernel::ard(1.7, shapes[0], &[length, 2.0 * length, 0.5 * length])
        };
        let n = points.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| kernel.value(&points[i], &points[j]));
        let gap = (&covariance - covariance.transpose()).amax();
        prop_assert!(gap < 1e-14, "{gap}");
        let smallest = covariance.symmetric_eigenvalues().min();
        prop_assert!(smallest > -1e-10 * n as f64, "{kernel:?} {smallest}");
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let source = Source::built_in("red-plastic").unwrap();
            let lattice = LatticeLayout { shape: [9, 7, 6], ..LatticeLayout::default() };
            [Layout::Lattice(lattice), Layout::Random { count: 60, seed: 3 }].map(|layout| {
                let samples = source.measure(&layout).unwrap();
                let model = fit(&samples, &FitOptions::default()).unwrap().model;
                let at = scattered(300, 8).angles;
                (model.to_bytes().unwrap(), model.predict(&at, IntervalOf::Observation).unwrap())
            })
        })
    };
    let one = run(1);
    assert!(one == run(2) && one == run(5));
}
