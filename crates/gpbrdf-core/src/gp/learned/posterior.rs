//! The process with a learned prior as a posterior of a model.

use std::borrow::Cow;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::base::error::Result;
use crate::brdf::angles::{HalfDiff, check_finite};
use crate::gp::dense::row_major;
use crate::gp::hyper::{Hyper, length_scale_report};
use crate::gp::posterior::{DeviceForm, KernelSum, KernelSums, Posterior};
use crate::gp::scattered::{ScatteredGp, Widening};
use crate::gp::solver::Solver;
use crate::gp::tensors::{TensorReader, TensorWriter};
use crate::kernel::Kernel;
use crate::prior::{Colour, OPPONENT, Prior, PriorHeader, SPACE, from_opponent, variance_of_channels};
use crate::sample::layout::random_directions;
use crate::sample::space::{InputSpace, about_plane};

/// The solver's name in files and reports.
pub(crate) const NAME: &str = "learned";

/// Number of directions at which the share of the prior is measured, and the seed that draws them.
const SHARE_DIRECTIONS: usize = 1000;
const SHARE_SEED: u64 = 3;

/// The process of one kind of colour.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) gp: ScatteredGp,
    pub(super) space: InputSpace,
    /// Directions of the samples, in the order of the process.
    pub(super) angles: Vec<HalfDiff>,
}

impl Part {
    /// What samples in the plane of incidence leave open out of it: there the mean takes what the functions leave as
    /// it is in the plane, along `phi_d`. If that changes with the distance `z` from the plane as it does with
    /// `theta_h`, the variance of the error is `2 (k(0) - k(z))`. 0 for samples that lie otherwise.
    fn variance_off_plane(&self, at: HalfDiff) -> f64 {
        if self.space != InputSpace::PlaneOfIncidence {
            return 0.0;
        }
        let ([_, _, distance], kernel) = (about_plane(at), self.gp.kernel());
        2.0 * (kernel.prior_variance() - kernel.value(&[distance, 0.0, 0.0], &[0.0; 3]))
    }
}

/// The processes of both kinds of colour, and what they share.
#[derive(Debug)]
pub(super) struct LearnedPosterior {
    /// The prior of all materials, and the weights of its materials in the one that is used.
    prior: Arc<Prior>,
    weights: Vec<f64>,
    adapted: Arc<Prior>,
    /// Achromatic, chromatic.
    parts: [Part; 2],
    /// The prior's mean and its functions with their posterior coefficients: the constant of each channel, and the
    /// coefficients of the prior's centres, one column per channel.
    constants: [f64; 3],
    trend: Vec<f64>,
}

/// The parts of a saved process that are not tensors.
#[derive(Serialize, Deserialize)]
struct Header {
    prior: SavedPrior,
    #[serde(default)]
    library_weights: Vec<f64>,
    parts: [PartHeader; 2],
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SavedPrior {
    /// The checksum of the one that comes with the crate.
    BuiltIn { sha256: String },
    /// One whose functions are tensors of the file.
    Tensors(PriorHeader),
}

#[derive(Serialize, Deserialize)]
struct PartHeader {
    space: InputSpace,
    kernel: Kernel,
    noise_variance: f64,
    basis_variance: f64,
    #[serde(default)]
    widening: Widening,
}

/// Names of the parts in tensors.
const PARTS: [&str; 2] = ["achromatic", "chromatic"];

/// Reads a process that [`Posterior::save`] has written.
pub(crate) fn load(header: Value, tensors: &TensorReader<'_>) -> Result<Arc<dyn Posterior>> {
    let Header { prior, library_weights, parts } = tensors.header(header)?;
    let prior = match prior {
        SavedPrior::BuiltIn { sha256 } if sha256 == Prior::BUILT_IN_SHA256 => Prior::built_in(),
        SavedPrior::BuiltIn { sha256 } => {
            let expected = format!("the built-in prior {}", Prior::BUILT_IN_SHA256);
            return Err(tensors.wrong(expected, sha256));
        }
        SavedPrior::Tensors(header) => {
            Arc::new(Prior::from_tensors(header, tensors).map_err(|e| tensors.damaged(e))?)
        }
    };
    let adapted = prior.weighted(&library_weights).map_err(|e| tensors.damaged(e))?;
    let mut made = Vec::new();
    for ((name, colour), header) in PARTS.into_iter().zip(Colour::ALL).zip(parts) {
        header.space.validate().map_err(|e| tensors.damaged(e))?;
        if header.kernel.dimension() != 3 {
            return Err(tensors.wrong("a kernel of 3 coordinates", header.kernel.dimension().to_string()));
        }
        let read = |what: &str| tensors.read(&format!("{name}.{what}"));
        let (angles, noise, weights) = (read("angles")?, read("noise")?, read("weights")?);
        let (rows, rest) = angles.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(tensors.wrong("three angles per sample", format!("{} numbers", angles.len())));
        }
        let angles: Vec<HalfDiff> =
            rows.iter().map(|&[theta_h, theta_d, phi_d]| HalfDiff { theta_h, theta_d, phi_d }).collect();
        let PartHeader { space, kernel, noise_variance, basis_variance, widening } = header;
        let points = space.points(&angles);
        let basis = (adapted.features(colour, &angles), adapted.n_functions(colour), basis_variance);
        let channels = colour.rows().len();
        let gp = ScatteredGp::with_basis(kernel, noise_variance, noise, points, basis, channels, weights);
        let gp = gp.and_then(|gp| gp.widened(widening)).map_err(|e| tensors.damaged(e))?;
        made.push(Part { gp, space, angles });
    }
    match <[Part; 2]>::try_from(made) {
        Ok(parts) => Ok(Arc::new(LearnedPosterior::new(prior, (library_weights, adapted), parts))),
        Err(_) => Err(tensors.wrong("processes of two kinds of colours", "others")),
    }
}

