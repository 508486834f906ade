//! What the processor computes before a device bakes a model.

use std::sync::Arc;

use gpbrdf_core::Model;
use gpbrdf_core::gp::{DeviceForm, KernelSum, LatticeGp, SeparableForm, SeparablePart, TableGeometry};
use gpbrdf_core::sample::InputSpace;

use super::separable::{Functions, Placement, Separable};
use crate::error::{Error, Result};

/// A model as the shaders of the bake read it. It is computed on the processor, so no device is needed yet.
#[derive(Debug)]
pub struct Prepared<'a> {
    pub(super) model: &'a Model,
    pub(super) parts: Vec<Part<'a>>,
    /// What is added to each channel besides its offset.
    pub(super) constants: [f64; 3],
    /// The cells in the space of the first part.
    pub(super) geometry: Arc<TableGeometry>,
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

/// Tables of cells and functions along axes that were computed before, those that were used last.
#[derive(Debug, Default)]
pub(super) struct Known {
    geometries: Vec<(InputSpace, Arc<TableGeometry>)>,
    functions: Vec<Arc<Functions>>,
}

/// The largest number of spaces, and of kernels, that are kept: as many as a model with separate channels or of
/// inducing lattices has, and some more.
const MOST_KEPT: usize = 8;

impl Known {
    /// The cells in `space`.
    fn geometry(&mut self, space: InputSpace) -> Arc<TableGeometry> {
        if let Some((_, known)) = self.geometries.iter().find(|(other, _)| *other == space) {
            return Arc::clone(known);
        }
        let made = Arc::new(TableGeometry::new(space));
        keep(&mut self.geometries, (space, Arc::clone(&made)));
        made
    }

    /// The functions of a lattice in `space`.
    fn functions(&mut self, gp: &LatticeGp, form: &SeparableForm<'_>, space: InputSpace) -> Arc<Functions> {
        if let Some(known) = self.functions.iter().find(|known| known.are_of(gp, space)) {
            return Arc::clone(known);
        }
        let made = Arc::new(Functions::new(gp, form, space, &self.geometry(space)));
        keep(&mut self.functions, Arc::clone(&made));
        made
    }
}

/// Adds to what is kept, in place of the oldest if there are too many.
fn keep<T>(all: &mut Vec<T>, new: T) {
    if all.len() == MOST_KEPT {
        all.remove(0);
    }
    all.push(new);
}

impl<'a> Prepared<'a> {
    /// Prepares a model. The functions of lattices are tabulated here; kernel sums are left to the bake.
    ///
    /// # Errors
    /// [`Error::NoShader`] for a model that no shader can evaluate.
    pub fn new(model: &'a Model) -> Result<Self> {
        Self::with(model, &mut Known::default())
    }

    /// [`Prepared::new`] with what is known from before.
    pub(super) fn with(model: &'a Model, known: &mut Known) -> Result<Self> {
        let mut geometries: Vec<Arc<TableGeometry>> = Vec::new();
        let (mut parts, mut constants) = (Vec::new(), [0.0; 3]);
        for (first, posterior) in model.posteriors() {
            match posterior.device_form() {
                DeviceForm::Separable(summands) => {
                    for SeparablePart { gp, space, colour } in summands {
                        let placement = colour
                            .map_or(Placement::Channels { first }, |colour| Placement::Mixed { colour });
                        let form = SeparableForm::new(gp)?;
                        let functions = known.functions(gp, &form, space.into());
                        geometries.push(known.geometry(space.into()));
                        let part = Separable::new(gp, &form, functions, placement);
                        parts.push(Part::Separable(Box::new(part)));
                    }
                }
                DeviceForm::KernelSum(all) => {
                    for sum in all.sums {
                        geometries.push(known.geometry(sum.space));
                        parts.push(Part::KernelSum(sum, first));
                    }
                    constants.iter_mut().zip(all.constants).for_each(|(sum, constant)| *sum += constant);
                }
                _ => return Err(Error::NoShader { what: format!("the {} solver", posterior.solver()) }),
            }
        }
        let geometry = geometries.first().map_or_else(|| known.geometry(model.space()), Arc::clone);
        let mut distinct = geometry.distinct().to_vec();
        for other in &geometries {
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
