//! `gpbrdf-cli bake`: measures a source, fits and bakes a model, compares it with the truth and writes it
//! all.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::brdf::N_CELLS;
use gpbrdf_core::figure::{Picture, SliceOptions, slice_figure, sphere_figure};
use gpbrdf_core::formats::{
    ExrChannels, ExrPart, TextureFormat, texture_files, write_merl_to, write_table_exr_to,
};
use gpbrdf_core::judge::render_env;
use gpbrdf_core::{Brdf, BrdfTable, Environment, SigmaTable, Source};

use super::input::{environment, open};
use super::reading::Reading;
use super::terminal::Terminal;
use crate::job::{Backend, Baked, Baking, Job, Judging, ModelSpec, Outcome, Report, Run, Stage, Truth};
use crate::output::OutputFolder;

/// Pixels along each side of the pictured spheres.
const PICTURE_SIZE: usize = 160;

#[derive(Args, Debug)]
pub(crate) struct Bake {
    /// A measurement, table or model file, the name of a built-in material, or - for measured samples from
    /// standard input.
    #[arg(default_value = "cherry-235")]
    input: PathBuf,
    /// Folder for the outputs; made if need be.
    #[arg(short, long, value_name = "DIR", default_value = "gpbrdf-out")]
    output: PathBuf,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    model: ModelSpec,
    /// Write the baked table as a 3-D texture, too, in the order of the lookup shader: .dds, .ktx2, .npy or .bin.
    /// May be repeated.
    #[arg(long, value_name = "FILE", value_parser = texture_path)]
    texture: Vec<PathBuf>,
    /// Where to bake.
    #[arg(long, value_enum, default_value_t)]
    backend: Backend,
    /// Environment map (.hdr or .exr, latitude-longitude) of the image metrics instead of the built-in one.
    #[arg(long, value_name = "FILE")]
    env: Option<PathBuf>,
    /// Write no pictures.
    #[arg(long)]
    no_images: bool,
    /// Do not compare with the truth; its table is not computed.
    #[arg(long)]
    no_metrics: bool,
    /// Do not bake the standard deviation.
    #[arg(long)]
    no_sigma: bool,
    /// Print the report as JSON on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
}

impl Bake {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let mut run = Run::new(terminal.clone());
        OutputFolder::check(&self.output)?;
        let source = run.stage(Stage::Load, || open(&self.input, self.reading, terminal))?;
        self.model.check(&source)?;
        let environment = environment(self.env.as_deref())?;
        let is_compared = !(self.no_metrics && self.no_images);
        let outcome = run.job(&Job {
            baking: Some(Baking { backend: self.backend, sigma: !self.no_sigma }),
            truth: if is_compared { Truth::Tabulated } else { Truth::Unwanted },
            judging: if self.no_metrics { Judging::Nothing } else { Judging::All(&environment) },
            ..Job::new(&source, &self.model)
        })?;
        let mut outputs = run.stage(Stage::Write, || {
            let mut outputs = Outputs::new(&self.output)?;
            outputs.write_model(&outcome)?;
            outputs.write_textures(&self.texture, &outcome)?;
            if !self.no_images {
                outputs.write_pictures(&source, &outcome, &environment)?;
            }
            Ok(outputs)
        })?;
        let report = outputs.write_report(Report::new(&outcome, run.seconds()))?;
        outputs.commit()?;
        terminal.report(&report, self.json)
    }
}

/// The files of a run, which appear together at its end.
struct Outputs {
    folder: OutputFolder,
    files: Vec<AtomicFile>,
}

impl Outputs {
    fn new(folder: &Path) -> Result<Self> {
        Ok(Self { folder: OutputFolder::create(folder)?, files: Vec::new() })
    }

    /// Adds a file, which `write` fills.
    fn add(&mut self, name: &str, write: impl FnOnce(&mut AtomicFile) -> Result<()>) -> Result<()> {
        let mut file = AtomicFile::create(self.folder.join(name))?;
        write(&mut file).with_context(|| unwritten(&file))?;
        self.files.push(file);
        Ok(())
    }

    /// Adds the model and its tables.
    fn write_model(&mut self, outcome: &Outcome) -> Result<()> {
        if let Some(baked) = &outcome.baked {
            let mut binary = AtomicFile::create(self.folder.join("table.binary"))?;
            let mut exr = AtomicFile::create(self.folder.join("table.exr"))?;
            let truth = outcome.truth.as_deref();
            // One file keeps the disk busy while the other one is compressed.
            let (binary_written, exr_written) =
                rayon::join(|| write_merl_to(&mut binary, &baked.mean), || write_exr(&mut exr, baked, truth));
            binary_written.with_context(|| unwritten(&binary))?;
            exr_written.with_context(|| unwritten(&exr))?;
            self.files.extend([binary, exr]);
        }
        let model = outcome.fitted.model.to_bytes()?;
        self.add("model.safetensors", |file| Ok(file.write_all(&model)?))
    }

