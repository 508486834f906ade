//! `gpbrdf-cli learn`: a prior from a library of materials.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::prior::{Colour, LearnOptions, Library, learn};

use super::library::read_materials;
use super::reading::Reading;
use super::terminal::Terminal;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli learn weights.csv scans/*.bsdf --name mine -o mine.safetensors",
))]
pub(crate) struct Learn {
    /// Materials: measurement, table or model files, built-in materials, or tables of Neural BRDF weights, which
    /// hold many. A file replaces Neural BRDF weights of the same name. Scattered measurements are fitted first.
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// File to write.
    #[arg(short, long, value_name = "FILE", default_value = "prior.safetensors")]
    output: PathBuf,
    /// What reports call the prior.
    #[arg(long, value_name = "NAME", default_value = "learned")]
    name: String,
    /// Leave out the materials whose names begin with one of these words.
    #[arg(long, value_name = "WORD,WORD,...", value_delimiter = ',')]
    leave_out: Vec<String>,
    /// Number of directions at which the materials are known.
    #[arg(long, value_name = "N", default_value_t = Library::CENTRES)]
    centres: usize,
    /// The largest number of functions for brightness and for colour.
    #[arg(long, value_name = "N,N", value_delimiter = ',', num_args = 1, default_value = "60,30")]
    functions: Vec<usize>,
    #[command(flatten)]
    reading: Reading,
}

impl Learn {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let [bright, coloured] = self.functions[..] else {
            bail!("--functions: expected two numbers, found {}", self.functions.len());
        };
        let options = LearnOptions { functions: [bright, coloured] };
        let mut file = AtomicFile::create(&self.output)?;
        let library = self.library(terminal)?;
        let prior = terminal.stage("Learning", || anyhow::Ok(learn(&self.name, &library, &options)?))?;
        file.write_all(&prior.to_bytes()?)
            .with_context(|| format!("cannot write \"{}\"", self.output.display()))?;
        file.commit()?;
        let [bright, coloured] = Colour::ALL.map(|colour| (prior.n_functions(colour), prior.left(colour)));
        terminal.summary(&format!(
            "wrote {}: {} functions of {} materials, which leave {:.3} of the logarithm of another's brightness, and \
             {} functions of their colours, which leave {:.3}",
            self.output.display(),
            bright.0,
            prior.materials.len(),
            bright.1,
            coloured.0,
            coloured.1
        ))
    }

    /// All materials.
    fn library(&self, terminal: &Terminal) -> Result<Library> {
        let mut library = Library::new(self.centres)?;
        let is_left_out = |name: &str| self.leave_out.iter().any(|word| name.starts_with(word.as_str()));
        read_materials(&self.inputs, self.reading, is_left_out, terminal, |name, brdf| {
            terminal.stage("Learning", || Ok(library.add(name, brdf)?))
        })?;
        Ok(library)
    }
}
