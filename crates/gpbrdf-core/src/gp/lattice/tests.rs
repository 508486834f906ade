use super::*;
use crate::base::random::SplitMix64;
use crate::kernel::AxisMetric;
use crate::kernel::{Shape, Term1d};
use nalgebra::{DMatrix, DVector};

/// The kinds of third axis: its metric, and whether it is mirrored.
const AXES: [(AxisMetric, bool); 3] =
    [(AxisMetric::Linear, false), (AxisMetric::Chord, false), (AxisMetric::Chord, true)];

/// Hyper-parameters in which every shape occurs along some axis, alone or in a sum.
fn cases() -> Vec<LatticeHyper> {
    let single = Kernel1d::new;
    let sum = Kernel1d {
        terms: vec![
            Term1d { weight: 1.0, shape: Shape::Matern52, length_scale: 0.9 },
            Term1d { weight: 0.4, shape: Shape::RationalQuadratic { alpha: 1.1 }, length_scale: 0.3 },
        ],
    };
    let axes = [
        [single(Shape::Matern52, 0.6), single(Shape::Matern52, 0.8), single(Shape::Matern52, 0.7)],
        [single(Shape::SquaredExponential, 0.3), single(Shape::Matern12, 0.8), single(Shape::Matern32, 0.7)],
        [sum.clone(), single(Shape::RationalQuadratic { alpha: 0.6 }, 0.5), sum],
        [single(Shape::Matern { nu: 1.3 }, 0.5), single(Shape::Matern32, 1.0), single(Shape::Matern12, 0.4)],
    ];
    axes.map(|kernels| LatticeHyper { signal_variance: 1.7, noise_variance: 0.01, kernels }).into()
}

fn data((metric, mirrored): (AxisMetric, bool)) -> LatticeData {
    let mut random = SplitMix64::new(5);
    let mut axis = |n: usize, extent: f64| -> Vec<f64> {
        (0..n).map(|i| extent * (i as f64 + 0.6 * random.next_unit()) / n as f64).collect()
    };
    let coordinates = [axis(5, 1.0), axis(4, 1.0), axis(3, 3.0)];
    let channels = 2;
    let targets = (0..channels * 60).map(|_| 2.0 * random.next_unit() - 1.0).collect();
    LatticeData {
        coordinates,
        metrics: [AxisMetric::Linear, AxisMetric::Linear, metric],
        mirrored: [false, false, mirrored],
        targets,
        channels,
    }
}

fn points(data: &LatticeData) -> Vec<[f64; 3]> {
    let [u, v, phi] = &data.coordinates;
    let grid = |&u: &f64| v.iter().flat_map(move |&v| phi.iter().map(move |&phi| [u, v, phi]));
    u.iter().flat_map(grid).collect()
}

/// The textbook dense process, computed with nalgebra.
struct Oracle {
    inverse: DMatrix<f64>,
    #[cfg(feature = "fit")]
    log_det: f64,
}

fn kernel(data: &LatticeData, hyper: &LatticeHyper, a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let one = |k: usize, b: f64| hyper.kernels[k].value(data.metrics[k].distance(a[k], b));
    let factor = |k: usize| one(k, b[k]) + if data.mirrored[k] { one(k, -b[k]) } else { 0.0 };
    hyper.signal_variance * factor(0) * factor(1) * factor(2)
}

fn oracle(data: &LatticeData, hyper: &LatticeHyper) -> Oracle {
    let x = points(data);
    let mut k = DMatrix::from_fn(x.len(), x.len(), |i, j| kernel(data, hyper, &x[i], &x[j]));
    k += DMatrix::identity(x.len(), x.len()) * hyper.noise_variance;
    let cholesky = k.cholesky().unwrap();
    Oracle {
        #[cfg(feature = "fit")]
        log_det: 2.0 * cholesky.l().diagonal().map(f64::ln).sum(),
        inverse: cholesky.inverse(),
    }
}

