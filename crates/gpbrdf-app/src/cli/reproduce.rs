//! `gpbrdf-cli reproduce`: the paper's experiments, each a table and pictures.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, bail};
use clap::Args;
use gpbrdf_core::Source;
use gpbrdf_core::brdf::materials as built_in_materials;
use gpbrdf_core::formats::{read_neural_csv, sha256_file};
use serde_json::{Value, json};

use super::figure_args::FigureSize;
use super::input::{environment, near_name};
use super::library::read_materials;
use super::reading::Reading;
use super::terminal::Terminal;
use crate::job::{FigureKind, Observer};
use crate::output::OutputFolder;
use crate::reproduce::{Context, Experiment, Materials, PAPER_MATERIALS, measurements, store};

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli reproduce --quick",
    "\n  gpbrdf-cli reproduce --only table2,figures345 --figures pdf --width 85",
))]
pub(crate) struct Reproduce {
    /// Experiments to run. [default: all]
    #[arg(long, value_enum, value_delimiter = ',', value_name = "NAME,...")]
    only: Vec<Experiment>,
    /// Smaller settings: about five minutes in all on two free processors.
    #[arg(long)]
    quick: bool,
    /// Folder of measurements: RGL .bsdf files, and MERL .binary files, which are recognised by their sha256.
    #[arg(help_heading = "Input", long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Only these materials, by name.
    #[arg(help_heading = "Input", long, value_delimiter = ',', value_name = "NAME,...")]
    materials: Vec<String>,
    /// CSV file with the weights of Neural BRDF fits to compare with, 675 per material.
    #[arg(help_heading = "Input", long, value_name = "FILE")]
    nbrdf: Option<PathBuf>,
    /// Materials to learn priors from, as for `gpbrdf-cli learn`, for the experiment prior. The measurements of --data
    /// are added to them.
    #[arg(help_heading = "Input", long, value_name = "FILE", num_args = 1..)]
    library: Vec<PathBuf>,
    /// Environment map (.hdr or .exr, latitude-longitude) of the pictures instead of the built-in one.
    #[arg(help_heading = "Input", long, value_name = "FILE")]
    env: Option<PathBuf>,
    /// Seconds that one dense fit may be expected to take; decides its number of samples.
    /// [default: 60, or 1 with --quick]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    budget: Option<f64>,
    /// The kind of file of figures.
    #[arg(help_heading = "Output", long, value_enum, value_name = "KIND", default_value_t)]
    figures: FigureKind,
    #[command(flatten)]
    figure_size: FigureSize,
    /// Folder for the outputs. Experiments whose results of the same options it holds are not run again.
    #[arg(help_heading = "Output", short, long, value_name = "DIR", default_value = "gpbrdf-reproduction")]
    output: PathBuf,
}

impl Reproduce {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        OutputFolder::check(&self.output)?;
        let budget = self.budget.unwrap_or(if self.quick { 1.0 } else { 60.0 });
        if !(budget > 0.0 && budget.is_finite()) {
            bail!("--budget: expected a positive number of seconds, found {budget}");
        }
        let measured =
            self.data.as_deref().map_or(Ok(Vec::new()), |folder| measurements(folder, terminal))?;
        for name in &self.materials {
            let known = measured.iter().any(|s| &s.name == name)
                || built_in_materials().iter().any(|m| m.name == name);
            if !known {
                let near = near_name(name).map_or_else(String::new, |near| format!("; did you mean {near}?"));
                bail!(
                    "--materials: expected names of materials of --data or built-in ones, found \"{name}\"{near}"
                );
            }
        }
        let library = self.library(&measured, terminal)?;
        let context = Context {
            figures: self.figures,
            figure_size: self.figure_size.into(),
            quick: self.quick,
            budget,
            environment: environment(self.env.as_deref())?,
            only: self.materials.clone(),
            neural: self.nbrdf.as_deref().map_or(Ok(Vec::new()), read_neural_csv)?,
            built_in: PAPER_MATERIALS.into_iter().map(Source::built_in).collect::<Result<_, _>>()?,
            measured,
            library,
        };
        let key = self.key(&context)?;
        let chosen = |e: &Experiment| match self.only[..] {
            [] => e.is_possible(&context),
            _ => self.only.contains(e),
        };
        let (done, open): (Vec<_>, Vec<_>) = Experiment::ALL
            .into_iter()
            .filter(chosen)
            .partition(|e| store::is_done(&self.output, e.name(), &key));
        for experiment in done {
            terminal.summary(&format!("{}: taken from \"{}\"", experiment.name(), self.output.display()))?;
        }
        let mut left: f64 = open.iter().map(|e| e.seconds(&context)).sum();
        if left > 0.0 {
            terminal.note(&format!("about {left:.0} s; what is done is kept when interrupted"));
        }
        for experiment in open {
            let start = Instant::now();
            let outcome = terminal.stage(experiment.name(), || experiment.run(&context))?;
            let seconds = start.elapsed().as_secs_f64();
            for table in &outcome.tables {
                terminal.summary(&table.markdown())?;
            }
            let files = store::write(&self.output, experiment.name(), &key, seconds, outcome)?;
            terminal.summary(&format!(
                "{}: {seconds:.1} s, {files} files in \"{}\"",
                experiment.name(),
                self.output.display()
            ))?;
            left -= experiment.seconds(&context);
            if left > 1.0 {
                terminal.note(&format!("about {left:.0} s left"));
            }
        }
        Ok(())
    }

    /// The materials of `--library` and the measurements.
    fn library(&self, measured: &[Source], terminal: &Terminal) -> Result<Option<Materials>> {
        if self.library.is_empty() {
            return Ok(None);
        }
        let mut materials = Materials::new()?;
        let reading = Reading::default();
        read_materials(
            &self.library,
            reading,
            |_| false,
            terminal,
            |name, brdf| terminal.stage("Learning", || materials.add(name, brdf)),
        )?;
        for source in measured {
            terminal.stage("Learning", || materials.add(&source.name, source.brdf()?))?;
        }
        Ok(Some(materials))
    }

    /// What the results depend on: the options and the checksums of the inputs.
    fn key(&self, context: &Context) -> Result<Value> {
        let sum = |file: &Option<PathBuf>| file.as_ref().map(sha256_file).transpose();
        let measured: Vec<&str> = context.measured.iter().map(|s| s.sha256.as_str()).collect();
        Ok(json!({
            "version": env!("CARGO_PKG_VERSION"),
            "quick": self.quick,
            "budget": context.budget,
            "figures": self.figures.extension(),
            "width": context.figure_size.width,
            "dpi": context.figure_size.dots_per_inch,
            "materials": self.materials,
            "measurements": measured,
            "nbrdf": sum(&self.nbrdf)?,
            "library": self.library.iter().map(sha256_file).collect::<Result<Vec<_>, _>>()?,
            "env": sum(&self.env)?,
        }))
    }
}
