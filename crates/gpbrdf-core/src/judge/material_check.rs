//! Whether a material is one that a renderer can rely on: reciprocal, positive, without gaps, not brighter than its
//! light, and sampled as its density says.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;

use crate::base::error::Result;
use crate::base::random::SplitMix64;
use crate::base::{ChiSquare, chi_square};
use crate::brdf::{
    Brdf, BrdfTable, GRAZING_COSINE, LUMINANCE_WEIGHTS, N_CELLS, cell_center, cell_indices, direction,
};
use crate::material::{Material, MaterialOptions};

/// Elevations of `wo` at which sampling is tested, degrees.
pub const CHECK_VIEWS: [f64; 8] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 82.0, 88.0];

/// Azimuth of `wo` in these tests, radians: no axis of anything.
const AZIMUTH: f64 = 0.4;

/// Bins over `theta_i` and `phi_i` in which drawn directions are counted.
const BINS: [usize; 2] = [80, 160];

/// Fewest directions that are expected in a bin or a pool of bins.
const LEAST_EXPECTED: f64 = 5.0;

/// Probability that correct sampling fails one of all the tests of a material.
const SIGNIFICANCE: f64 = 0.01;

/// Largest median of relative differences between `f(wi, wo)` and `f(wo, wi)`.
const MOST_MEDIAN_DIFFERENCE: f64 = 0.05;

/// How far an albedo may exceed 1 and an integral of a density miss it.
const TOLERANCE: f64 = 1e-3;

/// Added to denominators of relative differences of `f`, sr^-1.
const FLOOR: f64 = 1e-3;

/// How a [`MaterialCheck`] is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CheckOptions {
    /// Directions drawn at each of [`CHECK_VIEWS`].
    pub samples: usize,
    /// Pairs of directions at which reciprocity and positivity are tested.
    pub pairs: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// What the material is made to be before its energy and its sampling are tested.
    pub material: MaterialOptions,
}

impl Default for CheckOptions {
    fn default() -> Self {
        Self { samples: 1_000_000, pairs: 20_000, seed: 1, material: MaterialOptions::default() }
    }
}

/// Relative differences `|f(wi, wo) - f(wo, wi)| / ((f(wi, wo) + f(wo, wi)) / 2 + 0.001)` of the channel in which they
/// are largest, over random pairs with both cosines above 0.08.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Reciprocity {
    /// The largest.
    pub largest: f64,
    /// The median.
    pub median: f64,
    /// `theta_i`, `theta_o` and the azimuth between both where it is largest, degrees.
    pub largest_at: [f64; 3],
}

/// The largest albedo over all elevations and channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Energy {
    /// The albedo.
    pub largest_albedo: f64,
    /// Elevation of `wo` there, degrees from the normal.
    pub theta_o: f64,
    /// Channel: 0 is red, 1 green, 2 blue.
    pub channel: usize,
}

/// The sampling at one elevation of `wo`. Weights are of luminance, in units of its albedo, so that their mean is 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SamplingCheck {
    /// Elevation of `wo`, degrees from the normal.
    pub theta_o: f64,
    /// Albedo of each channel.
    pub albedo: [f32; 3],
    /// Probability of a chi-square statistic as large as the one that was found, if sampling is right.
    pub p_value: f64,
    /// Bins of the test after pooling, minus one.
    pub degrees_of_freedom: usize,
    /// Integral of the density.
    pub pdf_integral: f64,
    /// Mean of the weights.
    pub mean_weight: f64,
    /// Variance of the weights.
    pub variance: f64,
    /// Variance of the weights if directions are drawn in proportion to the cosine.
    pub cosine_variance: f64,
    /// The weight that 99.9 % of the samples do not exceed.
    pub weight_999: f64,
    /// The largest weight.
    pub largest_weight: f64,
}

/// What was found about a material.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaterialCheck {
    /// Reciprocity of the BRDF as it was measured.
    pub reciprocity: Reciprocity,
    /// Random pairs of directions at which the BRDF as it was measured has a negative channel or one that is no finite
    /// number.
    pub bad_values: usize,
    /// Cells of the table above the horizon that have no data.
    pub missing_cells: usize,
    /// Energy of the material.
    pub energy: Energy,
    /// Sampling at each of [`CHECK_VIEWS`].
    pub sampling: Vec<SamplingCheck>,
    /// What does not hold, in words; empty where all does.
    pub failures: Vec<String>,
}