#[test]
fn agrees_with_the_dense_process_written_out() {
    for axis in AXES {
        let data = data(axis);
        let n = data.len();
        let x = points(&data);
        for hyper in cases() {
            let oracle = oracle(&data, &hyper);
            let gp = LatticeGp::new(data.clone(), hyper.clone()).unwrap();
            let queries: Vec<[f64; 3]> = (0..40)
                .map(|i| [0.02 * f64::from(i), 0.7 - 0.01 * f64::from(i), 0.07 * f64::from(i)])
                .collect();
            let (means, variances) =
                (gp.predict_mean(&queries), gp.predict_variance_latent(&queries).unwrap());
            let residuals = gp.leave_one_out_residuals().unwrap();
            for channel in 0..2 {
                let y = DVector::from_column_slice(&data.targets[channel * n..][..n]);
                let alpha = &oracle.inverse * &y;
                for (i, q) in queries.iter().enumerate() {
                    let k = DVector::from_fn(n, |j, _| kernel(&data, &hyper, q, &x[j]));
                    let (mean, found) = (k.dot(&alpha), means[2 * i + channel]);
                    assert!((mean - found).abs() < 1e-8 * mean.abs().max(1e-3), "{mean} {found}");
                    let variance = kernel(&data, &hyper, q, q) - k.dot(&(&oracle.inverse * &k));
                    assert!((variance / variances[i] - 1.0).abs() < 1e-8, "{variance} {}", variances[i]);
                }
                for i in 0..n {
                    let left_out = alpha[i] / oracle.inverse[(i, i)];
                    assert!((left_out - residuals[channel * n + i]).abs() < 1e-10);
                }
            }
        }
    }
}

#[cfg(feature = "fit")]
#[test]
fn the_likelihood_is_that_of_the_dense_process_written_out() {
    for axis in AXES {
        let data = data(axis);
        let n = data.len();
        for hyper in cases() {
            let oracle = oracle(&data, &hyper);
            let mut lml = 0.0;
            for y in data.targets.chunks(n).map(DVector::from_column_slice) {
                let alpha = &oracle.inverse * &y;
                lml -= 0.5 * (y.dot(&alpha) + oracle.log_det + n as f64 * (2.0 * std::f64::consts::PI).ln());
            }
            let found = data.likelihood(&hyper).unwrap().value;
            assert!((found / lml - 1.0).abs() < 1e-9, "{found} {lml}");
        }
    }
}

#[test]
fn agrees_with_the_dense_solver() {
    for axis in &AXES[..2] {
        let data = data(*axis);
        let n = data.len();
        let x = points(&data);
        for hyper in cases() {
            let axes = hyper.kernels.iter().cloned().zip(data.metrics).collect();
            let kernel = crate::kernel::Kernel::product(hyper.signal_variance, axes);
            let y: Vec<f64> = (0..n).flat_map(|i| [data.targets[i], data.targets[n + i]]).collect();
            let noise = hyper.noise_variance;
            let dense = crate::gp::DenseGp::fit_at(x.as_flattened(), &y, 2, kernel, noise).unwrap();
            let lattice = LatticeGp::new(data.clone(), hyper.clone()).unwrap();
            let queries: Vec<[f64; 3]> =
                (0..30).map(|i| [0.03 * f64::from(i), 0.5, 0.08 * f64::from(i)]).collect();
            let means = dense.predict_mean(queries.as_flattened()).unwrap();
            for (a, b) in lattice.predict_mean(&queries).iter().zip(&means) {
                assert!((a - b).abs() < 1e-8 * b.abs().max(1e-3), "{a} {b}");
            }
            let variances = dense.predict_variance_latent(queries.as_flattened()).unwrap();
            for (a, b) in lattice.predict_variance_latent(&queries).unwrap().iter().zip(&variances) {
                assert!((a / b - 1.0).abs() < 1e-8, "{a} {b}");
            }
            #[cfg(feature = "fit")]
            {
                let likelihood = data.likelihood(&hyper).unwrap().value;
                let expected = dense.log_marginal_likelihood().unwrap();
                assert!((likelihood / expected - 1.0).abs() < 1e-9, "{likelihood} {expected}");
            }
        }
    }
}

