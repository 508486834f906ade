//! Comparison of a table with the truth, in numbers that can be quoted.

use std::array::from_fn;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::base::error::{Error, Result};
use crate::brdf::angles::GRAZING_COSINE;
use crate::brdf::table::{BrdfTable, N_PHI_D, N_THETA_D, N_THETA_H, cell_center, cell_index, cell_indices};
use crate::judge::environment::Environment;
use crate::judge::image_metrics::{ImageMetrics, decibel};
use crate::judge::sphere::{SPHERE_SIZE, render_env, render_point};
use crate::sample::LOG_EPSILON;

/// The 95 % interval of the cell with this index: its lower and upper end in each channel, sr^-1.
pub type Interval<'a> = dyn Fn(usize) -> ([f64; 3], [f64; 3]) + Sync + 'a;

/// All metrics of a prediction against a truth. In JSON they are one flat object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// Comparison cell by cell.
    #[serde(flatten)]
    pub cells: CellMetrics,
    /// Comparison of pictures.
    #[serde(flatten)]
    pub images: ImageMetrics,
}

impl Metrics {
    /// Compares two tables: cell by cell, in sphere pictures under `environment` and under the point light,
    /// and by the coverage of `interval`, if it is given.
    ///
    /// Parallel; the result does not depend on the number of threads.
    ///
    /// # Errors
    /// The errors of [`CellMetrics::new`].
    pub fn new(
        truth: &BrdfTable,
        prediction: &BrdfTable,
        environment: &Environment,
        interval: Option<&Interval<'_>>,
    ) -> Result<Self> {
        let cells = CellMetrics::new(truth, prediction, interval)?;
        let tables = [truth, prediction];
        let env = render_env(&tables, environment, SPHERE_SIZE);
        let point = render_point(&tables, SPHERE_SIZE);
        let images = ImageMetrics::new((&env[0], &env[1]), (&point[0], &point[1]))?;
        Ok(Self { cells, images })
    }
}

/// Comparison of a prediction `f^` with a truth `f`, cell by cell, unweighted.
///
/// The valid cells are compared: those whose centre is above the horizon and where the truth has data. The
/// logarithmic metrics compare only valid cells in which both cosines exceed 0.08. A negative prediction is
/// taken as it is in `mae` and `mse`, and as 0 in the logarithmic metrics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellMetrics {
    /// Number of valid cells: 1,096,216 for a truth without gaps.
    pub valid_cells: usize,
    /// Mean of `|f^ - f|` over cells and channels, sr^-1. The paper, eq. 18.
    pub mae: f64,
    /// `mae` of each channel.
    pub mae_rgb: [f64; 3],
    /// Mean of `(f^ - f)^2` over cells and channels, sr^-2. The paper, eq. 19.
    pub mse: f64,
    /// `mse` of each channel.
    pub mse_rgb: [f64; 3],
    /// Root of the mean over cells and channels of `(ln(f^ + 1e-3) - ln(f + 1e-3))^2`.
    pub log_rmse: f64,
    /// `log_rmse` of each channel.
    pub log_rmse_rgb: [f64; 3],
    /// Median over cells and channels of `|ln(f^ + 1e-3) - ln(f + 1e-3)|`.
    pub median_abs_log: f64,
    /// `median_abs_log` of each channel.
    pub median_abs_log_rgb: [f64; 3],
    /// Mean over cells and channels of `|ln(1 + f cos theta_i) - ln(1 + f^ cos theta_i)|`.
    pub log1p_cos_l1: f64,
    /// `log1p_cos_l1` of each channel.
    pub log1p_cos_l1_rgb: [f64; 3],
    /// `10 log10(255^2 / mse)`, dB, the quantity in the PSNR column of the paper's table 2. It is a function
    /// of `mse` alone and cannot be compared with the PSNR of images. Infinite (`"inf"` in JSON) for equal
    /// tables.
    #[serde(with = "decibel")]
    pub psnr_paper_table2: f64,
    /// Share of valid cells and channels in which the truth is within the 95 % interval; `None` without
    /// intervals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coverage_95: Option<f64>,
    /// `coverage_95` of each channel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coverage_95_rgb: Option<[f64; 3]>,
}