impl LearnedPosterior {
    /// A process with a prior, the weights of its materials and the prior that these lead to.
    pub(super) fn new(
        prior: Arc<Prior>,
        (weights, adapted): (Vec<f64>, Arc<Prior>),
        parts: [Part; 2],
    ) -> Self {
        let [bright, coloured] = &parts;
        let colours = [
            adapted.combined(Colour::Achromatic, &bright.gp.basis_coefficients(0)),
            adapted.combined(Colour::Chromatic, &coloured.gp.basis_coefficients(0)),
            adapted.combined(Colour::Chromatic, &coloured.gp.basis_coefficients(1)),
        ];
        let centre = |j: usize| from_opponent(colours.each_ref().map(|(_, column)| column[j]));
        let trend = (0..3).flat_map(|c| (0..prior.span().len()).map(move |j| (c, j)));
        let trend = trend.map(|(c, j)| centre(j)[c]).collect();
        let constants = from_opponent(colours.each_ref().map(|(constant, _)| *constant));
        Self { prior, weights, adapted, parts, constants, trend }
    }

    /// The part of the mean that is due to the kernels, and the prior's part.
    fn means(&self, angles: &[HalfDiff]) -> impl Iterator<Item = ([f64; 3], [f64; 3])> + '_ {
        // Coordinates take long, and the spaces are usually the same.
        let in_prior = SPACE.points(angles);
        let points = |space: InputSpace| {
            if space == SPACE { Cow::Borrowed(&in_prior) } else { Cow::Owned(space.points(angles)) }
        };
        let [bright, coloured] = self.parts.each_ref().map(|part| part.gp.mean_at(&points(part.space)));
        let trend = self.prior.span().values_at(&self.trend, &in_prior);
        (0..bright.len()).map(move |i| {
            let own = from_opponent([bright[i], coloured[2 * i], coloured[2 * i + 1]]);
            (own, std::array::from_fn(|c| self.constants[c] + trend[3 * i + c]))
        })
    }

    /// The share of the prior in the variance of the mean over directions that are spread over the box.
    fn share_of_prior(&self) -> f64 {
        let angles = random_directions(SHARE_DIRECTIONS, 0.95, SHARE_SEED);
        let (mut all, mut rest) = (Moments::default(), Moments::default());
        for (own, trend) in self.means(&angles) {
            for c in 0..3 {
                all.add(own[c] + trend[c]);
                rest.add(own[c]);
            }
        }
        (1.0 - rest.variance() / all.variance().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
    }
}

/// Running moments.
#[derive(Default)]
struct Moments {
    count: f64,
    sum: f64,
    squares: f64,
}

impl Moments {
    fn add(&mut self, x: f64) {
        self.count += 1.0;
        self.sum += x;
        self.squares += x * x;
    }

    fn variance(&self) -> f64 {
        (self.squares - self.sum * self.sum / self.count) / self.count
    }
}

