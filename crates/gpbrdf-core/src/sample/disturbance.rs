//! Disturbances: what an instrument adds to the values that it measures.

use crate::base::error::{Error, Result};
use crate::base::random::SplitMix64;
use crate::sample::set::SampleSet;

/// Noise and outliers of measured values.
///
/// The value of channel `c` of sample `i` becomes `f exp(R g) s`, with `g` standard normal and independent
/// for every `i` and `c`, and `s` the outlier factor where `i` is an outlier and 1 elsewhere. This is noise
/// with the relative standard deviation `R`, as `R` is small, and leaves the median of a value where it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance {
    /// `R`, the standard deviation of `ln f`; 0 for none.
    pub noise: f64,
    /// Number of samples, drawn without replacement, that are outliers.
    pub outliers: usize,
    /// What the value of an outlier is multiplied by, in all channels.
    pub outlier_factor: f64,
    /// Seed of the random numbers. Noise and outliers have a sequence each, so that neither depends on the
    /// other, nor on directions that were drawn from the same seed.
    pub seed: u64,
}

impl Default for Disturbance {
    /// No noise, and no outliers; they would be ten times as large as they should.
    fn default() -> Self {
        Self { noise: 0.0, outliers: 0, outlier_factor: 10.0, seed: 0 }
    }
}

/// Which sequence of a seed is used for what.
const NOISE: u64 = 1;
const OUTLIERS: u64 = 2;

impl Disturbance {
    /// Disturbs the values of `samples` and returns the indices of the outliers in increasing order.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for noise that is negative or not finite, for an outlier factor that is not
    /// a positive number, for more outliers than samples, and for a disturbed value that no file can hold
    /// because it is negative or larger than the largest f32. The samples are left alone then.
    pub fn apply(&self, samples: &mut SampleSet) -> Result<Vec<usize>> {
        if !(self.noise >= 0.0 && self.noise.is_finite()) {
            return Err(Error::argument("noise", "a number of at least 0", self.noise));
        }
        if !(self.outlier_factor > 0.0 && self.outlier_factor.is_finite()) {
            return Err(Error::argument("outlier factor", "a positive number", self.outlier_factor));
        }
        if self.outliers > samples.len() {
            let expected = format!("at most {}, the number of samples", samples.len());
            return Err(Error::argument("number of outliers", expected, self.outliers));
        }
        let mut values = samples.values.clone();
        if self.noise > 0.0 {
            let mut random = SplitMix64::stream(self.seed, NOISE);
            for value in values.as_flattened_mut() {
                *value *= (self.noise * random.next_normal()).exp();
            }
        }
        let mut outliers: Vec<usize> = (0..samples.len()).collect();
        SplitMix64::stream(self.seed, OUTLIERS).draw_to_front(&mut outliers, self.outliers);
        outliers.truncate(self.outliers);
        outliers.sort_unstable();
        for &index in &outliers {
            values[index] = values[index].map(|x| x * self.outlier_factor);
        }
        if let Some(value) = values.as_flattened().iter().find(|x| !(0.0..=f64::from(f32::MAX)).contains(*x))
        {
            return Err(Error::argument("measured value", "0 to 3.4e38, the largest f32", value));
        }
        samples.values = values;
        Ok(outliers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::angles::HalfDiff;

    fn samples(count: usize) -> SampleSet {
        let values = (0..count).map(|i| [0.1 + i as f64, 1.0, 1e-3]).collect();
        SampleSet { angles: vec![HalfDiff::default(); count], values, ..SampleSet::default() }
    }

    #[test]
    fn noise_has_the_relative_deviation_that_was_asked_for() {
        let clean = samples(20_000);
        let mut noisy = clean.clone();
        let noise = Disturbance { noise: 0.03, seed: 4, ..Disturbance::default() };
        assert!(noise.apply(&mut noisy).unwrap().is_empty());
        let ratios: Vec<[f64; 3]> = std::iter::zip(&noisy.values, &clean.values)
            .map(|(a, b)| std::array::from_fn(|c| (a[c] / b[c]).ln()))
            .collect();
        let mean = |of: &dyn Fn(&[f64; 3]) -> f64| ratios.iter().map(of).sum::<f64>() / 20_000.0;
        for c in 0..3 {
            assert!(mean(&|r| r[c]).abs() < 1.1e-3);
            assert!((mean(&|r| r[c] * r[c]).sqrt() / 0.03 - 1.0).abs() < 0.03);
            let other = (c + 1) % 3;
            assert!((mean(&|r| r[c] * r[other]) / 0.03f64.powi(2)).abs() < 0.04, "channels are independent");
        }
        let mut again = clean.clone();
        noise.apply(&mut again).unwrap();
        assert_eq!(noisy, again);
        Disturbance { seed: 5, ..noise }.apply(&mut again).unwrap();
        assert_ne!(noisy, again);
    }

    #[test]
    fn outliers_are_distinct_and_do_not_depend_on_the_noise() {
        let clean = samples(300);
        let outliers = Disturbance { outliers: 15, seed: 4, ..Disturbance::default() };
        let mut disturbed = clean.clone();
        let found = outliers.apply(&mut disturbed).unwrap();
        assert!(found.len() == 15 && found.windows(2).all(|pair| pair[0] < pair[1]), "{found:?}");
        for i in 0..300 {
            let factor = if found.contains(&i) { 10.0 } else { 1.0 };
            assert_eq!(disturbed.values[i], clean.values[i].map(|x| x * factor));
        }
        let mut noisy = clean.clone();
        assert_eq!(Disturbance { noise: 0.1, ..outliers }.apply(&mut noisy).unwrap(), found);
        assert_ne!(Disturbance { seed: 6, ..outliers }.apply(&mut noisy).unwrap(), found);
        let all = Disturbance { outliers: 300, ..outliers }.apply(&mut noisy).unwrap();
        assert!(all.into_iter().eq(0..300));
        let mut same = clean.clone();
        assert!(Disturbance::default().apply(&mut same).unwrap().is_empty());
        assert_eq!(same, clean);
    }

    #[test]
    fn disturbances_without_a_meaning_are_refused() {
        let default = Disturbance::default();
        for (wrong, message) in [
            (Disturbance { noise: -0.1, ..default }, "noise: expected a number of at least 0, found -0.1"),
            (Disturbance { noise: f64::NAN, ..default }, "noise: expected a number of at least 0, found NaN"),
            (
                Disturbance { noise: f64::INFINITY, ..default },
                "noise: expected a number of at least 0, found inf",
            ),
            (
                Disturbance { noise: 1e6, ..default },
                "measured value: expected 0 to 3.4e38, the largest f32, found inf",
            ),
            (
                Disturbance { outlier_factor: 0.0, ..default },
                "outlier factor: expected a positive number, found 0",
            ),
            (
                Disturbance { outliers: 9, ..default },
                "number of outliers: expected at most 8, the number of samples, found 9",
            ),
        ] {
            let mut found = samples(8);
            assert_eq!(wrong.apply(&mut found).unwrap_err().to_string(), message);
            assert_eq!(found, samples(8));
        }
    }
}
