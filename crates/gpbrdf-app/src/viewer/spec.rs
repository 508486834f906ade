//! What the model panel asks for: how to sample a source and which model to fit.

use anyhow::{Result, bail};
use gpbrdf_core::gp::dense_cost;
use gpbrdf_core::kernel::ParameterKind;
use gpbrdf_core::{
    FitOptions, Hyper, LatticeLayout, Layout, MeanFunction, Noise, SampleSet, Shape, Solver, Source,
    Symmetry, Transform, detect_symmetry,
};
use serde::{Deserialize, Serialize};

/// Where to measure a source that can be asked anywhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum LayoutKind {
    #[default]
    Lattice,
    Random,
    Cells,
}

/// The symmetry to rely on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum SymmetryKind {
    #[default]
    Auto,
    Bilateral,
    Reciprocal,
}

/// What is fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum TransformKind {
    #[default]
    Log,
    Identity,
    CubeRoot,
}

/// The shape of a kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum KernelKind {
    SquaredExponential,
    RationalQuadratic,
    Matern12,
    Matern32,
    #[default]
    Matern52,
}

impl LayoutKind {
    pub(crate) const ALL: [Self; 3] = [Self::Lattice, Self::Random, Self::Cells];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Lattice => "Lattice",
            Self::Random => "Random directions",
            Self::Cells => "Table cells",
        }
    }
}

impl SymmetryKind {
    pub(crate) const ALL: [Self; 3] = [Self::Auto, Self::Bilateral, Self::Reciprocal];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Auto => "Measured",
            Self::Bilateral => "Bilateral",
            Self::Reciprocal => "Reciprocal only",
        }
    }
}

impl TransformKind {
    pub(crate) const ALL: [Self; 3] = [Self::Log, Self::Identity, Self::CubeRoot];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Log => "ln(f + ε)",
            Self::Identity => "f",
            Self::CubeRoot => "Cube root of f",
        }
    }
}

impl KernelKind {
    pub(crate) const ALL: [Self; 5] =
        [Self::Matern52, Self::Matern32, Self::Matern12, Self::SquaredExponential, Self::RationalQuadratic];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::SquaredExponential => "Squared exponential",
            Self::RationalQuadratic => "Rational quadratic",
            Self::Matern12 => "Matérn 1/2",
            Self::Matern32 => "Matérn 3/2",
            Self::Matern52 => "Matérn 5/2",
        }
    }

    fn shape(self) -> Shape {
        match self {
            Self::SquaredExponential => Shape::SquaredExponential,
            Self::RationalQuadratic => Shape::RationalQuadratic { alpha: 1.0 },
            Self::Matern12 => Shape::Matern12,
            Self::Matern32 => Shape::Matern32,
            Self::Matern52 => Shape::Matern52,
        }
    }
}

/// How to sample and fit one material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct ModelSpec {
    pub(crate) layout: LayoutKind,
    /// Nodes of the lattice along `theta_h`, `theta_d`, `phi_d`.
    pub(crate) shape: [usize; 3],
    /// Samples off a lattice.
    pub(crate) count: usize,
    pub(crate) seed: u64,
    pub(crate) symmetry: SymmetryKind,
    /// The kernel along each axis; off a lattice the first is that of all axes.
    pub(crate) kernels: [KernelKind; 3],
    pub(crate) transform: TransformKind,
    /// sr^-1, of the logarithmic transform.
    pub(crate) epsilon: f64,
    pub(crate) mean: MeanFunction,
    /// Noise variance in squared target units; found with the rest where there is none.
    pub(crate) noise: Option<f64>,
    /// Hyper-parameters set by hand; the search finds them where there are none.
    pub(crate) hyper: Option<Hyper>,
}

impl Default for ModelSpec {
    fn default() -> Self {
        Self {
            layout: LayoutKind::Lattice,
            shape: LatticeLayout::default().shape,
            count: 800,
            seed: 0,
            symmetry: SymmetryKind::Auto,
            kernels: [KernelKind::default(); 3],
            transform: TransformKind::Log,
            epsilon: 1e-3,
            mean: MeanFunction::Constant,
            noise: None,
            hyper: None,
        }
    }
}

