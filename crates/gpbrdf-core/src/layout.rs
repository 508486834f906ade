//! Where to sample a BRDF.

use std::f64::consts::{FRAC_PI_2, PI};

use serde::{Deserialize, Serialize};

use crate::angles::{BoxPoint, HalfDiff};
use crate::error::{Error, Result};
use crate::gp::optimize::SplitMix64;
use crate::space::InputSpace;
use crate::table::{N_CELLS, N_THETA_H, cell_center, cell_indices};

/// The symmetry of `f` in `phi_d` that a layout and a model rely on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Symmetry {
    /// `phi_d` and `pi - phi_d` are alike, besides reciprocity: `phi` folds to `[0, pi/2]`.
    #[default]
    Bilateral,
    /// Only `phi_d` and `phi_d + pi` are alike: `phi` lives on a circle of length `pi`.
    Reciprocal,
}

impl Symmetry {
    /// The length of the axis of `phi`: `pi/2` where it is folded, else `pi`.
    pub(crate) fn phi_extent(self) -> f64 {
        match self {
            Self::Bilateral => FRAC_PI_2,
            Self::Reciprocal => PI,
        }
    }
}

/// The exponent of nodes along a folded `phi` where there are enough of them; what others reach is in `docs/results.md`.
pub(crate) const PHI_DENSITY: f64 = 1.5;

/// A product lattice in the warped box, `A x B x C` nodes along `u`, `v` and `phi`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LatticeLayout {
    /// Nodes along `u`, `v`, `phi`.
    pub shape: [usize; 3],
    /// Exponent of the warp along `u`, in which kernels measure distance: `u^(1/node_density)`.
    pub node_density: f64,
    /// Exponent `p > 1` of the nodes along `u`: `u = s t + (1 - s) t^p` with `t` evenly spaced and `s = A / 90`, so
    /// that at the specular peak the nodes stand on the centres of the table's cells, no denser, and spread out
    /// from there. 0 for `u = t^node_density`, nodes that are even in the warp.
    pub node_spread: f64,
    /// Exponent of the nodes along `v`: `v = v_max t^v_density`; below 1 the nodes crowd towards the horizon.
    pub v_density: f64,
    /// The largest `v`; 1 is the horizon, where nothing can be measured.
    pub v_max: f64,
    /// Symmetry in `phi_d`.
    pub symmetry: Symmetry,
    /// Exponent of the nodes along a folded `phi`: `phi = pi/2 (1 - (1 - t)^phi_density)`; above 1 the nodes crowd towards
    /// `phi_d = pi/2`.
    #[serde(default = "even")]
    pub phi_density: f64,
}

/// Nodes of files that say nothing.
fn even() -> f64 {
    1.0
}

impl Default for LatticeLayout {
    /// 64 x 32 x 18 nodes: 36,864 samples, 2.5 % of the table.
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

/// The exponent along `v` of `b` nodes: the more there are, the more they crowd towards the horizon.
fn v_density(b: usize) -> f64 {
    0.6 + 0.3 / b as f64
}

/// The largest `v` of `b` nodes: what lies beyond is extrapolated, and grows there; few nodes are better spent elsewhere.
fn v_max(b: usize) -> f64 {
    1.0 - (0.18 / b as f64).clamp(0.01, 0.09)
}

/// How the nodes along `phi` grow with the number of samples: faster than the others, whose power is half of the rest.
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

    /// A lattice of this shape. Few nodes spread and crowd less: `node_spread = 1 + A / 32`, at most 3;
    /// `v_density = 0.6 + 0.3 / B`; `v_max = 1 - 0.18 / B`, 0.91 to 0.99; `phi_density = 1 + C / 16`, at most 1.5.
    #[must_use]
    pub fn with_shape(shape: [usize; 3], symmetry: Symmetry) -> Self {
        let node_spread = (1.0 + shape[0] as f64 / 32.0).min(3.0);
        let phi_density = (1.0 + shape[2] as f64 / 16.0).min(PHI_DENSITY);
        let (v_density, v_max) = (v_density(shape[1]), v_max(shape[1]));
        Self { shape, node_spread, v_density, v_max, phi_density, symmetry, ..Self::default() }
    }

