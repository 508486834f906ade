//! How to measure a source and what to fit to it, as options of the command line and in sessions of the
//! viewer.

use anyhow::{Result, bail};
use clap::Args;
use gpbrdf_core::gp::OptimizeOptions;
use gpbrdf_core::sample::InputSpace;
use gpbrdf_core::{
    CompressOptions, Content, FitOptions, Hyper, LatticeLayout, Layout, MeanFunction, Outliers, Solver,
    Source, Symmetry, Transform,
};
use serde::{Deserialize, Serialize};

use super::choices::{LayoutChoice, NoiseChoice, SymmetryChoice, TransformChoice, named, parse_lattice};
use super::compression::{Compression, refuse_others};
use super::kernels::Kernels;
use super::prior::PriorName;

/// Number of values that the paper takes, 2.58 % of a table.
pub(crate) const PAPER_SAMPLES: usize = 37_616;

/// Number of samples off a lattice: one that takes seconds.
const SCATTERED_SAMPLES: usize = 2_000;

/// The largest lattice: a table has 1,458,000 cells, so more nodes than this hold nothing new, and take
/// gigabytes.
const MAX_NODES: usize = 1 << 22;

/// How to measure and fit one material.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(next_help_heading = "Model")]
#[serde(default, deny_unknown_fields)]
pub(crate) struct ModelSpec {
    /// Nodes of the lattice along theta_h, theta_d and phi_d, for example 48x32x24.
    #[arg(help_heading = "Sampling", long, value_name = "HxDxP", value_parser = parse_lattice)]
    #[arg(conflicts_with = "samples")]
    pub(crate) lattice: Option<[usize; 3]>,
    /// Number of samples; the lattice is chosen near it. [default: 37616 on a lattice, 2000 off it]
    #[arg(help_heading = "Sampling", long, value_name = "N")]
    pub(crate) samples: Option<usize>,
    /// Where to sample a source that can be evaluated at any direction.
    #[arg(help_heading = "Sampling", long, value_enum, default_value_t)]
    pub(crate) layout: LayoutChoice,
    /// Symmetry in phi_d that samples and model rely on. auto measures it at a source that can be evaluated
    /// at any direction; scattered samples are taken for bilateral.
    #[arg(help_heading = "Sampling", long, value_enum, default_value_t)]
    pub(crate) symmetry: SymmetryChoice,
    /// Place the lattice's nodes at sqrt(theta_h) = t^EXPONENT with t evenly spaced; above 1 they crowd at
    /// the specular peak. By default they stand on the table's cells there and spread out from it.
    #[arg(help_heading = "Sampling", long, value_name = "EXPONENT", allow_hyphen_values = true)]
    pub(crate) node_density: Option<f64>,
    /// Exact solver.
    #[arg(long, default_value = "auto", value_parser = named::<Solver>(&Solver::NAMES))]
    pub(crate) solver: Solver,
    /// The kernel.
    #[arg(long, value_name = "SHAPE[+SHAPE...]", default_value_t, help = Kernels::help())]
    pub(crate) kernel: Kernels,
    /// Smoothness of `--kernel matern`.
    #[arg(long, value_name = "NU", default_value_t = ModelSpec::default().nu, allow_hyphen_values = true)]
    pub(crate) nu: f64,
    /// What is fitted: ln(f + epsilon), f itself or its cube root.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) transform: TransformChoice,
    /// Epsilon of `--transform log`, sr^-1.
    #[arg(
        long,
        value_name = "VALUE",
        default_value_t = ModelSpec::default().epsilon,
        allow_hyphen_values = true
    )]
    pub(crate) epsilon: f64,
    /// Prior mean.
    #[arg(long, default_value = "constant", value_parser = named::<MeanFunction>(&["constant", "zero"]))]
    pub(crate) mean: MeanFunction,
    /// Noise variance in squared target units, or auto to find it.
    #[arg(long, value_name = "VARIANCE|auto", default_value_t, allow_hyphen_values = true)]
    pub(crate) noise: NoiseChoice,
    /// Let the likelihood alone decide on the hyper-parameters of samples off a lattice, as in the paper, instead
    /// of weak priors for what the samples leave open.
    #[arg(long)]
    pub(crate) no_hyper_priors: bool,
    /// What is known of other materials, for samples off a lattice and for lattices of few nodes: the prior that comes
    /// with the program, one that `gpbrdf-cli learn` has written, or none.
    #[arg(long, value_name = "built-in|none|FILE", default_value_t)]
    pub(crate) prior: PriorName,
    /// What to do about suspected outliers among scattered samples: take them like all others, or give them a
    /// larger noise. They are listed either way where the noise is larger.
    #[arg(long, default_value = "downweight", value_parser = named::<Outliers>(&["keep", "downweight"]))]
    pub(crate) outliers: Outliers,
    /// Seed of random layouts and restarts.
    #[arg(help_heading = "Sampling", long, value_name = "SEED", default_value_t)]
    pub(crate) seed: u64,
    /// Further starts of the search for hyper-parameters.
    #[arg(long, value_name = "N", default_value_t)]
    pub(crate) restarts: usize,
    /// Hyper-parameters for each channel instead of shared ones.
    #[arg(long)]
    pub(crate) per_channel: bool,
    #[command(flatten)]
    pub(crate) compression: Compression,
    /// Hyper-parameters that were set by hand; without them a search finds them.
    #[arg(skip)]
    pub(crate) hyper: Option<Hyper>,
}

