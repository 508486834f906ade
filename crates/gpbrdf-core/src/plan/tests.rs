use std::sync::Arc;

use super::belief::Highlights;
use super::cells::reflected_energies;
use super::*;
use crate::brdf::{angles::HalfDiff, materials};
use crate::gp::Solver;
use crate::judge::Environment;
use crate::kernel::{Kernel, Shape};
use crate::model::{FitOptions, IntervalOf, PriorChoice, condition, fit};
use crate::prior::{LearnOptions, Library, Prior, learn};
use crate::sample::{InPlaneScan, InputSpace, Sample, SampleSet};
use crate::{Brdf, Hyper};

fn prior() -> Arc<Prior> {
    let mut library = Library::new(200).unwrap();
    for material in materials() {
        let values: Vec<_> = library.centres().iter().map(|&at| material.brdf.eval_half_diff(at)).collect();
        library.add_values(material.name, &values).unwrap();
    }
    Arc::new(learn("test", &library, &LearnOptions { functions: [8, 4] }).unwrap())
}

/// More geometries than the devices of these tests have, unless their steps are fine.
const MOST: usize = 3000;

/// The values of a material.
fn measured(brdf: &dyn Brdf, geometries: &[Geometry]) -> SampleSet {
    let sample = |geometry: &Geometry| {
        let [wi, wo] = geometry.directions();
        Sample { wi, wo, value: brdf.eval(&wi, &wo) }
    };
    geometries.iter().map(sample).collect()
}

/// Whether all angles are multiples of a step, azimuths from the mirror direction.
fn is_coarse(step: f64) -> impl Fn(&Geometry) -> bool {
    move |g| [g.theta_i, g.theta_o, 180.0 - g.phi_o].iter().all(|angle| (angle / step).fract() == 0.0)
}

fn coarse() -> Device {
    Device { step: 15.0, theta_max: 75.0, ..Device::default() }
}

/// The variances that a plan expects are those of the process that is conditioned on the planned measurements.
#[test]
fn expected_errors_are_those_of_the_conditioned_process() {
    let prior = prior();
    let candidates = Candidates::of(&coarse()).unwrap();
    let cells = Cells::hemisphere(300).unwrap();
    for prior in [Some(&prior), None] {
        let belief = Belief::before(prior);
        let found = plan(&belief, &[], &candidates, &cells, Goal::Count(9)).unwrap();
        let material = &materials()[3].brdf;
        for count in [1, 4, 9] {
            let samples = measured(material, &found.geometries[..count]);
            let own = Hyper::new(
                Solver::Scattered,
                belief.kernel.clone(),
                belief.noise_variance,
                Some(belief.space),
            );
            let hyper = Hyper {
                basis_variance: prior.map(|_| 1.0),
                chromatic: prior.map(|_| Box::new(Hyper { basis_variance: Some(1e-9), ..own.clone() })),
                ..own
            };
            let choice = prior.map_or(PriorChoice::None, |prior| PriorChoice::Learned(Arc::clone(prior)));
            let options = FitOptions { prior: choice, ..FitOptions::default() };
            let model = condition(&samples, &options, &hyper).unwrap().model;
            let variances = model.predict_variance(&cells.angles, IntervalOf::Latent).unwrap();
            let mut expected: f64 = variances.iter().zip(&cells.weights).map(|(v, w)| v[0] * w).sum();
            if let Some(hyper) = hyper.chromatic {
                // The chromatic colours of the model have the same kernel and nearly no functions.
                let chromatic = Belief { prior: None, scale: 1.0, ..Belief::of_fit(&hyper, prior).unwrap() };
                // Intervals of the model are calibrated as a whole.
                let factors = belief.calibration(&cells.angles);
                let mut calibrated = cells.clone();
                calibrated.weights.iter_mut().zip(factors).for_each(|(weight, factor)| *weight *= factor);
                let chromatic = expected_error(&chromatic, &samples.angles, &calibrated).unwrap().powi(2);
                expected -= 2.0 / 3.0 * chromatic;
            }
            let own = found.errors[count].powi(2);
            assert!((own / expected - 1.0).abs() < 1e-4, "{count}: {own} {expected}");
            let again = expected_error(&belief, &samples.angles, &cells).unwrap();
            assert!((again / found.errors[count] - 1.0).abs() < 1e-9, "{count}");
        }
        assert!(found.errors.windows(2).all(|pair| pair[1] < pair[0]), "{:?}", found.errors);
    }
}

