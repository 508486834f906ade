//! How much wider intervals must be than a process says by itself: what happens to the samples says it.

use serde::{Deserialize, Serialize};

#[cfg(feature = "fit")]
use {
    super::NEAREST,
    super::conditional::{Process, Scratch},
    super::neighbours::Embedded,
    crate::base::error::Result,
    crate::base::watch::Watch,
    crate::brdf::angles::HalfDiff,
    crate::sample::space::InputSpace,
    rayon::prelude::*,
};

/// Number of powers of two at which factors are known.
const OCTAVES: usize = 11;

/// Factors of the standard deviation of the noise-free function, by how much the samples leave open: at standard
/// deviations of `2^-10`, `2^-9`, ... 1 of the kernel's own, linear between them in the logarithm and constant beyond.
///
/// A process takes its hyper-parameters as certain and its function as equally smooth everywhere. Where no sample is
/// near, its intervals are therefore too narrow: the lobes of a material are steeper than what the kernel learns from
/// all of its samples. So regions of all sizes are left out around some of the samples, each of these is predicted
/// from the samples outside of its region, and a factor is the one with which 95 % intervals would have held 95 % of
/// the samples that were predicted about as uncertainly. Leaving out single samples alone would say nothing about
/// directions that are farther from all samples than these are from each other. Highlights have factors of their own.
/// Source of the principle: D. R. Roberts et al., "Cross-validation strategies for data with temporal, spatial,
/// hierarchical, or phylogenetic structure" (2017).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Widening {
    /// The first coordinate of the kernel at [`HIGHLIGHT`].
    edge: f64,
    /// Factors far below the edge and far above it.
    highlight: [f64; OCTAVES],
    rest: [f64; OCTAVES],
}

/// The polar angle of half vectors at which a highlight ends, in degrees.
#[cfg(feature = "fit")]
const HIGHLIGHT: f64 = 15.0;

/// The width of the transition between both kinds of factors, relative to the edge.
const TRANSITION: f64 = 0.5;

impl Default for Widening {
    /// No change.
    fn default() -> Self {
        Self { edge: 1.0, highlight: [1.0; OCTAVES], rest: [1.0; OCTAVES] }
    }
}

impl Widening {
    /// Whether all factors are finite numbers of at least 1, and the edge a positive number.
    pub(super) fn is_valid(&self) -> bool {
        let mut factors = self.highlight.iter().chain(&self.rest);
        factors.all(|factor| *factor >= 1.0 && factor.is_finite()) && self.edge > 0.0 && self.edge.is_finite()
    }

    /// The variance of the noise-free function at a point whose first coordinate is `x`, where the process says
    /// `variance`, and `prior` without any samples.
    pub(super) fn widened(&self, x: f64, variance: f64, prior: f64) -> f64 {
        let at = octave(variance, prior);
        if !at.is_finite() {
            return variance;
        }
        let below = OCTAVES - 2 - (0..OCTAVES - 2).rev().filter(|&k| at < (k + 1) as f64).count();
        let t = at - below as f64;
        let of = |factors: &[f64; OCTAVES]| (1.0 - t) * factors[below] + t * factors[below + 1];
        let outside = ((x / self.edge - 1.0) / TRANSITION + 0.5).clamp(0.0, 1.0);
        let factor = (1.0 - outside) * of(&self.highlight) + outside * of(&self.rest);
        factor * factor * variance
    }
}

/// The place of a variance among the factors, 0 to `OCTAVES - 1`.
fn octave(variance: f64, prior: f64) -> f64 {
    let last = (OCTAVES - 1) as f64;
    (0.5 * (variance / prior).log2() + last).clamp(0.0, last)
}

/// Number of samples around which regions are left out, in the highlight and elsewhere.
#[cfg(feature = "fit")]
const CENTRES: [usize; 2] = [100, 200];

