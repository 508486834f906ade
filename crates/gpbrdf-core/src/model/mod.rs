//! A fitted Gaussian-process BRDF: fitting, predicting, saving, baking.

pub(crate) mod bake;
#[cfg(feature = "fit")]
pub(crate) mod compress;
pub(crate) mod file;
#[cfg(feature = "fit")]
pub(crate) mod fit;
mod interval;

pub use bake::{Baked, bake_mean, bake_mean_observed, bake_sigma, bake_sigma_observed};
#[cfg(feature = "fit")]
pub use compress::{CellWeights, CompressOptions, InducingSize, compress};
#[cfg(feature = "fit")]
pub use fit::{Conditioned, Fit, FitOptions, PriorChoice, condition, fit};
pub(crate) use interval::interval_about;
pub use interval::{IntervalOf, Intervals};

use std::sync::Arc;

use nalgebra::Vector3;
use serde_json::{Value, json};

use crate::base::error::{Error, Result};
use crate::brdf::angles::{HalfDiff, check_finite};
use crate::brdf::{Brdf, Rgb};
use crate::gp::{Hyper, Posterior};
use crate::sample::{InputSpace, MeanFunction, Provenance, Transform};

/// A fitted Gaussian-process BRDF: `f = g^-1(m + GP(wi, wo))` for each channel.
#[derive(Clone, Debug)]
pub struct Model {
    /// Origin of the samples or of the table that the model was fitted to.
    pub provenance: Provenance,
    /// The map from BRDF values to targets.
    pub transform: Transform,
    /// The rule for the prior mean.
    pub mean: MeanFunction,
    /// Prior mean of each channel's target.
    pub offsets: [f64; 3],
    /// The conditioned processes, which have three channels together.
    posteriors: Vec<Arc<dyn Posterior>>,
}

/// A prediction for one pair of directions, sr^-1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// The predictive mean of the target, transformed back: the median of the BRDF value.
    pub mean: Rgb,
    /// Lower end of the 95 % interval.
    pub lower: Rgb,
    /// Upper end of the 95 % interval.
    pub upper: Rgb,
}

impl Model {
    /// A model made of conditioned processes: one for all channels where they share hyper-parameters, else
    /// one per channel.
    ///
    /// # Errors
    /// Processes whose channels do not add up to three.
    pub fn new(
        provenance: Provenance,
        transform: Transform,
        mean: MeanFunction,
        offsets: [f64; 3],
        posteriors: Vec<Arc<dyn Posterior>>,
    ) -> Result<Self> {
        let channels: usize = posteriors.iter().map(|p| p.n_channels()).sum();
        if channels != 3 {
            return Err(Error::argument("channels of a model", "3", channels));
        }
        if let Some(bad) = offsets.iter().find(|offset| !offset.is_finite()) {
            return Err(Error::argument("prior mean", "a finite number", bad));
        }
        Ok(Self { provenance, transform, mean, offsets, posteriors })
    }

