//! What the processor computes before a device bakes a model.

use gpbrdf_core::Model;
use gpbrdf_core::gp::{DeviceForm, KernelSum, SeparablePart, TableGeometry};
use gpbrdf_core::sample::InputSpace;

use super::separable::{Placement, Separable};
use crate::error::{Error, Result};

/// A model as the shaders of the bake read it. It is computed on the processor, so no device is needed yet.
#[derive(Debug)]
pub struct Prepared<'a> {
    pub(super) model: &'a Model,
    pub(super) parts: Vec<Part<'a>>,
    /// What is added to each channel besides its offset.
    pub(super) constants: [f64; 3],
    /// The cells in the space of the first part.
    pub(super) geometry: TableGeometry,
    /// Distinct cells of each column, as [`TableGeometry::distinct`], but the smallest number of all parts:
    /// their spaces may differ, and a cell at the horizon may be rounded to either side of it.
    pub(super) distinct: Vec<usize>,
}

/// A summand of the targets of a model.
#[derive(Debug)]
pub(super) enum Part<'a> {
    /// A sum of products of functions along the axes.
    Separable(Box<Separable>),
    /// A sum over all samples, and the channel of the model that is its first.
    KernelSum(KernelSum<'a>, usize),
}

impl<'a> Prepared<'a> {
    /// Prepares a model. The functions of lattices are tabulated here, which takes about a millisecond for 64 x 32 x 18
    /// nodes; kernel sums are left to the bake.
    ///
    /// # Errors
    /// [`Error::NoShader`] for a model that no shader can evaluate.
    pub fn new(model: &'a Model) -> Result<Self> {
        let mut geometries: Vec<(InputSpace, TableGeometry)> = Vec::new();
        let (mut parts, mut constants) = (Vec::new(), [0.0; 3]);
        for (first, posterior) in model.posteriors() {
            match posterior.device_form() {
                DeviceForm::Separable(summands) => {
                    for SeparablePart { gp, space, colour } in summands {
                        let placement = colour
                            .map_or(Placement::Channels { first }, |colour| Placement::Mixed { colour });
                        let geometry = geometry_of(&mut geometries, space.into());
                        let part = Separable::new(gp, geometry, placement)?;
                        parts.push(Part::Separable(Box::new(part)));
                    }
                }
                DeviceForm::KernelSum(all) => {
                    for sum in all.sums {
                        geometry_of(&mut geometries, sum.space);
                        parts.push(Part::KernelSum(sum, first));
                    }
                    constants.iter_mut().zip(all.constants).for_each(|(sum, constant)| *sum += constant);
                }
                _ => return Err(Error::NoShader { what: format!("the {} solver", posterior.solver()) }),
            }
        }
        if geometries.is_empty() {
            geometry_of(&mut geometries, model.space());
        }
        let (_, geometry) = geometries.remove(0);
        let mut distinct = geometry.distinct().to_vec();
        for (_, other) in &geometries {
            distinct.iter_mut().zip(other.distinct()).for_each(|(least, &n)| *least = n.min(*least));
        }
        Ok(Self { model, parts, constants, geometry, distinct })
    }

    /// Whether any part is mixed into all channels.
    pub(super) fn is_mixed(&self) -> bool {
        let is_mixed = |part: &Part<'_>| match part {
            Part::Separable(part) => matches!(part.placement, Placement::Mixed { .. }),
            Part::KernelSum(..) => false,
        };
        self.parts.iter().any(is_mixed)
    }
}

/// The cells in `space`, which are computed once for each space.
fn geometry_of(known: &mut Vec<(InputSpace, TableGeometry)>, space: InputSpace) -> &TableGeometry {
    let at = known.iter().position(|(other, _)| *other == space).unwrap_or_else(|| {
        known.push((space, TableGeometry::new(space)));
        known.len() - 1
    });
    &known[at].1
}
