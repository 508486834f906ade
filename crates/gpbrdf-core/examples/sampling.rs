//! Error of a sphere lit by a small bright lamp in a dim room, at equal samples, for three ways to draw directions: by
//! the cosine, by a GGX lobe fitted to the material and the cosine, and by the material's own densities.
//!
//! ```sh
//! cargo run --release -p gpbrdf-core --example sampling -- FILE...
//! ```
//!
//! Without files it takes the built-in materials.
#![allow(clippy::print_stdout, reason = "its purpose")]

use gpbrdf_core::base::SplitMix64;
use gpbrdf_core::brdf::{LUMINANCE_WEIGHTS, materials};
use gpbrdf_core::{Material, MaterialOptions, Result, Source};

/// Samples of each pixel.
const SAMPLES: usize = 64;
/// Pixels along each side of a picture.
const SIZE: usize = 48;
/// Directions to the lamp in three pictures: x right, y up, z towards the viewer. Normalised where they are used.
const LAMPS: [[f32; 3]; 3] = [[0.3, 0.4, 0.9], [0.5, 0.7, 0.3], [0.6, 0.5, -0.6]];
/// Cosine of the lamp's angular radius, 4 degrees.
const LAMP_COSINE: f32 = 0.997_564;
/// Radiance of the lamp and of the room.
const RADIANCE: [f32; 2] = [100.0, 0.1];
/// Samples by which a GGX lobe is fitted, at each of the views.
const FIT_SAMPLES: usize = 4_000;
/// Elevations of the viewer at which it is fitted, degrees.
const FIT_VIEWS: [f32; 8] = [0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 78.0, 85.0];

type Direction = [f32; 3];

fn dot(a: Direction, b: Direction) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn normalize(a: Direction) -> Direction {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}

fn luminance(rgb: [f32; 3]) -> f64 {
    (0..3).map(|c| LUMINANCE_WEIGHTS[c] * f64::from(rgb[c])).sum()
}

/// A way to draw directions.
enum Sampler<'a> {
    Cosine,
    Ggx(Ggx),
    Own(&'a Material),
}

/// An isotropic GGX lobe of visible normals, and the share of directions drawn from it; the others follow the cosine.
/// Sources: B. Walter et al., "Microfacet Models for Refraction through Rough Surfaces" (2007), equation 33; E. Heitz,
/// "Sampling the GGX Distribution of Visible Normals", JCGT 7 (2018).
#[derive(Clone, Copy, Debug)]
struct Ggx {
    alpha: f32,
    share: f32,
}

impl Ggx {
    fn density(self, wi: Direction, wo: Direction) -> f32 {
        let h = normalize([wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]]);
        let a2 = self.alpha * self.alpha;
        let base = h[2] * h[2] * (a2 - 1.0) + 1.0;
        let d = a2 / (std::f32::consts::PI * base * base);
        let tan2 = (1.0 - wo[2] * wo[2]) / (wo[2] * wo[2]);
        let g1 = 2.0 / (1.0 + (1.0 + a2 * tan2).sqrt());
        let cosine = wi[2] / std::f32::consts::PI;
        self.share * g1 * d / (4.0 * wo[2]) + (1.0 - self.share) * cosine
    }

    fn draw(self, wo: Direction, choice: f32, u: f32, v: f32) -> Direction {
        if choice >= self.share {
            return cosine(u, v);
        }
        let stretched = normalize([self.alpha * wo[0], self.alpha * wo[1], wo[2]]);
        let across = stretched[0].hypot(stretched[1]);
        let t1 =
            if across > 0.0 { [-stretched[1] / across, stretched[0] / across, 0.0] } else { [1.0, 0.0, 0.0] };
        let t2 = [
            stretched[1] * t1[2] - stretched[2] * t1[1],
            stretched[2] * t1[0] - stretched[0] * t1[2],
            stretched[0] * t1[1] - stretched[1] * t1[0],
        ];
        let (r, phi) = (u.sqrt(), std::f32::consts::TAU * v);
        let a = r * phi.cos();
        let s = 0.5 * (1.0 + stretched[2]);
        let b = (1.0 - s) * (1.0 - a * a).max(0.0).sqrt() + s * r * phi.sin();
        let c = (1.0 - a * a - b * b).max(0.0).sqrt();
        let normal: Direction = std::array::from_fn(|k| a * t1[k] + b * t2[k] + c * stretched[k]);
        let h = normalize([self.alpha * normal[0], self.alpha * normal[1], normal[2].max(0.0)]);
        let along = 2.0 * dot(wo, h);
        std::array::from_fn(|k| along * h[k] - wo[k])
    }

    /// The lobe and the share with the smallest mean of `(luminance(f) cos / albedo)^2 / pdf` over the views.
    fn fitted(material: &Material) -> Self {
        let mut random = SplitMix64::new(3);
        let mut drawn = Vec::new();
        for degrees in FIT_VIEWS {
            let theta = degrees.to_radians();
            let wo = [theta.sin(), 0.0, theta.cos()];
            let albedo = luminance(material.albedo(wo));
            for _ in 0..FIT_SAMPLES {
                let Some(sample) = material.sample(wo, unit(&mut random), unit(&mut random)) else {
                    continue;
                };
                let value = luminance(sample.weight) / albedo;
                drawn.push((sample.wi, wo, value * value * f64::from(sample.pdf)));
            }
        }
        let mut best = (f64::INFINITY, Self { alpha: 1.0, share: 0.0 });
        for step in 0..40 {
            let alpha = 0.01 * 1.13f32.powi(step);
            for share in [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9] {
                let ggx = Self { alpha, share };
                let moment = drawn.iter().map(|&(wi, wo, m)| m / f64::from(ggx.density(wi, wo))).sum::<f64>();
                if moment < best.0 {
                    best = (moment, ggx);
                }
            }
        }
        best.1
    }
}

