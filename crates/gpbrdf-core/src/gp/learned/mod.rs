//! The Gaussian process of scattered samples with a prior that was learned from other materials.
//!
//! The logarithms of the three channels are rotated into one achromatic and two chromatic colours. Each kind of colour
//! is a process of `scattered/` whose covariance has the principal functions of the prior as its basis:
//! `k(x, x') + v B(x)^T B(x')`. Kernels, `v` and noise of both kinds are found separately.

pub(crate) mod posterior;
#[cfg(feature = "fit")]
pub(crate) mod solve;
#[cfg(all(test, feature = "fit"))]
mod tests;
