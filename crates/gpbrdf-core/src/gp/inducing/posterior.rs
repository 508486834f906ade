//! Inducing lattices as the posterior of a model. Each component is the lattice process that its values
//! define, and colours are mixtures of the components.

use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{COLOUR_CONSTANTS, InducingComponent, InducingGp, InducingShape};
use crate::base::error::Result;
use crate::base::watch::Watch;
use crate::brdf::angles::HalfDiff;
use crate::brdf::table::{N_CELLS, SLAB, cell_index};
use crate::gp::hyper::Hyper;
use crate::gp::lattice::posterior::product_name;
use crate::gp::lattice::table::{bake_means, bake_variances};
use crate::gp::posterior::{DeviceForm, Posterior, SeparablePart};
use crate::gp::table::{MeanTable, to_f32};
use crate::gp::tensors::{TensorReader, TensorWriter};
use crate::sample::space::InputSpace;

/// The solver's name in files and reports.
pub(crate) const NAME: &str = "inducing";

/// The parts of a saved process that are not tensors.
#[derive(Serialize, Deserialize)]
struct Header {
    mix: [[f64; 3]; 3],
    cells: usize,
    components: Vec<InducingShape>,
}

/// Reads a process that [`Posterior::save`] has written.
pub(crate) fn load(header: Value, tensors: &TensorReader<'_>) -> Result<Arc<dyn Posterior>> {
    let Header { mix, cells, components } = tensors.header(header)?;
    let components = components.into_iter().enumerate().map(|(k, lattice)| {
        let values = tensors.read(&format!("{k}.values"))?;
        InducingComponent::new(lattice, values).map_err(|e| tensors.damaged(e))
    });
    let gp = InducingGp { mix, components: components.collect::<Result<_>>()?, cells };
    gp.validate().map_err(|e| tensors.damaged(e))?;
    Ok(Arc::new(gp))
}

impl InducingGp {
    /// Coordinates of directions in the space of a component.
    fn points(component: &InducingComponent, angles: &[HalfDiff]) -> Vec<[f64; 3]> {
        let space = component.lattice().space;
        angles.iter().map(|&angles| space.coordinates(angles)).collect()
    }
}

