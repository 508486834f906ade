//! Covariance functions and their derivatives.

mod shape;

pub use shape::Shape;
