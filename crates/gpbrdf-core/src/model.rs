//! A fitted Gaussian-process BRDF.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::angles::HalfDiff;
use crate::brdf::{Brdf, Rgb};
use crate::error::Result;
use crate::gp::{DenseGp, InducingGp, LatticeGp};
use crate::layout::LatticeLayout;
use crate::space::InputSpace;
use crate::target::{MeanFunction, Transform};

/// Half width of a 95 % interval in standard deviations.
const Z_95: f64 = 1.959_963_984_540_054;

/// Where a model comes from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Name of the material.
    pub material: String,
    /// File or built-in material that was sampled.
    pub source: String,
    /// sha256 of that file, hexadecimal; empty for built-in materials.
    pub sha256: String,
    /// Name of the layout: `lattice`, `random`, `cells`, `samples` or `table`.
    pub layout: String,
    /// The lattice, where there is one.
    pub lattice: Option<LatticeLayout>,
}

/// The process of a model: one for all channels where they share hyper-parameters, else one a channel.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Process {
    /// On a product lattice.
    Lattice(Vec<LatticeGp>),
    /// On any points.
    Dense(Vec<DenseGp>),
    /// Sparse, fitted to a whole table: few numbers stored.
    Inducing(Box<InducingGp>),
}

/// A fitted Gaussian-process BRDF: `f = g^-1(m + GP(coordinates(wi, wo)))` for each channel.
#[derive(Clone, Debug)]
pub struct Model {
    /// Where it comes from.
    pub provenance: Provenance,
    /// From BRDF values to targets.
    pub transform: Transform,
    /// The rule for the prior mean.
    pub mean: MeanFunction,
    /// Prior mean of each channel's target.
    pub offsets: [f64; 3],
    /// From directions to kernel coordinates.
    pub space: InputSpace,
    /// The conditioned process.
    pub process: Process,
}

/// A prediction for one pair of directions, sr^-1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// The predictive mean of the target, carried back: the median of the BRDF value.
    pub mean: Rgb,
    /// Lower end of the 95 % interval.
    pub lower: Rgb,
    /// Upper end of the 95 % interval.
    pub upper: Rgb,
}

/// What an interval is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IntervalOf {
    /// The value of a new measurement: latent variance plus noise variance.
    #[default]
    Observation,
    /// The noise-free function.
    Latent,
}

impl Model {
    /// The predictive mean of the target at each pair of directions, prior mean included. Angles that are not finite
    /// give NaN.
    #[must_use]
    pub fn predict_target(&self, angles: &[HalfDiff]) -> Vec<Rgb> {
        if let Process::Inducing(gp) = &self.process {
            let parts = each_component(gp, angles, LatticeGp::predict_mean);
            let colours = parts.into_iter().map(|parts| gp.colour(parts));
            return colours.map(|rgb| std::array::from_fn(|c| self.offsets[c] + rgb[c])).collect();
        }
        let points: Vec<[f64; 3]> = angles.iter().map(|&a| self.space.coordinates(a)).collect();
        let mut out = vec![self.offsets; points.len()];
        let mut first = 0;
        let mut add = |means: &[f64], channels: usize| {
            for (out, means) in out.iter_mut().zip(means.chunks(channels)) {
                out[first..].iter_mut().zip(means).for_each(|(out, m)| *out += m);
            }
            first += channels;
        };
        match &self.process {
            Process::Lattice(groups) => {
                groups.iter().for_each(|gp| add(&gp.predict_mean(&points), gp.data().channels));
            }
            Process::Dense(groups) => {
                for gp in groups {
                    let means = gp.predict_mean(points.as_flattened());
                    add(
                        &means.unwrap_or_else(|_| vec![f64::NAN; points.len() * gp.channels()]),
                        gp.channels(),
                    );
                }
            }
            Process::Inducing(_) => {}
        }
        out
    }

    /// The predictive mean, carried back to sr^-1. `O(n)` kernel values a direction for a dense model, as many
    /// multiply-adds for a lattice one.
    #[must_use]
    pub fn predict_mean(&self, angles: &[HalfDiff]) -> Vec<Rgb> {
        self.predict_target(angles).into_iter().map(|g| g.map(|g| self.transform.inverse(g))).collect()
    }

    /// Variance of the target at each pair of directions, for each channel.
    #[must_use]
    pub fn predict_variance(&self, angles: &[HalfDiff], of: IntervalOf) -> Vec<Rgb> {
        if let Process::Inducing(gp) = &self.process {
            let noise = if of == IntervalOf::Observation { gp.noise_variances() } else { [0.0; 3] };
            let parts = each_component(gp, angles, LatticeGp::predict_variance_latent);
            let colours = parts.into_iter().map(|parts| gp.colour_variance(parts));
            return colours.map(|rgb| std::array::from_fn(|c| rgb[c] + noise[c])).collect();
        }
        let points: Vec<[f64; 3]> = angles.iter().map(|&a| self.space.coordinates(a)).collect();
        let mut out = vec![[0.0; 3]; points.len()];
        let mut first = 0;
        let mut set = |variances: &[f64], noise: f64, channels: usize| {
            let noise = if of == IntervalOf::Observation { noise } else { 0.0 };
            for (out, variance) in out.iter_mut().zip(variances) {
                out[first..first + channels].fill(variance + noise);
            }
            first += channels;
        };
        match &self.process {
            Process::Lattice(groups) => {
                for gp in groups {
                    let variances = gp.predict_variance_latent(&points);
                    set(&variances, gp.hyper().noise_variance, gp.data().channels);
                }
            }
            Process::Dense(groups) => {
                for gp in groups {
                    let variances = gp.predict_variance_latent(points.as_flattened());
                    let variances = variances.unwrap_or_else(|_| vec![f64::NAN; points.len()]);
                    set(&variances, gp.noise_variance(), gp.channels());
                }
            }
            Process::Inducing(_) => {}
        }
        out
    }

