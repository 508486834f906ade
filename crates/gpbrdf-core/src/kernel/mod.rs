//! Covariance functions and their derivatives.

mod axis;
mod bessel;
mod composite;
mod grid;
mod pairs;
#[cfg(feature = "fit")]
mod row_gradient;
mod rows;
mod shape;
mod slices;
#[cfg(feature = "fit")]
mod slopes;

pub use axis::{Kernel1d, ParameterKind, Term1d};
pub use composite::{AxisMetric, Kernel, KernelBody, KernelTerm};
pub(crate) use grid::GridScratch;
pub(crate) use pairs::Pairs;
#[cfg(feature = "fit")]
pub(crate) use row_gradient::GradientScratch;
pub(crate) use rows::{Points, RowScratch};
pub use shape::Shape;

#[cfg(test)]
pub(crate) use composite::tests::kernels as test_kernels;
