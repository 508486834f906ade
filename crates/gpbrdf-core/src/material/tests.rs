use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::*;
use crate::base::random::quasi_random;
use crate::brdf::{HalfDiff, Reciprocal, cell_center, cell_index, direction, material};

fn table_of(name: &str) -> BrdfTable {
    let brdf = Reciprocal { inner: material(name).unwrap().brdf, min_cosine: 1e-3 };
    BrdfTable::from_fn(|angles| brdf.eval_half_diff(angles))
}

fn made(table: BrdfTable) -> Material {
    Material::new(table, &MaterialOptions::default()).unwrap()
}

#[expect(clippy::cast_possible_truncation, reason = "materials are in single precision")]
fn narrow(w: nalgebra::Vector3<f64>) -> [f32; 3] {
    [w.x as f32, w.y as f32, w.z as f32]
}

/// Directions within 89.9 degrees of the normal.
fn pairs(count: usize) -> impl Iterator<Item = [nalgebra::Vector3<f64>; 2]> {
    (0..count).map(|i| {
        let ([a, b, c], [d, ..]) = (quasi_random(i), quasi_random(i / 3 + 17));
        [direction(1.569 * a, TAU * b), direction(1.569 * c, TAU * d)]
    })
}

#[test]
fn values_are_those_of_the_table_in_double_precision() {
    for name in ["cherry-235", "purple-paint", "ashikhmin-shirley"] {
        let material = made(table_of(name));
        let mut worst = 0.0f64;
        // Pairs anywhere, and pairs whose half vector is near the normal, where lobes are steep.
        let near = (0..20_000).map(|i| {
            let [a, b, c] = quasi_random(i);
            let angles = HalfDiff { theta_h: 0.1 * a * a, theta_d: 1.45 * b, phi_d: PI * c };
            <[_; 2]>::from(angles.to_directions())
        });
        for [wi, wo] in pairs(50_000).chain(near) {
            let (wi, wo) = (narrow(wi), narrow(wo));
            let found = material.eval(wi, wo);
            let wide = |w: [f32; 3]| nalgebra::Vector3::from(w.map(f64::from));
            let exact = material.table().eval(&wide(wi), &wide(wo));
            for (found, exact) in found.iter().zip(exact) {
                worst = worst.max((f64::from(*found) - exact).abs() / (exact + 1e-3));
            }
        }
        assert!(worst < 5e-4, "{name}: {worst:e}");
    }
}

#[test]
fn densities_of_a_table_are_those_of_its_material() {
    let table = table_of("cook-torrance");
    let found = DirectionDensities::of_table(&table).unwrap();
    assert_eq!(&found, made(table).densities());
    let mut values = table_of("lambert").values().to_vec();
    values[5][1] = f32::INFINITY;
    assert!(DirectionDensities::of_table(&BrdfTable::from_values(values).unwrap()).is_err());
}

#[test]
fn the_right_cells_are_read() {
    // Neighbours of a random table have nothing in common.
    let mut random = crate::base::SplitMix64::new(7);
    #[expect(clippy::cast_possible_truncation, reason = "tables are in single precision")]
    let values =
        (0..crate::brdf::N_CELLS).map(|_| [0.0; 3].map(|_: f32| random.next_unit() as f32)).collect();
    let material = made(BrdfTable::from_values(values).unwrap());
    // Every column, where the last pair of columns joins the last one to the first, and the outermost rows.
    let corners = [[1e-4, 0.0], [0.3, 0.7], [0.02, 1.568]];
    for (i, [theta_h, theta_d]) in (0..7200u16).zip(corners.into_iter().cycle()) {
        let phi_d = PI * (f64::from(i) + 0.3) / 7200.0;
        let (wi, wo) = HalfDiff { theta_h, theta_d, phi_d }.to_directions();
        let (wi, wo) = (narrow(wi), narrow(wo));
        let wide = |w: [f32; 3]| nalgebra::Vector3::from(w.map(f64::from));
        let (found, exact) = (material.eval(wi, wo), material.table().eval(&wide(wi), &wide(wo)));
        for (found, exact) in found.iter().zip(exact) {
            assert!((f64::from(*found) - exact).abs() < 3e-3, "{theta_h} {theta_d} {phi_d}: {found} {exact}");
        }
    }
}