#[cfg(feature = "fit")]
#[test]
fn gradients_agree_with_finite_differences() {
    for axis in AXES {
        let data = data(axis);
        for hyper in cases() {
            let at = data.likelihood(&hyper).unwrap();
            let check = |slope: f64, move_by: &dyn Fn(f64) -> LatticeHyper| {
                let step = 1e-4;
                let value = |s: f64| data.likelihood(&move_by(s)).unwrap().value;
                // Differences of fourth order, which allow a large step.
                let numeric = (8.0 * (value(step) - value(-step)) - (value(2.0 * step) - value(-2.0 * step)))
                    / (12.0 * step);
                assert!((slope - numeric).abs() < 1e-6 * (1.0 + slope.abs()), "{slope} {numeric}");
            };
            check(at.d_signal, &|s| LatticeHyper {
                signal_variance: hyper.signal_variance * s.exp(),
                ..hyper.clone()
            });
            check(at.d_noise, &|s| LatticeHyper {
                noise_variance: hyper.noise_variance * s.exp(),
                ..hyper.clone()
            });
            for k in 0..3 {
                let start: Vec<f64> = hyper.kernels[k].log_parameters();
                assert_eq!(at.d_axes[k].len(), start.len());
                for (i, &slope) in at.d_axes[k].iter().enumerate() {
                    check(slope, &|s| {
                        let mut moved = hyper.clone();
                        let mut p = start.clone();
                        p[i] += s;
                        moved.kernels[k].set_log_parameters(&p).unwrap();
                        moved
                    });
                }
            }
        }
    }
}

#[cfg(feature = "fit")]
#[test]
fn the_profiled_signal_variance_is_the_best_one() {
    let data = data(AXES[0]);
    let hyper = &cases()[0];
    let (signal_variance, best) = data.profile_likelihood(&hyper.kernels, 0.05).unwrap();
    assert!((best.d_signal + best.d_noise).abs() < 1e-9);
    for factor in [0.9, 1.1] {
        let signal_variance = signal_variance * factor;
        let kernels = hyper.kernels.clone();
        let other = LatticeHyper { signal_variance, noise_variance: 0.05 * signal_variance, kernels };
        assert!(data.likelihood(&other).unwrap().value < best.value);
    }
}

#[cfg(feature = "fit")]
#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let data = data(AXES[1]);
    let hyper = &cases()[2];
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let gp = LatticeGp::new(data.clone(), hyper.clone()).unwrap();
            (gp.weights().to_vec(), data.likelihood(hyper).unwrap())
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_mirrored_lattice_is_the_whole_circle_with_mirrored_targets() {
    let half = data(AXES[2]);
    let [u, v, phi] = half.coordinates.clone();
    let c = phi.len();
    // Nodes at phi and pi - phi; their targets are the same.
    let circle: Vec<f64> =
        phi.iter().copied().chain(phi.iter().rev().map(|x| std::f64::consts::PI - x)).collect();
    let mirror = |row: &[f64]| row.iter().chain(row.iter().rev()).copied().collect::<Vec<_>>();
    let targets = half.targets.chunks(c).flat_map(mirror).collect();
    let whole = LatticeData { coordinates: [u, v, circle], mirrored: [false; 3], targets, ..half.clone() };
    let hyper = cases()[0].clone();
    // Every target occurs twice on the circle, so each occurrence has twice the noise variance.
    let noisy = LatticeHyper { noise_variance: 2.0 * hyper.noise_variance, ..hyper.clone() };
    // The kernel of the half circle is the sum over both images, and the covariance of mirrored values on the
    // circle is their average: half the signal variance makes them equal.
    let halved = LatticeHyper {
        signal_variance: 0.5 * hyper.signal_variance,
        noise_variance: hyper.noise_variance,
        ..hyper
    };
    let points: Vec<[f64; 3]> = (0..20).map(|i| [0.05 * f64::from(i), 0.4, 0.15 * f64::from(i)]).collect();
    let a = LatticeGp::new(half, halved).unwrap().predict_mean(&points);
    let b = LatticeGp::new(whole, noisy).unwrap().predict_mean(&points);
    for (a, b) in a.iter().zip(&b) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

#[test]
fn broken_data_is_refused() {
    let good = data(AXES[0]);
    let hyper = cases()[0].clone();
    let mut short = good.clone();
    short.targets.pop();
    assert!(LatticeGp::new(short, hyper.clone()).is_err());
    let mut nan = good.clone();
    nan.targets[3] = f64::NAN;
    assert!(LatticeGp::new(nan, hyper.clone()).is_err());
    assert!(LatticeGp::new(good, LatticeHyper { noise_variance: 0.0, ..hyper }).is_err());
}
