//! `gpbrdf-cli convert`: writes any source as `.binary`, `.exr` or `.csv`.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use gpbrdf_core::formats::{ExrChannels, ExrPart, write_merl, write_samples_csv, write_table_exr};
use gpbrdf_core::{Content, LatticeLayout, Layout, detect_symmetry};

use super::input::open;
use super::terminal::Terminal;

#[derive(Args, Debug)]
pub(crate) struct Convert {
    /// A measurement, table or model file, or the name of a built-in material.
    input: PathBuf,
    /// File to write: .binary (MERL table), .exr (table) or .csv (samples).
    output: PathBuf,
    /// Number of samples of a .csv from a source that can be evaluated at any direction.
    #[arg(long, value_name = "N", default_value_t = 3072)]
    samples: usize,
}

impl Convert {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let source = open(&self.input)?;
        let extension = self.output.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        match extension.as_str() {
            "binary" | "exr" => {
                let table = terminal.stage("Tabulating", || source.table())?;
                if extension == "binary" {
                    write_merl(&self.output, &table)?;
                } else {
                    let part = ExrPart {
                        name: "mean",
                        description: &source.name,
                        unit: "sr^-1",
                        channels: ExrChannels::Rgb(table.values()),
                    };
                    write_table_exr(&self.output, &[part])?;
                }
            }
            "csv" => {
                let measured;
                let samples = if let Content::Samples(samples) = &source.content {
                    samples
                } else {
                    let symmetry = detect_symmetry(source.brdf()?);
                    let layout = Layout::Lattice(LatticeLayout::with_samples(self.samples, symmetry)?);
                    measured = terminal.stage("Sampling", || source.measure(&layout))?;
                    &measured
                };
                write_samples_csv(&self.output, samples)?;
            }
            _ => bail!("\"{}\": expected a name that ends in .binary, .exr or .csv", self.output.display()),
        }
        terminal.summary(&format!("wrote {}", self.output.display()))
    }
}
