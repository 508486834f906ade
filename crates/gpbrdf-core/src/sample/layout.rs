//! Layouts: the choice of directions to measure.

use std::f64::consts::PI;

use crate::base::random::SplitMix64;
use crate::brdf::angles::{BoxPoint, HalfDiff};
use crate::brdf::table::{N_CELLS, cell_center, cell_indices};
use crate::sample::lattice::LatticeLayout;

/// The choice of directions to measure.
#[derive(Clone, Debug, PartialEq)]
pub enum Layout {
    /// A product lattice in the warped box.
    Lattice(LatticeLayout),
    /// Directions drawn uniformly in the warped box, with `v` below `v_max` of the default lattice.
    Random {
        /// Number of directions.
        count: usize,
        /// Seed of the random numbers.
        seed: u64,
    },
    /// Centres of table cells above the horizon, drawn without replacement.
    Cells {
        /// Number of cells.
        count: usize,
        /// Seed of the random numbers.
        seed: u64,
    },
}

/// `count` directions drawn uniformly in the warped box, with `v` below `v_max`, from `seed`.
#[must_use]
pub fn random_directions(count: usize, v_max: f64, seed: u64) -> Vec<HalfDiff> {
    let mut random = SplitMix64::new(seed);
    (0..count)
        .map(|_| {
            let [u, v, phi] = std::array::from_fn(|_| random.next_unit());
            BoxPoint { u, v: v * v_max, phi: phi * PI }.to_half_diff()
        })
        .collect()
}

/// The centres of `count` distinct table cells above the horizon, drawn from `seed`, in table order. All
/// cells if `count` exceeds their number.
#[must_use]
pub fn random_cells(count: usize, seed: u64) -> Vec<HalfDiff> {
    let centre = |index| {
        let (h, d, p) = cell_indices(index);
        cell_center(h, d, p)
    };
    let mut valid: Vec<usize> = (0..N_CELLS).filter(|&index| centre(index).is_above_horizon()).collect();
    let count = count.min(valid.len());
    let mut random = SplitMix64::new(seed);
    // These are the first `count` steps of a Fisher-Yates shuffle.
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