/// Radii of the regions in length scales. In the first one there is only the centre.
#[cfg(feature = "fit")]
const RADII: [f64; 9] = [0.0, 0.05, 0.1, 0.2, 0.3, 0.45, 0.7, 1.0, 1.5];

/// The fewest samples outside of a region from which its centre is predicted.
#[cfg(feature = "fit")]
const FEWEST: usize = 4;

/// The half width, in octaves, of the band of predictions that tell a factor, and how many there must be at least.
#[cfg(feature = "fit")]
const BAND: f64 = 0.5;
#[cfg(feature = "fit")]
const ENOUGH: usize = 60;

/// Half the width of a 95 % interval of a normal distribution, in standard deviations.
#[cfg(feature = "fit")]
const Z_95: f64 = 1.959_963_984_540_054;

/// A sample as it is predicted from outside of a region around it.
#[cfg(feature = "fit")]
#[derive(Clone, Debug)]
struct Predicted {
    in_highlight: bool,
    /// One residual per channel.
    residuals: Vec<f64>,
    /// The variance of the noise-free function, and that of the sample's noise.
    latent: f64,
    noise: f64,
}

#[cfg(feature = "fit")]
impl Widening {
    /// The factors for targets `y`, one column per channel, in coordinates of a space. Samples whose weights are
    /// below 1 are not predicted. Cost: up to 2,700 conditionals on 48 samples and as many times the distances to all
    /// of them.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled) where the observer stops the work.
    pub(super) fn measured(
        process: &Process<'_>,
        y: &[Vec<f64>],
        weights: &[f64],
        space: InputSpace,
        watch: &Watch,
    ) -> Result<Self> {
        let top = HalfDiff { theta_h: HIGHLIGHT.to_radians(), theta_d: 0.0, phi_d: 0.0 };
        let edge = space.coordinates(top)[0];
        let embedded = Embedded::new(process.x, process.kernel);
        let in_highlight = |i: usize| process.point(i)[0] < edge;
        let trusted = || (0..weights.len()).filter(|&i| weights[i] >= 1.0);
        let [of_highlight, of_rest] = CENTRES;
        let centres: Vec<usize> = (trusted().filter(|&i| in_highlight(i)).take(of_highlight))
            .chain(trusted().filter(|&i| !in_highlight(i)).take(of_rest))
            .collect();
        let steps = watch.steps(centres.len());
        let predicted = centres
            .into_par_iter()
            .map_init(
                || Scratch::new(process.kernel),
                |scratch, centre| {
                    steps.take()?;
                    let found = RADII.iter().filter_map(|radius| {
                        let given = embedded.nearest_outside(centre, *radius, NEAREST);
                        if given.len() < FEWEST {
                            return None;
                        }
                        let (b, latent) = scratch.condition(process, centre, &given);
                        let mean =
                            |y: &[f64]| b.iter().zip(&given).map(|(b, &j)| b * y[j as usize]).sum::<f64>();
                        Some(Predicted {
                            in_highlight: in_highlight(centre),
                            residuals: y.iter().map(|y| y[centre] - mean(y)).collect(),
                            latent,
                            noise: process.noise[centre],
                        })
                    });
                    Ok(found.collect())
                },
            )
            .collect::<Result<Vec<Vec<Predicted>>>>()?;
        Ok(Self::of(&predicted.concat(), edge, process.kernel.prior_variance()))
    }

