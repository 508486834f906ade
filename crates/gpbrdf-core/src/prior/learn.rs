//! Learning a prior from a library of materials.

use rayon::prelude::*;

use super::colour::{Colour, to_opponent};
use super::grid::BoxGrid;
use super::{Functions, Prior};
use crate::base::error::{Error, Result};
use crate::base::f16::to_half;
use crate::base::linalg::{product, symmetric_eigen, view_slice};
use crate::base::simd::{add_scaled, dot};
use crate::brdf::Brdf;
use crate::brdf::angles::HalfDiff;

/// The largest value that is taken from a material, sr^-1.
const BRIGHTEST: f64 = 1e5;

/// The number of parts of the library that are left out in turn to see what the functions leave.
const FOLDS: usize = 8;

/// Size of a prior.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LearnOptions {
    /// Nodes along `u`, `v` and `phi`.
    pub grid: BoxGrid,
    /// The largest number of achromatic and of chromatic functions. There are never more of them than materials.
    pub functions: [usize; 2],
}

impl Default for LearnOptions {
    /// 60 and 30 functions on 30 x 19 x 10 nodes: one mebibyte in half precision.
    fn default() -> Self {
        Self { grid: BoxGrid { shape: [30, 19, 10] }, functions: [60, 30] }
    }
}

/// Materials, each as three colours of `ln(f + 1e-3)` at the nodes of a grid.
#[derive(Clone, Debug)]
pub struct Library {
    grid: BoxGrid,
    names: Vec<String>,
    /// For each material, one row of nodes per colour.
    colours: Vec<[Vec<f64>; 3]>,
}

impl Library {
    /// An empty library.
    ///
    /// # Errors
    /// A grid of too few or too many nodes.
    pub fn new(grid: BoxGrid) -> Result<Self> {
        grid.validate()?;
        Ok(Self { grid, names: Vec::new(), colours: Vec::new() })
    }

    /// Adds a material: the mean over both orders and all mirror images of each pair of directions. At `theta_h = 0`
    /// and `theta_d = 0` values are averaged over `phi_d`, which has no meaning there. One of the same name is
    /// replaced.
    pub fn add(&mut self, name: &str, brdf: &dyn Brdf) {
        let [nu, nv, nphi] = self.grid.shape;
        let rows: Vec<Vec<[f64; 3]>> = (0..nu * nv)
            .into_par_iter()
            .map(|row| {
                let (i, j) = (row / nv, row % nv);
                let mut values: Vec<[f64; 3]> =
                    (0..nphi).map(|k| to_opponent(logarithms(brdf, self.grid.node([i, j, k])))).collect();
                if i == 0 || j == 0 {
                    let mean =
                        std::array::from_fn(|c| values.iter().map(|v| v[c]).sum::<f64>() / nphi as f64);
                    values.fill(mean);
                }
                values
            })
            .collect();
        let colours = std::array::from_fn(|c| rows.iter().flatten().map(|v| v[c]).collect());
        match self.names.iter().position(|known| known == name) {
            Some(place) => self.colours[place] = colours,
            None => {
                self.names.push(name.to_owned());
                self.colours.push(colours);
            }
        }
    }

    /// The names of the materials.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The library without the materials whose names `leave` picks.
    #[must_use]
    pub fn without(&self, leave: impl Fn(&str) -> bool) -> Self {
        let kept = || self.names.iter().zip(&self.colours).filter(|(name, _)| !leave(name));
        Self {
            grid: self.grid,
            names: kept().map(|(name, _)| name.clone()).collect(),
            colours: kept().map(|(_, colours)| colours.clone()).collect(),
        }
    }
}

/// `ln(f + 1e-3)` of each channel, averaged over all pairs of directions that are alike by symmetry.
fn logarithms(brdf: &dyn Brdf, at: HalfDiff) -> [f64; 3] {
    use std::f64::consts::PI;
    let images = [at.phi_d, PI - at.phi_d, at.phi_d + PI, 2.0 * PI - at.phi_d];
    let values = images.map(|phi_d| brdf.eval_half_diff(HalfDiff { phi_d, ..at }));
    std::array::from_fn(|c| {
        let mean = values.iter().map(|v| v[c]).sum::<f64>() / 4.0;
        let value = if mean.is_finite() { mean.clamp(0.0, BRIGHTEST) } else { 0.0 };
        Prior::TRANSFORM.forward(value)
    })
}

