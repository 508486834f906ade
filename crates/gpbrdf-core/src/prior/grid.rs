//! A grid of nodes in the warped box, and cubic interpolation between them.

use std::f64::consts::FRAC_PI_2;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::base::error::{Error, Result};
use crate::brdf::angles::{BoxPoint, HalfDiff, fold_phi_d};

/// The last node along `u` and `v`: reflectances are not known at the horizon itself. Beyond it functions are constant.
const LAST: f64 = 0.985;

/// The smallest and the largest number of nodes along an axis.
const NODES: std::ops::RangeInclusive<usize> = 4..=1000;

/// Evenly spaced nodes in `u` and `v`, from 0 to 0.985, and in a folded `phi`, from 0 to `pi/2`; `u`, `v` and `phi` as
/// in [`BoxPoint`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BoxGrid {
    /// The number of nodes along each axis. Values are stored with `phi` varying fastest.
    pub shape: [usize; 3],
}

impl BoxGrid {
    /// The number of nodes.
    #[must_use]
    pub fn len(self) -> usize {
        self.shape.iter().product()
    }

    /// Whether there are no nodes.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Checks the number of nodes.
    ///
    /// # Errors
    /// Fewer than 4 nodes along an axis, or more than 1,000.
    pub fn validate(self) -> Result<()> {
        match self.shape.iter().find(|n| !NODES.contains(n)) {
            None => Ok(()),
            Some(bad) => Err(Error::argument("nodes along an axis of a prior", "4 to 1000", bad)),
        }
    }

    /// Angles of node `(i, j, k)`.
    #[must_use]
    pub fn node(self, [i, j, k]: [usize; 3]) -> HalfDiff {
        let [nu, nv, nphi] = self.shape;
        let at = |index: usize, count: usize, last: f64| index as f64 / (count - 1) as f64 * last;
        let point = BoxPoint { u: at(i, nu, LAST), v: at(j, nv, LAST), phi: at(k, nphi, FRAC_PI_2) };
        point.to_half_diff()
    }

    /// The nodes that a function between them is made of, and their weights: along each axis the cubic convolution
    /// of R. G. Keys, "Cubic Convolution Interpolation for Digital Image Processing" (1981), continued as an even
    /// function at `u = 0`, `v = 0` and both ends of `phi`, and by a parabola at the last nodes of `u` and `v`.
    #[must_use]
    pub(crate) fn stencil(self, angles: HalfDiff) -> Stencil {
        let mut point = BoxPoint::from_half_diff(angles);
        point.phi = fold_phi_d(point.phi);
        let point = point.folded_bilateral();
        let [nu, nv, nphi] = self.shape;
        let axes = [
            axis(point.u / LAST, nu, End::Parabola),
            axis(point.v / LAST, nv, End::Parabola),
            axis(point.phi / FRAC_PI_2, nphi, End::Even),
        ];
        Stencil { axes, shape: self.shape }
    }

    /// The values of three functions with these values at the nodes. Not-a-number for angles that are not finite.
    /// Cost: 64 multiply-adds per value.
    pub(crate) fn values(self, nodes: &[Vec<f32>; 3], angles: &[HalfDiff]) -> Vec<[f64; 3]> {
        let value = |&at: &HalfDiff| {
            if !at.is_finite() {
                return [f64::NAN; 3];
            }
            let mut sums = [0.0; 3];
            self.stencil(at).for_each(|node, weight| {
                sums.iter_mut().zip(nodes).for_each(|(sum, nodes)| *sum += weight * f64::from(nodes[node]));
            });
            sums
        };
        angles.par_iter().map(value).collect()
    }

    /// The value of one function; see [`BoxGrid::values`].
    pub(crate) fn value(self, nodes: &[f32], at: HalfDiff) -> f64 {
        let mut sum = 0.0;
        self.stencil(at).for_each(|node, weight| sum += weight * f64::from(nodes[node]));
        if at.is_finite() { sum } else { f64::NAN }
    }
}

/// How a function goes on beyond its last node.
#[derive(Clone, Copy)]
enum End {
    Even,
    Parabola,
}

/// Four nodes and weights along each axis.
pub(crate) struct Stencil {
    axes: [[(usize, f64); 4]; 3],
    shape: [usize; 3],
}

impl Stencil {
    /// Calls `take` with every node and its weight.
    pub(crate) fn for_each(&self, mut take: impl FnMut(usize, f64)) {
        for &(i, a) in &self.axes[0] {
            for &(j, b) in &self.axes[1] {
                let row = (i * self.shape[1] + j) * self.shape[2];
                for &(k, c) in &self.axes[2] {
                    let weight = a * b * c;
                    if weight != 0.0 {
                        take(row + k, weight);
                    }
                }
            }
        }
    }
}

/// Nodes and weights at `x`, which runs from 0 at the first node to 1 at the last one.
fn axis(x: f64, count: usize, end: End) -> [(usize, f64); 4] {
    let x = if x.is_finite() { x.clamp(0.0, 1.0) * (count - 1) as f64 } else { 0.0 };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "x lies within [0, count - 1]"
    )]
    let low = (x as usize).min(count - 2);
    let t = x - low as f64;
    let (t2, t3) = (t * t, t * t * t);
    let w = [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ];
    let first = if low == 0 { 1 } else { low - 1 };
    if low + 2 < count {
        return [(first, w[0]), (low, w[1]), (low + 1, w[2]), (low + 2, w[3])];
    }
    match end {
        End::Even => [(first, w[0]), (low, w[1]), (low + 1, w[2]), (low, w[3])],
        // The parabola through the last three nodes has the value 3 c - 3 b + a one node further.
        End::Parabola => {
            [(first, w[0] + w[3]), (low, w[1] - 3.0 * w[3]), (low + 1, w[2] + 3.0 * w[3]), (low, 0.0)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_reproduces_nodes_and_even_cubics() {
        let grid = BoxGrid { shape: [9, 7, 5] };
        let of = |angles: HalfDiff| {
            let p = BoxPoint::from_half_diff(angles);
            let even = (2.0 * p.phi).cos();
            1.0 + p.u * p.u - 0.3 * p.v * p.v + 0.1 * even * p.u * p.u * p.v * p.v
        };
        let mut nodes = Vec::new();
        for i in 0..9 {
            for j in 0..7 {
                nodes.extend((0..5).map(|k| of(grid.node([i, j, k]))));
            }
        }
        let nodes: Vec<f32> = nodes.into_iter().map(crate::gp::table::to_f32).collect();
        for i in 0..200u32 {
            let x = f64::from(i);
            let [a, b, c] = [0.618_034, 0.754_878, 0.569_840].map(|step| (step * x).fract());
            let angles = BoxPoint { u: 0.98 * a, v: 0.98 * b, phi: c * std::f64::consts::PI }.to_half_diff();
            let found = grid.value(&nodes, angles);
            assert!((found - of(angles)).abs() < 3e-3, "{angles:?} {found} {}", of(angles));
        }
        let at = grid.node([3, 2, 1]);
        assert!((grid.value(&nodes, at) - of(at)).abs() < 1e-6);
        assert!(grid.value(&nodes, HalfDiff { theta_h: f64::NAN, ..at }).is_nan());
        assert!(BoxGrid { shape: [3, 7, 5] }.validate().is_err());
    }
}
