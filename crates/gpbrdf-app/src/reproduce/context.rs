//! Options and materials, which all experiments share, and the comparison of a model with its truth.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
use gpbrdf_core::brdf::analytic::NeuralBrdf;
use gpbrdf_core::figure::{Axis, Curve, Figure, FigureOptions, Panel, Plot};
use gpbrdf_core::formats::{merl_material_name, sha256_file};
use gpbrdf_core::model::PriorChoice;
use gpbrdf_core::{
    Brdf, BrdfTable, Content, Environment, FitOptions, LatticeLayout, Layout, Metrics, Model, SampleSet,
    Source, Symmetry, bake_mean, bake_sigma, detect_symmetry, fit,
};

use super::prior::Materials;
use super::table::Table;
use crate::job::{FigureKind, Observer, judge, samples_within};

/// The results of an experiment: tables, and pictures with the names of their files.
#[derive(Debug, Default)]
pub(crate) struct Outcome {
    pub(crate) tables: Vec<Table>,
    pub(crate) figures: Vec<(String, Vec<u8>)>,
}

impl Outcome {
    /// Adds curves.
    pub(super) fn plot(
        &mut self,
        context: &Context,
        name: &str,
        title: &str,
        x: Axis,
        y: Axis,
        curves: Vec<Curve>,
    ) -> Result<()> {
        self.figure(context, name, &curves_figure(title, x, y, curves))
    }

    /// Adds a figure as a file of this name, without its extension.
    pub(super) fn figure(&mut self, context: &Context, name: &str, figure: &Figure) -> Result<()> {
        let mut bytes = Vec::new();
        let file = format!("{name}.{}", context.figures.extension());
        figure
            .write(&mut bytes, context.figures.into(), &context.figure_size)
            .with_context(|| format!("cannot draw \"{file}\""))?;
        self.figures.push((file, bytes));
        Ok(())
    }
}

/// The materials of the paper's table 2, and the one of its figures.
pub(crate) const PAPER_MATERIALS: [&str; 7] = [
    "red-plastic",
    "purple-paint",
    "blue-rubber",
    "blue-metallic-paint",
    "silver-paint",
    "violet-rubber",
    "cherry-235",
];

/// The largest number of samples of a dense fit, whatever the budget: its matrix takes 3.2 GB.
const MAX_DENSE: usize = 20_000;

/// A figure of curves with a legend.
pub(super) fn curves_figure(title: &str, x: Axis, y: Axis, curves: Vec<Curve>) -> Figure {
    Figure::of_panels(title, vec![Panel::plot("", Plot { x, y, curves, legend: true }, 0.62)], "")
}

#[derive(Debug)]
pub(crate) struct Context {
    /// How figures are written.
    pub(crate) figures: FigureKind,
    pub(crate) figure_size: FigureOptions,
    pub(crate) quick: bool,
    /// Seconds for one dense fit.
    pub(crate) budget: f64,
    pub(crate) environment: Environment,
    /// Stand-ins for the paper's materials, [`PAPER_MATERIALS`].
    pub(crate) built_in: Vec<Source>,
    /// The measurements found with `--data`.
    pub(crate) measured: Vec<Source>,
    /// The only materials to use; all if empty.
    pub(crate) only: Vec<String>,
    pub(crate) neural: Vec<(String, NeuralBrdf)>,
    /// The materials of `--library` and, where it is given, the measurements.
    pub(crate) library: Option<Materials>,
}

/// A material of an experiment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Material<'a> {
    source: &'a Source,
    /// What people read about its truth.
    pub(super) origin: &'a str,
}

impl<'a> Material<'a> {
    pub(super) fn name(&self) -> &'a str {
        &self.source.name
    }

    /// The table that predictions are compared with.
    ///
    /// # Errors
    /// If the source is scattered samples.
    pub(super) fn truth(&self) -> Result<Cow<'a, BrdfTable>> {
        Ok(self.source.table()?)
    }

    /// The source as a function of directions.
    ///
    /// # Errors
    /// If the source is scattered samples.
    pub(super) fn brdf(&self) -> Result<&'a dyn Brdf> {
        Ok(self.source.brdf()?)
    }

    /// Measures the source on the default lattice of about `count` nodes.
    ///
    /// # Errors
    /// If the source is scattered samples, or the count out of range.
    pub(super) fn lattice_samples(&self, count: usize) -> Result<SampleSet> {
        self.measure(|symmetry| Ok(LatticeLayout::with_samples(count, symmetry)?))
    }

    /// Measures the source on a lattice that relies on the symmetry of the source.
    ///
    /// # Errors
    /// If the source is scattered samples, or the lattice broken.
    pub(super) fn measure(
        &self,
        layout: impl FnOnce(Symmetry) -> Result<LatticeLayout>,
    ) -> Result<SampleSet> {
        let lattice = layout(detect_symmetry(self.source.brdf()?))?;
        Ok(self.source.measure(&Layout::Lattice(lattice))?)
    }
}

/// A fitted model, its table and its metrics.
#[derive(Debug)]
pub(super) struct Fitted {
    pub(super) model: Model,
    pub(super) mean: BrdfTable,
    pub(super) metrics: Metrics,
    pub(super) fit_seconds: f64,
}

