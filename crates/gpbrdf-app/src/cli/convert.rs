//! `gpbrdf-cli convert`: writes any source as `.binary`, `.exr`, `.bsdf`, `.csv`, Zemax `.bsdf` or a texture.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use gpbrdf_core::formats::{OutputFormat, OutputOptions, RglColours, TextureFormat};

use super::input::open;
use super::reading::Reading;
use super::terminal::Terminal;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli convert satin_purple.bsdf satin_purple.binary",
    "\n  gpbrdf-cli convert model.safetensors table.dds",
))]
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
    #[arg(help_heading = "Output", long, value_enum, value_name = "FORMAT")]
    format: Option<Written>,
    /// Write colours of an RGL file as linear sRGB, for RGB variants of Mitsuba 3; spectra are for all others.
    #[arg(help_heading = "Output", long)]
    rgb: bool,
    /// Number of samples of a .csv from a source that can be evaluated at any direction.
    #[arg(help_heading = "Output", long, value_name = "N", default_value_t = OutputOptions::default().samples)]
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

impl From<Written> for OutputFormat {
    fn from(written: Written) -> Self {
        match written {
            Written::Merl => Self::Merl,
            Written::Exr => Self::Exr,
            Written::Rgl => Self::Rgl,
            Written::Csv => Self::Csv,
            Written::Dds => Self::Texture(TextureFormat::Dds),
            Written::Ktx2 => Self::Texture(TextureFormat::Ktx2),
            Written::Npy => Self::Texture(TextureFormat::Npy),
            Written::Raw => Self::Texture(TextureFormat::Raw),
            Written::Zemax => Self::Zemax,
        }
    }
}

impl Convert {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let format =
            self.format.map_or_else(|| OutputFormat::of(&self.output), |format| Ok(format.into()))?;
        if self.rgb && format != OutputFormat::Rgl {
            bail!("--rgb: expected an RGL file as output, found \"{}\"", self.output.display());
        }
        let source = open(&self.input, self.reading, terminal)?;
        let colours = if self.rgb { RglColours::Rgb } else { RglColours::Spectral };
        let options = OutputOptions { colours, samples: self.samples };
        terminal.stage("Converting", || source.write(&self.output, format, &options))?;
        terminal.summary(&format!("wrote {}", self.output.display()))
    }
}