impl MaterialCheck {
    /// Checks a BRDF and the material of its table.
    ///
    /// Cost: at each of [`CHECK_VIEWS`], one sample for each of `options.samples` and about two million densities.
    ///
    /// # Errors
    /// Those of [`Material::new`].
    pub fn new(brdf: &dyn Brdf, table: &BrdfTable, options: &CheckOptions) -> Result<Self> {
        let material = Material::new(table.clone(), &options.material)?;
        let (reciprocity, bad_values) = reciprocity(brdf.as_measured().unwrap_or(brdf), options);
        let sampling: Vec<SamplingCheck> = CHECK_VIEWS
            .into_par_iter()
            .enumerate()
            .map(|(k, theta_o)| {
                check_sampling(&material, theta_o, options.samples, options.seed ^ (k as u64) << 32)
            })
            .collect();
        let mut check = Self {
            reciprocity,
            bad_values,
            missing_cells: missing_cells(table),
            energy: energy(&material),
            sampling,
            failures: Vec::new(),
        };
        check.failures = check.find_failures();
        Ok(check)
    }

    fn find_failures(&self) -> Vec<String> {
        let mut failures = Vec::new();
        if !(self.reciprocity.median <= MOST_MEDIAN_DIFFERENCE) {
            failures.push(format!(
                "reciprocity: expected a median difference of at most {:.0} %, found {:.1} %",
                100.0 * MOST_MEDIAN_DIFFERENCE,
                100.0 * self.reciprocity.median
            ));
        }
        if self.bad_values > 0 {
            failures.push(format!(
                "values: expected finite numbers, none negative, found others at {} pairs of directions",
                self.bad_values
            ));
        }
        if self.missing_cells > 0 {
            failures
                .push(format!("table: expected data in every cell, found {} without", self.missing_cells));
        }
        if !(self.energy.largest_albedo <= 1.0 + TOLERANCE) {
            failures.push(format!(
                "energy: expected albedos of at most 1, found {:.3} at {:.1} degrees",
                self.energy.largest_albedo, self.energy.theta_o
            ));
        }
        let level = sidak(SIGNIFICANCE, self.sampling.len());
        for view in &self.sampling {
            if !(view.p_value >= level) {
                failures.push(format!(
                    "sampling at {} degrees: expected directions that follow their density, found p = {:.1e}",
                    view.theta_o, view.p_value
                ));
            }
            if !((view.pdf_integral - 1.0).abs() <= TOLERANCE) {
                failures.push(format!(
                    "density at {} degrees: expected an integral of 1, found {:.4}",
                    view.theta_o, view.pdf_integral
                ));
            }
        }
        failures
    }
}

/// The level at which each of `tests` independent tests is done so that all of them pass with a probability of
/// `1 - significance` (Z. Sidak, 1967).
#[must_use]
pub fn sidak(significance: f64, tests: usize) -> f64 {
    -((-significance).ln_1p() / tests.max(1) as f64).exp_m1()
}

/// Cells above the horizon without data.
fn missing_cells(table: &BrdfTable) -> usize {
    let is_missing = |&cell: &usize| {
        let (h, d, p) = cell_indices(cell);
        !table.values()[cell].iter().all(|&x| x >= 0.0) && cell_center(h, d, p).is_above_horizon()
    };
    (0..N_CELLS).into_par_iter().filter(is_missing).count()
}

