//! The source of a BRDF: a file of any format that can be read, or a built-in material.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::base::error::{Error, Result};
use crate::brdf::materials::material;
use crate::brdf::table::BrdfTable;
use crate::brdf::{Brdf, Reciprocal};
use crate::formats::format::{Reader, recognise_bytes};
use crate::formats::measured::{Input, ReadOptions};
use crate::formats::read::{open, read_bytes};
use crate::formats::{merl_material_name, recognise, sha256_file, sha256_hex};
use crate::material::{Material, MaterialOptions};
use crate::model::Model;
use crate::model::bake::bake_mean;
use crate::sample::{Layout, Provenance, SampleSet};

/// Analytic models are evaluated at a cosine of at least this, so that cells at the horizon are filled.
const ANALYTIC_MIN_COSINE: f64 = 1e-3;

/// The largest file of measurements that is read.
const LIMIT_BYTES: u64 = 1 << 30;

/// What a source holds.
pub enum Content {
    /// A table, from a MERL or OpenEXR file.
    Table(BrdfTable),
    /// A BRDF that can be evaluated at any directions: an RGL measurement or an analytic model.
    Function {
        /// The BRDF.
        brdf: Box<dyn Brdf>,
        /// What the source says about itself.
        description: String,
    },
    /// Scattered measurements.
    Samples(Box<SampleSet>),
    /// A fitted model.
    Model(Box<Model>),
}

impl std::fmt::Debug for Content {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Table(_) => "Table",
            Self::Function { .. } => "Function",
            Self::Samples(_) => "Samples",
            Self::Model(_) => "Model",
        })
    }
}

/// A BRDF and what is known about its origin.
#[derive(Debug)]
pub struct Source {
    /// Name of the material: the MERL name if the checksum is a published one, else the stem of the file's
    /// name or the name of the built-in material.
    pub name: String,
    /// What the source says about itself.
    pub description: String,
    /// The kind of source, for people, for example `RGL measurement`.
    pub kind: String,
    /// The file; `None` for built-in materials and for models that no file holds.
    pub path: Option<PathBuf>,
    /// SHA-256 sum of the file, hexadecimal; empty without one.
    pub sha256: String,
    /// What the source holds.
    pub content: Content,
}

/// What a model says about itself.
fn description_of(model: &Model) -> String {
    format!("model of {}", model.provenance.source)
}

