//! Pictures and models as files, written off the window's thread.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, Result, bail};
use eframe::egui::Context;
use gpbrdf_core::{AtomicFile, Brdf, Picture, Rgb, Slice, slice_figure, sphere_figure, write_image_exr};

use crate::viewer::app::Viewer;
use crate::viewer::work::fitter::{Event, Outbox};

/// Runs `work` on a thread of its own and says how it went.
fn in_background(outbox: &Outbox, work: impl FnOnce() -> Result<String> + Send + 'static) {
    let outbox = outbox.clone();
    let fallback = outbox.clone();
    let job = move || outbox.send(Event::Saved { result: work().map_err(|e| format!("{e:#}")) });
    if let Err(error) = std::thread::Builder::new().name("writer".into()).spawn(job) {
        fallback.send(Event::Saved { result: Err(format!("cannot write: {error}")) });
    }
}

/// `name.png` with a suffix in place of its extension.
fn beside(path: &Path, suffix: &str) -> PathBuf {
    let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    path.with_file_name(format!("{stem}{suffix}"))
}

fn png_file(path: &Path, picture: &Picture) -> Result<AtomicFile> {
    let mut file = AtomicFile::create(path)?;
    picture.write_png(&mut file).with_context(|| format!("cannot write \"{}\"", path.display()))?;
    Ok(file)
}

fn exr_file(path: &Path, size: [usize; 2], pixels: &[Rgb]) -> Result<AtomicFile> {
    let mut file = AtomicFile::create(path)?;
    write_image_exr(&mut file, size[0], size[1], pixels)
        .with_context(|| format!("cannot write \"{}\"", path.display()))?;
    Ok(file)
}

/// The selected material's slices: a figure, and linear values beside it.
pub(crate) fn slices(viewer: &mut Viewer, path: &Path) {
    let Some(document) = viewer.document() else { return };
    let Some(fitted) = document.fitted.clone() else {
        viewer.messages.error("nothing to export: no model has been fitted yet");
        return;
    };
    let (truth, source) = (document.truth.clone(), Arc::clone(&document.source));
    let (name, path) = (document.name.clone(), path.with_extension("png"));
    let options = viewer.settings.slices.options();
    let has_truth = document.has_truth();
    in_background(&viewer.outbox, move || {
        let truth: Option<&dyn Brdf> = match &truth {
            Some(table) => Some(table.as_ref()),
            None if has_truth => source.brdf(),
            None => None,
        };
        let picture = slice_figure(&name, truth, fitted.mean.as_ref(), None, &options)?;
        let mut files = vec![png_file(&path, &picture)?];
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

/// The sphere as it is shown: a figure, and linear pictures beside it.
pub(crate) fn sphere(viewer: &mut Viewer, path: &Path) {
    let (Some(document), Some(shown)) = (viewer.document(), &viewer.spheres) else {
        viewer.messages.error("nothing to export: no sphere has been drawn yet");
        return;
    };
    let (images, psnr) = (shown.images.linear.clone(), shown.images.psnr);
    let (name, path) = (document.name.clone(), path.with_extension("png"));
    in_background(&viewer.outbox, move || {
        let find = |which: &str| images.iter().find(|(n, _)| *n == which).map(|(_, image)| image);
        let Some(mean) = find("prediction") else { bail!("no sphere has been drawn yet") };
        let picture = sphere_figure(&name, find("truth"), mean, None, psnr)?;
        let mut files = vec![png_file(&path, &picture)?];
        for (which, image) in &images {
            let pixels: Vec<Rgb> = image.pixels().iter().map(|p| p.map(f64::from)).collect();
            let target = beside(&path, &format!("-{which}.exr"));
            files.push(exr_file(&target, [image.width(), image.height()], &pixels)?);
        }
        AtomicFile::commit_all(files)?;
        Ok(format!("wrote \"{}\" and the linear pictures beside it", path.display()))
    });
}

/// The selected material's model.
pub(crate) fn model(viewer: &mut Viewer, path: &Path) {
    let Some(fitted) = viewer.document().and_then(|d| d.fitted.clone()) else {
        viewer.messages.error("nothing to save: no model has been fitted yet");
        return;
    };
    let path = path.with_extension("safetensors");
    in_background(&viewer.outbox, move || {
        let mut file = AtomicFile::create(&path)?;
        std::io::Write::write_all(&mut file, &fitted.model.to_bytes()?)
            .with_context(|| format!("cannot write \"{}\"", path.display()))?;
        file.commit()?;
        Ok(format!("saved model \"{}\"", path.display()))
    });
}

/// A picture of the window, as PNG and EXR in the folder of screenshots.
pub(crate) fn screenshot(ctx: &Context, viewer: &Viewer) {
    let (outbox, folder) = (viewer.outbox.clone(), viewer.pictures.clone());
    ctx.request_screenshot(move |image| {
        let folder = folder.clone();
        in_background(&outbox, move || {
            let [width, height] = image.size;
            let folder =
                folder.map_or_else(std::env::current_dir, Ok).context("cannot find the current folder")?;
            let path = free_name(&folder, "gpbrdf-screenshot")?;
            let picture = Picture::from_fn(width, height, |x, y| {
                let [r, g, b, _] = image.pixels[y * width + x].to_array();
                [r, g, b]
            });
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

/// A name in a folder that no file has.
fn free_name(folder: &Path, stem: &str) -> Result<PathBuf> {
    let mut names = (1..10_000).map(|i| folder.join(format!("{stem}-{i}.png")));
    let free = names.find(|p| !p.exists() && !p.with_extension("exr").exists());
    free.with_context(|| format!("too many screenshots in \"{}\"", folder.display()))
}
