//! Any BRDF as the maps of an RGL file.
//!
//! The maps are read by the formulas of [`super`], whatever they hold, so they may be chosen such that few values are
//! enough. `ndf` is the average `f` as a function of the half vector's polar angle, so that what is left, `f
//! cos(theta_o) 4 sigma / ndf`, has no high peak. The warp, whose density the format calls `vndf`, decides where the
//! values of what is left are dense. It is a sum of three densities of the half vector `m`: visible facets, which are
//! dense in the highlight; directions `wo` evenly spread over the hemisphere; and polar angles of `m` evenly spread,
//! which are dense about the mirror direction at grazing incidence. Half vectors whose `wo` is far below the horizon
//! hardly count. Each azimuth of `m` gets nearly the same share of the values.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::base::error::{Error, Result};
use crate::brdf::{Brdf, HalfDiff, Rgb, direction, theta_d_max};
use crate::formats::rgl::warp::{Map, Warp};
use crate::formats::rgl::{RglBrdf, luminance};

/// Sizes of the grids of an RGL file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RglGrid {
    /// Number of polar angles of incidence from 0 to 90 degrees, which are denser towards 90 degrees.
    pub incidences: usize,
    /// Number of rows and of columns of the values at each of them.
    pub resolution: usize,
}

impl Default for RglGrid {
    /// 48 incidences with 128 x 128 values each.
    fn default() -> Self {
        Self { incidences: 48, resolution: 128 }
    }
}

impl RglGrid {
    /// The polar angles of incidence, radians, exact in single precision as they are stored.
    fn theta_i(self) -> impl Iterator<Item = f64> {
        (0..self.incidences).map(move |k| {
            let left = 1.0 - k as f64 / (self.incidences - 1) as f64;
            f64::from(single(FRAC_PI_2 * (1.0 - left.powf(INCIDENCE_POWER))))
        })
    }
}

/// The largest number of incidences, and of rows and columns.
const LARGEST_SIZE: usize = 1024;
/// Power by which angles of incidence are denser towards grazing.
const INCIDENCE_POWER: f64 = 1.3;
/// Number of polar angles of `ndf` and `sigma`.
const POLAR_NODES: usize = 256;
/// Smallest `ndf` in units of the largest one.
const LEAST_NDF: f64 = 1e-6;
/// Number of polar angles and of azimuths of the warp's density.
const WARP_SIZE: [usize; 2] = [128, 64];
/// Shares of visible facets, of even directions and of even polar angles in the warp's density.
const SHARES: [f64; 3] = [0.8, 0.2, 3.0];
/// Part of the density that is the same for each azimuth.
const EVEN_AZIMUTHS: f64 = 0.8;
/// The cosine of `wo` below the horizon at which even densities have fallen to `1/e`.
const BELOW: f64 = 0.2;
/// Added to cosines between `wi` and `m`, so that no azimuth is without density.
const LEAST_COSINE: f64 = 1e-4;

#[expect(clippy::cast_possible_truncation, reason = "f32 is the file's precision")]
fn single(x: f64) -> f32 {
    x as f32
}

/// The polar angle at node `k` of `n`: `theta = u^2 pi/2` with `u = k / (n - 1)`.
fn polar(k: usize, n: usize) -> f64 {
    (k as f64 / (n - 1) as f64).powi(2) * FRAC_PI_2
}

/// What is not a positive number becomes 0.
fn positive(rgb: Rgb) -> Rgb {
    rgb.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 })
}

