//! Figure 2: error and time of the fit against the sampling rate.

use anyhow::Result;
use gpbrdf_core::brdf::N_CELLS;
use gpbrdf_core::figure::{Axis, Curve};
use gpbrdf_core::{FitOptions, LatticeLayout, Layout, SampleSet, Solver};
use serde_json::json;

use super::context::{Context, Outcome};
use super::measures::{MAE, MEDIAN_LN, MSE, Measure, PSNR_ENV, cells, columns};
use super::table::{Table, number};

/// Percent of the cells of a table.
const RATES: [f64; 9] = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 2.58, 5.0, 10.0];
const QUICK_RATES: [f64; 4] = [0.05, 0.2, 1.0, 2.58];

const MEASURES: [Measure; 4] = [MAE, MSE, MEDIAN_LN, PSNR_ENV];

/// The number of cells that are `rate` percent of a table.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rates are in 0 to 10")]
fn samples_of(rate: f64) -> usize {
    (rate / 100.0 * N_CELLS as f64).round() as usize
}

pub(super) fn run(context: &Context) -> Result<Outcome> {
    let materials = context.paper_materials()?;
    let Some(material) = materials.last() else { return Ok(Outcome::default()) };
    let truth = material.truth()?;
    let mut table = Table::new(
        "figure2",
        format!(
            "Figure 2: error and time against the sampling rate, {} ({})",
            material.name(),
            material.origin
        ),
        &columns(&["solver", "rate %", "samples"], &MEASURES, &["fit s"]),
    );
    let names = ["lattice", "dense, random cells"];
    let mut errors = names.map(|name| Curve { name: name.into(), points: Vec::new(), ..Curve::default() });
    let mut times = errors.clone();
    let most = context.dense_samples(1);
    let rates = if context.quick { &QUICK_RATES[..] } else { &RATES[..] };
    for (k, name) in names.into_iter().enumerate() {
        let mut wanted: Vec<usize> = rates.iter().map(|&rate| samples_of(rate)).collect();
        if k == 1 {
            wanted.retain(|&n| n < most);
            wanted.push(most);
        }
        for count in wanted {
            let (samples, options) = if k == 0 {
                (material.lattice_samples(count)?, FitOptions::default())
            } else {
                let samples = SampleSet::measure(&*truth, &Layout::Cells { count, seed: 0 })?;
                // The same space and the same rule as on the lattice: only the layout differs.
                let space = Some(LatticeLayout::default().space().into());
                let options =
                    FitOptions { solver: Solver::Dense, hyper_priors: false, space, ..FitOptions::default() };
                (samples, options)
            };
            let fitted = context.fit_and_compare(&truth, &samples, &options, false)?;
            let n = samples.angles.len();
            let rate = 100.0 * n as f64 / N_CELLS as f64;
            errors[k].points.push((rate, fitted.metrics.cells.mae));
            times[k].points.push((rate, fitted.fit_seconds));
            let mut row = vec![json!(name), number(rate), json!(n)];
            row.extend(cells(&MEASURES, &fitted.metrics));
            row.push(number(fitted.fit_seconds));
            table.rows.push(row);
        }
    }
    table.note(format!(
        "Rates are of all 1,458,000 cells, as in the paper. The dense solver stops at {most} samples, the \
         most that a budget of {} s is expected to hold. Both fit ln(f + 0.001) by a Matern 5/2 kernel; \
         times are those of this machine.",
        context.budget
    ));
    let mut outcome = Outcome::default();
    let x = Axis::logarithmic("sampling rate, %");
    let y = Axis::logarithmic("MAE, 1/sr");
    outcome.plot(context, "figure2-error", "Figure 2: error", x.clone(), y, errors.to_vec())?;
    let y = Axis::logarithmic("fit, s");
    outcome.plot(context, "figure2-time", "Figure 2: time of the fit", x, y, times.to_vec())?;
    outcome.tables.push(table);
    Ok(outcome)
}