fn cosine(u: f32, v: f32) -> Direction {
    let (r, phi) = (u.sqrt(), std::f32::consts::TAU * v);
    [r * phi.cos(), r * phi.sin(), (1.0 - u).sqrt()]
}

#[expect(clippy::cast_possible_truncation, reason = "directions are in single precision")]
fn unit(random: &mut SplitMix64) -> f32 {
    (random.next_unit() as f32).min(1.0 - f32::EPSILON)
}

impl Sampler<'_> {
    /// A direction and `f cos / pdf`.
    fn draw(
        &self,
        material: &Material,
        wo: Direction,
        random: &mut SplitMix64,
    ) -> Option<(Direction, [f32; 3])> {
        let (u, v) = (unit(random), unit(random));
        let (wi, pdf) = match self {
            Self::Own(material) => return material.sample(wo, u, v).map(|drawn| (drawn.wi, drawn.weight)),
            Self::Cosine => {
                let wi = cosine(u, v);
                (wi, wi[2] / std::f32::consts::PI)
            }
            Self::Ggx(ggx) => {
                let wi = ggx.draw(wo, unit(random), u, v);
                (wi, ggx.density(wi, wo))
            }
        };
        (wi[2] > 0.0).then(|| (wi, material.eval(wi, wo).map(|f| f * wi[2] / pdf)))
    }
}

/// A frame about a pixel's normal: tangents and the normal.
struct Frame([Direction; 3]);

impl Frame {
    fn new(n: Direction) -> Self {
        let e = normalize(if n[0].abs() < 0.5 { [0.0, -n[2], n[1]] } else { [-n[2], 0.0, n[0]] });
        let f = [n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0]];
        Self([e, f, n])
    }

    fn local(&self, w: Direction) -> Direction {
        self.0.map(|axis| dot(axis, w))
    }

    fn world(&self, w: Direction) -> Direction {
        std::array::from_fn(|k| (0..3).map(|axis| w[axis] * self.0[axis][k]).sum())
    }
}

fn radiance(w: Direction, lamp: Direction) -> f32 {
    if dot(w, normalize(lamp)) > LAMP_COSINE { RADIANCE[0] } else { RADIANCE[1] }
}

/// The pixels of a sphere seen from `+z`: their frames.
fn pixels() -> Vec<Frame> {
    let at = |i: usize| 2.0 * (i as f32 + 0.5) / SIZE as f32 - 1.0;
    let all = (0..SIZE * SIZE).map(|i| (at(i % SIZE), at(i / SIZE)));
    all.filter(|(x, y)| x * x + y * y < 0.99)
        .map(|(x, y)| Frame::new([x, y, (1.0 - x * x - y * y).sqrt()]))
        .collect()
}

/// What a pixel reflects: the room by the albedo, the lamp by points spread evenly over its disc.
fn reference(material: &Material, frame: &Frame, lamp: Direction) -> [f64; 3] {
    let wo = frame.local([0.0, 0.0, 1.0]);
    let lamp = Frame::new(normalize(lamp));
    let mut sum = material.albedo(wo).map(|a| f64::from(a * RADIANCE[1]));
    let (rings, spokes) = (32, 64);
    let solid_angle = std::f32::consts::TAU * (1.0 - LAMP_COSINE) / (rings * spokes) as f32;
    for ring in 0..rings {
        let cosine = 1.0 - (1.0 - LAMP_COSINE) * (ring as f32 + 0.5) / rings as f32;
        for spoke in 0..spokes {
            let phi = std::f32::consts::TAU * (spoke as f32 + 0.5) / spokes as f32;
            let sine = (1.0 - cosine * cosine).sqrt();
            let wi = frame.local(lamp.world([sine * phi.cos(), sine * phi.sin(), cosine]));
            let f = material.eval(wi, wo);
            let weight = f64::from((RADIANCE[0] - RADIANCE[1]) * wi[2] * solid_angle);
            (0..3).for_each(|c| sum[c] += weight * f64::from(f[c]));
        }
    }
    sum
}

