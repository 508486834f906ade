//! Product lattices of directions to measure.

use serde::{Deserialize, Serialize};

use crate::base::error::{Error, Result};
use crate::brdf::angles::{BoxPoint, HalfDiff};
use crate::brdf::table::N_THETA_H;
use crate::sample::space::WarpedBox;
use crate::sample::symmetry::Symmetry;

/// The exponent of nodes along a folded `phi` on large lattices. Results with other exponents are in
/// `docs/results.md`.
pub(crate) const PHI_DENSITY: f64 = 1.5;

/// A product lattice in the warped box, with `A x B x C` nodes along `u`, `v` and `phi`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LatticeLayout {
    /// Number of nodes along `u`, `v` and `phi`.
    pub shape: [usize; 3],
    /// Exponent of the warp along `u`: kernels measure distance in `u^(1/node_density)`.
    pub node_density: f64,
    /// Exponent `p > 1` of the nodes along `u`: `u = s t + (1 - s) t^p` with `t` evenly spaced and
    /// `s = A / 90`, at most 1. Next to the specular peak the nodes are then at the centres of the table's
    /// cells and no denser; they spread out from there. 0 means `u = t^node_density`, nodes that are evenly
    /// spaced in the warp.
    pub node_spread: f64,
    /// Exponent of the nodes along `v`: `v = v_max t^v_density`. Below 1 the nodes crowd towards the horizon.
    pub v_density: f64,
    /// The largest `v`; 1 is the horizon, where nothing can be measured.
    pub v_max: f64,
    /// Symmetry in `phi_d`.
    pub symmetry: Symmetry,
    /// Exponent of the nodes along a folded `phi`: `phi = pi/2 (1 - (1 - t)^phi_density)`. Above 1 the nodes
    /// crowd towards `phi_d = pi/2`.
    #[serde(default = "even")]
    pub phi_density: f64,
}

/// The `phi_density` of files that do not have one: evenly spaced nodes.
fn even() -> f64 {
    1.0
}

impl Default for LatticeLayout {
    /// A lattice of 64 x 32 x 18 nodes: 36,864 samples, 2.5 % of the table.
    fn default() -> Self {
        Self {
            shape: [64, 32, 18],
            node_density: 1.3,
            node_spread: 3.0,
            v_density: v_density(32),
            v_max: v_max(32),
            symmetry: Symmetry::Bilateral,
            phi_density: PHI_DENSITY,
        }
    }
}

/// The exponent of `b` nodes along `v`: the more nodes there are, the more they crowd towards the horizon.
fn v_density(b: usize) -> f64 {
    0.6 + 0.3 / b as f64
}

/// The position of the last of `b` nodes along `v`. Beyond it a fit extrapolates, and `f` grows towards the
/// horizon. Many nodes therefore reach closer to 1; few nodes are better used at smaller `v`.
fn v_max(b: usize) -> f64 {
    1.0 - (0.18 / b as f64).clamp(0.01, 0.09)
}

/// The number of nodes along `phi` grows like the number of samples to this power; those along `u` and `v`
/// grow more slowly, each like the number of samples to the power of `(1 - 0.38) / 2 = 0.31`.
const PHI_POWER: f64 = 0.38;

impl LatticeLayout {
    /// Number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Whether the lattice has no node.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A lattice of this shape. The fewer nodes there are, the more evenly they are spaced:
    /// `node_spread = 1 + A / 32`, at most 3; `v_density = 0.6 + 0.3 / B`; `v_max = 1 - 0.18 / B`, between
    /// 0.91 and 0.99; `phi_density = 1 + C / 16`, at most 1.5.
    #[must_use]
    pub fn with_shape(shape: [usize; 3], symmetry: Symmetry) -> Self {
        let node_spread = (1.0 + shape[0] as f64 / 32.0).min(3.0);
        let phi_density = (1.0 + shape[2] as f64 / 16.0).min(PHI_DENSITY);
        let (v_density, v_max) = (v_density(shape[1]), v_max(shape[1]));
        Self { shape, node_spread, v_density, v_max, phi_density, symmetry, ..Self::default() }
    }