/// The first choice is the best of all single measurements where highlights count as in choices, and choices go on from
/// measurements as from choices.
#[test]
fn choices_are_the_best_ones_and_may_be_made_in_stages() {
    let candidates = Candidates::of(&Device { step: 30.0, theta_max: 60.0, ..Device::default() }).unwrap();
    let cells = Cells::hemisphere(200).unwrap();
    let belief = Belief::before(Some(&prior()));
    let whole = plan(&belief, &[], &candidates, &cells, Goal::Count(8)).unwrap();
    let mut emphasised = cells.clone();
    let (emphasis, calibration) = (belief.emphasis(&cells.angles), belief.calibration(&cells.angles));
    let factors = emphasis.iter().zip(calibration).map(|(chosen, expected)| chosen / expected);
    emphasised.weights.iter_mut().zip(factors).for_each(|(weight, factor)| *weight *= factor);
    let error = |g: &Geometry| expected_error(&belief, &[g.angles()], &emphasised).unwrap();
    let best = candidates.all.iter().map(error).fold(f64::INFINITY, f64::min);
    let found = error(&whole.geometries[0]);
    assert!((found / best - 1.0).abs() < 1e-9, "{found} {best}");
    for (factor, at) in emphasis.iter().zip(&cells.angles) {
        assert!(if at.theta_h < 0.08 { (factor - 4.0).abs() < 1e-9 } else { (1.0..=4.0).contains(factor) });
    }
    let known: Vec<HalfDiff> = whole.geometries[..3].iter().map(|g| g.angles()).collect();
    let rest = plan(&belief, &known, &candidates, &cells, Goal::Count(5)).unwrap();
    assert_eq!(rest.geometries, whole.geometries[3..]);
    assert!(rest.errors.iter().zip(&whole.errors[3..]).all(|(a, b)| (a / b - 1.0).abs() < 1e-9));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| plan(&belief, &known, &candidates, &cells, Goal::Count(5)).unwrap())
    };
    assert_eq!(run(1), run(3));
}

/// The first measurements are at coarse steps, those after them at all, in one plan or in several.
#[test]
fn the_first_measurements_are_planned_at_coarse_steps() {
    let cells = Cells::warped_box(200).unwrap();
    let belief = Belief::before(Some(&prior()));
    let few = Candidates::FEW;
    for (step, coarse) in [(1.0, 5.0), (2.0, 6.0)] {
        let device = Device { step, theta_max: 60.0, ..Device::default() };
        let candidates = Candidates::of(&device).unwrap();
        let run = |known: &[Geometry], goal| {
            let known: Vec<HalfDiff> = known.iter().map(|geometry| geometry.angles()).collect();
            plan(&belief, &known, &candidates, &cells, goal).unwrap()
        };
        let whole = run(&[], Goal::Count(few + 10));
        assert_eq!((whole.geometries.len(), whole.errors.len()), (few + 10, few + 11));
        assert!(whole.errors.windows(2).all(|pair| pair[1] < pair[0]), "{:?}", whole.errors);
        assert!(whole.geometries[..few].iter().all(is_coarse(coarse)));
        assert!(whole.geometries[few..].iter().any(|geometry| !is_coarse(coarse)(geometry)));
        for (i, geometry) in whole.geometries.iter().enumerate() {
            assert!(!whole.geometries[..i].contains(geometry), "{geometry:?}");
        }
        for known in [7, few, few + 4] {
            let (known, next) = whole.geometries.split_at(known);
            assert_eq!(run(known, Goal::Count(next.len())).geometries, next);
        }
        let until = run(&[], Goal::Error(whole.errors[few + 3]));
        assert_eq!(until.geometries, whole.geometries[..few + 3]);
    }
    // Nothing but the normal is at multiples of 5 degrees, too near to the light; 4 degrees of both are far enough.
    let device = Device { theta_max: 4.0, ..Device::default() };
    let candidates = Candidates::of(&device).unwrap();
    assert!(candidates.coarse.is_empty());
    assert_eq!(plan(&belief, &[], &candidates, &cells, Goal::Count(3)).unwrap().geometries.len(), 3);
    // Fewer at coarse steps than the first measurements: the others are at fine ones.
    let device = Device { theta_max: 10.0, in_plane: true, ..Device::default() };
    let candidates = Candidates::of(&device).unwrap();
    let coarse = candidates.coarse.len();
    assert!((1..few).contains(&coarse));
    let whole = plan(&belief, &[], &candidates, &cells, Goal::Count(few)).unwrap().geometries;
    assert!(whole[..coarse].iter().all(is_coarse(5.0)) && !is_coarse(5.0)(&whole[coarse]));
    assert!(plan(&belief, &[], &candidates, &cells, Goal::Count(candidates.len())).is_ok());
    let message = plan(&belief, &[], &candidates, &cells, Goal::Count(1_000_000)).unwrap_err().to_string();
    assert!(message.contains("expected at most ") && message.ends_with("found 1000000"), "{message}");
}

