//! Measured samples at scattered directions.

use nalgebra::Vector3;

use crate::angles::HalfDiff;
use crate::brdf::Rgb;

/// One measured value of a BRDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Unit direction to the light, above the horizon, in the local frame (normal +z).
    pub wi: Vector3<f64>,
    /// Unit direction to the viewer, above the horizon.
    pub wo: Vector3<f64>,
    /// `f(wi, wo)` in sr^-1, cosine not included.
    pub value: Rgb,
}

impl Sample {
    /// The half-difference angles of the sample's directions.
    #[must_use]
    pub fn half_diff(&self) -> HalfDiff {
        HalfDiff::from_directions(&self.wi, &self.wo)
    }
}

/// The measurements of one material, in the order of their source.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// What the source says about itself; empty where it says nothing.
    pub description: String,
    /// The measurements.
    pub samples: Vec<Sample>,
}