/// The luminance of `f` at each of the polar angles of the half vector: its average over all directions above the
/// horizon, weighted by both cosines.
fn averages(brdf: &dyn Brdf) -> Vec<f64> {
    const STEPS: usize = 8;
    let average = |k: usize| {
        let theta_h = polar(k, POLAR_NODES);
        let angles: Vec<HalfDiff> = (0..STEPS * STEPS)
            .map(|at| {
                let [v, phi] = [at % STEPS, at / STEPS].map(|k| (k as f64 + 0.5) / STEPS as f64);
                let phi_d = phi * PI;
                HalfDiff { theta_h, theta_d: v * theta_d_max(theta_h, phi_d), phi_d }
            })
            .collect();
        let mut values = vec![[0.0; 3]; angles.len()];
        brdf.eval_many(&angles, &mut values);
        let (mut sum, mut weights) = (0.0, 0.0);
        for (angles, value) in angles.iter().zip(values) {
            let (cos_theta_i, cos_theta_o) = angles.cosines();
            let weight = (cos_theta_i * cos_theta_o).max(0.0);
            sum += weight * luminance(positive(value));
            weights += weight;
        }
        if weights > 0.0 { sum / weights } else { 0.0 }
    };
    (0..POLAR_NODES).into_par_iter().map(average).collect()
}

/// `int max(0, wi . m) dphi_m` over the circle, for facets `m` with polar angle `theta_m`.
fn visible(theta_i: f64, theta_m: f64) -> f64 {
    let even = theta_i.cos().max(0.0) * theta_m.cos().max(0.0);
    let tilted = theta_i.sin() * theta_m.sin();
    if even >= tilted {
        2.0 * PI * even
    } else {
        2.0 * (even * (-even / tilted).acos() + (tilted * tilted - even * even).sqrt())
    }
}

/// `int ndf(m) max(0, wi . m) dm`, with `dm = sin(theta) dtheta dphi` and `dtheta = pi u du`.
fn projected_area(theta_i: f64, ndf: &[f64]) -> f64 {
    let step = 1.0 / (POLAR_NODES - 1) as f64;
    let part = |(k, density): (usize, &f64)| {
        let theta = polar(k, POLAR_NODES);
        // The trapezoid rule; at the first node there is no area.
        let width = if k + 1 == POLAR_NODES { 0.5 * step } else { step };
        density * visible(theta_i, theta) * theta.sin() * PI * k as f64 * step * width
    };
    ndf.iter().enumerate().map(part).sum()
}

/// A map that does not depend on the azimuth.
fn rotational(row: &[f64]) -> Map {
    Map { height: 2, width: row.len(), values: row.iter().chain(row).map(|&x| single(x)).collect() }
}

/// The density of the warp at one angle of incidence, `[phi_m][theta_m]`.
fn density(theta_i: f64, ndf: &Map, sigma: f64) -> Vec<f32> {
    let [width, height] = WARP_SIZE;
    let wi = direction(theta_i, 0.0);
    let mut values = Vec::with_capacity(width * height);
    let mut totals = Vec::with_capacity(height);
    for y in 0..height {
        let phi_m = (2.0 * y as f64 / (height - 1) as f64 - 1.0) * PI;
        let start = values.len();
        for x in 0..width {
            let u = x as f64 / (width - 1) as f64;
            let theta_m = polar(x, width);
            let m = direction(theta_m, phi_m);
            let cosine = wi.dot(&m).max(0.0);
            let below = (2.0 * cosine * m.z - wi.z).min(0.0);
            let above = (below / BELOW).exp();
            // The area of the unit square grows with u sin(theta_m), and that of wo with 4 wi . m, by which the
            // format's own formula divides ndf / sigma, too.
            let facets = SHARES[0] * ndf.eval(u, 0.5) / sigma;
            let directions = SHARES[1] * 4.0 / (2.0 * PI) * above;
            let area = u * theta_m.sin();
            values.push((cosine + LEAST_COSINE) * (area * (facets + directions) + SHARES[2] * u * above));
        }
        totals.push(values[start..].iter().sum::<f64>());
    }
    let mean = totals.iter().sum::<f64>() / height as f64;
    for (row, total) in values.chunks_exact_mut(width).zip(totals) {
        let scale = EVEN_AZIMUTHS / total + (1.0 - EVEN_AZIMUTHS) / mean;
        row.iter_mut().for_each(|value| *value *= scale);
    }
    values.into_iter().map(single).collect()
}

