//! The process whose variances a plan reduces.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use crate::base::error::{Error, Result};
use crate::brdf::angles::HalfDiff;
use crate::gp::Hyper;
use crate::kernel::{Kernel, KernelBody, Points, Shape};
use crate::model::{FitOptions, Model};
use crate::prior::{Colour, Prior, of_variance_by_bands};
use crate::sample::space::about_plane;
use crate::sample::{InputSpace, SampleSet};

/// The noise variance of measurements that were not made yet.
const NOISE: f64 = 1e-4;

/// The variance of `ln f` where nothing is known of other materials.
const BROAD: f64 = 4.0;

/// How much larger the standard deviation of `ln f` is taken for the choice of directions than a process with a learned
/// prior says, by `theta_h` in bands that end at 10, 30, 60 and 90 degrees. They are between the factors of intervals
/// of the built-in prior and those that would hold 95 % of the errors of left-out materials in place of 90 %: where a
/// material is like no other of the library, that is mostly in its highlight (`docs/results.md`).
const EMPHASIS: [f64; 4] = [2.0, 1.4, 1.15, 1.35];

/// How much brighter the mirror direction is than 5 degrees beside it where a highlight is called sharp. Of 17 measured
/// materials (J. Dupuy and W. Jakob 2018) nine have at least 1.7 at some `theta_d` of up to 45 degrees, the matte ones
/// at most 1.3.
const SHARP: f64 = 1.5;

/// A process of the brightness of a material: the covariance `v B(x)^T B(x') + k(x, x')` with the achromatic principal
/// functions `B` of a learned prior, or `k(x, x')` alone.
#[derive(Clone, Debug)]
pub struct Belief {
    /// The prior whose functions are part of the covariance.
    pub(super) prior: Option<Arc<Prior>>,
    /// `v`.
    pub(super) basis_variance: f64,
    /// `k`.
    pub(super) kernel: Kernel,
    /// The coordinates of the kernel. In those of the plane of incidence the distance from it is the third one, so that
    /// plans leave a plane that was measured.
    pub(super) space: InputSpace,
    /// Noise variance of a measurement.
    pub(super) noise_variance: f64,
    /// The variance of `ln f`, mean of the channels, per variance of the process.
    pub(super) scale: f64,
    /// What is known of the highlights.
    pub(super) highlights: Highlights,
}

/// What is known of the highlights of a material.
#[derive(Clone, Debug)]
pub(super) enum Highlights {
    /// Nothing: some may be too sharp for coarse steps of an instrument.
    Unknown,
    /// None of them is sharp.
    Broad,
    /// Some are sharp, as this model says.
    Sharp(Box<Model>),
}

impl Belief {
    /// What is known before anything is measured. With a prior: `v = 1`, and a Matern 5/2 kernel whose variance is that
    /// of what the functions leave of other materials ([`Prior::left`]); without: a variance of 4 of `ln f`. Length
    /// scales are the usual ones of [`InputSpace::PolarAngles`], and the noise variance is 1e-4.
    #[must_use]
    pub fn before(prior: Option<&Arc<Prior>>) -> Self {
        let space = InputSpace::PolarAngles;
        let lengths = space.usual_lengths().map(|(median, _)| median);
        let variance = prior.map_or(BROAD, |prior| prior.left(Colour::Achromatic).powi(2));
        Self {
            prior: prior.cloned(),
            basis_variance: 1.0,
            kernel: Kernel::ard(variance, Shape::Matern52, &lengths),
            space,
            noise_variance: NOISE,
            scale: scale(prior.is_some()),
            highlights: Highlights::Unknown,
        }
    }

    /// What is known with the hyper-parameters of a fit; `prior` is the one that it has used, if any, before it was
    /// adapted to the samples.
    ///
    /// # Errors
    /// Hyper-parameters of a process on a lattice, which has no space of its own, those of a fit with a prior without
    /// that prior, and those of a fit with another one.
    pub fn of_fit(hyper: &Hyper, prior: Option<&Arc<Prior>>) -> Result<Self> {
        let Some(space) = hyper.space else {
            let expected = "those of samples off a lattice";
            return Err(Error::argument("hyper-parameters of a plan", expected, "those of a lattice"));
        };
        let prior = match (hyper.basis_variance, prior) {
            (None, _) => None,
            (Some(_), Some(prior)) => Some(prior),
            (Some(_), None) => {
                let found = "none";
                return Err(Error::argument("prior of a plan", "the one that the fit has used", found));
            }
        };
        let prior = prior.map(|prior| prior.weighted(&hyper.library_weights)).transpose()?;
        Ok(Self {
            scale: scale(prior.is_some()),
            prior,
            basis_variance: hyper.basis_variance.unwrap_or(0.0),
            kernel: if space == InputSpace::PlaneOfIncidence {
                with_distance_from_plane(&hyper.kernel)
            } else {
                hyper.kernel.clone()
            },
            space,
            noise_variance: hyper.noise_variance.max(1e-9 * hyper.kernel.prior_variance()),
            highlights: Highlights::Unknown,
        })
    }