/// Root mean square error of the luminance over the spheres, one for each lamp.
fn error(sampler: &Sampler<'_>, material: &Material, frames: &[Frame], truth: &[Vec<[f64; 3]>]) -> f64 {
    let mut random = SplitMix64::new(17);
    let mut sum = 0.0;
    for (lamp, truth) in LAMPS.iter().zip(truth) {
        for (frame, truth) in frames.iter().zip(truth) {
            let wo = frame.local([0.0, 0.0, 1.0]);
            let mut found = [0.0; 3];
            for _ in 0..SAMPLES {
                if let Some((wi, weight)) = sampler.draw(material, wo, &mut random) {
                    let light = radiance(frame.world(wi), *lamp) / SAMPLES as f32;
                    (0..3).for_each(|c| found[c] += f64::from(weight[c] * light));
                }
            }
            let difference: f64 = (0..3).map(|c| LUMINANCE_WEIGHTS[c] * (found[c] - truth[c])).sum();
            sum += difference * difference;
        }
    }
    (sum / (LAMPS.len() * frames.len()) as f64).sqrt()
}

/// The weight that 99.9 % of samples stay below and the largest, in units of the albedo, at the worst of many views.
fn largest_weights(material: &Material) -> (f64, f64) {
    let mut random = SplitMix64::new(5);
    let mut worst = (0.0f64, 0.0f64);
    for degrees in [0.0f32, 12.0, 25.0, 38.0, 50.0, 62.0, 75.0, 82.0, 88.0] {
        let theta = degrees.to_radians();
        let wo = [theta.sin(), 0.0, theta.cos()];
        let albedo = luminance(material.albedo(wo));
        let mut weights: Vec<f64> = (0..50_000)
            .filter_map(|_| material.sample(wo, unit(&mut random), unit(&mut random)))
            .map(|drawn| luminance(drawn.weight) / albedo)
            .collect();
        weights.sort_by(f64::total_cmp);
        let most = weights.get(weights.len() * 999 / 1000).copied().unwrap_or(0.0);
        worst = (worst.0.max(most), worst.1.max(weights.last().copied().unwrap_or(0.0)));
    }
    worst
}

fn main() -> Result<()> {
    let files: Vec<_> = std::env::args_os().skip(1).collect();
    let sources: Vec<Source> = if files.is_empty() {
        materials().iter().map(|material| Source::built_in(material.name)).collect::<Result<_>>()?
    } else {
        files.iter().map(Source::open).collect::<Result<_>>()?
    };
    let columns = "own / cosine | own / GGX | 99.9 % of weights | largest";
    println!("| material | cosine | fitted GGX | own density | {columns} |");
    println!("|---|---|---|---|---|---|---|---|");
    let frames = pixels();
    let (mut ratios, mut errors) = (Vec::new(), Vec::new());
    for source in &sources {
        let material = source.material(&MaterialOptions::default())?;
        let seen = |lamp| frames.iter().map(|frame| reference(&material, frame, lamp)).collect();
        let truth: Vec<Vec<_>> = LAMPS.into_iter().map(seen).collect();
        let ggx = Ggx::fitted(&material);
        let of = |sampler: Sampler<'_>| error(&sampler, &material, &frames, &truth);
        let (cosine, fitted, own) = (of(Sampler::Cosine), of(Sampler::Ggx(ggx)), of(Sampler::Own(&material)));
        let (most, largest) = largest_weights(&material);
        let lobe = format!("alpha {:.3}, share {:.1}", ggx.alpha, ggx.share);
        println!(
            "| {} | {cosine:.4} | {fitted:.4} ({lobe}) | {own:.4} | {:.2} | {:.2} | {most:.2} | {largest:.2} |",
            source.name,
            own / cosine,
            own / fitted
        );
        ratios.push([own / cosine, own / fitted]);
        errors.push([cosine, fitted, own]);
    }
    let count = sources.len() as f64;
    let mean = |k: usize| ratios.iter().map(|r: &[f64; 2]| r[k]).sum::<f64>() / count;
    let [cosine, fitted, own] =
        [0, 1, 2].map(|k| errors.iter().map(|e: &[f64; 3]| e[k]).sum::<f64>() / count);
    println!("| mean | {cosine:.4} | {fitted:.4} | {own:.4} | {:.2} | {:.2} | | |", mean(0), mean(1));
    Ok(())
}
