//! Options by their names.

use std::path::PathBuf;
use std::sync::Arc;

use gpbrdf_core::formats::{AngleUnit, ReadOptions, ValueKind, Zenith};
use gpbrdf_core::model::PriorChoice;
use gpbrdf_core::prior::Prior;
use gpbrdf_core::{IntervalOf, MeanFunction, Outliers, Solver, Transform};
use pyo3::PyResult;

use crate::error::{exception, wrong};

/// The choice with this name.
fn named<T: Copy>(what: &str, name: &str, choices: &[(&str, T)]) -> PyResult<T> {
    choices.iter().find(|(known, _)| *known == name).map(|(_, choice)| *choice).ok_or_else(|| {
        let known: Vec<String> = choices.iter().map(|(known, _)| format!("\"{known}\"")).collect();
        wrong(what, &format!("one of {}", known.join(", ")), format_args!("\"{name}\""))
    })
}

pub(crate) fn solver(name: &str) -> PyResult<Solver> {
    let all = [Solver::Auto, Solver::Lattice, Solver::Scattered, Solver::Dense];
    let choices: Vec<_> = Solver::NAMES.into_iter().zip(all).collect();
    named("solver", name, &choices)
}

pub(crate) fn transform(name: &str, epsilon: f64) -> PyResult<Transform> {
    let log = Transform::Log { epsilon };
    named(
        "transform",
        name,
        &[("log", log), ("identity", Transform::Identity), ("cube-root", Transform::CubeRoot)],
    )
}

pub(crate) fn mean(name: &str) -> PyResult<MeanFunction> {
    named("mean", name, &[("constant", MeanFunction::Constant), ("zero", MeanFunction::Zero)])
}

pub(crate) fn outliers(name: &str) -> PyResult<Outliers> {
    named("outliers", name, &[("keep", Outliers::Keep), ("downweight", Outliers::Downweight)])
}

pub(crate) fn interval_of(name: &str) -> PyResult<IntervalOf> {
    named("of", name, &[("observation", IntervalOf::Observation), ("latent", IntervalOf::Latent)])
}

/// How to read measurements that are text; `None` is what the file says.
pub(crate) fn reading(
    values: Option<&str>,
    angles: Option<&str>,
    zenith: Option<&str>,
) -> PyResult<ReadOptions> {
    let kinds = [("brdf", ValueKind::Brdf), ("cosine", ValueKind::Cosine), ("factor", ValueKind::Factor)];
    let units = [("degrees", AngleUnit::Degrees), ("radians", AngleUnit::Radians)];
    let zeniths = [("theta", Zenith::Theta), ("phi", Zenith::Phi)];
    Ok(ReadOptions {
        values: values.map(|name| named("values", name, &kinds)).transpose()?,
        angles: angles.map(|name| named("angles", name, &units)).transpose()?,
        zenith: zenith.map(|name| named("zenith", name, &zeniths)).transpose()?,
    })
}

/// What is known of other materials: `None` for nothing, `built-in`, or the file of a learned prior.
pub(crate) fn prior(name: Option<PathBuf>) -> PyResult<PriorChoice> {
    Ok(match name {
        None => PriorChoice::None,
        Some(name) if name.as_os_str() == "built-in" => PriorChoice::BuiltIn,
        Some(path) => PriorChoice::Learned(Arc::new(Prior::load(path).map_err(exception)?)),
    })
}
