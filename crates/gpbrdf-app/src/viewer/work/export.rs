//! Pictures and models as files, written by threads of their own.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, Result};
use eframe::egui::{ColorImage, Context, Rect};
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::figure::{Figure, FigureFormat, FigureOptions, Panel, Picture, Scale, Slice, slice_figure};
use gpbrdf_core::formats::{OutputFormat, OutputOptions, write_image_exr};
use gpbrdf_core::{Model, Rgb, Source};
use gpbrdf_render::LinearPixel;

use super::outbox::{Outbox, in_background};
use super::scene::Whole;
use super::slices::Truth;
use crate::job::{expected_errors, plan_csv};
use crate::message::said_once;
use crate::viewer::state::document::Document;
use crate::viewer::state::look::SliceLook;

/// What became of a file: a sentence for the user, or an error.
pub(crate) type Saved = Result<String, String>;

/// Writes files on a thread of its own and reports how it went.
fn write(outbox: &Outbox<Saved>, work: impl FnOnce() -> Result<String> + Send + 'static) {
    in_background(outbox, "writer", "cannot write", || work().map_err(|error| said_once(&error)));
}

/// The path `name.png` with a suffix in place of its extension.
fn beside(path: &Path, suffix: &str) -> PathBuf {
    let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    path.with_file_name(format!("{stem}{suffix}"))
}

fn png_file(path: &Path, picture: &Picture) -> Result<AtomicFile> {
    let mut file = AtomicFile::create(path)?;
    picture.write_png(&mut file).with_context(|| format!("cannot write \"{}\"", path.display()))?;
    Ok(file)
}

/// A figure in the format that its name says, as PNG where it says none.
fn figure_file(path: &Path, figure: &Figure) -> Result<AtomicFile> {
    let mut file = AtomicFile::create(path)?;
    let format = FigureFormat::of(path).unwrap_or(FigureFormat::Png);
    figure
        .write(&mut file, format, &FigureOptions::default())
        .with_context(|| format!("cannot write \"{}\"", path.display()))?;
    Ok(file)
}

/// The path with `.png` in place of its ending unless that is one of figures.
fn figure_path(path: &Path) -> PathBuf {
    if FigureFormat::of(path).is_some() { path.to_owned() } else { path.with_extension("png") }
}

fn exr_file(path: &Path, size: [usize; 2], pixels: &[Rgb]) -> Result<AtomicFile> {
    let mut file = AtomicFile::create(path)?;
    write_image_exr(&mut file, size[0], size[1], pixels)
        .with_context(|| format!("cannot write \"{}\"", path.display()))?;
    Ok(file)
}

/// Writes the slices of a material: a figure, and linear values beside it.
pub(crate) fn slices(document: &Document, look: &SliceLook, path: &Path, outbox: &Outbox<Saved>) {
    let Some(fitted) = document.fitted.clone() else {
        outbox.send(Err("nothing to export: no model has been fitted yet".to_owned()));
        return;
    };
    let truth = Truth::of(document);
    let (name, path) = (document.name.clone(), figure_path(path));
    let options = look.options();
    write(outbox, move || {
        let truth = truth.as_ref().and_then(Truth::brdf);
        let figure = slice_figure(&name, truth, fitted.mean.as_ref(), &options)?;
        let mut files = vec![figure_file(&path, &figure)?];
        let size = [options.size; 2];
        let mut add = |suffix: &str, pixels: &[Rgb]| -> Result<()> {
            files.push(exr_file(&beside(&path, suffix), size, pixels)?);
            Ok(())
        };
        let mean = Slice::new(fitted.mean.as_ref(), &options);
        add("-prediction.exr", mean.values())?;
        if let Some(truth) = truth {
            let truth = Slice::new(truth, &options);
            add("-truth.exr", truth.values())?;
            let difference = mean.log_difference(&truth)?;
            add("-difference.exr", &difference.into_iter().map(|gap| [gap; 3]).collect::<Vec<_>>())?;
        }
        if let Some(sigma) = &fitted.sigma {
            add("-sigma.exr", Slice::new(sigma.as_ref(), &options).values())?;
        }
        AtomicFile::commit_all(files)?;
        Ok(format!("wrote \"{}\" and the linear slices beside it", path.display()))
    });
}

/// Writes the lit object as it is shown: a figure, and linear pictures beside it.
pub(crate) fn picture(name: &str, whole: &Whole, path: &Path, outbox: &Outbox<Saved>) {
    let (name, whole, path) = (name.to_owned(), whole.clone(), figure_path(path));
    write(outbox, move || {
        let mut panels = Vec::new();
        if let Some(truth) = &whole.truth {
            panels.push(Panel::picture("truth", picture_of(truth)));
        }
        panels.push(Panel::picture("prediction", picture_of(&whole.prediction)));
        let mut note = "";
        if let Some(difference) = &whole.difference {
            let scale = Scale::signed(f64::from(whole.limits.difference));
            panels.push(Panel::scaled("difference", picture_of(difference), scale));
            note = "difference: exposure x (prediction - truth), linear, mean of R, G, B";
        }
        let mut files = vec![figure_file(&path, &Figure::of_panels(name, panels, note))?];
        let raster = whole.linear.raster();
        let mut linear = |which: &str, value: fn(&LinearPixel) -> [f32; 3]| -> Result<()> {
            let pixels: Vec<Rgb> = raster.pixels().iter().map(|p| value(p).map(f64::from)).collect();
            let target = beside(&path, &format!("-{which}.exr"));
            files.push(exr_file(&target, [raster.width(), raster.height()], &pixels)?);
            Ok(())
        };
        if whole.truth.is_some() {
            linear("truth", |pixel| pixel.truth)?;
        }
        linear("prediction", |pixel| pixel.prediction)?;
        AtomicFile::commit_all(files)?;
        Ok(format!("wrote \"{}\" and the linear pictures beside it", path.display()))
    });
}

