//! Measuring a source.

use std::sync::Arc;

use anyhow::{Result, bail};
use gpbrdf_core::{Brdf, Content, Layout, SampleSet, Solver, Source, Symmetry, detect_symmetry};

use super::choices::{LayoutChoice, SymmetryChoice};
use super::forecast::forecast;
use super::run::Observer;
use super::spec::ModelSpec;

/// What the measurements of one source depend on: two specifications with the same key have the same samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SampleKey {
    layout: LayoutChoice,
    lattice: Option<[usize; 3]>,
    samples: Option<usize>,
    seed: Option<u64>,
    symmetry: SymmetryChoice,
    node_density: Option<f64>,
}

impl ModelSpec {
    /// What the samples depend on: nothing that leaves them alone is in it.
    pub(crate) fn sample_key(&self) -> SampleKey {
        let on_lattice = self.layout == LayoutChoice::Lattice;
        SampleKey {
            layout: self.layout,
            lattice: self.lattice.filter(|_| on_lattice),
            samples: self.samples.filter(|_| !on_lattice || self.lattice.is_none()),
            seed: (!on_lattice).then_some(self.seed),
            symmetry: self.symmetry,
            node_density: self.node_density,
        }
    }
}

/// Measurements, and the symmetry that a model of them may rely on.
#[derive(Clone, Debug)]
pub(crate) struct Measured {
    pub(crate) samples: Arc<SampleSet>,
    pub(super) symmetry: Symmetry,
    key: SampleKey,
}

impl Measured {
    /// Whether these are the samples that `spec` asks for.
    pub(super) fn serves(&self, spec: &ModelSpec) -> bool {
        self.key == spec.sample_key()
    }

    /// Measures a source; a dense fit that will not fit in memory is refused before.
    ///
    /// # Errors
    /// A source without data, a broken layout, or too many samples for a dense fit.
    pub(super) fn new(source: &Source, spec: &ModelSpec, observer: &dyn Observer) -> Result<Self> {
        let announce = |samples: usize| {
            let note = forecast(samples, spec.solver, spec.per_channel)?;
            note.iter().for_each(|note| observer.note(note));
            anyhow::Ok(())
        };
        let key = spec.sample_key();
        if let Content::Samples(samples) = &source.content {
            announce(samples.len())?;
            samples.blind_spots().iter().for_each(|spot| observer.note(spot));
            let symmetry = match spec.symmetry {
                SymmetryChoice::Auto | SymmetryChoice::Bilateral => Symmetry::Bilateral,
                SymmetryChoice::Reciprocal => Symmetry::Reciprocal,
            };
            return Ok(Self { samples: Arc::new((**samples).clone()), symmetry, key });
        }
        let brdf = source.brdf()?;
        if let Content::Table(table) = &source.content
            && !table.values().iter().any(|v| v.iter().all(|&x| x >= 0.0))
        {
            bail!("{}: expected data in at least one cell, found none", source.origin());
        }
        let symmetry = symmetry(spec, brdf, observer);
        let layout = spec.layout(symmetry)?;
        match &layout {
            Layout::Lattice(lattice) if spec.solver == Solver::Dense => announce(lattice.len())?,
            Layout::Lattice(_) => {}
            Layout::Random { count, .. } | Layout::Cells { count, .. } => announce(*count)?,
            Layout::Hemisphere { count, .. } => announce(*count)?,
            Layout::InPlane(scan) => announce(scan.count)?,
            Layout::Gonio(grid) => announce(grid.len())?,
        }
        Ok(Self { samples: Arc::new(source.measure(&layout)?), symmetry, key })
    }
}

/// The symmetry that was asked for, or the measured one.
pub(super) fn symmetry(spec: &ModelSpec, brdf: &dyn Brdf, observer: &dyn Observer) -> Symmetry {
    let symmetry = match spec.symmetry {
        SymmetryChoice::Auto => detect_symmetry(brdf),
        SymmetryChoice::Bilateral => Symmetry::Bilateral,
        SymmetryChoice::Reciprocal => Symmetry::Reciprocal,
    };
    observer.detail(&format!("symmetry: {symmetry:?}"));
    symmetry
}

#[cfg(test)]
mod tests {
    use gpbrdf_core::BrdfTable;

    use super::*;

    struct Silent;
    impl Observer for Silent {}

    /// A material for which `phi_d` and `pi - phi_d` are not alike.
    fn skewed() -> BrdfTable {
        BrdfTable::from_fn(|a| [1.0 + 0.5 * a.theta_h.sin() * a.theta_d.sin() * (2.0 * a.phi_d).sin(); 3])
    }

    fn spec(layout: LayoutChoice) -> ModelSpec {
        ModelSpec { layout, samples: Some(60), ..ModelSpec::default() }
    }

    #[test]
    fn automatic_symmetry_is_measured_on_every_layout() {
        let mut source = Source::built_in("ward").unwrap();
        for layout in [LayoutChoice::Lattice, LayoutChoice::Random, LayoutChoice::Cells] {
            let found = Measured::new(&source, &spec(layout), &Silent).unwrap();
            assert_eq!(found.symmetry, Symmetry::Bilateral, "{layout:?}");
        }
        source.content = Content::Table(skewed());
        for layout in [LayoutChoice::Lattice, LayoutChoice::Random, LayoutChoice::Cells] {
            let found = Measured::new(&source, &spec(layout), &Silent).unwrap();
            assert_eq!(found.symmetry, Symmetry::Reciprocal, "{layout:?}");
            let by_hand = ModelSpec { symmetry: SymmetryChoice::Bilateral, ..spec(layout) };
            let found = Measured::new(&source, &by_hand, &Silent).unwrap();
            assert_eq!(found.symmetry, Symmetry::Bilateral, "{layout:?}");
        }
    }

    #[test]
    fn samples_stay_when_only_the_kernel_changes() {
        let spec = ModelSpec { lattice: Some([9, 8, 7]), ..ModelSpec::default() };
        let mut other = ModelSpec { seed: 9, nu: 2.0, ..spec.clone() };
        other.kernel = "se".parse().unwrap();
        assert_eq!(spec.sample_key(), other.sample_key());
        assert_ne!(spec.sample_key(), ModelSpec { lattice: Some([8; 3]), ..spec.clone() }.sample_key());
        let random = ModelSpec { layout: LayoutChoice::Random, ..spec };
        assert_ne!(random.sample_key(), ModelSpec { seed: 9, ..random.clone() }.sample_key());
    }
}
