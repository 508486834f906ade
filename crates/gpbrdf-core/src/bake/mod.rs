//! From a model to a whole table of mean and sigma.

mod dense;
mod geometry;
mod inducing;
mod lattice;
mod separable;

pub use geometry::TableGeometry;
pub use separable::{AxisBasis, SeparableForm};

use rayon::prelude::*;

use crate::model::{Model, Process};
use crate::space::InputSpace;
use crate::table::{BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, cell_index};

/// Posterior standard deviation of the latent target at the centre of every cell, in target units: with the
/// logarithmic transform 0.05 reads as five per cent. Cells below the horizon hold the value at the horizon.
#[derive(Clone, Debug, PartialEq)]
pub struct SigmaTable {
    planes: Vec<Vec<f32>>,
}

impl SigmaTable {
    /// One plane in MERL order for all channels, or three; `None` unless each has [`N_CELLS`] values.
    #[must_use]
    pub fn from_planes(planes: Vec<Vec<f32>>) -> Option<Self> {
        let whole = planes.iter().all(|plane| plane.len() == N_CELLS);
        (whole && matches!(planes.len(), 1 | 3)).then_some(Self { planes })
    }

    /// One plane in MERL order where the channels share hyper-parameters, else one a channel.
    #[must_use]
    pub fn planes(&self) -> &[Vec<f32>] {
        &self.planes
    }

    /// Sigma of one cell and channel.
    #[must_use]
    pub fn value(&self, cell: usize, channel: usize) -> f32 {
        self.planes[channel.min(self.planes.len() - 1)][cell]
    }
}

/// Evaluates the predictive mean of a model at the centre of all 1,458,000 cells, in parallel, and carries it back to
/// sr^-1. Cells below the horizon hold the value at the horizon, so that texture filtering shows no dark fringe.
///
/// A lattice model takes tens of milliseconds; a dense one sums `n` kernel values a cell.
#[must_use]
pub fn bake_mean(model: &Model) -> BrdfTable {
    if let Process::Inducing(gp) = &model.process {
        return inducing::bake_mean(model, gp);
    }
    let (Process::Lattice(groups), InputSpace::WarpedBox { symmetry, .. }) = (&model.process, model.space)
    else {
        return dense::bake_mean(model);
    };
    let mut mean = vec![[0.0f32; 3]; N_CELLS];
    let mut first = 0;
    for gp in groups {
        let slabs = mean.par_chunks_mut(SLAB);
        lattice::bake_means(gp, model.space, symmetry, slabs, |slab, rows, means| {
            for (channel, means) in means.chunks_mut(N_THETA_D).enumerate() {
                means.iter_mut().for_each(|m| *m += model.offsets[first + channel]);
                model.transform.inverse_in_place(means);
                for (l, value) in means.iter().map(|&value| to_f32(value)).enumerate() {
                    rows.iter().for_each(|&row| slab[cell_index(0, l, row)][first + channel] = value);
                }
            }
        });
        first += gp.data().channels;
    }
    BrdfTable::from_cells(mean)
}

/// Evaluates the latent standard deviation of a model's target at the centre of every cell, in parallel.
///
/// The variance of a dense model costs `n^2` a point: it is computed in the middle of every block of 3 x 3 x 3 cells and
/// interpolated between.
#[must_use]
pub fn bake_sigma(model: &Model) -> SigmaTable {
    if let Process::Inducing(gp) = &model.process {
        return inducing::bake_sigma(gp);
    }
    let (Process::Lattice(groups), InputSpace::WarpedBox { symmetry, .. }) = (&model.process, model.space)
    else {
        return dense::bake_sigma(model);
    };
    let planes = groups.iter().map(|gp| {
        let mut plane = vec![0.0f32; N_CELLS];
        let slabs = plane.par_chunks_mut(SLAB);
        lattice::bake_variances(gp, model.space, symmetry, slabs, |slab, rows, variances| {
            for (l, sigma) in variances.iter().map(|&variance| to_f32(variance.sqrt())).enumerate() {
                rows.iter().for_each(|&row| slab[cell_index(0, l, row)] = sigma);
            }
        });
        plane
    });
    SigmaTable { planes: planes.collect() }
}

