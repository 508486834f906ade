//! `gpbrdf-cli gallery`: a figure of several materials, each predicted from few planned measurements.

use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use clap::{Args, value_parser};
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::brdf::direction;
use gpbrdf_core::figure::{Axis, Curve, Figure, FigureFormat, Panel, Picture, Plot, Row, write_moving_png};
use gpbrdf_core::nalgebra::Vector3;
use gpbrdf_core::plan::{Cells, Device};
use gpbrdf_core::{Brdf, BrdfTable, Environment, HalfDiff, IntervalOf, Model, Source, bake_mean};

use super::figure_args::{FigureSize, grouped};
use super::input::{environment, open};
use super::reading::Reading;
use super::terminal::Terminal;
use crate::job::{Backend, Portrait, PriorName, Subject};
use crate::reproduce::{Trained, Trial};

/// Polar angle of the light of the curves, degrees.
const INCIDENCE: i32 = 45;
/// The largest polar angle of their views, degrees.
const STEEPEST: i32 = 80;
/// The smallest value on the axis of the curves, 1/sr: what models add to values before the logarithm.
const DARKEST: f64 = 1e-3;
/// The most materials: with more the pictures would be a few millimetres wide.
const MOST: usize = 12;
/// How measurements are divided into stages: a part of them, then all.
const FIRST_STAGE: usize = 10;
/// How long each picture of a moving one is shown, milliseconds.
const PAUSE: u16 = 700;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli gallery red-plastic purple-paint ward -o gallery.pdf",
    "\n  gpbrdf-cli gallery scans/*.bsdf --count 40 --prior mine.safetensors",
    "\n  gpbrdf-cli gallery satin_purple.bsdf --count 3,5,8,12,20,30,50,80 --dpi 100 -o growing.png",
))]
pub(crate) struct Gallery {
    /// Materials that can be evaluated at any direction: measurement, table or model files, or built-in materials.
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// Number of measurements of each material, of which the first ten are planned before the others. Several numbers
    /// make an animated PNG with a picture of each; then each stage is planned with what the one before has measured.
    #[arg(
        help_heading = "Sampling",
        long,
        value_name = "N[,N...]",
        value_delimiter = ',',
        default_value = "20"
    )]
    #[arg(value_parser = value_parser!(u32).range(1..=1000))]
    count: Vec<u32>,
    /// What is known of other materials: the prior that comes with the program, one that `gpbrdf-cli learn` has
    /// written, or none. The built-in prior knows its own library: leave a material out to judge it.
    #[arg(help_heading = "Model", long, value_name = "built-in|none|FILE", default_value_t)]
    prior: PriorName,
    /// Figure to write: .png, .svg or .pdf.
    #[arg(help_heading = "Output", short, long, value_name = "FILE", default_value = "gallery.png")]
    output: PathBuf,
    /// Environment map (.hdr or .exr, latitude-longitude) of the pictures instead of the built-in one.
    #[arg(help_heading = "Output", long, value_name = "FILE")]
    env: Option<PathBuf>,
    #[command(flatten)]
    figure_size: FigureSize,
}

/// What is shown of one material from one number of measurements.
struct Shown {
    name: String,
    samples: usize,
    psnr: f64,
    coverage: f64,
    truth: Picture,
    prediction: Picture,
    curves: [Curve; 2],
}

