//! `gpbrdf-cli check`: whether a renderer can rely on a material.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use gpbrdf_core::MaterialOptions;
use gpbrdf_core::judge::{CheckOptions, MaterialCheck};
use serde::Serialize;

use super::input::open;
use super::json::to_json;
use super::reading::Reading;
use super::terminal::Terminal;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli check satin_purple.bsdf --strict",
))]
pub(crate) struct Check {
    /// A table, measurement or model file, or a built-in material.
    input: PathBuf,
    /// Scale the material where it reflects more light than it receives, as renderers can ask for.
    #[arg(long)]
    energy_conserving: bool,
    /// Directions drawn at each elevation to test the sampling.
    #[arg(long, value_name = "N", default_value_t = 1_000_000)]
    #[arg(value_parser = clap::value_parser!(u32).range(1000..=100_000_000))]
    samples: u32,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Fail if something does not hold.
    #[arg(long)]
    strict: bool,
    /// Print JSON on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Checked {
    input: String,
    energy_conserving: bool,
    #[serde(flatten)]
    check: MaterialCheck,
}

impl Check {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let source = open(&self.input, Reading::default(), terminal)?;
        let options = CheckOptions {
            samples: self.samples as usize,
            seed: self.seed,
            material: MaterialOptions { energy_conserving: self.energy_conserving },
            ..CheckOptions::default()
        };
        let brdf = source.brdf()?;
        let table = terminal.stage("Tabulating", || source.table())?;
        let check = terminal.stage("Checking", || MaterialCheck::new(brdf, &table, &options))?;
        let failures = check.failures.len();
        if self.json {
            let checked =
                Checked { input: source.origin(), energy_conserving: self.energy_conserving, check };
            terminal.print(&to_json(&checked)?)?;
        } else {
            terminal.summary(&format!("{}\n{}", source.origin(), lines(&check).join("\n")))?;
        }
        if self.strict && failures > 0 {
            bail!(
                "{}: expected a material that passes every check, found {failures} that {} not",
                source.origin(),
                if failures == 1 { "does" } else { "do" }
            );
        }
        Ok(())
    }
}

/// The report for people.
fn lines(check: &MaterialCheck) -> Vec<String> {
    let (reciprocity, energy) = (check.reciprocity, check.energy);
    let [theta_i, theta_o, phi] = reciprocity.largest_at;
    let channel = ["red", "green", "blue"].get(energy.channel).copied().unwrap_or_default();
    let mut lines = vec![
        format!(
            "  reciprocity: median difference {:.2} %, largest {:.1} % at theta_i {theta_i:.0}, theta_o {theta_o:.0}, \
             azimuth {phi:.0} degrees",
            100.0 * reciprocity.median,
            100.0 * reciprocity.largest
        ),
        format!(
            "  energy: largest albedo {:.3} in {channel} at theta_o {:.1} degrees",
            energy.largest_albedo, energy.theta_o
        ),
        format!(
            "  values: {} negative or not finite, {} cells without data",
            check.bad_values, check.missing_cells
        ),
        "  sampling by luminance, variances and weights in units of the albedo:".to_owned(),
        "    theta_o  albedo  p of chi-square  variance  cosine's variance  99.9 % of weights below"
            .to_owned(),
    ];
    lines.extend(check.sampling.iter().map(|view| {
        let mean = view.albedo.iter().sum::<f32>() / 3.0;
        format!(
            "    {:7.0}  {mean:6.3}  {:15.3}  {:8.3}  {:17.3}  {:23.2}",
            view.theta_o, view.p_value, view.variance, view.cosine_variance, view.weight_999
        )
    }));
    if check.failures.is_empty() {
        lines.push("  everything holds".to_owned());
    } else {
        lines.extend(check.failures.iter().map(|failure| format!("  does not hold: {failure}")));
    }
    lines
}
