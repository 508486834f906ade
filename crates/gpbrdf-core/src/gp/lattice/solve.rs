//! Fits and conditions the lattice process for samples on a lattice.

use std::sync::Arc;

use super::fit::fit_lattice;
use super::posterior::LatticePosterior;
use super::{LatticeData, LatticeGp, LatticeHyper};
use crate::base::error::{Error, Result};
use crate::gp::hyper::Hyper;
use crate::gp::posterior::Posterior;
use crate::gp::problem::{Fitted, Problem};
use crate::kernel::{Kernel1d, KernelBody, KernelTerm, Shape, Term1d};
use crate::sample::lattice::LatticeLayout;

/// Finds hyper-parameters by maximum marginal likelihood and conditions the process at them.
pub(crate) fn fit(problem: &Problem<'_>) -> Result<Fitted> {
    problem.refuse_known_noise()?;
    let lattice = on_lattice(problem)?;
    let data = data_on(lattice, &problem.targets);
    let kernels = std::array::from_fn(|k| starting_kernel(&problem.kernel[k], &data.coordinates[k]));
    let evaluation = || problem.watch.evaluation();
    let (gp, report) = fit_lattice(data, &kernels, problem.noise, problem.optimize, &evaluation)?;
    Ok((Arc::new(LatticePosterior { gp, space: lattice.space() }), report))
}

/// Conditions the process at known hyper-parameters. The second value is the log marginal likelihood there.
pub(crate) fn condition(problem: &Problem<'_>, hyper: &Hyper) -> Result<(Arc<dyn Posterior>, f64)> {
    problem.refuse_known_noise()?;
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

/// Targets on the nodes of a lattice, with the kernel coordinates of the nodes.
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

/// The kernel from which the search along one axis starts: a sum of `shapes` of equal weight, with length
/// scales of a quarter of the extent of the nodes `x` and less.
fn starting_kernel(shapes: &[Shape], x: &[f64]) -> Kernel1d {
    let low = x.iter().copied().fold(f64::INFINITY, f64::min);
    let high = x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let extent = (high - low).max(1e-3);
    let terms = shapes.iter().enumerate().map(|(i, &shape)| Term1d {
        weight: 1.0,
        shape,
        // Terms of the same shape must start at different length scales, or they would stay equal.
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
