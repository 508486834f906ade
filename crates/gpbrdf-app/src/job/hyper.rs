//! Hyper-parameters to set by hand: their names for people and the ranges of their sliders.

use gpbrdf_core::Hyper;
use gpbrdf_core::gp::HyperKind;

/// A slider of one hyper-parameter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HyperSlider {
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

/// The sliders of all hyper-parameters, in the order of [`Hyper::parameters`].
pub(crate) fn hyper_sliders(hyper: &Hyper) -> Vec<HyperSlider> {
    let slider = |kind, value| {
        let (name, range) = match kind {
            HyperKind::LengthScale(axis) => (format!("Length scale {}", AXES[axis.min(2)]), LENGTHS),
            HyperKind::Alpha(Some(axis)) => (format!("Mixture α {}", AXES[axis.min(2)]), ALPHAS),
            HyperKind::Alpha(None) => ("Mixture α".to_owned(), ALPHAS),
            HyperKind::Weight => ("Weight".to_owned(), VARIANCES),
            HyperKind::SignalVariance => ("Signal variance".to_owned(), VARIANCES),
            HyperKind::NoiseVariance => ("Noise variance".to_owned(), NOISES),
        };
        HyperSlider { name, value, range }
    };
    hyper.parameters().into_iter().map(|parameter| slider(parameter.kind, parameter.value)).collect()
}

#[cfg(test)]
mod tests {
    use gpbrdf_core::kernel::{AxisMetric, Kernel, Kernel1d};
    use gpbrdf_core::{Shape, Solver};

    use super::*;

    #[test]
    fn every_hyper_parameter_has_a_name_and_is_within_its_range() {
        let shapes = [Shape::Matern52, Shape::RationalQuadratic { alpha: 2.0 }, Shape::SquaredExponential];
        let axes = shapes.map(|shape| (Kernel1d::new(shape, 0.1), AxisMetric::Linear));
        let kernel = Kernel::product(2.0, axes.to_vec());
        let hyper = Hyper::new(Solver::Lattice, kernel, 1e-5, None);
        let sliders = hyper_sliders(&hyper);
        let names: Vec<&str> = sliders.iter().map(|slider| slider.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "Signal variance",
                "Length scale θh",
                "Length scale θd",
                "Mixture α θd",
                "Length scale φd",
                "Noise variance"
            ]
        );
        for HyperSlider { name, value, range } in sliders {
            assert!(range.0 < value && value < range.1, "{name}");
        }
    }
}
