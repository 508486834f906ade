//! A sparse Gaussian process on inducing lattices: the few numbers that it stores are its values at lattice
//! nodes.
//!
//! There are three components, one for each column of a colour matrix, and each has its own lattice. Given
//! the values `m` at its nodes `Z`, a component is an exact lattice process without noise, so its mean and
//! variance are those of [`LatticeGp`]: `k(x, Z) K_ZZ^-1 m` and `s^2 (k(x, x) - k(x, Z) K_ZZ^-1 k(Z, x))`.
//! This variance leaves out the uncertainty of the values themselves; with thousands of table cells per node,
//! that uncertainty is far smaller than the variance between the nodes.

#[cfg(feature = "fit")]
pub(crate) mod cell_grid;
#[cfg(feature = "fit")]
pub(crate) mod fit;
#[cfg(feature = "fit")]
mod heavy_tails;
mod node_covariance;
pub(crate) mod posterior;
#[cfg(feature = "fit")]
mod regression;

use serde::{Deserialize, Serialize};

use self::node_covariance::NodeCovariance;
use crate::base::error::{Error, Result};
use crate::base::linalg::{Matrix, view};
use crate::gp::hyper::MIN_NOISE_RATIO;
use crate::gp::lattice::{LatticeData, LatticeGp, LatticeHyper};
use crate::kernel::Kernel1d;
use crate::sample::space::WarpedBox;

/// Shape, space and hyper-parameters of the lattice of one component: everything but its values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InducingShape {
    /// Number of nodes along `u`, `v`, `phi`.
    pub shape: [usize; 3],
    /// The warped box with this component's own densities; nodes are evenly spaced in its coordinates.
    pub space: WarpedBox,
    /// The kernel of each axis.
    pub kernels: [Kernel1d; 3],
    /// Signal variance `s^2`, in squared target units.
    pub signal_variance: f64,
    /// Variance of the residuals that the signal does not account for, in squared target units.
    pub noise_variance: f64,
}

impl InducingShape {
    /// Kernel coordinates of the nodes along the three axes.
    ///
    /// Along `u` the nodes reach from the centre of the table's first cell, next to the specular peak, to
    /// `theta_h = pi/2`, and along `v` from 0 to the horizon, with nodes at both ends. Along `phi` the
    /// outermost nodes lie half a step inside the ends. A single node is placed in the middle of its axis.
    #[must_use]
    pub fn nodes(&self) -> [Vec<f64>; 3] {
        let [a, b, c] = self.shape;
        let between = |low: f64, high: f64, n: usize| -> Vec<f64> {
            if n == 1 {
                return vec![0.5 * (low + high)];
            }
            (0..n).map(|i| low + (high - low) * i as f64 / (n - 1) as f64).collect()
        };
        let first = self.space.warp_u(0.5 / crate::brdf::table::N_THETA_H as f64);
        let period = self.space.symmetry.phi_extent();
        let phi = (0..c).map(|i| (i as f64 + 0.5) / c as f64 * period).collect();
        [between(first, self.space.warp_u(1.0), a), between(0.0, 1.0, b), phi]
    }

    /// Number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Whether there is no node.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The inverse covariance of the nodes along each axis.
    pub(super) fn inverses(&self) -> Result<[Matrix; 3]> {
        let nodes = self.nodes();
        let (metrics, mirrored) = (self.space.lattice_metrics(), self.space.mirrored());
        let axis = |k: usize| -> Result<Matrix> {
            Ok(NodeCovariance::new(&self.kernels[k], metrics[k], mirrored[k], &nodes[k])?.inverse())
        };
        Ok([axis(0)?, axis(1)?, axis(2)?])
    }

    fn validate(&self) -> Result<()> {
        self.space.validate()?;
        check_shape(self.shape)
    }
}

/// The largest number of nodes of one lattice; with more, the normal matrix would take gigabytes.
pub(crate) const MAX_NODES: usize = 12_000;

/// Checks the numbers of nodes along the axes of an inducing lattice.
///
/// # Errors
/// An axis without nodes or with more than 512, or more than 12,000 nodes in all.
pub(crate) fn check_shape(shape: [usize; 3]) -> Result<()> {
    let nodes = shape.iter().try_fold(1usize, |n, &side| n.checked_mul(side));
    match nodes {
        Some(1..=MAX_NODES) if shape.iter().all(|&side| side <= 512) => Ok(()),
        _ => {
            let [a, b, c] = shape;
            let expected = format!("1 to 512 nodes along each axis and at most {MAX_NODES} in all");
            Err(Error::argument("inducing lattice", expected, format!("{a}x{b}x{c}")))
        }
    }
}

