//! `gpbrdf-cli sample`: simulates what an instrument measures.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::formats::write_samples_csv_to;
use gpbrdf_core::sample::{Disturbance, GonioGrid, InPlaneScan, MIN_DRAWN_COSINE};
use gpbrdf_core::{Layout, SampleSet, Source};

use super::input::open;
use super::reading::Reading;
use super::terminal::Terminal;

/// Directions of `--layout random`.
const RANDOM_COUNT: usize = 1000;

/// The most outliers: a file is recognised by its first 64 KiB, in which the list of them must fit.
const MAX_OUTLIERS: usize = 5000;

/// The directions that an instrument measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Instrument {
    /// Light and viewer drawn uniformly in solid angle, with a cosine of at least 0.05.
    #[default]
    Random,
    /// A scan in the plane of incidence, viewer from -78 to 78 degrees.
    InPlane,
    /// The grid of a goniometer over one half of the hemisphere.
    Gonio,
}

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli sample red-plastic --count 500 --noise 0.02 -o measured.csv",
    "\n  gpbrdf-cli sample ward --layout in-plane | gpbrdf-cli bake -",
))]
pub(crate) struct Sample {
    /// A measurement, table or model file, or the name of a built-in material.
    input: PathBuf,
    /// Where to measure.
    #[arg(long, value_enum, default_value_t)]
    layout: Instrument,
    /// Number of samples: exact with random and in-plane, approximate with gonio. [default: 1000 with random,
    /// 380 with in-plane, 1146 with gonio]
    #[arg(long, value_name = "N")]
    count: Option<usize>,
    /// Angles between light and normal, degrees. [default: 10,25,40,55,70 with in-plane, 0,15,30,45,60,75
    /// with gonio]
    #[arg(long, value_name = "DEG,DEG,...", value_delimiter = ',', allow_hyphen_values = true)]
    incidences: Option<Vec<f64>>,
    /// Relative standard deviation R of the noise: every channel of every value is multiplied by exp(R g), g
    /// standard normal.
    #[arg(long, value_name = "R", default_value_t = Disturbance::default().noise, allow_hyphen_values = true)]
    noise: f64,
    /// Number of samples that are outliers.
    #[arg(long, value_name = "K", default_value_t = Disturbance::default().outliers)]
    outliers: usize,
    /// What outliers are multiplied by.
    #[arg(
        long,
        value_name = "FACTOR",
        default_value_t = Disturbance::default().outlier_factor,
        allow_hyphen_values = true,
        requires = "outliers"
    )]
    outlier_factor: f64,
    /// Seed of random directions, noise and outliers.
    #[arg(long, value_name = "SEED", default_value_t)]
    seed: u64,
    /// CSV file to write; - is standard output.
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

impl Sample {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        if self.outliers > MAX_OUTLIERS {
            bail!("--outliers: expected at most {MAX_OUTLIERS}, found {}", self.outliers);
        }
        let layout = self.layout()?;
        let source = terminal.stage("Loading", || open(&self.input, Reading::default(), terminal))?;
        let to_file = self.output != Path::new("-");
        // Created before the work, so that nobody waits for samples that cannot be written.
        let file = if to_file { Some(AtomicFile::create(&self.output)?) } else { None };
        let mut samples = terminal.stage("Sampling", || source.measure(&layout))?;
        let disturbance = Disturbance {
            noise: self.noise,
            outliers: self.outliers,
            outlier_factor: self.outlier_factor,
            seed: self.seed,
        };
        let outliers = disturbance.apply(&mut samples)?;
        samples.description = self.recipe(&source, &layout, &samples, &outliers);
        match file {
            None => {
                let mut bytes = Vec::new();
                write_samples_csv_to(&mut bytes, &samples)?;
                terminal.print_bytes(&bytes)
            }
            Some(mut file) => {
                let path = self.output.display();
                write_samples_csv_to(&mut file, &samples)
                    .with_context(|| format!("cannot write \"{path}\""))?;
                file.commit()?;
                terminal.summary(&format!("wrote {} samples to {path}", samples.len()))
            }
        }
    }

    fn layout(&self) -> Result<Layout> {
        let Self { count, seed, .. } = *self;
        Ok(match self.layout {
            Instrument::Random => {
                if self.incidences.is_some() {
                    bail!("--incidences: expected --layout in-plane or gonio, found random");
                }
                Layout::Hemisphere { count: count.unwrap_or(RANDOM_COUNT), seed }
            }
            Instrument::InPlane => {
                let default = InPlaneScan::default();
                let incidences = self.incidences.clone().unwrap_or(default.incidences);
                Layout::InPlane(InPlaneScan { incidences, count: count.unwrap_or(default.count) })
            }
            Instrument::Gonio => {
                let default = GonioGrid::default();
                let incidences = self.incidences.clone().unwrap_or(default.incidences);
                Layout::Gonio(match count {
                    Some(count) => GonioGrid::with_count(incidences, count)?,
                    None => GonioGrid { incidences, ..default },
                })
            }
        })
    }

    /// All that is needed to make the same file again, one fact a line, and which lines of it hold outliers.
    fn recipe(&self, source: &Source, layout: &Layout, samples: &SampleSet, outliers: &[usize]) -> String {
        // A path may hold characters that end a comment.
        let origin = source.origin().replace(char::is_control, " ");
        let mut lines = vec![
            format!("simulated measurement by gpbrdf-cli {}", env!("CARGO_PKG_VERSION")),
            format!("source: {origin}"),
        ];
        if !source.sha256.is_empty() {
            lines.push(format!("sha256: {}", source.sha256));
        }
        lines.push(format!("layout: {}", described(layout)));
        lines.push(format!("count: {}", samples.len()));
        lines.push(format!("seed: {}", self.seed));
        lines.push(match self.noise {
            0.0 => "noise: none".to_owned(),
            noise => format!("noise: {noise} (each channel times exp({noise} g), g standard normal)"),
        });
        // Lines count from 1; this one and the names of the columns are between the recipe and the samples.
        let first = lines.len() + 3;
        lines.push(if outliers.is_empty() {
            "outliers: none".to_owned()
        } else {
            let at = joined(outliers.iter().map(|index| index + first));
            format!("outliers: {} (all channels times {}), lines {at}", outliers.len(), self.outlier_factor)
        });
        lines.join("\n")
    }
}

/// A layout in words, with the options that choose it.
fn described(layout: &Layout) -> String {
    match layout {
        Layout::InPlane(scan) => format!(
            "in-plane, incidences {} degrees, viewer from -{limit} to {limit} degrees",
            joined(&scan.incidences),
            limit = InPlaneScan::VIEWER_LIMIT
        ),
        Layout::Gonio(grid) => format!(
            "gonio, incidences {} degrees, viewer in {} polar steps to {} degrees, {} azimuth steps to 180",
            joined(&grid.incidences),
            grid.polar_steps,
            GonioGrid::VIEWER_LIMIT,
            grid.azimuth_steps
        ),
        _ => format!("random, uniform in solid angle, cosines of at least {MIN_DRAWN_COSINE}"),
    }
}

fn joined<T: ToString>(items: impl IntoIterator<Item = T>) -> String {
    items.into_iter().map(|item| item.to_string()).collect::<Vec<_>>().join(", ")
}