impl Default for ModelSpec {
    fn default() -> Self {
        Self {
            lattice: None,
            samples: None,
            layout: LayoutChoice::default(),
            symmetry: SymmetryChoice::default(),
            node_density: None,
            solver: Solver::default(),
            kernel: Kernels::default(),
            nu: 1.5,
            transform: TransformChoice::default(),
            epsilon: 1e-3,
            mean: MeanFunction::default(),
            noise: NoiseChoice::default(),
            no_hyper_priors: false,
            prior: PriorName::default(),
            outliers: Outliers::default(),
            seed: 0,
            restarts: 0,
            per_channel: false,
            compression: Compression::default(),
            hyper: None,
        }
    }
}

impl ModelSpec {
    /// Refuses options that contradict each other or the source, as a command line may.
    ///
    /// # Errors
    /// The first contradiction.
    pub(crate) fn check(&self, source: &Source) -> Result<()> {
        self.check_prior()?;
        if self.compression.size().is_some() {
            return Ok(());
        }
        if let Content::Samples(samples) = &source.content {
            if self.lattice.is_some() || self.samples.is_some() {
                bail!(
                    "{}: expected no --lattice and no --samples for scattered measurements, found one: \
                     all {} are used",
                    source.origin(),
                    samples.len()
                );
            }
        } else if self.layout == LayoutChoice::Lattice && self.solver != Solver::Dense {
            return Ok(());
        } else if self.layout != LayoutChoice::Lattice {
            if self.lattice.is_some() {
                bail!("--lattice: expected --layout lattice, found another layout");
            }
            if self.solver == Solver::Lattice {
                bail!("--solver lattice: expected --layout lattice, found another layout");
            }
        }
        if !self.kernel.are_alike() {
            bail!(
                "--kernel: expected one kernel for all axes of samples off a lattice, found {}",
                self.kernel
            );
        }
        Ok(())
    }

    /// Refuses a prior of the user's own where the other options leave no use for it.
    fn check_prior(&self) -> Result<()> {
        let PriorName::File(path) = &self.prior else { return Ok(()) };
        let contradictions = [
            ("--transform log --epsilon 0.001", self.transform() == Transform::default()),
            ("--mean constant", self.mean == MeanFunction::Constant),
            ("no --per-channel", !self.per_channel),
            ("no --no-hyper-priors", !self.no_hyper_priors),
            ("no --node-density", self.node_density.is_none()),
            ("no symmetry but bilateral", self.symmetry != SymmetryChoice::Reciprocal),
            ("--solver auto or scattered", matches!(self.solver, Solver::Auto | Solver::Scattered)),
            ("no compression", self.compression.size().is_none()),
        ];
        match contradictions.iter().find(|(_, holds)| !holds) {
            Some((expected, _)) => bail!("--prior {}: expected {expected}, found otherwise", path.display()),
            None => Ok(()),
        }
    }

    /// Number of samples of a source that can be evaluated at any direction, off a lattice.
    pub(crate) fn scattered_samples(&self) -> usize {
        self.samples.unwrap_or(SCATTERED_SAMPLES)
    }

    /// Where to measure a source of this symmetry.
    ///
    /// # Errors
    /// A lattice that is too small, too large or otherwise broken.
    pub(super) fn layout(&self, symmetry: Symmetry) -> Result<Layout> {
        let (count, seed) = (self.scattered_samples(), self.seed);
        Ok(match self.layout {
            LayoutChoice::Lattice => Layout::Lattice(self.lattice_layout(symmetry)?),
            LayoutChoice::Random => Layout::Random { count, seed },
            LayoutChoice::Cells => Layout::Cells { count, seed },
        })
    }

