//! Leave-one-out prediction: every sample of a dense process is predicted from all others.

use std::f64::consts::TAU;

use super::DenseGp;
use super::inverse::left_out_variances;
use crate::base::error::Result;

/// The predictions of every sample from all others.
#[derive(Clone, Debug, PartialEq)]
pub struct LeaveOneOut {
    /// `y_i - mu_i`: the target minus the mean that is predicted from all other samples; `n` rows with one
    /// value per channel.
    pub residuals: Vec<f64>,
    /// Variance of that prediction, noise included; one value per sample, shared by the channels.
    pub variances: Vec<f64>,
    /// `sum_i ln p(y_i | all others)` in nats, over samples and channels.
    pub log_predictive_density: f64,
}

impl DenseGp {
    /// Predicts every sample from all others at the same hyper-parameters, without conditioning the process
    /// anew.
    ///
    /// `sigma_i^2 = 1 / [K^-1]_ii`, `mu_i = y_i - alpha_i sigma_i^2`. Source: C. E. Rasmussen and C. K. I.
    /// Williams, "Gaussian Processes for Machine Learning" (2006), eqs. 5.10 to 5.12. Cost: `n^3 / 6`
    /// multiply-adds.
    ///
    /// # Errors
    /// A process that was loaded from a file and whose covariance cannot be factorised or does not fit in
    /// memory.
    pub fn leave_one_out(&self) -> Result<LeaveOneOut> {
        let n = self.points.len();
        let factor = self.factor()?;
        let variances = left_out_variances(factor, n);
        let mut residuals = vec![0.0; n * self.channels];
        let mut log_predictive_density = 0.0;
        for (c, alpha) in self.alpha.chunks(n).enumerate() {
            for (i, (alpha, variance)) in alpha.iter().zip(&variances).enumerate() {
                let residual = alpha * variance;
                residuals[i * self.channels + c] = residual;
                log_predictive_density -= 0.5 * ((TAU * variance).ln() + residual * residual / variance);
            }
        }
        Ok(LeaveOneOut { residuals, variances, log_predictive_density })
    }
}
