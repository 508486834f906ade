//! Compression of a whole table into a model that stores few numbers.

use std::sync::Arc;

use nalgebra::{Matrix3, SymmetricEigen};

use crate::base::error::{Error, Result};
use crate::base::f16::to_half;
use crate::brdf::table::BrdfTable;
use crate::gp::inducing::cell_grid::CellGrid;
use crate::gp::{Budget, FitReport, GridData, InducingComponent, InducingGp, fit_inducing};
use crate::kernel::Shape;
use crate::model::{Fit, Model};
use crate::sample::target::Transform;
use crate::sample::{MeanFunction, Provenance, SampleLayout, Symmetry};

/// The count of numbers that a compressed model stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InducingSize {
    /// One lattice shape for all three components.
    Shape([usize; 3]),
    /// At most this many numbers in all: node values, colour matrix, prior means, densities and
    /// hyper-parameters. The shapes of the lattices are searched.
    Floats(usize),
}

/// Weights of table cells in the objective of the compression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellWeights {
    /// The share of the total weight, 0 to 1, that is distributed by how much a cell shows in pictures: its
    /// measure in pairs of directions times its brightness. The rest is distributed evenly over all cells
    /// except grazing ones, which get less.
    pub picture: f64,
}

impl Default for CellWeights {
    fn default() -> Self {
        Self { picture: 0.6 }
    }
}

/// Options of [`compress`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompressOptions {
    /// The count of numbers that the model stores.
    pub size: InducingSize,
    /// Symmetry in `phi_d` that the model relies on.
    pub symmetry: Symmetry,
    /// Shape of the kernel along each axis.
    pub kernel: Shape,
    /// The map from BRDF values to targets.
    pub transform: Transform,
    /// Weights of the table's cells.
    pub weights: CellWeights,
    /// Whether colours are decorrelated first. Otherwise each component is one of the channels.
    pub decorrelate: bool,
}

impl Default for CompressOptions {
    /// A budget of 675 floats, as many as a Neural BRDF has (A. Sztrajman et al. 2021).
    fn default() -> Self {
        Self {
            size: InducingSize::Floats(675),
            symmetry: Symmetry::Bilateral,
            kernel: Shape::Matern52,
            transform: Transform::default(),
            weights: CellWeights::default(),
            decorrelate: true,
        }
    }
}

/// Compresses a table: fits inducing lattices to all of its valid cells. It needs the whole table; samples at
/// few directions are fitted by [`fit`](crate::model::fit()).
///
/// The channels of the targets are transformed into uncorrelated components. Shapes and densities of their
/// lattices are searched on a thinned grid, and the values at the nodes follow in closed form from all cells.
/// Values are rounded to half precision. Every table takes seconds. There is one report for all components,
/// whose log marginal likelihood is the variational bound.
///
/// # Errors
/// A table without data or with values that are not finite, invalid options, or a size out of range.
pub fn compress(table: &BrdfTable, options: &CompressOptions, origin: Provenance) -> Result<Fit> {
    let (gp, offsets, report) = inducing_lattices(table, options)?;
    let origin = Provenance { layout: SampleLayout::Table, lattice: None, ..origin };
    let model = Model::new(origin, options.transform, MeanFunction::Constant, offsets, vec![Arc::new(gp)])?;
    Ok(Fit { model, reports: vec![report] })
}

