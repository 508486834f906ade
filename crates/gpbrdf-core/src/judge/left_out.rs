//! How good a fit is without a truth: every sample as it is predicted from all others.

use serde::{Deserialize, Serialize};

use crate::base::error::Result;
use crate::brdf::Rgb;
use crate::judge::SampleMetrics;
use crate::model::{Fit, Prediction, interval_about};
use crate::sample::SampleSet;

/// The comparison of the samples of a fit with their predictions from all other samples (leave-one-out
/// cross-validation), and the samples that are suspected to be outliers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// The comparison. Suspected outliers are part of it.
    pub metrics: SampleMetrics,
    /// Suspected outliers, in the order of the samples.
    pub outliers: Vec<Outlier>,
}

/// A sample that contradicts all samples around it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outlier {
    /// Its index among the samples, from 0.
    pub sample: usize,
    /// The line of the file that holds it, from 1, if there is a file.
    pub line: Option<u64>,
    /// Its value, sr^-1.
    pub value: Rgb,
    /// Both ends of the 95 % interval that all other samples predict, sr^-1.
    pub expected: [Rgb; 2],
}

impl Outlier {
    /// Where it is, for people: `line 17`, or `sample 17` counted from 1 where there is no file.
    #[must_use]
    pub fn place(&self) -> String {
        match self.line {
            Some(line) => format!("line {line}"),
            None => format!("sample {}", self.sample + 1),
        }
    }
}

impl LeftOut {
    /// What a fit to `samples` says about them; `None` where its solver leaves no sample out.
    ///
    /// # Errors
    /// Samples that the fit was not made from.
    pub fn new(samples: &SampleSet, fit: &Fit) -> Result<Option<Self>> {
        let n = samples.len();
        let (transform, mut first) = (fit.model.transform, 0);
        let unknown = Prediction { mean: [0.0; 3], lower: [0.0; 3], upper: [0.0; 3] };
        let mut predictions = vec![unknown; n];
        let mut suspected = vec![false; n];
        for report in &fit.reports {
            let Some(left_out) = &report.leave_one_out else { return Ok(None) };
            let channels = left_out.residuals.len() / left_out.variances.len().max(1);
            let rows = left_out.residuals.chunks(channels.max(1)).zip(&left_out.variances);
            for ((prediction, value), (residuals, variance)) in
                predictions.iter_mut().zip(&samples.values).zip(rows)
            {
                for (channel, residual) in (first..3).zip(residuals) {
                    let target = transform.forward(value[channel]) - residual;
                    prediction.mean[channel] = transform.inverse(target);
                    (prediction.lower[channel], prediction.upper[channel]) =
                        interval_about(transform, target, variance.sqrt());
                }
            }
            suspected.iter_mut().zip(&report.weights).for_each(|(s, weight)| *s |= *weight < 1.0);
            first += channels;
        }
        // A value below zero is a dark one, as in the targets.
        let values: Vec<Rgb> = samples.values.iter().map(|v| v.map(|v| v.max(0.0))).collect();
        let metrics = SampleMetrics::new(&values, &predictions)?;
        let outliers = (0..n).filter(|&i| suspected[i]).map(|i| Outlier {
            sample: i,
            line: samples.lines.get(i).copied(),
            value: samples.values[i],
            expected: [predictions[i].lower, predictions[i].upper],
        });
        Ok(Some(Self { metrics, outliers: outliers.collect() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::material;
    use crate::sample::Layout;
    use crate::{FitOptions, fit};

    #[test]
    fn an_outlier_is_named_with_its_line_and_what_was_expected() {
        let layout = Layout::Random { count: 300, seed: 4 };
        let mut samples = SampleSet::measure(material("red-plastic").unwrap(), &layout).unwrap();
        samples.lines = (0..300).map(|i| i + 2).collect();
        let truth = samples.values[120];
        samples.values[120] = truth.map(|v| 12.0 * v);
        for per_channel in [false, true] {
            let options = FitOptions { per_channel, ..FitOptions::default() };
            let left_out = LeftOut::new(&samples, &fit(&samples, &options).unwrap()).unwrap().unwrap();
            let [outlier] = left_out.outliers[..] else { panic!("{:?}", left_out.outliers) };
            assert_eq!((outlier.sample, outlier.line, outlier.value), (120, Some(122), samples.values[120]));
            let [lower, upper] = outlier.expected;
            for c in 0..3 {
                assert!(lower[c] <= truth[c] * 1.05 && truth[c] * 0.95 <= upper[c], "{outlier:?} {truth:?}");
                assert!(upper[c] < outlier.value[c]);
            }
            let m = left_out.metrics;
            assert!(m.samples == 300 && m.median_abs_log < 0.1 && m.coverage_95 > 0.85, "{m:?}");
        }
    }
}
