//! Curves through a BRDF for the plots: values and intervals looked up in tables, and directional albedos.

use std::f64::consts::PI;
use std::sync::Arc;

use gpbrdf_core::brdf::direction;
use gpbrdf_core::{Brdf, BrdfTable, HalfDiff, Model, Rgb};
use rayon::prelude::*;

use super::mailbox::{Mailbox, Sender};
use super::outbox::Outbox;
use crate::viewer::state::document::{Document, DocumentId};
use crate::viewer::state::look::{CurveKind, CurveLook};

/// One point of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CurvePoint {
    /// Degrees; for a lobe the angle of the viewer, negative on the side of the light.
    pub(crate) x: f64,
    pub(crate) truth: Option<f64>,
    pub(crate) mean: f64,
    /// The 95 % interval.
    pub(crate) band: Option<(f64, f64)>,
}

/// The directions of a curve, with its abscissa in degrees.
fn directions(look: &CurveLook, points: usize) -> Vec<(f64, HalfDiff)> {
    let t = |i: usize| i as f64 / (points - 1) as f64;
    let at = look.at.map(f64::to_radians);
    let all = (0..points).map(|i| match look.kind {
        CurveKind::Lobe | CurveKind::Albedo => {
            let x = -89.5 + 179.0 * t(i);
            let wi = direction(look.incidence.to_radians(), PI);
            let wo = direction(x.to_radians(), 0.0);
            (x, HalfDiff::from_directions(&wi, &wo))
        }
        // Points are denser at the peak.
        CurveKind::ThetaH => {
            let x = 90.0 * t(i) * t(i);
            (x, HalfDiff { theta_h: x.to_radians(), theta_d: at[1], phi_d: at[2] })
        }
        CurveKind::ThetaD => {
            let x = 90.0 * t(i);
            (x, HalfDiff { theta_h: at[0], theta_d: x.to_radians(), phi_d: at[2] })
        }
        CurveKind::PhiD => {
            let x = 180.0 * t(i);
            (x, HalfDiff { theta_h: at[0], theta_d: at[1], phi_d: x.to_radians() })
        }
    });
    all.filter(|(_, angles)| angles.is_above_horizon()).collect()
}

/// The factor of the values at a direction: the cosine of the light, or 1 where it is not wanted.
fn factor(look: &CurveLook, angles: HalfDiff) -> f64 {
    match look.kind {
        _ if !look.times_cosine => 1.0,
        CurveKind::Lobe => look.incidence.to_radians().cos(),
        _ => angles.cosines().0.max(0.0),
    }
}

/// The curve of a document; empty until it is fitted.
pub(crate) fn curve(document: &Document, look: &CurveLook) -> Vec<CurvePoint> {
    let Some(fitted) = &document.fitted else { return Vec::new() };
    let points = directions(look, 361).into_iter().map(|(x, angles)| {
        let scale = factor(look, angles);
        let mean = fitted.mean.eval_half_diff(angles);
        let truth = document.truth_at(angles);
        let band = fitted.sigma.as_ref().map(|sigma| band_at(&fitted.model, mean, sigma, angles));
        let value = |rgb: Rgb| scale * look.channel.of(rgb);
        CurvePoint {
            x,
            truth: truth.map(value),
            mean: value(mean),
            band: band.map(|(low, high)| (value(low), value(high))),
        }
    });
    points.collect()
}

/// The 95 % interval of a measurement about a mean, with sigma from its table.
pub(crate) fn band_at(model: &Model, mean: Rgb, sigma: &BrdfTable, angles: HalfDiff) -> (Rgb, Rgb) {
    model.interval_about(mean, sigma.eval_half_diff(angles))
}

/// The largest distance, in degrees, of the samples that are drawn with a curve.
const NEAR: f64 = 1.5;