/// The process of a compressed table, its prior means, and the report of the search.
fn inducing_lattices(
    table: &BrdfTable,
    options: &CompressOptions,
) -> Result<(InducingGp, [f64; 3], FitReport)> {
    options.transform.validate()?;
    let picture = options.weights.picture;
    if !(0.0..=1.0).contains(&picture) {
        return Err(Error::argument("share of the picture's weights", "0 to 1", picture));
    }
    let grid = CellGrid::new(table, options.symmetry, options.transform, picture)?;
    let (offsets, mix) = principal_colours(&grid, options.decorrelate);
    let (fine, coarse) = (components(&grid, offsets, mix), components(&grid.decimated(), offsets, mix));
    let budget = match options.size {
        InducingSize::Shape(shape) => Budget::Shape(shape),
        InducingSize::Floats(floats) => Budget::Floats(floats),
    };
    let fits = fit_inducing(&fine, &coarse, options.symmetry, options.kernel, budget)?;
    let report = FitReport {
        log_marginal_likelihood: fits.iter().map(|fit| fit.bound).sum(),
        evaluations: fits.first().map_or(0, |fit| fit.evaluations),
        converged: true,
        ..FitReport::default()
    };
    let parts = fits.into_iter().map(|fit| {
        let values = fit.values.into_iter().map(|value| to_half(value).to_f64()).collect();
        InducingComponent::new(fit.lattice, values)
    });
    let gp = InducingGp { mix, components: parts.collect::<Result<_>>()?, cells: grid.cells };
    gp.validate()?;
    Ok((gp, offsets, report))
}

/// Weighted means of the channels, and the eigenvectors of their weighted covariance as columns, that of the
/// largest eigenvalue first. Without `decorrelate`, the columns are those of the identity matrix.
fn principal_colours(grid: &CellGrid, decorrelate: bool) -> ([f64; 3], [[f64; 3]; 3]) {
    let total: f64 = grid.weights.iter().sum();
    let mean = |x: &[f64]| x.iter().zip(&grid.weights).map(|(x, w)| w * x).sum::<f64>() / total;
    let offsets = grid.targets.each_ref().map(|t| mean(t));
    if !decorrelate {
        return (offsets, std::array::from_fn(|c| std::array::from_fn(|k| f64::from(u8::from(c == k)))));
    }
    let covariance = Matrix3::from_fn(|a, b| {
        let pairs = grid.targets[a].iter().zip(&grid.targets[b]).zip(&grid.weights);
        pairs.map(|((x, y), w)| w * (x - offsets[a]) * (y - offsets[b])).sum::<f64>() / total
    });
    let eigen = SymmetricEigen::new(covariance);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let mix = std::array::from_fn(|c| order.map(|k| eigen.eigenvectors[(c, k)]));
    (offsets, mix)
}

/// The grid's targets as components: `mix^T (target - offset)`, because the inverse of the orthogonal `mix`
/// is its transpose.
fn components(grid: &CellGrid, offsets: [f64; 3], mix: [[f64; 3]; 3]) -> GridData {
    let component = |k: usize| {
        (0..grid.weights.len())
            .map(|at| (0..3).map(|c| mix[c][k] * (grid.targets[c][at] - offsets[c])).sum())
            .collect::<Vec<f64>>()
    };
    GridData {
        u: grid.u.clone(),
        v: grid.v.clone(),
        phi: grid.phi.clone(),
        weights: grid.weights.clone(),
        shown: grid.shown.clone(),
        components: std::array::from_fn(component),
    }
}

#[cfg(all(test, feature = "formats"))]
mod tests {
    use super::*;
    use crate::brdf::table::{N_CELLS, cell_center, cell_indices};
    use crate::formats::source::Source;
    use crate::judge::CellMetrics;
    use crate::model::IntervalOf;
    use crate::model::bake::{bake_mean, bake_sigma};

    fn compressed(symmetry: Symmetry, size: InducingSize) -> (Model, BrdfTable) {
        let table = Source::built_in("red-plastic").unwrap().table().unwrap().into_owned();
        let options = CompressOptions { size, symmetry, ..CompressOptions::default() };
        (compress(&table, &options, Provenance::default()).unwrap().model, table)
    }

