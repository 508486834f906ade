//! Takes in what the threads have sent.

use std::time::Instant;

use eframe::egui::{self, Context, TextureHandle};
use gpbrdf_core::Hyper;

use crate::viewer::app::{ShownScene, ShownSlices, ShownSpheres, Viewer};
use crate::viewer::state::document::Work;
use crate::viewer::work::fitter::Event;
use crate::viewer::work::scene::{SceneImage, Shape};
use crate::viewer::work::{slices, spheres};

impl Viewer {
    /// Takes in what the threads have sent.
    pub(crate) fn receive(&mut self, ctx: &Context) {
        while let Ok(event) = self.events.try_recv() {
            match event {
                Event::Opened { result: Ok(source), restore } => self.add(*source, restore),
                Event::Opened { result: Err(message), .. } | Event::Environment { result: Err(message) } => {
                    self.messages.error(message);
                }
                Event::Environment { result: Ok((path, map)) } => {
                    let name =
                        path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
                    self.environment = (self.environment.0 + 1, name, map);
                    self.settings.environment = Some(path);
                }
                Event::Saved { result: Ok(what) } => self.messages.note(what),
                Event::Saved { result: Err(message) } => self.messages.error(message),
                Event::Chosen { purpose, paths } => self.chosen(purpose, &paths),
                Event::Slices(images) => self.take_slices(ctx, *images),
                Event::Spheres(images) => self.take_spheres(ctx, images),
                Event::Scene(image) => self.take_scene(ctx, *image),
                Event::Quality(quality) => self.quality = Some(quality),
                Event::SceneFailed(message) => {
                    // The processor's sphere is always there.
                    self.settings.shape = Shape::Sphere;
                    (self.scene, self.quality, self.staged) = (None, None, None);
                    self.messages.error(message);
                }
                Event::DeviceLost(message) => self.messages.error(format!("{message}; it is opened anew")),
                Event::Albedo(albedos) => self.albedos = albedos,
                other => self.take_stage(other),
            }
        }
    }

    fn take_stage(&mut self, event: Event) {
        let (Event::Stage { document: id, .. }
        | Event::Fitted { document: id, .. }
        | Event::Sigma { document: id, .. }
        | Event::Truth { document: id, .. }
        | Event::Cells { document: id, .. }
        | Event::Images { document: id, .. }
        | Event::Done { document: id }
        | Event::Failed { document: id, .. }) = event
        else {
            return;
        };
        let Some(document) = self.documents.iter_mut().find(|d| d.id == id) else { return };
        let cancelled = document.work == Work::Cancelled;
        let current =
            |version: u64| move |f: &&mut crate::viewer::state::document::Fitted| f.version == version;
        match event {
            Event::Stage { stage, evaluations, .. } if !cancelled => {
                let since = match document.work {
                    Work::Running { since, .. } if stage != "Sampling" => since,
                    _ => Instant::now(),
                };
                document.work = Work::Running { stage, since, evaluations };
            }
            Event::Fitted { fitted, .. } => {
                if document.spec.hyper.is_none() {
                    document.optimum = Hyper::of(&fitted.model);
                }
                document.fitted = Some(*fitted);
            }
            Event::Sigma { version, sigma, .. } => {
                if let Some(fitted) = document.fitted.as_mut().filter(current(version)) {
                    fitted.sigma = Some(sigma);
                }
            }
            Event::Truth { truth, .. } => document.truth = Some(truth),
            Event::Cells { version, cells, .. } => {
                if let Some(fitted) = document.fitted.as_mut().filter(current(version)) {
                    fitted.cells = Some(*cells);
                }
            }
            Event::Images { version, images, .. } => {
                if let Some(fitted) = document.fitted.as_mut().filter(current(version)) {
                    fitted.images = Some(*images);
                }
            }
            Event::Done { .. } if !cancelled => document.work = Work::Idle,
            Event::Failed { message, .. } => {
                self.messages.error(format!("{}: {message}", document.name));
                document.work = Work::Failed(message);
            }
            _ => {}
        }
    }

    fn take_slices(&mut self, ctx: &Context, images: slices::SliceImages) {
        let limits = images.panels.each_ref().map(|p| p.as_ref().and_then(|p| p.limit));
        let mut old = self.slices.take().map(|s| s.textures).unwrap_or_default();
        let mut textures = [None, None, None, None];
        for (i, panel) in images.panels.into_iter().enumerate() {
            let Some(panel) = panel else { continue };
            textures[i] = Some(upload(ctx, &mut old[i], format!("slice {i}"), panel.image));
        }
        self.slices = Some(ShownSlices { key: images.key, textures, limits });
    }

    fn take_scene(&mut self, ctx: &Context, new: SceneImage) {
        let (first, second) = self.scene.take().map_or((None, None), |s| (Some(s.texture), s.beside));
        let texture = upload(ctx, &mut { first }, "object".to_owned(), new.image);
        let beside = new.beside.map(|image| upload(ctx, &mut { second }, "object beside".to_owned(), image));
        let (document, picture, samples) = (new.document, new.picture, new.samples);
        self.scene = Some(ShownScene { document, picture, texture, beside, samples });
    }

    fn take_spheres(&mut self, ctx: &Context, images: Box<spheres::SphereImages>) {
        let load = |name: &str, image: &egui::ColorImage| {
            upload(ctx, &mut None, format!("sphere {name}"), image.clone())
        };
        let truth = images.truth.as_ref().map(|i| load("truth", i));
        let difference = images.difference.as_ref().map(|(i, _)| load("difference", i));
        let sigma = images.sigma.as_ref().map(|(i, _)| load("sigma", i));
        let mean = load("prediction", &images.mean);
        self.spheres = Some(ShownSpheres { images, truth, mean, difference, sigma });
    }
}

/// Puts an image where another was, or in a new texture.
fn upload(
    ctx: &Context,
    old: &mut Option<TextureHandle>,
    name: String,
    image: egui::ColorImage,
) -> TextureHandle {
    match old.take() {
        Some(mut texture) => {
            texture.set(image, egui::TextureOptions::LINEAR);
            texture
        }
        None => ctx.load_texture(name, image, egui::TextureOptions::LINEAR),
    }
}