/// The samples next to a curve: abscissa and value.
pub(crate) fn samples_near(document: &Document, look: &CurveLook) -> Vec<[f64; 2]> {
    let Some(fitted) = &document.fitted else { return Vec::new() };
    let near = |a: f64, b: f64, width: f64| (a - b).abs() <= width;
    let mut found = Vec::new();
    for (angles, &value) in std::iter::zip(&fitted.samples.angles, &fitted.samples.values) {
        let [h, d, p] = [angles.theta_h, angles.theta_d, angles.phi_d].map(f64::to_degrees);
        // Layouts with bilateral symmetry hold one half of the range only.
        let p_off = (p - look.at[2]).abs().min((180.0 - p - look.at[2]).abs());
        let x = match look.kind {
            CurveKind::ThetaH if near(d, look.at[1], NEAR) && p_off <= 3.0 * NEAR => h,
            CurveKind::ThetaD if near(h, look.at[0], NEAR) && p_off <= 3.0 * NEAR => d,
            CurveKind::PhiD if near(h, look.at[0], NEAR) && near(d, look.at[1], NEAR) => p,
            _ => continue,
        };
        found.push([x, factor(look, *angles) * look.channel.of(value)]);
    }
    found.truncate(2000);
    found
}

/// The directional albedo of a document's truth and of its prediction, at each of [`ALBEDO_ANGLES`] angles.
#[derive(Clone, Debug)]
pub(crate) struct Albedo {
    pub(crate) document: DocumentId,
    pub(crate) truth: Option<Vec<Rgb>>,
    pub(crate) mean: Vec<Rgb>,
}

/// The number of angles of incidence of albedos: 0, 5, .. 85 degrees.
pub(crate) const ALBEDO_ANGLES: usize = 18;

/// Albedos to compute.
#[derive(Clone, Debug)]
pub(crate) struct AlbedoRequest {
    pub(crate) document: DocumentId,
    pub(crate) version: u64,
    pub(crate) truth: Option<Arc<BrdfTable>>,
    pub(crate) mean: Arc<BrdfTable>,
}

impl AlbedoRequest {
    /// The request for an open material; `None` until it is fitted.
    pub(crate) fn of(document: &Document) -> Option<Self> {
        let fitted = document.fitted.as_ref()?;
        Some(Self {
            document: document.id,
            version: fitted.version,
            truth: document.truth.clone(),
            mean: Arc::clone(&fitted.mean),
        })
    }
}

/// Starts the thread that integrates.
pub(crate) fn spawn(outbox: Outbox<Vec<Albedo>>) -> std::io::Result<Sender<Vec<AlbedoRequest>>> {
    Mailbox::spawn("albedo", move |requests: Vec<AlbedoRequest>, stale| {
        let mut found = Vec::new();
        for request in requests {
            if stale() {
                return;
            }
            found.push(Albedo {
                document: request.document,
                truth: request.truth.map(|table| albedo(&table)),
                mean: albedo(&request.mean),
            });
        }
        outbox.send(found);
    })
}

/// The integral of `f cos(theta_o)` over the directions `omega_o` by the midpoint rule, uniform in
/// `sin^2(theta_o)` and in the azimuth. By symmetry 48 x 48 directions cover half of the azimuths.
fn albedo(table: &BrdfTable) -> Vec<Rgb> {
    const N: usize = 48;
    (0..ALBEDO_ANGLES)
        .into_par_iter()
        .map(|k| {
            let wi = direction((5.0 * k as f64).to_radians(), 0.0);
            let mut sum = [0.0; 3];
            for i in 0..N {
                let theta = ((i as f64 + 0.5) / N as f64).sqrt().asin();
                for j in 0..N {
                    let wo = direction(theta, PI * (j as f64 + 0.5) / N as f64);
                    let value = table.eval(&wi, &wo);
                    for c in 0..3 {
                        sum[c] += value[c];
                    }
                }
            }
            sum.map(|s| s * PI / (N * N) as f64)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_white_lambertian_surface_has_albedo_one() {
        let table = BrdfTable::from_fn(|_| [1.0 / PI, 0.5 / PI, 0.0]);
        for value in albedo(&table) {
            assert!((value[0] - 1.0).abs() < 1e-6 && (value[1] - 0.5).abs() < 1e-6, "{value:?}");
        }
    }

    #[test]
    fn a_lobe_peaks_opposite_the_light() {
        let look = CurveLook::default();
        let specular = directions(&look, 359).into_iter().find(|(x, _)| (x - 45.0).abs() < 1e-9);
        assert!(specular.is_some_and(|(_, angles)| angles.theta_h < 1e-9));
    }
}
