//! The paper's own setting: its lattice of table cells, thinned to what a dense solver can hold, and its
//! kernel.

use gpbrdf_core::base::golden_ratio_subset;
use gpbrdf_core::brdf::{N_PHI_D, N_THETA_D, N_THETA_H, cell_center};
use gpbrdf_core::sample::{InputSpace, SampleLayout};
use gpbrdf_core::{
    Brdf, BrdfTable, FitOptions, HalfDiff, MeanFunction, Provenance, SampleSet, Shape, Solver, Transform,
};

/// Every fifth `theta_h`, third `theta_d` and second `phi_d` cell above the horizon; the paper counts 37,616.
pub(super) fn paper_cells() -> Vec<HalfDiff> {
    let mut cells = Vec::new();
    for h in (0..N_THETA_H).step_by(5) {
        for d in (0..N_THETA_D).step_by(3) {
            let row = (0..N_PHI_D).step_by(2).map(|p| cell_center(h, d, p));
            cells.extend(row.filter(|angles| angles.is_above_horizon()));
        }
    }
    cells
}

/// Measures `count` of the paper's cells, spread evenly over them.
pub(super) fn paper_samples(truth: &BrdfTable, count: usize) -> SampleSet {
    let cells = paper_cells();
    let mut order = golden_ratio_subset(cells.len(), count);
    order.sort_unstable();
    let angles: Vec<HalfDiff> = order.into_iter().map(|i| cells[i]).collect();
    let values = angles.iter().map(|&a| truth.eval_half_diff(a)).collect();
    let origin = Provenance { layout: SampleLayout::Cells, ..Provenance::default() };
    SampleSet { angles, values, origin, ..SampleSet::default() }
}

/// The paper's model: a dense process on `f` itself, with zero mean and kernels on the plain half-difference
/// angles.
pub(super) fn paper_options(kernel: &[Shape]) -> FitOptions {
    FitOptions {
        solver: Solver::Dense,
        hyper_priors: false,
        transform: Transform::Identity,
        mean: MeanFunction::Zero,
        space: Some(InputSpace::HalfDiff),
        ..FitOptions::default()
    }
    .with_kernel(kernel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_s_lattice_has_about_its_count_and_is_thinned_evenly() {
        let cells = paper_cells();
        assert!((37_000..38_500).contains(&cells.len()), "{}", cells.len());
        let table = BrdfTable::from_fn(|a| [a.theta_h, a.theta_d, a.phi_d]);
        let samples = paper_samples(&table, 500);
        assert_eq!((samples.angles.len(), samples.values.len()), (500, 500));
        let mean = |of: &dyn Fn(&HalfDiff) -> f64, all: &[HalfDiff]| {
            all.iter().map(of).sum::<f64>() / all.len() as f64
        };
        for of in [|a: &HalfDiff| a.theta_h, |a: &HalfDiff| a.theta_d, |a: &HalfDiff| a.phi_d] {
            let (some, all) = (mean(&of, &samples.angles), mean(&of, &cells));
            assert!((some - all).abs() < 0.05, "{some} {all}");
        }
        // A value is that of its cell.
        let (a, v) = (samples.angles[77], samples.values[77]);
        assert!((a.theta_h - v[0]).abs() < 1e-6 && (a.theta_d - v[1]).abs() < 1e-6);
        assert_eq!(paper_samples(&table, usize::MAX).angles.len(), cells.len());
    }
}