    /// What is known with a model that was fitted to samples with these options. Beside its variances this is whether
    /// the model has a sharp highlight, without which measurements near mirror directions tell little, and how bright
    /// it is in which directions of one.
    ///
    /// # Errors
    /// A model without hyper-parameters, and those of [`Belief::of_fit`].
    pub fn of_model(model: &Model, samples: &SampleSet, options: &FitOptions) -> Result<Self> {
        let Some(hyper) = model.hyper() else {
            return Err(Error::argument("model of a plan", "one with hyper-parameters", "none"));
        };
        let is_sharp = has_sharp_highlight(model);
        let highlights =
            if is_sharp { Highlights::Sharp(Box::new(model.clone())) } else { Highlights::Broad };
        Ok(Self { highlights, ..Self::of_fit(&hyper, options.prior(samples).as_ref())? })
    }

    /// Whether some highlight may be too sharp for coarse steps of an instrument.
    pub(super) fn may_be_sharp(&self) -> bool {
        !matches!(self.highlights, Highlights::Broad)
    }

    /// The factors by which variances at directions are larger than the process says: those of the intervals of a fit.
    pub(super) fn calibration(&self, angles: &[HalfDiff]) -> Vec<f64> {
        let factor =
            |at| self.prior.as_ref().map_or(1.0, |prior| prior.calibration().of_variance(self.space, at));
        angles.iter().map(factor).collect()
    }

    /// The factors by which variances at directions count more in the choice of directions than the process says.
    pub(super) fn emphasis(&self, angles: &[HalfDiff]) -> Vec<f64> {
        let factor = |at| if self.prior.is_some() { of_variance_by_bands(&EMPHASIS, at) } else { 1.0 };
        angles.iter().map(factor).collect()
    }

    /// Coordinates and functions of directions.
    pub(super) fn places(&self, angles: &[HalfDiff]) -> Places {
        let features = self.prior.as_ref().map(|prior| prior.features(Colour::Achromatic, angles));
        let x = match self.space {
            InputSpace::PlaneOfIncidence => angles.iter().flat_map(|&at| about_plane(at)).collect(),
            space => space.points(angles),
        };
        Places {
            points: Points::new(&x, &self.kernel.metric),
            count: self.prior.as_ref().map_or(0, |prior| prior.n_functions(Colour::Achromatic)),
            features: features.unwrap_or_default(),
        }
    }
}

/// A kernel of samples in the plane of incidence that counts the distance from it like the first coordinate.
fn with_distance_from_plane(kernel: &Kernel) -> Kernel {
    let mut kernel = kernel.clone();
    for term in &mut kernel.terms {
        if let KernelBody::Ard { length_scale, .. } = &mut term.body {
            length_scale[2] = length_scale[0];
        }
    }
    kernel
}

/// Whether the mirror direction is much brighter than 5 degrees beside it, at some `theta_d`.
fn has_sharp_highlight(model: &Model) -> bool {
    let at = |theta_h: f64, theta_d: f64| HalfDiff {
        theta_h: theta_h.to_radians(),
        theta_d: theta_d.to_radians(),
        phi_d: FRAC_PI_2,
    };
    let pairs = [5.0, 15.0, 25.0, 35.0, 45.0].map(|theta_d| [at(0.0, theta_d), at(5.0, theta_d)]);
    let brightness: Vec<f64> =
        model.predict_mean(pairs.as_flattened()).iter().map(|value| value.iter().sum()).collect();
    brightness.chunks(2).any(|pair| pair[0] > SHARP * pair[1])
}

/// The variance of the mean of the logarithms of three channels, per variance of their achromatic colour; processes
/// without a prior are those of the channels themselves.
fn scale(has_prior: bool) -> f64 {
    if has_prior { 1.0 / 3.0 } else { 1.0 }
}

/// Directions as a process sees them.
#[derive(Clone, Debug)]
pub(super) struct Places {
    pub(super) points: Points,
    /// Number of functions.
    pub(super) count: usize,
    /// Values of the functions, one row per direction.
    pub(super) features: Vec<f64>,
}

impl Places {
    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    /// The functions at direction `i`.
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.features[i * self.count..(i + 1) * self.count]
    }
}
