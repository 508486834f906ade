//! `gpbrdf-cli convert`: writes any source as `.binary`, `.exr`, `.bsdf`, `.csv`, Zemax `.bsdf` or a texture.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use gpbrdf_core::formats::{
    ExrChannels, ExrPart, RglBrdf, RglColours, RglGrid, SpecularGrid, SpecularTable, TextureFormat,
    write_merl, write_rgl, write_samples_csv, write_table_exr, write_texture, write_zemax,
};
use gpbrdf_core::{Baked, Content, LatticeLayout, Layout, SampleSet, Source, Symmetry, detect_symmetry};

use super::input::open;
use super::reading::Reading;
use super::terminal::Terminal;

#[derive(Args, Debug)]
pub(crate) struct Convert {
    /// A measurement, table or model file, the name of a built-in material, or - for measured samples from
    /// standard input.
    input: PathBuf,
    #[command(flatten)]
    reading: Reading,
    /// File to write: .binary (MERL table), .exr (table), .bsdf (RGL file), .csv (samples), .dds, .ktx2, .npy or
    /// .bin (texture), or with --format any name.
    output: PathBuf,
    /// What to write [default: what the name of the output says]
    #[arg(long, value_enum, value_name = "FORMAT")]
    format: Option<Written>,
    /// Write colours of an RGL file as linear sRGB, for RGB variants of Mitsuba 3; spectra are for all others.
    #[arg(long)]
    rgb: bool,
    /// Number of samples of a .csv from a source that can be evaluated at any direction.
    #[arg(long, value_name = "N", default_value_t = 3072)]
    samples: usize,
}

/// The formats that can be written.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Written {
    /// A MERL table.
    Merl,
    /// A table as OpenEXR.
    Exr,
    /// An RGL file, for Mitsuba 3 (`measured`) and pbrt-v4 (`"measured"`).
    Rgl,
    /// Samples, with their standard deviation where it is known.
    Csv,
    /// A 3-D texture in the order of the lookup shader, as DirectDraw surface.
    Dds,
    /// The same as Khronos texture.
    Ktx2,
    /// The same as array of NumPy.
    Npy,
    /// The same without a header, and a JSON file that describes it.
    Raw,
    /// The tabular BSDF of Zemax: samples on its grid as they are, other sources at incidences and azimuths in
    /// steps of 5 degrees and 41 angles from the specular direction.
    Zemax,
}

impl Written {
    /// The format that the name of a file says.
    fn of(path: &Path) -> Result<Self> {
        if let Some(format) = TextureFormat::of(path) {
            return Ok(match format {
                TextureFormat::Dds => Self::Dds,
                TextureFormat::Ktx2 => Self::Ktx2,
                TextureFormat::Npy => Self::Npy,
                TextureFormat::Raw => Self::Raw,
            });
        }
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        Ok(match extension.as_str() {
            "binary" => Self::Merl,
            "exr" => Self::Exr,
            "bsdf" => Self::Rgl,
            "csv" => Self::Csv,
            _ => bail!(
                "\"{}\": expected a name that ends in .binary, .exr, .bsdf, .csv, .dds, .ktx2, .npy or .bin",
                path.display()
            ),
        })
    }
}

impl Convert {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let format = self.format.map_or_else(|| Written::of(&self.output), Ok)?;
        if self.rgb && !matches!(format, Written::Rgl) {
            bail!("--rgb: expected an RGL file as output, found \"{}\"", self.output.display());
        }
        let source = open(&self.input, self.reading, terminal)?;
        match format {
            Written::Merl => {
                let table = terminal.stage("Tabulating", || source.table())?;
                write_merl(&self.output, &table)?;
            }
            Written::Exr => {
                let table = terminal.stage("Tabulating", || source.table())?;
                let part = ExrPart {
                    name: "mean",
                    description: &source.name,
                    unit: "sr^-1",
                    channels: ExrChannels::Rgb(table.values()),
                };
                write_table_exr(&self.output, &[part])?;
            }
            Written::Rgl => {
                let brdf = source.brdf()?;
                let table = terminal.stage("Tabulating", || {
                    RglBrdf::tabulate(brdf, RglGrid::default(), description(&source))
                })?;
                let colours = if self.rgb { RglColours::Rgb } else { RglColours::Spectral };
                write_rgl(&self.output, &table, colours)?;
            }
            Written::Csv => write_samples_csv(&self.output, &*self.measure(&source, terminal)?)?,
            Written::Dds => self.write_texture(&source, TextureFormat::Dds, terminal)?,
            Written::Ktx2 => self.write_texture(&source, TextureFormat::Ktx2, terminal)?,
            Written::Npy => self.write_texture(&source, TextureFormat::Npy, terminal)?,
            Written::Raw => self.write_texture(&source, TextureFormat::Raw, terminal)?,
            Written::Zemax => {
                let table = terminal.stage("Sampling", || specular_table(&source))?;
                write_zemax(&self.output, &table)?;
            }
        }
        terminal.summary(&format!("wrote {}", self.output.display()))
    }

    /// A texture of the source. Alpha is the standard deviation of a model, else 0.
    fn write_texture(&self, source: &Source, format: TextureFormat, terminal: &Terminal) -> Result<()> {
        if let Content::Model(model) = &source.content {
            let baked = terminal.stage("Baking", || Baked::new(model))?;
            return Ok(write_texture(&self.output, format, &baked.mean, Some(&baked.sigma))?);
        }
        let table = terminal.stage("Tabulating", || source.table())?;
        Ok(write_texture(&self.output, format, &table, None)?)
    }

    /// The samples of the source, or samples of it on a lattice.
    fn measure<'a>(&self, source: &'a Source, terminal: &Terminal) -> Result<Cow<'a, SampleSet>> {
        if let Content::Samples(samples) = &source.content {
            return Ok(Cow::Borrowed(samples));
        }
        let symmetry = detect_symmetry(source.brdf()?);
        let layout = Layout::Lattice(LatticeLayout::with_samples(self.samples, symmetry)?);
        Ok(Cow::Owned(terminal.stage("Sampling", || source.measure(&layout))?))
    }
}

/// The source about the specular direction: its samples if it has any, else its values on a fine grid.
fn specular_table(source: &Source) -> Result<SpecularTable> {
    if let Content::Samples(samples) = &source.content {
        return Ok(SpecularTable::from_samples(samples)?);
    }
    let brdf = source.brdf()?;
    let grid = SpecularGrid::fine(detect_symmetry(brdf) == Symmetry::Bilateral);
    Ok(SpecularTable::measure(brdf, grid, description(source)))
}

/// What a file says about its material.
fn description(source: &Source) -> String {
    match &source.content {
        Content::Model(_) | Content::Table(_) => source.name.clone(),
        _ => source.description.clone(),
    }
}