/// Learns a prior: the mean of the achromatic colour over the library, and the principal functions of its deviations;
/// the principal functions of both chromatic colours together, without a mean. All orders of the three channels are
/// equally likely in advance; since they rotate the chromatic colours into each other, this changes no function.
///
/// What the functions leave of unknown materials is measured on the library itself, of which one eighth at a time is
/// left out. Cost: `O(m^2 n)` for `m` materials and `n` nodes. Numbers are rounded to half precision, as in files.
///
/// # Errors
/// Fewer than two materials.
pub fn learn(name: &str, library: &Library, options: &LearnOptions) -> Result<Prior> {
    let count = library.names.len();
    if count < 2 {
        return Err(Error::argument("materials of a library", "at least 2", count));
    }
    let nodes = library.grid.len();
    let mut mean = vec![0.0; nodes];
    for [bright, ..] in &library.colours {
        add_scaled(1.0 / count as f64, bright, &mut mean);
    }
    let round = |x: f64| to_half(x).to_f32();
    let functions = Colour::ALL.map(|colour| {
        let wanted = options.functions[colour as usize];
        // A group of rows for each material.
        let groups: Vec<Vec<Vec<f64>>> = library
            .colours
            .iter()
            .map(|colours| {
                let own = colours[colour.rows()].iter().cloned();
                own.map(|row| if colour == Colour::Achromatic { difference(&row, &mean) } else { row })
                    .collect()
            })
            .collect();
        let rows: Vec<&[f64]> = groups.iter().flatten().map(Vec::as_slice).collect();
        let principal = principal_functions(&rows, wanted.min(count - 1));
        let mut at_nodes = vec![0.0; nodes * principal.len()];
        for (k, function) in principal.iter().enumerate() {
            for (node, &value) in function.iter().enumerate() {
                at_nodes[node * principal.len() + k] = round(value);
            }
        }
        Functions { count: principal.len(), nodes: at_nodes, left: what_is_left(&groups, wanted) }
    });
    let mean = mean.into_iter().map(round).collect();
    Prior::new(name.to_owned(), library.names.clone(), library.grid, mean, functions)
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// The first principal functions of rows about zero, each times its standard deviation; fewer where the rows do not
/// span as many.
fn principal_functions(rows: &[&[f64]], count: usize) -> Vec<Vec<f64>> {
    let (n, length) = (rows.len(), rows.first().map_or(0, |row| row.len()));
    let all = rows.concat();
    let columns = view_slice(&all, length, n);
    let gram = product(columns.transpose(), columns);
    let Some((values, vectors)) = symmetric_eigen(&gram) else { return Vec::new() };
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    let largest = values[order[0]].max(f64::MIN_POSITIVE);
    let kept = order.into_iter().take(count).filter(|&k| values[k] > 1e-9 * largest);
    // The rows' combination with eigenvector v has the length sqrt(value): divided by sqrt(n), the standard deviation.
    kept.map(|k| {
        let mut function = vec![0.0; length];
        for (i, row) in rows.iter().enumerate() {
            add_scaled(vectors[(i, k)] / (n as f64).sqrt(), row, &mut function);
        }
        function
    })
    .collect()
}

/// Root mean square of what the functions of the other groups leave of each group, one part of the groups at a time.
fn what_is_left(groups: &[Vec<Vec<f64>>], count: usize) -> f64 {
    let folds = FOLDS.min(groups.len());
    let (sum, terms) = (0..folds)
        .into_par_iter()
        .map(|fold| {
            let own = |i: usize| i % folds == fold;
            let rows: Vec<&[f64]> = groups
                .iter()
                .enumerate()
                .filter(|(i, _)| !own(*i))
                .flat_map(|(_, rows)| rows.iter().map(Vec::as_slice))
                .collect();
            let functions = principal_functions(&rows, count.min(rows.len() - 1));
            let mut sum = 0.0;
            let mut terms = 0;
            for row in groups.iter().enumerate().filter(|(i, _)| own(*i)).flat_map(|(_, rows)| rows) {
                let mut left = row.clone();
                // The functions are orthogonal.
                for function in &functions {
                    add_scaled(-dot(function, &left) / dot(function, function), function, &mut left);
                }
                sum += dot(&left, &left);
                terms += left.len();
            }
            (sum, terms)
        })
        .collect::<Vec<_>>()
        .into_iter()
        .fold((0.0, 0), |(a, m), (b, n)| (a + b, m + n));
    (sum / terms.max(1) as f64).sqrt().max(1e-3)
}

#[cfg(test)]
impl Library {
    /// The colours of a material.
    pub(super) fn colours_of(&self, name: &str) -> [Vec<f64>; 3] {
        let place = self.names.iter().position(|known| known == name);
        place.map_or_else(Default::default, |place| self.colours[place].clone())
    }
}
