//! How to sample and fit, as options of `bake` and `fit`.

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use gpbrdf_core::{
    Brdf, FitOptions, FitReport, InducingSize, LatticeLayout, Layout, MeanFunction, Model, Noise,
    OptimizeOptions, Provenance, SampleSet, Shape, Solver, Source, Symmetry, TableFitOptions, Transform,
    dense_cost, detect_symmetry, fit_table,
};

use super::inducing_args::InducingArgs;
use super::report::Seconds;
use super::terminal::Terminal;

/// Number of values that the paper takes, 2.58 % of a table.
const PAPER_SAMPLES: usize = 37_616;

/// Samples off a lattice are solved densely: a number that takes seconds.
const DENSE_SAMPLES: usize = 2_000;

/// The largest lattice: more nodes than this are no samples of a table of 1,458,000 cells, and take gigabytes.
const MAX_NODES: usize = 1 << 22;

/// Evaluations of likelihood and gradient that a dense search usually takes.
const TYPICAL_EVALUATIONS: usize = 40;

/// Fewer samples than this take a second and a few MB: nothing to foretell.
const SHORT_DENSE_RUN: usize = 1000;

#[derive(Args, Clone, Debug)]
pub(crate) struct ModelArgs {
    /// Nodes of the lattice along theta_h, theta_d and phi_d, for example 48x32x24.
    #[arg(long, value_name = "HxDxP", value_parser = parse_lattice, conflicts_with = "samples")]
    lattice: Option<[usize; 3]>,
    /// Number of samples; the lattice is chosen near it. [default: 37616 on a lattice, 2000 off it]
    #[arg(long, value_name = "N")]
    samples: Option<usize>,
    /// Where to sample a source that can be asked anywhere.
    #[arg(long, value_enum, default_value = "lattice")]
    layout: LayoutName,
    /// Symmetry in phi_d that samples and model rely on; auto measures it.
    #[arg(long, value_enum, default_value = "auto")]
    symmetry: SymmetryName,
    /// Place the lattice's nodes at sqrt(theta_h) = t^EXPONENT with t evenly spaced; above 1 they crowd at the
    /// specular peak. By default they stand on the table's cells there and spread out from it.
    #[arg(long, value_name = "EXPONENT", allow_hyphen_values = true)]
    node_density: Option<f64>,
    /// Exact solver.
    #[arg(long, value_enum, default_value = "auto")]
    solver: SolverName,
    /// Kernel shapes, summed: se, rq, matern12, matern32, matern52, matern (with --nu).
    #[arg(long, value_name = "SHAPE[+SHAPE...]", default_value = "matern52")]
    kernel: String,
    /// Smoothness of `--kernel matern`.
    #[arg(long, value_name = "NU", default_value_t = 1.5, allow_hyphen_values = true)]
    nu: f64,
    /// What is fitted: ln(f + epsilon), f itself or its cube root.
    #[arg(long, value_enum, default_value = "log")]
    transform: TransformName,
    /// Epsilon of `--transform log`, sr^-1.
    #[arg(long, value_name = "VALUE", default_value_t = 1e-3, allow_hyphen_values = true)]
    epsilon: f64,
    /// Prior mean.
    #[arg(long, value_enum, default_value = "constant")]
    mean: MeanName,
    /// Noise variance in squared target units, or auto to find it.
    #[arg(long, value_name = "VARIANCE|auto", default_value = "auto", value_parser = parse_noise, allow_hyphen_values = true)]
    noise: NoiseArg,
    /// Seed of random layouts and restarts.
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    seed: u64,
    /// Further starts of the search for hyper-parameters.
    #[arg(long, value_name = "N", default_value_t = 0)]
    restarts: usize,
    /// Hyper-parameters for each channel instead of shared ones.
    #[arg(long)]
    per_channel: bool,
    #[command(flatten)]
    inducing: InducingArgs,
}

