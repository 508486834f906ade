//! Covariance functions and their derivatives.

mod axis;
mod bessel;
mod shape;

pub use axis::{AxisMetric, Kernel1d, ParameterInfo, ParameterKind, Term1d};
pub use shape::Shape;
