//! A small path tracer: three spheres of measured materials on a floor, under a dim sky and two lamps. The same scene
//! three times with equally many paths, whose directions are drawn by the cosine, by a GGX lobe fitted to each material
//! and the cosine, and by each material's own densities. At each reflection one lamp is lit directly, too, and both
//! are weighted by the balance heuristic of E. Veach and L. Guibas, "Optimally Combining Sampling Techniques for Monte
//! Carlo Rendering" (1995), as most renderers do.
//!
//! ```sh
//! cargo run --release -p gpbrdf-core --example path_tracer -- OUT.png [SPHERE SPHERE SPHERE]
//! ```
//!
//! A sphere is a built-in material or a file. The root mean square error of each picture, against one of 64 times
//! as many paths, is printed.
#![allow(clippy::print_stdout, reason = "its purpose")]

mod support;

use std::path::PathBuf;

use gpbrdf_core::base::SplitMix64;
use gpbrdf_core::{Error, Material, MaterialOptions, Result, Source};
use rayon::prelude::*;

use support::{Direction, Frame, Ggx, Sampler, dot, normalize, unit};

/// Pixels of each of the three pictures, and paths through each pixel.
const WIDTH: usize = 360;
const HEIGHT: usize = 200;
const PATHS: usize = 16;
/// Paths of the reference relative to these.
const MORE: usize = 64;
/// The largest number of reflections of a path.
const REFLECTIONS: usize = 5;
/// The height of the eye, and half the vertical extent of its view at a distance of 1.
const EYE: Direction = [0.0, 1.7, 7.0];
const VIEW: f32 = 0.27;
/// The spheres: centre and radius. They stand on the floor, the plane `y = 0`.
const SPHERES: [(Direction, f32); 3] =
    [([-2.1, 1.0, 0.0], 1.0), ([0.0, 1.0, -0.6], 1.0), ([2.1, 1.0, 0.0], 1.0)];
/// The lamps: direction, cosine of the angular radius, radiance.
const LAMPS: [(Direction, f32, [f32; 3]); 2] =
    [([-0.5, 0.8, 0.5], 0.9925, [28.0, 25.0, 20.0]), ([0.9, 0.35, 0.25], 0.998, [30.0, 36.0, 48.0])];
/// Distance below which a ray does not hit the surface that it leaves.
const EPSILON: f32 = 1e-3;

/// The radiance of a lamp in a direction, and the density of the directions that [`to_lamp`] draws.
fn lamp(w: Direction) -> Option<([f32; 3], f32)> {
    LAMPS.into_iter().find(|&(lamp, cosine, _)| dot(w, normalize(lamp)) > cosine).map(
        |(_, cosine, radiance)| {
            let solid_angle = std::f32::consts::TAU * (1.0 - cosine);
            (radiance, 1.0 / (LAMPS.len() as f32 * solid_angle))
        },
    )
}

/// A direction to one of the lamps.
fn to_lamp(random: &mut SplitMix64) -> Direction {
    let (towards, least, _) = LAMPS[usize::from(unit(random) < 0.5)];
    let cosine = 1.0 - (1.0 - least) * unit(random);
    let (sine, phi) = ((1.0 - cosine * cosine).sqrt(), std::f32::consts::TAU * unit(random));
    Frame::new(normalize(towards)).world([sine * phi.cos(), sine * phi.sin(), cosine])
}

/// The radiance of the sky.
fn sky(w: Direction) -> [f32; 3] {
    let up = 0.5 * (w[1] + 1.0);
    [0.10 + 0.12 * up, 0.10 + 0.16 * up, 0.10 + 0.25 * up]
}

/// The nearest surface along a ray: its distance, its normal and the index of its material; the floor is the last one.
fn nearest(origin: Direction, w: Direction) -> Option<(f32, Direction, usize)> {
    let mut best: Option<(f32, Direction, usize)> = None;
    for (index, (centre, radius)) in SPHERES.into_iter().enumerate() {
        let to: Direction = std::array::from_fn(|k| origin[k] - centre[k]);
        let (b, c) = (dot(to, w), dot(to, to) - radius * radius);
        let discriminant = b * b - c;
        if discriminant <= 0.0 {
            continue;
        }
        let t = -b - discriminant.sqrt();
        if t > EPSILON && best.is_none_or(|(known, ..)| t < known) {
            let normal = std::array::from_fn(|k| (to[k] + t * w[k]) / radius);
            best = Some((t, normal, index));
        }
    }
    let t = -origin[1] / w[1];
    if t > EPSILON && t.is_finite() && best.is_none_or(|(known, ..)| t < known) {
        best = Some((t, [0.0, 1.0, 0.0], SPHERES.len()));
    }
    best
}

