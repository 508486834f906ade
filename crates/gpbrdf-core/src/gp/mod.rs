//! Exact Gaussian-process regression.

mod cost;
mod dense;
mod factor;

pub use cost::{DenseCost, dense_cost};
pub use dense::{DenseEvaluator, DenseGp, DenseLikelihood, LeaveOneOut};
