//! Sets of measured values.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::base::error::Result;
use crate::brdf::angles::HalfDiff;
use crate::brdf::{Brdf, Rgb};
use crate::sample::lattice::LatticeLayout;
use crate::sample::layout::{Layout, hemisphere_directions, random_cells, random_directions};
use crate::sample::origin::{Provenance, SampleLayout};

/// One measured value of a BRDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Unit direction to the light, above the horizon, in the local frame (normal +z).
    pub wi: Vector3<f64>,
    /// Unit direction to the viewer, above the horizon.
    pub wo: Vector3<f64>,
    /// `f(wi, wo)` in sr^-1, without the cosine. Noise can make the value of a dark sample slightly negative.
    pub value: Rgb,
}

/// Measured values at known directions, to which a model is fitted. Samples keep the order of their source.
///
/// Lists that hold something for each sample are as long as [`SampleSet::angles`] or empty.
/// [`SampleSet::subset`] keeps them aligned.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampleSet {
    /// What the source says about itself; empty if it says nothing.
    pub description: String,
    /// Half-difference angles of each sample.
    pub angles: Vec<HalfDiff>,
    /// `f` in sr^-1 at each of the angles. Noise can make dark values slightly negative.
    pub values: Vec<Rgb>,
    /// The standard deviation of each value, in sr^-1. Empty if the source does not give it.
    pub sigma: Vec<Rgb>,
    /// The line of the source's file that holds each sample, counted from 1. Empty if there is none.
    pub lines: Vec<u64>,
    /// `[wi, wo]` of each sample as measured, including its rotation about the normal. Empty if only the
    /// angles are known.
    pub directions: Vec<[Vector3<f64>; 2]>,
    /// Where the samples come from. If [`Provenance::lattice`] is given, the samples are in the order of its
    /// nodes.
    pub origin: Provenance,
    /// What the user should know about how the source was read, in whole sentences without a full stop.
    pub notices: Vec<String>,
}

impl SampleSet {
    /// Evaluates `brdf` at the directions of a layout, in parallel. Layouts that imitate an instrument give
    /// [`SampleSet::directions`], the others angles only. Only the layout is recorded as the origin;
    /// [`Source::measure`](crate::Source::measure) fills in the rest.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`](crate::Error::InvalidArgument) for an invalid lattice, scan or grid, and
    /// for a number of directions that a layout does not allow.
    pub fn measure(brdf: &dyn Brdf, layout: &Layout) -> Result<Self> {
        let (directions, lattice, kind) = match layout {
            Layout::Lattice(lattice) => {
                lattice.validate()?;
                (Chosen::Angles(lattice.directions()), Some(lattice.clone()), SampleLayout::Lattice)
            }
            Layout::Random { count, seed } => {
                let v_max = LatticeLayout::default().v_max;
                (Chosen::Angles(random_directions(*count, v_max, *seed)), None, SampleLayout::Random)
            }
            Layout::Cells { count, seed } => {
                (Chosen::Angles(random_cells(*count, *seed)), None, SampleLayout::Cells)
            }
            Layout::Hemisphere { count, seed } => {
                (Chosen::Pairs(hemisphere_directions(*count, *seed)?), None, SampleLayout::Hemisphere)
            }
            Layout::InPlane(scan) => (Chosen::Pairs(scan.directions()?), None, SampleLayout::InPlane),
            Layout::Gonio(grid) => (Chosen::Pairs(grid.directions()?), None, SampleLayout::Gonio),
        };
        let (angles, directions) = match directions {
            Chosen::Angles(angles) => (angles, Vec::new()),
            Chosen::Pairs(pairs) => {
                (pairs.iter().map(|[wi, wo]| HalfDiff::from_directions(wi, wo)).collect(), pairs)
            }
        };
        let mut values = vec![[0.0; 3]; angles.len()];
        let blocks = angles.par_chunks(BLOCK).zip(values.par_chunks_mut(BLOCK));
        blocks.for_each(|(angles, values)| brdf.eval_many(angles, values));
        let origin = Provenance { layout: kind, lattice, ..Provenance::default() };
        Ok(Self { angles, values, directions, origin, ..Self::default() })
    }

    /// The number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.angles.len()
    }

    /// Whether the set has no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.angles.is_empty()
    }

    /// The lattice whose nodes are the directions, if there is one. The samples are in the order of its
    /// nodes.
    #[must_use]
    pub fn lattice(&self) -> Option<&LatticeLayout> {
        self.origin.lattice.as_ref()
    }

    /// The samples with these indices, in this order, with everything that is known about each. They lie on no
    /// lattice.
    ///
    /// # Panics
    /// If an index is not below [`SampleSet::len`].
    #[must_use]
    pub fn subset(&self, indices: &[usize]) -> Self {
        fn take<T: Copy>(of: &[T], indices: &[usize]) -> Vec<T> {
            if of.is_empty() { Vec::new() } else { indices.iter().map(|&i| of[i]).collect() }
        }
        let layout = match self.origin.layout {
            SampleLayout::Lattice => SampleLayout::Samples,
            other => other,
        };
        Self {
            description: self.description.clone(),
            angles: take(&self.angles, indices),
            values: take(&self.values, indices),
            sigma: take(&self.sigma, indices),
            lines: take(&self.lines, indices),
            directions: take(&self.directions, indices),
            origin: Provenance { layout, lattice: None, ..self.origin.clone() },
            notices: self.notices.clone(),
        }
    }

    /// Adds a sample of which no more is known than its directions and its value.
    pub(crate) fn push(&mut self, Sample { wi, wo, value }: Sample) {
        self.angles.push(HalfDiff::from_directions(&wi, &wo));
        self.directions.push([wi, wo]);
        self.values.push(value);
    }

    /// The samples one by one. If the measured directions are not known, the half vector is above the x axis.
    pub fn iter(&self) -> impl Iterator<Item = Sample> + '_ {
        self.angles.iter().zip(&self.values).enumerate().map(|(i, (angles, &value))| {
            let [wi, wo] = self.directions.get(i).copied().unwrap_or_else(|| angles.to_directions().into());
            Sample { wi, wo, value }
        })
    }
}

/// What a layout chooses.
enum Chosen {
    Angles(Vec<HalfDiff>),
    /// `[wi, wo]`, with a rotation about the normal.
    Pairs(Vec<[Vector3<f64>; 2]>),
}

/// Number of directions that a task evaluates at a time.
const BLOCK: usize = 256;

impl FromIterator<Sample> for SampleSet {
    fn from_iter<I: IntoIterator<Item = Sample>>(samples: I) -> Self {
        let mut set = Self::default();
        samples.into_iter().for_each(|sample| set.push(sample));
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::angles::direction;

    #[test]
    fn subsets_stay_aligned() {
        let sample = |i: u32| Sample {
            wi: direction(0.1 * f64::from(i), 0.0),
            wo: direction(0.2, 1.0),
            value: [f64::from(i); 3],
        };
        let mut set: SampleSet = (0..5).map(sample).collect();
        set.sigma = set.values.clone();
        set.lines = (10..15).collect();
        let found = set.subset(&[3, 1]);
        assert_eq!(found.values, [[3.0; 3], [1.0; 3]]);
        assert_eq!((found.sigma.clone(), found.lines.clone()), (found.values.clone(), vec![13, 11]));
        assert_eq!(found.iter().next().unwrap(), sample(3));
        set.lines.clear();
        assert!(set.subset(&[0]).lines.is_empty());
    }
}