impl Gallery {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        if self.inputs.len() > MOST {
            bail!("expected at most {MOST} materials, found {}", self.inputs.len());
        }
        match FigureFormat::of(&self.output) {
            Some(FigureFormat::Png) => {}
            Some(_) if self.count.len() == 1 => {}
            Some(_) => bail!("\"{}\": expected .png for several numbers of --count", self.output.display()),
            None => bail!("\"{}\": expected a name that ends in .png, .svg or .pdf", self.output.display()),
        }
        let environment = environment(self.env.as_deref())?;
        let mut frames: Vec<Vec<Shown>> = self.count.iter().map(|_| Vec::new()).collect();
        for input in &self.inputs {
            let source = open(input, Reading::default(), terminal)?;
            let shown = self.shown(&source, &environment, terminal)?;
            frames.iter_mut().zip(shown).for_each(|(frame, one)| frame.push(one));
        }
        let options = self.figure_size.into();
        match &frames[..] {
            [only] => self.figure(only).save(&self.output, &options)?,
            _ => {
                let figures = frames.iter().map(|frame| self.figure(frame).picture(&options));
                let pictures = figures.collect::<gpbrdf_core::Result<Vec<_>>>()?;
                let mut file = AtomicFile::create(&self.output)?;
                write_moving_png(&mut file, &pictures, PAUSE)
                    .with_context(|| format!("cannot write \"{}\"", self.output.display()))?;
                file.commit()?;
            }
        }
        terminal.summary(&format!("wrote {}", self.output.display()))
    }

    /// Measures a material where plans say, and predicts it from each number of measurements.
    fn shown(&self, source: &Source, environment: &Environment, terminal: &Terminal) -> Result<Vec<Shown>> {
        let truth = terminal.stage("Tabulating", || source.table())?;
        let trial = Trial {
            brdf: source.brdf()?,
            truth: &truth,
            environment,
            device: &Device::default(),
            cells: &Cells::usual(None, Cells::COUNT)?,
            prior: self.prior.open()?.prior(),
        };
        let counts: Vec<usize> = self.count.iter().map(|&count| count as usize).collect();
        let stages = match counts[..] {
            [count] if count > FIRST_STAGE => vec![FIRST_STAGE, count],
            _ => counts.clone(),
        };
        let mut trained = terminal.stage("Planning, measuring and fitting", || trial.planned(&stages))?;
        trained.drain(..stages.len() - counts.len());
        let show = |one: &Trained| {
            let mean = terminal.stage("Baking", || bake_mean(&one.model));
            let subject =
                Subject { title: &source.name, truth: Some(&truth), mean: &mean, sigma: None, psnr: None };
            let portrait = terminal
                .stage("Rendering", || Portrait::new(&subject, environment, Backend::Auto, terminal))?;
            let psnr = one.metrics.images.psnr_env;
            let coverage = 100.0 * one.metrics.cells.coverage_95.unwrap_or(f64::NAN);
            terminal.summary(&format!(
                "{}: {} samples, PSNR {psnr:.1} dB, 95 % interval covers {coverage:.1} % of the cells",
                source.name, one.samples
            ))?;
            Ok(Shown {
                name: source.name.trim_end_matches("_rgb").replace('_', " "),
                samples: one.samples,
                psnr,
                coverage,
                truth: portrait.truth(),
                prediction: portrait.prediction(),
                curves: curves(&one.model, &truth)?,
            })
        };
        trained.iter().map(show).collect()
    }

    /// Materials side by side, or truth, prediction and curves of a single one.
    fn figure(&self, shown: &[Shown]) -> Figure {
        let mean = |of: fn(&Shown) -> f64| shown.iter().map(of).sum::<f64>() / shown.len().max(1) as f64;
        let (psnr, coverage) = (mean(|one| one.psnr), mean(|one| one.coverage));
        // Ends of the axis by the truth, so that they stay while measurements are added.
        let values =
            shown.iter().flat_map(|one| one.curves[0].points.iter().map(|p| p.1)).map(|f| f.max(DARKEST));
        let (low, high) = values.fold((f64::INFINITY, 0.0), |(l, h): (f64, f64), f| (l.min(f), h.max(f)));
        let limits =
            (low < high).then(|| [power_of_ten(low, f64::floor), power_of_ten(2.0 * high, f64::ceil)]);
        let (steepest, mirror) = (f64::from(STEEPEST), f64::from(INCIDENCE));
        let plot = |one: &Shown| Plot {
            x: Axis {
                limits: Some([-steepest, steepest]),
                ticks: vec![-mirror, 0.0, mirror],
                ..Axis::linear("θ_o (degrees)")
            },
            y: Axis { limits, ..Axis::logarithmic("f (1/sr)") },
            curves: one.curves.to_vec(),
            legend: false,
        };
        let samples = grouped(shown.first().map_or(0, |one| one.samples));
        let (title, rows) = if let [one] = shown {
            let panels = vec![
                Panel::picture("truth", one.truth.clone()),
                Panel::picture("prediction", one.prediction.clone()),
                Panel::plot("in the plane of incidence", plot(one), 1.0),
            ];
            let title = format!("{}, predicted from {samples} planned measurements", one.name);
            (title, vec![Row { name: String::new(), panels }])
        } else {
            let row = |name: &str, panel: &dyn Fn(&Shown) -> Panel| Row {
                name: name.to_owned(),
                panels: shown.iter().map(panel).collect(),
            };
            let rows = vec![
                row("truth", &|one| Panel::picture(one.name.as_str(), one.truth.clone())),
                row("prediction", &|one| {
                    Panel::picture(format!("{:.1} dB", one.psnr), one.prediction.clone())
                }),
                row("", &|one| Panel::plot("", plot(one), 1.0)),
            ];
            (format!("{} materials, each predicted from {samples} planned measurements", shown.len()), rows)
        };
        let prior = match &self.prior {
            PriorName::BuiltIn => "built-in, which may know the material",
            PriorName::None => "none",
            PriorName::File(_) => "learned from other materials",
        };
        let note = format!(
            "PSNR under the environment {psnr:.1} dB{0}; the 95 % interval covers {coverage:.1} % of all cells{0}. \
             Curves: green channel in the plane of incidence, light at {INCIDENCE}°, mirror direction at \
             +{INCIDENCE}°; truth in black, prediction in blue with its 95 % interval. Prior: {prior}.",
            if shown.len() == 1 { "" } else { " on average" }
        );
        Figure { title, rows, note }
    }
}

