//! The peer of learned priors: principal components of a library, with ridge regression.

use gpbrdf_core::brdf::{BoxPoint, HORIZON_COSINE};
use gpbrdf_core::nalgebra::{DMatrix, DVector};
use gpbrdf_core::{Brdf, BrdfTable, HalfDiff, Rgb, SampleSet};
use std::f64::consts::FRAC_PI_2;

/// Nodes along `u`, `v` and the folded `phi` of the warped box, at which materials are known.
const NODES: [usize; 3] = [48, 24, 12];

/// Added to `f cos theta_i` before the logarithm, sr^-1.
const EPSILON: f64 = 1e-3;

/// The weight of the ridge, as published.
const RIDGE: f64 = 40.0;

/// Materials at the nodes: `ln(f cos theta_i + 0.001)` of each channel, with the smaller of both cosines, as nodes are
/// reciprocal.
#[derive(Clone, Debug, Default)]
pub(crate) struct Principal {
    names: Vec<String>,
    /// For each material, three columns.
    columns: Vec<[Vec<f64>; 3]>,
}

impl Principal {
    /// Adds a material; one of the same name is replaced.
    pub(crate) fn add(&mut self, name: &str, brdf: &dyn Brdf) {
        let nodes: Vec<HalfDiff> = (0..NODES.iter().product()).map(node).collect();
        let mut values = vec![[0.0; 3]; nodes.len()];
        brdf.eval_many(&nodes, &mut values);
        let column = |c: usize| nodes.iter().zip(&values).map(|(&at, f)| logarithm(f[c], at)).collect();
        let columns = std::array::from_fn(column);
        match self.names.iter().position(|known| known == name) {
            Some(place) => self.columns[place] = columns,
            None => {
                self.names.push(name.to_owned());
                self.columns.push(columns);
            }
        }
    }

    /// The library without the materials whose names `leave` picks.
    pub(super) fn without(&self, leave: impl Fn(&str) -> bool) -> Self {
        let kept = || self.names.iter().zip(&self.columns).filter(|(name, _)| !leave(name));
        Self {
            names: kept().map(|(name, _)| name.clone()).collect(),
            columns: kept().map(|(_, columns)| columns.clone()).collect(),
        }
    }

    /// A table of what few samples tell with the help of the library.
    ///
    /// `y = ln((f cos theta_i + e) / (m + e))` with the library's median `m` is taken as its mean over all columns of
    /// the library (each channel of each material) plus `Q x`, with the principal components `Q = U S` of the columns
    /// about their mean and `x = (P^T P + 40 I)^-1 P^T (y - mean)` from the rows `P` of `Q` at the samples. Source: J.
    /// B. Nielsen, H. W. Jensen and R. Ramamoorthi, "On Optimal, Minimal BRDF Sampling for Reflectance Acquisition"
    /// (SIGGRAPH Asia 2015), sections 3 and 4. The median is the same in all columns and drops out. With all
    /// components, `Q` is the matrix of the columns `A` times an orthonormal one, so that the result is `mean + A B^T
    /// (B B^T + 40 I)^-1 (y - mean)`, with the rows `B` of `A` at the samples. Between nodes, `y` is trilinear. Cost:
    /// `O(n^3)` for `n` samples.
    pub(super) fn predict(&self, samples: &SampleSet) -> BrdfTable {
        let columns: Vec<&Vec<f64>> = self.columns.iter().flatten().collect();
        let count = columns.len() as f64;
        let size = NODES.iter().product();
        let mean: Vec<f64> =
            (0..size).map(|node| columns.iter().map(|column| column[node]).sum::<f64>() / count).collect();
        let (n, m) = (samples.len(), columns.len());
        let places: Vec<Place> = samples.angles.iter().map(|&at| Place::new(at)).collect();
        let rows = DMatrix::from_fn(n, m, |i, j| places[i].of(columns[j]) - places[i].of(&mean));
        let ridge = &rows * rows.transpose() + DMatrix::identity(n, n) * RIDGE;
        let Some(factor) = ridge.cholesky() else { return BrdfTable::from_fn(|_| [0.0; 3]) };
        let predicted: [Vec<f64>; 3] = std::array::from_fn(|c| {
            let targets = samples.angles.iter().zip(&samples.values).zip(&places);
            let targets = targets.map(|((&at, f), place)| logarithm(f[c], at) - place.of(&mean));
            let weights = rows.transpose() * factor.solve(&DVector::from_iterator(n, targets));
            let mut sum = mean.clone();
            for (weight, column) in weights.iter().zip(&columns) {
                sum.iter_mut().zip(*column).zip(&mean).for_each(|((s, x), m)| *s += weight * (x - m));
            }
            sum
        });
        BrdfTable::from_fn(|at| -> Rgb {
            let place = Place::new(at);
            let cosine = smaller_cosine(at).max(HORIZON_COSINE);
            predicted.each_ref().map(|y| ((place.of(y).exp() - EPSILON) / cosine).max(0.0))
        })
    }
}