    /// The factors with which 95 % intervals hold 95 % of the residuals.
    fn of(predicted: &[Predicted], edge: f64, prior: f64) -> Self {
        // The place of each variance, and the factor with which the interval of a residual just reaches it.
        let needed = |is_meant: &dyn Fn(&Predicted) -> bool| -> Vec<(f64, f64)> {
            let meant = predicted.iter().filter(|sample| sample.latent > 0.0 && is_meant(sample));
            meant
                .flat_map(|sample| {
                    let at = octave(sample.latent, prior);
                    let needed = |r: &f64| ((r / Z_95).powi(2) - sample.noise).max(0.0) / sample.latent;
                    sample.residuals.iter().map(move |r| (at, needed(r).sqrt()))
                })
                .collect()
        };
        let [all, highlight, rest] = [
            needed(&|_| true),
            needed(&|sample| sample.in_highlight),
            needed(&|sample| !sample.in_highlight),
        ];
        let of = |needed: &[(f64, f64)]| -> [f64; OCTAVES] {
            std::array::from_fn(|k| quantile(needed, k).or_else(|| quantile(&all, k)).unwrap_or(1.0).max(1.0))
        };
        let found = Self { edge, highlight: of(&highlight), rest: of(&rest) };
        if found.is_valid() { found } else { Self::default() }
    }
}

/// The factor that 95 % of the needed ones do not exceed about an octave. `None` where there are too few.
#[cfg(feature = "fit")]
fn quantile(needed: &[(f64, f64)], octave: usize) -> Option<f64> {
    let near = |(at, _): &&(f64, f64)| (at - octave as f64).abs() <= BAND;
    let mut factors: Vec<f64> = needed.iter().filter(near).map(|(_, factor)| *factor).collect();
    factors.sort_unstable_by(f64::total_cmp);
    (factors.len() >= ENOUGH).then(|| factors[95 * factors.len() / 100])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_linear_between_octaves_and_constant_beyond() {
        let rising: [f64; OCTAVES] = std::array::from_fn(|k| [1.0, 2.0, 4.0][k.saturating_sub(OCTAVES - 3)]);
        let widening = Widening { edge: 0.4, highlight: [3.0; OCTAVES], rest: rising };
        let factor = |x: f64, deviation: f64| {
            (widening.widened(x, 9.0 * deviation * deviation, 9.0) / 9.0).sqrt() / deviation
        };
        let beyond = [(1e-9, 1.0), (0.25, 1.0), (0.5, 2.0), (0.5f64.sqrt(), 3.0), (1.0, 4.0), (2.0, 4.0)];
        for (deviation, expected) in beyond {
            assert!((factor(0.8, deviation) - expected).abs() < 1e-12, "{deviation}");
            assert!((factor(0.0, deviation) - 3.0).abs() < 1e-12, "{deviation}");
        }
        assert!((factor(0.4, 1.0) - 3.5).abs() < 1e-12);
        assert_eq!(widening.widened(0.8, 0.0, 9.0), 0.0);
        for bad in [0.5, f64::NAN, f64::INFINITY] {
            assert!(!Widening { highlight: [bad; OCTAVES], ..widening }.is_valid());
        }
        assert!(!Widening { edge: 0.0, ..widening }.is_valid());
    }

    /// Residuals of twice the deviation that was expected where much is open, and of half of it elsewhere.
    #[cfg(feature = "fit")]
    #[test]
    fn factors_are_those_that_cover_95_of_100() {
        let mut random = crate::base::random::SplitMix64::new(5);
        let mut predicted = |in_highlight, latent: f64, noise: f64, scale: f64| Predicted {
            in_highlight,
            residuals: vec![(scale * scale * latent + noise).sqrt() * random.next_normal()],
            latent,
            noise,
        };
        let samples: Vec<Predicted> = (0..30_000)
            .map(|i| match i % 3 {
                0 => predicted(false, 1.0, 0.1, 2.0),
                1 => predicted(false, 1e-3, 0.0, 0.5),
                _ => predicted(true, 1.0, 0.0, 3.0),
            })
            .collect();
        let Widening { edge, highlight, rest } = Widening::of(&samples, 0.2, 1.0);
        assert_eq!(edge, 0.2);
        assert!(
            (rest[OCTAVES - 1] - 2.0).abs() < 0.06 && rest[..OCTAVES - 3].iter().all(|f| *f == 1.0),
            "{rest:?}"
        );
        assert!((highlight[OCTAVES - 1] - 3.0).abs() < 0.1, "{highlight:?}");
    }
}