impl RglBrdf {
    /// Tabulates any isotropic BRDF. Values that are negative or no numbers become 0.
    ///
    /// With the default grid, half of all directions are met to 0.1 %, nine in ten to 0.7 %, and 99 in 100 to a few
    /// per cent where no cosine is below 0.08; materials whose highlight is sharper than half a degree to less.
    /// `brdf` is evaluated `incidences x resolution^2 + 16,384` times, in parallel.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] unless both sizes of the grid are from 2 to 1,024.
    pub fn tabulate(brdf: &dyn Brdf, grid: RglGrid, description: impl Into<String>) -> Result<Self> {
        let sizes = 2..=LARGEST_SIZE;
        if !sizes.contains(&grid.incidences) || !sizes.contains(&grid.resolution) {
            return Err(Error::argument("grid", "sizes from 2 to 1024", format!("{grid:?}")));
        }
        let theta_i: Vec<f64> = grid.theta_i().collect();

        let mut ndf = averages(brdf);
        let highest = ndf.iter().copied().fold(0.0, f64::max);
        let least = if highest > 0.0 { LEAST_NDF * highest } else { 1.0 };
        ndf.iter_mut().for_each(|x| *x = x.max(least));
        let area = projected_area(0.0, &ndf);
        ndf.iter_mut().for_each(|x| *x /= area);
        let sigma: Vec<f64> = (0..POLAR_NODES).map(|k| projected_area(polar(k, POLAR_NODES), &ndf)).collect();
        let (ndf, sigma) = (rotational(&ndf), rotational(&sigma));
        let sigma_at = |theta_i: f64| sigma.eval((theta_i / FRAC_PI_2).sqrt(), 0.5);

        let [width, height] = WARP_SIZE;
        let densities: Vec<f32> =
            theta_i.par_iter().flat_map_iter(|&theta_i| density(theta_i, &ndf, sigma_at(theta_i))).collect();
        let warp = Warp::new(height, width, &densities).map_err(|slice| {
            Error::argument("brdf", "a positive density of facets", format!("zero at incidence {slice}"))
        })?;

        let n = grid.resolution;
        let slice = |(slice, &theta_i): (usize, &f64)| {
            let wi = direction(theta_i, 0.0);
            let sigma = sigma_at(theta_i);
            let node = |k: usize| {
                let [s_x, s_y] = [k % n, k / n].map(|k| k as f64 / (n - 1) as f64);
                let ([x, y], _) = warp.sample(slice, s_x, s_y);
                let m = facet(x, y);
                let wo = 2.0 * m.dot(&wi) * m - wi;
                (4.0 * sigma / ndf.eval(x, y) * wo.z.max(0.0), wo)
            };
            let nodes: Vec<(f64, Vector3<f64>)> = (0..n * n).map(node).collect();
            let angles: Vec<HalfDiff> =
                nodes.iter().map(|(_, wo)| HalfDiff::from_directions(&wi, wo)).collect();
            let mut values = vec![[0.0; 3]; angles.len()];
            brdf.eval_many(&angles, &mut values);
            let scaled = |((factor, _), value): ((f64, Vector3<f64>), Rgb)| {
                positive(value).map(|x| single((x * factor).min(f32::MAX.into())))
            };
            nodes.into_iter().zip(values).map(scaled).collect::<Vec<_>>()
        };
        let rgb = theta_i.par_iter().enumerate().flat_map_iter(slice).collect();
        Ok(Self {
            description: description.into(),
            theta_i,
            ndf,
            sigma,
            jacobian: true,
            warp,
            rgb_height: n,
            rgb_width: n,
            rgb,
        })
    }
}