/// Sums over the cells with the same `theta_h`.
#[derive(Default)]
struct Sums {
    valid: usize,
    absolute: [f64; 3],
    square: [f64; 3],
    log_square: [f64; 3],
    log1p: [f64; 3],
    covered: [usize; 3],
    logs: [Vec<f32>; 3],
    /// The first cell in which the prediction is not finite.
    broken: Option<usize>,
}

impl CellMetrics {
    /// Compares two tables, and the truth with `interval`, if it is given.
    ///
    /// Parallel over `theta_h` and summed in a fixed order: the result does not depend on the number of
    /// threads.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] when the truth has no valid cell, or the prediction is not finite in a
    /// valid cell.
    pub fn new(truth: &BrdfTable, prediction: &BrdfTable, interval: Option<&Interval<'_>>) -> Result<Self> {
        // Sine and cosine of each theta_d, and the cosine of each phi_d.
        let thetas: Vec<(f64, f64)> =
            (0..N_THETA_D).map(|d| cell_center(0, d, 0).theta_d.sin_cos()).collect();
        let phis: Vec<f64> = (0..N_PHI_D).map(|p| cell_center(0, 0, p).phi_d.cos()).collect();
        let rows: Vec<Sums> = (0..N_THETA_H)
            .into_par_iter()
            .map(|h| sum_row(h, &thetas, &phis, truth, prediction, interval))
            .collect();

        let mut all = Sums::default();
        for row in rows {
            all.add(row);
        }
        if let Some(cell) = all.broken {
            let (h, d, p) = cell_indices(cell);
            let found = format!("{:?} in cell ({h}, {d}, {p})", prediction.values()[cell]);
            return Err(Error::argument("prediction", "finite values in all valid cells", found));
        }
        if all.valid == 0 {
            return Err(Error::argument("truth", "data in at least one cell above the horizon", "none"));
        }
        Ok(all.finish(interval.is_some()))
    }
}

/// The sums over all cells of the `theta_h` cell `h`.
fn sum_row(
    h: usize,
    thetas: &[(f64, f64)],
    phis: &[f64],
    truth: &BrdfTable,
    prediction: &BrdfTable,
    interval: Option<&Interval<'_>>,
) -> Sums {
    let mut sums = Sums::default();
    let (sin_h, cos_h) = cell_center(h, 0, 0).theta_h.sin_cos();
    for (d, &(sin_d, cos_d)) in thetas.iter().enumerate() {
        for (p, cos_p) in phis.iter().enumerate() {
            // Equal to HalfDiff::cosines to the last bit.
            let skew = sin_h * sin_d * cos_p;
            let (cos_i, cos_o) = (cos_h * cos_d - skew, cos_h * cos_d + skew);
            let cell = cell_index(h, d, p);
            let f = truth.values()[cell].map(f64::from);
            if cos_i.min(cos_o) > 0.0 && f.iter().all(|&x| x >= 0.0) {
                sums.add_cell(cell, f, prediction.values()[cell].map(f64::from));
                if let Some(interval) = interval {
                    let (low, high) = interval(cell);
                    for c in 0..3 {
                        sums.covered[c] += usize::from(low[c] <= f[c] && f[c] <= high[c]);
                    }
                }
                if cos_i.min(cos_o) > GRAZING_COSINE {
                    sums.add_logs(cos_i, f, prediction.values()[cell].map(f64::from));
                }
            }
        }
    }
    sums
}

