//! The functions of the package.

use std::path::PathBuf;

use gpbrdf_core::brdf::materials;
use gpbrdf_core::formats::read_environment;
use gpbrdf_core::gp::OptimizeOptions;
use gpbrdf_core::plan::{AxisCosts, Belief, Candidates, Cells, Device, Goal, tour};
use gpbrdf_core::{FitOptions, HalfDiff, Noise, Shape, brdf};
use numpy::PyArray2;
use pyo3::{Bound, Py, PyAny, PyRef, PyResult, Python, pyfunction};

use crate::arrays::{Like, angle_rows, array1, array2, column, direction_pairs, paired};
use crate::error::{exception, wrong};
use crate::model::Model;
use crate::names;
use crate::planned::Plan;
use crate::samples::Samples;
use crate::work::observed;

/// The names of the built-in materials.
#[pyfunction]
pub(crate) fn built_in_materials() -> Vec<&'static str> {
    materials().iter().map(|material| material.name).collect()
}

/// Unit vectors at the angle theta from the normal and the azimuth phi, both in radians: shape (n, 3).
#[pyfunction]
pub(crate) fn direction<'py>(
    py: Python<'py>,
    theta: Like<'py, f64>,
    phi: Like<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (theta, phi) = paired("theta and phi", column("theta", &theta)?, column("phi", &phi)?)?;
    array2(
        py,
        theta.iter().zip(phi.iter()).map(|(&theta, &phi)| brdf::direction(theta, phi).into()).collect(),
    )
}

/// The half-difference angles of pairs of unit directions: rows (theta_h, theta_d, phi_d) in radians.
#[pyfunction]
pub(crate) fn half_difference<'py>(
    py: Python<'py>,
    wi: Like<'py, f64>,
    wo: Like<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let pairs = direction_pairs(&wi, &wo)?;
    let angles: Vec<HalfDiff> = pairs.iter().map(|[wi, wo]| HalfDiff::from_directions(wi, wo)).collect();
    array2(py, angle_rows(&angles))
}

/// Fits a model to samples.
///
/// solver: "auto", "lattice", "scattered" or "dense". kernel: the name of a covariance function, such as "matern52" or
/// "se". transform: what is fitted, "log" for ln(f + epsilon), "identity" or "cube-root". mean: "constant" or "zero".
/// noise: the noise variance in squared units of the target, or None to find it. hyper_priors: weak priors for what
/// scattered samples leave open. prior: what is known of other materials, "built-in", the file of a learned prior, or
/// None. outliers: "downweight" or "keep". per_channel: hyper-parameters for each channel. restarts, seed: further
/// starts of the search. progress: called with the share that is done, 0 to 1.
///
/// Ctrl-C stops the fit.
#[pyfunction]
#[pyo3(signature = (samples, *, solver="auto", kernel="matern52", transform="log", epsilon=1e-3, mean="constant",
    noise=None, hyper_priors=true, prior=Some(PathBuf::from("built-in")), outliers="downweight", per_channel=false,
    restarts=0, seed=0, progress=None))]
