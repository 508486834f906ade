//! The dense process as a posterior of a model.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::DenseGp;
use crate::base::error::Result;
use crate::brdf::angles::HalfDiff;
use crate::gp::hyper::{Hyper, length_scale_report};
use crate::gp::posterior::{DeviceForm, KernelSum, KernelSums, Posterior};
use crate::gp::solver::Solver;
use crate::gp::tensors::{TensorReader, TensorWriter};
use crate::kernel::Kernel;
use crate::sample::space::InputSpace;

/// The solver's name in files and reports.
pub(crate) const NAME: &str = "dense";

/// A dense process and the space of its inputs.
#[derive(Debug)]
pub(super) struct DensePosterior {
    pub(super) gp: DenseGp,
    pub(super) space: InputSpace,
}

/// The parts of a saved process that are not tensors.
#[derive(Serialize, Deserialize)]
struct Header {
    space: InputSpace,
    kernel: Kernel,
    noise_variance: f64,
    jitter: f64,
    channels: usize,
}

/// Reads a process that [`Posterior::save`] has written.
pub(crate) fn load(header: Value, tensors: &TensorReader<'_>) -> Result<Arc<dyn Posterior>> {
    let Header { space, kernel, noise_variance, jitter, channels } = tensors.header(header)?;
    space.validate().map_err(|e| tensors.damaged(e))?;
    if kernel.dimension() != 3 {
        return Err(tensors.wrong("a kernel of 3 coordinates", kernel.dimension().to_string()));
    }
    let (x, targets, weights) = (tensors.read("x")?, tensors.read("targets")?, tensors.read("weights")?);
    let gp = DenseGp::from_weights(&x, &targets, &weights, channels, kernel, noise_variance, jitter);
    Ok(Arc::new(DensePosterior { gp: gp.map_err(|e| tensors.damaged(e))?, space }))
}

impl DensePosterior {
    fn points(&self, angles: &[HalfDiff]) -> Vec<[f64; 3]> {
        angles.iter().map(|&angles| self.space.coordinates(angles)).collect()
    }
}

impl Posterior for DensePosterior {
    fn solver(&self) -> &'static str {
        NAME
    }

    fn label(&self) -> &'static str {
        "Exact, dense"
    }

    fn space(&self) -> InputSpace {
        self.space
    }

    fn n_channels(&self) -> usize {
        self.gp.channels()
    }

    fn n_data(&self) -> usize {
        self.gp.n_samples()
    }

    fn n_floats(&self) -> usize {
        self.gp.n_samples() * (3 + self.gp.channels()) + self.gp.kernel().n_parameters() + 1
    }

    fn noise_variances(&self) -> Vec<f64> {
        vec![self.gp.noise_variance(); self.gp.channels()]
    }

    fn predict_mean(&self, angles: &[HalfDiff]) -> Vec<f64> {
        self.gp.mean_at(self.points(angles).as_flattened())
    }

    fn predict_variance(&self, angles: &[HalfDiff]) -> Result<Vec<f64>> {
        self.gp.predict_variance_latent(self.points(angles).as_flattened())
    }

    fn hyper(&self) -> Option<Hyper> {
        let (kernel, noise_variance) = (self.gp.kernel().clone(), self.gp.noise_variance());
        Some(Hyper::new(Solver::Dense, kernel, noise_variance, Some(self.space)))
    }

    fn kernel_name(&self) -> String {
        self.gp.kernel().name()
    }

    fn report(&self) -> Value {
        json!({
            "length_scale": length_scale_report(self.gp.kernel()),
            "signal_variance": self.gp.kernel().prior_variance(),
            "noise_variance": self.gp.noise_variance(),
            "jitter": self.gp.jitter(),
            "terms": self.gp.kernel(),
        })
    }

    fn save(&self, tensors: &mut TensorWriter) -> Result<Value> {
        let (n, channels) = (self.gp.n_samples(), self.gp.channels());
        tensors.add("x", &[n, 3], self.gp.inputs());
        tensors.add("targets", &[n, channels], &self.gp.targets());
        tensors.add("weights", &[n, channels], &self.gp.weights());
        crate::gp::tensors::header(&Header {
            space: self.space,
            kernel: self.gp.kernel().clone(),
            noise_variance: self.gp.noise_variance(),
            jitter: self.gp.jitter(),
            channels,
        })
    }

    fn device_form(&self) -> DeviceForm<'_> {
        DeviceForm::KernelSum(KernelSums::from(KernelSum {
            kernel: self.gp.kernel(),
            space: self.space,
            inputs: self.gp.inputs(),
            weights: self.gp.weights(),
            n_channels: self.gp.channels(),
        }))
    }
}
