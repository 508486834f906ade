//! Plans tried out on a material that is known everywhere, beside other choices of directions.

use std::sync::Arc;

use anyhow::Result;
use gpbrdf_core::figure::{Axis, Curve, Figure};
use gpbrdf_core::model::PriorChoice;
use gpbrdf_core::plan::{Belief, Candidates, Cells, Device, Geometry, Goal, expected_error, plan};
use gpbrdf_core::prior::Prior;
use gpbrdf_core::sample::InPlaneScan;
use gpbrdf_core::{
    Brdf, BrdfTable, Environment, FitOptions, HalfDiff, LatticeLayout, Layout, Metrics, Model, Sample,
    SampleSet, Symmetry, bake_mean, bake_sigma, fit,
};
use serde_json::{Value, json};

use super::context::curves_figure;
use super::measures::{COVERAGE, MEDIAN_LN, Measure, PSNR_ENV, cells, columns};
use super::table::{Table, number};
use crate::job::judge;

/// The numbers of directions of the paper's and of other published measurements with few samples.
pub(crate) const BATCHES: [usize; 5] = [10, 20, 42, 100, 234];

/// Seed of the directions that are drawn at random.
const SEED: u64 = 1;

/// The fewest nodes of a lattice.
const FEWEST_NODES: usize = 12;

/// A material whose values are known everywhere, and how plans for it are made and judged.
pub(crate) struct Trial<'a> {
    pub(crate) brdf: &'a dyn Brdf,
    pub(crate) truth: &'a BrdfTable,
    pub(crate) environment: &'a Environment,
    pub(crate) device: &'a Device,
    pub(crate) cells: &'a Cells,
    pub(crate) prior: Option<Arc<Prior>>,
}

/// A model of few samples beside the truth.
#[derive(Clone, Debug)]
pub(crate) struct Trained {
    /// How the directions were chosen.
    pub(crate) choice: &'static str,
    pub(crate) samples: usize,
    pub(crate) model: Arc<Model>,
    pub(crate) metrics: Metrics,
    /// The root mean square error of `ln f` that the process of the samples expects; `None` for a process on a lattice.
    pub(crate) expected: Option<f64>,
}

impl Trial<'_> {
    /// Planned directions, measured in stages of these counts: after each, a model is fitted, and the next stage is
    /// planned with its hyper-parameters.
    ///
    /// # Errors
    /// Counts that the device does not reach, and those of a fit.
    pub(crate) fn planned(&self, counts: &[usize]) -> Result<Vec<Trained>> {
        let candidates = Candidates::of(self.device)?;
        let mut belief = Belief::before(self.prior.as_ref());
        let mut chosen: Vec<Geometry> = Vec::new();
        let mut found = Vec::new();
        for &count in counts {
            let known: Vec<HalfDiff> = chosen.iter().map(|geometry| geometry.angles()).collect();
            let goal = Goal::Count(count.saturating_sub(chosen.len()));
            chosen.extend(plan(&belief, &known, &candidates, self.cells, goal)?.geometries);
            let (trained, next) = self.train("planned", &self.measured(&chosen))?;
            belief = next.unwrap_or(belief);
            found.push(trained);
        }
        Ok(found)
    }

    /// Light and viewer drawn at random, uniformly in solid angle.
    ///
    /// # Errors
    /// A count of 0, and those of a fit.
    pub(crate) fn random(&self, count: usize) -> Result<Trained> {
        let samples = SampleSet::measure(self.brdf, &Layout::Hemisphere { count, seed: SEED })?;
        Ok(self.train("random", &samples)?.0)
    }

    /// Light and viewer spread evenly in solid angle by an additive recurrence.
    ///
    /// # Errors
    /// A count of 0, and those of a fit.
    pub(crate) fn even(&self, count: usize) -> Result<Trained> {
        let sample = |angles: &HalfDiff| {
            let (wi, wo) = angles.to_directions();
            Sample { wi, wo, value: self.brdf.eval(&wi, &wo) }
        };
        let samples = Cells::hemisphere(count)?.angles().iter().map(sample).collect();
        Ok(self.train("quasi-random", &samples)?.0)
    }

    /// The product lattice of about this number of nodes; `None` where that is too small for one.
    ///
    /// # Errors
    /// Those of a fit.
    pub(crate) fn lattice(&self, count: usize) -> Result<Option<Trained>> {
        if count < FEWEST_NODES {
            return Ok(None);
        }
        let lattice = LatticeLayout::with_samples(count, Symmetry::Bilateral)?;
        let samples = SampleSet::measure(self.brdf, &Layout::Lattice(lattice))?;
        Ok(Some(self.train("product lattice", &samples)?.0))
    }

    /// A scan in the plane of incidence at five incidences.
    ///
    /// # Errors
    /// Those of a fit.
    pub(crate) fn in_plane(&self, count: usize) -> Result<Trained> {
        let scan = InPlaneScan { count, ..InPlaneScan::default() };
        let samples = SampleSet::measure(self.brdf, &Layout::InPlane(scan))?;
        Ok(self.train("in-plane", &samples)?.0)
    }

    /// The values of the material.
    pub(super) fn measured(&self, geometries: &[Geometry]) -> SampleSet {
        let sample = |geometry: &Geometry| {
            let [wi, wo] = geometry.directions();
            Sample { wi, wo, value: self.brdf.eval(&wi, &wo) }
        };
        geometries.iter().map(sample).collect()
    }

    /// Fits a model and compares it with the truth. The second value is what is known then.
    fn train(&self, choice: &'static str, samples: &SampleSet) -> Result<(Trained, Option<Belief>)> {
        let prior = self.prior.clone().map_or(PriorChoice::None, PriorChoice::Learned);
        let options = FitOptions { prior, ..FitOptions::default() };
        let model = fit(samples, &options)?.model;
        let belief = Belief::of_model(&model, samples, &options).ok();
        let expected = belief.as_ref().map(|belief| expected_error(belief, &samples.angles, self.cells));
        let (mean, sigma) = (bake_mean(&model), bake_sigma(&model)?);
        let metrics = judge(self.truth, &model, &mean, Some(&sigma), self.environment)?;
        let expected = expected.transpose()?;
        let model = Arc::new(model);
        Ok((Trained { choice, samples: samples.len(), model, metrics, expected }, belief))
    }
}