/// A scan in the plane of incidence says nothing of other directions, and its plan knows.
#[test]
fn plans_leave_a_plane_that_was_measured() {
    let prior = prior();
    let hyper = Hyper {
        basis_variance: Some(1.0),
        ..Hyper::new(
            Solver::Scattered,
            Kernel::ard(0.05, Shape::Matern52, &[0.2, 0.35, 0.01]),
            1e-4,
            Some(InputSpace::PlaneOfIncidence),
        )
    };
    let belief = Belief::of_fit(&hyper, Some(&prior)).unwrap();
    let scan = InPlaneScan { count: 100, ..InPlaneScan::default() }.directions().unwrap();
    let scan: Vec<HalfDiff> = scan.iter().map(|[wi, wo]| HalfDiff::from_directions(wi, wo)).collect();
    let candidates = Candidates::of(&Device::default()).unwrap();
    let cells = Cells::usual(None, 500).unwrap();
    let plan = plan(&belief, &scan, &candidates, &cells, Goal::Count(10)).unwrap();
    let outside = plan.geometries.iter().filter(|g| g.phi_o % 180.0 != 0.0).count();
    assert!(outside >= 8, "{:?}", plan.geometries);
}

#[test]
fn fine_steps_are_left_to_materials_with_sharp_highlights() {
    let cells = Cells::warped_box(200).unwrap();
    let candidates = Candidates::of(&Device::default()).unwrap();
    let prior = prior();
    let first =
        plan(&Belief::before(Some(&prior)), &[], &candidates, &cells, Goal::Count(Candidates::FEW)).unwrap();
    let next = |brdf: &dyn Brdf| {
        let samples = measured(brdf, &first.geometries);
        let options = FitOptions { prior: PriorChoice::Learned(Arc::clone(&prior)), ..FitOptions::default() };
        let model = fit(&samples, &options).unwrap().model;
        let belief = Belief::of_model(&model, &samples, &options).unwrap();
        plan(&belief, &samples.angles, &candidates, &cells, Goal::Count(10)).unwrap().geometries
    };
    let named = |name: &str| materials().iter().find(|material| material.name == name).unwrap();
    assert!(next(&named("lambert").brdf).iter().all(is_coarse(5.0)));
    assert!(!next(&named("purple-paint").brdf).iter().all(is_coarse(5.0)));
}

