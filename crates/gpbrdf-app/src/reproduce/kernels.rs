//! Table 3: kernels and their sums, dense in the paper's setting and on the lattice.

use anyhow::Result;
use gpbrdf_core::{FitOptions, Shape};
use serde_json::json;

use super::context::{Context, Outcome};
use super::measures::{MAE, MEDIAN_LN, MSE, Measure, PSNR_ENV, cells, columns};
use super::paper_lattice::{paper_options, paper_samples};
use super::table::{Table, number};
use crate::job::PAPER_SAMPLES;

const RQ: Shape = Shape::RationalQuadratic { alpha: 1.0 };
const SE: Shape = Shape::SquaredExponential;
const MATERN: Shape = Shape::Matern32;

/// Each kernel, with the paper's MAE, MSE and PSNR.
const KERNELS: [(&str, &[Shape], [f64; 3]); 6] = [
    ("RQ", &[RQ], [0.0134, 0.0830, 54.4767]),
    ("SE", &[SE], [0.0156, 0.0875, 50.2725]),
    ("Matern", &[MATERN], [0.0122, 0.0837, 52.6951]),
    ("Matern+SE", &[MATERN, SE], [0.0800, 0.4527, 36.1594]),
    ("Matern+RQ", &[MATERN, RQ], [0.0187, 0.0992, 57.2624]),
    ("RQ+SE", &[RQ, SE], [0.0205, 0.1078, 52.9558]),
];

const MEASURES: [Measure; 4] = [MAE, MSE, PSNR_ENV, MEDIAN_LN];

pub(super) fn run(context: &Context) -> Result<Outcome> {
    let materials = context.paper_materials()?;
    let Some(material) = materials.first() else { return Ok(Outcome::default()) };
    let truth = material.truth()?;
    let mut table = Table::new(
        "table3",
        format!("Table 3: kernels, {} ({})", material.name(), material.origin),
        &columns(
            &["kernel", "setting", "samples"],
            &MEASURES,
            &["fit s", "paper MAE", "paper MSE", "paper PSNR"],
        ),
    );
    // A sum has twice as many parameters to search. All kernels are given as many samples as a sum can have.
    let most = context.dense_samples(2);
    let few = paper_samples(&truth, most);
    let many = material.lattice_samples(PAPER_SAMPLES)?;
    for (setting, samples) in [("dense", few), ("lattice", many)] {
        for (kernel, shapes, paper) in KERNELS {
            let options = match samples.lattice() {
                None => paper_options(shapes),
                Some(_) => FitOptions::default().with_kernel(shapes),
            };
            let fitted = context.fit_and_compare(&truth, &samples, &options, false)?;
            let mut row = vec![json!(kernel), json!(setting), json!(samples.angles.len())];
            row.extend(cells(&MEASURES, &fitted.metrics));
            row.extend([fitted.fit_seconds].into_iter().chain(paper).map(number));
            table.rows.push(row);
        }
    }
    table.note(format!(
        "Dense: the paper's setting with ARD kernels on {most} of its cells, what a budget of {} s is \
         expected to hold for a sum. Lattice: products of 1-D kernels along the axes, not ARD kernels, on \
         ln(f + 0.001). Matern is of order 3/2: the paper does not say which it takes, nor which material \
         its figures are for, nor how its PSNR was had.",
        context.budget
    ));
    Ok(Outcome { tables: vec![table], figures: Vec::new() })
}