/// What samples depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SampleKey {
    layout: LayoutKind,
    shape: [usize; 3],
    count: usize,
    seed: u64,
    symmetry: SymmetryKind,
}

/// Evaluations of a dense search, for a forecast of its time.
const TYPICAL_EVALUATIONS: usize = 40;

impl ModelSpec {
    /// What the samples depend on: nothing that leaves them alone is in it.
    pub(crate) fn sample_key(&self) -> SampleKey {
        let on_lattice = self.layout == LayoutKind::Lattice;
        SampleKey {
            layout: self.layout,
            shape: if on_lattice { self.shape } else { [0; 3] },
            count: if on_lattice { 0 } else { self.count },
            seed: if on_lattice { 0 } else { self.seed },
            symmetry: if on_lattice { self.symmetry } else { SymmetryKind::Auto },
        }
    }

    /// Number of samples of a source that can be asked anywhere.
    pub(crate) fn samples(&self) -> usize {
        match self.layout {
            LayoutKind::Lattice => self.shape.iter().product(),
            _ => self.count,
        }
    }

    /// Measures a source.
    pub(crate) fn measure(&self, source: &Source) -> Result<SampleSet> {
        if let gpbrdf_core::Content::Samples(samples) = &source.content {
            dense_cost(samples.samples.len(), 3, TYPICAL_EVALUATIONS).check()?;
            return Ok(SampleSet::from(samples));
        }
        let Some(brdf) = source.brdf() else { bail!("{}: nothing to sample", source.origin()) };
        let layout = match self.layout {
            LayoutKind::Lattice => {
                let symmetry = match self.symmetry {
                    SymmetryKind::Auto => detect_symmetry(brdf),
                    SymmetryKind::Bilateral => Symmetry::Bilateral,
                    SymmetryKind::Reciprocal => Symmetry::Reciprocal,
                };
                Layout::Lattice(LatticeLayout::with_shape(self.shape, symmetry))
            }
            LayoutKind::Random => Layout::Random { count: self.count, seed: self.seed },
            LayoutKind::Cells => Layout::Cells { count: self.count, seed: self.seed },
        };
        if self.layout != LayoutKind::Lattice {
            dense_cost(self.count, 3, TYPICAL_EVALUATIONS).check()?;
        }
        Ok(SampleSet::measure(brdf, &layout)?)
    }

    /// The shapes of the three kernels.
    pub(crate) fn shapes(&self) -> [[Shape; 1]; 3] {
        self.kernels.map(|kernel| [kernel.shape()])
    }

    /// The options of a fit.
    pub(crate) fn options(&self) -> FitOptions {
        let transform = match self.transform {
            TransformKind::Log => Transform::Log { epsilon: self.epsilon },
            TransformKind::Identity => Transform::Identity,
            TransformKind::CubeRoot => Transform::CubeRoot,
        };
        FitOptions {
            solver: Solver::Auto,
            transform,
            mean: self.mean,
            noise: self.noise.map_or(Noise::Optimized, Noise::Fixed),
            ..FitOptions::default()
        }
    }
}

/// One hyper-parameter to set by hand.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HyperParameter {
    pub(crate) name: String,
    pub(crate) value: f64,
    /// What it may be.
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

/// All hyper-parameters, in an order that [`set_hyper_parameter`] knows.
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
    use gpbrdf_core::gp::LatticeHyper;
    use gpbrdf_core::kernel::Kernel1d;

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

    #[test]
    fn samples_stay_when_only_the_kernel_changes() {
        let spec = ModelSpec::default();
        let other = ModelSpec { kernels: [KernelKind::Matern12; 3], seed: 9, ..spec.clone() };
        assert_eq!(spec.sample_key(), other.sample_key());
        assert_ne!(spec.sample_key(), ModelSpec { shape: [8, 8, 8], ..spec.clone() }.sample_key());
        assert_eq!(spec.samples(), 36_864);
    }
}