impl Posterior for LearnedPosterior {
    fn solver(&self) -> &'static str {
        NAME
    }

    fn label(&self) -> &'static str {
        "Learned prior, exact mean"
    }

    fn space(&self) -> InputSpace {
        self.parts[0].space
    }

    fn n_channels(&self) -> usize {
        3
    }

    fn n_data(&self) -> usize {
        self.parts[0].angles.len()
    }

    fn n_floats(&self) -> usize {
        // Angles, noise and weights of each sample in both processes; what is stored of the prior is not counted.
        let parameters = self.parts.iter().map(|part| part.gp.kernel().n_parameters() + 2).sum::<usize>();
        self.n_data() * (2 * 4 + 3) + parameters
    }

    fn noise_variances(&self) -> Vec<f64> {
        let [bright, coloured] = self.parts.each_ref().map(|part| part.gp.noise_variance());
        vec![variance_of_channels(bright, coloured); 3]
    }

    fn predict_mean(&self, angles: &[HalfDiff]) -> Vec<f64> {
        self.means(angles).flat_map(|(own, trend)| [0, 1, 2].map(|c| own[c] + trend[c])).collect()
    }

    fn predict_variance(&self, angles: &[HalfDiff]) -> Result<Vec<f64>> {
        check_finite(angles)?;
        let [bright, coloured] = Colour::ALL.map(|colour| {
            let part = &self.parts[colour as usize];
            let features = self.adapted.features(colour, angles);
            let mut variances = part.gp.variance_at(&part.space.points(angles), &features)?;
            variances.iter_mut().zip(angles).for_each(|(v, &at)| *v += part.variance_off_plane(at));
            Ok(variances)
        });
        let (bright, coloured): (Vec<f64>, Vec<f64>) = (bright?, coloured?);
        let rows = bright.into_iter().zip(coloured).zip(angles);
        let calibration = self.prior.calibration();
        let space = self.space();
        Ok(rows.map(|((a, c), at)| calibration.of_variance(space, at) * variance_of_channels(a, c)).collect())
    }

    fn hyper(&self) -> Option<Hyper> {
        let [bright, coloured] = self.parts.each_ref().map(|Part { gp, space, .. }| Hyper {
            basis_variance: Some(gp.basis_variance()),
            ..Hyper::new(Solver::Scattered, gp.kernel().clone(), gp.noise_variance(), Some(*space))
        });
        Some(Hyper { chromatic: Some(Box::new(coloured)), library_weights: self.weights.clone(), ..bright })
    }

    fn kernel_name(&self) -> String {
        format!("{} + learned", self.parts[0].gp.kernel().name())
    }

    fn report(&self) -> Value {
        let [bright, coloured] = self.parts.each_ref().map(|Part { gp, space, .. }| {
            json!({
                "space": space,
                "length_scale": length_scale_report(gp.kernel()),
                "signal_variance": gp.kernel().prior_variance(),
                "prior_variance": gp.basis_variance(),
                "noise_variance": gp.noise_variance(),
                "terms": gp.kernel(),
            })
        });
        json!({
            "prior": self.prior.name,
            "prior_materials": self.prior.materials.len(),
            "share_of_prior": self.share_of_prior(),
            "achromatic": bright,
            "chromatic": coloured,
        })
    }

    fn save(&self, tensors: &mut TensorWriter) -> Result<Value> {
        let prior = if *self.prior == *Prior::built_in() {
            SavedPrior::BuiltIn { sha256: Prior::BUILT_IN_SHA256.to_owned() }
        } else {
            SavedPrior::Tensors(self.prior.add_to(tensors))
        };
        for (name, Part { gp, angles, .. }) in PARTS.into_iter().zip(&self.parts) {
            let rows: Vec<f64> = angles.iter().flat_map(|a| [a.theta_h, a.theta_d, a.phi_d]).collect();
            tensors.add(&format!("{name}.angles"), &[angles.len(), 3], &rows);
            tensors.add(&format!("{name}.noise"), &[angles.len()], gp.noise());
            let channels = gp.weights().len() / angles.len();
            tensors.add(&format!("{name}.weights"), &[channels, angles.len()], gp.weights());
        }
        let parts = self.parts.each_ref().map(|Part { gp, space, .. }| PartHeader {
            space: *space,
            kernel: gp.kernel().clone(),
            noise_variance: gp.noise_variance(),
            basis_variance: gp.basis_variance(),
            widening: gp.widening(),
        });
        crate::gp::tensors::header(&Header { prior, library_weights: self.weights.clone(), parts })
    }

    fn device_form(&self) -> DeviceForm<'_> {
        let mut sums = vec![KernelSum {
            kernel: self.prior.span().kernel(),
            space: SPACE,
            inputs: self.prior.span().inputs(),
            weights: row_major(&self.trend, 3),
            n_channels: 3,
        }];
        sums.extend(Colour::ALL.map(|colour| {
            let Part { gp, space, .. } = &self.parts[colour as usize];
            let rows = &OPPONENT[colour.rows()];
            // Weights of the colours become weights of the channels.
            let weights = row_major(gp.weights(), rows.len());
            let weights = weights.chunks(rows.len()).flat_map(|own| {
                let channel = |c: usize| own.iter().zip(rows).map(|(w, row)| w * row[c]).sum();
                [0, 1, 2].map(channel)
            });
            KernelSum {
                kernel: gp.kernel(),
                space: *space,
                inputs: gp.inputs(),
                weights: weights.collect(),
                n_channels: 3,
            }
        }));
        DeviceForm::KernelSum(KernelSums { sums, constants: self.constants })
    }
}
