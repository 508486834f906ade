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
    /// What it is, with its unit.
    pub(crate) help: &'static str,
}

const AXES: [&str; 3] = ["θh", "θd", "φd"];
const LENGTHS: (f64, f64) = (1e-3, 1e2);
const VARIANCES: (f64, f64) = (1e-4, 1e4);
const NOISES: (f64, f64) = (1e-12, 1.0);
const ALPHAS: (f64, f64) = (0.05, 1e3);

/// The sliders of all hyper-parameters, in the order of [`Hyper::parameters`].
pub(crate) fn hyper_sliders(hyper: &Hyper) -> Vec<HyperSlider> {
    let slider = |kind, value| {
        let (name, range, help) = match kind {
            HyperKind::LengthScale(axis) => {
                let help =
                    "The distance over which values resemble each other, in units of the kernel's coordinate";
                (format!("Length scale {}", AXES[axis.min(2)]), LENGTHS, help)
            }
            HyperKind::Alpha(Some(axis)) => (
                format!("Mixture α {}", AXES[axis.min(2)]),
                ALPHAS,
                "The mixture of length scales, without a unit",
            ),
            HyperKind::Alpha(None) => {
                ("Mixture α".to_owned(), ALPHAS, "The mixture of length scales, without a unit")
            }
            HyperKind::Weight => ("Weight".to_owned(), VARIANCES, "The share of a kernel, without a unit"),
            HyperKind::SignalVariance => {
                let help = "How much the target varies about its mean, in squared units of the target";
                ("Signal variance".to_owned(), VARIANCES, help)
            }
            HyperKind::NoiseVariance => {
                let help = "The variance of the error of a measurement, in squared units of the target";
                ("Noise variance".to_owned(), NOISES, help)
            }
        };
        HyperSlider { name, value, range, help }
    };
    hyper.parameters().into_iter().map(|parameter| slider(parameter.kind, parameter.value)).collect()
}

/// The name for people of a hyper-parameter that a report names by its place: `terms[0].log_length_scale[2]` and
/// `terms[0].axes[2].terms[0].log_length_scale` are the length scale φd here. A process that is named in front of it
/// stays there.
pub(crate) fn bound_name(name: &str) -> String {
    let (process, place) =
        name.rsplit_once(' ').map_or((None, name), |(process, place)| (Some(process), place));
    let index = |part: &str, word: &str| {
        part.strip_prefix(word)?.strip_prefix('[')?.strip_suffix(']')?.parse::<usize>().ok()
    };
    let mut parts: Vec<&str> = place.split('.').collect();
    let last = parts.pop().unwrap_or_default();
    let word = last.split('[').next().unwrap_or_default();
    let axis = index(last, word).or_else(|| parts.iter().find_map(|part| index(part, "axes")));
    let term = parts.first().and_then(|part| index(part, "terms")).filter(|&term| term > 0);
    let mut text = match word.trim_start_matches("log_") {
        "noise_ratio" => "ratio of noise to signal".to_owned(),
        "alpha" => "mixture α".to_owned(),
        other => other.replace('_', " "),
    };
    text.extend(axis.map(|axis| format!(" {}", AXES[axis.min(2)])));
    text.extend(term.map(|term| format!(" of kernel {}", term + 1)));
    process.map_or(text.clone(), |process| format!("{process} {text}"))
}

#[cfg(test)]
mod tests {
    use gpbrdf_core::kernel::{AxisMetric, Kernel, Kernel1d};
    use gpbrdf_core::{Shape, Solver};

    use super::*;

    #[test]
    fn bounds_are_named_in_words() {
        for (name, words) in [
            ("noise_ratio", "ratio of noise to signal"),
            ("terms[0].log_length_scale[2]", "length scale φd"),
            ("terms[1].log_variance", "variance of kernel 2"),
            ("terms[0].axes[1].terms[0].log_alpha", "mixture α θd"),
            ("achromatic noise_ratio", "achromatic ratio of noise to signal"),
        ] {
            assert_eq!(bound_name(name), words);
        }
    }

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
        for HyperSlider { name, value, range, help } in sliders {
            assert!(range.0 < value && value < range.1 && help.contains("unit"), "{name}");
        }
    }
}