    fn lattice_layout(&self, symmetry: Symmetry) -> Result<LatticeLayout> {
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
            bail!("--lattice: expected at most {MAX_NODES} nodes, found {a}x{b}x{c} = {}", lattice.len());
        }
        Ok(lattice)
    }

    /// The options of a fit to samples that rely on `symmetry`.
    ///
    /// # Errors
    /// A kernel of an unknown name.
    pub(super) fn fit_options(&self, symmetry: Symmetry) -> Result<FitOptions> {
        // A density of nodes is one of the warped box, which also knows materials that are not bilateral.
        let space = if symmetry == Symmetry::Bilateral && self.node_density.is_none() {
            None
        } else {
            let lattice = LatticeLayout::default();
            let node_density = self.node_density.unwrap_or(lattice.node_density);
            Some(InputSpace::from(LatticeLayout { node_density, symmetry, ..lattice }.space()))
        };
        Ok(FitOptions {
            solver: self.solver,
            kernel: self.kernel.shapes(self.nu)?,
            transform: self.transform(),
            mean: self.mean,
            noise: self.noise.noise(),
            per_channel: self.per_channel,
            hyper_priors: !self.no_hyper_priors,
            prior: self.prior.open()?,
            outliers: self.outliers,
            space,
            optimize: OptimizeOptions {
                restarts: self.restarts,
                seed: self.seed,
                ..OptimizeOptions::default()
            },
            ..FitOptions::default()
        })
    }

    fn transform(&self) -> Transform {
        match self.transform {
            TransformChoice::Log => Transform::Log { epsilon: self.epsilon },
            TransformChoice::Identity => Transform::Identity,
            TransformChoice::CubeRoot => Transform::CubeRoot,
        }
    }

    /// The options of a compression, if one is asked for, but for the symmetry.
    ///
    /// # Errors
    /// Options that a compression does not heed, or several kernel shapes.
    pub(super) fn compress_options(&self) -> Result<Option<CompressOptions>> {
        let Some(size) = self.compression.size() else { return Ok(None) };
        refuse_others(&[
            ("--layout", self.layout == LayoutChoice::Lattice),
            ("--solver", self.solver == Solver::Auto),
            ("--mean", self.mean == MeanFunction::Constant),
            ("--noise", self.noise == NoiseChoice::default()),
        ])?;
        let shapes = self.kernel.shapes(self.nu)?;
        if !self.kernel.are_alike() {
            bail!("--kernel: expected one kernel for all axes of inducing lattices, found {}", self.kernel);
        }
        let [kernel] = shapes[0][..] else {
            bail!("--kernel: expected one shape for inducing lattices, found {}", shapes[0].len());
        };
        let transform = self.transform();
        let weights = self.compression.weights();
        Ok(Some(CompressOptions { size, kernel, transform, weights, ..CompressOptions::default() }))
    }
}

/// What the viewer's panel shows and sets.
#[cfg(feature = "viewer")]
impl ModelSpec {
    /// The specification that an interactive program starts with: a lattice of a known shape, and so few
    /// samples off it that a dense fit takes a second.
    pub(crate) fn interactive() -> Self {
        Self { lattice: Some(LatticeLayout::default().shape), samples: Some(800), ..Self::default() }
    }

    /// Nodes of the lattice along each axis.
    pub(crate) fn shape(&self) -> [usize; 3] {
        let lattice = self.lattice_layout(Symmetry::default());
        lattice.map_or_else(|_| LatticeLayout::default().shape, |lattice| lattice.shape)
    }

    /// Number of samples of a source that can be evaluated at any direction.
    pub(crate) fn count(&self) -> usize {
        match self.layout {
            LayoutChoice::Lattice => self.shape().iter().product(),
            LayoutChoice::Random | LayoutChoice::Cells => self.scattered_samples(),
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        spec: ModelSpec,
    }

    fn parse(line: &str) -> ModelSpec {
        Line::parse_from(std::iter::once("test").chain(line.split_whitespace())).spec
    }

    #[test]
    fn an_empty_command_line_is_the_default() {
        Line::command().debug_assert();
        assert_eq!(parse(""), ModelSpec::default());
        assert_eq!(serde_json::from_str::<ModelSpec>("{}").unwrap(), ModelSpec::default());
    }

    #[test]
    fn a_command_line_comes_back_from_a_session() {
        let line = "--lattice 8x6x4 --layout cells --symmetry reciprocal --node-density 2 --solver dense \
                    --kernel se+rq,matern,matern12 --nu 2.5 --transform cube-root --epsilon 0.1 --mean zero \
                    --noise 1e-4 --seed 7 --restarts 2 --per-channel --picture-weight 0.5";
        let spec = parse(line);
        assert_eq!(
            (spec.lattice, spec.solver, spec.mean),
            (Some([8, 6, 4]), Solver::Dense, MeanFunction::Zero)
        );
        let json = serde_json::to_value(&spec).unwrap();
        assert_eq!((&json["transform"], &json["noise"]), (&"cube-root".into(), &1e-4.into()));
        assert_eq!(serde_json::from_value::<ModelSpec>(json).unwrap(), spec);
    }

    #[test]
    fn sessions_with_unknown_values_are_refused_by_name() {
        for (text, said) in [
            (r#"{"shape": [1, 2, 3]}"#, "unknown field `shape`"),
            (r#"{"layout": "spiral"}"#, "unknown variant `spiral`"),
            (r#"{"kernel": "se,rq"}"#, "found 2"),
        ] {
            let message = serde_json::from_str::<ModelSpec>(text).unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
        }
    }
}
