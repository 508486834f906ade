//! Where a BRDF comes from: a file of any kind that is read, or a built-in material.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::base::error::{Error, Result};
use crate::brdf::materials::material;
use crate::brdf::table::BrdfTable;
use crate::brdf::{Brdf, Reciprocal};
use crate::formats::cornell::read_cornell;
use crate::formats::merl::read_merl;
use crate::formats::merl_names::merl_material_name;
use crate::formats::rgl::read_rgl;
use crate::formats::samples_csv::read_samples_csv;
use crate::formats::table_exr::read_table_exr;
use crate::formats::{FileKind, recognise, sha256_file};
use crate::model::Model;
use crate::model::bake::bake_mean;
use crate::sample::{Layout, Provenance, SampleSet};

/// RGL measurements are extrapolated at grazing angles: asked at a cosine of at least this.
const RGL_MIN_COSINE: f64 = 0.02;

/// Analytic models are defined up to the horizon; this keeps cells at the horizon filled.
const ANALYTIC_MIN_COSINE: f64 = 1e-3;

/// What a source holds.
pub enum Content {
    /// A MERL or OpenEXR table.
    Table(BrdfTable),
    /// A BRDF that can be asked at any directions: an RGL measurement or an analytic model.
    Function(Box<dyn Brdf>),
    /// Scattered measurements.
    Samples(Box<SampleSet>),
    /// A fitted model.
    Model(Box<Model>),
}

impl std::fmt::Debug for Content {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Table(_) => "Table",
            Self::Function(_) => "Function",
            Self::Samples(_) => "Samples",
            Self::Model(_) => "Model",
        })
    }
}

/// A BRDF and what is known about its origin.
#[derive(Debug)]
pub struct Source {
    /// Name of the material: the MERL name where the checksum is a published one, else the file's stem or the name of
    /// the built-in material.
    pub name: String,
    /// What the source says about itself.
    pub description: String,
    /// The kind of source, for people, for example `RGL measurement`.
    pub kind: String,
    /// The file; none for built-in materials.
    pub path: Option<PathBuf>,
    /// sha256 of the file, hexadecimal; empty for built-in materials.
    pub sha256: String,
    /// What it holds.
    pub content: Content,
}

