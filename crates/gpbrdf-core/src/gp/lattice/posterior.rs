//! The lattice process as a posterior of a model.

use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::fit::fit_lattice;
use super::table::{bake_means, bake_variances};
use super::{LatticeData, LatticeGp, LatticeHyper};
use crate::base::error::{Error, Result};
use crate::brdf::angles::HalfDiff;
use crate::brdf::table::{N_CELLS, N_THETA_D, SLAB, cell_index};
use crate::gp::hyper::Hyper;
use crate::gp::posterior::{DeviceForm, Fitted, Posterior, SeparablePart};
use crate::gp::report::AXIS_NAMES;
use crate::gp::solver::{Problem, Solver};
use crate::gp::table::{MeanTable, to_f32};
use crate::gp::tensors::{TensorReader, TensorWriter};
use crate::kernel::{AxisMetric, Kernel, Kernel1d, KernelBody, KernelTerm, Shape, Term1d};
use crate::sample::lattice::LatticeLayout;
use crate::sample::space::{InputSpace, WarpedBox};

/// The solver's name in files and reports.
pub(crate) const NAME: &str = "lattice";

/// A lattice process and the box in which its lattice stands.
#[derive(Debug)]
struct LatticePosterior {
    gp: LatticeGp,
    space: WarpedBox,
}

/// Finds hyper-parameters by maximum marginal likelihood and conditions.
pub(crate) fn fit(problem: &Problem<'_>) -> Result<Fitted> {
    let lattice = on_lattice(problem)?;
    let data = data_on(lattice, &problem.targets);
    let kernels = std::array::from_fn(|k| starting_kernel(&problem.kernel[k], &data.coordinates[k]));
    let evaluation = || problem.watch.evaluation();
    let (gp, report) = fit_lattice(data, &kernels, problem.noise, problem.optimize, &evaluation)?;
    Ok((Arc::new(LatticePosterior { gp, space: lattice.space() }), report))
}

/// Conditions at known hyper-parameters.
pub(crate) fn condition(problem: &Problem<'_>, hyper: &Hyper) -> Result<(Arc<dyn Posterior>, f64)> {
    let lattice = on_lattice(problem)?;
    let data = data_on(lattice, &problem.targets);
    let hyper = LatticeHyper::try_from(hyper)?;
    hyper.validate()?;
    let value = data.likelihood(&hyper)?.value;
    let gp = LatticeGp::new(data, hyper)?;
    Ok((Arc::new(LatticePosterior { gp, space: lattice.space() }), value))
}

fn on_lattice<'a>(problem: &Problem<'a>) -> Result<&'a LatticeLayout> {
    problem.lattice.ok_or_else(|| Error::argument("solver", "dense, for samples off a lattice", "lattice"))
}

/// Targets on the nodes of a lattice.
fn data_on(lattice: &LatticeLayout, targets: &[Vec<f64>]) -> LatticeData {
    let space = lattice.space();
    let [u, v, phi] = lattice.nodes();
    LatticeData {
        coordinates: [
            u.into_iter().map(|u| space.warp_u(u)).collect(),
            v.into_iter().map(|v| space.warp_v(v)).collect(),
            phi.into_iter().map(|phi| space.warp_phi(phi)).collect(),
        ],
        metrics: space.lattice_metrics(),
        mirrored: space.mirrored(),
        channels: targets.len(),
        targets: targets.concat(),
    }
}

/// A sum of `shapes` of equal weight, with length scales spread below the extent of the nodes `x`.
fn starting_kernel(shapes: &[Shape], x: &[f64]) -> Kernel1d {
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

impl TryFrom<&Hyper> for LatticeHyper {
    type Error = Error;

    fn try_from(hyper: &Hyper) -> Result<Self> {
        let wrong = || {
            let found = hyper.kernel.name();
            Error::argument("hyper-parameters", "those of a lattice: one product of three axes", found)
        };
        let [KernelTerm { variance, body: KernelBody::Product(axes) }] = hyper.kernel.terms.as_slice() else {
            return Err(wrong());
        };
        let kernels = axes.clone().try_into().map_err(|_| wrong())?;
        Ok(Self { signal_variance: *variance, noise_variance: hyper.noise_variance, kernels })
    }
}

/// A saved process, but for its tensors.
#[derive(Serialize, Deserialize)]
struct Header {
    space: WarpedBox,
    hyper: LatticeHyper,
}

/// Reads what [`Posterior::save`] has written.
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
        Some(Hyper { solver: Solver::Lattice, kernel, noise_variance })
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

    fn bake_mean(&self, table: &mut MeanTable<'_>) {
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
    }

    fn bake_sigma(&self) -> Result<Vec<Vec<f32>>> {
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

/// The name of a product of one kernel along each axis, after the first axis.
pub(crate) fn product_name(kernels: &[Kernel1d; 3]) -> String {
    let names: Vec<&str> = kernels[0].terms.iter().map(|term| term.shape.name()).collect();
    format!("product of {} along u, v, phi", names.join(" + "))
}