#[test]
fn values_are_reciprocal_and_zero_below_the_horizon() {
    let material = made(table_of("cherry-235"));
    for [wi, wo] in pairs(5_000) {
        let (wi, wo) = (narrow(wi), narrow(wo));
        let (forward, backward) = (material.eval(wi, wo), material.eval(wo, wi));
        assert!((0..3).all(|c| (forward[c] - backward[c]).abs() <= 2e-4 * forward[c]), "{wi:?} {wo:?}");
    }
    let (up, side) = ([0.0, 0.0, 1.0], [0.6, 0.0, 0.8]);
    for bad in [[0.0, 0.6, -0.8], [1.0, 0.0, 0.0], [f32::NAN; 3]] {
        assert_eq!(material.eval(bad, side), [0.0; 3]);
        assert_eq!(material.eval(side, bad), [0.0; 3]);
        assert_eq!((material.pdf(bad, up), material.pdf(up, bad)), (0.0, 0.0));
        assert_eq!((material.sample(bad, 0.5, 0.5), material.albedo(bad)), (None, [0.0; 3]));
    }
    // Nothing is promised of these but that they are taken.
    for odd in [[f32::NAN, 0.0, 1.0], [f32::INFINITY; 3], [1e30, -1e30, 1e30], [0.0, 0.0, 1e-30]] {
        assert!(material.eval(odd, side).iter().all(|f| !(*f < 0.0)));
        assert!(!(material.pdf(odd, side) < 0.0) && !(material.pdf(side, odd) < 0.0));
        assert!(material.sample(odd, 0.5, 0.5).is_none_or(|drawn| !(drawn.pdf < 0.0)));
    }
    for u in [-1.0, 0.0, 0.1, 0.999_999_9, 1.0, 7.0, f32::NAN, f32::INFINITY] {
        for wo in [up, side, narrow(direction(FRAC_PI_2 - 1e-6, 1.0))] {
            let Some(drawn) = material.sample(wo, u, u) else { continue };
            assert!(drawn.pdf > 0.0 && drawn.pdf.is_finite() && drawn.wi[2] > 0.0, "{u} {drawn:?}");
            assert!(drawn.weight.iter().all(|w| *w >= 0.0 && w.is_finite()), "{u} {drawn:?}");
        }
    }
}

#[test]
fn many_are_evaluated_like_one() {
    let material = made(table_of("red-plastic"));
    let (mut wi, mut wo): (Vec<_>, Vec<_>) = pairs(1_003).map(|[wi, wo]| (narrow(wi), narrow(wo))).unzip();
    // Some of a block are not above the horizon.
    for (k, bad) in [[0.0, 0.6, -0.8], [1.0, 0.0, 0.0], [f32::NAN; 3]].into_iter().enumerate() {
        (wi[70 + k], wo[80 + k]) = (bad, bad);
    }
    let mut values = vec![[0.0; 3]; wi.len()];
    material.eval_many(&wi, &wo, &mut values);
    let mut densities = vec![0.0; wi.len()];
    material.pdf_many(&wi, &wo, &mut densities);
    let u: Vec<[f32; 2]> = (0..wi.len()).map(|i| [i as f32 / 1_003.0, (i as f32 * 0.618).fract()]).collect();
    let mut drawn = vec![None; wi.len()];
    material.sample_many(&wo, &u, &mut drawn);
    for i in 0..wi.len() {
        assert_eq!(values[i], material.eval(wi[i], wo[i]));
        assert_eq!(densities[i], material.pdf(wi[i], wo[i]));
        assert_eq!(drawn[i], material.sample(wo[i], u[i][0], u[i][1]));
    }
    let mut short = [[0.0; 3]; 40];
    material.eval_many(&wi, &wo, &mut short);
    assert_eq!(short[..], values[..40]);
}