/// Cells of one `i_theta_h`.
const SLAB: usize = N_THETA_D * N_PHI_D;

/// Rounds to the table's precision.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the table's precision")]
fn to_f32(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{FitOptions, Layout, SampleSet, Solver, fit};
    use crate::kernel::Shape;
    use crate::layout::{LatticeLayout, Symmetry};
    use crate::model::{IntervalOf, Provenance};
    use crate::source::Source;
    use crate::table::{cell_center, cell_indices};

    fn model(symmetry: Symmetry, solver: Solver, per_channel: bool, kernel: Vec<Shape>) -> Model {
        let source = Source::built_in("red-plastic").unwrap();
        let layout = LatticeLayout { shape: [10, 8, 6], symmetry, ..LatticeLayout::default() };
        let samples = SampleSet::measure(source.brdf().unwrap(), &Layout::Lattice(layout)).unwrap();
        let options = FitOptions { solver, per_channel, kernel, ..FitOptions::default() };
        fit(&samples, &options, Provenance::default()).unwrap().0
    }

    /// Cells of every region, below the horizon too.
    fn cells() -> impl Iterator<Item = usize> {
        (0..N_CELLS).step_by(1237)
    }

    fn center(cell: usize) -> crate::HalfDiff {
        let (h, d, p) = cell_indices(cell);
        cell_center(h, d, p)
    }

    #[test]
    fn tables_hold_what_the_model_predicts() {
        let sum = vec![Shape::Matern32, Shape::RationalQuadratic { alpha: 1.0 }];
        for model in [
            model(Symmetry::Bilateral, Solver::Lattice, false, vec![Shape::Matern52]),
            model(Symmetry::Reciprocal, Solver::Lattice, true, vec![Shape::SquaredExponential]),
            model(Symmetry::Reciprocal, Solver::Lattice, false, sum),
        ] {
            let angles: Vec<_> = cells().map(center).collect();
            let (mean, sigma) = (bake_mean(&model), bake_sigma(&model));
            let (values, variances) =
                (model.predict_mean(&angles), model.predict_variance(&angles, IntervalOf::Latent));
            for ((cell, value), variance) in cells().zip(values).zip(variances) {
                for c in 0..3 {
                    let found = f64::from(mean.values()[cell][c]);
                    assert!(
                        (found - value[c]).abs() <= 2e-7 * value[c] + 1e-9,
                        "{cell} {found} {}",
                        value[c]
                    );
                    let (found, expected) = (f64::from(sigma.value(cell, c)), variance[c].sqrt());
                    assert!((found - expected).abs() <= 1e-6 * expected + 1e-7, "{cell} {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn dense_tables_hold_the_mean_and_interpolate_sigma() {
        let model = model(Symmetry::Bilateral, Solver::Dense, false, vec![Shape::Matern52]);
        let (mean, sigma) = (bake_mean(&model), bake_sigma(&model));
        let angles: Vec<_> = cells().map(center).collect();
        let (values, variances) =
            (model.predict_mean(&angles), model.predict_variance(&angles, IntervalOf::Latent));
        let mut ratios = Vec::new();
        for ((cell, value), variance) in cells().zip(values).zip(variances) {
            for c in 0..3 {
                let found = f64::from(mean.values()[cell][c]);
                assert!((found - value[c]).abs() <= 2e-7 * value[c] + 1e-9, "{cell} {found} {}", value[c]);
            }
            ratios.push((f64::from(sigma.value(cell, 0)) / variance[0].sqrt()).ln().abs());
        }
        // Sigma has a dip at each sample, which interpolation rounds off.
        ratios.sort_by(f64::total_cmp);
        assert!(ratios[ratios.len() / 2] < 0.15, "{}", ratios[ratios.len() / 2]);
    }

    #[test]
    fn tables_do_not_depend_on_the_number_of_threads() {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let model = model(Symmetry::Bilateral, Solver::Lattice, false, vec![Shape::Matern52]);
                (bake_mean(&model), bake_sigma(&model))
            })
        };
        assert_eq!(run(1), run(3));
    }
}