fn smaller_cosine(at: HalfDiff) -> f64 {
    let (a, b) = at.cosines();
    a.min(b).max(0.0)
}

fn logarithm(f: f64, at: HalfDiff) -> f64 {
    (f.max(0.0) * smaller_cosine(at) + EPSILON).ln()
}

/// The directions of a node.
fn node(index: usize) -> HalfDiff {
    let [_, b, c] = NODES;
    let share = |i: usize, n: usize| i as f64 / (n - 1) as f64;
    let point = BoxPoint {
        u: share(index / (b * c), NODES[0]),
        // At the horizon itself nothing has a value.
        v: 0.999 * share(index / c % b, b),
        phi: FRAC_PI_2 * share(index % c, c),
    };
    point.to_half_diff()
}

/// The eight nodes about a pair of directions, and their weights.
struct Place {
    corners: [(usize, f64); 8],
}

impl Place {
    fn new(at: HalfDiff) -> Self {
        let point = BoxPoint::from_half_diff(at).folded_bilateral();
        let coordinates = [point.u, (point.v / 0.999).min(1.0), point.phi / FRAC_PI_2];
        let mut first = [0; 3];
        let mut rest = [0.0; 3];
        for k in 0..3 {
            let x = coordinates[k].clamp(0.0, 1.0) * (NODES[k] - 1) as f64;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the nodes")]
            let low = (x.floor() as usize).min(NODES[k] - 2);
            first[k] = low;
            rest[k] = x - low as f64;
        }
        let corners = std::array::from_fn(|corner| {
            let mut index = 0;
            let mut weight = 1.0;
            for k in 0..3 {
                let up = corner >> k & 1;
                index = index * NODES[k] + first[k] + up;
                weight *= if up == 1 { rest[k] } else { 1.0 - rest[k] };
            }
            (index, weight)
        });
        Self { corners }
    }

    fn of(&self, values: &[f64]) -> f64 {
        self.corners.iter().map(|&(index, weight)| weight * values[index]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gpbrdf_core::brdf::materials;
    use gpbrdf_core::{Layout, SampleSet};

    #[test]
    fn nodes_are_found_again() {
        let values: Vec<f64> = (0..NODES.iter().product()).map(|i: usize| i as f64).collect();
        for index in [0, 7, 1000, 5000, 12_345] {
            let at = node(index);
            // The polar axis of the box has no phi.
            if at.theta_h > 0.0 {
                assert!((Place::new(at).of(&values) - index as f64).abs() < 1e-6, "{index}");
            }
        }
    }

    #[test]
    fn a_material_of_the_library_is_recognised_the_better_the_more_is_measured() {
        let mut library = Principal::default();
        for material in materials() {
            library.add(material.name, &material.brdf);
        }
        let material = &materials()[2];
        let error = |count: usize| {
            let samples = SampleSet::measure(&material.brdf, &Layout::Hemisphere { count, seed: 1 }).unwrap();
            let table = library.predict(&samples);
            let test =
                SampleSet::measure(&material.brdf, &Layout::Hemisphere { count: 500, seed: 9 }).unwrap();
            let errors = test.angles.iter().zip(&test.values).map(|(&at, f)| {
                let found = table.eval_half_diff(at);
                ((found[1] + 1e-3) / (f[1] + 1e-3)).ln().abs()
            });
            errors.sum::<f64>() / 500.0
        };
        let (few, many) = (error(4), error(400));
        assert!(many < few && many < 0.2, "{few} {many}");
        assert_eq!(library.without(|name| name == material.name).names.len(), library.names.len() - 1);
    }
}