#[test]
fn the_density_is_that_of_the_samples() {
    for name in ["silver-paint", "lambert"] {
        let material = made(table_of(name));
        let (mut worst, mut count) = (0.0f32, 0);
        for (i, [_, wo]) in pairs(20_000).enumerate() {
            let wo = narrow(wo);
            let [a, b, _] = quasi_random(i + 5).map(|u| (u * 16_777_216.0).floor() / 16_777_216.0);
            #[expect(clippy::cast_possible_truncation, reason = "random numbers of single precision")]
            let Some(drawn) = material.sample(wo, a as f32, b as f32) else { continue };
            let length = drawn.wi.iter().map(|x| x * x).sum::<f32>().sqrt();
            assert!((length - 1.0).abs() < 1e-5, "{drawn:?}");
            worst = worst.max((material.pdf(drawn.wi, wo) / drawn.pdf - 1.0).abs());
            count += 1;
        }
        // Rounding of directions is all there is between them; at grazing angles it counts most.
        assert!(worst < 0.02 && count > 19_990, "{name}: {worst} {count}");
    }
}

/// The integral of `f cos theta_i` by the midpoint rule over `theta_i` and `phi_i`, which knows nothing of half
/// vectors.
fn brute_force_albedo(material: &Material, wo: [f32; 3]) -> [f64; 3] {
    let (rows, columns) = (600, 600);
    let mut sum = [0.0; 3];
    for row in 0..rows {
        let theta = FRAC_PI_2 * (f64::from(row) + 0.5) / f64::from(rows);
        for column in 0..columns {
            let wi = narrow(direction(theta, TAU * (f64::from(column) + 0.5) / f64::from(columns)));
            let f = material.eval(wi, wo);
            let weight =
                theta.sin() * theta.cos() * (FRAC_PI_2 / f64::from(rows)) * (TAU / f64::from(columns));
            (0..3).for_each(|c| sum[c] += weight * f64::from(f[c]));
        }
    }
    sum
}

#[test]
fn albedos_are_integrals() {
    for name in ["red-plastic", "blue-metallic-paint"] {
        let material = made(table_of(name));
        for degrees in [0.0f64, 33.0, 61.0, 79.0, 87.0] {
            let wo = narrow(direction(degrees.to_radians(), 0.3));
            let expected = brute_force_albedo(&material, wo);
            for (found, expected) in material.albedo(wo).iter().zip(expected) {
                let error = f64::from(*found) / expected - 1.0;
                assert!(error.abs() < 2e-3, "{name} at {degrees}: {found} {expected}");
            }
        }
    }
}

#[test]
fn energy_is_conserved_where_it_is_asked_for() {
    // Albedos from 0.6 at the normal to several at grazing angles, more in red than in blue.
    let bright = |angles: HalfDiff| {
        let (a, b) = angles.cosines();
        let lobe = 0.4 * (-(angles.theta_h / 0.2).powi(2)).exp() / (a.max(0.02) * b.max(0.02));
        [0.15 + lobe, 0.15 + 0.6 * lobe, 0.15 + 0.3 * lobe]
    };
    let plain = made(BrdfTable::from_fn(bright));
    let conserving =
        Material::new(BrdfTable::from_fn(bright), &MaterialOptions { energy_conserving: true }).unwrap();
    assert!(plain.conserving_factors().is_none());
    let factors = conserving.conserving_factors().unwrap();
    assert!(factors.iter().all(|&s| s > 0.0 && s <= 1.0));
    for degrees in [0.0f64, 20.0, 40.0, 60.0, 75.0, 82.0, 86.5, 88.0] {
        let wo = narrow(direction(degrees.to_radians(), 0.0));
        let (before, after) = (brute_force_albedo(&plain, wo), brute_force_albedo(&conserving, wo));
        assert!(after[0] <= 1.003, "{degrees}: {after:?}");
        if before[0] > 1.3 {
            assert!(after[0] > 0.95, "no darker than needed at {degrees}: {before:?} {after:?}");
        }
        let found = conserving.albedo(wo);
        assert!(
            (0..3).all(|c| (f64::from(found[c]) / after[c] - 1.0).abs() < 4e-3),
            "{degrees}: {found:?} {after:?}"
        );
        let (wi, hue) = ([-0.6, 0.0, 0.8], |f: [f32; 3]| f[0] / f[2]);
        let (a, b) = (plain.eval(wi, wo), conserving.eval(wi, wo));
        assert!((hue(a) / hue(b) - 1.0).abs() < 1e-5);
        let swapped = conserving.eval(wo, wi);
        assert!((b[0] / swapped[0] - 1.0).abs() < 1e-4);
    }
    // What is dark enough stays as it is.
    let dark = Material::new(table_of("cherry-235"), &MaterialOptions { energy_conserving: true }).unwrap();
    assert!(dark.conserving_factors().is_none());
}