/// What the window shows, for a file.
fn picture_of(image: &ColorImage) -> Picture {
    let [width, height] = image.size;
    Picture::from_fn(width, height, |x, y| {
        let [r, g, b, _] = image.pixels[y * width + x].to_array();
        [r, g, b]
    })
}

/// Writes curves as a table, and a picture of this part of the window beside it.
pub(crate) fn curves(ctx: &Context, text: String, part: Option<Rect>, path: &Path, outbox: &Outbox<Saved>) {
    let path = path.with_extension("csv");
    let table = move |path: &Path| -> Result<AtomicFile> {
        let mut file = AtomicFile::create(path)?;
        std::io::Write::write_all(&mut file, text.as_bytes())
            .with_context(|| format!("cannot write \"{}\"", path.display()))?;
        Ok(file)
    };
    let Some(part) = part else {
        write(outbox, move || {
            table(&path)?.commit()?;
            Ok(format!("wrote \"{}\"", path.display()))
        });
        return;
    };
    let (outbox, scale) = (outbox.clone(), ctx.pixels_per_point());
    ctx.request_screenshot(move |image| {
        write(&outbox, move || {
            let picture = picture_of(&image.region(&part, Some(scale)));
            let files = vec![table(&path)?, png_file(&path.with_extension("png"), &picture)?];
            AtomicFile::commit_all(files)?;
            Ok(format!("wrote \"{}\" and its picture beside it", path.display()))
        });
    });
}

/// Writes the directions to measure next.
pub(crate) fn plan(document: &Document, path: &Path, outbox: &Outbox<Saved>) {
    let Some(plan) = document.plan().cloned() else {
        outbox.send(Err("nothing to write: no directions have been planned yet".to_owned()));
        return;
    };
    let (path, name) = (path.with_extension("csv"), document.name.clone());
    write(outbox, move || {
        let lines = [
            format!("{} directions to measure, the most telling first", plan.geometries.len()),
            format!("of: {name}").replace(char::is_control, " "),
            expected_errors(&plan),
        ];
        AtomicFile::write(&path, plan_csv(&lines, &plan.geometries).as_bytes())?;
        Ok(format!("wrote \"{}\"", path.display()))
    });
}

/// Writes the model of a material.
pub(crate) fn model(document: &Document, path: &Path, outbox: &Outbox<Saved>) {
    let Some(model) = document.fitted.as_ref().map(|fitted| Arc::clone(&fitted.model)) else {
        outbox.send(Err("nothing to save: no model has been fitted yet".to_owned()));
        return;
    };
    let path = path.with_extension("safetensors");
    write(outbox, move || {
        let mut file = AtomicFile::create(&path)?;
        std::io::Write::write_all(&mut file, &model.to_bytes()?)
            .with_context(|| format!("cannot write \"{}\"", path.display()))?;
        file.commit()?;
        Ok(format!("saved model \"{}\"", path.display()))
    });
}

/// Writes the prediction of a material in any format that its name says, as `gpbrdf-cli convert` does.
pub(crate) fn table(document: &Document, path: &Path, outbox: &Outbox<Saved>) {
    let Some(model) = document.fitted.as_ref().map(|fitted| Arc::clone(&fitted.model)) else {
        outbox.send(Err("nothing to export: no model has been fitted yet".to_owned()));
        return;
    };
    let (path, name) = (path.to_owned(), document.name.clone());
    write(outbox, move || {
        let source = Source { name, ..Source::of_model(Model::clone(&model)) };
        source.write(&path, OutputFormat::of(&path)?, &OutputOptions::default())?;
        Ok(format!("wrote \"{}\"", path.display()))
    });
}

/// Writes a picture of the window as PNG and EXR to a folder, to the current one if `folder` is `None`.
pub(crate) fn screenshot(ctx: &Context, folder: Option<PathBuf>, outbox: &Outbox<Saved>) {
    let outbox = outbox.clone();
    ctx.request_screenshot(move |image| {
        write(&outbox, move || {
            let [width, height] = image.size;
            let folder =
                folder.map_or_else(std::env::current_dir, Ok).context("cannot find the current folder")?;
            let path = free_name(&folder, "gpbrdf-screenshot")?;
            let picture = picture_of(&image);
            // The inverse of the curve of IEC 61966-2-1.
            let linear = |x: u8| {
                let x = f64::from(x) / 255.0;
                if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
            };
            let pixels: Vec<Rgb> = picture.pixels().iter().map(|p| p.map(linear)).collect();
            let files = vec![
                png_file(&path, &picture)?,
                exr_file(&path.with_extension("exr"), [width, height], &pixels)?,
            ];
            AtomicFile::commit_all(files)?;
            Ok(format!("wrote \"{}\" and its EXR", path.display()))
        });
    });
}

/// A path in a folder that no file has yet.
fn free_name(folder: &Path, stem: &str) -> Result<PathBuf> {
    let mut names = (1..10_000).map(|i| folder.join(format!("{stem}-{i}.png")));
    let free = names.find(|p| !p.exists() && !p.with_extension("exr").exists());
    free.with_context(|| format!("too many screenshots in \"{}\"", folder.display()))
}
