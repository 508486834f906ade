//! Hyper-parameters to set by hand: their names for people and the ranges of their sliders.

use anyhow::Result;
use gpbrdf_core::{Hyper, ParameterKind};

/// One hyper-parameter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HyperParameter {
    pub(crate) name: String,
    pub(crate) value: f64,
    /// The values that it may have.
    pub(crate) range: (f64, f64),
}

const AXES: [&str; 3] = ["θh", "θd", "φd"];
const LENGTHS: (f64, f64) = (1e-3, 1e2);
const VARIANCES: (f64, f64) = (1e-4, 1e4);
const NOISES: (f64, f64) = (1e-12, 1.0);
const ALPHAS: (f64, f64) = (0.05, 1e3);

fn named(kind: ParameterKind, value: f64, axis: Option<usize>) -> HyperParameter {
    let (name, range) = match kind {
        ParameterKind::LengthScale(k) => (format!("Length scale {}", AXES[k.min(2)]), LENGTHS),
        ParameterKind::Alpha => {
            (axis.map_or_else(|| "Mixture α".to_owned(), |k| format!("Mixture α {}", AXES[k])), ALPHAS)
        }
        ParameterKind::Weight => ("Weight".to_owned(), VARIANCES),
        ParameterKind::Variance => ("Signal variance".to_owned(), VARIANCES),
    };
    HyperParameter { name, value, range }
}

/// All hyper-parameters, in the order of [`set_hyper_parameter`]'s index.
pub(crate) fn hyper_parameters(hyper: &Hyper) -> Vec<HyperParameter> {
    let noise = |value| HyperParameter { name: "Noise variance".to_owned(), value, range: NOISES };
    match hyper {
        Hyper::Lattice(lattice) => {
            let axes = lattice.kernels.iter().enumerate().flat_map(|(k, kernel)| {
                let values = kernel.log_parameters().into_iter().map(f64::exp);
                kernel
                    .parameter_kinds(k)
                    .into_iter()
                    .zip(values)
                    .map(move |(kind, v)| named(kind, v, Some(k)))
            });
            let mut all: Vec<_> = axes.collect();
            all.push(named(ParameterKind::Variance, lattice.signal_variance, None));
            all.push(noise(lattice.noise_variance));
            all
        }
        Hyper::Dense { kernel, noise_variance } => {
            let values = kernel.log_parameters().into_iter().map(f64::exp);
            let mut all: Vec<_> = kernel
                .parameter_kinds()
                .into_iter()
                .zip(values)
                .map(|(kind, v)| named(kind, v, None))
                .collect();
            all.push(noise(*noise_variance));
            all
        }
    }
}

/// Sets the hyper-parameter at `index` of [`hyper_parameters`].
pub(crate) fn set_hyper_parameter(hyper: &mut Hyper, index: usize, value: f64) -> Result<()> {
    match hyper {
        Hyper::Lattice(lattice) => {
            let mut left = index;
            for kernel in &mut lattice.kernels {
                if left < kernel.n_parameters() {
                    let mut values = kernel.log_parameters();
                    values[left] = value.ln();
                    kernel.set_log_parameters(&values)?;
                    return Ok(());
                }
                left -= kernel.n_parameters();
            }
            if left == 0 {
                lattice.signal_variance = value;
            } else {
                lattice.noise_variance = value;
            }
        }
        Hyper::Dense { kernel, noise_variance } => {
            let mut values = kernel.log_parameters();
            if let Some(log) = values.get_mut(index) {
                *log = value.ln();
                kernel.set_log_parameters(&values)?;
            } else {
                *noise_variance = value;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use gpbrdf_core::{Kernel1d, LatticeHyper, Shape};

    #[test]
    fn every_hyper_parameter_is_set_where_it_is_read() {
        let mut hyper = Hyper::Lattice(LatticeHyper {
            signal_variance: 2.0,
            noise_variance: 1e-5,
            kernels: [
                Kernel1d::new(Shape::Matern52, 0.1),
                Kernel1d::new(Shape::RationalQuadratic { alpha: 2.0 }, 0.2),
                Kernel1d::new(Shape::SquaredExponential, 0.3),
            ],
        });
        let names: Vec<_> = hyper_parameters(&hyper).into_iter().map(|p| p.name).collect();
        assert_eq!(names.len(), 6);
        assert_eq!((names[2].as_str(), names[5].as_str()), ("Mixture α θd", "Noise variance"));
        for index in 0..6 {
            set_hyper_parameter(&mut hyper, index, 0.5 + index as f64).unwrap();
        }
        for (index, parameter) in hyper_parameters(&hyper).into_iter().enumerate() {
            assert!((parameter.value - 0.5 - index as f64).abs() < 1e-12, "{parameter:?}");
        }
        assert!(set_hyper_parameter(&mut hyper, 0, f64::NAN).is_err());
    }
}
