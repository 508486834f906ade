//! `gpbrdf-cli plan`: which directions to measure next.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::base::number::significant;
use gpbrdf_core::figure::FigureOptions;
use gpbrdf_core::formats::read_environment;
use gpbrdf_core::plan::{
    AxisCosts, Belief, Candidates, Cells, Device, Goal, MOST_MEASURED, Plan as Planned, plan, tour,
};
use gpbrdf_core::prior::Prior;
use gpbrdf_core::{Content, FitOptions, HalfDiff, fit};

use super::input::{environment, open};
use super::json::to_json;
use super::reading::Reading;
use super::terminal::Terminal;
use crate::job::{Observer, PriorName, expected_errors, plan_csv};
use crate::output::OutputFolder;
use crate::reproduce::{BATCHES, Simulation, Trial};

/// Directions of a plan without `--count` and `--until`.
const COUNT: usize = 20;

/// The sequence of the directions in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Order {
    /// A short way through all of them, for one session at the instrument.
    #[default]
    Tour,
    /// The most telling first, for a session that may end early.
    Rank,
}

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli plan --count 20 -o first.csv",
    "\n  gpbrdf-cli plan --measured first-measured.csv --until 0.1",
    "\n  gpbrdf-cli plan --simulate satin_purple.bsdf -o out",
))]
pub(crate) struct Plan {
    /// What was measured already: a file of scattered samples, or - for standard input. Without it the plan is that of
    /// the first measurements.
    #[arg(long, value_name = "FILE")]
    measured: Option<PathBuf>,
    /// What is known of other materials: the prior that comes with the program, one that `gpbrdf-cli learn` has
    /// written, or none.
    #[arg(long, value_name = "built-in|none|FILE", default_value_t)]
    prior: PriorName,
    /// Number of directions. [default: 20]
    #[arg(long, value_name = "K", conflicts_with = "until")]
    count: Option<usize>,
    /// As many directions as the expected error takes: the root mean square of the error of ln f, weighted like the
    /// cells.
    #[arg(long, value_name = "ERROR", allow_hyphen_values = true)]
    until: Option<f64>,
    #[command(flatten)]
    instrument: Instrument,
    /// Environment map (.hdr or .exr, latitude-longitude): directions count as much as a picture of a sphere in its
    /// light uses them; without it, as one in even light does. For materials that may have a sharp highlight, half of
    /// the weight is on directions that are the more the nearer they are to the mirror direction.
    #[arg(long, value_name = "FILE")]
    env: Option<PathBuf>,
    /// Sequence of the directions.
    #[arg(long, value_enum, default_value_t)]
    order: Order,
    /// What it costs to turn each axis by a degree, for the way through all directions; axes turn at the same time.
    #[arg(
        long,
        value_name = "THETA_I,PHI_I,THETA_O,PHI_O",
        value_delimiter = ',',
        num_args = 1,
        default_value = "1,1,1,1",
        allow_hyphen_values = true
    )]
    axis_cost: Vec<f64>,
    /// CSV file to write, on standard output by default; with --simulate, the folder of its picture.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    simulation: Simulate,
}

/// A plan that is tried out.
#[derive(Args, Debug)]
#[command(next_help_heading = "Simulation")]
struct Simulate {
    /// Instead of writing a plan, try it out on a material that can be evaluated at any direction: a measurement, table
    /// or model file, or a built-in material. Each batch is planned with the hyper-parameters of a fit to those before.
    #[arg(
        long,
        value_name = "INPUT",
        conflicts_with_all = ["measured", "count", "until", "order", "axis_cost"]
    )]
    simulate: Option<PathBuf>,
    /// Numbers of directions after each batch. [default: 10,20,42,100,234]
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', requires = "simulate")]
    batches: Option<Vec<usize>>,
    /// Print the results as JSON.
    #[arg(long, requires = "simulate")]
    json: bool,
}

