//! Tests of the dense Gaussian process against hand computation, reference values of scikit-learn, and its
//! definition.

use serde_json::Value;

use super::*;
use crate::kernel::Shape;
use crate::test_data::data_dir;

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * b.abs().max(1e-3)
}

fn samples(n: usize, channels: usize) -> (Vec<f64>, Vec<f64>) {
    let x: Vec<f64> =
        (0..3 * n).map(|i| (0.618_033_988_749_895 * (i * i + 3 * i) as f64).fract() * 1.5).collect();
    let y = x.chunks(3).flat_map(|p| (0..channels).map(move |c| (3.0 * p[0] + c as f64).sin() * p[1] + p[2]));
    let y = y.collect();
    (x, y)
}

fn numbers(value: &Value) -> Vec<f64> {
    match value.as_array() {
        Some(rows) => rows.iter().flat_map(numbers).collect(),
        None if value.is_null() => Vec::new(),
        None => vec![value.as_f64().unwrap()],
    }
}

#[test]
fn reference_cases_of_scikit_learn() {
    let Some(dir) = data_dir() else { return };
    let text = std::fs::read_to_string(dir.join("gp/reference.json")).unwrap();
    let reference: Value = serde_json::from_str(&text).unwrap();
    let (x, y, x_test) =
        (numbers(&reference["x_train"]), numbers(&reference["y_train"]), numbers(&reference["x_test"]));
    let length_scale = [0.6, 0.9, 1.7];
    let mut with_gradient = 0;
    for case in reference["cases"].as_array().unwrap() {
        let name = case["kernel"].as_str().unwrap();
        let shape = match name {
            "squared_exponential" => Shape::SquaredExponential,
            "matern_1_2" => Shape::Matern12,
            "matern_3_2" => Shape::Matern32,
            "matern_5_2" => Shape::Matern52,
            "matern_general_nu_1.3" => Shape::Matern { nu: 1.3 },
            "rational_quadratic_ard" => Shape::RationalQuadratic { alpha: 0.8 },
            _ if name.starts_with("sum: 0.7*matern_3_2") => Shape::Matern32,
            _ => panic!("unknown case {name}"),
        };
        let mut kernel = Kernel::ard(1.3, shape, &length_scale);
        if name.starts_with("sum") {
            kernel = Kernel::ard(0.7, shape, &length_scale);
            kernel.terms.extend(Kernel::ard(0.5, Shape::SquaredExponential, &[0.4, 0.5, 0.6]).terms);
        }
        let tolerance = if name.contains("general") { 1e-6 } else { 1e-8 };
        let gp = DenseGp::fit_at(&x, &y, 1, kernel.clone(), 0.02).unwrap();
        assert_eq!(gp.jitter(), 0.0);
        let lml = case["log_marginal_likelihood"].as_f64().unwrap();
        assert!(
            close(gp.log_marginal_likelihood().unwrap(), lml, tolerance),
            "{name}: {}",
            gp.log_marginal_likelihood().unwrap()
        );
        let mean = gp.predict_mean(&x_test).unwrap();
        let variance = gp.predict_variance_latent(&x_test).unwrap();
        for (ours, key) in [(mean, "mean"), (variance, "variance_latent")] {
            let theirs = numbers(&case[key]);
            assert_eq!(ours.len(), theirs.len());
            for (a, b) in ours.iter().zip(&theirs) {
                assert!(close(*a, *b, tolerance), "{name} {key}: {a} {b}");
            }
        }
        let gradient = numbers(&case["gradient_theta_log"]);
        with_gradient += usize::from(!gradient.is_empty());
        #[cfg(feature = "fit")]
        {
            let mut evaluator = DenseEvaluator::new(&x, 3, &y, 1).unwrap();
            let likelihood = evaluator.evaluate_with_gradient(&kernel, 0.02).unwrap();
            assert!(close(likelihood.log_marginal_likelihood, lml, tolerance), "{name}");
            assert!(gradient.is_empty() || likelihood.gradient.len() == gradient.len());
            for (a, b) in likelihood.gradient.iter().zip(&gradient) {
                assert!(close(*a, *b, tolerance), "{name} gradient: {a} {b}");
            }
        }
    }
    assert_eq!(with_gradient, 4);
}