impl Source {
    /// Reads a file; its format is recognised by its content.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Format`] for a file that cannot be read or is damaged;
    /// [`Error::UnknownFormat`] for one that has no known format.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::open_with(path, &ReadOptions::default())
    }

    /// Like [`Source::open`]; `options` say how to read measurements that are text. A file that is no regular
    /// one, for example a pipe, is read as by [`Source::parse`].
    ///
    /// # Errors
    /// Those of [`Source::open`], and [`Error::Unsuitable`] if there are options for a file that holds no such
    /// measurements.
    pub fn open_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        let (_, length) = open(path)?;
        if length.is_none() {
            return Self::parse(&read_bytes(path, "text", LIMIT_BYTES)?, path, options);
        }
        let format = recognise(path)?;
        match format.read {
            Reader::File(read) => {
                no_options(path, options)?;
                Ok(Self::read_from(path, format.name, read(path)?, sha256_file(path)?))
            }
            Reader::Samples(_) => Self::parse(&read_bytes(path, format.name, LIMIT_BYTES)?, path, options),
        }
    }

    /// Reads the content of a file of measurements that are text; `name` stands for the file in messages.
    ///
    /// # Errors
    /// Those of [`Source::open_with`]; [`Error::UnknownFormat`] also for tables and models, which are read from
    /// files only.
    pub fn parse(bytes: &[u8], name: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let name = name.as_ref();
        let format = recognise_bytes(bytes, bytes.len() as u64, name)?;
        match format.read {
            Reader::File(_) => Err(Error::UnknownFormat {
                path: name.to_owned(),
                expected: "measurements as text, or the name of a regular file".to_owned(),
                found: format.file.to_owned(),
            }),
            Reader::Samples(read) => {
                let samples = read(Input { format: format.name, path: name, bytes, options })?;
                let content = Content::Samples(Box::new(samples));
                Ok(Self::read_from(name, format.name, content, sha256_hex(bytes)))
            }
        }
    }

    /// A source that was read.
    fn read_from(path: &Path, kind: &str, content: Content, sha256: String) -> Self {
        let stem = || path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        let mut name = merl_material_name(&sha256).map_or_else(stem, str::to_owned);
        let description = match &content {
            Content::Table(_) => String::new(),
            Content::Function { description, .. } => description.clone(),
            Content::Samples(samples) => samples.description.clone(),
            Content::Model(model) => {
                name.clone_from(&model.provenance.material);
                description_of(model)
            }
        };
        let mut source =
            Self { name, description, kind: kind.to_owned(), path: Some(path.to_owned()), sha256, content };
        let origin = source.provenance();
        if let Content::Samples(samples) = &mut source.content {
            samples.origin = origin;
        }
        source
    }

    /// What the user should know about how the source was read.
    #[must_use]
    pub fn notices(&self) -> &[String] {
        match &self.content {
            Content::Samples(samples) => &samples.notices,
            _ => &[],
        }
    }

    /// The built-in material called `name`.
    ///
    /// # Errors
    /// [`Error::UnknownName`], which lists the names that exist.
    pub fn built_in(name: &str) -> Result<Self> {
        let found = material(name)?;
        let description = format!("{}; {}", found.description, found.source);
        let brdf = Box::new(Reciprocal { inner: found.brdf, min_cosine: ANALYTIC_MIN_COSINE });
        Ok(Self {
            name: found.name.to_owned(),
            description: description.clone(),
            kind: "built-in material".to_owned(),
            path: None,
            sha256: String::new(),
            content: Content::Function { brdf, description },
        })
    }

    /// A model that no file holds. It has the name of its material.
    #[must_use]
    pub fn of_model(model: Model) -> Self {
        Self {
            name: model.provenance.material.clone(),
            description: description_of(&model),
            kind: "model".to_owned(),
            path: None,
            sha256: String::new(),
            content: Content::Model(Box::new(model)),
        }
    }

    /// The source as a BRDF that can be evaluated at any directions.
    ///
    /// # Errors
    /// [`Error::Unsuitable`] for scattered samples, which do not define values between them.
    pub fn brdf(&self) -> Result<&dyn Brdf> {
        match &self.content {
            Content::Table(table) => Ok(table),
            Content::Function { brdf, .. } => Ok(brdf.as_ref()),
            Content::Model(model) => Ok(model.as_ref()),
            Content::Samples(_) => Err(self.scattered()),
        }
    }

    /// The source as a table: a table as it is, a function tabulated, a model baked.
    ///
    /// # Errors
    /// [`Error::Unsuitable`] for scattered samples.
    pub fn table(&self) -> Result<Cow<'_, BrdfTable>> {
        match &self.content {
            Content::Table(table) => Ok(Cow::Borrowed(table)),
            Content::Function { brdf, .. } => Ok(Cow::Owned(BrdfTable::from_fn(|a| brdf.eval_half_diff(a)))),
            Content::Model(model) => Ok(Cow::Owned(bake_mean(model))),
            Content::Samples(_) => Err(self.scattered()),
        }
    }

    /// The source as a material that a renderer evaluates and samples.
    ///
    /// # Errors
    /// [`Error::Unsuitable`] for scattered samples, and those of [`Material::new`].
    pub fn material(&self, options: &MaterialOptions) -> Result<Material> {
        Material::new(self.table()?.into_owned(), options)
    }

    /// The error for scattered samples where a BRDF is needed.
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
    /// [`Error::Unsuitable`] for a source that is not a set of samples.
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

    /// Evaluates the source at the directions of a layout. The samples record where they come from.
    ///
    /// # Errors
    /// [`Error::Unsuitable`] for scattered samples, [`Error::InvalidArgument`] for an invalid layout.
    pub fn measure(&self, layout: &Layout) -> Result<SampleSet> {
        let samples = SampleSet::measure(self.brdf()?, layout)?;
        let Provenance { layout, lattice, .. } = samples.origin;
        let origin = Provenance { layout, lattice, ..self.provenance() };
        Ok(SampleSet { description: self.description.clone(), origin, ..samples })
    }

    /// Name, file and checksum of the source, to be recorded in whatever is made from it.
    #[must_use]
    pub fn provenance(&self) -> Provenance {
        Provenance {
            material: self.name.clone(),
            source: self.origin(),
            sha256: self.sha256.clone(),
            ..Provenance::default()
        }
    }

    /// The path of the file, or `built-in NAME` or `model of NAME` without one, for reports.
    #[must_use]
    pub fn origin(&self) -> String {
        match (&self.path, &self.content) {
            (Some(path), _) => path.display().to_string(),
            (None, Content::Model(_)) => self.description.clone(),
            (None, _) => format!("built-in {}", self.name),
        }
    }
}

/// Refuses options for a file that says itself how it is to be read.
fn no_options(path: &Path, options: &ReadOptions) -> Result<()> {
    if *options == ReadOptions::default() {
        return Ok(());
    }
    Err(Error::Unsuitable {
        what: path.display().to_string(),
        expected: "measurements as text, for options about values and angles",
        found: "a format that leaves no choice",
    })
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
        let rgl = Source::open(dir.join("rgl/paper_blue_rgb.bsdf")).unwrap();
        assert_eq!((rgl.name.as_str(), rgl.kind.as_str()), ("paper_blue_rgb", "RGL measurement"));
        assert!(rgl.description.contains("Blue A4 paper") && rgl.sha256.len() == 64);
        let cornell = Source::open(dir.join("cornell/cayman.brdf")).unwrap();
        assert!(cornell.brdf().is_err() && cornell.table().is_err());
        assert!(Source::open(dir.join("rgl/absent.bsdf")).is_err());
    }
}