#[pyo3(text_signature = "(samples, *, solver='auto', kernel='matern52', transform='log', epsilon=0.001, \
mean='constant', noise=None, hyper_priors=True, prior='built-in', outliers='downweight', per_channel=False, \
restarts=0, seed=0, progress=None)")]
pub(crate) fn fit(
    py: Python<'_>,
    samples: PyRef<'_, Samples>,
    solver: &str,
    kernel: &str,
    transform: &str,
    epsilon: f64,
    mean: &str,
    noise: Option<f64>,
    hyper_priors: bool,
    prior: Option<PathBuf>,
    outliers: &str,
    per_channel: bool,
    restarts: usize,
    seed: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Model> {
    let options = FitOptions {
        solver: names::solver(solver)?,
        transform: names::transform(transform, epsilon)?,
        mean: names::mean(mean)?,
        noise: noise.map_or(Noise::Optimized, Noise::Fixed),
        hyper_priors,
        prior: names::prior(prior)?,
        outliers: names::outliers(outliers)?,
        per_channel,
        optimize: OptimizeOptions { restarts, seed, ..OptimizeOptions::default() },
        ..FitOptions::default()
    }
    .with_kernel(&[Shape::from_name(kernel).map_err(exception)?]);
    let samples = &samples.inner;
    let fitted = observed(py, progress.as_ref(), |observer| {
        gpbrdf_core::fit(samples, &FitOptions { observer: observer.clone(), ..options })
    })?;
    Ok(Model { inner: fitted.model, reports: fitted.reports })
}

/// Chooses the directions to measure next, the most telling first.
///
/// measured: samples that were measured already, or None. count: the number of directions, 20 unless until says the
/// expected error of ln f to be reached. The instrument: step of all angles (the first 20 directions and those of matte
/// materials are at multiples of 5 degrees), incidences of the light, theta_max of the detector and min_separation
/// between both, in degrees; in_plane keeps the detector in the plane of incidence. environment: a .hdr or .exr map in
/// whose light the material will be seen, or None for even light; highlights count as much, unless the material is
/// matte. prior as in fit(). Ctrl-C stops the fit to what was measured; the choice itself, which takes seconds, is
/// finished first.
#[pyfunction]
#[pyo3(signature = (measured=None, *, count=None, until=None, prior=Some(PathBuf::from("built-in")), step=1.0,
    incidences=None, theta_max=80.0, in_plane=false, min_separation=3.0, environment=None))]
#[pyo3(
    text_signature = "(measured=None, *, count=None, until=None, prior='built-in', step=1.0, incidences=None, \
theta_max=80.0, in_plane=False, min_separation=3.0, environment=None)"
)]
pub(crate) fn plan(
    py: Python<'_>,
    measured: Option<PyRef<'_, Samples>>,
    count: Option<usize>,
    until: Option<f64>,
    prior: Option<PathBuf>,
    step: f64,
    incidences: Option<Vec<f64>>,
    theta_max: f64,
    in_plane: bool,
    min_separation: f64,
    environment: Option<PathBuf>,
) -> PyResult<Plan> {
    let goal = match (count, until) {
        (Some(_), Some(_)) => return Err(wrong("goal of a plan", "count or until", "both")),
        (Some(0), _) => return Err(wrong("count", "at least 1", 0)),
        (Some(count), None) => Goal::Count(count),
        (None, Some(error)) => Goal::Error(error),
        (None, None) => Goal::Count(20),
    };
    let device = Device { step, incidences, theta_max, in_plane, min_separation };
    let prior = names::prior(prior)?;
    let measured = measured.as_ref().map(|measured| &measured.inner);
    let (found, way) = observed(py, None, |observer| {
        let candidates = Candidates::of(&device)?;
        let environment = environment.map(read_environment).transpose()?;
        let cells = Cells::usual(environment.as_ref(), Cells::COUNT)?;
        let belief = match measured {
            None => Belief::before(prior.prior().as_ref()),
            Some(samples) => {
                let options = FitOptions { prior, observer: observer.clone(), ..FitOptions::default() };
                let fitted = gpbrdf_core::fit(samples, &options)?;
                Belief::of_model(&fitted.model, samples, &options)?
            }
        };
        let angles = measured.map_or(&[][..], |samples| &samples.angles);
        let found = gpbrdf_core::plan::plan(&belief, angles, &candidates, &cells, goal)?;
        let way = tour(&found.geometries, &AxisCosts::default());
        Ok((found, way))
    })?;
    let chosen = &found.geometries;
    let direction_rows =
        |which: usize| array2(py, chosen.iter().map(|g| g.directions()[which].into()).collect());
    Ok(Plan {
        theta_i: array1(py, chosen.iter().map(|g| g.theta_i).collect()).unbind(),
        theta_o: array1(py, chosen.iter().map(|g| g.theta_o).collect()).unbind(),
        phi_o: array1(py, chosen.iter().map(|g| g.phi_o).collect()).unbind(),
        wi: direction_rows(0)?.unbind(),
        wo: direction_rows(1)?.unbind(),
        errors: array1(py, found.errors.clone()).unbind(),
        tour: array1(py, way).unbind(),
    })
}
