//! Beyond the paper: a comparison with Neural BRDF, errors against the number of samples, and the calibration
//! of the interval.

use anyhow::Result;
use gpbrdf_core::brdf::analytic::NEURAL_FLOATS;
use gpbrdf_core::figure::{Axis, Curve};
use gpbrdf_core::{
    Brdf, BrdfTable, CompressOptions, FitOptions, InducingSize, LatticeLayout, Metrics, Provenance, compress,
    detect_symmetry,
};
use serde_json::{Value, json};
use std::time::Instant;

use super::context::{Context, Material, Outcome};
use super::measures::{
    COVERAGE, LN_COS, MAE, MEDIAN_LN, MSE, Measure, PSNR_ENV, PSNR_POINT, RMS_LN, SSIM_ENV, cells, columns,
};
use super::table::{Table, number};

const COUNTS: [usize; 7] = [20, 40, 160, 400, 1000, 4000, 37_000];
const QUICK_COUNTS: [usize; 4] = [20, 160, 1000, 37_000];

/// A lattice that stores no more floats than Neural BRDF: each measurement takes three, each coordinate of
/// the nodes one more.
const EQUAL_SHAPE: [usize; 3] = [11, 6, 3];

const MEASURES: [Measure; 9] =
    [PSNR_ENV, PSNR_POINT, SSIM_ENV, MEDIAN_LN, RMS_LN, LN_COS, MAE, MSE, COVERAGE];

pub(super) fn run(context: &Context) -> Result<Outcome> {
    let mut rivals = Table::new(
        "beyond-rivals",
        "As many stored floats",
        &columns(&["material", "truth", "model", "floats", "fit s"], &MEASURES, &[]),
    );
    let mut curve = Table::new(
        "beyond-samples",
        "Few measurements: sampling curve and calibration of the 95 % interval",
        &columns(&["material", "truth", "samples", "floats", "fit s"], &MEASURES, &[]),
    );
    let counts = if context.quick { &QUICK_COUNTS[..] } else { &COUNTS[..] };
    let (mut quality, mut coverage) = (Vec::new(), Vec::new());
    for material in context.all_materials()? {
        let truth = material.truth()?;
        against_neural(context, material, &truth, &mut rivals)?;
        let mut points: [Vec<(f64, f64)>; 2] = [Vec::new(), Vec::new()];
        for &count in counts {
            let samples = material.lattice_samples(count)?;
            let fitted = context.fit_and_compare(&truth, &samples, &FitOptions::default(), true)?;
            let n = samples.angles.len();
            points[0].push((n as f64, fitted.metrics.images.psnr_env));
            points[1].extend(fitted.metrics.cells.coverage_95.map(|share| (n as f64, share)));
            let mut row = vec![
                json!(material.name()),
                json!(material.origin),
                json!(n),
                json!(fitted.model.n_floats()),
                number(fitted.fit_seconds),
            ];
            row.extend(cells(&MEASURES, &fitted.metrics));
            curve.rows.push(row);
        }
        let [psnr, share] = points;
        quality.push(Curve { name: material.name().to_owned(), points: psnr, ..Curve::default() });
        coverage.push(Curve { name: material.name().to_owned(), points: share, ..Curve::default() });
    }
    rivals.add_means(2);
    curve.add_means(2);
    rivals.note(
        "Neural BRDF and the inducing lattices are given the whole table: the first was trained on it by its \
         authors, the second are fitted to all its valid cells. The exact lattice is given no more than it \
         stores. The floats of ours include every constant. Without --nbrdf, or where it has no fit of a \
         material, ours stand alone.",
    );
    curve.note(
        "Exact lattice process, default options. Coverage is the share of all valid cells inside the 95 % \
         interval of a measurement: 0.95 is calibrated, less is too sure of itself.",
    );
    let mut outcome = Outcome { tables: vec![rivals, curve], figures: Vec::new() };
    let x = Axis::logarithmic("measurements");
    let y = Axis::linear("PSNR env, dB");
    outcome.plot(context, "beyond-samples", "Quality against measurements", x.clone(), y, quality)?;
    let y = Axis::linear("share of cells in the 95 % interval");
    outcome.plot(context, "beyond-coverage", "Calibration of the 95 % interval", x, y, coverage)?;
    Ok(outcome)
}

/// Adds rows for Neural BRDF, if there is a fit of this material, for inducing lattices, and for an exact
/// lattice that stores as many floats.
fn against_neural(
    context: &Context,
    material: Material<'_>,
    truth: &BrdfTable,
    table: &mut Table,
) -> Result<()> {
    let mut add = |model: &str, floats: usize, seconds: Value, metrics: &Metrics| {
        let (name, origin) = (json!(material.name()), json!(material.origin));
        let mut row = vec![name, origin, json!(model), json!(floats), seconds];
        row.extend(cells(&MEASURES, metrics));
        table.rows.push(row);
    };
    if let Some((_, neural)) = context.neural.iter().find(|(of, _)| of == material.name()) {
        let predicted = BrdfTable::from_fn(|angles| neural.eval_half_diff(angles));
        let metrics = Metrics::new(truth, &predicted, &context.environment, None)?;
        add("Neural BRDF", NEURAL_FLOATS, Value::Null, &metrics);
    }
    let options = CompressOptions {
        size: InducingSize::Floats(NEURAL_FLOATS),
        symmetry: detect_symmetry(truth),
        ..CompressOptions::default()
    };
    let start = Instant::now();
    let model = compress(truth, &options, Provenance::default())?.model;
    let seconds = start.elapsed().as_secs_f64();
    let floats = model.n_floats();
    let fitted = context.compare(truth, model, seconds, true)?;
    add("inducing lattices", floats, number(seconds), &fitted.metrics);
    let samples = material.measure(|symmetry| Ok(LatticeLayout::with_shape(EQUAL_SHAPE, symmetry)))?;
    let fitted = context.fit_and_compare(truth, &samples, &FitOptions::default(), true)?;
    let name = format!("lattice of {} measurements", samples.angles.len());
    add(&name, fitted.model.n_floats(), number(fitted.fit_seconds), &fitted.metrics);
    Ok(())
}
