//! Fits a model to scattered measurements and checks its intervals against measurements that were kept back
//! from the fit: `cargo run --release -p gpbrdf-core --example fit_csv -- [SAMPLES.csv [MODEL.safetensors]]`.
//!
//! Without arguments the example measures a built-in material and writes such a file itself, into a temporary
//! folder.
#![expect(clippy::print_stdout, reason = "an example reports to a terminal")]

use std::path::{Path, PathBuf};

use gpbrdf_core::formats::write_samples_csv;
use gpbrdf_core::{FitOptions, IntervalOf, Layout, Model, Source, fit};

type Result<T = (), E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

/// Number of measurements in the file that the example writes.
const COUNT: usize = 500;

/// One measurement out of this many is kept back from the fit.
const KEPT_BACK: usize = 5;

fn main() -> Result {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    match arguments.next() {
        Some(file) => run(&file, &arguments.next().unwrap_or_else(|| file.with_extension("safetensors"))),
        None => {
            let folder = tempfile::tempdir()?;
            let file = folder.path().join("samples.csv");
            write_measurements(&file)?;
            run(&file, &folder.path().join("model.safetensors"))
        }
    }
}

/// Writes a file like that of a goniometer: each line holds a pair of directions and its red, green and blue
/// values.
fn write_measurements(file: &Path) -> Result {
    let samples = Source::built_in("red-plastic")?.measure(&Layout::Random { count: COUNT, seed: 1 })?;
    write_samples_csv(file, &samples)?;
    Ok(())
}

fn run(file: &Path, model_file: &Path) -> Result {
    let source = Source::open(file)?;
    let measured = source.samples()?;
    println!("{} measurements in {}", measured.len(), file.display());
    let part = |kept_back: bool| {
        let chosen = |i: &usize| i.is_multiple_of(KEPT_BACK) == kept_back;
        let indices: Vec<usize> = (0..measured.len()).filter(chosen).collect();
        measured.subset(&indices)
    };
    let (known, unknown) = (part(false), part(true));

    let fitted = fit(&known, &FitOptions::default())?;
    println!("log marginal likelihood {:.1}", fitted.reports[0].log_marginal_likelihood);
    fitted.model.save(model_file)?;
    let model = Model::load(model_file)?;

    let predictions = model.predict(&unknown.angles, IntervalOf::Observation)?;
    let inside = predictions
        .iter()
        .zip(&unknown.values)
        .flat_map(|(p, value)| (0..3).map(move |c| (p.lower[c]..=p.upper[c]).contains(&value[c])));
    let inside = inside.filter(|&inside| inside).count();
    println!("{inside} of {} values kept back are in their 95 % interval", 3 * predictions.len());
    for ((angles, value), p) in unknown.angles.iter().zip(&unknown.values).zip(&predictions).take(3) {
        println!(
            "theta_h {:4.1}, theta_d {:4.1}, phi_d {:5.1} degrees: \
             measured {:.4}, predicted {:.4}, from {:.4} to {:.4}",
            angles.theta_h.to_degrees(),
            angles.theta_d.to_degrees(),
            angles.phi_d.to_degrees(),
            value[0],
            p.mean[0],
            p.lower[0],
            p.upper[0],
        );
    }
    Ok(())
}