impl Source {
    /// Reads a file; its kind is recognised by content.
    ///
    /// # Errors
    /// A file that cannot be read, is of no known kind, or is damaged.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let kind = recognise(path)?;
        let mut description = String::new();
        let content = match kind {
            FileKind::Merl => Content::Table(read_merl(path)?),
            FileKind::TableExr => Content::Table(read_table_exr(path)?),
            FileKind::Rgl => {
                let inner = read_rgl(path)?;
                inner.description().clone_into(&mut description);
                Content::Function(Box::new(Reciprocal { inner, min_cosine: RGL_MIN_COSINE }))
            }
            FileKind::SamplesCsv => Content::Samples(Box::new(read_samples_csv(path)?)),
            FileKind::Cornell => Content::Samples(Box::new(read_cornell(path)?)),
            FileKind::Model => Content::Model(Box::new(Model::load(path)?)),
        };
        let sha256 = sha256_file(path)?;
        let stem = || path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        let mut name = merl_material_name(&sha256).map_or_else(stem, str::to_owned);
        if let Content::Model(model) = &content {
            name.clone_from(&model.provenance.material);
            description = format!("model of {}", model.provenance.source);
        }
        let mut source =
            Self { name, description, kind: kind.to_string(), path: Some(path.to_owned()), sha256, content };
        let origin = source.provenance();
        if let Content::Samples(samples) = &mut source.content {
            source.description.clone_from(&samples.description);
            samples.origin = origin;
        }
        Ok(source)
    }

    /// A built-in material by name.
    ///
    /// # Errors
    /// A name that none has.
    pub fn built_in(name: &str) -> Result<Self> {
        let found = material(name)?;
        Ok(Self {
            name: found.name.to_owned(),
            description: format!("{}; {}", found.description, found.source),
            kind: "built-in material".to_owned(),
            path: None,
            sha256: String::new(),
            content: Content::Function(Box::new(Reciprocal {
                inner: found.brdf,
                min_cosine: ANALYTIC_MIN_COSINE,
            })),
        })
    }

    /// The source as a BRDF that can be evaluated at any directions.
    ///
    /// # Errors
    /// Scattered samples, which say nothing between them.
    pub fn brdf(&self) -> Result<&dyn Brdf> {
        match &self.content {
            Content::Table(table) => Ok(table),
            Content::Function(brdf) => Ok(brdf.as_ref()),
            Content::Model(model) => Ok(model.as_ref()),
            Content::Samples(_) => Err(self.scattered()),
        }
    }

    /// The source as a table, baked or tabulated where it is none.
    ///
    /// # Errors
    /// Scattered samples.
    pub fn table(&self) -> Result<Cow<'_, BrdfTable>> {
        match &self.content {
            Content::Table(table) => Ok(Cow::Borrowed(table)),
            Content::Function(brdf) => Ok(Cow::Owned(BrdfTable::from_fn(|a| brdf.eval_half_diff(a)))),
            Content::Model(model) => Ok(Cow::Owned(bake_mean(model))),
            Content::Samples(_) => Err(self.scattered()),
        }
    }

    /// What it says where a BRDF is needed and the source is scattered samples.
    fn scattered(&self) -> Error {
        Error::Unsuitable {
            what: self.origin(),
            expected: "a BRDF that can be evaluated at any directions",
            found: "scattered samples; bake them first",
        }
    }

    /// The scattered measurements of the source.
    ///
    /// # Errors
    /// A source that is no set of samples.
    pub fn samples(&self) -> Result<&SampleSet> {
        match &self.content {
            Content::Samples(samples) => Ok(samples),
            _ => Err(Error::Unsuitable {
                what: self.origin(),
                expected: "scattered samples",
                found: "a BRDF that can be evaluated at any directions; measure it with a layout",
            }),
        }
    }

    /// Evaluates the source at the directions of a layout; the samples know where they come from.
    ///
    /// # Errors
    /// Scattered samples, or a broken layout.
    pub fn measure(&self, layout: &Layout) -> Result<SampleSet> {
        let samples = SampleSet::measure(self.brdf()?, layout)?;
        let Provenance { layout, lattice, .. } = samples.origin;
        let origin = Provenance { layout, lattice, ..self.provenance() };
        Ok(SampleSet { description: self.description.clone(), origin, ..samples })
    }

    /// Name, file and checksum, for what is made of the source.
    #[must_use]
    pub fn provenance(&self) -> Provenance {
        Provenance {
            material: self.name.clone(),
            source: self.origin(),
            sha256: self.sha256.clone(),
            ..Provenance::default()
        }
    }

    /// The file's path or `built-in NAME`, for reports.
    #[must_use]
    pub fn origin(&self) -> String {
        self.path
            .as_ref()
            .map_or_else(|| format!("built-in {}", self.name), |path| path.display().to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::angles::HalfDiff;
    use crate::test_data::data_dir;

    #[test]
    fn built_in_materials_are_filled_up_to_the_horizon() {
        let source = Source::built_in("cherry-235").unwrap();
        let table = source.table().unwrap();
        assert!(table.values().iter().flatten().all(|x| x.is_finite() && *x >= 0.0));
        let angles = HalfDiff { theta_h: 0.3, theta_d: 0.4, phi_d: 1.0 };
        assert!(source.brdf().unwrap().eval_half_diff(angles)[0] > 0.0);
        assert!(Source::built_in("cherry").is_err());
    }

    #[test]
    fn files_are_opened_by_content() {
        let Some(dir) = data_dir() else { return };
        let rgl = Source::open(&dir.join("rgl/paper_blue_rgb.bsdf")).unwrap();
        assert_eq!((rgl.name.as_str(), rgl.kind.as_str()), ("paper_blue_rgb", "RGL measurement"));
        assert!(rgl.description.contains("Blue A4 paper") && rgl.sha256.len() == 64);
        let cornell = Source::open(&dir.join("cornell/cayman.brdf")).unwrap();
        assert!(cornell.brdf().is_err() && cornell.table().is_err());
        assert!(Source::open(&dir.join("rgl/absent.bsdf")).is_err());
    }
}