    /// The conditioned processes, each with the index of its first channel.
    pub fn posteriors(&self) -> impl Iterator<Item = (usize, &dyn Posterior)> + '_ {
        self.posteriors.iter().scan(0, |next, posterior| {
            let first = *next;
            *next += posterior.n_channels();
            Some((first, posterior.as_ref()))
        })
    }

    /// The first process. It stands for all of them in questions with one answer per model, such as the
    /// solver.
    fn first(&self) -> &dyn Posterior {
        self.posteriors[0].as_ref()
    }

    /// Name of the solver, as in reports and files.
    #[must_use]
    pub fn solver(&self) -> &'static str {
        self.first().solver()
    }

    /// Name of the solver as it is shown to users.
    #[must_use]
    pub fn solver_label(&self) -> &'static str {
        self.first().label()
    }

    /// The map from directions to the coordinates of the kernel, as the first process has it.
    #[must_use]
    pub fn space(&self) -> InputSpace {
        self.first().space()
    }

    /// Name of the first process's kernel.
    #[must_use]
    pub fn kernel_name(&self) -> String {
        self.first().kernel_name()
    }

    /// Hyper-parameters of the first process, with which others can be conditioned. `None` for a compressed
    /// table, which has no measurements to condition on.
    #[must_use]
    pub fn hyper(&self) -> Option<Hyper> {
        self.first().hyper()
    }

    /// The hyper-parameters as JSON for reports: an object, or `{"channels": [...]}` where each channel has
    /// its own.
    #[must_use]
    pub fn hyper_report(&self) -> Value {
        let mut all: Vec<Value> = self.posteriors.iter().map(|p| p.report()).collect();
        if all.len() == 1 { all.swap_remove(0) } else { json!({ "channels": all }) }
    }

    /// Number of measured directions; for a compressed table, the number of its valid cells.
    #[must_use]
    pub fn n_samples(&self) -> usize {
        self.first().n_data()
    }

    /// The count of numbers that the model stores, which is not the number of samples: values or weights of
    /// all channels, positions of nodes or samples, prior means, colour matrix, densities and
    /// hyper-parameters.
    #[must_use]
    pub fn n_floats(&self) -> usize {
        self.offsets.len() + self.posteriors.iter().map(|p| p.n_floats()).sum::<usize>()
    }

    /// Noise variance of each channel, in squared target units.
    #[must_use]
    pub fn noise_variances(&self) -> Rgb {
        let mut out = [0.0; 3];
        for (first, posterior) in self.posteriors() {
            out[first..].iter_mut().zip(posterior.noise_variances()).for_each(|(out, noise)| *out = noise);
        }
        out
    }

    /// The predictive mean of the target at each pair of directions, prior mean included. Angles that are not
    /// finite give NaN.
    #[must_use]
    pub fn predict_target(&self, angles: &[HalfDiff]) -> Vec<Rgb> {
        let mut out = vec![self.offsets; angles.len()];
        for (first, posterior) in self.posteriors() {
            let means = posterior.predict_mean(angles);
            for (out, means) in out.iter_mut().zip(means.chunks(posterior.n_channels())) {
                out[first..].iter_mut().zip(means).for_each(|(out, mean)| *out += mean);
            }
        }
        out
    }

    /// The predictive mean of the target at each pair of directions, transformed back to sr^-1. Per
    /// direction, a dense model takes one kernel evaluation per sample, a lattice model one multiply-add per
    /// node.
    #[must_use]
    pub fn predict_mean(&self, angles: &[HalfDiff]) -> Vec<Rgb> {
        self.predict_target(angles).into_iter().map(|g| g.map(|g| self.transform.inverse(g))).collect()
    }

    /// Variance of the target at each pair of directions, for each channel. The first call on a loaded model
    /// may factorise a covariance that only variances need.
    ///
    /// # Errors
    /// Angles that are not finite, or a covariance that cannot be factorised or does not fit in memory.
    pub fn predict_variance(&self, angles: &[HalfDiff], of: IntervalOf) -> Result<Vec<Rgb>> {
        check_finite(angles)?;
        let mut out = vec![[0.0; 3]; angles.len()];
        for (first, posterior) in self.posteriors() {
            let (count, channels) = (posterior.n_variances(), posterior.n_channels());
            let variances = posterior.predict_variance(angles)?;
            for (out, variances) in out.iter_mut().zip(variances.chunks(count)) {
                for (channel, out) in out[first..first + channels].iter_mut().enumerate() {
                    *out = variances[channel.min(count - 1)];
                }
            }
        }
        if of == IntervalOf::Observation {
            let noise = self.noise_variances();
            out.iter_mut().for_each(|v| v.iter_mut().zip(noise).for_each(|(v, noise)| *v += noise));
        }
        Ok(out)
    }

    /// Both ends of the 95 % interval of a new measurement about a predictive mean in sr^-1, with the latent
    /// standard deviation of each channel in target units.
    #[must_use]
    pub fn interval_about(&self, mean: Rgb, sigma: Rgb) -> (Rgb, Rgb) {
        interval::measurement_interval(self.transform, self.noise_variances(), mean, sigma)
    }

    /// Mean and 95 % interval at each pair of directions. The interval of the target is transformed back, so
    /// it is asymmetric about the mean and never negative.
    ///
    /// # Errors
    /// Those of [`Model::predict_variance`].
    pub fn predict(&self, angles: &[HalfDiff], of: IntervalOf) -> Result<Vec<Prediction>> {
        let means = self.predict_target(angles);
        let variances = self.predict_variance(angles, of)?;
        let back = |g: f64| self.transform.inverse(g);
        let predictions = std::iter::zip(means, variances).map(|(g, variance)| {
            let ends: [(f64, f64); 3] =
                std::array::from_fn(|c| interval_about(self.transform, g[c], variance[c].sqrt()));
            Prediction { mean: g.map(back), lower: ends.map(|e| e.0), upper: ends.map(|e| e.1) }
        });
        Ok(predictions.collect())
    }
}

/// Evaluates the predictive mean. Every call allocates memory, so many directions are better evaluated by one
/// call of [`Brdf::eval_many`], or by baking the model and looking up its table.
impl Brdf for Model {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return [0.0; 3];
        }
        self.eval_half_diff(HalfDiff::from_directions(wi, wo))
    }

    fn eval_half_diff(&self, angles: HalfDiff) -> Rgb {
        self.predict_mean(&[angles])[0]
    }

    fn eval_many(&self, angles: &[HalfDiff], out: &mut [Rgb]) {
        out.copy_from_slice(&self.predict_mean(angles));
    }
}

#[cfg(test)]
mod tests;
