//! Comparison of predictions with measurements at the same directions, in numbers that can be quoted.

use serde::{Deserialize, Serialize};

use crate::base::error::{Error, Result};
use crate::brdf::Rgb;
use crate::judge::metrics::median;
use crate::model::Prediction;
use crate::sample::log_value;

/// Comparison of predictions with measured values, one by one and unweighted. The logarithmic metrics take
/// negative values as 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampleMetrics {
    /// Number of measurements.
    pub samples: usize,
    /// Mean of `|f^ - f|` over measurements and channels, sr^-1.
    pub mae: f64,
    /// Mean of `(f^ - f)^2` over measurements and channels, sr^-2.
    pub mse: f64,
    /// Root of the mean over measurements and channels of `(ln(f^ + 1e-3) - ln(f + 1e-3))^2`.
    pub log_rmse: f64,
    /// Median over measurements and channels of `|ln(f^ + 1e-3) - ln(f + 1e-3)|`.
    pub median_abs_log: f64,
    /// Share of measurements and channels that are within the predicted 95 % interval.
    pub coverage_95: f64,
}

impl SampleMetrics {
    /// Compares `values`, sr^-1, with the predictions at the same directions.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if there are no values, or not as many predictions as values.
    pub fn new(values: &[Rgb], predictions: &[Prediction]) -> Result<Self> {
        if values.is_empty() || values.len() != predictions.len() {
            let found = format!("{} and {}", values.len(), predictions.len());
            return Err(Error::argument("values and predictions", "as many of both, at least one", found));
        }
        let (mut absolute, mut square, mut log_square, mut covered) = (0.0, 0.0, 0.0, 0usize);
        let mut logs = Vec::with_capacity(3 * values.len());
        for (value, prediction) in values.iter().zip(predictions) {
            for c in 0..3 {
                let (f, g) = (value[c], prediction.mean[c]);
                absolute += (g - f).abs();
                square += (g - f).powi(2);
                covered += usize::from(prediction.lower[c] <= f && f <= prediction.upper[c]);
                let log = log_value(g) - log_value(f);
                log_square += log * log;
                #[expect(clippy::cast_possible_truncation, reason = "as in the metrics of tables")]
                logs.push(log.abs() as f32);
            }
        }
        let n = logs.len() as f64;
        Ok(Self {
            samples: values.len(),
            mae: absolute / n,
            mse: square / n,
            log_rmse: (log_square / n).sqrt(),
            median_abs_log: median(&mut logs),
            coverage_95: covered as f64 / n,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_measurements_are_compared_by_hand() {
        let about =
            |mean: f64| Prediction { mean: [mean; 3], lower: [mean - 0.1; 3], upper: [mean + 0.1; 3] };
        let found = SampleMetrics::new(&[[1.0; 3], [2.0; 3]], &[about(1.05), about(1.5)]).unwrap();
        assert_eq!((found.samples, found.coverage_95), (2, 0.5));
        assert!((found.mae - 0.275).abs() < 1e-12 && (found.mse - 0.126_25).abs() < 1e-12);
        let logs = [(1.051f64 / 1.001).ln(), (2.001f64 / 1.501).ln()];
        assert!((found.median_abs_log - 0.5 * (logs[0] + logs[1])).abs() < 1e-6);
        let rmse = (0.5 * (logs[0].powi(2) + logs[1].powi(2))).sqrt();
        assert!((found.log_rmse - rmse).abs() < 1e-12);
        assert!(SampleMetrics::new(&[], &[]).is_err());
        assert!(SampleMetrics::new(&[[1.0; 3]], &[]).is_err());
    }
}
