//! Hyper-parameters, in one form for every solver.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::base::error::{Error, Result};
use crate::gp::solver::Solver;
use crate::kernel::{Kernel, KernelBody, ParameterKind};
use crate::sample::space::InputSpace;

/// The smallest ratio of noise variance to signal variance. It keeps the covariance positive definite in f64.
pub(crate) const MIN_NOISE_RATIO: f64 = 1e-9;

/// Names of the three axes of the warped box.
pub(crate) const AXIS_NAMES: [&str; 3] = ["u", "v", "phi"];

/// The hyper-parameters of a process whose channels share them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hyper {
    /// The solver that these hyper-parameters belong to.
    pub solver: Solver,
    /// The kernel, with the variances of its terms. For the lattice solver it is a single product term.
    pub kernel: Kernel,
    /// Noise variance, in squared target units.
    pub noise_variance: f64,
    /// The input space of the kernel, where a solver has chosen it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub space: Option<InputSpace>,
    /// The variance of the principal functions of a learned prior, where one is used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub basis_variance: Option<f64>,
    /// The hyper-parameters of the chromatic colours, where a learned prior is used; the others are those of the
    /// achromatic one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chromatic: Option<Box<Hyper>>,
    /// The weights of the library's materials in a learned prior; empty where none is used, or all weigh the same.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub library_weights: Vec<f64>,
}

impl Hyper {
    /// Hyper-parameters that all channels share, without a learned prior.
    #[must_use]
    pub fn new(solver: Solver, kernel: Kernel, noise_variance: f64, space: Option<InputSpace>) -> Self {
        Self {
            solver,
            kernel,
            noise_variance,
            space,
            basis_variance: None,
            chromatic: None,
            library_weights: Vec::new(),
        }
    }
}

/// The length scales of a kernel as JSON for reports: of its only term, or a list with those of each.
pub(crate) fn length_scale_report(kernel: &Kernel) -> Value {
    let mut lengths: Vec<Value> = kernel
        .terms
        .iter()
        .map(|term| match &term.body {
            KernelBody::Ard { length_scale, .. } => json!(length_scale),
            KernelBody::Product(axes) => json!(axes),
        })
        .collect();
    if lengths.len() == 1 { lengths.remove(0) } else { Value::Array(lengths) }
}

/// The role of a hyper-parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HyperKind {
    /// The variance of a term of the kernel, in squared target units.
    SignalVariance,
    /// The weight of one term in the sum of kernels along one axis.
    Weight,
    /// The length scale along the axis of this index, in the unit of the coordinate.
    LengthScale(usize),
    /// The mixture parameter `alpha` of a rational quadratic kernel: `Some(k)` for a kernel along axis `k`,
    /// `None` for a kernel of the joint distance.
    Alpha(Option<usize>),
    /// The noise variance, in squared target units.
    NoiseVariance,
}

/// One hyper-parameter and its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HyperParameter {
    /// The role of this hyper-parameter.
    pub kind: HyperKind,
    /// Its value, positive.
    pub value: f64,
}

impl Hyper {
    /// All hyper-parameters: the kernel's, in the order of [`Kernel::log_parameters`], followed by the noise
    /// variance.
    #[must_use]
    pub fn parameters(&self) -> Vec<HyperParameter> {
        let mut kinds = Vec::with_capacity(self.kernel.n_parameters() + 1);
        for term in &self.kernel.terms {
            kinds.push(HyperKind::SignalVariance);
            match &term.body {
                KernelBody::Ard { shape, length_scale } => {
                    kinds.extend((0..length_scale.len()).map(HyperKind::LengthScale));
                    kinds.extend(shape.has_alpha().then_some(HyperKind::Alpha(None)));
                }
                KernelBody::Product(axes) => {
                    for (k, axis) in axes.iter().enumerate() {
                        kinds.extend(axis.parameter_kinds(k).into_iter().map(|kind| match kind {
                            ParameterKind::Variance => HyperKind::SignalVariance,
                            ParameterKind::Weight => HyperKind::Weight,
                            ParameterKind::LengthScale(axis) => HyperKind::LengthScale(axis),
                            ParameterKind::Alpha => HyperKind::Alpha(Some(k)),
                        }));
                    }
                }
            }
        }
        kinds.push(HyperKind::NoiseVariance);
        let values = self.kernel.log_parameters().into_iter().map(f64::exp).chain([self.noise_variance]);
        kinds.into_iter().zip(values).map(|(kind, value)| HyperParameter { kind, value }).collect()
    }

    /// Sets the hyper-parameter at position `index` of [`Hyper::parameters`].
    ///
    /// # Errors
    /// A value that is not positive and finite, or an index out of range.
    pub fn set(&mut self, index: usize, value: f64) -> Result<()> {
        if !(value > 0.0 && value.is_finite()) {
            return Err(Error::argument("hyper-parameter", "a positive number", value));
        }
        let mut values = self.kernel.log_parameters();
        let count = values.len();
        match values.get_mut(index) {
            Some(log) => {
                *log = value.ln();
                self.kernel.set_log_parameters(&values)
            }
            None if index == count => {
                self.noise_variance = value;
                Ok(())
            }
            None => Err(Error::argument("index of a hyper-parameter", format!("at most {count}"), index)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{AxisMetric, Kernel1d, Shape};

    #[test]
    fn every_hyper_parameter_is_set_where_it_is_read() {
        let shapes = [Shape::Matern52, Shape::RationalQuadratic { alpha: 2.0 }, Shape::SquaredExponential];
        let axes = shapes.map(|shape| (Kernel1d::new(shape, 0.1), AxisMetric::Linear));
        let product = Kernel::product(2.0, axes.to_vec());
        let ard = Kernel::ard(2.0, Shape::RationalQuadratic { alpha: 1.0 }, &[0.1, 0.2, 0.3]);
        for (solver, kernel, alpha) in [
            (Solver::Lattice, product, HyperKind::Alpha(Some(1))),
            (Solver::Dense, ard, HyperKind::Alpha(None)),
        ] {
            let mut hyper = Hyper::new(solver, kernel, 1e-5, None);
            let count = hyper.parameters().len();
            assert_eq!(count, 6);
            assert!(hyper.parameters().iter().any(|p| p.kind == alpha));
            assert_eq!(hyper.parameters()[5].kind, HyperKind::NoiseVariance);
            for index in 0..count {
                hyper.set(index, 0.5 + index as f64).unwrap();
            }
            for (index, parameter) in hyper.parameters().into_iter().enumerate() {
                assert!((parameter.value - 0.5 - index as f64).abs() < 1e-12, "{parameter:?}");
            }
            assert!(hyper.set(0, f64::NAN).is_err() && hyper.set(6, 1.0).is_err());
        }
    }
}
