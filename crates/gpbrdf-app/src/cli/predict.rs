//! `gpbrdf-cli predict`: values with intervals at given directions.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::formats::{parse_directions_csv, read_directions_csv};
use gpbrdf_core::{IntervalOf, Model};

use super::input::{STANDARD_INPUT, is_standard_input, standard_input};
use super::reading::Reading;
use super::terminal::Terminal;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli predict model.safetensors directions.csv -o values.csv",
))]
pub(crate) struct Predict {
    /// Model file.
    model: PathBuf,
    /// CSV file of directions, or - for standard input: theta_i,phi_i,theta_o,phi_o or theta_h,theta_d,phi_d,
    /// in degrees unless the header says otherwise.
    directions: PathBuf,
    #[command(flatten)]
    reading: Reading,
    /// CSV file to write instead of standard output.
    #[arg(help_heading = "Output", short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Give intervals of the noise-free value instead of those of a new measurement.
    #[arg(long)]
    latent: bool,
}

impl Predict {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let model = Model::load(&self.model)?;
        let options = self.reading.options();
        let directions = if is_standard_input(&self.directions) {
            parse_directions_csv(&standard_input()?, STANDARD_INPUT, &options)?
        } else {
            read_directions_csv(&self.directions, &options)?
        };
        let of = if self.latent { IntervalOf::Latent } else { IntervalOf::Observation };
        let predictions = terminal.stage("Predicting", || model.predict(&directions.angles, of))?;
        let mut text = directions.columns.join(",");
        for part in ["", "_lower", "_upper"] {
            for channel in ["r", "g", "b"] {
                text.push_str(&format!(",{channel}{part}"));
            }
        }
        text.push('\n');
        for (row, p) in directions.rows.iter().zip(&predictions) {
            text.push_str(&row.join(","));
            for value in p.mean.iter().chain(&p.lower).chain(&p.upper) {
                text.push_str(&format!(",{value:e}"));
            }
            text.push('\n');
        }
        match &self.output {
            None => terminal.print(&text),
            Some(path) => {
                let mut file = AtomicFile::create(path)?;
                file.write_all(text.as_bytes())
                    .with_context(|| format!("cannot write \"{}\"", path.display()))?;
                file.commit()?;
                terminal.summary(&format!("wrote {} predictions to {}", predictions.len(), path.display()))
            }
        }
    }
}
