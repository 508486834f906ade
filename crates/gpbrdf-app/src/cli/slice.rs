//! `gpbrdf-cli slice`: draws a BRDF at one `phi_d`.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::{Args, value_parser};
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::figure::{Slice, SliceOptions, slice_figure};
use gpbrdf_core::formats::write_image_exr;
use gpbrdf_core::{Brdf, BrdfTable, Content};

use super::figure_args::{FigureSize, PictureFile, title};
use super::input::open;
use super::reading::Reading;
use super::terminal::Terminal;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli slice model.safetensors --difference satin_purple.bsdf -o slice.pdf",
    "\n  gpbrdf-cli slice phong --phi-d 0 --exposure 2 --width 85 -o slice.svg",
))]
pub(crate) struct SliceCommand {
    /// A measurement, table or model file, or the name of a built-in material.
    input: PathBuf,
    /// Figure to write, .png, .svg or .pdf, or values in 1/sr, .exr.
    #[arg(help_heading = "Output", short, long, value_name = "FILE", default_value = "slice.png")]
    output: PathBuf,
    /// phi_d in degrees; at 90 every direction is above the horizon.
    #[arg(long, value_name = "DEGREES", default_value_t = 90.0, allow_hyphen_values = true)]
    phi_d: f64,
    /// Exposure in stops.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_hyphen_values = true)]
    exposure: f64,
    /// Space theta_h by its square root, as the table does.
    #[arg(long)]
    square_theta_h: bool,
    /// Show a truth beside it, and their difference.
    #[arg(long, value_name = "TRUTH")]
    difference: Option<PathBuf>,
    /// Rows and columns of a slice.
    #[arg(long, value_name = "PIXELS", default_value_t = 512, value_parser = value_parser!(u32).range(8..=4096))]
    size: u32,
    #[command(flatten)]
    figure_size: FigureSize,
}

impl SliceCommand {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let file = PictureFile::of(&self.output)?;
        for (what, value) in [("--phi-d", self.phi_d), ("--exposure", self.exposure)] {
            if !value.is_finite() {
                bail!("{what}: expected a finite number, found {value}");
            }
        }
        let options = SliceOptions {
            phi_d: self.phi_d.to_radians(),
            exposure: self.exposure,
            square_theta_h: self.square_theta_h,
            size: self.size as usize,
            ..SliceOptions::default()
        };
        let source = open(&self.input, Reading::default(), terminal)?;
        let prediction = source.table()?.into_owned();
        let reference =
            self.difference.as_deref().map(|path| open(path, Reading::default(), terminal)).transpose()?;
        let truth = reference.as_ref().map(|source| anyhow::Ok(source.table()?.into_owned())).transpose()?;
        match file {
            PictureFile::Exr => write_exr(&self.output, &prediction, truth.as_ref(), &options)?,
            PictureFile::Figure(_) => {
                let shown = match &source.content {
                    Content::Model(model) => title(&source.name, model),
                    _ => source.name.clone(),
                };
                let against = reference.map_or_else(String::new, |truth| format!(", against {}", truth.name));
                let truth = truth.as_ref().map(|t| t as &dyn Brdf);
                let figure = slice_figure(&format!("{shown}{against}"), truth, &prediction, &options)?;
                figure.save(&self.output, &self.figure_size.into())?;
            }
        }
        terminal.summary(&format!("wrote {}", self.output.display()))
    }
}

/// Writes the values of the slice, or prediction minus truth, as linear RGB.
fn write_exr(
    path: &Path,
    prediction: &BrdfTable,
    truth: Option<&BrdfTable>,
    options: &SliceOptions,
) -> Result<()> {
    let mut values = Slice::new(prediction, options).values().to_vec();
    if let Some(truth) = truth {
        for (value, truth) in values.iter_mut().zip(Slice::new(truth, options).values()) {
            (0..3).for_each(|c| value[c] -= truth[c]);
        }
    }
    let mut file = AtomicFile::create(path)?;
    write_image_exr(&mut file, options.size, options.size, &values)?;
    file.commit()?;
    Ok(())
}