    /// A lattice with about `samples` nodes, that of the default one in its proportions; with fewer samples the nodes
    /// along `phi` thin out most.
    ///
    /// # Errors
    /// Fewer than 12 samples.
    pub fn with_samples(samples: usize, symmetry: Symmetry) -> Result<Self> {
        if samples < 12 {
            return Err(Error::argument("number of samples", "at least 12", samples));
        }
        let reference = Self::default().shape.map(|n| n as f64);
        // The circle is twice as long as the folded interval.
        let stretch = if symmetry == Symmetry::Reciprocal { 2.0 } else { 1.0 };
        let reference = [reference[0], reference[1], reference[2] * stretch];
        let scale = samples as f64 / reference.iter().product::<f64>();
        let along_phi = (reference[2] * scale.powf(PHI_POWER)).max(2.0);
        // What is left to the plane of the other two, in the default's proportions.
        let side = (samples as f64 / along_phi / (reference[0] * reference[1])).sqrt();
        let ideal = [reference[0] * side, reference[1] * side, along_phi];
        // Among the roundings of the three sides, the product nearest to the request.
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
    /// A side of fewer than 2 or more than 512 nodes, a density or `v_max` outside its range.
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
    pub fn space(&self) -> InputSpace {
        InputSpace::WarpedBox {
            density: self.node_density,
            v_density: self.v_density,
            symmetry: self.symmetry,
            tail: 1.0,
            phi_density: self.phi_density,
        }
    }

    /// The nodes along `u`, `v` and `phi`, increasing.
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
        // Half a step off the ends of a folded phi, where the mirrored kernel already knows that slopes vanish.
        let period = self.symmetry.phi_extent();
        let phi_density = if self.symmetry == Symmetry::Bilateral { self.phi_density } else { 1.0 };
        let place = |t: f64| period * (1.0 - (1.0 - t).powf(phi_density));
        let phi = (0..self.shape[2]).map(|i| place((i as f64 + 0.5) / c)).collect();
        [u, v, phi]
    }

    /// The directions of the nodes, `phi` fastest, then `v`, then `u`.
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

/// `count` directions drawn uniformly in the warped box up to `v = v_max`, from `seed`.
#[must_use]
pub fn random_directions(count: usize, v_max: f64, seed: u64) -> Vec<HalfDiff> {
    let mut random = SplitMix64(seed);
    (0..count)
        .map(|_| {
            let [u, v, phi] = std::array::from_fn(|_| random.next_unit());
            BoxPoint { u, v: v * v_max, phi: phi * PI }.to_half_diff()
        })
        .collect()
}

/// `count` distinct valid cells of the table drawn from `seed`: their centres, in table order.
#[must_use]
pub fn random_cells(count: usize, seed: u64) -> Vec<HalfDiff> {
    let centre = |index| {
        let (h, d, p) = cell_indices(index);
        cell_center(h, d, p)
    };
    let mut valid: Vec<usize> = (0..N_CELLS).filter(|&index| centre(index).is_above_horizon()).collect();
    let count = count.min(valid.len());
    let mut random = SplitMix64(seed);
    // The first `count` places of a Fisher-Yates shuffle.
    for i in 0..count {
        let left = (valid.len() - i) as u64;
        #[expect(clippy::cast_possible_truncation, reason = "below the number of cells")]
        let j = i + (random.next_u64() % left) as usize;
        valid.swap(i, j);
    }
    valid.truncate(count);
    valid.sort_unstable();
    valid.into_iter().map(centre).collect()
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

    #[test]
    fn random_layouts_are_valid_seeded_and_distinct() {
        let directions = random_directions(500, 0.97, 7);
        assert_eq!(directions, random_directions(500, 0.97, 7));
        assert_ne!(directions, random_directions(500, 0.97, 8));
        assert!(directions.iter().all(|a| a.is_above_horizon()));
        let cells = random_cells(1000, 3);
        assert_eq!(cells, random_cells(1000, 3));
        assert!(cells.iter().all(|a| a.is_above_horizon()));
        assert!(cells.windows(2).all(|w| w[0] != w[1]) && cells.len() == 1000);
        assert_eq!(random_cells(usize::MAX, 0).len(), 1_096_216);
    }
}
