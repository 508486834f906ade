//! Layouts: the choice of directions to measure.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use crate::base::error::{Error, Result};
use crate::base::random::SplitMix64;
use crate::brdf::angles::{BoxPoint, HalfDiff};
use crate::brdf::table::{N_CELLS, cell_center, cell_indices};
use crate::sample::lattice::LatticeLayout;
use crate::sample::scan::{GonioGrid, InPlaneScan};

/// The most directions of a layout that imitates an instrument.
pub const MAX_DIRECTIONS: usize = 10_000_000;

/// The smallest cosine of directions drawn over the hemisphere: closer to the horizon most instruments
/// measure nothing.
pub const MIN_DRAWN_COSINE: f64 = 0.05;

/// The choice of directions to measure.
#[derive(Clone, Debug, PartialEq)]
pub enum Layout {
    /// A product lattice in the warped box.
    Lattice(LatticeLayout),
    /// Half-difference angles drawn uniformly in the warped box, with `v` below `v_max` of the default
    /// lattice. Compared with [`Layout::Hemisphere`], many more of them are near the specular peak.
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
    /// Light and viewer drawn uniformly in solid angle, as by an instrument that knows nothing of specular
    /// peaks: see [`hemisphere_directions`].
    Hemisphere {
        /// Number of pairs of directions.
        count: usize,
        /// Seed of the random numbers.
        seed: u64,
    },
    /// A scan in the plane of incidence.
    InPlane(InPlaneScan),
    /// The grid of a goniometer.
    Gonio(GonioGrid),
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
    SplitMix64::new(seed).draw_to_front(&mut valid, count);
    valid.truncate(count);
    valid.sort_unstable();
    valid.into_iter().map(centre).collect()
}

/// `count` pairs `[wi, wo]`, each direction drawn from `seed` independently of the other and uniformly in
/// solid angle, with a cosine of at least [`MIN_DRAWN_COSINE`]: the cosine is uniform on `[0.05, 1)` and the
/// azimuth on `[0, 2 pi)`, so that the mean cosine is 0.525. The first pairs are the same for every count.
///
/// # Errors
/// [`Error::InvalidArgument`] for a count of 0 or above [`MAX_DIRECTIONS`].
pub fn hemisphere_directions(count: usize, seed: u64) -> Result<Vec<[Vector3<f64>; 2]>> {
    check_count(count, 1)?;
    let mut random = SplitMix64::new(seed);
    let mut draw = || {
        let z = MIN_DRAWN_COSINE + (1.0 - MIN_DRAWN_COSINE) * random.next_unit();
        let (sin_phi, cos_phi) = (TAU * random.next_unit()).sin_cos();
        let horizontal = ((1.0 - z) * (1.0 + z)).sqrt();
        Vector3::new(horizontal * cos_phi, horizontal * sin_phi, z)
    };
    Ok((0..count).map(|_| [draw(), draw()]).collect())
}

/// Refuses numbers of directions that are too small for a layout or too large for any.
pub(super) fn check_count(count: usize, least: usize) -> Result<()> {
    if (least..=MAX_DIRECTIONS).contains(&count) {
        return Ok(());
    }
    Err(Error::argument("number of samples", format!("{least} to {MAX_DIRECTIONS}"), count))
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

    #[test]
    fn hemisphere_directions_are_uniform_in_solid_angle() {
        const COUNT: usize = 100_000;
        let pairs = hemisphere_directions(COUNT, 3).unwrap();
        assert_eq!(pairs.len(), COUNT);
        assert_eq!(pairs[..50], hemisphere_directions(50, 3).unwrap());
        assert_ne!(pairs[..50], hemisphere_directions(50, 4).unwrap());
        let mean = |of: &dyn Fn(&[Vector3<f64>; 2]) -> f64| pairs.iter().map(of).sum::<f64>() / COUNT as f64;
        for side in [0, 1] {
            assert!(pairs.iter().all(|pair| pair[side].z >= MIN_DRAWN_COSINE));
            assert!(pairs.iter().all(|pair| (pair[side].norm() - 1.0).abs() < 1e-15));
            // With z uniform on [a, 1], the mean of z is (1 + a) / 2 and that of z^2 is (1 + a + a^2) / 3.
            // Each bound is about five standard deviations of a mean.
            let a = MIN_DRAWN_COSINE;
            assert!((mean(&|pair| pair[side].z) - 0.5 * (1.0 + a)).abs() < 5e-3);
            assert!((mean(&|pair| pair[side].z.powi(2)) - (1.0 + a + a * a) / 3.0).abs() < 5e-3);
            assert!(mean(&|pair| pair[side].x).abs() < 1e-2 && mean(&|pair| pair[side].y).abs() < 1e-2);
            let quadrant = mean(&|pair| f64::from(u8::from(pair[side].x > 0.0 && pair[side].y > 0.0)));
            assert!((quadrant - 0.25).abs() < 7e-3, "{quadrant}");
        }
        // The directions do not depend on each other.
        let product = mean(&|pair| (pair[0].z - 0.525) * (pair[1].z - 0.525));
        let azimuths = mean(&|pair| pair[0].x * pair[1].x + pair[0].y * pair[1].y);
        assert!(product.abs() < 2e-3 && azimuths.abs() < 1e-2, "{product} {azimuths}");
        for count in [0, MAX_DIRECTIONS + 1] {
            let message = hemisphere_directions(count, 0).unwrap_err().to_string();
            assert_eq!(message, format!("number of samples: expected 1 to 10000000, found {count}"));
        }
    }
}
