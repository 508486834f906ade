//! Lit spheres of truth, prediction, difference and sigma in colour, made on a thread of their own. Coarse
//! pictures come first.

use std::sync::Arc;
use std::time::Duration;

use eframe::egui::{Color32, ColorImage};
use gpbrdf_core::brdf::direction;
use gpbrdf_core::figure::Colormap;
use gpbrdf_core::figure::round_limit;
use gpbrdf_core::judge::{
    DistantLight, ENV_PATCHES, Image, ImageMetrics, POINT_LIGHT, SPHERE_SIZE, environment_lights,
    exposure_of, psnr, render_sphere, ssim,
};
use gpbrdf_core::{BrdfTable, Environment};

use super::mailbox::{Mailbox, Sender};
use super::outbox::Outbox;
use super::slices::{colour, shown};
use crate::viewer::state::document::DocumentId;
use crate::viewer::state::look::SphereLight;

/// Pixels along each side of the first and of the last pictures.
const COARSE: usize = 96;
const FINE: usize = 256;
/// Columns and rows of patches to which an environment is averaged for the first pictures.
const COARSE_PATCHES: (usize, usize) = (24, 12);

impl SphereLight {
    /// The distant lights of the point light or of the turned environment.
    fn lights(&self, environment: &Environment, patches: (usize, usize)) -> Vec<DistantLight> {
        if self.point {
            let [x, y] = self.at;
            return vec![point_light(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())];
        }
        let mut lights = environment_lights(environment, patches);
        let (sy, cy) = self.yaw.sin_cos();
        let (sp, cp) = self.pitch.sin_cos();
        for light in &mut lights {
            let d = &mut light.direction;
            (d.x, d.z) = (cy * d.x + sy * d.z, cy * d.z - sy * d.x);
            (d.y, d.z) = (cp * d.y - sp * d.z, cp * d.z + sp * d.y);
        }
        lights
    }
}

/// White light of irradiance pi from a direction.
fn point_light(x: f64, y: f64, z: f64) -> DistantLight {
    let towards = direction(x.hypot(y).atan2(z), y.atan2(x));
    DistantLight { direction: towards, irradiance: [std::f64::consts::PI; 3] }
}

/// What spheres depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SphereKey {
    pub(crate) document: DocumentId,
    pub(crate) version: u64,
    pub(crate) light: SphereLight,
    pub(crate) environment: u64,
    pub(crate) truth_is_tabulated: bool,
    pub(crate) has_sigma: bool,
}

/// Spheres to make.
#[derive(Clone, Debug)]
pub(crate) struct SphereRequest {
    pub(crate) key: SphereKey,
    pub(crate) truth: Option<Arc<BrdfTable>>,
    pub(crate) mean: Arc<BrdfTable>,
    pub(crate) sigma: Option<Arc<BrdfTable>>,
    pub(crate) environment: Arc<Environment>,
    /// Whether the metrics of pictures are still unknown.
    pub(crate) wants_metrics: bool,
}

/// What the thread sends.
#[derive(Clone, Debug)]
pub(crate) enum SphereResult {
    Pictures(Box<SphereImages>),
    /// Metrics of pictures of a result.
    Metrics {
        document: DocumentId,
        version: u64,
        images: Box<ImageMetrics>,
    },
}

/// Spheres in colour.
#[derive(Clone, Debug)]
pub(crate) struct SphereImages {
    pub(crate) key: SphereKey,
    /// Whether these are the last, finest ones.
    pub(crate) fine: bool,
    pub(crate) truth: Option<ColorImage>,
    pub(crate) mean: ColorImage,
    /// Prediction minus truth, see [`difference`], with the value at the end of its scale.
    pub(crate) difference: Option<(ColorImage, f64)>,
    /// Sigma averaged over the light that a pixel sees, with the value at the end of its scale.
    pub(crate) sigma: Option<(ColorImage, f64)>,
    pub(crate) psnr: Option<f64>,
    pub(crate) ssim: Option<f64>,
    /// The factor of radiance in the pictures of truth and prediction.
    pub(crate) exposure: f64,
    /// Linear pictures of truth and prediction, for files.
    pub(crate) linear_truth: Option<Image>,
    pub(crate) linear_mean: Image,
}

/// The picture of a truth, kept while the light and the size are the same.
type Kept = Option<((DocumentId, SphereLight, u64, usize), Image)>;

