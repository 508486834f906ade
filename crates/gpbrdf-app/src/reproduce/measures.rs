//! Columns of tables that compare a prediction with its truth.

use gpbrdf_core::Metrics;
use serde_json::Value;

use super::table::number;

/// The name of a column and its value, if there is one.
pub(super) type Measure = (&'static str, fn(&Metrics) -> Option<f64>);

pub(super) const MAE: Measure = ("MAE", |m| Some(m.cells.mae));
pub(super) const MSE: Measure = ("MSE", |m| Some(m.cells.mse));
pub(super) const PAPER_PSNR: Measure = ("paper's PSNR", |m| Some(m.cells.psnr_paper_table2));
pub(super) const PSNR_ENV: Measure = ("PSNR env", |m| Some(m.images.psnr_env));
pub(super) const PSNR_POINT: Measure = ("PSNR point", |m| Some(m.images.psnr_point));
pub(super) const SSIM_ENV: Measure = ("SSIM env", |m| Some(m.images.ssim_env));
pub(super) const MEDIAN_LN: Measure = ("median ln", |m| Some(m.cells.median_abs_log));
pub(super) const RMS_LN: Measure = ("rms ln", |m| Some(m.cells.log_rmse));
pub(super) const LN_COS: Measure = ("ln(1 + f cos)", |m| Some(m.cells.log1p_cos_l1));
pub(super) const COVERAGE: Measure = ("coverage 95 %", |m| m.cells.coverage_95);

/// The names of columns: those before the measures, the measures themselves, and those after them.
pub(super) fn columns(
    before: &[&'static str],
    measures: &[Measure],
    after: &[&'static str],
) -> Vec<&'static str> {
    let names = measures.iter().map(|(name, _)| *name);
    before.iter().copied().chain(names).chain(after.iter().copied()).collect()
}

/// The cells of a row under `measures`.
pub(super) fn cells(measures: &[Measure], metrics: &Metrics) -> impl Iterator<Item = Value> {
    measures.iter().map(|(_, of)| of(metrics).map_or(Value::Null, number))
}
