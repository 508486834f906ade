//! The smooth functions of which a prior is made.

use std::f64::consts::FRAC_PI_2;

use rayon::prelude::*;

use crate::base::error::{Error, Result};
use crate::base::linalg::{product_into_slice, view_slice};
use crate::base::random::quasi_random;
use crate::brdf::angles::{BoxPoint, HalfDiff};
use crate::kernel::{Kernel, Points, RowScratch, Shape};
use crate::sample::InputSpace;

/// The space of the kernel.
pub(crate) const SPACE: InputSpace = InputSpace::PolarAngles;

/// The kernel's length scales: somewhat shorter than those that reflectances usually have.
const LENGTHS: [f64; 3] = [0.15, 0.8, 1.2];

/// The centres reach this far to the horizon, where reflectances are not known.
const LAST_V: f64 = 0.985;

/// Number of directions of a parallel task.
const BLOCK: usize = 64;

/// The fewest and the most centres.
const CENTRES: std::ops::RangeInclusive<usize> = 10..=20_000;

/// All functions `c_0 + sum_j c_j k(x, x_j)` with a Matern 5/2 kernel `k` of [`InputSpace::PolarAngles`] and centres
/// `x_j` that are spread evenly over the warped box. They are smooth, isotropic, reciprocal and bilateral.
#[derive(Clone, Debug)]
pub(crate) struct Span {
    centres: Vec<HalfDiff>,
    /// Coordinates of the centres, `n` rows.
    inputs: Vec<f64>,
    points: Points,
    kernel: Kernel,
}

impl Span {
    /// The functions of `count` centres, the points of an additive recurrence in the warped box.
    ///
    /// # Errors
    /// Fewer than 10 centres, or more than 20,000.
    pub(crate) fn new(count: usize) -> Result<Self> {
        if !CENTRES.contains(&count) {
            return Err(Error::argument("centres of a prior", "10 to 20000", count));
        }
        let centre = |i: usize| {
            let [u, v, phi] = quasi_random(i);
            BoxPoint { u, v: LAST_V * v, phi: FRAC_PI_2 * phi }.to_half_diff()
        };
        let centres: Vec<HalfDiff> = (0..count).map(centre).collect();
        let inputs = SPACE.points(&centres);
        let kernel = Kernel::ard(1.0, Shape::Matern52, &LENGTHS);
        let points = Points::new(&inputs, &kernel.metric);
        Ok(Self { centres, inputs, points, kernel })
    }

    pub(crate) fn len(&self) -> usize {
        self.centres.len()
    }

    #[cfg(feature = "fit")]
    pub(crate) fn centres(&self) -> &[HalfDiff] {
        &self.centres
    }

    /// Coordinates of the centres, `n` rows.
    pub(crate) fn inputs(&self) -> &[f64] {
        &self.inputs
    }

    pub(crate) fn kernel(&self) -> &Kernel {
        &self.kernel
    }

    /// Values of several functions without their constants: rows with one value per function. `coefficients` has one
    /// column of `n` per function. Cost: `n` kernel values and `n` multiply-adds per function for each direction.
    pub(crate) fn values(&self, coefficients: &[f64], angles: &[HalfDiff]) -> Vec<f64> {
        self.values_at(coefficients, &SPACE.points(angles))
    }

    /// [`Span::values`] at points of [`SPACE`], rows of coordinates.
    pub(crate) fn values_at(&self, coefficients: &[f64], points: &[f64]) -> Vec<f64> {
        let at = Points::new(points, &self.kernel.metric);
        let n = self.len();
        let count = coefficients.len() / n;
        let mut out = vec![0.0; at.len() * count];
        if count == 0 {
            return out;
        }
        let columns = view_slice(coefficients, n, count);
        out.par_chunks_mut(BLOCK * count).enumerate().for_each_init(
            || (RowScratch::new(self.kernel.dimension()), vec![0.0; BLOCK * n]),
            |(scratch, rows), (block, out)| {
                let rows = &mut rows[..out.len() / count * n];
                for (row, j) in rows.chunks_mut(n).zip(block * BLOCK..) {
                    self.kernel.row(&self.points, 0..n, &at, j, scratch, row);
                }
                let rows = view_slice(rows, n, out.len() / count);
                product_into_slice(out, columns.transpose(), rows);
            },
        );
        out
    }
}

/// Spans of the same number of centres are alike.
impl PartialEq for Span {
    fn eq(&self, other: &Self) -> bool {
        self.len() == other.len()
    }
}