/// Reciprocity, and the count of pairs with values that are negative or not finite.
fn reciprocity(brdf: &dyn Brdf, options: &CheckOptions) -> (Reciprocity, usize) {
    let mut random = SplitMix64::stream(options.seed, 1);
    let mut drawn = || {
        // Uniform over the solid angle above the grazing cosine.
        let cosine = GRAZING_COSINE + (1.0 - GRAZING_COSINE) * random.next_unit();
        direction(cosine.acos(), TAU * random.next_unit())
    };
    let mut found: Vec<(f64, [f64; 3])> = Vec::with_capacity(options.pairs);
    let mut bad = 0;
    for _ in 0..options.pairs {
        let (wi, wo) = (drawn(), drawn());
        let (forward, backward) = (brdf.eval(&wi, &wo), brdf.eval(&wo, &wi));
        bad += usize::from(forward.iter().chain(&backward).any(|&x| !(x >= 0.0 && x.is_finite())));
        let difference = (0..3)
            .map(|c| (forward[c] - backward[c]).abs() / (0.5 * (forward[c] + backward[c]).abs() + FLOOR))
            .fold(0.0, f64::max);
        let azimuth = (wi.y.atan2(wi.x) - wo.y.atan2(wo.x)).to_degrees().rem_euclid(360.0);
        found.push((difference, [wi.z.acos().to_degrees(), wo.z.acos().to_degrees(), azimuth]));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let median = found.get(found.len() / 2).map_or(0.0, |at| at.0);
    let (largest, largest_at) = found.last().copied().unwrap_or_default();
    (Reciprocity { largest, median, largest_at }, bad)
}

/// The largest albedo over half a degree of elevation each and all channels.
fn energy(material: &Material) -> Energy {
    let mut energy = Energy::default();
    for step in 0..180 {
        let theta_o = 0.5 * f64::from(step);
        let albedo = material.albedo(narrow(direction(theta_o.to_radians(), 0.0)));
        for (channel, albedo) in albedo.into_iter().map(f64::from).enumerate() {
            if albedo > energy.largest_albedo {
                energy = Energy { largest_albedo: albedo, theta_o, channel };
            }
        }
    }
    energy
}

/// Tests the sampling at one elevation.
pub(crate) fn check_sampling(material: &Material, theta_o: f64, samples: usize, seed: u64) -> SamplingCheck {
    let wo = narrow(direction(theta_o.to_radians(), AZIMUTH));
    let luminance = |rgb: [f32; 3]| -> f64 { (0..3).map(|c| LUMINANCE_WEIGHTS[c] * f64::from(rgb[c])).sum() };
    let albedo = material.albedo(wo);
    let scale = luminance(albedo).max(f64::MIN_POSITIVE);
    let mut random = SplitMix64::new(seed);
    let mut counts = vec![0.0; BINS[0] * BINS[1]];
    let mut weights = Vec::with_capacity(samples);
    let (mut sum, mut squares, mut cosine_squares) = (0.0, 0.0, 0.0);
    for _ in 0..samples {
        let Some(drawn) = material.sample(wo, unit(&mut random), unit(&mut random)) else { continue };
        counts[bin(drawn.wi)] += 1.0;
        let weight = luminance(drawn.weight) / scale;
        sum += weight;
        squares += weight * weight;
        // The second moment of pi f under the density cos / pi, by the samples at hand.
        cosine_squares += weight * PI * luminance(material.eval(drawn.wi, wo)) / scale;
        weights.push(weight);
    }
    let count = samples.max(1) as f64;
    let expected: Vec<f64> = (0..BINS[0] * BINS[1]).map(|at| integral(material, wo, at)).collect();
    let pdf_integral = expected.iter().sum();
    let ChiSquare { p_value, degrees_of_freedom, .. } = chi_square(&counts, &expected, LEAST_EXPECTED);
    weights.sort_by(f64::total_cmp);
    let mean_weight = sum / count;
    SamplingCheck {
        theta_o,
        albedo,
        p_value,
        degrees_of_freedom,
        pdf_integral,
        mean_weight,
        variance: squares / count - mean_weight * mean_weight,
        cosine_variance: cosine_squares / count - mean_weight * mean_weight,
        weight_999: weights.get(weights.len() * 999 / 1000).copied().unwrap_or(0.0),
        largest_weight: weights.last().copied().unwrap_or(0.0),
    }
}

/// The bin of a direction.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "angles are within their ranges")]
fn bin(wi: [f32; 3]) -> usize {
    let [x, y, z] = wi.map(f64::from);
    let theta = x.hypot(y).atan2(z) / FRAC_PI_2;
    let phi = y.atan2(x) / TAU + 0.5;
    let row = ((theta * BINS[0] as f64) as usize).min(BINS[0] - 1);
    let column = ((phi * BINS[1] as f64) as usize).min(BINS[1] - 1);
    row * BINS[1] + column
}

/// Nodes in `[0, 1]` and weights of the Gauss-Legendre rule of four points.
const GAUSS: [[f64; 2]; 4] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_92],
    [0.330_009_478_207_571_87, 0.326_072_577_431_273_1],
    [0.669_990_521_792_428_1, 0.326_072_577_431_273_1],
    [0.930_568_155_797_026_3, 0.173_927_422_568_726_92],
];