#[test]
fn posterior_of_one_and_two_points_by_hand() {
    // One sample: mean k y / (v + s), variance v - k^2 / (v + s).
    let kernel = Kernel::ard(2.0, Shape::Matern12, &[0.5]);
    let gp = DenseGp::fit_at(&[1.0], &[3.0, -1.0], 2, kernel.clone(), 0.5).unwrap();
    let k = 2.0 * (-0.4f64).exp();
    let mean = gp.predict_mean(&[1.2]).unwrap();
    assert!(close(mean[0], k * 3.0 / 2.5, 1e-14) && close(mean[1], -k / 2.5, 1e-14));
    assert!(close(gp.predict_variance_latent(&[1.2]).unwrap()[0], 2.0 - k * k / 2.5, 1e-14));
    assert!(close(gp.predict_variance_observed(&[1.2]).unwrap()[0], 2.5 - k * k / 2.5, 1e-14));
    let lml = -0.5 * (9.0 + 1.0) / 2.5 - (TAU * 2.5).ln();
    assert!(close(gp.log_marginal_likelihood().unwrap(), lml, 1e-14));

    // Two samples: the inverse of [[a, b], [b, a]] is [[a, -b], [-b, a]] / (a^2 - b^2).
    let gp = DenseGp::fit_at(&[0.0, 1.0], &[1.0, 2.0], 1, kernel, 0.5).unwrap();
    let (a, b) = (2.5, 2.0 * (-2.0f64).exp());
    let (k0, k1) = (2.0 * (-0.6f64).exp(), 2.0 * (-1.4f64).exp());
    let det = a * a - b * b;
    let mean = (k0 * (a - 2.0 * b) + k1 * (2.0 * a - b)) / det;
    assert!(close(gp.predict_mean(&[0.3]).unwrap()[0], mean, 1e-14));
    let variance = 2.0 - (a * (k0 * k0 + k1 * k1) - 2.0 * b * k0 * k1) / det;
    assert!(close(gp.predict_variance_latent(&[0.3]).unwrap()[0], variance, 1e-14));
    let lml = -0.5 * (5.0 * a - 4.0 * b) / det - 0.5 * det.ln() - TAU.ln();
    assert!(close(gp.log_marginal_likelihood().unwrap(), lml, 1e-14));
}

#[cfg(feature = "fit")]
#[test]
fn gradients_match_central_differences_for_every_kernel() {
    let (x, y) = samples(40, 2);
    let mut evaluator = DenseEvaluator::new(&x, 3, &y, 2).unwrap();
    for kernel in crate::kernel::test_kernels() {
        let noise: f64 = 0.03;
        let likelihood = evaluator.evaluate_with_gradient(&kernel, noise).unwrap();
        assert_eq!(likelihood, evaluator.evaluate_with_gradient(&kernel, noise).unwrap());
        let p = kernel.log_parameters();
        assert_eq!(likelihood.gradient.len(), p.len() + 1);
        let mut at = |i: usize, step: f64| {
            let (mut kernel, mut p) = (kernel.clone(), p.clone());
            let noise = if i == p.len() { noise * step.exp() } else { noise };
            if let Some(p) = p.get_mut(i) {
                *p += step;
            }
            kernel.set_log_parameters(&p).unwrap();
            evaluator.evaluate(&kernel, noise).unwrap().log_marginal_likelihood
        };
        for (i, analytic) in likelihood.gradient.iter().enumerate() {
            let difference = (at(i, 1e-4) - at(i, -1e-4)) / 2e-4;
            let name = kernel.name();
            assert!(
                (difference - analytic).abs() < 2e-6 * (1.0 + analytic.abs()),
                "{name} {i}: {difference} {analytic}"
            );
        }
    }
}

