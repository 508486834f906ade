//! Baking: the evaluation of a model into tables of its mean and its sigma.

use crate::base::error::{Error, Result};
use crate::base::watch::{Observer, Watch};
use crate::brdf::Rgb;
use crate::brdf::sigma::SigmaTable;
use crate::brdf::table::{BrdfTable, N_CELLS};
use crate::gp::MeanTable;
use crate::model::{Intervals, Model};
use crate::sample::Transform;

/// Evaluates the predictive mean of a model at the centre of all 1,458,000 cells, in parallel, and transforms
/// it back to sr^-1. Cells below the horizon hold the value at the horizon, so that texture filtering shows
/// no dark fringe.
///
/// A lattice model takes tens of milliseconds; a dense one evaluates the kernel `n` times per cell.
#[must_use]
pub fn bake_mean(model: &Model) -> BrdfTable {
    let mut cells = vec![[0.0f32; 3]; N_CELLS];
    // Nothing but an observer ends this early.
    let _ = fill_mean(model, &Watch::default(), &mut cells);
    BrdfTable::from_cells(cells)
}

/// The same with an observer, which hears of the share that is done and can stop the work. Models on lattices take
/// tens of milliseconds, which it does not interrupt.
///
/// # Errors
/// [`Error::Cancelled`] where the observer stops the work.
pub fn bake_mean_observed(model: &Model, observer: &Observer) -> Result<BrdfTable> {
    let mut cells = vec![[0.0f32; 3]; N_CELLS];
    fill_mean(model, &Watch::new(observer), &mut cells)?;
    Ok(BrdfTable::from_cells(cells))
}

fn fill_mean(model: &Model, watch: &Watch, cells: &mut [[f32; 3]]) -> Result<()> {
    let count = model.posteriors().count() as f64;
    for (k, (first_channel, posterior)) in model.posteriors().enumerate() {
        let (offsets, transform) = (model.offsets, model.transform);
        let watch = watch.part(k as f64 / count, (k + 1) as f64 / count);
        posterior.bake_mean(&mut MeanTable { cells, first_channel, offsets, transform }, &watch)?;
    }
    Ok(())
}

/// Evaluates the latent standard deviation of a model's target at the centre of every cell, in parallel.
///
/// The variance of a dense model costs `n^2` per point. It is therefore computed in the middle of every block
/// of 3 x 3 x 3 cells and interpolated between them.
///
/// # Errors
/// A covariance that cannot be factorised or does not fit in memory.
pub fn bake_sigma(model: &Model) -> Result<SigmaTable> {
    bake_sigma_observed(model, &Observer::default())
}

/// The same with an observer, which hears of the share that is done and can stop the work. What is factorised
/// before the first variance is not interrupted.
///
/// # Errors
/// Those of [`bake_sigma`], and [`Error::Cancelled`] where the observer stops the work.
pub fn bake_sigma_observed(model: &Model, observer: &Observer) -> Result<SigmaTable> {
    let (watch, mut planes) = (Watch::new(observer), Vec::new());
    let count = model.posteriors().count() as f64;
    for (k, (_, posterior)) in model.posteriors().enumerate() {
        planes.extend(posterior.bake_sigma(&watch.part(k as f64 / count, (k + 1) as f64 / count))?);
    }
    if planes.len() == 2 {
        return Err(Error::argument("variances of a model", "1 for all channels, or 3", planes.len()));
    }
    SigmaTable::from_planes(planes)
}

/// A model evaluated on the whole table: the mean, which a renderer looks up, and its uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Baked {
    /// Predictive mean, sr^-1.
    pub mean: BrdfTable,
    /// Standard deviation of the latent target.
    pub sigma: SigmaTable,
    /// Noise variance of each channel, in squared target units.
    pub noise_variances: Rgb,
    /// The map from BRDF values to targets.
    pub transform: Transform,
}

impl Baked {
    /// Bakes the mean and the sigma of a model.
    ///
    /// # Errors
    /// Those of [`bake_sigma`].
    pub fn new(model: &Model) -> Result<Self> {
        Ok(Self {
            mean: bake_mean(model),
            sigma: bake_sigma(model)?,
            noise_variances: model.noise_variances(),
            transform: model.transform,
        })
    }

    /// The 95 % intervals of new measurements.
    #[must_use]
    pub fn intervals(&self) -> Intervals<'_> {
        let Self { mean, sigma, noise_variances, transform } = self;
        Intervals { mean, sigma, noise_variances: *noise_variances, transform: *transform }
    }
}
#[cfg(all(test, feature = "fit", feature = "formats"))]
mod tests {
    use super::*;
    use crate::brdf::table::{cell_center, cell_indices};
    use crate::formats::source::Source;
    use crate::gp::Solver;
    use crate::kernel::Shape;
    use crate::model::{FitOptions, IntervalOf, fit};
    use crate::sample::{LatticeLayout, Layout, Symmetry};

    fn model(symmetry: Symmetry, solver: Solver, per_channel: bool, kernel: &[Shape]) -> Model {
        let source = Source::built_in("red-plastic").unwrap();
        let layout = LatticeLayout { shape: [10, 8, 6], symmetry, ..LatticeLayout::default() };
        let samples = source.measure(&Layout::Lattice(layout)).unwrap();
        let options = FitOptions { solver, per_channel, ..FitOptions::default() }.with_kernel(kernel);
        fit(&samples, &options).unwrap().model
    }

    /// Cells of every region of the table, including some below the horizon.
    fn cells() -> impl Iterator<Item = usize> {
        (0..N_CELLS).step_by(1237)
    }

    fn center(cell: usize) -> crate::HalfDiff {
        let (h, d, p) = cell_indices(cell);
        cell_center(h, d, p)
    }

    #[test]
    fn tables_hold_what_the_model_predicts() {
        let sum = &[Shape::Matern32, Shape::RationalQuadratic { alpha: 1.0 }];
        for model in [
            model(Symmetry::Bilateral, Solver::Lattice, false, &[Shape::Matern52]),
            model(Symmetry::Reciprocal, Solver::Lattice, true, &[Shape::SquaredExponential]),
            model(Symmetry::Reciprocal, Solver::Lattice, false, sum),
        ] {
            let angles: Vec<_> = cells().map(center).collect();
            let (mean, sigma) = (bake_mean(&model), bake_sigma(&model).unwrap());
            let (values, variances) =
                (model.predict_mean(&angles), model.predict_variance(&angles, IntervalOf::Latent).unwrap());
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
        let model = model(Symmetry::Bilateral, Solver::Dense, false, &[Shape::Matern52]);
        let (mean, sigma) = (bake_mean(&model), bake_sigma(&model).unwrap());
        let angles: Vec<_> = cells().map(center).collect();
        let (values, variances) =
            (model.predict_mean(&angles), model.predict_variance(&angles, IntervalOf::Latent).unwrap());
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
                let model = model(Symmetry::Bilateral, Solver::Lattice, false, &[Shape::Matern52]);
                (bake_mean(&model), bake_sigma(&model).unwrap())
            })
        };
        assert_eq!(run(1), run(3));
    }
}
