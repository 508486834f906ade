//! Models at given hyper-parameters, with kernels that differ from axis to axis, and searches that can be cancelled:
//! what an interactive program needs beyond [`fit`](crate::fit).

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::fit::{FitOptions, SampleSet, Solver, starting_kernel};
use crate::gp::{
    DenseGp, FitReport, LatticeData, LatticeGp, LatticeHyper, fit_dense_until, fit_lattice_until,
};
use crate::kernel::{Kernel, Shape};
use crate::layout::LatticeLayout;
use crate::model::{Model, Process, Provenance};

/// The hyper-parameters of a process whose channels share them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hyper {
    /// Of a lattice process.
    Lattice(LatticeHyper),
    /// Of a dense process.
    Dense {
        /// The kernel, variances included.
        kernel: Kernel,
        /// Noise variance, in squared target units.
        noise_variance: f64,
    },
}

impl Hyper {
    /// The hyper-parameters of a model, of its first channel where they differ; none of a compressed table, which has
    /// no measurements to condition on.
    #[must_use]
    pub fn of(model: &Model) -> Option<Self> {
        match &model.process {
            Process::Lattice(groups) => groups.first().map(|gp| Self::Lattice(gp.hyper().clone())),
            Process::Dense(groups) => groups
                .first()
                .map(|gp| Self::Dense { kernel: gp.kernel().clone(), noise_variance: gp.noise_variance() }),
            Process::Inducing(_) => None,
        }
    }
}

/// As [`fit`](crate::fit), with the shapes of each axis's kernel in place of [`FitOptions::kernel`]; the dense solver
/// takes the first axis's for all. `cancelled` is asked before every evaluation of the likelihood.
///
/// # Errors
/// Those of [`fit`](crate::fit), and [`Error::Cancelled`] as soon as `cancelled` says so.
pub fn fit_per_axis(
    samples: &SampleSet,
    options: &FitOptions,
    shapes: [&[Shape]; 3],
    provenance: Provenance,
    cancelled: &dyn Fn() -> bool,
) -> Result<(Model, Vec<FitReport>)> {
    let (targets, offsets) = targets(samples, options)?;
    if shapes.iter().any(|shapes| shapes.is_empty()) {
        return Err(Error::argument("kernel", "at least one shape", "none"));
    }
    shapes.iter().flat_map(|shapes| shapes.iter()).try_for_each(|shape| shape.validate())?;
    let groups: Vec<Vec<Vec<f64>>> =
        if options.per_channel { targets.into_iter().map(|t| vec![t]).collect() } else { vec![targets] };

    let (space, process, reports) = match (options.solver, &samples.lattice) {
        (Solver::Auto | Solver::Lattice, Some(lattice)) => {
            let fitted = groups.into_iter().map(|targets| {
                let data = lattice_data(lattice, &targets);
                let kernels = std::array::from_fn(|k| starting_kernel(shapes[k], &data.coordinates[k]));
                fit_lattice_until(data, &kernels, options.noise, &options.optimize, cancelled)
            });
            let (gps, reports) = fitted.collect::<Result<Vec<_>>>()?.into_iter().unzip();
            (lattice.space(), Process::Lattice(gps), reports)
        }
        (Solver::Lattice, None) => {
            return Err(Error::argument("solver", "dense, for samples off a lattice", "lattice"));
        }
        (Solver::Auto | Solver::Dense, lattice) => {
            let space = lattice.as_ref().map_or(options.space, LatticeLayout::space);
            space.validate()?;
            let points: Vec<[f64; 3]> = samples.angles.iter().map(|&a| space.coordinates(a)).collect();
            let fitted = groups.into_iter().map(|targets| {
                fit_dense_until(
                    points.as_flattened(),
                    &targets,
                    &space.metrics(),
                    shapes[0],
                    options.noise,
                    &options.optimize,
                    cancelled,
                )
            });
            let (gps, reports) = fitted.collect::<Result<Vec<_>>>()?.into_iter().unzip();
            (space, Process::Dense(gps), reports)
        }
    };
    let provenance =
        Provenance { layout: samples.layout.into(), lattice: samples.lattice.clone(), ..provenance };
    let model =
        Model { provenance, transform: options.transform, mean: options.mean, offsets, space, process };
    Ok((model, reports))
}

