//! From a source to the files of its material: what `bake` does once and `batch` for many.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::brdf::N_CELLS;
use gpbrdf_core::figure::{Figure, FigureOptions, SliceOptions, slice_figure};
use gpbrdf_core::formats::{
    ExrChannels, ExrPart, TextureFormat, texture_files, write_merl_to, write_table_exr_to,
};
use gpbrdf_core::{Brdf, BrdfTable, Environment, SigmaTable, Source};

use super::figure_args::{FigureSize, title};
use super::input::environment;
use super::json::to_json;
use super::reading::Reading;
use crate::job::{
    Backend, Baked, Baking, FigureKind, Job, Judging, ModelSpec, Outcome, Portrait, Report, Run, Stage,
    Subject, Truth,
};
use crate::output::OutputFolder;

/// Rows and columns of the slices that are drawn.
const SLICE_SIZE: usize = 512;

/// How to make a material out of a source.
#[derive(Args, Debug)]
pub(super) struct Making {
    #[command(flatten)]
    pub(super) reading: Reading,
    #[command(flatten)]
    pub(super) model: ModelSpec,
    /// Where to bake.
    #[arg(help_heading = "Output", long, value_enum, default_value_t)]
    pub(super) backend: Backend,
    /// Environment map (.hdr or .exr, latitude-longitude) of the image metrics instead of the built-in one.
    #[arg(help_heading = "Output", long, value_name = "FILE")]
    pub(super) env: Option<PathBuf>,
    /// Do not compare with the truth; its table is not computed.
    #[arg(help_heading = "Output", long)]
    pub(super) no_metrics: bool,
    /// Do not bake the standard deviation.
    #[arg(help_heading = "Output", long)]
    pub(super) no_sigma: bool,
    /// The kind of file of the figures of slice and sphere.
    #[arg(help_heading = "Output", long, value_enum, value_name = "KIND", default_value_t)]
    pub(super) figures: FigureKind,
    #[command(flatten)]
    pub(super) figure_size: FigureSize,
}

/// A file of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Product {
    /// The mean as a MERL table, table.binary.
    Binary,
    /// Mean, standard deviation, truth and difference, table.exr.
    Exr,
    /// The fitted model, model.safetensors.
    Model,
    /// Hyper-parameters, times and metrics, report.json.
    Report,
    /// Truth, prediction and difference of a slice, slice.png (or .svg, .pdf with --figures).
    Slice,
    /// Truth, prediction and difference of a sphere, sphere.png (or .svg, .pdf with --figures).
    Sphere,
    /// The texture of the lookup shader, table.dds.
    Dds,
    /// The texture of the lookup shader, table.ktx2.
    Ktx2,
    /// The texture of the lookup shader, table.npy.
    Npy,
    /// The texture of the lookup shader, table.bin, and its description, table.bin.json.
    Bin,
}

impl Product {
    /// What is written where nobody asks for anything else.
    pub(super) const USUAL: [Self; 6] =
        [Self::Binary, Self::Exr, Self::Model, Self::Report, Self::Slice, Self::Sphere];

    /// The name of its file.
    pub(super) fn file_name(self, figures: FigureKind) -> String {
        match self {
            Self::Slice | Self::Sphere => format!("{}.{}", self.stem(), figures.extension()),
            _ => self.stem().to_owned(),
        }
    }

    /// The name of its file, without the extension of a figure.
    fn stem(self) -> &'static str {
        match self {
            Self::Binary => "table.binary",
            Self::Exr => "table.exr",
            Self::Model => "model.safetensors",
            Self::Report => "report.json",
            Self::Slice => "slice",
            Self::Sphere => "sphere",
            Self::Dds => "table.dds",
            Self::Ktx2 => "table.ktx2",
            Self::Npy => "table.npy",
            Self::Bin => "table.bin",
        }
    }

    pub(super) fn is_picture(self) -> bool {
        matches!(self, Self::Slice | Self::Sphere)
    }

    fn texture_format(self) -> Option<TextureFormat> {
        TextureFormat::of(Path::new(self.stem()))
    }
}

/// The files to write of one material.
#[derive(Debug)]
pub(super) struct Wanted<'a> {
    pub(super) folder: &'a Path,
    /// Files in that folder.
    pub(super) products: Vec<Product>,
    /// Textures anywhere.
    pub(super) textures: Vec<PathBuf>,
}

impl Making {
    /// The environment of the image metrics.
    ///
    /// # Errors
    /// A map that cannot be read.
    pub(super) fn environment(&self) -> Result<Environment> {
        environment(self.env.as_deref())
    }

    /// Makes the material and writes the wanted files, all of them or, if anything fails, none. Returns the report and
    /// the paths of the files.
    ///
    /// # Errors
    /// Options that contradict each other or the source, and those of the run and of writing.
    pub(super) fn make(
        &self,
        run: &mut Run,
        source: &Source,
        environment: &Environment,
        wanted: Wanted<'_>,
    ) -> Result<(Report, Vec<PathBuf>)> {
        self.model.check(source)?;
        let is_compared = !self.no_metrics || wanted.products.iter().any(|product| product.is_picture());
        let outcome = run.job(&Job {
            baking: Some(Baking { backend: self.backend, sigma: !self.no_sigma }),
            truth: if is_compared { Truth::Tabulated } else { Truth::Unwanted },
            judging: if self.no_metrics { Judging::Nothing } else { Judging::All(environment) },
            ..Job::new(source, &self.model)
        })?;
        let title = title(&source.name, &outcome.fitted.model);
        let drawn = match &outcome.baked {
            Some(baked) if wanted.products.contains(&Product::Sphere) => {
                let subject = Subject {
                    title: &title,
                    truth: outcome.truth.as_deref(),
                    mean: &baked.mean,
                    sigma: baked.sigma.as_deref(),
                    psnr: outcome.metrics.as_ref().map(|metrics| metrics.images.psnr_env),
                };
                let observer = run.observer();
                let draw = || Ok(Portrait::new(&subject, environment, self.backend, &*observer)?.figure());
                Some(run.stage(Stage::Render, draw)?)
            }
            _ => None,
        };
        let mut outputs = run.stage(Stage::Write, || {
            let mut outputs = Outputs::new(wanted, self)?;
            outputs.write_model(&outcome)?;
            outputs.write_textures(&outcome)?;
            outputs.write_figures(&title, &outcome, drawn.as_ref())?;
            Ok(outputs)
        })?;
        let report = outputs.write_report(Report::new(&outcome, run.seconds()))?;
        let paths = outputs.commit()?;
        Ok((report, paths))
    }
}