#[test]
fn a_lambertian_material_is_sampled_by_the_cosine() {
    let material = made(BrdfTable::from_fn(|_| [0.5 / PI, 0.25 / PI, 0.1 / PI]));
    for degrees in [0.0f64, 40.0, 80.0] {
        let wo = narrow(direction(degrees.to_radians(), 2.0));
        for [wi, _] in pairs(2_000) {
            if wi.z > 0.2 {
                let ratio = f64::from(material.pdf(narrow(wi), wo)) * PI / wi.z;
                assert!((ratio - 1.0).abs() < 0.15, "{degrees} {wi} {ratio}");
            }
        }
        assert!((material.albedo(wo)[0] - 0.5).abs() < 5e-4, "{:?}", material.albedo(wo));
    }
}

#[test]
fn odd_tables_are_taken_or_refused() {
    let black = made(BrdfTable::from_fn(|_| [0.0; 3]));
    let drawn = black.sample([0.0, 0.0, 1.0], 0.3, 0.8).unwrap();
    assert!(drawn.pdf > 0.0 && drawn.weight == [0.0; 3] && black.albedo([0.0, 0.0, 1.0]) == [0.0; 3]);
    let mut values = vec![[0.2; 3]; crate::brdf::N_CELLS];
    values[cell_index(3, 50, 7)] = [-1.0; 3];
    let filled = made(BrdfTable::from_values(values.clone()).unwrap());
    let (wi, wo) = cell_center(3, 50, 7).to_directions();
    assert!((filled.eval(narrow(wi), narrow(wo))[1] - 0.2).abs() < 1e-6);
    values[9] = [1.0, f32::INFINITY, 1.0];
    let error =
        Material::new(BrdfTable::from_values(values).unwrap(), &MaterialOptions::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "values of a table: expected finite numbers, found [1.0, inf, 1.0] in cell 9"
    );
}

#[test]
fn tables_beside_that_of_values_take_less_than_a_mebibyte() {
    let material = made(table_of("lambert"));
    let densities = material.densities();
    let floats = densities.values().len() + densities.conditional().len() + densities.marginal().len();
    let bytes = 4 * floats + 12 * material.albedos().len() + 4 * ALBEDO_VIEWS;
    assert!(bytes <= 1 << 20, "{bytes}");
    assert_eq!(densities.values().len(), VIEWS * ROWS * COLUMNS);
    for square in densities.marginal().chunks(ROWS) {
        assert!(square[0] == 0.0 && (square[ROWS - 1] - 1.0).abs() < 1e-5);
        assert!(square.windows(2).all(|pair| pair[0] <= pair[1]));
    }
}

#[test]
fn a_brdf_that_is_not_reciprocal_is_made_so() {
    struct Skewed;
    impl Brdf for Skewed {
        fn eval(&self, wi: &nalgebra::Vector3<f64>, _: &nalgebra::Vector3<f64>) -> crate::Rgb {
            [wi.z.max(0.0); 3]
        }
    }
    let material = Material::from_brdf(&Skewed, &MaterialOptions::default()).unwrap();
    let (wi, wo) = ([0.0, 0.6, 0.8], [0.8, 0.0, 0.6]);
    assert!((material.eval(wi, wo)[0] - 0.7).abs() < 2e-3, "{:?}", material.eval(wi, wo));
}