    /// Adds textures of the tables.
    fn write_textures(&mut self, paths: &[PathBuf], outcome: &Outcome) -> Result<()> {
        let Some(baked) = &outcome.baked else { return Ok(()) };
        for path in paths {
            let format = TextureFormat::of(path).context("expected a texture")?;
            self.files.extend(texture_files(path, format, &baked.mean, baked.sigma.as_deref())?);
        }
        Ok(())
    }

    /// Adds a picture of one slice and one of spheres.
    fn write_pictures(
        &mut self,
        source: &Source,
        outcome: &Outcome,
        environment: &Environment,
    ) -> Result<()> {
        let Some(baked) = &outcome.baked else { return Ok(()) };
        let truth = outcome.truth.as_deref();
        let psnr = outcome.metrics.as_ref().map(|metrics| metrics.images.psnr_env);
        let slice = slice_picture(&source.name, truth, &baked.mean)?;
        self.add("slice.png", |file| Ok(slice.write_png(file)?))?;
        let sphere = sphere_picture(&source.name, truth, &baked.mean, environment, psnr)?;
        self.add("sphere.png", |file| Ok(sphere.write_png(file)?))
    }

    /// Adds the report, which names all files, itself too.
    fn write_report(&mut self, mut report: Report) -> Result<Report> {
        let json = self.folder.join("report.json");
        let paths = self.files.iter().map(AtomicFile::target).chain([json.as_path()]);
        report.outputs = paths.map(|path| path.display().to_string()).collect();
        self.add("report.json", |file| {
            serde_json::to_writer_pretty(&mut *file, &report)?;
            Ok(file.write_all(b"\n")?)
        })?;
        Ok(report)
    }

    fn commit(self) -> Result<()> {
        Ok(AtomicFile::commit_all(self.files)?)
    }
}

/// The name of a texture, whose end says its format.
fn texture_path(name: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(name);
    match TextureFormat::of(&path) {
        Some(_) => Ok(path),
        None => Err("expected a name that ends in .dds, .ktx2, .npy or .bin".to_owned()),
    }
}

fn unwritten(file: &AtomicFile) -> String {
    format!("cannot write \"{}\"", file.target().display())
}

fn write_exr(file: &mut AtomicFile, baked: &Baked, truth: Option<&BrdfTable>) -> std::io::Result<()> {
    let rgb = |name, description, values| ExrPart {
        name,
        description,
        unit: "sr^-1",
        channels: ExrChannels::Rgb(values),
    };
    let mut parts =
        vec![rgb("mean", "predictive mean of the BRDF (median of the value)", baked.mean.values())];
    let per_channel = baked.sigma.as_deref().map(channels).unwrap_or_default();
    if let Some(sigma) = &baked.sigma {
        let channels = match sigma.planes() {
            [plane] => ExrChannels::Luminance(plane),
            _ => ExrChannels::Rgb(&per_channel),
        };
        let description = "posterior standard deviation of the latent target";
        parts.push(ExrPart { name: "sigma", description, unit: "target units", channels });
    }
    let difference: Vec<[f32; 3]>;
    if let Some(truth) = truth {
        difference = std::iter::zip(baked.mean.values(), truth.values())
            .map(|(a, b)| std::array::from_fn(|c| a[c] - b[c]))
            .collect();
        parts.push(rgb("truth", "the source", truth.values()));
        parts.push(rgb("difference", "mean - truth", &difference));
    }
    write_table_exr_to(file, &parts)
}

/// Sigma of each channel in every cell, where the channels have a plane each; else nothing.
fn channels(sigma: &SigmaTable) -> Vec<[f32; 3]> {
    let cells = if sigma.planes().len() > 1 { N_CELLS } else { 0 };
    (0..cells).map(|cell| std::array::from_fn(|c| sigma.value(cell, c))).collect()
}

fn slice_picture(name: &str, truth: Option<&BrdfTable>, mean: &BrdfTable) -> Result<Picture> {
    let truth = truth.map(|truth| truth as &dyn Brdf);
    Ok(slice_figure(name, truth, mean, &SliceOptions::default())?)
}

fn sphere_picture(
    name: &str,
    truth: Option<&BrdfTable>,
    mean: &BrdfTable,
    environment: &Environment,
    psnr: Option<f64>,
) -> Result<Picture> {
    let tables: Vec<&BrdfTable> = std::iter::once(mean).chain(truth).collect();
    let images = render_env(&tables, environment, PICTURE_SIZE);
    Ok(sphere_figure(name, images.get(1), &images[0], psnr)?)
}