/// The files of a run, which appear together at its end.
struct Outputs<'a> {
    wanted: Wanted<'a>,
    figures: FigureKind,
    figure_size: FigureOptions,
    folder: OutputFolder,
    files: Vec<AtomicFile>,
}

impl<'a> Outputs<'a> {
    fn new(wanted: Wanted<'a>, making: &Making) -> Result<Self> {
        let (figures, figure_size) = (making.figures, making.figure_size.into());
        let folder = OutputFolder::create(wanted.folder)?;
        Ok(Self { folder, wanted, figures, figure_size, files: Vec::new() })
    }

    /// Starts the file of a product, if it is wanted.
    fn start(&self, product: Product) -> Result<Option<AtomicFile>> {
        let is_wanted = self.wanted.products.contains(&product);
        Ok(is_wanted
            .then(|| AtomicFile::create(self.folder.join(&product.file_name(self.figures))))
            .transpose()?)
    }

    /// Adds the file of a product, which `write` fills, if it is wanted.
    fn add(&mut self, product: Product, write: impl FnOnce(&mut AtomicFile) -> Result<()>) -> Result<()> {
        let Some(mut file) = self.start(product)? else { return Ok(()) };
        write(&mut file).with_context(|| unwritten(&file))?;
        self.files.push(file);
        Ok(())
    }

    /// Adds the model and its tables.
    fn write_model(&mut self, outcome: &Outcome) -> Result<()> {
        if let Some(baked) = &outcome.baked {
            let (mut binary, mut exr) = (self.start(Product::Binary)?, self.start(Product::Exr)?);
            let truth = outcome.truth.as_deref();
            // One file keeps the disk busy while the other one is compressed.
            let (binary_written, exr_written) = rayon::join(
                || binary.as_mut().map_or(Ok(()), |file| write_merl_to(file, &baked.mean)),
                || exr.as_mut().map_or(Ok(()), |file| write_exr(file, baked, truth)),
            );
            for (file, written) in [(binary, binary_written), (exr, exr_written)] {
                let Some(file) = file else { continue };
                written.with_context(|| unwritten(&file))?;
                self.files.push(file);
            }
        }
        self.add(Product::Model, |file| Ok(file.write_all(&outcome.fitted.model.to_bytes()?)?))
    }

    /// Adds textures of the tables.
    fn write_textures(&mut self, outcome: &Outcome) -> Result<()> {
        let Some(baked) = &outcome.baked else { return Ok(()) };
        let named = self.wanted.textures.iter().map(|path| Ok((path.clone(), texture_format(path)?)));
        let products = self.wanted.products.iter().filter_map(|product| {
            Some(Ok((self.folder.join(&product.file_name(self.figures)), product.texture_format()?)))
        });
        for texture in named.chain(products).collect::<Result<Vec<_>>>()? {
            let (path, format) = texture;
            self.files.extend(texture_files(path, format, &baked.mean, baked.sigma.as_deref())?);
        }
        Ok(())
    }

    /// Adds the figures of one slice and of a sphere.
    fn write_figures(&mut self, title: &str, outcome: &Outcome, sphere: Option<&Figure>) -> Result<()> {
        let Some(baked) = &outcome.baked else { return Ok(()) };
        let (kind, size) = (self.figures.into(), self.figure_size);
        let truth = outcome.truth.as_deref().map(|truth| truth as &dyn Brdf);
        self.add(Product::Slice, |file| {
            let options = SliceOptions { size: SLICE_SIZE, ..SliceOptions::default() };
            Ok(slice_figure(title, truth, &*baked.mean, &options)?.write(file, kind, &size)?)
        })?;
        let Some(sphere) = sphere else { return Ok(()) };
        self.add(Product::Sphere, |file| Ok(sphere.write(file, kind, &size)?))
    }

    /// Adds the report, which names all files, itself too.
    fn write_report(&mut self, mut report: Report) -> Result<Report> {
        let own = self
            .wanted
            .products
            .contains(&Product::Report)
            .then(|| self.folder.join(&Product::Report.file_name(self.figures)));
        let paths = self.files.iter().map(AtomicFile::target).chain(own.as_deref());
        report.outputs = paths.map(|path| path.display().to_string()).collect();
        self.add(Product::Report, |file| Ok(file.write_all(to_json(&report)?.as_bytes())?))?;
        Ok(report)
    }

    /// Gives all files their names, which it returns.
    fn commit(self) -> Result<Vec<PathBuf>> {
        let paths = self.files.iter().map(|file| file.target().to_owned()).collect();
        AtomicFile::commit_all(self.files)?;
        Ok(paths)
    }
}

fn texture_format(path: &Path) -> Result<TextureFormat> {
    TextureFormat::of(path).context("expected a texture")
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