impl Sums {
    fn add_cell(&mut self, cell: usize, f: [f64; 3], g: [f64; 3]) {
        self.valid += 1;
        for c in 0..3 {
            let gap = g[c] - f[c];
            self.absolute[c] += gap.abs();
            self.square[c] += gap * gap;
        }
        if self.broken.is_none() && !g.iter().all(|x| x.is_finite()) {
            self.broken = Some(cell);
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of a table")]
    fn add_logs(&mut self, cos_i: f64, f: [f64; 3], g: [f64; 3]) {
        for c in 0..3 {
            let g = g[c].max(0.0);
            let log = ((g + LOG_EPSILON) / (f[c] + LOG_EPSILON)).ln();
            self.log_square[c] += log * log;
            self.logs[c].push(log.abs() as f32);
            self.log1p[c] += ((1.0 + g * cos_i) / (1.0 + f[c] * cos_i)).ln().abs();
        }
    }

    fn add(&mut self, other: Self) {
        self.valid += other.valid;
        self.broken = self.broken.or(other.broken);
        for (c, mut logs) in other.logs.into_iter().enumerate() {
            self.absolute[c] += other.absolute[c];
            self.square[c] += other.square[c];
            self.log_square[c] += other.log_square[c];
            self.log1p[c] += other.log1p[c];
            self.covered[c] += other.covered[c];
            self.logs[c].append(&mut logs);
        }
    }

    /// The metrics, if there is at least one valid cell.
    fn finish(self, has_interval: bool) -> CellMetrics {
        let valid = self.valid as f64;
        // All valid cells may be grazing. The logarithmic metrics then compare no cell, and are 0.
        let lit = self.logs[0].len().max(1) as f64;
        let mean = |x: [f64; 3]| (x[0] + x[1] + x[2]) / 3.0;
        let mae_rgb = self.absolute.map(|x| x / valid);
        let mse_rgb = self.square.map(|x| x / valid);
        let log_mse = self.log_square.map(|x| x / lit);
        let log1p_cos_l1_rgb = self.log1p.map(|x| x / lit);
        let coverage_95_rgb = has_interval.then(|| self.covered.map(|x| x as f64 / valid));
        let mut logs = self.logs;
        let mut pooled = logs.concat();
        let (median_abs_log, medians) = rayon::join(
            || median(&mut pooled),
            || logs.par_iter_mut().map(|x| median(x)).collect::<Vec<_>>(),
        );
        CellMetrics {
            valid_cells: self.valid,
            mae: mean(mae_rgb),
            mae_rgb,
            mse: mean(mse_rgb),
            mse_rgb,
            log_rmse: mean(log_mse).sqrt(),
            log_rmse_rgb: log_mse.map(f64::sqrt),
            median_abs_log,
            median_abs_log_rgb: from_fn(|c| medians[c]),
            log1p_cos_l1: mean(log1p_cos_l1_rgb),
            log1p_cos_l1_rgb,
            psnr_paper_table2: 10.0 * (255.0 * 255.0 / mean(mse_rgb)).log10(),
            coverage_95: coverage_95_rgb.map(mean),
            coverage_95_rgb,
        }
    }
}

/// The median; for an even number of values the mean of the middle two, for none 0. Reorders the values.
pub(super) fn median(values: &mut [f32]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    let even = values.len().is_multiple_of(2);
    let (below, &mut high, _) = values.select_nth_unstable_by(middle, f32::total_cmp);
    let low = if even { below.iter().copied().fold(0.0, f32::max) } else { high };
    0.5 * (f64::from(low) + f64::from(high))
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "noise for tables of f32")]
mod tests {
    use super::*;
    use crate::brdf::angles::HalfDiff;