/// Starts the thread that renders. It has a thread pool of its own, and waits with finer pictures while the
/// fitter is `busy`.
pub(crate) fn spawn(
    outbox: Outbox<SphereResult>,
    busy: impl Fn() -> bool + Send + Sync + 'static,
) -> std::io::Result<Sender<SphereRequest>> {
    let pool = rayon::ThreadPoolBuilder::new().build().map_err(std::io::Error::other)?;
    let mut kept: [Kept; 3] = [None, None, None];
    let passes = [(COARSE, COARSE_PATCHES), (FINE, COARSE_PATCHES), (FINE, ENV_PATCHES)];
    Mailbox::spawn("spheres", move |request: SphereRequest, stale| {
        for (i, (size, patches)) in passes.into_iter().enumerate() {
            while i > 0 && busy() {
                if stale() {
                    return;
                }
                std::thread::sleep(Duration::from_millis(5));
            }
            let known = &mut kept[i];
            let made = pool.install(|| make(&request, size, patches, known, stale));
            let Some(images) = made else { return };
            outbox.send(SphereResult::Pictures(Box::new(images)));
            let wanted = i == 1 && request.wants_metrics;
            if let Some(images) = wanted.then(|| pool.install(|| metrics(&request, stale))).flatten() {
                let (document, version) = (request.key.document, request.key.version);
                outbox.send(SphereResult::Metrics { document, version, images: Box::new(images) });
            }
        }
    })
}

type Stale<'a> = &'a (dyn Fn() -> bool + Sync);

fn make(
    request: &SphereRequest,
    size: usize,
    patches: (usize, usize),
    kept: &mut Kept,
    stale: Stale<'_>,
) -> Option<SphereImages> {
    let key = request.key;
    let lights = key.light.lights(&request.environment, patches);
    let kept_key = (key.document, key.light, key.environment, size);
    let known = kept.as_ref().filter(|(k, _)| *k == kept_key).map(|(_, image)| image.clone());
    let mut tables = vec![request.mean.as_ref()];
    if let (None, Some(truth)) = (&known, &request.truth) {
        tables.push(truth);
    }
    let mut images = render_sphere(&tables, &lights, size, stale).ok()?;
    let truth = known.or_else(|| if images.len() > 1 { images.pop() } else { None });
    let truth = truth.filter(|_| request.truth.is_some());
    let mean = images.pop()?;
    if let Some(truth) = &truth {
        *kept = Some((kept_key, truth.clone()));
    }
    let exposure = exposure_of(truth.as_ref().unwrap_or(&mean));
    let scale = exposure * key.light.exposure.exp2();
    let plain = |image: &Image| {
        disc(image, |i| {
            let [r, g, b] = image.raster().pixels()[i].map(|x| shown(f64::from(x) * scale, 2.2));
            Color32::from_rgb(r, g, b)
        })
    };
    let difference = truth.as_ref().map(|truth| difference_disc(truth, &mean, scale));
    let sigma = request.sigma.as_ref().and_then(|table| sigma_sphere(table, &lights, stale));
    let (psnr, ssim) = match &truth {
        Some(truth) => (psnr(truth, &mean, exposure).ok(), ssim(truth, &mean, exposure).ok()),
        None => (None, None),
    };
    Some(SphereImages {
        key,
        fine: size == FINE && patches == ENV_PATCHES,
        truth: truth.as_ref().map(plain),
        mean: plain(&mean),
        difference,
        sigma,
        psnr,
        ssim,
        exposure: scale,
        linear_truth: truth,
        linear_mean: mean,
    })
}

/// Prediction minus truth at each pixel, averaged over R, G and B: `exposure * (b - a)` of the linear
/// radiances `b` of the prediction and `a` of the truth, before clipping and gamma, so that 1 is the white of
/// the picture.
fn difference(truth: &Image, mean: &Image, exposure: f64) -> Vec<f64> {
    let gap = |(a, b): (&[f32; 3], &[f32; 3])| {
        let channel = |c: usize| f64::from(b[c]) - f64::from(a[c]);
        exposure * (channel(0) + channel(1) + channel(2)) / 3.0
    };
    std::iter::zip(truth.raster().pixels(), mean.raster().pixels()).map(gap).collect()
}

/// The difference in colour, red where the prediction is too bright, with the value at the end of the scale.
fn difference_disc(truth: &Image, mean: &Image, exposure: f64) -> (ColorImage, f64) {
    let gap = difference(truth, mean, exposure);
    let limit = round_limit(&gap, truth.mask());
    (disc(truth, |i| colour(Colormap::Diverging, 0.5 + 0.5 * gap[i] / limit)), limit)
}

/// Sigma averaged over the light that each pixel sees, in colour; of three channels the largest, as on
/// objects.
fn sigma_sphere(table: &BrdfTable, lights: &[DistantLight], stale: Stale<'_>) -> Option<(ColorImage, f64)> {
    let (image, values) = mean_sigma(table, lights, stale)?;
    let limit = round_limit(&values, image.mask());
    Some((disc(&image, |i| colour(Colormap::Sequential, values[i] / limit)), limit))
}