#[cfg(feature = "fit")]
#[test]
fn leaving_one_out_matches_refits() {
    let (x, y) = samples(17, 2);
    let kernel = Kernel::ard(1.2, Shape::Matern52, &[0.5, 0.7, 0.9]);
    let gp = DenseGp::fit_at(&x, &y, 2, kernel.clone(), 0.01).unwrap();
    let loo = gp.leave_one_out().unwrap();
    let mut density = 0.0;
    for i in 0..17 {
        let (mut x, mut y) = (x.clone(), y.clone());
        let point: Vec<f64> = x.drain(3 * i..3 * i + 3).collect();
        let target: Vec<f64> = y.drain(2 * i..2 * i + 2).collect();
        let rest = DenseGp::fit_at(&x, &y, 2, kernel.clone(), 0.01).unwrap();
        let mean = rest.predict_mean(&point).unwrap();
        let variance = rest.predict_variance_observed(&point).unwrap()[0];
        assert!(close(loo.variances[i], variance, 1e-10));
        for c in 0..2 {
            let residual = target[c] - mean[c];
            assert!(close(loo.residuals[2 * i + c], residual, 1e-9), "{i} {c}");
            density -= 0.5 * (TAU * variance).ln() + 0.5 * residual * residual / variance;
        }
    }
    assert!(close(loo.log_predictive_density, density, 1e-9));
}

#[test]
fn duplicated_points_without_noise_climb_the_jitter_ladder() {
    let (mut x, mut y) = samples(30, 1);
    x.extend_from_within(..);
    y.extend_from_within(..);
    let kernel = Kernel::ard(4.0, Shape::SquaredExponential, &[0.9, 0.9, 0.9]);
    let gp = DenseGp::fit_at(&x, &y, 1, kernel.clone(), 0.0).unwrap();
    assert!(gp.jitter() >= 4e-12 && gp.jitter() <= 4e-6, "{}", gp.jitter());
    let mean = gp.predict_mean(&x).unwrap();
    assert!(mean.iter().zip(&y).all(|(m, y)| (m - y).abs() < 1e-2));
    assert_eq!(DenseGp::fit_at(&x, &y, 1, kernel.clone(), 0.1).unwrap().jitter(), 0.0);
    #[cfg(feature = "fit")]
    {
        let mut evaluator = DenseEvaluator::new(&x, 3, &y, 1).unwrap();
        assert_eq!(evaluator.evaluate(&kernel, 0.0).unwrap().jitter, gp.jitter());
        assert_eq!(evaluator.evaluate(&kernel, 0.1).unwrap().jitter, 0.0);
    }
}

#[cfg(feature = "fit")]
#[test]
fn blocks_of_the_inverse_match_the_identity() {
    // Three blocks of columns, the last of which is narrower.
    let block = factor::INVERSE_COLUMNS;
    let (n, noise) = (2 * block + 44, 0.05);
    let (x, y) = samples(n, 1);
    let kernel = Kernel::ard(1.0, Shape::Matern32, &[0.5, 0.6, 0.7]);
    let gp = DenseGp::fit_at(&x, &y, 1, kernel.clone(), noise).unwrap();
    let covariance = |i: usize, j: usize| {
        let nugget = if i == j { noise } else { 0.0 };
        kernel.value(&x[3 * i..3 * i + 3], &x[3 * j..3 * j + 3]) + nugget
    };
    let mut inverse = vec![vec![0.0; n]; n];
    for (first, width) in [(0, block), (block, block), (2 * block, 44)] {
        let mut columns = vec![0.0; (n - first) * width];
        inverse::inverse_columns(gp.factor().unwrap(), n, first, width, &mut columns);
        for (column, j) in columns.chunks(n - first).zip(first..) {
            for i in j..n {
                inverse[i][j] = column[i - first];
                inverse[j][i] = column[i - first];
            }
        }
    }
    for (i, j) in [(0, 0), (5, 200), (block + 2, block + 1), (n - 1, n - 1), (n - 1, 0), (block - 1, block)] {
        let product: f64 = (0..n).map(|k| covariance(i, k) * inverse[k][j]).sum();
        assert!((product - f64::from(u8::from(i == j))).abs() < 1e-11, "{i} {j}: {product}");
    }
}