    #[test]
    fn tables_hold_what_the_model_predicts_and_files_keep_every_bit() {
        for symmetry in [Symmetry::Bilateral, Symmetry::Reciprocal] {
            let (model, truth) = compressed(symmetry, InducingSize::Shape([7, 4, 3]));
            assert_eq!(model.n_floats(), 3 * 84 + 3 * 8 + 12);
            assert_eq!(model.n_samples(), 1_096_216);
            let cells: Vec<usize> = (0..N_CELLS).step_by(1237).collect();
            let angles: Vec<_> = cells
                .iter()
                .map(|&cell| {
                    let (h, d, p) = cell_indices(cell);
                    cell_center(h, d, p)
                })
                .collect();
            let (mean, sigma) = (bake_mean(&model), bake_sigma(&model).unwrap());
            let means = model.predict_mean(&angles);
            let variances = model.predict_variance(&angles, IntervalOf::Latent).unwrap();
            for ((&cell, value), variance) in cells.iter().zip(&means).zip(&variances) {
                for c in 0..3 {
                    let baked = f64::from(mean.values()[cell][c]);
                    assert!(
                        (baked - value[c]).abs() < 2e-5 * (value[c] + 1e-3),
                        "{cell} {baked} {}",
                        value[c]
                    );
                    assert!((f64::from(sigma.value(cell, c)) - variance[c].sqrt()).abs() < 1e-4);
                }
            }
            let metrics = CellMetrics::new(&truth, &mean, None).unwrap();
            assert!(metrics.median_abs_log < 0.1, "{}", metrics.median_abs_log);

            let bytes = model.to_bytes().unwrap();
            let again = Model::from_bytes(&bytes, std::path::Path::new("m")).unwrap();
            assert_eq!(bake_mean(&again), mean);
            assert_eq!(bake_sigma(&again).unwrap(), sigma);
            assert_eq!(again.to_bytes().unwrap(), bytes);
            let broken: Vec<u8> = bytes[..bytes.len() - 2].to_vec();
            assert!(Model::from_bytes(&broken, std::path::Path::new("m")).is_err());
        }
    }

    #[test]
    fn half_precision_costs_next_to_nothing() {
        let truth = Source::built_in("red-plastic").unwrap().table().unwrap().into_owned();
        let options = CompressOptions { size: InducingSize::Floats(300), ..CompressOptions::default() };
        let (gp, offsets, _) = inducing_lattices(&truth, &options).unwrap();
        let moved = |share: f64| {
            // The values are moved by a fraction of the spacing of numbers in half precision, as rounding
            // would move them.
            let components = gp.components.iter().map(|component| {
                let values = component.values().iter().enumerate();
                let values = values.map(|(i, x)| x * (1.0 + share * if i % 2 == 0 { 1.0 } else { -1.0 }));
                InducingComponent::new(component.lattice().clone(), values.collect()).unwrap()
            });
            let moved = Arc::new(InducingGp { components: components.collect(), ..gp.clone() });
            let origin = Provenance::default();
            let model = Model::new(origin, options.transform, MeanFunction::Constant, offsets, vec![moved]);
            CellMetrics::new(&truth, &bake_mean(&model.unwrap()), None).unwrap().log_rmse
        };
        for component in &gp.components {
            assert!(component.values().iter().all(|&x| to_half(x).to_f64() == x));
        }
        let (kept, worse) = (moved(0.0), moved(2f64.powi(-12)));
        assert!(worse < 1.01 * kept + 1e-3, "{kept} {worse}");
    }

    #[test]
    fn options_out_of_range_are_refused() {
        let table = BrdfTable::from_fn(|_| [0.1, 0.2, 0.3]);
        let options = CompressOptions { size: InducingSize::Shape([2, 2, 2]), ..CompressOptions::default() };
        let weights = CellWeights { picture: f64::NAN };
        assert!(compress(&table, &CompressOptions { weights, ..options }, Provenance::default()).is_err());
        // A table of equal cells is not an error.
        let model = compress(&table, &options, Provenance::default()).unwrap().model;
        let value = model.predict_mean(&[cell_center(5, 5, 5)])[0];
        assert!((value[1] - 0.2).abs() < 1e-3, "{value:?}");
    }
}
