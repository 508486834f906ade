//! The process of scattered samples as a posterior of a model.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::conditional::Basis;
use super::{ScatteredGp, Widening};
use crate::base::error::Result;
use crate::brdf::angles::{HalfDiff, check_finite};
use crate::gp::dense::row_major;
use crate::gp::hyper::{Hyper, length_scale_report};
use crate::gp::posterior::{DeviceForm, KernelSum, KernelSums, Posterior};
use crate::gp::solver::Solver;
use crate::gp::tensors::{TensorReader, TensorWriter};
use crate::kernel::Kernel;
use crate::sample::space::InputSpace;

/// The solver's name in files and reports.
pub(crate) const NAME: &str = "scattered";

/// A process and the space of its inputs.
#[derive(Debug)]
pub(super) struct ScatteredPosterior {
    pub(super) gp: ScatteredGp,
    pub(super) space: InputSpace,
}

/// The parts of a saved process that are not tensors.
#[derive(Serialize, Deserialize)]
struct Header {
    space: InputSpace,
    kernel: Kernel,
    noise_variance: f64,
    channels: usize,
    #[serde(default)]
    widening: Widening,
}

/// Reads a process that [`Posterior::save`] has written.
pub(crate) fn load(header: Value, tensors: &TensorReader<'_>) -> Result<Arc<dyn Posterior>> {
    let Header { space, kernel, noise_variance, channels, widening } = tensors.header(header)?;
    space.validate().map_err(|e| tensors.damaged(e))?;
    if kernel.dimension() != 3 {
        return Err(tensors.wrong("a kernel of 3 coordinates", kernel.dimension().to_string()));
    }
    let (x, noise, weights) = (tensors.read("x")?, tensors.read("noise")?, tensors.read("weights")?);
    let gp = ScatteredGp::new(kernel, noise_variance, noise, x, (Basis::default(), 0.0), channels, weights);
    let gp = gp.and_then(|gp| gp.widened(widening)).map_err(|e| tensors.damaged(e))?;
    Ok(Arc::new(ScatteredPosterior { gp, space }))
}

impl Posterior for ScatteredPosterior {
    fn solver(&self) -> &'static str {
        NAME
    }

    fn label(&self) -> &'static str {
        "Exact mean, nearest-neighbour variance"
    }

    fn space(&self) -> InputSpace {
        self.space
    }

    fn n_channels(&self) -> usize {
        self.gp.channels
    }

    fn n_data(&self) -> usize {
        self.gp.n_samples()
    }

    fn n_floats(&self) -> usize {
        self.gp.n_samples() * (4 + self.gp.channels) + self.gp.kernel.n_parameters() + 1
    }

    fn noise_variances(&self) -> Vec<f64> {
        vec![self.gp.noise_variance; self.gp.channels]
    }

    fn predict_mean(&self, angles: &[HalfDiff]) -> Vec<f64> {
        self.gp.mean_at(&self.space.points(angles))
    }

    fn predict_variance(&self, angles: &[HalfDiff]) -> Result<Vec<f64>> {
        check_finite(angles)?;
        self.gp.variance_at(&self.space.points(angles), &[])
    }

    fn hyper(&self) -> Option<Hyper> {
        let (kernel, noise_variance) = (self.gp.kernel.clone(), self.gp.noise_variance);
        Some(Hyper::new(Solver::Scattered, kernel, noise_variance, Some(self.space)))
    }

    fn kernel_name(&self) -> String {
        self.gp.kernel.name()
    }

    fn report(&self) -> Value {
        json!({
            "length_scale": length_scale_report(&self.gp.kernel),
            "signal_variance": self.gp.kernel.prior_variance(),
            "noise_variance": self.gp.noise_variance,
            "terms": self.gp.kernel,
        })
    }

    fn save(&self, tensors: &mut TensorWriter) -> Result<Value> {
        let (n, channels) = (self.gp.n_samples(), self.gp.channels);
        tensors.add("x", &[n, self.gp.kernel.dimension()], &self.gp.inputs);
        tensors.add("noise", &[n], &self.gp.noise);
        tensors.add("weights", &[channels, n], &self.gp.weights);
        crate::gp::tensors::header(&Header {
            space: self.space,
            kernel: self.gp.kernel.clone(),
            noise_variance: self.gp.noise_variance,
            channels,
            widening: self.gp.widening,
        })
    }

    fn device_form(&self) -> DeviceForm<'_> {
        DeviceForm::KernelSum(KernelSums::from(KernelSum {
            kernel: &self.gp.kernel,
            space: self.space,
            inputs: &self.gp.inputs,
            weights: row_major(&self.gp.weights, self.gp.channels),
            n_channels: self.gp.channels,
        }))
    }
}
