//! The lattice process as a posterior of a model.

use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::table::{bake_means, bake_variances};
use super::{LatticeData, LatticeGp, LatticeHyper};
use crate::base::error::Result;
use crate::base::watch::Watch;
use crate::brdf::angles::HalfDiff;
use crate::brdf::table::{N_CELLS, N_THETA_D, SLAB, cell_index};
use crate::gp::hyper::{AXIS_NAMES, Hyper};
use crate::gp::posterior::{DeviceForm, Posterior, SeparablePart};
use crate::gp::solver::Solver;
use crate::gp::table::{MeanTable, to_f32};
use crate::gp::tensors::{TensorReader, TensorWriter};
use crate::kernel::{AxisMetric, Kernel, Kernel1d};
use crate::sample::space::{InputSpace, WarpedBox};

/// The solver's name in files and reports.
pub(crate) const NAME: &str = "lattice";

/// A lattice process and the warped box that its lattice lies in.
#[derive(Debug)]
pub(super) struct LatticePosterior {
    pub(super) gp: LatticeGp,
    pub(super) space: WarpedBox,
}

/// The parts of a saved process that are not tensors.
#[derive(Serialize, Deserialize)]
struct Header {
    space: WarpedBox,
    hyper: LatticeHyper,
}

/// Reads a process that [`Posterior::save`] has written.
pub(crate) fn load(header: Value, tensors: &TensorReader<'_>) -> Result<Arc<dyn Posterior>> {
    let Header { space, hyper } = tensors.header(header)?;
    space.validate().map_err(|e| tensors.damaged(e))?;
    let [u, v, phi] = AXIS_NAMES.map(|axis| tensors.read(axis));
    let coordinates = [u?, v?, phi?];
    let targets = tensors.read("targets")?;
    let nodes: usize = coordinates.iter().map(Vec::len).product();
    let data = LatticeData {
        coordinates,
        metrics: space.lattice_metrics(),
        mirrored: space.mirrored(),
        channels: targets.len() / nodes.max(1),
        targets,
    };
    let gp = LatticeGp::from_weights(data, hyper, tensors.read("weights")?);
    Ok(Arc::new(LatticePosterior { gp: gp.map_err(|e| tensors.damaged(e))?, space }))
}

impl LatticePosterior {
    fn points(&self, angles: &[HalfDiff]) -> Vec<[f64; 3]> {
        angles.iter().map(|&angles| self.space.coordinates(angles)).collect()
    }
}

impl Posterior for LatticePosterior {
    fn solver(&self) -> &'static str {
        NAME
    }

    fn label(&self) -> &'static str {
        "Exact, on a lattice"
    }

    fn space(&self) -> InputSpace {
        self.space.into()
    }

    fn n_channels(&self) -> usize {
        self.gp.data().channels
    }

    fn n_data(&self) -> usize {
        self.gp.data().len()
    }

    fn n_floats(&self) -> usize {
        let nodes: usize = self.gp.data().shape().iter().sum();
        let kernels: usize = self.gp.hyper().kernels.iter().map(Kernel1d::n_parameters).sum();
        self.gp.weights().len() + nodes + kernels + 2
    }

    fn noise_variances(&self) -> Vec<f64> {
        vec![self.gp.hyper().noise_variance; self.n_channels()]
    }

    fn predict_mean(&self, angles: &[HalfDiff]) -> Vec<f64> {
        self.gp.predict_mean(&self.points(angles))
    }

    fn predict_variance(&self, angles: &[HalfDiff]) -> Result<Vec<f64>> {
        self.gp.predict_variance_latent(&self.points(angles))
    }

    fn hyper(&self) -> Option<Hyper> {
        let LatticeHyper { signal_variance, noise_variance, kernels } = self.gp.hyper().clone();
        let metrics: [AxisMetric; 3] = self.gp.data().metrics;
        let kernel = Kernel::product(signal_variance, kernels.into_iter().zip(metrics).collect());
        Some(Hyper::new(Solver::Lattice, kernel, noise_variance, None))
    }

    fn kernel_name(&self) -> String {
        product_name(&self.gp.hyper().kernels)
    }

    fn report(&self) -> Value {
        let hyper = self.gp.hyper();
        let single = hyper.kernels.iter().all(|k| k.terms.len() == 1);
        let length = |kernel: &Kernel1d| match kernel.terms.as_slice() {
            [term] if single => json!(term.length_scale),
            terms => terms.iter().map(|t| t.length_scale).collect(),
        };
        json!({
            "length_scale": hyper.kernels.each_ref().map(length),
            "signal_variance": hyper.signal_variance,
            "noise_variance": hyper.noise_variance,
            "axes": hyper.kernels,
        })
    }

    fn save(&self, tensors: &mut TensorWriter) -> Result<Value> {
        let data = self.gp.data();
        for (axis, x) in AXIS_NAMES.iter().zip(&data.coordinates) {
            tensors.add(axis, &[x.len()], x);
        }
        let [a, b, c] = data.shape();
        tensors.add("targets", &[data.channels, a, b, c], &data.targets);
        tensors.add("weights", &[data.channels, a, b, c], self.gp.weights());
        crate::gp::tensors::header(&Header { space: self.space, hyper: self.gp.hyper().clone() })
    }

    fn device_form(&self) -> DeviceForm<'_> {
        DeviceForm::Separable(vec![SeparablePart { gp: &self.gp, space: self.space, colour: None }])
    }

    fn bake_mean(&self, table: &mut MeanTable<'_>, _watch: &Watch) -> Result<()> {
        let (first, offsets, transform) = (table.first_channel, table.offsets, table.transform);
        let slabs = table.cells.par_chunks_mut(SLAB);
        bake_means(&self.gp, self.space, slabs, |slab, rows, means| {
            for (channel, means) in means.chunks_mut(N_THETA_D).enumerate() {
                means.iter_mut().for_each(|m| *m += offsets[first + channel]);
                transform.inverse_in_place(means);
                for (l, value) in means.iter().map(|&value| to_f32(value)).enumerate() {
                    rows.iter().for_each(|&row| slab[cell_index(0, l, row)][first + channel] = value);
                }
            }
        });
        Ok(())
    }

    fn bake_sigma(&self, _watch: &Watch) -> Result<Vec<Vec<f32>>> {
        let mut plane = vec![0.0f32; N_CELLS];
        let slabs = plane.par_chunks_mut(SLAB);
        bake_variances(&self.gp, self.space, slabs, |slab, rows, variances| {
            for (l, sigma) in variances.iter().map(|&variance| to_f32(variance.sqrt())).enumerate() {
                rows.iter().for_each(|&row| slab[cell_index(0, l, row)] = sigma);
            }
        })?;
        Ok(vec![plane])
    }
}

/// The name of a product of one kernel along each axis; of one kernel where all axes have the same shapes.
pub(crate) fn product_name(kernels: &[Kernel1d; 3]) -> String {
    let names = kernels.each_ref().map(|kernel| {
        let shapes: Vec<&str> = kernel.terms.iter().map(|term| term.shape.name()).collect();
        shapes.join(" + ")
    });
    let same = names.iter().all(|name| *name == names[0]);
    format!("product of {} along u, v, phi", if same { names[0].clone() } else { names.join(", ") })
}
