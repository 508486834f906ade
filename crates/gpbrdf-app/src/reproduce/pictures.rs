//! Figures 3, 4 and 5: spheres, slices and the distribution of the pixel difference.

use anyhow::Result;
use gpbrdf_core::FitOptions;
use gpbrdf_core::figure::{Axis, Curve, SliceOptions, slice_figure, sphere_figure};
use gpbrdf_core::judge::{Image, PixelDifference, render_env, render_point};
use serde_json::json;

use super::context::{Context, Outcome};
use super::table::{Table, number};
use crate::job::PAPER_SAMPLES;

/// Points of a curve of the distribution.
const STEPS: usize = 200;

/// The sizes of `1 - b / a` over the sphere's pixels and channels, sorted.
fn differences(truth: &Image, prediction: &Image) -> Vec<f64> {
    let pairs = truth.sphere_pixels().flatten().zip(prediction.sphere_pixels().flatten());
    let lit = pairs.filter(|(a, _)| **a > 0.0);
    let mut values: Vec<f64> = lit.map(|(&a, &b)| (1.0 - f64::from(b) / f64::from(a)).abs()).collect();
    values.sort_unstable_by(f64::total_cmp);
    values
}

pub(super) fn run(context: &Context) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut table = Table::new(
        "figures345",
        "Figure 5 (e): pixel difference |1 - b / a| of the sphere",
        &["material", "truth", "light", "mean", "median", "99th percentile", "largest", "share below 5 %"],
    );
    let size = if context.quick { 96 } else { 512 };
    let mut distributions = Vec::new();
    for material in context.paper_materials()? {
        let (name, truth) = (material.name(), material.truth()?);
        let samples = material.lattice_samples(PAPER_SAMPLES)?;
        let fitted = context.fit_and_compare(&truth, &samples, &FitOptions::default(), false)?;
        let tables = [&*truth, &fitted.mean];
        let title = format!("{name}, predicted from {} samples", samples.angles.len());
        let slice = slice_figure(&title, Some(&*truth), &fitted.mean, &SliceOptions::default())?;
        outcome.figure(context, &format!("figure4-slice-{name}"), &slice)?;
        let lights = [
            ("environment", render_env(&tables, &context.environment, size)),
            ("point", render_point(&tables, size)),
        ];
        for (light, images) in lights {
            let [a, b] = &images[..] else { continue };
            let lit = match light {
                "point" => "under a point light",
                _ => "under an environment",
            };
            let picture = sphere_figure(&format!("{title}, {lit}"), Some(a), b, None)?;
            outcome.figure(context, &format!("figure5-{light}-{name}"), &picture)?;
            let found = PixelDifference::new(a, b)?;
            table.rows.push(vec![
                json!(name),
                json!(material.origin),
                json!(light),
                number(found.mean),
                number(found.median),
                number(found.percentile_99),
                number(found.max),
                number(found.share_below_5_percent),
            ]);
            if light == "point" {
                let values = differences(a, b);
                let last = values.len().saturating_sub(1);
                let points = (0..=STEPS).filter_map(|i| {
                    let share = i as f64 / STEPS as f64;
                    values.get(i * last / STEPS).map(|&x| (x.max(1e-7), share))
                });
                distributions.push(Curve {
                    name: name.to_owned(),
                    points: points.collect(),
                    ..Curve::default()
                });
            }
        }
    }
    table.note(
        "The paper finds the difference below 5 % under its point light, on pictures of its own scene. \
         Figures 3 and 5 are spheres here; figure 4 shows slices at phi_d = 90 degrees.",
    );
    let x = Axis::logarithmic("|1 − b / a|, point light");
    let y = Axis::linear("share of pixels below");
    outcome.plot(
        context,
        "figure5-difference",
        "Figure 5 (e): distribution of the pixel difference",
        x,
        y,
        distributions,
    )?;
    outcome.tables.push(table);
    Ok(outcome)
}
