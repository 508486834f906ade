//! `gpbrdf-cli bake`: measures a source, fits and bakes a model, compares it with the truth and writes it
//! all.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use gpbrdf_core::formats::TextureFormat;

use super::input::open;
use super::making::{Making, Product, Wanted};
use super::terminal::Terminal;
use crate::job::{Run, Stage};
use crate::output::OutputFolder;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli bake satin_purple.bsdf -o out",
    "\n  gpbrdf-cli bake measured.csv --values factor --prior none",
    "\n  gpbrdf-cli bake cherry-235 --samples 3000 --figures pdf --width 85",
))]
pub(crate) struct Bake {
    /// A measurement, table or model file, the name of a built-in material, or - for measured samples from
    /// standard input.
    #[arg(default_value = "cherry-235")]
    input: PathBuf,
    #[command(flatten)]
    making: Making,
    /// Folder for the outputs; made if need be.
    #[arg(help_heading = "Output", short, long, value_name = "DIR", default_value = "gpbrdf-out")]
    output: PathBuf,
    /// Write the baked table as a 3-D texture, too, in the order of the lookup shader: .dds, .ktx2, .npy or .bin.
    /// May be repeated.
    #[arg(help_heading = "Output", long, value_name = "FILE", value_parser = texture_path)]
    texture: Vec<PathBuf>,
    /// Write no pictures.
    #[arg(help_heading = "Output", long)]
    no_images: bool,
    /// Print the report as JSON on standard output, and nothing else there.
    #[arg(help_heading = "Output", long)]
    json: bool,
}

impl Bake {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let mut run = Run::new(terminal.clone());
        OutputFolder::check(&self.output)?;
        let source = run.stage(Stage::Load, || open(&self.input, self.making.reading, terminal))?;
        let environment = self.making.environment()?;
        let products =
            Product::USUAL.into_iter().filter(|product| !(self.no_images && product.is_picture())).collect();
        let wanted = Wanted { folder: &self.output, products, textures: self.texture.clone() };
        let (report, _) = self.making.make(&mut run, &source, &environment, wanted)?;
        terminal.report(&report, self.json)
    }
}

/// The name of a texture, whose end says its format.
fn texture_path(name: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(name);
    match TextureFormat::of(&path) {
        Some(_) => Ok(path),
        None => Err("expected a name that ends in .dds, .ktx2, .npy or .bin".to_owned()),
    }
}
