//! What other materials tell about a material that is measured: the mean and the principal functions of a library
//! of reflectances.

mod colour;
mod file;
mod grid;
#[cfg(feature = "fit")]
mod learn;

pub use colour::Colour;
#[cfg(feature = "fit")]
pub(crate) use colour::to_opponent;
pub(crate) use colour::{OPPONENT, from_opponent, variance_of_channels};
pub(crate) use file::PriorHeader;
pub use grid::BoxGrid;
#[cfg(feature = "fit")]
pub use learn::{LearnOptions, Library, learn};

use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use crate::base::error::{Error, Result};
use crate::brdf::angles::HalfDiff;
use crate::sample::LOG_EPSILON;
use crate::sample::Transform;

/// A prior of `ln(f + 1e-3)`, learned from a library of materials.
///
/// The logarithms of the three channels are rotated into one achromatic and two chromatic colours ([`Colour`]).
/// The achromatic one is `m(x) + sum_k z_k B_k(x) + r(x)` with `z_k ~ N(0, 1)`: the library's mean `m`, its
/// principal functions `B_k`, each times its standard deviation over the library, and a rest `r`. The chromatic
/// ones have functions of their own and no mean. With a stationary process as the rest, every colour is a Gaussian
/// process with the covariance `B(x)^T B(x') + k(x, x')`.
///
/// Functions are cubic between the nodes of a grid in the warped box ([`BoxGrid`]). They are even in `theta_h`,
/// `theta_d` and `phi_d`, and do not depend on `phi_d` where it has no meaning, like every isotropic, reciprocal and
/// bilateral reflectance.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// The name by which reports call it.
    pub name: String,
    /// Names of the materials of the library.
    pub materials: Vec<String>,
    grid: BoxGrid,
    /// `m` at the nodes.
    mean: Vec<f32>,
    /// The functions of the achromatic and of the chromatic colours.
    functions: [Functions; 2],
}

/// The principal functions of one kind of colour.
#[derive(Clone, Debug, PartialEq)]
struct Functions {
    count: usize,
    /// Values at the nodes, one row of `count` values per node.
    nodes: Vec<f32>,
    /// Standard deviation of what the functions leave of a material that is not in the library.
    left: f64,
}

impl Prior {
    /// The transform of its targets.
    pub const TRANSFORM: Transform = Transform::Log { epsilon: LOG_EPSILON };

    /// SHA-256 sum of the file of [`Prior::built_in`].
    pub const BUILT_IN_SHA256: &str = "f6eb1afb1dc66f2c8891bdfac530496a41bbf8f9a4d5058a02574f11855f8f2c";

    /// The prior that comes with this crate. `assets/README.md` names its sources.
    #[must_use]
    pub fn built_in() -> Arc<Self> {
        static BUILT_IN: OnceLock<Arc<Prior>> = OnceLock::new();
        Arc::clone(BUILT_IN.get_or_init(|| Arc::new(file::built_in())))
    }

    fn new(
        name: String,
        materials: Vec<String>,
        grid: BoxGrid,
        mean: Vec<f32>,
        functions: [Functions; 2],
    ) -> Result<Self> {
        grid.validate()?;
        let nodes = grid.len();
        let fits = mean.len() == nodes && functions.iter().all(|f| f.nodes.len() == nodes * f.count);
        if !fits {
            let found = format!("{} values of the mean", mean.len());
            return Err(Error::argument("functions of a prior", format!("{nodes} values each"), found));
        }
        if let Some(bad) = functions.iter().map(|f| f.left).find(|left| !(*left > 0.0 && left.is_finite())) {
            return Err(Error::argument("rest of a prior", "a positive number", bad));
        }
        Ok(Self { name, materials, grid, mean, functions })
    }

    /// The grid of its nodes.
    #[must_use]
    pub fn grid(&self) -> BoxGrid {
        self.grid
    }

    /// The number of principal functions of a kind of colour.
    #[must_use]
    pub fn n_functions(&self, colour: Colour) -> usize {
        self.functions[colour as usize].count
    }

    /// Standard deviation of what the functions leave, root mean square over the warped box, of a material that is
    /// not in the library.
    #[must_use]
    pub fn left(&self, colour: Colour) -> f64 {
        self.functions[colour as usize].left
    }

    /// The principal functions at directions, one row per direction. Cost: 64 multiply-adds per value.
    #[must_use]
    pub fn features(&self, colour: Colour, angles: &[HalfDiff]) -> Vec<f64> {
        let Functions { count, nodes, .. } = &self.functions[colour as usize];
        let mut rows = vec![0.0; angles.len() * count];
        if *count > 0 {
            rows.par_chunks_mut(*count).zip(angles).for_each(|(row, &at)| {
                self.grid.stencil(at).for_each(|node, weight| {
                    let values = &nodes[node * count..(node + 1) * count];
                    row.iter_mut().zip(values).for_each(|(out, &value)| *out += weight * f64::from(value));
                });
            });
        }
        rows
    }

    /// The library's mean of a colour at directions; zero for chromatic ones.
    #[must_use]
    pub fn mean(&self, colour: Colour, angles: &[HalfDiff]) -> Vec<f64> {
        match colour {
            Colour::Achromatic => angles.iter().map(|&at| self.grid.value(&self.mean, at)).collect(),
            Colour::Chromatic => vec![0.0; angles.len()],
        }
    }

    /// `m + sum_k z_k B_k` at the nodes, for the coefficients of one colour.
    pub(crate) fn combined(&self, colour: Colour, coefficients: &[f64]) -> Vec<f64> {
        let Functions { count, nodes, .. } = &self.functions[colour as usize];
        let sum = |node: usize| -> f64 {
            let row = &nodes[node * count..(node + 1) * count];
            row.iter().zip(coefficients).map(|(b, z)| f64::from(*b) * z).sum()
        };
        (0..self.grid.len())
            .map(|node| {
                let mean = if colour == Colour::Achromatic { f64::from(self.mean[node]) } else { 0.0 };
                mean + sum(node)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests;