    /// A lattice with about `samples` nodes. Its sides along `u` and `v` have the proportions of the default
    /// lattice; with fewer samples, the number of nodes along `phi` decreases most.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for fewer than 12 samples.
    pub fn with_samples(samples: usize, symmetry: Symmetry) -> Result<Self> {
        if samples < 12 {
            return Err(Error::argument("number of samples", "at least 12", samples));
        }
        let reference = Self::default().shape.map(|n| n as f64);
        // The whole circle is twice as long as the folded interval.
        let stretch = if symmetry == Symmetry::Reciprocal { 2.0 } else { 1.0 };
        let reference = [reference[0], reference[1], reference[2] * stretch];
        let scale = samples as f64 / reference.iter().product::<f64>();
        let along_phi = (reference[2] * scale.powf(PHI_POWER)).max(2.0);
        // The remaining factor is shared by u and v in the default's proportions.
        let side = (samples as f64 / along_phi / (reference[0] * reference[1])).sqrt();
        let ideal = [reference[0] * side, reference[1] * side, along_phi];
        // Of all ways to round the three sides, the one whose product is nearest to the request is chosen.
        let mut best = ([2, 2, 2], f64::INFINITY);
        for corner in 0..8 {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "sides are positive")]
            let shape: [usize; 3] =
                std::array::from_fn(|k| (ideal[k].floor() as usize + (corner >> k & 1)).max(2));
            let count = shape.iter().product::<usize>() as f64;
            let miss = (count / samples as f64).ln().abs();
            if miss < best.1 {
                best = (shape, miss);
            }
        }
        Ok(Self::with_shape(best.0, symmetry))
    }

    /// Checks every field.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for a side of fewer than 2 or more than 512 nodes, or a density or `v_max`
    /// outside its range.
    pub fn validate(&self) -> Result<()> {
        if self.shape.iter().any(|n| !(2..=512).contains(n)) {
            let [a, b, c] = self.shape;
            return Err(Error::argument(
                "lattice shape",
                "2 to 512 nodes along each axis",
                format!("{a}x{b}x{c}"),
            ));
        }
        if !(self.node_density >= 0.25 && self.node_density <= 4.0) {
            return Err(Error::argument("node density", "0.25 to 4", self.node_density));
        }
        if !(self.node_spread == 0.0 || (self.node_spread >= 1.0 && self.node_spread <= 8.0)) {
            return Err(Error::argument("node spread", "0, or 1 to 8", self.node_spread));
        }
        if !(self.v_density >= 0.25 && self.v_density <= 4.0) {
            return Err(Error::argument("node density along v", "0.25 to 4", self.v_density));
        }
        if !(self.phi_density >= 0.25 && self.phi_density <= 4.0) {
            return Err(Error::argument("node density along phi", "0.25 to 4", self.phi_density));
        }
        if !(self.v_max > 0.1 && self.v_max <= 1.0) {
            return Err(Error::argument("v_max", "0.1 to 1", self.v_max));
        }
        Ok(())
    }

    /// The input space of a process on this lattice.
    #[must_use]
    pub fn space(&self) -> WarpedBox {
        WarpedBox {
            density: self.node_density,
            v_density: self.v_density,
            symmetry: self.symmetry,
            tail: 1.0,
            phi_density: self.phi_density,
        }
    }

    /// The nodes along `u`, `v` and `phi`, in increasing order.
    #[must_use]
    pub fn nodes(&self) -> [Vec<f64>; 3] {
        let [a, b, c] = self.shape.map(|n| n as f64);
        let spread = |t: f64| {
            let s = (a / N_THETA_H as f64).min(1.0);
            s * t + (1.0 - s) * t.powf(self.node_spread)
        };
        let place = |t: f64| if self.node_spread > 0.0 { spread(t) } else { t.powf(self.node_density) };
        let u = (0..self.shape[0]).map(|i| place((i as f64 + 0.5) / a)).collect();
        let v =
            (0..self.shape[1]).map(|i| (i as f64 / (b - 1.0)).powf(self.v_density) * self.v_max).collect();
        // Nodes along phi begin and end half a step off the ends of a folded phi, where the mirrored kernel
        // already knows that slopes vanish.
        let period = self.symmetry.phi_extent();
        let phi_density = if self.symmetry == Symmetry::Bilateral { self.phi_density } else { 1.0 };
        let place = |t: f64| period * (1.0 - (1.0 - t).powf(phi_density));
        let phi = (0..self.shape[2]).map(|i| place((i as f64 + 0.5) / c)).collect();
        [u, v, phi]
    }

    /// The directions of the nodes. `phi` varies fastest, then `v`, then `u`.
    #[must_use]
    pub fn directions(&self) -> Vec<HalfDiff> {
        let [u, v, phi] = self.nodes();
        let mut directions = Vec::with_capacity(self.len());
        for &u in &u {
            for &v in &v {
                directions.extend(phi.iter().map(|&phi| BoxPoint { u, v, phi }.to_half_diff()));
            }
        }
        directions
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lattice_directions_stand_at_the_nodes_above_the_horizon() {
        for symmetry in [Symmetry::Bilateral, Symmetry::Reciprocal] {
            let layout = LatticeLayout { shape: [5, 4, 3], symmetry, ..LatticeLayout::default() };
            let [u, v, phi] = layout.nodes();
            let directions = layout.directions();
            assert_eq!(directions.len(), 60);
            for (index, angles) in directions.iter().enumerate() {
                let point = BoxPoint::from_half_diff(*angles);
                assert!((point.u - u[index / 12]).abs() < 1e-12);
                assert!((point.v - v[index / 3 % 4]).abs() < 1e-9);
                assert!((point.phi - phi[index % 3]).abs() < 1e-15);
                assert!(angles.is_above_horizon(), "{angles:?}");
            }
        }
    }

    #[test]
    fn a_sample_count_gives_a_lattice_near_it() {
        assert_eq!(
            LatticeLayout::with_samples(36_864, Symmetry::Bilateral).unwrap(),
            LatticeLayout::default()
        );
        for samples in [12, 64, 225, 3072, 37_616, 200_000] {
            for symmetry in [Symmetry::Bilateral, Symmetry::Reciprocal] {
                let layout = LatticeLayout::with_samples(samples, symmetry).unwrap();
                layout.validate().unwrap();
                let ratio = layout.len() as f64 / samples as f64;
                assert!((0.75..1.35).contains(&ratio), "{samples} {layout:?}");
            }
        }
        assert!(LatticeLayout::with_samples(11, Symmetry::Bilateral).is_err());
    }

    #[test]
    fn broken_layouts_are_refused() {
        let good = LatticeLayout::default();
        assert!(LatticeLayout { shape: [1, 4, 4], ..good.clone() }.validate().is_err());
        assert!(LatticeLayout { node_density: f64::NAN, ..good.clone() }.validate().is_err());
        assert!(LatticeLayout { v_density: 0.0, ..good.clone() }.validate().is_err());
        assert!(LatticeLayout { v_max: 1.5, ..good }.validate().is_err());
    }
}