/// What an instrument reaches.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Instrument")]
pub(crate) struct Instrument {
    /// Step of all angles, degrees. The first 20 directions, and all of matte materials, are at multiples of 5 degrees
    /// or of the next multiple of the step: few measurements tell most there.
    #[arg(long, value_name = "DEGREES", default_value_t = Device::default().step, allow_hyphen_values = true)]
    step: f64,
    /// Angles between light and normal, degrees. [default: all steps up to --theta-max]
    #[arg(long, value_name = "DEG,DEG,...", value_delimiter = ',', allow_hyphen_values = true)]
    theta_i: Option<Vec<f64>>,
    /// The largest angle between detector and normal, degrees.
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = Device::default().theta_max,
        allow_hyphen_values = true
    )]
    theta_max: f64,
    /// Keep the detector in the plane of light and normal.
    #[arg(long)]
    in_plane: bool,
    /// The smallest angle between light and detector, degrees.
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = Device::default().min_separation,
        allow_hyphen_values = true
    )]
    min_separation: f64,
}

impl Instrument {
    pub(crate) fn device(&self) -> Device {
        Device {
            step: self.step,
            incidences: self.theta_i.clone(),
            theta_max: self.theta_max,
            in_plane: self.in_plane,
            min_separation: self.min_separation,
        }
    }
}

/// What was measured, and what is known with it.
struct Known {
    belief: Belief,
    angles: Vec<HalfDiff>,
    /// What the file says about both.
    measured: String,
    prior: String,
}

