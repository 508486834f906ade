//! The one door to every solver: what a model needs of a conditioned process.

use std::fmt::Debug;

use serde_json::Value;

use crate::base::error::Result;
use crate::brdf::angles::HalfDiff;
use crate::gp::hyper::Hyper;
use crate::gp::lattice::LatticeGp;
use crate::gp::table::{self, MeanTable};
use crate::gp::tensors::TensorWriter;
use crate::kernel::Kernel;
use crate::sample::space::{InputSpace, WarpedBox};

/// A Gaussian process conditioned on the targets of one channel, or of several that share hyper-parameters.
///
/// Targets have zero mean; the model adds the prior mean and carries values back to sr^-1. A new solver implements this
/// trait in a folder of its own and is entered in `gp/solver.rs`.
pub trait Posterior: Debug + Send + Sync {
    /// Name of the solver in reports and model files.
    fn solver(&self) -> &'static str;

    /// Name of the solver for people.
    fn label(&self) -> &'static str;

    /// From directions to the coordinates that the kernel compares; of the first component where they differ.
    fn space(&self) -> InputSpace;

    /// The number of channels.
    fn n_channels(&self) -> usize;

    /// The number of measured directions, or of table cells that a compressed table was fitted to.
    fn n_data(&self) -> usize;

    /// Numbers that are stored: values or weights of all channels, positions, and hyper-parameters.
    fn n_floats(&self) -> usize;

    /// Noise variance of each channel, in squared target units.
    fn noise_variances(&self) -> Vec<f64>;

    /// How many variances there are for each direction: 1 where the channels share it, else one per channel.
    fn n_variances(&self) -> usize {
        1
    }

    /// Posterior mean `[direction][channel]`. Angles that are not finite give NaN.
    fn predict_mean(&self, angles: &[HalfDiff]) -> Vec<f64>;

    /// Posterior variance of the noise-free function, `[direction][variance]` with [`Posterior::n_variances`] for each
    /// direction. The first call may factorise what only variances need.
    ///
    /// # Errors
    /// A covariance that cannot be factorised or does not fit in memory, or angles that are not finite.
    fn predict_variance(&self, angles: &[HalfDiff]) -> Result<Vec<f64>>;

    /// The hyper-parameters, to condition another process at; `None` where there are no measurements to condition on.
    fn hyper(&self) -> Option<Hyper>;

    /// Name of the kernel, for reports.
    fn kernel_name(&self) -> String;

    /// The hyper-parameters as they stand in reports.
    fn report(&self) -> Value;

    /// Writes everything that is not small into tensors and returns the rest, from which the solver's `load` makes the
    /// same process.
    ///
    /// # Errors
    /// Numbers that JSON cannot hold.
    fn save(&self, tensors: &mut TensorWriter) -> Result<Value>;

    /// What a graphics device evaluates.
    fn device_form(&self) -> DeviceForm<'_>;

    /// Evaluates the mean in every cell of a table. By default at each distinct cell, one block of directions at a time.
    fn bake_mean(&self, table: &mut MeanTable<'_>) {
        table::points::bake_mean(self, table);
    }

    /// The latent standard deviation in every cell of a table, as one plane in MERL order for each of
    /// [`Posterior::n_variances`]. By default on every third cell along each axis, interpolated between.
    ///
    /// # Errors
    /// Those of [`Posterior::predict_variance`].
    fn bake_sigma(&self) -> Result<Vec<Vec<f32>>> {
        table::points::bake_sigma(self)
    }
}

/// The two forms of a posterior that a graphics device evaluates.
#[derive(Debug)]
#[non_exhaustive]
pub enum DeviceForm<'a> {
    /// Sums of products of one function per axis, added up.
    Separable(Vec<SeparablePart<'a>>),
    /// Sums of kernel values over samples.
    KernelSum(KernelSum<'a>),
}

/// One lattice process of a separable form; see [`SeparableForm`](crate::gp::SeparableForm).
#[derive(Clone, Copy, Debug)]
pub struct SeparablePart<'a> {
    /// The process.
    pub gp: &'a LatticeGp,
    /// From directions to its coordinates.
    pub space: WarpedBox,
    /// If the process is a component of one channel that is mixed into colours: the weight of its mean in each channel.
    /// The weights of its variance are their squares.
    pub colour: Option<[f64; 3]>,
}

/// `mean_c(x) = sum_i weights_ic k(x, x_i)`.
#[derive(Clone, Debug)]
pub struct KernelSum<'a> {
    /// The kernel.
    pub kernel: &'a Kernel,
    /// From directions to coordinates.
    pub space: InputSpace,
    /// Coordinates of the samples, `n` rows of three.
    pub inputs: &'a [f64],
    /// `n` rows of one weight per channel.
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
