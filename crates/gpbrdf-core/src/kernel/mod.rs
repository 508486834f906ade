//! Covariance functions and their derivatives.

mod bessel;
mod shape;

pub use shape::Shape;
