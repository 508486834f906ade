//! `gpbrdf-cli bake`: load, sample, bake, compare, write.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;
use gpbrdf_core::{
    AtomicFile, BrdfTable, Environment, ExrChannels, ExrPart, Metrics, Model, N_CELLS, Picture, SliceOptions,
    Source, render_env, slice_figure, sphere_figure, write_merl_to, write_table_exr_to,
};

use super::backend::{BackendArgs, Baked};
use super::input::{OutputFolder, environment, open};
use super::model_args::ModelArgs;
use super::report::{Report, Seconds, cell_interval};
use super::terminal::Terminal;

/// Pixels along each side of the pictured spheres.
const PICTURE_SIZE: usize = 160;

#[derive(Args, Debug)]
pub(crate) struct Bake {
    /// A measurement, table or model file, or the name of a built-in material.
    #[arg(default_value = "cherry-235")]
    input: PathBuf,
    /// Folder for the outputs; made if need be.
    #[arg(short, long, value_name = "DIR", default_value = "gpbrdf-out")]
    output: PathBuf,
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten)]
    backend: BackendArgs,
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
        let start = Instant::now();
        OutputFolder::check(&self.output)?;
        let mut seconds = Seconds::default();
        let source = seconds.measure("load", || terminal.stage("reading", || open(&self.input)))?;
        let environment = environment(self.env.as_deref())?;
        let (model, fits) = self.model.sample_and_fit(&source, &mut seconds, terminal)?;
        let baked = self.backend.bake(&model, !self.no_sigma, &mut seconds, terminal)?;
        let compare = !(self.no_metrics && self.no_images);
        let truth = if compare {
            seconds.measure("metrics", || terminal.stage("tabulating the truth", || source.table()))
        } else {
            None
        };
        let mut report = Report::new(&model, &fits, seconds, baked.backend.clone());
        if let (false, Some(truth)) = (self.no_metrics, &truth) {
            let begin = Instant::now();
            report.metrics =
                Some(terminal.stage("comparing", || compare_tables(truth, &baked, &model, &environment))?);
            report.seconds.add("metrics", begin);
        }
        terminal.stage("writing", || {
            self.write(&source, truth.as_deref(), &model, &baked, &environment, &mut report, start)
        })?;
        report.show(self.json, terminal)
    }

    /// Writes all outputs or none.
    #[expect(clippy::too_many_arguments, reason = "the outputs need all of it")]
    fn write(
        &self,
        source: &Source,
        truth: Option<&BrdfTable>,
        model: &Model,
        baked: &Baked,
        environment: &Environment,
        report: &mut Report,
        start: Instant,
    ) -> Result<()> {
        let begin = Instant::now();
        let folder = OutputFolder::create(&self.output)?;
        let mut files = Vec::new();
        let mut create = |name: &str| create_in(&folder, name, &mut report.outputs);
        let (mut binary, mut exr, mut safetensors) =
            (create("table.binary")?, create("table.exr")?, create("model.safetensors")?);
        // Disk and processor at once.
        let (binary_written, exr_written) =
            rayon::join(|| write_merl_to(&mut binary, &baked.mean), || write_exr(&mut exr, baked, truth));
        binary_written.with_context(|| unwritten(&binary))?;
        exr_written.with_context(|| unwritten(&exr))?;
        std::io::Write::write_all(&mut safetensors, &model.to_bytes()?)
            .with_context(|| unwritten(&safetensors))?;
        files.extend([binary, exr, safetensors]);
        if !self.no_images {
            for (name, picture) in [
                ("slice.png", slice_picture(source, truth, baked)?),
                ("sphere.png", sphere_picture(source, truth, baked, environment, report)?),
            ] {
                let mut file = create_in(&folder, name, &mut report.outputs)?;
                picture.write_png(&mut file).with_context(|| unwritten(&file))?;
                files.push(file);
            }
        }
        let mut json = create_in(&folder, "report.json", &mut report.outputs)?;
        report.seconds.add("write", begin);
        report.seconds.add("total", start);
        serde_json::to_writer_pretty(&mut json, report)?;
        std::io::Write::write_all(&mut json, b"\n").with_context(|| unwritten(&json))?;
        files.push(json);
        AtomicFile::commit_all(files)?;
        Ok(())
    }
}

fn create_in(folder: &OutputFolder, name: &str, outputs: &mut Vec<String>) -> Result<AtomicFile> {
    let path = folder.join(name);
    outputs.push(path.display().to_string());
    Ok(AtomicFile::create(path)?)
}

fn unwritten(file: &AtomicFile) -> String {
    format!("cannot write \"{}\"", file.target().display())
}

/// All metrics, with the coverage of the interval of an observation where sigma was baked.
fn compare_tables(
    truth: &BrdfTable,
    baked: &Baked,
    model: &Model,
    environment: &Environment,
) -> Result<Metrics> {
    let noise = model.noise_variances();
    let interval = baked
        .sigma
        .as_ref()
        .map(|sigma| move |cell: usize| cell_interval(model, noise, &baked.mean, sigma, cell));
    let interval = interval.as_ref().map(|f| f as &gpbrdf_core::Interval<'_>);
    Ok(Metrics::new(truth, &baked.mean, environment, interval)?)
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
    let per_channel;
    if let Some(sigma) = &baked.sigma {
        let channels = match sigma.planes() {
            [plane] => ExrChannels::Luminance(plane),
            _ => {
                per_channel = (0..N_CELLS)
                    .map(|cell| std::array::from_fn(|c| sigma.value(cell, c)))
                    .collect::<Vec<[f32; 3]>>();
                ExrChannels::Rgb(&per_channel)
            }
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

fn slice_picture(source: &Source, truth: Option<&BrdfTable>, baked: &Baked) -> Result<Picture> {
    let truth = truth.map(|t| t as &dyn gpbrdf_core::Brdf);
    Ok(slice_figure(&source.name, truth, &baked.mean, None, &SliceOptions::default())?)
}

fn sphere_picture(
    source: &Source,
    truth: Option<&BrdfTable>,
    baked: &Baked,
    environment: &Environment,
    report: &Report,
) -> Result<Picture> {
    let psnr = report.metrics.as_ref().map(|m| m.images.psnr_env);
    let tables: Vec<&BrdfTable> = std::iter::once(&baked.mean).chain(truth).collect();
    let images = render_env(&tables, environment, PICTURE_SIZE);
    Ok(sphere_figure(&source.name, images.get(1), &images[0], None, psnr)?)
}