#[cfg(feature = "fit")]
#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let (x, y) = samples(700, 3);
    let kernel = Kernel::ard(1.0, Shape::Matern52, &[0.5, 0.6, 0.7]);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let gp = DenseGp::fit_at(&x, &y, 3, kernel.clone(), 0.01).unwrap();
            let likelihood = DenseEvaluator::new(&x, 3, &y, 3).unwrap().evaluate_with_gradient(&kernel, 0.01);
            let mean = gp.predict_mean(&x[..900]).unwrap();
            let variance = gp.predict_variance_latent(&x[..900]).unwrap();
            (likelihood.unwrap(), mean, variance, gp.leave_one_out().unwrap())
        })
    };
    let one = run(1);
    for threads in [2, 3, 8] {
        assert!(one == run(threads), "{threads} threads");
    }
}

#[test]
fn the_chord_metric_closes_the_circle() {
    let axes = vec![(crate::kernel::Kernel1d::new(Shape::Matern52, 0.4), crate::kernel::AxisMetric::Chord)];
    let kernel = Kernel::product(1.0, axes);
    let gp = DenseGp::fit_at(&[0.1, 1.0, 2.9], &[1.0, 0.3, 0.8], 1, kernel, 1e-6).unwrap();
    let mean = gp.predict_mean(&[0.4, 0.4 + std::f64::consts::PI]).unwrap();
    assert!((mean[0] - mean[1]).abs() < 1e-10);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let kernel = Kernel::ard(1.0, Shape::Matern52, &[0.5]);
    let fit = |x: &[f64], y: &[f64], channels, noise| {
        DenseGp::fit_at(x, y, channels, kernel.clone(), noise).map(|_| ())
    };
    assert!(fit(&[], &[], 1, 0.1).is_err());
    assert!(fit(&[0.0], &[], 0, 0.1).is_err());
    assert!(fit(&[0.0, 1.0], &[1.0], 1, 0.1).is_err());
    assert!(fit(&[0.0, f64::NAN], &[1.0, 1.0], 1, 0.1).is_err());
    assert!(fit(&[0.0, 1.0], &[1.0, f64::INFINITY], 1, 0.1).is_err());
    assert!(fit(&[0.0, 1.0], &[1.0, 1.0], 1, -0.1).is_err());
    assert!(fit(&[0.0, 1.0], &[1.0, 1.0], 1, f64::NAN).is_err());
    assert!(fit(&[0.0, 1.0], &[1.0, 1.0], 1, 0.0).is_ok());
    // The covariance matrix would have 9e12 entries, 65 TiB.
    let many = vec![0.5; 3_000_000];
    assert!(matches!(fit(&many, &many, 1, 0.1), Err(Error::TooLarge { samples: 3_000_000, .. })));
    let two = Kernel::ard(1.0, Shape::Matern52, &[0.5, 0.5]);
    #[cfg(feature = "fit")]
    {
        assert!(matches!(DenseEvaluator::new(&many, 1, &many, 1), Err(Error::TooLarge { .. })));
        assert!(DenseEvaluator::new(&[0.0], 1, &[1.0], 1).unwrap().evaluate(&two, 0.1).is_err());
    }
    let gp = DenseGp::fit_at(&[0.0, 1.0], &[1.0], 1, two, 0.1).unwrap();
    assert!(gp.predict_mean(&[0.0]).is_err() && gp.predict_variance_latent(&[f64::NAN, 0.0]).is_err());
    assert!(gp.predict_mean(&[]).unwrap().is_empty());
}
