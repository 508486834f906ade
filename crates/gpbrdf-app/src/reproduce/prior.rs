//! Few measurements with a prior that was learned from other materials, by choice of directions, beside a peer.

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::{Result, bail};
use gpbrdf_core::brdf::Brdf;
use gpbrdf_core::figure::{Axis, Curve};
use gpbrdf_core::plan::{Belief, Candidates, Cells, Device, Goal, plan};
use gpbrdf_core::prior::{LearnOptions, Library, family, learn};
use gpbrdf_core::{BrdfTable, Metrics};
use serde_json::{Value, json};

use super::context::{Context, Material, Outcome};
use super::measures::{COVERAGE, MEDIAN_LN, Measure, PSNR_ENV, cells, columns};
use super::principal::Principal;
use super::simulate::{BATCHES, Trained, Trial};
use super::table::{Table, number};

const QUICK_COUNTS: [usize; 2] = [20, 100];

/// Samples of the scan in the plane of incidence: about one every 4 degrees at five incidences.
const IN_PLANE: usize = 215;

/// Numbers of planned directions of the peer.
const PEER_COUNTS: [usize; 5] = [5, 10, 20, 42, 165];
const QUICK_PEER_COUNTS: [usize; 1] = [20];

const MEASURES: [Measure; 3] = [PSNR_ENV, MEDIAN_LN, COVERAGE];

/// Materials to learn from, for priors and for their peer.
#[derive(Clone, Debug)]
pub(crate) struct Materials {
    library: Library,
    principal: Principal,
}

impl Materials {
    /// No materials.
    ///
    /// # Errors
    /// None with the usual number of directions.
    pub(crate) fn new() -> Result<Self> {
        Ok(Self { library: Library::new(Library::CENTRES)?, principal: Principal::default() })
    }

    /// Adds a material; one of the same name is replaced.
    ///
    /// # Errors
    /// A material that cannot be fitted.
    pub(crate) fn add(&mut self, name: &str, brdf: &dyn Brdf) -> Result<()> {
        self.library.add(name, brdf)?;
        self.principal.add(name, brdf);
        Ok(())
    }
}

/// A row of the table of all materials.
struct Row {
    choice: &'static str,
    samples: usize,
    metrics: Metrics,
    expected: Option<f64>,
}

impl From<Trained> for Row {
    fn from(Trained { choice, samples, metrics, expected, .. }: Trained) -> Self {
        Self { choice, samples, metrics, expected }
    }
}

/// The materials of the experiment: RGL measurements of `--data`.
fn materials(context: &Context) -> Vec<Material<'_>> {
    let mut found = context.rgl_materials();
    if context.quick {
        found.truncate(2);
    }
    found
}

/// Whether the experiment has what it needs.
pub(super) fn is_possible(context: &Context) -> bool {
    context.library.is_some() && !materials(context).is_empty()
}

/// The expected time in seconds.
pub(super) fn seconds(context: &Context) -> f64 {
    materials(context).len() as f64 * if context.quick { 25.0 } else { 50.0 }
}