#[derive(Clone, Copy, Debug)]
struct NoiseArg(Noise);

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum LayoutName {
    Lattice,
    Random,
    Cells,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum SymmetryName {
    Auto,
    Bilateral,
    Reciprocal,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum SolverName {
    Auto,
    Lattice,
    Dense,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum TransformName {
    Log,
    Identity,
    CubeRoot,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum MeanName {
    Constant,
    Zero,
}

pub(super) fn parse_lattice(text: &str) -> Result<[usize; 3], String> {
    let sides: Vec<usize> = text.split(['x', 'X']).map_while(|side| side.parse().ok()).collect();
    match <[usize; 3]>::try_from(sides) {
        Ok(sides) if text.split(['x', 'X']).count() == 3 => Ok(sides),
        _ => Err("expected three numbers like 48x32x24".into()),
    }
}

fn parse_noise(text: &str) -> Result<NoiseArg, String> {
    if text == "auto" {
        return Ok(NoiseArg(Noise::Optimized));
    }
    match text.parse::<f64>() {
        Ok(variance) if variance > 0.0 && variance.is_finite() => Ok(NoiseArg(Noise::Fixed(variance))),
        _ => Err("expected auto or a positive number".into()),
    }
}

impl ModelArgs {
    /// Measures a source and fits a model to it, both as asked for.
    pub(crate) fn sample_and_fit(
        &self,
        source: &Source,
        seconds: &mut Seconds,
        terminal: &Terminal,
    ) -> Result<(Model, Vec<FitReport>)> {
        let provenance = Provenance {
            material: source.name.clone(),
            source: source.origin(),
            sha256: source.sha256.clone(),
            ..Provenance::default()
        };
        if let Some(size) = self.inducing.size() {
            return self.compress(source, size, provenance, seconds, terminal);
        }
        let samples =
            seconds.measure("sample", || terminal.stage("sampling", || self.sample(source, terminal)))?;
        let options = self.fit_options()?;
        Ok(seconds.measure("fit", || {
            terminal.stage("fitting", || gpbrdf_core::fit(&samples, &options, provenance))
        })?)
    }

    /// Fits inducing lattices to the whole table of a source.
    fn compress(
        &self,
        source: &Source,
        size: InducingSize,
        provenance: Provenance,
        seconds: &mut Seconds,
        terminal: &Terminal,
    ) -> Result<(Model, Vec<FitReport>)> {
        for (option, found) in [
            ("--layout", self.layout != LayoutName::Lattice),
            ("--solver", !matches!(self.solver, SolverName::Auto)),
            ("--mean", !matches!(self.mean, MeanName::Constant)),
            ("--noise", self.noise.0 != Noise::Optimized),
        ] {
            if found {
                bail!("{option}: expected its default for inducing lattices, found another value");
            }
        }
        let options = self.fit_options()?;
        let [kernel] = options.kernel[..] else {
            bail!("--kernel: expected one shape for inducing lattices, found {}", options.kernel.len());
        };
        let table = seconds.measure("sample", || terminal.stage("tabulating", || source.table()));
        let (Some(table), Some(brdf)) = (table, source.brdf()) else {
            bail!(
                "{}: expected a whole table for inducing lattices, found scattered samples",
                source.origin()
            );
        };
        let symmetry = self.measured_symmetry(brdf, terminal);
        let options = TableFitOptions {
            size,
            symmetry,
            kernel,
            transform: options.transform,
            weights: self.inducing.weights(),
            ..TableFitOptions::default()
        };
        Ok(seconds
            .measure("fit", || terminal.stage("fitting", || fit_table(&table, &options, provenance)))?)
    }

    /// The symmetry that was asked for, or that of the source.
    fn measured_symmetry(&self, brdf: &dyn Brdf, terminal: &Terminal) -> Symmetry {
        let symmetry = match self.symmetry {
            SymmetryName::Auto => detect_symmetry(brdf),
            SymmetryName::Bilateral => Symmetry::Bilateral,
            SymmetryName::Reciprocal => Symmetry::Reciprocal,
        };
        terminal.detail(&format!("symmetry: {symmetry:?}"));
        symmetry
    }

    /// Measures a source as asked for.
    fn sample(&self, source: &Source, terminal: &Terminal) -> Result<SampleSet> {
        if let gpbrdf_core::Content::Samples(samples) = &source.content {
            if self.lattice.is_some() || self.samples.is_some() {
                bail!(
                    "{}: expected no --lattice and no --samples for scattered measurements, found one: all {} are used",
                    source.origin(),
                    samples.samples.len()
                );
            }
            self.foretell(samples.samples.len(), terminal)?;
            return Ok(SampleSet::from(samples));
        }
        if let gpbrdf_core::Content::Table(table) = &source.content
            && !table.values().iter().any(|v| v.iter().all(|&x| x >= 0.0))
        {
            bail!("{}: expected data in at least one cell, found none", source.origin());
        }
        let Some(brdf) = source.brdf() else { bail!("{}: nothing to sample", source.origin()) };
        let layout = match self.layout {
            LayoutName::Lattice => {
                let symmetry = self.measured_symmetry(brdf, terminal);
                let mut lattice = match self.lattice {
                    Some(shape) => LatticeLayout::with_shape(shape, symmetry),
                    None => LatticeLayout::with_samples(self.samples.unwrap_or(PAPER_SAMPLES), symmetry)?,
                };
                if let Some(density) = self.node_density {
                    lattice.node_density = density;
                    lattice.node_spread = 0.0;
                }
                lattice.validate()?;
                if lattice.len() > MAX_NODES {
                    let [a, b, c] = lattice.shape;
                    bail!(
                        "--lattice: expected at most {MAX_NODES} nodes, found {a}x{b}x{c} = {}",
                        lattice.len()
                    );
                }
                if matches!(self.solver, SolverName::Dense) {
                    self.foretell(lattice.len(), terminal)?;
                }
                Layout::Lattice(lattice)
            }
            name => {
                if self.lattice.is_some() {
                    bail!("--lattice: expected --layout lattice, found another layout");
                }
                if matches!(self.solver, SolverName::Lattice) {
                    bail!("--solver lattice: expected --layout lattice, found another layout");
                }
                let count = self.samples.unwrap_or(DENSE_SAMPLES);
                self.foretell(count, terminal)?;
                if name == LayoutName::Random {
                    Layout::Random { count, seed: self.seed }
                } else {
                    Layout::Cells { count, seed: self.seed }
                }
            }
        };
        Ok(SampleSet::measure(brdf, &layout)?)
    }

    /// Tells what a dense fit to `samples` samples will take if that is long, and refuses it if it will not fit in
    /// memory; before anything is sampled.
    fn foretell(&self, samples: usize, terminal: &Terminal) -> Result<()> {
        if samples < SHORT_DENSE_RUN {
            return Ok(());
        }
        let mut cost = dense_cost(samples, 3, TYPICAL_EVALUATIONS);
        if self.per_channel {
            cost.seconds *= 3.0;
        }
        cost.check()?;
        if cost.seconds > 10.0 {
            terminal.note(&format!(
                "a dense fit to {samples} samples takes {:.1} GiB and about {:.0} s",
                cost.bytes / (1u64 << 30) as f64,
                cost.seconds
            ));
        }
        Ok(())
    }

    /// The options of the fit.
    fn fit_options(&self) -> Result<FitOptions> {
        let kernel =
            self.kernel.split('+').map(|name| self.shape(name.trim())).collect::<Result<Vec<_>>>()?;
        let symmetry = match self.symmetry {
            SymmetryName::Reciprocal => Symmetry::Reciprocal,
            SymmetryName::Auto | SymmetryName::Bilateral => Symmetry::Bilateral,
        };
        let lattice = LatticeLayout::default();
        let density = self.node_density.unwrap_or(lattice.node_density);
        Ok(FitOptions {
            solver: match self.solver {
                SolverName::Auto => Solver::Auto,
                SolverName::Lattice => Solver::Lattice,
                SolverName::Dense => Solver::Dense,
            },
            kernel,
            transform: match self.transform {
                TransformName::Log => Transform::Log { epsilon: self.epsilon },
                TransformName::Identity => Transform::Identity,
                TransformName::CubeRoot => Transform::CubeRoot,
            },
            mean: match self.mean {
                MeanName::Constant => MeanFunction::Constant,
                MeanName::Zero => MeanFunction::Zero,
            },
            noise: self.noise.0,
            per_channel: self.per_channel,
            space: LatticeLayout { node_density: density, symmetry, ..lattice }.space(),
            optimize: OptimizeOptions {
                restarts: self.restarts,
                seed: self.seed,
                ..OptimizeOptions::default()
            },
        })
    }

    fn shape(&self, name: &str) -> Result<Shape> {
        Ok(match name {
            "se" => Shape::SquaredExponential,
            "rq" => Shape::RationalQuadratic { alpha: 1.0 },
            "matern12" => Shape::Matern12,
            "matern32" => Shape::Matern32,
            "matern52" => Shape::Matern52,
            "matern" => Shape::Matern { nu: self.nu },
            other => bail!(
                "--kernel: expected shapes out of se, rq, matern12, matern32, matern52, matern joined by +, found \"{other}\""
            ),
        })
    }
}