impl Plan {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        match &self.simulation.simulate {
            None => self.write(terminal),
            Some(input) => self.simulate(input, terminal),
        }
    }

    /// Tries the plan out.
    fn simulate(&self, input: &Path, terminal: &Terminal) -> Result<()> {
        let batches = self.simulation.batches.clone().unwrap_or_else(|| BATCHES.to_vec());
        if batches.is_empty() || batches[0] == 0 || batches.windows(2).any(|pair| pair[0] >= pair[1]) {
            let found: Vec<String> = batches.iter().map(ToString::to_string).collect();
            bail!("--batches: expected increasing numbers of at least 1, found {}", found.join(","));
        }
        if let Some(folder) = &self.output {
            OutputFolder::check(folder)?;
        }
        let environment = environment(self.env.as_deref())?;
        let source = terminal.stage("Loading", || open(input, self.reading, terminal))?;
        let truth = source.table()?;
        let trial = Trial {
            brdf: source.brdf()?,
            truth: &truth,
            environment: &environment,
            device: &self.instrument.device(),
            cells: &self.cells()?,
            prior: self.prior.open()?.prior(),
        };
        let found = terminal.stage("Simulating", || Simulation::new(&source.name, &trial, &batches))?;
        if self.simulation.json {
            terminal.print(&to_json(&found.json())?)?;
        } else {
            terminal.print(&found.table().markdown())?;
        }
        if let Some(folder) = &self.output {
            let folder = OutputFolder::create(folder)?;
            found.figure().save(folder.join("plan.svg"), &FigureOptions::default())?;
        }
        Ok(())
    }

    fn cells(&self) -> Result<Cells> {
        let environment = self.env.as_ref().map(read_environment).transpose()?;
        Ok(Cells::usual(environment.as_ref(), Cells::COUNT)?)
    }

    /// Writes the plan.
    fn write(&self, terminal: &Terminal) -> Result<()> {
        let costs = self.axis_costs()?;
        let goal = match (self.count, self.until) {
            (Some(0), _) => bail!("--count: expected at least 1, found 0"),
            (Some(count), _) => Goal::Count(count),
            (None, Some(error)) => Goal::Error(error),
            (None, None) => Goal::Count(COUNT),
        };
        let device = self.instrument.device();
        let candidates = Candidates::of(&device)?;
        let path = self.output.as_deref().filter(|path| *path != Path::new("-"));
        // Created before the work, so that nobody waits for a plan that cannot be written.
        let file = path.map(|path| anyhow::Ok((path.display(), AtomicFile::create(path)?))).transpose()?;
        let cells = self.cells()?;
        let known = self.known(terminal)?;
        let found = terminal.stage("Planning", || {
            anyhow::Ok(plan(&known.belief, &known.angles, &candidates, &cells, goal)?)
        })?;
        let text = self.text(&found, &known, &device, &costs);
        match file {
            None => terminal.print(&text),
            Some((path, mut file)) => {
                file.write_all(text.as_bytes()).with_context(|| format!("cannot write \"{path}\""))?;
                file.commit()?;
                let [now, then] = ends(&found).map(|error| significant(error, 3));
                terminal.summary(&format!(
                    "wrote {} directions to {path}: expected error of ln f {now} now, {then} after them",
                    found.geometries.len()
                ))
            }
        }
    }

    fn axis_costs(&self) -> Result<AxisCosts> {
        let wrong = |found: &str| format!("--axis-cost: expected four numbers of at least 0, found {found}");
        let [theta_i, phi_i, theta_o, phi_o] = self.axis_cost[..] else {
            bail!(wrong(&self.axis_cost.len().to_string()));
        };
        match self.axis_cost.iter().find(|cost| !(**cost >= 0.0 && cost.is_finite())) {
            Some(bad) => bail!(wrong(&bad.to_string())),
            None => Ok(AxisCosts { theta_i, phi_i, theta_o, phi_o }),
        }
    }

    /// Reads what was measured and fits a model to it.
    fn known(&self, terminal: &Terminal) -> Result<Known> {
        let choice = self.prior.open()?;
        let Some(path) = &self.measured else {
            let prior = choice.prior();
            let belief = Belief::before(prior.as_ref());
            return Ok(Known {
                belief,
                angles: Vec::new(),
                measured: "nothing".into(),
                prior: described(prior),
            });
        };
        let source = terminal.stage("Loading", || open(path, self.reading, terminal))?;
        let Content::Samples(samples) = &source.content else {
            bail!(
                "--measured \"{}\": expected scattered samples, found a {}, which is known everywhere",
                path.display(),
                source.kind
            );
        };
        if samples.len() > MOST_MEASURED {
            terminal.note(&format!(
                "{}: {MOST_MEASURED} of its {} samples are taken into account, spread evenly over them",
                source.origin(),
                samples.len()
            ));
        }
        let options = FitOptions { prior: choice, ..FitOptions::default() };
        let fitted = terminal.stage("Fitting", || anyhow::Ok(fit(samples, &options)?))?;
        let count = samples.len();
        let origin = source.origin().replace(char::is_control, " ");
        Ok(Known {
            belief: Belief::of_model(&fitted.model, samples, &options)?,
            angles: samples.angles.clone(),
            measured: format!("{count} samples of {origin}"),
            prior: described(options.prior(samples)),
        })
    }

    /// The file.
    fn text(&self, found: &Planned, known: &Known, device: &Device, costs: &AxisCosts) -> String {
        let geometries = &found.geometries;
        let count = geometries.len();
        let rank: Vec<usize> = (0..count).collect();
        let order = if self.order == Order::Rank { rank.clone() } else { tour(geometries, costs) };
        let cost = |order: &[usize]| significant(costs.of_way(geometries, order), 4);
        let order_said = match self.order {
            Order::Rank => "the most telling first".to_owned(),
            Order::Tour => format!(
                "a way of cost {} through all of them, {} by rank; `--order rank` has the most telling first",
                cost(&order),
                cost(&rank)
            ),
        };
        let lit = match &self.env {
            None => "a sphere in even light".to_owned(),
            Some(path) => {
                format!("a sphere in the light of {}", path.display()).replace(char::is_control, " ")
            }
        };
        let comments = [
            format!("{count} directions to measure, by gpbrdf-cli {}", env!("CARGO_PKG_VERSION")),
            format!("instrument: {device}"),
            format!("measured: {}", known.measured),
            format!("prior: {}", known.prior),
            format!("what counts: {lit}; highlights as much, unless the material is matte"),
            expected_errors(found),
            format!("order: {order_said}"),
        ];
        plan_csv(&comments, order.into_iter().map(|i| &geometries[i]))
    }
}

fn described(prior: Option<Arc<Prior>>) -> String {
    match prior {
        None => "none".to_owned(),
        Some(prior) => {
            format!("{}, of {} materials", prior.name, prior.materials.len()).replace(char::is_control, " ")
        }
    }
}

/// The expected error before and after a plan.
fn ends(found: &Planned) -> [f64; 2] {
    [0, found.geometries.len()].map(|m| found.errors[m])
}
