//! Asks the threads for what has changed.

use std::sync::Arc;

use crate::viewer::app::Viewer;
use crate::viewer::state::document::Work;
use crate::viewer::state::settings::Arrangement;
use crate::viewer::ui::widgets::narrow;
use crate::viewer::work::curves::{AlbedoRequest, CurveKind};
use crate::viewer::work::fitter::Request;
use crate::viewer::work::scene::{SceneKey, SceneRequest, Shape};
use crate::viewer::work::slices::{SliceKey, SliceRequest, Surface};
use crate::viewer::work::spheres::{SphereKey, SphereRequest};

impl Viewer {
    /// Asks the threads for what has changed.
    pub(crate) fn request(&mut self) {
        for document in &mut self.documents {
            if document.asked.as_ref() == Some(&document.spec) {
                continue;
            }
            document.asked = Some(document.spec.clone());
            if !document.is_busy() {
                document.work = Work::Waiting;
            }
            self.fitter.submit(Request {
                document: document.id,
                source: Arc::clone(&document.source),
                truth: document.truth.clone(),
                spec: document.spec.clone(),
            });
        }
        self.request_slices();
        self.request_spheres();
        self.request_albedos();
        self.request_scene();
    }

    fn request_scene(&mut self) {
        let Some(sender) = self.scenery.as_ref().filter(|_| self.settings.shape != Shape::Sphere) else {
            return;
        };
        let views = [Arrangement::All, Arrangement::Sphere];
        if !views.contains(&self.settings.arrangement) || self.scene_size.contains(&0) {
            return;
        }
        let Some(document) = self.document() else { return };
        let Some(fitted) = &document.fitted else { return };
        let exposure = self.spheres.as_ref().map_or(1.0, |s| s.images.exposure);
        let key = SceneKey {
            document: document.id,
            version: fitted.version,
            has_truth: document.truth.is_some(),
            has_sigma: fitted.sigma.is_some(),
            shape: self.settings.shape.clone(),
            orbit: self.settings.orbit,
            light: self.settings.light,
            environment: self.environment.0,
            exposure: narrow(exposure),
            size: self.scene_size,
            shown: self.settings.sphere,
            swipe: self.settings.swipe,
        };
        if self.staged.as_ref() == Some(&key) {
            return;
        }
        sender.put(SceneRequest {
            key: key.clone(),
            truth: document.truth.clone(),
            mean: Arc::clone(&fitted.mean),
            sigma: fitted.sigma.clone(),
            environment: Arc::clone(&self.environment.2),
        });
        self.staged = Some(key);
    }

    fn request_slices(&mut self) {
        let Some(document) = self.document() else { return };
        let Some(fitted) = &document.fitted else { return };
        let key = SliceKey {
            document: document.id,
            version: fitted.version,
            look: self.settings.slices,
            truth_is_table: document.truth.is_some(),
            has_sigma: fitted.sigma.is_some(),
        };
        if self.sliced == Some(key) {
            return;
        }
        let truth = match (&document.truth, document.has_truth()) {
            (Some(table), _) => Some(Surface::Table(Arc::clone(table))),
            (None, true) => Some(Surface::Source(Arc::clone(&document.source))),
            (None, false) => None,
        };
        let (mean, sigma) = (Arc::clone(&fitted.mean), fitted.sigma.clone());
        self.slicer.put(SliceRequest { key, truth, mean, sigma });
        self.sliced = Some(key);
    }

    fn request_spheres(&mut self) {
        let Some(document) = self.document() else { return };
        let Some(fitted) = &document.fitted else { return };
        let key = SphereKey {
            document: document.id,
            version: fitted.version,
            light: self.settings.light,
            environment: self.environment.0,
            has_truth: document.truth.is_some(),
            has_sigma: fitted.sigma.is_some(),
        };
        if self.rendered == Some(key) {
            return;
        }
        self.renderer.put(SphereRequest {
            key,
            truth: document.truth.clone(),
            mean: Arc::clone(&fitted.mean),
            sigma: fitted.sigma.clone(),
            environment: Arc::clone(&self.environment.2),
            wants_metrics: document.has_truth() && fitted.images.is_none(),
        });
        self.rendered = Some(key);
    }

    fn request_albedos(&mut self) {
        if self.settings.curves.kind != CurveKind::Albedo {
            return;
        }
        let requests: Vec<_> = self.visible().filter_map(AlbedoRequest::of).collect();
        let keys: Vec<_> = requests.iter().map(|r| (r.document, r.version, r.truth.is_some())).collect();
        if keys != self.integrated {
            self.integrated = keys;
            self.integrator.put(requests);
        }
    }
}
