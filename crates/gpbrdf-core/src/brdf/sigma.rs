//! The uncertainty of a table, cell by cell.

use crate::base::error::{Error, Result};
use crate::brdf::table::{BrdfTable, N_CELLS, Trilinear};

/// Posterior standard deviation of the latent target at the centre of every cell, in target units: with the
/// logarithmic transform, 0.05 means five per cent. Cells below the horizon hold the value at the horizon.
#[derive(Clone, Debug, PartialEq)]
pub struct SigmaTable {
    planes: Vec<Vec<f32>>,
}

impl SigmaTable {
    /// A table from one plane in MERL order that serves all channels, or from one plane per channel.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] unless there are one or three planes of [`N_CELLS`] values each.
    pub fn from_planes(planes: Vec<Vec<f32>>) -> Result<Self> {
        if !matches!(planes.len(), 1 | 3) {
            return Err(Error::argument("planes of sigma", "1 or 3", planes.len()));
        }
        match planes.iter().find(|plane| plane.len() != N_CELLS) {
            None => Ok(Self { planes }),
            Some(plane) => Err(Error::argument("values of a plane", N_CELLS.to_string(), plane.len())),
        }
    }

    /// One plane in MERL order where the channels share hyper-parameters, else one per channel.
    #[must_use]
    pub fn planes(&self) -> &[Vec<f32>] {
        &self.planes
    }

    /// Sigma of one cell and channel.
    #[must_use]
    pub fn value(&self, cell: usize, channel: usize) -> f32 {
        self.planes[channel.min(self.planes.len() - 1)][cell]
    }

    /// The largest sigma of one cell over the channels, for uses that need a single number.
    #[must_use]
    pub fn largest(&self, cell: usize) -> f32 {
        self.planes.iter().fold(0.0, |largest, plane| largest.max(plane[cell]))
    }

    /// Sigma of each channel by trilinear interpolation.
    #[must_use]
    pub fn lookup(&self, at: &Trilinear) -> [f32; 3] {
        let mut sum = [0.0f32; 3];
        for (cell, weight) in at.corners() {
            sum.iter_mut().enumerate().for_each(|(c, sum)| *sum += weight * self.value(cell, c));
        }
        sum
    }

    /// Sigma of each channel as a table, for code that looks up tables of three channels.
    #[must_use]
    pub fn to_table(&self) -> BrdfTable {
        BrdfTable::from_cells(match self.planes.as_slice() {
            [r, g, b] => r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect(),
            planes => planes[0].iter().map(|&sigma| [sigma; 3]).collect(),
        })
    }
}