/// The power of ten at or beside a number.
fn power_of_ten(x: f64, round: fn(f64) -> f64) -> f64 {
    10f64.powf(round(x.log10()))
}

/// Truth and prediction in the plane of incidence.
fn curves(model: &Model, truth: &BrdfTable) -> Result<[Curve; 2]> {
    let views: Vec<f64> = (-STEEPEST..=STEEPEST).map(f64::from).collect();
    let light = direction(f64::from(INCIDENCE).to_radians(), std::f64::consts::PI);
    let pairs: Vec<[Vector3<f64>; 2]> = views
        .iter()
        .map(|view| [light, Vector3::new(view.to_radians().sin(), 0.0, view.to_radians().cos())])
        .collect();
    let angles: Vec<HalfDiff> = pairs.iter().map(|[wi, wo]| HalfDiff::from_directions(wi, wo)).collect();
    let predictions = model.predict(&angles, IntervalOf::Observation)?;
    let green = 1;
    let at = |values: &mut dyn Iterator<Item = f64>| {
        std::iter::zip(views.iter().copied(), values).collect::<Vec<_>>()
    };
    let truth = at(&mut pairs.iter().map(|[wi, wo]| truth.eval(wi, wo)[green]));
    let mean = at(&mut predictions.iter().map(|p| p.mean[green]));
    let band =
        std::iter::zip(&views, &predictions).map(|(&x, p)| (x, p.lower[green].max(1e-6), p.upper[green]));
    Ok([
        Curve { name: "truth".into(), points: truth, colour: Some([0x1a, 0x1a, 0x1c]), ..Curve::default() },
        Curve {
            name: "prediction".into(),
            points: mean,
            band: band.collect(),
            colour: Some([0x44, 0x77, 0xaa]),
        },
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_have_a_band_about_them_and_powers_are_beside_their_numbers() {
        assert_eq!([power_of_ten(0.03, f64::floor), power_of_ten(30.0, f64::ceil)], [0.01, 100.0]);
        let source = Source::built_in("ward").unwrap();
        let samples = source.measure(&gpbrdf_core::Layout::Hemisphere { count: 30, seed: 1 }).unwrap();
        let model = gpbrdf_core::fit(&samples, &gpbrdf_core::FitOptions::default()).unwrap().model;
        let table = source.table().unwrap();
        let [truth, prediction] = curves(&model, &table).unwrap();
        assert_eq!((truth.points.len(), prediction.points.len(), prediction.band.len()), (161, 161, 161));
        for (point, band) in std::iter::zip(&prediction.points, &prediction.band) {
            assert!(point.0 == band.0 && band.1 <= point.1 && point.1 <= band.2, "{point:?} {band:?}");
        }
        // The highlight of the truth is at the mirror direction.
        let highest = truth.points.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!((highest.0 - f64::from(INCIDENCE)).abs() < 12.0, "{highest:?}");
    }
}