/// A picture of sigma under white light, and the largest of its channels at each pixel divided by the light
/// there; NaN where there is no light.
fn mean_sigma(table: &BrdfTable, lights: &[DistantLight], stale: Stale<'_>) -> Option<(Image, Vec<f64>)> {
    let white: Vec<_> =
        lights.iter().map(|l| DistantLight { irradiance: [l.irradiance[1]; 3], ..*l }).collect();
    let image = render_sphere(&[table], &white, COARSE, stale).ok()?.pop()?;
    let total = |i: usize| {
        let center = |k: usize| 2.0 * (k as f64 + 0.5) / COARSE as f64 - 1.0;
        let (x, y) = (center(i % COARSE), -center(i / COARSE));
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        let cosine = |l: &DistantLight| l.direction.x * x + l.direction.y * y + l.direction.z * z;
        let lit = white.iter().map(|l| (cosine(l), l.irradiance[0]));
        lit.filter(|(cosine, _)| *cosine >= gpbrdf_core::brdf::GRAZING_COSINE)
            .map(|(c, e)| c * e)
            .sum::<f64>()
    };
    let values: Vec<f64> = (0..COARSE * COARSE)
        .map(|i| {
            let sum = total(i);
            let largest = image.raster().pixels()[i].into_iter().fold(0.0, f32::max);
            if image.mask()[i] && sum > 0.0 { f64::from(largest) / sum } else { f64::NAN }
        })
        .collect();
    Some((image, values))
}

/// A picture of the sphere with a soft rim. The outermost 2.5 pixels repeat the colour just inside of them,
/// so that the rim can be antialiased.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels, and a share of 255")]
fn disc(image: &Image, colour: impl Fn(usize) -> Color32) -> ColorImage {
    let (width, height) = (image.raster().width(), image.raster().height());
    let inside = 1.0 - 5.0 / width as f64;
    let pixels = (0..width * height)
        .map(|i| {
            let x = 2.0 * ((i % width) as f64 + 0.5) / width as f64 - 1.0;
            let y = 2.0 * ((i / width) as f64 + 0.5) / height as f64 - 1.0;
            let radius = x.hypot(y);
            let coverage = (0.5 + (1.0 - radius) * 0.5 * width as f64).clamp(0.0, 1.0);
            if coverage == 0.0 {
                return Color32::TRANSPARENT;
            }
            let scale = (inside / radius).min(1.0);
            let at = |x: f64, n: usize| ((0.5 + 0.5 * scale * x) * n as f64) as usize;
            let [r, g, b, _] = colour(at(y, height) * width + at(x, width)).to_array();
            Color32::from_rgba_unmultiplied(r, g, b, (255.0 * coverage) as u8)
        })
        .collect();
    ColorImage::new([width, height], pixels)
}

/// The metrics of pictures, as the command line reports them.
fn metrics(request: &SphereRequest, stale: Stale<'_>) -> Option<ImageMetrics> {
    let tables = [request.truth.as_ref()?.as_ref(), request.mean.as_ref()];
    let studio = Environment::studio();
    let env = render_sphere(&tables, &environment_lights(&studio, ENV_PATCHES), SPHERE_SIZE, stale).ok()?;
    let [x, y, z] = POINT_LIGHT;
    let point = render_sphere(&tables, &[point_light(x, y, z)], SPHERE_SIZE, stale).ok()?;
    ImageMetrics::new((env.first()?, env.get(1)?), (point.first()?, point.get(1)?)).ok()
}

#[cfg(test)]
mod tests {
    use gpbrdf_core::base::Raster;

    use super::*;

    #[test]
    fn differences_are_prediction_minus_truth_as_exposed() {
        let image = |pixel: [f32; 3]| Image::new(Raster::filled(16, 16, pixel), vec![true; 256]).unwrap();
        let truth = image([0.25, 0.5, 0.75]);
        let prediction = image([0.5, 0.5, 1.25]);
        assert_eq!(difference(&truth, &prediction, 2.0)[0], 0.5);
        assert_eq!(difference(&prediction, &truth, 2.0)[0], -0.5);
        // Red where the prediction is too bright, blue where it is too dark.
        let middle = |a: &Image, b: &Image| {
            let (picture, limit) = difference_disc(a, b, 2.0);
            assert!((limit - 0.5).abs() < 1e-9, "{limit}");
            picture.pixels[8 * 16 + 8]
        };
        let (bright, dark) = (middle(&truth, &prediction), middle(&prediction, &truth));
        assert!(bright.r() > bright.b() && dark.b() > dark.r(), "{bright:?} {dark:?}");
    }

    #[test]
    fn sigma_of_a_sphere_is_the_largest_of_the_channels() {
        let table = BrdfTable::from_fn(|_| [0.125, 0.25, 0.5]);
        let lights = [point_light(0.3, 0.2, 0.9)];
        let (image, values) = mean_sigma(&table, &lights, &|| false).unwrap();
        // The sphere is black at its rim, where the viewer is near the horizon.
        let lit: Vec<f64> = values.into_iter().filter(|v| *v > 0.0).collect();
        assert!(lit.len() > image.mask().len() / 4, "{}", lit.len());
        for value in lit {
            assert!((value - 0.5).abs() < 1e-3, "{value}");
        }
    }
}