pub(super) fn run(context: &Context) -> Result<Outcome> {
    let materials = materials(context);
    let Some(library) = &context.library else {
        bail!("--only prior: expected --library with the materials to learn from, found none");
    };
    if materials.is_empty() {
        bail!("--only prior: expected RGL measurements in --data, found none");
    }
    let cells_of_plans = Cells::usual(None, Cells::COUNT)?;
    let device = Device::default();
    let mut all = Table::new(
        "prior-materials",
        "Few measurements with a learned prior",
        &columns(&["material", "directions", "samples"], &MEASURES, &["expected error"]),
    );
    let mut groups: BTreeMap<(usize, &'static str, usize), Vec<Row>> = BTreeMap::new();
    for material in &materials {
        let own = family(material.name());
        let prior = learn(
            "left out",
            &library.library.without(|name| family(name) == own),
            &LearnOptions::default(),
        )?;
        let truth = material.truth()?;
        let trial = Trial {
            brdf: material.brdf()?,
            truth: &truth,
            environment: &context.environment,
            device: &device,
            cells: &cells_of_plans,
            prior: Some(Arc::new(prior)),
        };
        let principal = library.principal.without(|name| family(name) == own);
        for (place, row) in rows(context, &trial, &principal)?.into_iter().enumerate() {
            let mut shown = vec![json!(material.name()), json!(row.choice), json!(row.samples)];
            shown.extend(cells(&MEASURES, &row.metrics));
            shown.push(row.expected.map_or(Value::Null, number));
            all.rows.push(shown);
            groups.entry((place, row.choice, row.samples)).or_default().push(row);
        }
    }
    summarised(context, all, &groups, materials.len())
}

/// One table of means and worst cases, one of all materials, and the curves.
fn summarised(
    context: &Context,
    all: Table,
    groups: &BTreeMap<(usize, &'static str, usize), Vec<Row>>,
    count: usize,
) -> Result<Outcome> {
    let mut summary = Table::new(
        "prior",
        format!(
            "Few measurements with a prior learned from others: {count} materials, each without its family"
        ),
        &["directions", "samples", "PSNR env", "worst", "median ln", "coverage 95 %", "expected error"],
    );
    let mut curves: Vec<Curve> = Vec::new();
    for ((_, choice, samples), rows) in groups {
        let mean = |of: &dyn Fn(&Row) -> Option<f64>| {
            let values: Vec<f64> = rows.iter().filter_map(of).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let psnr = mean(&|row| Some(row.metrics.images.psnr_env)).unwrap_or(f64::NAN);
        let worst = rows.iter().map(|row| row.metrics.images.psnr_env).fold(f64::INFINITY, f64::min);
        let shown = |x: Option<f64>| x.map_or(Value::Null, number);
        summary.rows.push(vec![
            json!(choice),
            json!(samples),
            number(psnr),
            number(worst),
            shown(mean(&|row| Some(row.metrics.cells.median_abs_log))),
            shown(mean(&|row| row.metrics.cells.coverage_95)),
            shown(mean(&|row| row.expected)),
        ]);
        let point = (*samples as f64, psnr);
        match curves.iter_mut().find(|curve| curve.name == *choice) {
            Some(curve) => curve.points.push(point),
            None => {
                curves.push(Curve { name: (*choice).to_owned(), points: vec![point], ..Curve::default() })
            }
        }
    }
    summary.note(
        "Planned directions are measured in stages, each planned with the hyper-parameters of a fit to those before. \
         All but the peer are fitted with a prior that is learned from the library and the other measurements, without \
         all materials whose names begin with the same word. The peer is that of Nielsen, Jensen and Ramamoorthi \
         (2015): all principal components of the same library, with a ridge of 40, from planned directions. The \
         expected error is that of ln f which the fitted process expects, weighted with the cosines; PSNR env is in \
         dB.",
    );
    let mut outcome = Outcome { tables: vec![summary, all], figures: Vec::new() };
    let x = Axis::logarithmic("directions");
    let y = Axis::linear("mean PSNR env, dB");
    outcome.plot(context, "prior", "Few measurements with a learned prior", x, y, curves)?;
    Ok(outcome)
}

/// All choices of directions for one material.
fn rows(context: &Context, trial: &Trial<'_>, principal: &Principal) -> Result<Vec<Row>> {
    let counts = if context.quick { &QUICK_COUNTS[..] } else { &BATCHES[..] };
    let mut found: Vec<Row> = trial.planned(counts)?.into_iter().map(Row::from).collect();
    found.push(trial.in_plane(IN_PLANE)?.into());
    for &count in counts {
        found.push(trial.random(count)?.into());
    }
    for &count in counts {
        found.extend(trial.lattice(count)?.map(Row::from));
    }
    let counts = if context.quick { &QUICK_PEER_COUNTS[..] } else { &PEER_COUNTS[..] };
    let most = counts.iter().copied().max().unwrap_or(0);
    let candidates = Candidates::of(trial.device)?;
    let belief = Belief::before(trial.prior.as_ref());
    let chosen = plan(&belief, &[], &candidates, trial.cells, Goal::Count(most))?.geometries;
    for &count in counts {
        let predicted: BrdfTable = principal.predict(&trial.measured(&chosen[..count]));
        let metrics = Metrics::new(trial.truth, &predicted, trial.environment, None)?;
        found.push(Row { choice: "principal components", samples: count, metrics, expected: None });
    }
    Ok(found)
}
