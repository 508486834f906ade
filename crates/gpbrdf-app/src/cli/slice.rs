//! `gpbrdf-cli slice`: draws a BRDF at one `phi_d`.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::{Args, value_parser};
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::figure::{Slice, SliceOptions, slice_figure};
use gpbrdf_core::formats::write_image_exr;
use gpbrdf_core::{Brdf, BrdfTable};

use super::input::open;
use super::reading::Reading;
use super::terminal::Terminal;

#[derive(Args, Debug)]
pub(crate) struct SliceCommand {
    /// A measurement, table or model file, or the name of a built-in material.
    input: PathBuf,
    /// Picture to write: .png (as shown) or .exr (values in 1/sr).
    #[arg(short, long, value_name = "FILE", default_value = "slice.png")]
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
    #[arg(long, value_name = "PIXELS", default_value_t = 256, value_parser = value_parser!(u32).range(8..=4096))]
    size: u32,
}

impl SliceCommand {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let raw = match self.output.extension() {
            Some(png) if png.eq_ignore_ascii_case("png") => false,
            Some(exr) if exr.eq_ignore_ascii_case("exr") => true,
            _ => bail!("\"{}\": expected a name that ends in .png or .exr", self.output.display()),
        };
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
        let truth = self
            .difference
            .as_deref()
            .map(|t| anyhow::Ok(open(t, Reading::default(), terminal)?.table()?.into_owned()))
            .transpose()?;
        if raw {
            write_exr(&self.output, &prediction, truth.as_ref(), &options)?;
        } else {
            let truth = truth.as_ref().map(|t| t as &dyn Brdf);
            let picture = slice_figure(&source.name, truth, &prediction, &options)?;
            let mut file = AtomicFile::create(&self.output)?;
            picture.write_png(&mut file)?;
            file.commit()?;
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