#[test]
fn highlights_count_by_the_energy_that_a_model_reflects() {
    let model = |name: &str| {
        let material = materials().iter().find(|material| material.name == name).unwrap();
        let reached = coarse().geometries(MOST).unwrap();
        let samples = measured(&material.brdf, &reached);
        let options = FitOptions { prior: PriorChoice::None, ..FitOptions::default() };
        (fit(&samples, &options).unwrap().model, samples, options)
    };
    // A white surface reflects as much of it far from the mirror direction as evenly spread directions have there.
    let (white, samples, options) = model("lambert");
    let (even, in_box) = (Cells::hemisphere(20_000).unwrap(), Cells::warped_box(20_000).unwrap());
    let energies = reflected_energies(&white, in_box.angles(), &in_box.weights);
    for limit in [10.0, 20.0, 30.0, 45.0f64] {
        let share = |cells: &Cells, weights: &[f64]| {
            let within = cells.angles.iter().zip(weights).filter(|(at, _)| at.theta_h.to_degrees() < limit);
            within.map(|(_, w)| w).sum::<f64>() / weights.iter().sum::<f64>()
        };
        let (expected, found) = (share(&even, &even.weights), share(&in_box, &energies));
        assert!((found - expected).abs() < 0.02, "{limit}: {found} {expected}");
    }
    assert!(matches!(Belief::of_model(&white, &samples, &options).unwrap().highlights, Highlights::Broad));

    let (glossy, samples, options) = model("purple-paint");
    let highlights = Belief::of_model(&glossy, &samples, &options).unwrap().highlights;
    assert!(matches!(highlights, Highlights::Sharp(_)));
    let usual = Cells::usual(None, 2000).unwrap();
    assert_eq!(*usual.of_material(&highlights, Candidates::FEW - 1), usual);
    let weighted = usual.of_material(&highlights, Candidates::FEW);
    assert_eq!(weighted.weights[..1000], usual.weights[..1000]);
    assert!((weighted.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    // Where the model reflects next to nothing, a fifth of the weight stays.
    let least = weighted.weights.iter().zip(&usual.weights).map(|(w, u)| w / u).fold(f64::INFINITY, f64::min);
    assert!((0.2..0.5).contains(&least), "{least}");
}

#[test]
fn plans_end_with_their_goal_or_say_how_far_they_get() {
    let candidates = Candidates::from(coarse().geometries(MOST).unwrap());
    let cells = Cells::hemisphere(200).unwrap();
    let belief = Belief::before(None);
    let run = |goal| plan(&belief, &[], &candidates, &cells, goal);
    let found = run(Goal::Error(1.0)).unwrap();
    let errors = &found.errors;
    assert!(
        (errors[0] - 2.0).abs() < 1e-12 && errors[errors.len() - 1] <= 1.0 && errors[errors.len() - 2] > 1.0
    );
    assert_eq!(found.geometries.len() + 1, errors.len());
    let message = run(Goal::Error(1e-6)).unwrap_err().to_string();
    let all = candidates.len();
    assert!(message.contains(&format!("which {all} directions reach, found 0.000001")), "{message}");
    let message = run(Goal::Count(all + 1)).unwrap_err().to_string();
    let expected = format!("expected at most {all}, the directions to choose from, found {}", all + 1);
    assert!(message.ends_with(&expected), "{message}");
    assert!(run(Goal::Error(0.0)).is_err() && run(Goal::Error(f64::NAN)).is_err());
    assert!(plan(&belief, &[], &Candidates::default(), &cells, Goal::Count(0)).is_err());
    // All of them, each once.
    let mut every = run(Goal::Count(all)).unwrap().geometries;
    let order = |g: &Geometry, h: &Geometry| {
        [g.theta_i, g.theta_o, g.phi_o].partial_cmp(&[h.theta_i, h.theta_o, h.phi_o]).unwrap()
    };
    every.sort_by(order);
    assert_eq!(every, candidates.all);
}

#[test]
fn geometries_keep_to_the_limits_and_none_is_there_twice() {
    let devices = [
        Device { step: 5.0, ..Device::default() },
        Device { step: 2.0, ..Device::default() },
        Device { step: 7.0, ..Device::default() },
        Device { step: 5.0, in_plane: true, min_separation: 12.0, ..Device::default() },
        Device { step: 5.0, incidences: Some(vec![70.0, 12.5, 40.0]), theta_max: 60.0, ..Device::default() },
    ];
    for device in devices {
        let found = device.geometries(MOST).unwrap();
        assert!(found.len() <= MOST);
        for Geometry { theta_i, theta_o, phi_o } in &found {
            let is_multiple = |x: f64| (x / device.step - (x / device.step).round()).abs() < 1e-9;
            assert!(is_multiple(*theta_o) && is_multiple(180.0 - *phi_o) && *theta_o <= device.theta_max);
            match &device.incidences {
                Some(list) => assert!(list.contains(theta_i)),
                None => assert!(is_multiple(*theta_i) && *theta_i <= device.theta_max),
            }
            assert!((0.0..=180.0).contains(phi_o) && (!device.in_plane || phi_o % 180.0 == 0.0));
        }
        for (k, geometry) in found.iter().enumerate() {
            let [wi, wo] = geometry.directions();
            let separation = wi.dot(&wo).clamp(-1.0, 1.0).acos().to_degrees();
            assert!(separation > device.min_separation - 1e-4, "{geometry:?}");
            if device.step > 4.0 {
                let at = geometry.angles();
                let is_same = |other: &Geometry| {
                    let b = other.angles();
                    let mirrored =
                        (at.phi_d - b.phi_d).abs().min((at.phi_d + b.phi_d - std::f64::consts::PI).abs());
                    (at.theta_h - b.theta_h).abs() + (at.theta_d - b.theta_d).abs() + mirrored < 1e-9
                };
                assert!(!found[..k].iter().any(is_same), "{geometry:?}");
            }
        }
        // Mirror directions as far as they are reached.
        let on_grid = vec![3.0 * device.step, 8.0 * device.step];
        for theta_i in device.incidences.clone().unwrap_or(on_grid) {
            let of = || found.iter().filter(|g| g.theta_i == theta_i);
            let nearest = of().map(|g| g.angles().theta_h.to_degrees()).fold(90.0, f64::min);
            assert!(
                nearest <= 0.26 * device.step + (theta_i - device.theta_max).max(0.0),
                "{device:?} {nearest}"
            );
        }
    }
}

#[test]
fn limits_out_of_range_are_refused() {
    let device = Device::default();
    let refused = |device: Device| device.geometries(100).unwrap_err().to_string();
    assert!(refused(Device { step: 0.0, ..device.clone() }).ends_with("expected 0.5 to 45 degrees, found 0"));
    assert!(refused(Device { theta_max: 90.0, ..device.clone() }).contains("0 to 87 degrees, found 90"));
    assert!(refused(Device { min_separation: -1.0, ..device.clone() }).contains("0 to 180 degrees"));
    for incidences in [vec![], vec![f64::NAN], vec![10.0, 88.0]] {
        assert!(refused(Device { incidences: Some(incidences), ..device.clone() }).contains("incidences"));
    }
    assert_eq!(device.coarse_step(), Some(5.0));
    assert_eq!(Device { step: 2.0, ..device.clone() }.coarse_step(), Some(6.0));
    assert_eq!(Device { step: 5.0 / 3.0, ..device.clone() }.coarse_step(), Some(5.0));
    assert_eq!(Device { step: 5.0, ..device.clone() }.coarse_step(), None);
    let nothing = Device { theta_max: 40.0, min_separation: 120.0, ..device };
    assert!(refused(nothing).starts_with("limits of the instrument: expected at least one pair"));
}

#[test]
fn tours_visit_all_and_are_no_longer_than_the_order_of_rank() {
    let candidates = Device { step: 5.0, ..Device::default() }.geometries(MOST).unwrap();
    let order: Vec<usize> = crate::base::random::golden_ratio_subset(candidates.len(), 60);
    let geometries: Vec<Geometry> = order.iter().map(|&i| candidates[i]).collect();
    for costs in [AxisCosts::default(), AxisCosts { theta_i: 20.0, phi_o: 0.1, ..AxisCosts::default() }] {
        let found = tour(&geometries, &costs);
        let rank: Vec<usize> = (0..60).collect();
        let mut visited = found.clone();
        visited.sort_unstable();
        assert_eq!(visited, rank);
        let [short, long] = [&found, &rank].map(|order| costs.of_way(&geometries, order));
        assert!(short < 0.6 * long, "{short} {long}");
    }
    // The expensive axis turns least.
    let turned = |costs: AxisCosts| {
        let found = tour(&geometries, &costs);
        found.windows(2).map(|w| (geometries[w[0]].theta_i - geometries[w[1]].theta_i).abs()).sum::<f64>()
    };
    assert!(turned(AxisCosts { theta_i: 50.0, ..AxisCosts::default() }) < 100.0);
    assert!(tour(&[], &AxisCosts::default()).is_empty());
    let same = [geometries[0]; 3];
    assert_eq!(tour(&same, &AxisCosts::default()).len(), 3);
}

#[test]
fn cells_of_an_environment_are_those_that_its_light_reaches() {
    let cells = Cells::environment(&Environment::studio(), 1000).unwrap();
    assert_eq!((cells.len(), cells.weights.len()), (1000, 1000));
    assert!((cells.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    assert!(cells.angles.iter().all(|at| at.is_above_horizon()));
    // The key light stands 58 degrees from the viewer, who looks along the axis of the sphere: theta_d is about 29.
    let mean = |cells: &Cells| {
        cells.angles.iter().zip(&cells.weights).map(|(at, w)| w * at.theta_d.to_degrees()).sum::<f64>()
    };
    let narrow = |cells: &Cells| {
        let near = |at: &HalfDiff| (at.theta_d.to_degrees() - 29.0).abs() < 8.0;
        cells.angles.iter().zip(&cells.weights).filter(|(at, _)| near(at)).map(|(_, w)| w).sum::<f64>()
    };
    let even = Cells::hemisphere(1000).unwrap();
    assert!(narrow(&cells) > narrow(&even), "{} {}", narrow(&cells), narrow(&even));
    assert!((15.0..50.0).contains(&mean(&cells)) && (15.0..50.0).contains(&mean(&even)));
    assert!(Cells::hemisphere(0).is_err() && Cells::warped_box(0).is_err());
    let near_mirror = |cells: &Cells| cells.angles.iter().filter(|at| at.theta_h < 0.1).count();
    let warped = Cells::warped_box(1000).unwrap();
    assert!(near_mirror(&warped) > 5 * near_mirror(&even) && warped.weights.iter().all(|w| *w >= 0.0));
    let usual = Cells::usual(None, 2000).unwrap();
    assert_eq!(usual, even.clone().with_highlights(warped.clone()));
    assert!((usual.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    assert!((usual.weights[..1000].iter().sum::<f64>() - 0.5).abs() < 1e-12);
    assert_eq!(*usual.of_material(&Highlights::Unknown, 100), usual);
    let matte = usual.of_material(&Highlights::Broad, 100);
    assert_eq!(matte.angles, even.angles);
    assert!(matte.weights.iter().zip(&even.weights).all(|(a, b)| (a - b).abs() < 1e-15));
    let studio = Cells::usual(Some(&Environment::studio()), 2000).unwrap();
    assert_eq!(studio, cells.with_highlights(warped.clone()));
    assert!(Cells::usual(None, 1).is_err());
    let at = even.angles()[0];
    let bad = HalfDiff { theta_h: f64::NAN, ..at };
    for pairs in
        [vec![], vec![(at, 0.0)], vec![(at, 1.0), (at, -1e-9)], vec![(at, f64::INFINITY)], vec![(bad, 1.0)]]
    {
        assert!(Cells::new(pairs).is_err());
    }
    assert_eq!(Cells::new(vec![(at, 3.0), (at, 1.0)]).unwrap().weights, [0.75, 0.25]);
    let far_from_mirror = |cells: &Cells| {
        let far = cells.angles.iter().zip(&cells.weights).filter(|(at, _)| at.theta_h.to_degrees() > 30.0);
        far.map(|(_, weight)| weight).sum::<f64>()
    };
    let [in_hemisphere, in_box] = [far_from_mirror(&even), far_from_mirror(&warped)];
    assert!((in_hemisphere - 0.56).abs() < 0.03 && (in_box - 0.22).abs() < 0.03, "{in_hemisphere} {in_box}");
    let black = crate::base::raster::Raster::filled(4, 2, [0.0f32; 3]);
    assert!(Cells::environment(&Environment::new(black).unwrap(), 10).is_err());
}

#[test]
fn fine_steps_are_thinned_to_many_near_mirror_directions() {
    let found = Device::default().geometries(MOST).unwrap();
    assert!((MOST * 8 / 10..=MOST).contains(&found.len()), "{}", found.len());
    // Within 3 degrees lies a share of sqrt(3 / 90) of the warped box, and 0.1 % of the hemisphere of half vectors.
    let near = found.iter().filter(|geometry| geometry.angles().theta_h.to_degrees() < 3.0).count();
    assert!((found.len() / 10..found.len() / 4).contains(&near), "{near} of {}", found.len());
}