    /// Mean and 95 % interval at each pair of directions: the interval of the target, carried back, so it is
    /// asymmetric about the mean and never negative.
    #[must_use]
    pub fn predict(&self, angles: &[HalfDiff], of: IntervalOf) -> Vec<Prediction> {
        let means = self.predict_target(angles);
        let variances = self.predict_variance(angles, of);
        let back = |g: f64| self.transform.inverse(g);
        std::iter::zip(means, variances)
            .map(|(g, variance)| Prediction {
                mean: g.map(back),
                lower: std::array::from_fn(|c| back(g[c] - Z_95 * variance[c].sqrt())),
                upper: std::array::from_fn(|c| back(g[c] + Z_95 * variance[c].sqrt())),
            })
            .collect()
    }

    /// Noise variance of each channel, in squared target units.
    #[must_use]
    pub fn noise_variances(&self) -> Rgb {
        let mut out = [0.0; 3];
        let groups: Vec<(f64, usize)> = match &self.process {
            Process::Lattice(g) => g.iter().map(|g| (g.hyper().noise_variance, g.data().channels)).collect(),
            Process::Dense(g) => g.iter().map(|g| (g.noise_variance(), g.channels())).collect(),
            Process::Inducing(gp) => return gp.noise_variances(),
        };
        let all = groups.into_iter().flat_map(|(noise, channels)| std::iter::repeat_n(noise, channels));
        out.iter_mut().zip(all).for_each(|(out, noise)| *out = noise);
        out
    }

    /// The first channel of each process of the model.
    pub(crate) fn first_channels(&self) -> Vec<usize> {
        let channels: Vec<usize> = match &self.process {
            Process::Lattice(groups) => groups.iter().map(|g| g.data().channels).collect(),
            Process::Dense(groups) => groups.iter().map(DenseGp::channels).collect(),
            Process::Inducing(_) => vec![3],
        };
        let mut first = 0;
        channels
            .into_iter()
            .map(|count| {
                first += count;
                first - count
            })
            .collect()
    }

    /// Numbers that the model stores, another size than the number of samples: values or weights of all channels,
    /// positions of nodes or samples, prior means, colour matrix, densities and hyper-parameters.
    #[must_use]
    pub fn floats(&self) -> usize {
        match &self.process {
            Process::Lattice(groups) => {
                let group = |gp: &LatticeGp| {
                    let nodes: usize = gp.data().shape().iter().sum();
                    let kernels: usize = gp.hyper().kernels.iter().map(|k| k.n_parameters()).sum();
                    gp.weights().len() + nodes + kernels + 2
                };
                self.offsets.len() + groups.iter().map(group).sum::<usize>()
            }
            Process::Dense(groups) => {
                let group =
                    |gp: &DenseGp| gp.n_samples() * (3 + gp.channels()) + gp.kernel().n_parameters() + 1;
                self.offsets.len() + groups.iter().map(group).sum::<usize>()
            }
            Process::Inducing(gp) => gp.floats(),
        }
    }

    /// Number of measured directions; of a model of a whole table, its valid cells.
    #[must_use]
    pub fn samples(&self) -> usize {
        match &self.process {
            Process::Lattice(groups) => groups.first().map_or(0, |g| g.data().len()),
            Process::Dense(groups) => groups.first().map_or(0, DenseGp::n_samples),
            Process::Inducing(gp) => gp.cells,
        }
    }
}

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
}

/// A quantity of all three components at each pair of directions.
fn each_component(
    gp: &InducingGp,
    angles: &[HalfDiff],
    of: impl Fn(&LatticeGp, &[[f64; 3]]) -> Vec<f64>,
) -> Vec<[f64; 3]> {
    let mut out = vec![[0.0; 3]; angles.len()];
    for (k, component) in gp.components.iter().enumerate() {
        let space = component.lattice().space;
        let points: Vec<[f64; 3]> = angles.iter().map(|&a| space.coordinates(a)).collect();
        out.iter_mut().zip(of(component.gp(), &points)).for_each(|(out, x)| out[k] = x);
    }
    out
}

/// The interval that a table of means and a standard deviation stand for: `g^-1(g(mean) -+ 1.96 sigma)`.
#[must_use]
pub fn interval_95(transform: Transform, mean: f64, standard_deviation: f64) -> (f64, f64) {
    let g = transform.forward(mean);
    let half = Z_95 * standard_deviation;
    (transform.inverse(g - half), transform.inverse(g + half))
}

/// Rejects a fit whose channels do not add up to three.
pub(crate) fn check_channels(process: &Process) -> Result<()> {
    let channels: usize = match process {
        Process::Lattice(groups) => groups.iter().map(|g| g.data().channels).sum(),
        Process::Dense(groups) => groups.iter().map(DenseGp::channels).sum(),
        Process::Inducing(gp) => return gp.validate(),
    };
    if channels == 3 {
        Ok(())
    } else {
        Err(crate::error::Error::argument("channels of a model", "3", channels))
    }
}