/// The light that arrives along one path.
fn trace(
    materials: &[(Material, Sampler<'_>)],
    mut origin: Direction,
    mut w: Direction,
    random: &mut SplitMix64,
) -> [f32; 3] {
    let (mut throughput, mut sum) = ([1.0f32; 3], [0.0f32; 3]);
    // The density with which the material drew the direction; lamps are seen by the eye alone, not lit directly.
    let mut drawn = None;
    for _ in 0..=REFLECTIONS {
        let Some((t, normal, index)) = nearest(origin, w) else {
            let light = match (lamp(w), drawn) {
                (Some((radiance, of_lamp)), Some(pdf)) => radiance.map(|x| x * pdf / (pdf + of_lamp)),
                (Some((radiance, _)), None) => radiance,
                (None, _) => sky(w),
            };
            return std::array::from_fn(|c| sum[c] + throughput[c] * light[c]);
        };
        let frame = Frame::new(normal);
        let (material, sampler) = &materials[index];
        let wo = frame.local(w.map(|x| -x));
        origin = std::array::from_fn(|k| origin[k] + t * w[k]);
        let towards = to_lamp(random);
        let wi = frame.local(towards);
        if wi[2] > 0.0
            && nearest(origin, towards).is_none()
            && let Some((radiance, of_lamp)) = lamp(towards)
        {
            let (f, pdf) = (material.eval(wi, wo), sampler.pdf(material, wi, wo));
            (0..3).for_each(|c| sum[c] += throughput[c] * f[c] * wi[2] * radiance[c] / (of_lamp + pdf));
        }
        let Some((wi, weight)) = sampler.draw(material, wo, random) else { return sum };
        throughput = std::array::from_fn(|c| throughput[c] * weight[c]);
        drawn = Some(sampler.pdf(material, wi, wo));
        w = frame.world(wi);
    }
    sum
}

/// The scene with so many paths through each pixel.
fn render(materials: &[(Material, Sampler<'_>)], paths: usize, seed: u64) -> Vec<[f32; 3]> {
    (0..WIDTH * HEIGHT)
        .into_par_iter()
        .map(|pixel| {
            let mut random = SplitMix64::stream(seed, pixel as u64);
            let mut sum = [0.0f32; 3];
            for _ in 0..paths {
                let x = 2.0 * ((pixel % WIDTH) as f32 + unit(&mut random)) / WIDTH as f32 - 1.0;
                let y = 1.0 - 2.0 * ((pixel / WIDTH) as f32 + unit(&mut random)) / HEIGHT as f32;
                let across = VIEW * WIDTH as f32 / HEIGHT as f32;
                let w = normalize([x * across, y * VIEW - 0.11, -1.0]);
                let light = trace(materials, EYE, w, &mut random);
                (0..3).for_each(|c| sum[c] += light[c] / paths as f32);
            }
            sum
        })
        .collect()
}

/// The value of a picture in a file: the sRGB curve over one that compresses highlights.
fn encoded(x: f32) -> u8 {
    let x = 1.0 - (-1.6 * x).exp();
    let y = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounded, 0 to 255")]
    let byte = (255.0 * y.clamp(0.0, 1.0)).round() as u8;
    byte
}

/// Root mean square difference of two pictures as they are seen, out of 255.
fn error(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let seen = a.as_flattened().iter().zip(b.as_flattened());
    let sum: f64 = seen.map(|(a, b)| (f64::from(encoded(*a)) - f64::from(encoded(*b))).powi(2)).sum();
    (sum / (3 * a.len()) as f64).sqrt()
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let out = PathBuf::from(arguments.next().unwrap_or_else(|| "path_tracer.png".to_owned()));
    let mut names: Vec<String> = arguments.collect();
    if names.len() < SPHERES.len() {
        names = ["blue-metallic-paint", "cherry-235", "silver-paint"].map(str::to_owned).to_vec();
    }
    names.truncate(SPHERES.len());
    names.push("lambert".to_owned());
    let options = MaterialOptions { energy_conserving: true };
    let open = |name: &String| {
        let source = Source::built_in(name).or_else(|_| Source::open(name))?;
        source.material(&options)
    };
    let materials: Vec<Material> = names.iter().map(open).collect::<Result<_>>()?;
    let with = |sampler: &dyn for<'a> Fn(&'a Material) -> Sampler<'a>, paths: usize, seed: u64| {
        let all: Vec<(Material, Sampler<'_>)> = materials.iter().map(|m| (m.clone(), sampler(m))).collect();
        render(&all, paths, seed)
    };
    let reference = with(&|material| Sampler::Own(material), MORE * PATHS, 1);
    let pictures = [
        ("cosine", with(&|_| Sampler::Cosine, PATHS, 2)),
        ("fitted GGX and cosine", with(&|material| Sampler::Ggx(Ggx::fitted(material)), PATHS, 3)),
        ("own densities", with(&|material| Sampler::Own(material), PATHS, 4)),
    ];
    for (name, picture) in &pictures {
        println!("{name}: root mean square error {:.2} of 255", error(picture, &reference));
    }
    let rows =
        (0..HEIGHT).flat_map(|y| pictures.iter().map(move |(_, picture)| &picture[y * WIDTH..][..WIDTH]));
    let bytes: Vec<u8> = rows.flatten().flat_map(|light| light.map(encoded)).collect();
    let [width, height] = [3 * WIDTH, HEIGHT].map(|size| u32::try_from(size).unwrap_or(u32::MAX));
    let saved = image::save_buffer(&out, &bytes, width, height, image::ColorType::Rgb8);
    saved.map_err(|error| Error::Io {
        action: "cannot write",
        path: out.clone(),
        source: std::io::Error::other(error),
    })?;
    println!("{}", out.display());
    Ok(())
}
