use super::conditional::{Basis, Process};
use super::fit::{Data, Search, State};
use super::neighbours::Embedded;
use super::vecchia::{Targets, log_likelihood};
use super::*;
use crate::base::random::SplitMix64;
use crate::base::watch::{Observer, Watch};
use crate::gp::problem::{Outliers, Problem};
use crate::gp::report::{FitReport, Noise};
use crate::gp::{DenseEvaluator, DenseGp, OptimizeOptions};
use crate::kernel::{AxisMetric, Shape, test_kernels};
use crate::sample::space::InputSpace;

const CHANNELS: usize = 3;

/// Pseudo-random points, and targets of a smooth function with noise of standard deviation `noise`.
fn data(n: usize, noise: f64) -> (Vec<[f64; 3]>, Vec<Vec<f64>>) {
    let mut random = SplitMix64::new(11);
    let points: Vec<[f64; 3]> = (0..n).map(|_| std::array::from_fn(|_| random.next_unit())).collect();
    let mut normal = || (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
    let targets = (0..CHANNELS).map(|c| {
        let f = |p: &[f64; 3]| (3.0 * p[0] + c as f64).sin() + 0.5 * (2.0 * p[1]).cos() - 0.3 * p[2] * p[2];
        points.iter().map(|p| f(p) + noise * normal()).collect()
    });
    let targets = targets.collect();
    (points, targets)
}

const LENGTHS: [f64; 3] = [0.7, 0.9, 1.3];

fn kernel() -> Kernel {
    Kernel::ard(1.1, Shape::Matern52, &LENGTHS)
}

/// A search in the unit cube, which the prior's length scales do not fit too badly.
fn with_problem<R>(targets: &[Vec<f64>], outliers: Outliers, run: impl FnOnce(&Problem<'_>) -> R) -> R {
    let (observer, optimize) = (Observer::default(), OptimizeOptions::default());
    let watch = Watch::new(&observer);
    run(&Problem {
        angles: &[],
        lattice: None,
        targets: targets.to_vec(),
        space: Some(InputSpace::PolarAngles),
        kernel: &[vec![Shape::Matern52], vec![Shape::Matern52], vec![Shape::Matern52]],
        noise: Noise::Optimized,
        known_noise: &[],
        priors: true,
        usual_variance: None,
        prior: None,
        basis: None,
        factorises: false,
        outliers,
        optimize: &optimize,
        watch: &watch,
    })
}

fn rows(targets: &[Vec<f64>]) -> Vec<f64> {
    (0..targets[0].len()).flat_map(|i| targets.iter().map(move |t| t[i])).collect()
}

#[test]
fn with_all_earlier_samples_the_likelihood_is_the_exact_one() {
    let (points, y) = data(40, 0.1);
    let x = points.as_flattened();
    for kernel in test_kernels() {
        let all = Embedded::new(x, &kernel).nearest_before(40, &Watch::default()).unwrap();
        let subset: Vec<u32> = (0..40).collect();
        let at = |kernel: &Kernel, noise: f64| {
            let noise = vec![noise; 40];
            let process = Process { kernel, x, noise: &noise, basis: &Basis::default(), basis_variance: 0.0 };
            log_likelihood(&process, &Targets { y: &y, shared_noise: &noise }, &all, &subset)
        };
        let (value, gradient) = at(&kernel, 0.02);
        let mut exact = DenseEvaluator::new(x, 3, &rows(&y), CHANNELS).unwrap();
        let expected = exact.evaluate_with_gradient(&kernel, 0.02).unwrap();
        let scale = expected.log_marginal_likelihood.abs();
        let name = kernel.name();
        assert!((value - expected.log_marginal_likelihood).abs() < 1e-6 * scale, "{name}");
        assert_eq!(gradient.len(), expected.gradient.len());
        for (g, e) in gradient.iter().zip(&expected.gradient) {
            assert!((g - e).abs() < 1e-5 * (1.0 + e.abs()), "{name}: {gradient:?} {:?}", expected.gradient);
        }
    }
}

#[test]
fn gradients_match_finite_differences_where_neighbours_are_few() {
    let (points, y) = data(80, 0.1);
    let x = points.as_flattened();
    let noise_of = |log: f64| -> (Vec<f64>, Vec<f64>) {
        // Weights and known noise make the noise of each sample its own.
        let shared: Vec<f64> = (0..80).map(|i| log.exp() * (1.0 + 0.1 * f64::from(i))).collect();
        let all = shared.iter().enumerate().map(|(i, s)| s + 1e-3 * (i % 3) as f64).collect();
        (shared, all)
    };
    for kernel in [kernel(), Kernel::ard(0.5, Shape::RationalQuadratic { alpha: 0.7 }, &[0.3, 0.5, 0.8])] {
        let neighbours = Embedded::new(x, &kernel).nearest_before(7, &Watch::default()).unwrap();
        let subset: Vec<u32> = (0..80).step_by(3).collect();
        let start: Vec<f64> = kernel.log_parameters().into_iter().chain([0.03f64.ln()]).collect();
        let at = |p: &[f64]| {
            let mut kernel = kernel.clone();
            kernel.set_log_parameters(&p[..p.len() - 1]).unwrap();
            let (shared, all) = noise_of(p[p.len() - 1]);
            let process =
                Process { kernel: &kernel, x, noise: &all, basis: &Basis::default(), basis_variance: 0.0 };
            log_likelihood(&process, &Targets { y: &y, shared_noise: &shared }, &neighbours, &subset)
        };
        let (_, gradient) = at(&start);
        for k in 0..start.len() {
            let shifted = |by: f64| {
                let mut p = start.clone();
                p[k] += by;
                at(&p).0
            };
            let slope = (shifted(1e-5) - shifted(-1e-5)) / 2e-5;
            assert!((gradient[k] - slope).abs() < 1e-5 * (1.0 + slope.abs()), "{k}: {} {slope}", gradient[k]);
        }
    }
}

/// 4,096 directions of a glossy material, with and without noise, beside the dense process with the
/// hyper-parameters that the search finds.
#[test]
fn four_thousand_samples_agree_with_the_dense_process() {
    let material = crate::brdf::material("blue-metallic-paint").unwrap();
    let mut random = SplitMix64::new(5);
    let mut normal = move || (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
    let space = InputSpace::PolarAngles;
    for noise in [0.03, 0.0] {
        let set = crate::SampleSet::measure(material, &crate::Layout::Random { count: 4096, seed: 3 });
        let set = set.unwrap();
        let points: Vec<[f64; 3]> = set.angles.iter().map(|&a| space.coordinates(a)).collect();
        let y: Vec<Vec<f64>> = (0..CHANNELS)
            .map(|c| {
                let y: Vec<f64> = set.values.iter().map(|v| (v[c] + 1e-3).ln() + noise * normal()).collect();
                let mean = y.iter().sum::<f64>() / y.len() as f64;
                y.into_iter().map(|y| y - mean).collect()
            })
            .collect();
        let (gp, value) = with_problem(&y, Outliers::Keep, |problem| {
            let data = Data::new(&points, &y, &[], None);
            let search = Search::begin(problem, InputSpace::PolarAngles, data).unwrap();
            let (data, state, _) = search.finish().unwrap();
            state.condition(problem.watch, &data).unwrap()
        });
        let (kernel, own) = (gp.kernel.clone(), gp.noise_variance);
        let dense = DenseGp::fit_at(points.as_flattened(), &rows(&y), CHANNELS, kernel, own).unwrap();
        let exact = dense.log_marginal_likelihood().unwrap();
        assert!((value - exact).abs() < 5e-3 * exact.abs(), "{noise}: {value} {exact}");
        let at = crate::sample::random_directions(200, 0.97, 9);
        let test: Vec<f64> = at.iter().flat_map(|&a| space.coordinates(a)).collect();
        let (mean, expected) = (gp.mean_at(&test), dense.predict_mean(&test).unwrap());
        let (variance, exact) =
            (gp.variance_at(&test, &[]).unwrap(), dense.predict_variance_latent(&test).unwrap());
        let mut square = 0.0;
        for ((mean, expected), exact) in mean.chunks(CHANNELS).zip(expected.chunks(CHANNELS)).zip(&exact) {
            square += mean.iter().zip(expected).map(|(m, e)| (m - e).powi(2) / exact).sum::<f64>();
        }
        let error = (square / mean.len() as f64).sqrt();
        assert!(error < 0.05, "{noise}: {error}");
        let ratios: Vec<f64> = variance.iter().zip(&exact).map(|(v, e)| (v / e).sqrt()).collect();
        let mean_ratio = ratios.iter().sum::<f64>() / ratios.len() as f64;
        assert!((0.95..1.2).contains(&mean_ratio), "{noise}: {mean_ratio}");
        assert!(ratios.iter().all(|r| (0.6..2.5).contains(r)), "{noise}: {ratios:?}");
    }
}

#[test]
fn few_samples_are_left_out_exactly() {
    let (points, y) = data(NEAREST, 0.1);
    let dense =
        DenseGp::fit_at(points.as_flattened(), &rows(&y), CHANNELS, kernel(), 0.01).unwrap().leave_one_out();
    let dense = dense.unwrap();
    let mut report = FitReport::default();
    let data = Data::new(&points, &y, &[], None);
    State::known(kernel(), 0.01, 0.0, &data)
        .report_samples(&data, Widening::default(), &Watch::default(), &mut report)
        .unwrap();
    let found = report.leave_one_out.unwrap();
    for (a, b) in found.residuals.iter().zip(&dense.residuals) {
        assert!((a - b).abs() < 1e-7, "{a} {b}");
    }
    for (a, b) in found.variances.iter().zip(&dense.variances) {
        assert!((a - b).abs() < 1e-8, "{a} {b}");
    }
    assert!((found.log_predictive_density - dense.log_predictive_density).abs() < 1e-4);
}

#[test]
fn known_noise_counts_for_its_sample_only() {
    let (points, y) = data(30, 0.0);
    let mut known = vec![0.0; 30];
    known[7] = 1e6;
    let mean_at = |points: &[[f64; 3]], y: &[Vec<f64>], known: &[f64]| {
        with_problem(y, Outliers::Keep, |problem| {
            let data = Data::new(points, y, known, None);
            let state = State::known(kernel(), 1e-4, 0.0, &data);
            state.condition(problem.watch, &data).unwrap().0.mean_at(&[0.3, 0.4, 0.5])
        })
    };
    let without =
        |v: &[f64]| -> Vec<f64> { v.iter().enumerate().filter(|(i, _)| *i != 7).map(|p| *p.1).collect() };
    let fewer: Vec<[f64; 3]> = points.iter().enumerate().filter(|(i, _)| *i != 7).map(|p| *p.1).collect();
    let left: Vec<Vec<f64>> = y.iter().map(|y| without(y)).collect();
    let (ignored, absent) = (mean_at(&points, &y, &known), mean_at(&fewer, &left, &[]));
    for (a, b) in ignored.iter().zip(absent) {
        assert!((a - b).abs() < 1e-3, "{a} {b}");
    }
}

#[test]
fn outliers_are_found_and_nothing_else() {
    let (points, mut y) = data(600, 0.03);
    let planted = [5, 77, 301, 444];
    for (k, &i) in planted.iter().enumerate() {
        let by = if k % 2 == 0 { 2.3 } else { -2.3 };
        y.iter_mut().for_each(|y| y[i] += by);
    }
    let fit = |outliers| {
        with_problem(&y, outliers, |problem| {
            let data = Data::new(&points, &y, &[], None);
            let search = Search::begin(problem, InputSpace::PolarAngles, data).unwrap();
            let (data, state, mut report) = search.finish().unwrap();
            state.report_samples(&data, Widening::default(), &Watch::default(), &mut report).unwrap();
            let (gp, _) = state.condition(problem.watch, &data).unwrap();
            (gp.noise_variance.sqrt(), report)
        })
    };
    let (noise, report) = fit(Outliers::Downweight);
    assert!((noise / 0.03 - 1.0).abs() < 0.2, "{noise}");
    let found: Vec<usize> = (0..600).filter(|&i| report.weights[i] < 1.0).collect();
    assert_eq!(found, planted);
    let left_out = report.leave_one_out.unwrap();
    assert!((left_out.residuals[3 * 77] + 2.3).abs() < 0.2, "{}", left_out.residuals[3 * 77]);
    let (noise, report) = fit(Outliers::Keep);
    assert!(noise > 0.1 && report.weights.is_empty(), "{noise}");
}

/// Ripples of a smooth function, half as high as its noise is wide: they are not taken for noise, though a search that
/// begins with smooth functions would end there.
#[test]
fn ripples_under_noise_are_found() {
    let (points, mut y) = data(3000, 0.2);
    for y in &mut y {
        let ripple = |p: &[f64; 3]| 0.3 * (40.0 * p[0]).sin() * (40.0 * p[1]).cos();
        y.iter_mut().zip(&points).for_each(|(y, p)| *y += ripple(p));
    }
    let (kernel, noise) = with_problem(&y, Outliers::Keep, |problem| {
        let data = Data::new(&points, &y, &[], None);
        let search = Search::begin(problem, InputSpace::PolarAngles, data).unwrap();
        let (_, state, _) = search.finish().unwrap();
        (state.kernel, state.noise_variance.sqrt())
    });
    assert!((noise / 0.2 - 1.0).abs() < 0.1, "{noise} {kernel:?}");
}

#[test]
fn the_order_of_samples_changes_no_bit() {
    let (points, y) = data(500, 0.05);
    let fit = |points: &[[f64; 3]], y: &[Vec<f64>]| {
        with_problem(y, Outliers::Downweight, |problem| {
            let data = Data::new(points, y, &[], None);
            let search = Search::begin(problem, InputSpace::PolarAngles, data).unwrap();
            let (data, state, _) = search.finish().unwrap();
            let (gp, value) = state.condition(problem.watch, &data).unwrap();
            (gp.mean_at(&[0.1, 0.2, 0.3]), value, gp.kernel)
        })
    };
    let turned: Vec<[f64; 3]> = points.iter().rev().copied().collect();
    let back: Vec<Vec<f64>> = y.iter().map(|y| y.iter().rev().copied().collect()).collect();
    assert_eq!(fit(&points, &y), fit(&turned, &back));
}

#[test]
fn angles_are_chords_and_broken_parts_are_refused() {
    let kernel =
        Kernel { metric: vec![AxisMetric::Linear, AxisMetric::Linear, AxisMetric::Chord], ..kernel() };
    let make = |noise: Vec<f64>, weights: usize| {
        ScatteredGp::new(
            kernel.clone(),
            0.1,
            noise,
            vec![0.5; 6],
            (Basis::default(), 0.0),
            1,
            vec![1.0; weights],
        )
    };
    assert!(make(vec![0.1; 2], 2).is_ok());
    assert!(make(vec![0.1; 2], 3).is_err() && make(vec![-0.1; 2], 2).is_err() && make(vec![], 0).is_err());
}

#[test]
fn regions_that_are_left_out_leave_what_a_fit_without_them_predicts() {
    let (points, y) = data(60, 0.1);
    let (x, kernel) = (points.as_flattened(), kernel());
    let noise = vec![0.02; 60];
    let process =
        Process { kernel: &kernel, x, noise: &noise, basis: &Basis::default(), basis_variance: 0.0 };
    let embedded = Embedded::new(x, &kernel);
    for (centre, radius) in [(3, 0.0), (17, 0.4), (40, 0.8)] {
        let mut outside = embedded.nearest_outside(centre, radius, 60);
        outside.sort_unstable();
        let scaled = |i: usize| LENGTHS.iter().zip(points[i]).map(|(length, x)| x / length);
        let distance = |i: usize| scaled(i).zip(scaled(centre)).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let expected = (0..60).filter(|&i| i != centre && (radius == 0.0 || distance(i).sqrt() > radius));
        assert!(outside.iter().map(|&i| i as usize).eq(expected), "{radius}: {outside:?}");
        assert!((radius > 0.0) == (outside.len() < 59), "{radius}: {}", outside.len());
        // Another solver, which sees only what is outside.
        let of = |i: u32| points[i as usize];
        let known: Vec<f64> = outside.iter().flat_map(|&i| of(i)).collect();
        let targets: Vec<f64> = outside.iter().flat_map(|&i| y.iter().map(move |y| y[i as usize])).collect();
        let dense = DenseGp::fit_at(&known, &targets, CHANNELS, kernel.clone(), 0.02).unwrap();
        let mean = dense.predict_mean(&points[centre]).unwrap();
        let variance = dense.predict_variance_latent(&points[centre]).unwrap()[0];
        let mut scratch = Scratch::new(&kernel);
        let (b, latent) = scratch.condition(&process, centre, &outside);
        let near: f64 = b.iter().zip(&outside).map(|(b, &j)| b * y[0][j as usize]).sum();
        assert!((latent - variance).abs() < 1e-8 && (near - mean[0]).abs() < 1e-8);
    }
}

/// A function with steep bumps in a grid, all but one of them sampled.
#[test]
fn an_interval_where_no_sample_is_near_expects_what_happens_elsewhere() {
    let mut random = SplitMix64::new(4);
    let bump = |p: &[f64; 3]| -> f64 {
        let to = |k: usize| (4.0 * p[k]).fract() - 0.5;
        (-(to(0) * to(0) + to(1) * to(1)) / 0.05).exp()
    };
    let hole = [0.375, 0.375, 0.5];
    let is_near = |p: &[f64; 3]| (p[0] - hole[0]).hypot(p[1] - hole[1]) < 0.09;
    let points: Vec<[f64; 3]> = (0..1200)
        .map(|_| [random.next_unit(), random.next_unit(), random.next_unit()])
        .filter(|p| !is_near(p))
        .collect();
    let y = vec![points.iter().map(|p| bump(p) + 1e-3 * random.next_normal()).collect::<Vec<f64>>()];
    let kernel = Kernel::ard(0.2, Shape::Matern52, &[0.35, 0.35, 3.0]);
    let data = Data::new(&points, &y, &[], None);
    let state = State::known(kernel, 1e-6, 0.0, &data);
    let widening = state.widening(&data, InputSpace::PolarAngles, &Watch::default()).unwrap();
    let (gp, _) = state.condition(&Watch::default(), &data).unwrap();
    let error = (gp.mean_at(&hole)[0] - bump(&hole)).abs();
    let sure = gp.variance_at(&hole, &[]).unwrap()[0].sqrt();
    let widened = gp.widened(widening).unwrap().variance_at(&hole, &[]).unwrap()[0].sqrt();
    // The top of a bump is the worst place for a hole, and most regions that are left out have none in their middle.
    assert!(error > 20.0 * sure, "{error} {sure}");
    assert!(error < 6.0 * widened && widened < error, "{error} {sure} {widened}");
}