    /// A value in `[0, 1)` that looks random.
    fn noise(i: usize, seed: u64) -> f64 {
        let mut x = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ seed;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Random values; with `gaps`, a tenth of the cells has no data.
    fn random_table(seed: u64, gaps: bool) -> BrdfTable {
        let values = (0..crate::brdf::table::N_CELLS).map(|i| {
            if gaps && noise(i, seed + 7) < 0.1 {
                return [0.5, 0.5, -1.0];
            }
            from_fn(|c| (noise(3 * i + c, seed) as f32).powi(2))
        });
        BrdfTable::from_values(values.collect()).unwrap()
    }

    #[test]
    fn cell_metrics_equal_a_naive_computation() {
        let truth = random_table(1, true);
        let mut values = random_table(2, false).values().to_vec();
        for value in values.iter_mut().step_by(11) {
            value[1] = -0.25;
        }
        let prediction = BrdfTable::from_values(values).unwrap();
        let interval = |cell: usize| {
            let low: [f64; 3] = from_fn(|c| f64::from(truth.values()[cell][c]) - noise(cell, 5) + 0.2);
            (low, low.map(|x| x + 0.9))
        };
        let found = CellMetrics::new(&truth, &prediction, Some(&interval)).unwrap();

        let (mut valid, mut abs, mut sq, mut l2, mut l1, mut inside) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let mut logs = Vec::new();
        let mut red = Vec::new();
        for cell in 0..crate::brdf::table::N_CELLS {
            let (h, d, p) = cell_indices(cell);
            let angles: HalfDiff = cell_center(h, d, p);
            let f = truth.values()[cell];
            if !angles.is_above_horizon() || f.iter().any(|&x| x < 0.0) {
                continue;
            }
            let (cos_i, cos_o) = angles.cosines();
            for c in 0..3 {
                let (f, g) = (f64::from(f[c]), f64::from(prediction.values()[cell][c]));
                valid += 1.0;
                abs += (g - f).abs();
                sq += (g - f).powi(2);
                inside += if noise(cell, 5) >= 0.2 && noise(cell, 5) <= 1.1 { 1.0 } else { 0.0 };
                if cos_i > 0.08 && cos_o > 0.08 {
                    let g = g.max(0.0);
                    let log = (g + 1e-3).ln() - (f + 1e-3).ln();
                    l2 += log * log;
                    l1 += ((f * cos_i).ln_1p() - (g * cos_i).ln_1p()).abs();
                    logs.push(log.abs());
                    if c == 0 {
                        red.push(log.abs());
                    }
                }
            }
        }
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        assert_eq!(found.valid_cells as f64, valid / 3.0);
        near(found.mae, abs / valid);
        near(found.mae_rgb.iter().sum::<f64>() / 3.0, abs / valid);
        near(found.mse, sq / valid);
        near(found.log_rmse, (l2 / logs.len() as f64).sqrt());
        near(found.log1p_cos_l1, l1 / logs.len() as f64);
        near(found.psnr_paper_table2, 20.0 * 255.0f64.log10() - 10.0 * (sq / valid).log10());
        assert!((found.coverage_95.unwrap() - inside / valid).abs() < 1e-4);
        let middle = |mut x: Vec<f64>| {
            x.sort_by(f64::total_cmp);
            0.5 * (x[(x.len() - 1) / 2] + x[x.len() / 2])
        };
        assert!((found.median_abs_log / middle(logs) - 1.0).abs() < 1e-6);
        assert!((found.median_abs_log_rgb[0] / middle(red) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_table_equals_itself_and_json_is_flat() {
        let table = BrdfTable::from_fn(|a| [0.3, 0.3 + a.theta_h.cos().powi(8), 0.0]);
        let metrics = Metrics::new(&table, &table, &Environment::studio(), None).unwrap();
        assert_eq!(metrics.cells.valid_cells, 1_096_216);
        assert_eq!(
            (metrics.cells.mae, metrics.cells.log_rmse, metrics.cells.median_abs_log),
            (0.0, 0.0, 0.0)
        );
        assert_eq!(metrics.images.psnr_env, f64::INFINITY);
        assert!((metrics.images.ssim_env - 1.0).abs() < 1e-12);
        let json = serde_json::to_value(&metrics).unwrap();
        assert_eq!(json["psnr_point"], "inf");
        assert_eq!(json["psnr_paper_table2"], "inf");
        assert_eq!(json["mae"], 0.0);
        assert_eq!(json["pixel_difference"]["max"], 0.0);
        assert!(json.get("coverage_95").is_none());
        assert_eq!(serde_json::from_value::<Metrics>(json).unwrap(), metrics);
    }

    #[test]
    fn one_and_two_threads_agree_to_the_bit() {
        let (truth, prediction) = (random_table(3, true), random_table(4, true));
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let interval = |cell: usize| ([0.0; 3], [noise(cell, 1); 3]);
            let metrics = pool
                .install(|| Metrics::new(&truth, &prediction, &Environment::studio(), Some(&interval)))
                .unwrap();
            serde_json::to_string(&metrics).unwrap()
        };
        assert_eq!(run(1), run(2));
    }

    #[test]
    fn empty_truths_and_broken_predictions_are_errors() {
        let good = random_table(5, false);
        let empty = BrdfTable::from_fn(|_| [-1.0; 3]);
        assert!(CellMetrics::new(&empty, &good, None).is_err());
        let mut values = good.values().to_vec();
        values[cell_index(3, 4, 5)][1] = f32::NAN;
        let broken = BrdfTable::from_values(values).unwrap();
        let message = CellMetrics::new(&good, &broken, None).unwrap_err().to_string();
        assert!(message.contains("(3, 4, 5)"), "{message}");
    }
}
