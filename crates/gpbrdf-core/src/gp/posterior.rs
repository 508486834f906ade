//! The interface between models and solvers: everything that a model needs from a conditioned process.

use std::fmt::Debug;

use serde_json::Value;

use crate::base::error::Result;
use crate::base::watch::Watch;
use crate::brdf::angles::HalfDiff;
use crate::gp::hyper::Hyper;
use crate::gp::lattice::LatticeGp;
use crate::gp::table::{self, MeanTable};
use crate::gp::tensors::TensorWriter;
use crate::kernel::Kernel;
use crate::sample::space::{InputSpace, WarpedBox};

/// A Gaussian process conditioned on the targets of one channel, or of several that share hyper-parameters.
///
/// Targets have zero mean: the model adds the prior mean and transforms values back to sr^-1. A new solver
/// implements this trait in a folder of its own and is registered in `gp/solver.rs`.
pub trait Posterior: Debug + Send + Sync {
    /// Name of the solver in reports and model files.
    fn solver(&self) -> &'static str;

    /// Name of the solver as it is shown to users.
    fn label(&self) -> &'static str;

    /// The map from directions to the coordinates of the kernel. Where components have spaces of their own,
    /// it is the space of the first one.
    fn space(&self) -> InputSpace;

    /// The number of channels.
    fn n_channels(&self) -> usize;

    /// The number of measured directions, or the number of table cells that a compressed table was fitted to.
    fn n_data(&self) -> usize;

    /// The count of numbers that are stored: values or weights of all channels, positions, and
    /// hyper-parameters.
    fn n_floats(&self) -> usize;

    /// Noise variance of each channel, in squared target units.
    fn noise_variances(&self) -> Vec<f64>;

    /// The number of variances per direction: 1 where the channels share their variance, else one per
    /// channel.
    fn n_variances(&self) -> usize {
        1
    }

    /// Posterior mean, `[direction][channel]`. Angles that are not finite give NaN.
    fn predict_mean(&self, angles: &[HalfDiff]) -> Vec<f64>;

    /// Posterior variance of the noise-free function, `[direction][variance]`, with
    /// [`Posterior::n_variances`] values per direction. The first call may factorise a covariance that only
    /// variances need.
    ///
    /// # Errors
    /// A covariance that cannot be factorised or does not fit in memory, or angles that are not finite.
    fn predict_variance(&self, angles: &[HalfDiff]) -> Result<Vec<f64>>;

    /// The hyper-parameters, with which another process can be conditioned. `None` where there are no
    /// measurements to condition on.
    fn hyper(&self) -> Option<Hyper>;

    /// Name of the kernel for reports.
    fn kernel_name(&self) -> String;

    /// The hyper-parameters as JSON for reports.
    fn report(&self) -> Value;

    /// Writes the large arrays into `tensors` and returns the rest as JSON. The solver's `load` makes the
    /// same process from both.
    ///
    /// # Errors
    /// Numbers that JSON cannot hold.
    fn save(&self, tensors: &mut TensorWriter) -> Result<Value>;

    /// The form in which a graphics device evaluates the posterior.
    fn device_form(&self) -> DeviceForm<'_>;

    /// Evaluates the mean in every cell of a table. The default implementation predicts the mean of every
    /// distinct cell, one slab of directions at a time.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled) where the observer stops the work.
    fn bake_mean(&self, table: &mut MeanTable<'_>, watch: &Watch) -> Result<()> {
        table::points::bake_mean(self, table, watch)
    }

    /// The latent standard deviation in every cell of a table, as one plane in MERL order for each of the
    /// [`Posterior::n_variances`]. The default implementation predicts it in every third cell along each axis
    /// and interpolates between them.
    ///
    /// # Errors
    /// Those of [`Posterior::predict_variance`], and [`Error::Cancelled`](crate::Error::Cancelled) where the
    /// observer stops the work.
    fn bake_sigma(&self, watch: &Watch) -> Result<Vec<Vec<f32>>> {
        table::points::bake_sigma(self, watch)
    }
}

/// The two forms in which a graphics device can evaluate a posterior.
#[derive(Debug)]
#[non_exhaustive]
pub enum DeviceForm<'a> {
    /// Sums of products with one function per axis; the parts are added up.
    Separable(Vec<SeparablePart<'a>>),
    /// Weighted sums of kernel values over the samples.
    KernelSum(KernelSums<'a>),
}

/// A posterior mean as a sum of kernel sums.
#[derive(Clone, Debug)]
pub struct KernelSums<'a> {
    /// The kernel sums, at least one; all have the same number of channels.
    pub sums: Vec<KernelSum<'a>>,
    /// What is added to each channel of the model.
    pub constants: [f64; 3],
}

impl<'a> From<KernelSum<'a>> for KernelSums<'a> {
    fn from(sum: KernelSum<'a>) -> Self {
        Self { sums: vec![sum], constants: [0.0; 3] }
    }
}

/// One lattice process of a separable form; see [`SeparableForm`](crate::gp::SeparableForm).
#[derive(Clone, Copy, Debug)]
pub struct SeparablePart<'a> {
    /// The process.
    pub gp: &'a LatticeGp,
    /// The map from directions to the coordinates of the process.
    pub space: WarpedBox,
    /// For a process that is a component of one channel and is mixed into colours, the weight of its mean in
    /// each channel; the weights of its variance are the squares of these. `None` for a process with channels
    /// of its own.
    pub colour: Option<[f64; 3]>,
}

/// A posterior mean as a sum over the samples: `mean_c(x) = sum_i weights_ic k(x, x_i)`.
#[derive(Clone, Debug)]
pub struct KernelSum<'a> {
    /// The kernel.
    pub kernel: &'a Kernel,
    /// The map from directions to the coordinates of the kernel.
    pub space: InputSpace,
    /// Coordinates of the samples, `n` rows of three.
    pub inputs: &'a [f64],
    /// Weights of the samples, `n` rows with one value per channel.
    pub weights: Vec<f64>,
    /// The number of channels.
    pub n_channels: usize,
}

impl KernelSum<'_> {
    /// The number of samples.
    #[must_use]
    pub fn n_samples(&self) -> usize {
        self.inputs.len() / 3
    }
}