/// One component: a lattice and the process that its values define.
#[derive(Clone, Debug)]
pub struct InducingComponent {
    lattice: InducingShape,
    gp: LatticeGp,
}

impl InducingComponent {
    /// The process with these values at the nodes, `[A][B][C]`.
    ///
    /// # Errors
    /// An invalid lattice, a number of values that differs from that of the nodes, or values that are not
    /// finite.
    pub fn new(lattice: InducingShape, values: Vec<f64>) -> Result<Self> {
        lattice.validate()?;
        let data = LatticeData {
            coordinates: lattice.nodes(),
            metrics: lattice.space.lattice_metrics(),
            mirrored: lattice.space.mirrored(),
            targets: values,
            channels: 1,
        };
        data.validate()?;
        let hyper = LatticeHyper {
            signal_variance: lattice.signal_variance,
            noise_variance: MIN_NOISE_RATIO * lattice.signal_variance,
            kernels: lattice.kernels.clone(),
        };
        if !(lattice.noise_variance > 0.0 && lattice.noise_variance.is_finite()) {
            return Err(Error::argument("noise variance", "a positive number", lattice.noise_variance));
        }
        hyper.validate()?;
        let inverses = lattice.inverses()?;
        let weights = crate::gp::contract(inverses.each_ref().map(view), &data.targets, 1);
        Ok(Self { gp: LatticeGp::from_weights(data, hyper, weights)?, lattice })
    }

    /// Shape, space and hyper-parameters.
    #[must_use]
    pub fn lattice(&self) -> &InducingShape {
        &self.lattice
    }

    /// Values at the nodes, `[A][B][C]`. These are the numbers that are stored; after a fit, half precision
    /// represents each of them exactly.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.gp.data().targets
    }

    /// The exact lattice process that the values define: it gives the mean and the variance of the component.
    /// Its own noise variance is only a jitter.
    #[must_use]
    pub fn gp(&self) -> &LatticeGp {
        &self.gp
    }

    /// The count of numbers that the component stores: values, densities of its space, length scales and
    /// variances.
    #[must_use]
    pub fn floats(&self) -> usize {
        self.values().len() + COMPONENT_CONSTANTS
    }
}

/// The count of numbers that a component stores besides its values: three densities, three length scales, two
/// variances.
pub(crate) const COMPONENT_CONSTANTS: usize = 8;

/// The count of numbers that are stored once for all components: the colour matrix.
pub(crate) const COLOUR_CONSTANTS: usize = 9;

/// The inducing lattices of a material: `target_c = offset_c + sum_k mix_ck component_k`.
#[derive(Clone, Debug)]
pub struct InducingGp {
    /// The orthogonal colour matrix: column `k` is the colour of component `k`.
    pub mix: [[f64; 3]; 3],
    /// The three components; where colours are decorrelated, the one of the largest variance comes first.
    pub components: Vec<InducingComponent>,
    /// Number of table cells that the values were fitted to.
    pub cells: usize,
}

impl InducingGp {
    /// Checks that there are three components of one symmetry and a finite colour matrix.
    ///
    /// # Errors
    /// Another number of components, components of different symmetries, or a colour matrix that is not
    /// finite.
    pub fn validate(&self) -> Result<()> {
        if self.components.len() != 3 {
            return Err(Error::argument("components", "3", self.components.len()));
        }
        let symmetry = self.components[0].lattice.space.symmetry;
        if self.components.iter().any(|c| c.lattice.space.symmetry != symmetry) {
            return Err(Error::argument("symmetry of components", "the same for all", "a mixture"));
        }
        match self.mix.as_flattened().iter().find(|x| !x.is_finite()) {
            None => Ok(()),
            Some(bad) => Err(Error::argument("colour matrix", "finite numbers", bad)),
        }
    }

    /// Mixes the values of the components into colours.
    pub(crate) fn colour(&self, components: [f64; 3]) -> [f64; 3] {
        self.mix.map(|row| row.iter().zip(components).map(|(m, x)| m * x).sum())
    }

    /// The variances of the channels, given the variances of the components, which are independent.
    pub(crate) fn colour_variance(&self, components: [f64; 3]) -> [f64; 3] {
        self.mix.map(|row| row.iter().zip(components).map(|(m, x)| m * m * x).sum())
    }
}