/// All choices at the same numbers of directions.
#[derive(Debug)]
pub(crate) struct Simulation {
    material: String,
    rows: Vec<Trained>,
}

const MEASURES: [Measure; 3] = [PSNR_ENV, MEDIAN_LN, COVERAGE];

impl Simulation {
    /// Plans for a material and tries the plan, random directions, evenly spread ones and product lattices.
    ///
    /// # Errors
    /// Counts that the device does not reach, and those of a fit.
    pub(crate) fn new(material: &str, trial: &Trial<'_>, counts: &[usize]) -> Result<Self> {
        let mut rows = trial.planned(counts)?;
        for &count in counts {
            rows.push(trial.random(count)?);
        }
        for &count in counts {
            rows.push(trial.even(count)?);
        }
        for &count in counts {
            rows.extend(trial.lattice(count)?);
        }
        Ok(Self { material: material.to_owned(), rows })
    }

    /// The results for people.
    pub(crate) fn table(&self) -> Table {
        let columns = columns(&["directions", "samples"], &MEASURES, &["expected error"]);
        let mut table = Table::new("plan", format!("{}: few directions", self.material), &columns);
        for row in &self.rows {
            let mut shown = vec![json!(row.choice), json!(row.samples)];
            shown.extend(cells(&MEASURES, &row.metrics));
            shown.push(row.expected.map_or(Value::Null, number));
            table.rows.push(shown);
        }
        table
    }

    /// The results for programs.
    pub(crate) fn json(&self) -> Value {
        let rows = self.rows.iter().map(|row| {
            json!({
                "directions": row.choice,
                "samples": row.samples,
                "psnr_env": number(row.metrics.images.psnr_env),
                "median_abs_log": row.metrics.cells.median_abs_log,
                "coverage_95": row.metrics.cells.coverage_95,
                "expected_error": row.expected,
            })
        });
        json!({ "material": self.material, "rows": rows.collect::<Vec<_>>() })
    }

    /// The quality of the pictures against the number of samples.
    pub(crate) fn figure(&self) -> Figure {
        let mut all: Vec<Curve> = Vec::new();
        for row in &self.rows {
            let point = (row.samples as f64, row.metrics.images.psnr_env);
            match all.iter_mut().find(|curve| curve.name == row.choice) {
                Some(curve) => curve.points.push(point),
                None => {
                    all.push(Curve { name: row.choice.to_owned(), points: vec![point], ..Curve::default() })
                }
            }
        }
        let x = Axis::logarithmic("directions");
        let y = Axis::linear("PSNR env, dB");
        let title = format!("{}: quality of the prediction by how directions are chosen", self.material);
        curves_figure(&title, x, y, all)
    }
}