/// The facet at a point of the unit square, for light above the x axis.
pub(super) fn facet(x: f64, y: f64) -> Vector3<f64> {
    direction(x * x * FRAC_PI_2, (2.0 * y - 1.0) * PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::analytic::Lambert;
    use crate::formats::Source;
    use crate::test_data::data_dir;

    /// Quantiles 0.5, 0.9 and 0.99 of the difference between two BRDFs in units of the largest channel, over
    /// directions with cosines above 0.08 that are dense in the highlight and at grazing angles.
    fn errors(truth: &dyn Brdf, found: &dyn Brdf) -> [f64; 3] {
        const STEPS: usize = 18;
        let mut errors = Vec::new();
        for k in 0..STEPS.pow(3) {
            let [u, v, phi] =
                [k % STEPS, k / STEPS % STEPS, k / STEPS / STEPS].map(|k| (k as f64 + 0.37) / STEPS as f64);
            let (theta_h, phi_d) = (u * u * FRAC_PI_2, phi * PI);
            let angles = HalfDiff { theta_h, theta_d: v * theta_d_max(theta_h, phi_d), phi_d };
            let (wi, wo) = angles.to_directions();
            if wi.z.min(wo.z) < crate::brdf::GRAZING_COSINE {
                continue;
            }
            let (truth, found) = (truth.eval(&wi, &wo), found.eval(&wi, &wo));
            let scale = truth.into_iter().fold(1e-3, f64::max);
            errors.push((0..3).map(|c| (truth[c] - found[c]).abs() / scale).fold(0.0, f64::max));
        }
        errors.sort_by(f64::total_cmp);
        [1, 9, 99].map(|part| {
            let of = if part == 1 {
                2
            } else if part == 9 {
                10
            } else {
                100
            };
            errors[(errors.len() - 1) * part / of]
        })
    }

    #[test]
    fn materials_are_met() {
        let mut sources: Vec<Source> = ["ward", "cherry-235", "red-plastic", "cook-torrance", "silver-paint"]
            .map(|name| Source::built_in(name).unwrap())
            .into();
        let measured = ["satin_purple_rgb", "acrylic_felt_green_rgb"];
        sources.extend(data_dir().into_iter().flat_map(|dir| {
            measured.map(|name| Source::open(dir.join(format!("rgl/{name}.bsdf"))).unwrap())
        }));
        for source in &sources {
            let brdf = source.brdf().unwrap();
            let table = RglBrdf::tabulate(brdf, RglGrid::default(), "x").unwrap();
            let [median, most, nearly_all] = errors(brdf, &table);
            let name = &source.name;
            assert!(
                median < 1e-3 && most < 8e-3 && nearly_all < 0.08,
                "{name}: {median} {most} {nearly_all}"
            );
        }
    }

    #[test]
    fn sigma_is_the_projected_area_of_the_facets() {
        let table = RglBrdf::tabulate(
            &Lambert { albedo: [0.5; 3] },
            RglGrid { incidences: 4, resolution: 4 },
            "grey",
        )
        .unwrap();
        // Facets of the same density everywhere: D = 1/pi, and the area is (1 + cos(theta_i)) / 2.
        for u in [0.0, 0.3, 0.7, 0.9] {
            let theta: f64 = u * u * FRAC_PI_2;
            assert!((table.ndf.eval(u, 0.1) - 1.0 / PI).abs() < 1e-4);
            assert!((table.sigma.eval(u, 0.1) - 0.5 * (1.0 + theta.cos())).abs() < 2e-4, "{u}");
        }
        assert_eq!((table.theta_i[0], table.theta_i[3]), (0.0, f64::from(single(FRAC_PI_2))));
    }

    #[test]
    fn wrong_sizes_and_wrong_values_are_handled() {
        struct Broken;
        impl Brdf for Broken {
            fn eval(&self, _: &Vector3<f64>, _: &Vector3<f64>) -> Rgb {
                [f64::NAN, -1.0, f64::INFINITY]
            }
        }
        for (incidences, resolution) in [(1, 4), (4, 1), (4, 2000)] {
            let error = RglBrdf::tabulate(&Broken, RglGrid { incidences, resolution }, "").unwrap_err();
            assert!(error.to_string().contains("sizes from 2 to 1024"), "{error}");
        }
        let black = RglBrdf::tabulate(&Broken, RglGrid { incidences: 3, resolution: 4 }, "").unwrap();
        assert_eq!(black.eval(&direction(0.3, 0.0), &direction(0.4, 2.0)), [0.0; 3]);
    }
}
