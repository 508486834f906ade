//! From samples to a model.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::angles::HalfDiff;
use crate::brdf::{Brdf, Rgb};
use crate::condition::fit_per_axis;
use crate::error::Result;
use crate::gp::{FitReport, Noise, OptimizeOptions};
use crate::kernel::{Kernel1d, Shape, Term1d};
use crate::layout::{LatticeLayout, Symmetry, random_cells, random_directions};
use crate::model::{Model, Provenance};
use crate::samples::Samples;
use crate::space::InputSpace;
use crate::target::{MeanFunction, Transform};

/// Which directions to measure.
#[derive(Clone, Debug, PartialEq)]
pub enum Layout {
    /// A product lattice in the warped box.
    Lattice(LatticeLayout),
    /// Directions drawn uniformly in the warped box.
    Random {
        /// How many.
        count: usize,
        /// Seed of the draw.
        seed: u64,
    },
    /// Centres of valid table cells drawn without replacement.
    Cells {
        /// How many.
        count: usize,
        /// Seed of the draw.
        seed: u64,
    },
}

/// Measured values at known directions: what a model is fitted to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampleSet {
    /// Directions.
    pub angles: Vec<HalfDiff>,
    /// `f` in sr^-1 at each of them.
    pub values: Vec<Rgb>,
    /// The lattice that the directions stand on, if they do; they are in its order.
    pub lattice: Option<LatticeLayout>,
    /// Name of the layout for reports: `lattice`, `random`, `cells` or `samples`.
    pub layout: &'static str,
}

impl SampleSet {
    /// Measures `brdf` at the directions of a layout, in parallel.
    ///
    /// # Errors
    /// A broken layout.
    pub fn measure(brdf: &dyn Brdf, layout: &Layout) -> Result<Self> {
        let (angles, lattice, name) = match layout {
            Layout::Lattice(lattice) => {
                lattice.validate()?;
                (lattice.directions(), Some(lattice.clone()), "lattice")
            }
            Layout::Random { count, seed } => {
                (random_directions(*count, LatticeLayout::default().v_max, *seed), None, "random")
            }
            Layout::Cells { count, seed } => (random_cells(*count, *seed), None, "cells"),
        };
        let values = angles.par_iter().with_min_len(256).map(|&a| brdf.eval_half_diff(a)).collect();
        Ok(Self { angles, values, lattice, layout: name })
    }
}

impl From<&Samples> for SampleSet {
    fn from(samples: &Samples) -> Self {
        Self {
            angles: samples.samples.iter().map(|s| HalfDiff::from_directions(&s.wi, &s.wo)).collect(),
            values: samples.samples.iter().map(|s| s.value).collect(),
            lattice: None,
            layout: "samples",
        }
    }
}

/// Largest difference in `ln(f + 1e-3)` between `phi_d` and `pi - phi_d` that still counts as bilateral, as a root
/// mean square over the probes.
const BILATERAL_TOLERANCE: f64 = 0.03;

/// Probes `brdf` at 64 pairs `phi_d`, `pi - phi_d` and says which symmetry its samples can rely on: bilateral where
/// `ln(f + 1e-3)` differs by less than 3 % root mean square.
#[must_use]
pub fn detect_symmetry(brdf: &dyn Brdf) -> Symmetry {
    let lattice = LatticeLayout { shape: [4, 4, 4], v_max: 0.9, ..LatticeLayout::default() };
    let [u, v, phi] = lattice.nodes();
    // Off the ends of phi, where both sides are the same direction.
    let phi = phi.iter().map(|p| 0.1 + 0.8 * p);
    let mut sum = 0.0;
    for phi in phi {
        for (&u, &v) in u.iter().flat_map(|u| v.iter().map(move |v| (u, v))) {
            let side = |phi| brdf.eval_half_diff(crate::BoxPoint { u, v, phi }.to_half_diff());
            let (a, b) = (side(phi), side(std::f64::consts::PI - phi));
            let target = Transform::default();
            sum +=
                a.iter().zip(b).map(|(&a, b)| (target.forward(a) - target.forward(b)).powi(2)).sum::<f64>();
        }
    }
    let count = 3 * lattice.len();
    if (sum / count as f64).sqrt() < BILATERAL_TOLERANCE { Symmetry::Bilateral } else { Symmetry::Reciprocal }
}

/// Which exact solver to use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Solver {
    /// The lattice solver where the samples stand on a lattice, else the dense one.
    #[default]
    Auto,
    /// Kronecker algebra on a lattice, milliseconds.
    Lattice,
    /// Cholesky on any points, `O(n^3)`.
    Dense,
}

/// How to fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// The solver.
    pub solver: Solver,
    /// Shapes of the kernel, summed. On a lattice each axis has its own sum and the product is taken; the dense
    /// solver sums kernels with a length scale an axis each.
    pub kernel: Vec<Shape>,
    /// From BRDF values to targets.
    pub transform: Transform,
    /// Prior mean.
    pub mean: MeanFunction,
    /// Noise variance.
    pub noise: Noise,
    /// Hyper-parameters for each channel instead of shared ones.
    pub per_channel: bool,
    /// Input space of samples off the lattice.
    pub space: InputSpace,
    /// How long to search.
    pub optimize: OptimizeOptions,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            solver: Solver::Auto,
            kernel: vec![Shape::Matern52],
            transform: Transform::default(),
            mean: MeanFunction::default(),
            noise: Noise::default(),
            per_channel: false,
            space: LatticeLayout::default().space(),
            optimize: OptimizeOptions::default(),
        }
    }
}

/// Fits a model to samples: transforms them to targets, finds hyper-parameters by maximum marginal likelihood, and
/// conditions the process. With `per_channel` there is one report a channel, else one.
///
/// # Errors
/// No samples, values that are not finite, broken options, the lattice solver on samples that stand on no lattice, or
/// a dense run that will not fit.
pub fn fit(
    samples: &SampleSet,
    options: &FitOptions,
    provenance: Provenance,
) -> Result<(Model, Vec<FitReport>)> {
    let shapes = std::array::from_fn(|_| options.kernel.as_slice());
    fit_per_axis(samples, options, shapes, provenance, &|| false)
}

/// A sum of `shapes` of equal weight with length scales spread below the extent of `x`.
pub(crate) fn starting_kernel(shapes: &[Shape], x: &[f64]) -> Kernel1d {
    let low = x.iter().copied().fold(f64::INFINITY, f64::min);
    let high = x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let extent = (high - low).max(1e-3);
    let terms = shapes.iter().enumerate().map(|(i, &shape)| Term1d {
        weight: 1.0,
        shape,
        // Terms of one shape need different starts to become different.
        length_scale: 0.25 * extent * 0.5f64.powi(i32::try_from(i).unwrap_or(30)),
    });
    Kernel1d { terms: terms.collect() }
}
