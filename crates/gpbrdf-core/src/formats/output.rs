//! Any source in any format that can be written.

use std::borrow::Cow;
use std::path::Path;

use crate::base::error::{Error, Result};
use crate::formats::exr::table::{ExrChannels, ExrPart, write_table_exr};
use crate::formats::measured::text::write::write_samples_csv;
use crate::formats::measured::zemax::{SpecularGrid, SpecularTable, write_zemax};
use crate::formats::merl::write_merl;
use crate::formats::rgl::{RglBrdf, RglColours, RglGrid, write_rgl};
use crate::formats::source::{Content, Source};
use crate::formats::texture::{TextureFormat, write_texture};
use crate::model::Baked;
use crate::sample::{LatticeLayout, Layout, SampleSet, Symmetry, detect_symmetry};

/// The formats that [`Source::write`] writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum OutputFormat {
    /// A MERL table.
    Merl,
    /// A table as `OpenEXR`.
    Exr,
    /// An RGL file.
    Rgl,
    /// Samples as CSV, with their standard deviation where it is known.
    Csv,
    /// A 3-D texture in the order of the lookup shader. Alpha is the standard deviation of a model, else 0.
    Texture(TextureFormat),
    /// The tabular BSDF of Zemax: samples on its grid as they are, other sources at incidences and azimuths in
    /// steps of 5 degrees and 41 angles from the specular direction.
    Zemax,
}

impl OutputFormat {
    /// The format that the end of a file's name says: `.binary`, `.exr`, `.bsdf` (RGL), `.csv`, or one of
    /// [`TextureFormat::of`].
    ///
    /// # Errors
    /// [`Error::UnknownFormat`] for a name with another end.
    pub fn of(path: &Path) -> Result<Self> {
        if let Some(texture) = TextureFormat::of(path) {
            return Ok(Self::Texture(texture));
        }
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        Ok(match extension.as_str() {
            "binary" => Self::Merl,
            "exr" => Self::Exr,
            "bsdf" => Self::Rgl,
            "csv" => Self::Csv,
            _ => {
                return Err(Error::UnknownFormat {
                    path: path.to_owned(),
                    expected: "a name that ends in .binary, .exr, .bsdf, .csv, .dds, .ktx2, .npy or .bin"
                        .into(),
                    found: if extension.is_empty() { "no ending".into() } else { format!(".{extension}") },
                });
            }
        })
    }
}

/// Options of [`Source::write`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputOptions {
    /// The colours of an RGL file.
    pub colours: RglColours,
    /// About how many samples a CSV file holds of a source that can be evaluated at any directions. They lie on a
    /// lattice.
    pub samples: usize,
}

impl Default for OutputOptions {
    fn default() -> Self {
        Self { colours: RglColours::default(), samples: 3072 }
    }
}

impl Source {
    /// Writes the source in a format. Functions are tabulated and models are baked where the format is a table.
    ///
    /// # Errors
    /// [`Error::Unsuitable`] for scattered samples where the format is a table, [`Error::InvalidArgument`] for samples
    /// off the grid of Zemax and for too few samples of a CSV file, [`Error::Io`] when a file cannot be written; no
    /// part of it is left then.
    pub fn write(&self, path: impl AsRef<Path>, format: OutputFormat, options: &OutputOptions) -> Result<()> {
        let path = path.as_ref();
        match format {
            OutputFormat::Merl => write_merl(path, &*self.table()?),
            OutputFormat::Exr => {
                let table = self.table()?;
                let channels = ExrChannels::Rgb(table.values());
                write_table_exr(
                    path,
                    &[ExrPart { name: "mean", description: &self.name, unit: "sr^-1", channels }],
                )
            }
            OutputFormat::Rgl => {
                let table = RglBrdf::tabulate(self.brdf()?, RglGrid::default(), self.said())?;
                write_rgl(path, &table, options.colours)
            }
            OutputFormat::Csv => write_samples_csv(path, &*self.samples_or_lattice(options.samples)?),
            OutputFormat::Texture(texture) => match &self.content {
                Content::Model(model) => {
                    let baked = Baked::new(model)?;
                    write_texture(path, texture, &baked.mean, Some(&baked.sigma))
                }
                _ => write_texture(path, texture, &*self.table()?, None),
            },
            OutputFormat::Zemax => write_zemax(path, &self.specular_table()?),
        }
    }

    /// The samples of the source, or about `count` samples of it on a lattice.
    fn samples_or_lattice(&self, count: usize) -> Result<Cow<'_, SampleSet>> {
        if let Content::Samples(samples) = &self.content {
            return Ok(Cow::Borrowed(samples));
        }
        let symmetry = detect_symmetry(self.brdf()?);
        let layout = Layout::Lattice(LatticeLayout::with_samples(count, symmetry)?);
        Ok(Cow::Owned(self.measure(&layout)?))
    }

    /// The source about the specular direction: its samples if it has any, else its values on a fine grid.
    fn specular_table(&self) -> Result<SpecularTable> {
        if let Content::Samples(samples) = &self.content {
            return SpecularTable::from_samples(samples);
        }
        let brdf = self.brdf()?;
        let grid = SpecularGrid::fine(detect_symmetry(brdf) == Symmetry::Bilateral);
        Ok(SpecularTable::measure(brdf, grid, self.said()))
    }

    /// What a file says about its material.
    fn said(&self) -> String {
        match &self.content {
            Content::Model(_) | Content::Table(_) => self.name.clone(),
            _ => self.description.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_say_what_to_write() {
        let of = |name: &str| OutputFormat::of(Path::new(name));
        assert_eq!(of("a/b.BINARY").unwrap(), OutputFormat::Merl);
        assert_eq!(of("a.ktx2").unwrap(), OutputFormat::Texture(TextureFormat::Ktx2));
        let message = of("a/b.png").unwrap_err().to_string();
        assert!(
            message.starts_with("\"a/b.png\": expected a name") && message.ends_with("found .png"),
            "{message}"
        );
        assert!(of("binary").unwrap_err().to_string().ends_with("found no ending"));
    }

    #[test]
    fn what_is_written_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let source = Source::built_in("red-plastic").unwrap();
        let options = OutputOptions { samples: 100, ..OutputOptions::default() };
        for name in ["t.binary", "t.exr", "t.csv"] {
            let path = folder.path().join(name);
            source.write(&path, OutputFormat::of(&path).unwrap(), &options).unwrap();
            match Source::open(&path).unwrap().content {
                Content::Samples(samples) => {
                    for sample in samples.iter() {
                        let truth = source.brdf().unwrap().eval(&sample.wi, &sample.wo);
                        assert!((sample.value[0] / truth[0] - 1.0).abs() < 1e-3);
                    }
                }
                Content::Table(table) => {
                    let truth = source.table().unwrap();
                    assert!((table.cell(3, 4, 5)[1] / truth.cell(3, 4, 5)[1] - 1.0).abs() < 1e-5);
                }
                other => panic!("{other:?}"),
            }
        }
        let samples = Source::open(folder.path().join("t.csv")).unwrap();
        assert!(samples.write(folder.path().join("u.exr"), OutputFormat::Exr, &options).is_err());
        assert!(!folder.path().join("u.exr").exists());
    }
}