/// Conditions a process on samples at given hyper-parameters, which all channels share; of the options, transform,
/// mean and space count. The second value is the log marginal likelihood there, all channels together.
///
/// On a lattice this takes milliseconds; the dense process factorises its covariance once, `O(n^3)`.
///
/// # Errors
/// No samples, values that are not finite, hyper-parameters out of range, or those of a lattice for samples that stand
/// on none.
pub fn condition(
    samples: &SampleSet,
    options: &FitOptions,
    hyper: &Hyper,
    provenance: Provenance,
) -> Result<(Model, f64)> {
    let (targets, offsets) = targets(samples, options)?;
    let (space, process, value) = match (hyper, &samples.lattice) {
        (Hyper::Lattice(hyper), Some(lattice)) => {
            let data = lattice_data(lattice, &targets);
            hyper.validate()?;
            let value = data.likelihood(hyper)?.value;
            let gp = LatticeGp::new(data, hyper.clone())?;
            (lattice.space(), Process::Lattice(vec![gp]), value)
        }
        (Hyper::Lattice(_), None) => {
            return Err(Error::argument("hyper-parameters", "those of a dense process", "a lattice's"));
        }
        (Hyper::Dense { kernel, noise_variance }, lattice) => {
            let space = lattice.as_ref().map_or(options.space, LatticeLayout::space);
            space.validate()?;
            let points: Vec<[f64; 3]> = samples.angles.iter().map(|&a| space.coordinates(a)).collect();
            let y: Vec<f64> = (0..points.len()).flat_map(|i| targets.iter().map(move |t| t[i])).collect();
            let gp = DenseGp::fit_at(points.as_flattened(), &y, 3, kernel.clone(), *noise_variance)?;
            let value = gp.log_marginal_likelihood();
            (space, Process::Dense(vec![gp]), value)
        }
    };
    let provenance =
        Provenance { layout: samples.layout.into(), lattice: samples.lattice.clone(), ..provenance };
    let model =
        Model { provenance, transform: options.transform, mean: options.mean, offsets, space, process };
    Ok((model, value))
}

/// The targets of each channel less their prior mean, and that mean.
fn targets(samples: &SampleSet, options: &FitOptions) -> Result<(Vec<Vec<f64>>, [f64; 3])> {
    let n = samples.angles.len();
    if n == 0 || samples.values.len() != n {
        return Err(Error::argument("samples", "at least one, with as many values as directions", n));
    }
    if let Some(bad) = samples.values.as_flattened().iter().find(|x| !x.is_finite()) {
        return Err(Error::argument("sample values", "finite numbers", bad));
    }
    options.transform.validate()?;
    let mut targets: Vec<Vec<f64>> =
        (0..3).map(|c| samples.values.iter().map(|v| options.transform.forward(v[c])).collect()).collect();
    let mut offsets = [0.0; 3];
    for (offset, targets) in offsets.iter_mut().zip(&mut targets) {
        *offset = options.mean.offset(targets);
        targets.iter_mut().for_each(|y| *y -= *offset);
    }
    Ok((targets, offsets))
}

/// Targets on the nodes of a lattice.
fn lattice_data(lattice: &LatticeLayout, targets: &[Vec<f64>]) -> LatticeData {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{Layout, fit};
    use crate::model::IntervalOf;
    use crate::source::Source;

    fn samples() -> SampleSet {
        let source = Source::built_in("ward").unwrap();
        let lattice = LatticeLayout { shape: [9, 7, 5], ..LatticeLayout::default() };
        SampleSet::measure(source.brdf().unwrap(), &Layout::Lattice(lattice)).unwrap()
    }

    #[test]
    fn conditioning_at_the_optimum_gives_the_fitted_model() {
        for solver in [Solver::Lattice, Solver::Dense] {
            let (samples, options) = (samples(), FitOptions { solver, ..FitOptions::default() });
            let (fitted, reports) = fit(&samples, &options, Provenance::default()).unwrap();
            let hyper = Hyper::of(&fitted).unwrap();
            let (model, value) = condition(&samples, &options, &hyper, Provenance::default()).unwrap();
            let gap = (value - reports[0].log_marginal_likelihood).abs();
            assert!(gap < 1e-6 * value.abs(), "{solver:?} {gap}");
            let at = &samples.angles[..40];
            assert_eq!(
                model.predict(at, IntervalOf::Latent),
                fitted.predict(at, IntervalOf::Latent),
                "{solver:?}"
            );
        }
    }

    #[test]
    fn axes_have_their_own_shapes_and_searches_stop_when_told() {
        let (samples, options) = (samples(), FitOptions::default());
        let shapes = [&[Shape::Matern52] as &[Shape], &[Shape::SquaredExponential], &[Shape::Matern32]];
        let (model, _) = fit_per_axis(&samples, &options, shapes, Provenance::default(), &|| false).unwrap();
        let Some(Hyper::Lattice(hyper)) = Hyper::of(&model) else { panic!("a lattice") };
        assert_eq!(hyper.kernels.each_ref().map(|k| k.terms[0].shape), shapes.map(|s| s[0]));
        for solver in [Solver::Lattice, Solver::Dense] {
            let options = FitOptions { solver, ..FitOptions::default() };
            let asked = std::cell::Cell::new(0);
            let cancelled = || asked.replace(asked.get() + 1) == 3;
            let stopped = fit_per_axis(&samples, &options, shapes, Provenance::default(), &cancelled);
            assert!(matches!(stopped, Err(Error::Cancelled)), "{solver:?}");
            assert_eq!(asked.get(), 4, "{solver:?}");
        }
        let lattice = Hyper::Lattice(hyper);
        let scattered = SampleSet { lattice: None, ..samples };
        assert!(condition(&scattered, &options, &lattice, Provenance::default()).is_err());
    }
}