/// Halvings of a bin along both sides at most.
const DEPTH: usize = 7;

/// Where the integral over a part of a bin and the sum over its quarters differ by less, the sum is taken.
const INTEGRAL_TOLERANCE: f64 = 2e-8;

/// The integral of the density over one bin, by Gauss-Legendre rules on parts that are halved until they agree.
fn integral(material: &Material, wo: [f32; 3], at: usize) -> f64 {
    let step = [FRAC_PI_2 / BINS[0] as f64, TAU / BINS[1] as f64];
    let corner = [(at / BINS[1]) as f64 * step[0], (at % BINS[1]) as f64 * step[1] - PI];
    let whole = gauss(material, wo, corner, step);
    refined(material, wo, corner, step, whole, 0)
}

fn refined(
    material: &Material,
    wo: [f32; 3],
    corner: [f64; 2],
    step: [f64; 2],
    whole: f64,
    depth: usize,
) -> f64 {
    let half = [0.5 * step[0], 0.5 * step[1]];
    let corners = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]]
        .map(|[a, b]| [corner[0] + a * half[0], corner[1] + b * half[1]]);
    let quarters = corners.map(|corner| gauss(material, wo, corner, half));
    let sum = quarters.iter().sum::<f64>();
    if depth == DEPTH || (sum - whole).abs() < INTEGRAL_TOLERANCE {
        return sum;
    }
    corners
        .iter()
        .zip(quarters)
        .map(|(&corner, whole)| refined(material, wo, corner, half, whole, depth + 1))
        .sum()
}

/// The integral over a rectangle of `theta_i` and `phi_i`.
fn gauss(material: &Material, wo: [f32; 3], corner: [f64; 2], step: [f64; 2]) -> f64 {
    let phis = GAUSS.map(|[at, _]| (corner[1] + at * step[1]).sin_cos());
    let mut sum = 0.0;
    for [at, weight] in GAUSS {
        let (sine, cosine) = (corner[0] + at * step[0]).sin_cos();
        for ((sin_phi, cos_phi), [_, across]) in phis.iter().zip(GAUSS) {
            let wi = narrow(Vector3::new(sine * cos_phi, sine * sin_phi, cosine));
            sum += weight * across * sine * f64::from(material.pdf(wi, wo));
        }
    }
    sum * step[0] * step[1]
}

#[expect(clippy::cast_possible_truncation, reason = "materials are in single precision")]
fn narrow(w: Vector3<f64>) -> [f32; 3] {
    [w.x as f32, w.y as f32, w.z as f32]
}