impl Context {
    fn wanted(&self, name: &str) -> bool {
        self.only.is_empty() || self.only.iter().any(|only| only == name)
    }

    /// The paper's materials: the user's MERL files as far as they are there, else reconstructions.
    ///
    /// # Errors
    /// If `--materials` names none of them.
    pub(super) fn paper_materials(&self) -> Result<Vec<Material<'_>>> {
        let of = |built_in: &'_ Source| {
            self.measured.iter().find(|s| s.name == built_in.name && s.kind.contains("MERL"))
        };
        let wanted = self.built_in.iter().filter(|source| self.wanted(&source.name));
        let found: Vec<Material<'_>> = wanted
            .map(|built_in| match of(built_in) {
                Some(source) => Material { source, origin: "MERL" },
                None => Material { source: built_in, origin: "reconstructed from a published fit" },
            })
            .collect();
        if found.is_empty() {
            bail!(
                "--materials: expected at least one of {}, found {}",
                PAPER_MATERIALS.join(", "),
                self.only.join(", ")
            );
        }
        Ok(found)
    }

    /// The measurements of `--data`, or the paper's materials without any.
    ///
    /// # Errors
    /// If `--materials` names none of them.
    pub(super) fn all_materials(&self) -> Result<Vec<Material<'_>>> {
        let measured = self.measured.iter().filter(|source| self.wanted(&source.name));
        let mut found: Vec<_> = measured.map(|source| Material { source, origin: &source.kind }).collect();
        if found.is_empty() {
            found = self.paper_materials()?;
            if self.quick {
                found.truncate(2);
            }
        } else if self.quick {
            found.truncate(3);
        }
        Ok(found)
    }

    /// The RGL measurements of `--data`.
    pub(super) fn rgl_materials(&self) -> Vec<Material<'_>> {
        let rgl =
            self.measured.iter().filter(|source| source.kind.contains("RGL") && self.wanted(&source.name));
        rgl.map(|source| Material { source, origin: &source.kind }).collect()
    }

    /// The largest number of samples whose dense fit with `terms` kernels keeps to the budget of time.
    pub(super) fn dense_samples(&self, terms: usize) -> usize {
        samples_within(self.budget, terms, MAX_DENSE)
    }

    /// Fits a model to samples without a learned prior, bakes it and compares it with the truth. With `interval`
    /// sigma is baked too, for the coverage of the interval.
    pub(super) fn fit_and_compare(
        &self,
        truth: &BrdfTable,
        samples: &SampleSet,
        options: &FitOptions,
        interval: bool,
    ) -> Result<Fitted> {
        let start = Instant::now();
        // The built-in prior knows the materials that it would be judged on.
        let model = fit(samples, &FitOptions { prior: PriorChoice::None, ..options.clone() })?.model;
        self.compare(truth, model, start.elapsed().as_secs_f64(), interval)
    }

    /// Bakes a model and compares it with the truth.
    pub(super) fn compare(
        &self,
        truth: &BrdfTable,
        model: Model,
        fit_seconds: f64,
        interval: bool,
    ) -> Result<Fitted> {
        let mean = bake_mean(&model);
        let sigma = interval.then(|| bake_sigma(&model)).transpose()?;
        let metrics = judge(truth, &model, &mean, sigma.as_ref(), &self.environment)?;
        Ok(Fitted { model, mean, metrics, fit_seconds })
    }
}

/// Every file under `folder` that is an RGL measurement or one of the 100 published MERL tables, sorted by
/// name.
///
/// # Errors
/// If the folder cannot be read or holds none, or a file is damaged.
pub(crate) fn measurements(folder: &Path, observer: &dyn Observer) -> Result<Vec<Source>> {
    let mut files = Vec::new();
    collect(folder, &mut files, 0)?;
    files.sort();
    let mut sources = Vec::new();
    for file in files {
        let extension = file.extension().map(|e| e.to_ascii_lowercase());
        let merl = extension.as_deref().is_some_and(|e| e == "binary");
        if merl && merl_material_name(&sha256_file(&file)?).is_none() {
            observer.warn(&format!("\"{}\" is none of the published MERL files: left out", file.display()));
            continue;
        }
        if merl || extension.as_deref().is_some_and(|e| e == "bsdf") {
            let source = Source::open(&file)?;
            // The experiments need values everywhere.
            if matches!(source.content, Content::Samples(_)) {
                observer.warn(&format!("\"{}\" holds scattered samples: left out", file.display()));
            } else {
                sources.push(source);
            }
        }
    }
    if sources.is_empty() {
        bail!(
            "--data \"{}\": expected .bsdf files or published MERL .binary files, found none",
            folder.display()
        );
    }
    Ok(sources)
}

/// The files below a folder, three levels deep.
fn collect(folder: &Path, files: &mut Vec<PathBuf>, depth: usize) -> Result<()> {
    let failed = || format!("cannot read folder \"{}\"", folder.display());
    for entry in std::fs::read_dir(folder).with_context(failed)? {
        let path = entry.with_context(failed)?.path();
        if path.is_dir() && depth < 3 {
            collect(&path, files, depth + 1)?;
        } else if path.is_file() {
            files.push(path);
        }
    }
    Ok(())
}
