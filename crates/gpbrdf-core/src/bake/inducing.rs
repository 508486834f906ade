//! Mean and sigma of inducing lattices on the whole table: each component as the lattice process it is, then colours.

use rayon::prelude::*;

use super::{SLAB, SigmaTable, lattice, to_f32};
use crate::gp::InducingGp;
use crate::model::Model;
use crate::table::{BrdfTable, N_CELLS, cell_index};

/// [`super::bake_mean`] of inducing lattices. Components are added up in single precision, whose rounding is a tenth of a
/// millionth of a target.
pub(super) fn bake_mean(model: &Model, gp: &InducingGp) -> BrdfTable {
    let mut cells = vec![[0.0f32; 3]; N_CELLS];
    for (k, component) in gp.components.iter().enumerate() {
        let (space, symmetry) = (component.lattice().space, component.lattice().symmetry());
        let slabs = cells.par_chunks_mut(SLAB);
        lattice::bake_means(component.gp(), space, symmetry, slabs, |slab, rows, means| {
            for (l, value) in means.iter().map(|&value| to_f32(value)).enumerate() {
                rows.iter().for_each(|&row| slab[cell_index(0, l, row)][k] = value);
            }
        });
    }
    cells.par_chunks_mut(SLAB).for_each_init(Vec::new, |targets: &mut Vec<f64>, slab| {
        targets.clear();
        for parts in slab.iter() {
            let colour = gp.colour(parts.map(f64::from));
            targets.extend((0..3).map(|c| model.offsets[c] + colour[c]));
        }
        model.transform.inverse_in_place(targets);
        for (cell, values) in slab.iter_mut().zip(targets.chunks_exact(3)) {
            cell.iter_mut().zip(values).for_each(|(out, &value)| *out = to_f32(value));
        }
    });
    BrdfTable::from_cells(cells)
}

/// [`super::bake_sigma`] of inducing lattices: one plane a channel.
pub(super) fn bake_sigma(gp: &InducingGp) -> SigmaTable {
    let mut planes = vec![vec![0.0f32; N_CELLS]; 3];
    for (k, component) in gp.components.iter().enumerate() {
        let (space, symmetry) = (component.lattice().space, component.lattice().symmetry());
        let slabs = planes[k].par_chunks_mut(SLAB);
        lattice::bake_variances(component.gp(), space, symmetry, slabs, |slab, rows, variances| {
            for (l, value) in variances.iter().map(|&value| to_f32(value)).enumerate() {
                rows.iter().for_each(|&row| slab[cell_index(0, l, row)] = value);
            }
        });
    }
    let [first, second, third] = planes.as_mut_slice() else { return SigmaTable { planes } };
    let slabs = first.par_chunks_mut(SLAB).zip(second.par_chunks_mut(SLAB)).zip(third.par_chunks_mut(SLAB));
    slabs.for_each(|((first, second), third)| {
        for ((a, b), c) in first.iter_mut().zip(second).zip(third) {
            let parts = [&*a, &*b, &*c].map(|x| f64::from(*x));
            let sigmas = gp.colour_variance(parts).map(f64::sqrt);
            [*a, *b, *c] = sigmas.map(to_f32);
        }
    });
    SigmaTable { planes }
}
