//! Error of a sphere lit by a small bright lamp in a dim room, at equal samples, for three ways to draw directions: by
//! the cosine, by a GGX lobe fitted to the material and the cosine, and by the material's own densities.
//!
//! ```sh
//! cargo run --release -p gpbrdf-core --example sampling -- FILE...
//! ```
//!
//! Without files it takes the built-in materials.
#![allow(clippy::print_stdout, reason = "its purpose")]

mod support;

use gpbrdf_core::base::SplitMix64;
use gpbrdf_core::brdf::{LUMINANCE_WEIGHTS, materials};
use gpbrdf_core::{Material, MaterialOptions, Result, Source};

use support::{Direction, Frame, Ggx, Sampler, dot, luminance, normalize, unit};

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