impl Posterior for InducingGp {
    fn solver(&self) -> &'static str {
        NAME
    }

    fn label(&self) -> &'static str {
        "Compressed, on inducing lattices"
    }

    fn space(&self) -> InputSpace {
        self.components[0].lattice().space.into()
    }

    fn n_channels(&self) -> usize {
        3
    }

    fn n_data(&self) -> usize {
        self.cells
    }

    fn n_floats(&self) -> usize {
        COLOUR_CONSTANTS + self.components.iter().map(InducingComponent::floats).sum::<usize>()
    }

    fn noise_variances(&self) -> Vec<f64> {
        let components = std::array::from_fn(|k| self.components[k].lattice().noise_variance);
        self.colour_variance(components).to_vec()
    }

    fn n_variances(&self) -> usize {
        3
    }

    fn predict_mean(&self, angles: &[HalfDiff]) -> Vec<f64> {
        let mut parts = vec![[0.0; 3]; angles.len()];
        for (k, component) in self.components.iter().enumerate() {
            let means = component.gp().predict_mean(&Self::points(component, angles));
            parts.iter_mut().zip(means).for_each(|(part, mean)| part[k] = mean);
        }
        parts.into_iter().flat_map(|parts| self.colour(parts)).collect()
    }

    fn predict_variance(&self, angles: &[HalfDiff]) -> Result<Vec<f64>> {
        let mut parts = vec![[0.0; 3]; angles.len()];
        for (k, component) in self.components.iter().enumerate() {
            let variances = component.gp().predict_variance_latent(&Self::points(component, angles))?;
            parts.iter_mut().zip(variances).for_each(|(part, variance)| part[k] = variance);
        }
        Ok(parts.into_iter().flat_map(|parts| self.colour_variance(parts)).collect())
    }

    fn hyper(&self) -> Option<Hyper> {
        None
    }

    fn kernel_name(&self) -> String {
        product_name(&self.components[0].lattice().kernels)
    }

    fn report(&self) -> Value {
        let components = self.components.iter().map(|component| {
            let lattice = component.lattice();
            let lengths = lattice.kernels.each_ref().map(|k| k.terms.first().map(|t| t.length_scale));
            json!({
                "shape": lattice.shape,
                "length_scale": lengths,
                "signal_variance": lattice.signal_variance,
                "noise_variance": lattice.noise_variance,
                "space": lattice.space,
            })
        });
        json!({ "mix": self.mix, "components": components.collect::<Vec<_>>() })
    }

    fn save(&self, tensors: &mut TensorWriter) -> Result<Value> {
        for (k, component) in self.components.iter().enumerate() {
            tensors.add_half(&format!("{k}.values"), &component.lattice().shape, component.values());
        }
        let components = self.components.iter().map(|c| c.lattice().clone()).collect();
        crate::gp::tensors::header(&Header { mix: self.mix, cells: self.cells, components })
    }

    fn device_form(&self) -> DeviceForm<'_> {
        let parts = self.components.iter().enumerate().map(|(k, component)| SeparablePart {
            gp: component.gp(),
            space: component.lattice().space,
            colour: Some(self.mix.map(|row| row[k])),
        });
        DeviceForm::Separable(parts.collect())
    }

    /// Keeps the components in single precision until they are mixed, which rounds them to about 1e-7 of
    /// their size.
    fn bake_mean(&self, table: &mut MeanTable<'_>, _watch: &Watch) -> Result<()> {
        for (k, component) in self.components.iter().enumerate() {
            let slabs = table.cells.par_chunks_mut(SLAB);
            bake_means(component.gp(), component.lattice().space, slabs, |slab, rows, means| {
                for (l, value) in means.iter().map(|&value| to_f32(value)).enumerate() {
                    rows.iter().for_each(|&row| slab[cell_index(0, l, row)][k] = value);
                }
            });
        }
        let (offsets, transform) = (table.offsets, table.transform);
        table.cells.par_chunks_mut(SLAB).for_each_init(Vec::new, |targets: &mut Vec<f64>, slab| {
            targets.clear();
            for parts in slab.iter() {
                let colour = self.colour(parts.map(f64::from));
                targets.extend((0..3).map(|c| offsets[c] + colour[c]));
            }
            transform.inverse_in_place(targets);
            for (cell, values) in slab.iter_mut().zip(targets.chunks_exact(3)) {
                cell.iter_mut().zip(values).for_each(|(out, &value)| *out = to_f32(value));
            }
        });
        Ok(())
    }

    fn bake_sigma(&self, _watch: &Watch) -> Result<Vec<Vec<f32>>> {
        let mut planes = vec![vec![0.0f32; N_CELLS]; 3];
        for (component, plane) in self.components.iter().zip(&mut planes) {
            let slabs = plane.par_chunks_mut(SLAB);
            bake_variances(component.gp(), component.lattice().space, slabs, |slab, rows, variances| {
                for (l, value) in variances.iter().map(|&value| to_f32(value)).enumerate() {
                    rows.iter().for_each(|&row| slab[cell_index(0, l, row)] = value);
                }
            })?;
        }
        if let [first, second, third] = planes.as_mut_slice() {
            let slabs =
                first.par_chunks_mut(SLAB).zip(second.par_chunks_mut(SLAB)).zip(third.par_chunks_mut(SLAB));
            slabs.for_each(|((first, second), third)| {
                for ((a, b), c) in first.iter_mut().zip(second).zip(third) {
                    let parts = [&*a, &*b, &*c].map(|x| f64::from(*x));
                    let sigmas = self.colour_variance(parts).map(f64::sqrt);
                    [*a, *b, *c] = sigmas.map(to_f32);
                }
            });
        }
        Ok(planes)
    }
}
