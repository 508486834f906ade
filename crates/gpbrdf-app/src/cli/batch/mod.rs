//! `gpbrdf-cli batch`: what `bake` does, for many materials.

mod inputs;
mod memory;
mod part;
mod record;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, bail};
use clap::Args;
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::formats::sha256_file;
use gpbrdf_core::{Environment, Progress};
use rayon::ThreadPoolBuilder;
use serde_json::{Map, Value, json};

use self::inputs::Input;
use self::memory::Memory;
use self::part::Part;
use self::record::{End, Line, Record};
use super::input::open;
use super::json::to_json_line;
use super::making::{Making, Product, Wanted};
use super::terminal::Terminal;
use crate::job::{Observer, PriorName, Run, Stage, memory_bytes};
use crate::message::said_once;
use crate::output::OutputFolder;

/// The largest number of failed materials that the last message names.
const NAMED: usize = 5;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli batch \"scans/**/*.bsdf\" -o tables --write model,report",
    "\n  gpbrdf-cli batch scans/*.csv --part 2/4",
))]
pub(crate) struct Batch {
    /// Measurements, tables and model files, patterns of their names such as "scans/*.csv" or "scans/**/*.bsdf", and
    /// built-in materials.
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// Folder for the outputs; made if need be. Each material gets a folder in it, and batch.jsonl a line.
    #[arg(help_heading = "Output", short, long, value_name = "DIR", default_value = "gpbrdf-out")]
    output: PathBuf,
    /// The files to write of each material.
    #[arg(
        help_heading = "Output",
        long,
        value_enum,
        value_name = "FILE,FILE,...",
        value_delimiter = ',',
        default_values_t = Product::USUAL,
        hide_default_value = true
    )]
    write: Vec<Product>,
    /// The largest number of materials at a time [default: as many as there are worker threads]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Memory that they may take together, in GiB [default: four fifths of what is available]
    #[arg(long, value_name = "GIB", value_parser = positive)]
    memory: Option<f64>,
    /// Make the K-th of N parts of the materials only, for the K-th of N machines with the same command.
    #[arg(long, value_name = "K/N")]
    part: Option<Part>,
    #[command(flatten)]
    making: Making,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a positive number".to_owned()),
    }
}

impl Batch {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        OutputFolder::check(&self.output)?;
        let mut inputs = inputs::expand(&self.inputs)?;
        if let Some(part) = self.part {
            inputs = part.select(inputs);
        }
        let (environment, options) = (self.making.environment()?, self.options()?);
        let _folder = OutputFolder::create(&self.output)?;
        let record = Record::open(&self.output, self.part)?;
        if record.unreadable > 0 {
            terminal.note(&format!(
                "{}: {} lines of records were cut off or are of another version; their materials are made again",
                self.output.display(),
                record.unreadable
            ));
        }
        let memory = Memory::new(self.memory);
        let work = Work {
            batch: self,
            inputs: &inputs,
            environment: &environment,
            options: &options,
            record: &record,
            memory: &memory,
            terminal,
            ended: Mutex::default(),
        };
        let ended = terminal.stage("Making materials", || work.all())?;
        if ended.known > 0 {
            terminal.note(&format!("{} of {} materials were finished before", ended.known, inputs.len()));
        }
        if ended.failed.is_empty() {
            return Ok(());
        }
        let mut named = ended.failed[..ended.failed.len().min(NAMED)].join(", ");
        if ended.failed.len() > NAMED {
            named.push_str(&format!(" and {} more", ended.failed.len() - NAMED));
        }
        bail!(
            "{} of {} materials failed, as \"{}\" says: {named}",
            ended.failed.len(),
            inputs.len(),
            record.path().display()
        )
    }

    /// Everything besides its file that the outputs of a material depend on.
    fn options(&self) -> Result<Value> {
        let prior = match &self.making.model.prior {
            PriorName::File(path) => Some(sha256_file(path)?),
            PriorName::BuiltIn | PriorName::None => None,
        };
        Ok(json!({
            "version": env!("CARGO_PKG_VERSION"),
            "model": self.making.model,
            "prior_sha256": prior,
            "reading": self.making.reading,
            "backend": self.making.backend,
            "env_sha256": self.making.env.as_ref().map(sha256_file).transpose()?,
            "metrics": !self.making.no_metrics,
            "sigma": !self.making.no_sigma,
            "write": self.write.iter().map(|product| product.file_name(self.making.figures)).collect::<Vec<_>>(),
        }))
    }
}

/// All that the threads of a batch share.
struct Work<'a> {
    batch: &'a Batch,
    inputs: &'a [Input],
    environment: &'a Environment,
    options: &'a Value,
    record: &'a Record,
    memory: &'a Memory,
    terminal: &'a Terminal,
    ended: Mutex<Ended>,
}