/// The next number of single precision, uniform on `[0, 1)`.
fn unit(random: &mut SplitMix64) -> f32 {
    (random.next_u64() >> 40) as f32 / (1u32 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::material;

    fn table_of(name: &str) -> BrdfTable {
        let brdf = crate::brdf::Reciprocal { inner: material(name).unwrap().brdf, min_cosine: 1e-3 };
        BrdfTable::from_fn(|angles| brdf.eval_half_diff(angles))
    }

    fn made(table: BrdfTable) -> Material {
        Material::new(table, &MaterialOptions::default()).unwrap()
    }

    /// Sampling is right at every view, and as good as the documentation says.
    fn follows_its_density(name: &str, material: &Material, views: &[f64], samples: usize, level: f64) {
        for (k, &theta_o) in views.iter().enumerate() {
            let found = check_sampling(material, theta_o, samples, 7 + k as u64);
            assert!(found.p_value >= level, "{name}: {found:?}");
            assert!(found.degrees_of_freedom > 100 || theta_o > 80.0, "{name}: {found:?}");
            assert!((found.pdf_integral - 1.0).abs() < 1e-3, "{name}: {found:?}");
            // Six standard deviations of the mean, and what interpolates albedos between elevations.
            let bound = 6.0 * (found.variance.max(0.0) / samples as f64).sqrt() + 3e-3;
            assert!((found.mean_weight - 1.0).abs() < bound, "{name}: {found:?}");
        }
    }

    #[test]
    fn samples_follow_their_density() {
        let views = [0.0, 45.0, 88.0];
        let names = ["cherry-235", "cook-torrance", "violet-rubber"];
        let level = sidak(SIGNIFICANCE, names.len() * views.len());
        for name in names {
            follows_its_density(name, &made(table_of(name)), &views, 200_000, level);
        }
    }

    #[test]
    fn a_wrong_density_is_noticed() {
        let material = made(table_of("cherry-235"));
        let (wo, other) = ([0.6, 0.0, 0.8], [0.64, 0.0, 0.768_375]);
        let mut random = SplitMix64::new(4);
        let mut counts = vec![0.0; BINS[0] * BINS[1]];
        for _ in 0..200_000 {
            if let Some(drawn) = material.sample(wo, unit(&mut random), unit(&mut random)) {
                counts[bin(drawn.wi)] += 1.0;
            }
        }
        let p_value = |wo| {
            let expected: Vec<f64> = (0..counts.len()).map(|at| integral(&material, wo, at)).collect();
            chi_square(&counts, &expected, LEAST_EXPECTED).p_value
        };
        assert!(p_value(wo) > 1e-3 && p_value(other) < 1e-12, "{} {}", p_value(wo), p_value(other));
    }

    /// All built-in materials and all measured ones: takes minutes.
    #[test]
    #[cfg(feature = "formats")]
    #[ignore = "takes minutes: cargo test --release -p gpbrdf-core all_materials -- --ignored"]
    fn all_materials_are_sampled_as_their_density_says() {
        let mut all: Vec<(String, BrdfTable)> =
            crate::brdf::materials().iter().map(|m| (m.name.to_owned(), table_of(m.name))).collect();
        if let Some(data) = crate::test_data::data_dir() {
            let folder = std::fs::read_dir(data.join("rgl")).unwrap();
            let mut paths: Vec<_> = folder.map(|entry| entry.unwrap().path()).collect();
            paths.retain(|path| path.extension().is_some_and(|e| e == "bsdf"));
            paths.sort();
            for path in paths {
                let source = crate::Source::open(&path).unwrap();
                all.push((source.name.clone(), source.table().unwrap().into_owned()));
            }
        }
        let level = sidak(SIGNIFICANCE, all.len() * CHECK_VIEWS.len());
        all.into_par_iter().for_each(|(name, table)| {
            follows_its_density(&name, &made(table), &CHECK_VIEWS, 1_000_000, level);
        });
    }

    #[test]
    fn what_does_not_hold_is_said() {
        /// Twice as bright from one side, and more than the light.
        struct Broken;
        impl Brdf for Broken {
            fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> [f64; 3] {
                let value = if wi.x > wo.x { 1.0 } else { 0.5 };
                [value, if wi.z > 0.99 { -1.0 } else { 0.2 }, 0.1]
            }
        }
        let mut values = BrdfTable::from_fn(|_| [1.0, 0.2, 0.1]).values().to_vec();
        values[..500].fill([-1.0; 3]);
        let table = BrdfTable::from_values(values).unwrap();
        let options = CheckOptions { samples: 20_000, pairs: 2_000, ..CheckOptions::default() };
        let check = MaterialCheck::new(&Broken, &table, &options).unwrap();
        assert_eq!(check.failures.len(), 4, "{:?}", check.failures);
        assert!((check.reciprocity.median - 0.5 / 0.751).abs() < 1e-6, "{:?}", check.reciprocity);
        assert!(check.bad_values > 0 && check.missing_cells == 500);
        assert!((check.energy.largest_albedo / PI - 1.0).abs() < 2e-3 && check.energy.channel == 0);
        let conserving = MaterialOptions { energy_conserving: true };
        let check =
            MaterialCheck::new(&Broken, &table, &CheckOptions { material: conserving, ..options }).unwrap();
        assert!(check.energy.largest_albedo < 1.001, "{:?}", check.energy);
    }

    #[test]
    fn sidak_levels_multiply_to_the_significance() {
        let level = sidak(0.01, 160);
        assert!(((1.0 - level).powi(160) - 0.99).abs() < 1e-12 && (level - 6.28e-5).abs() < 1e-7);
    }
}