/// The materials that are through.
#[derive(Debug, Default)]
struct Ended {
    count: usize,
    /// How many of them an earlier run had finished.
    known: usize,
    failed: Vec<String>,
    /// What stops the whole batch.
    error: Option<anyhow::Error>,
}

impl Work<'_> {
    /// Makes all materials, several at a time, each with its share of the threads.
    fn all(&self) -> Result<Ended> {
        let threads = rayon::current_num_threads();
        let jobs = self.batch.jobs.map_or(threads, usize::from).min(self.inputs.len());
        let pools = (0..jobs)
            .map(|_| ThreadPoolBuilder::new().num_threads(threads.div_ceil(jobs)).build())
            .collect::<Result<Vec<_>, _>>()
            .context("cannot start worker threads")?;
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for pool in &pools {
                scope.spawn(|| {
                    while let Some(input) = self.inputs.get(next.fetch_add(1, Ordering::Relaxed)) {
                        if !pool.install(|| self.one(input)) {
                            return;
                        }
                    }
                });
            }
        });
        let mut ended = std::mem::take(&mut *self.ended.lock().unwrap_or_else(PoisonError::into_inner));
        match ended.error.take() {
            Some(error) => Err(error),
            None => Ok(ended),
        }
    }

    /// Makes one material, unless an earlier run has, and tells of it. Returns whether the batch goes on.
    fn one(&self, input: &Input) -> bool {
        // A file that cannot be read is reported when it is opened.
        let sha256 = if input.path.is_file() { sha256_file(&input.path).ok() } else { None };
        let known = self.record.finished(&input.name, sha256.as_deref(), self.options);
        let line = known.cloned().unwrap_or_else(|| self.make(input, sha256));
        let mut ended = self.ended.lock().unwrap_or_else(PoisonError::into_inner);
        if ended.error.is_some() {
            return false;
        }
        ended.count += 1;
        ended.known += usize::from(known.is_some());
        if let End::Failed { error } = &line.end {
            self.terminal.error(&format!("{}: {error}", line.name));
            ended.failed.push(line.name.clone());
        }
        if let Err(error) = self.tell(&line, known.is_none()) {
            ended.error = Some(error);
            return false;
        }
        self.terminal.progress(Progress::of_share(ended.count as f64 / self.inputs.len() as f64));
        true
    }

    /// Writes a line to standard output and, if it is new, to the record.
    fn tell(&self, line: &Line, is_new: bool) -> Result<()> {
        let text = to_json_line(line)?;
        if is_new {
            self.record.append(&text)?;
        }
        self.terminal.print(&text)
    }

    /// Makes one material.
    fn make(&self, input: &Input, sha256: Option<String>) -> Line {
        let mut run = Run::new(Named { name: input.name.clone(), terminal: self.terminal.clone() });
        let mut line = Line {
            name: input.name.clone(),
            file: input.path.display().to_string(),
            sha256,
            options: self.options.clone(),
            seconds: Value::Null,
            notes: Value::Null,
            end: End::Failed { error: String::new() },
        };
        line.end = self
            .files(input, &mut run, &mut line.sha256)
            .unwrap_or_else(|error| End::Failed { error: said_once(&error) });
        line.seconds = json!(run.seconds());
        line
    }

    /// Writes the files of one material.
    fn files(&self, input: &Input, run: &mut Run, sha256: &mut Option<String>) -> Result<End> {
        let folder = self.batch.output.join(&input.name);
        // A run that was killed leaves them behind; this one alone writes to the folder.
        AtomicFile::remove_abandoned(&folder)?;
        let making = &self.batch.making;
        let source = run.stage(Stage::Load, || open(&input.path, making.reading, self.terminal))?;
        if !source.sha256.is_empty() {
            *sha256 = Some(source.sha256.clone());
        }
        let _reserved = self.memory.reserve(memory_bytes(&source, &making.model));
        let wanted = Wanted { folder: &folder, products: self.batch.write.clone(), textures: Vec::new() };
        let (report, paths) = making.make(run, &source, self.environment, wanted)?;
        let mut outputs = Map::new();
        for path in paths {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            outputs.insert(name, json!(bytes(&path)?));
        }
        Ok(End::Finished { converged: report.converged, metrics: json!(report.metrics), outputs })
    }
}

fn bytes(path: &Path) -> Result<u64> {
    let metadata = path.metadata().with_context(|| format!("cannot read \"{}\"", path.display()))?;
    Ok(metadata.len())
}

/// Passes on what a run has to say, with the name of its material.
struct Named {
    name: String,
    terminal: Terminal,
}

impl Observer for Named {
    fn detail(&self, text: &str) {
        self.terminal.detail(&format!("{}: {text}", self.name));
    }

    fn note(&self, text: &str) {
        self.terminal.note(&format!("{}: {text}", self.name));
    }

    fn warn(&self, text: &str) {
        self.terminal.warn(&format!("{}: {text}", self.name));
    }
}
