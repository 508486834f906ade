//! What the examples that draw directions share: vectors, frames, and three ways to draw directions.

use gpbrdf_core::Material;
use gpbrdf_core::base::SplitMix64;
use gpbrdf_core::brdf::LUMINANCE_WEIGHTS;

/// Samples by which a GGX lobe is fitted, at each of the views.
const FIT_SAMPLES: usize = 4_000;
/// Elevations of the viewer at which it is fitted, degrees.
const FIT_VIEWS: [f32; 8] = [0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 78.0, 85.0];

pub(crate) type Direction = [f32; 3];

pub(crate) fn dot(a: Direction, b: Direction) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn normalize(a: Direction) -> Direction {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}

pub(crate) fn luminance(rgb: [f32; 3]) -> f64 {
    (0..3).map(|c| LUMINANCE_WEIGHTS[c] * f64::from(rgb[c])).sum()
}

/// A way to draw directions.
pub(crate) enum Sampler<'a> {
    Cosine,
    Ggx(Ggx),
    Own(&'a Material),
}

/// An isotropic GGX lobe of visible normals, and the share of directions drawn from it; the others follow the cosine.
/// Sources: B. Walter et al., "Microfacet Models for Refraction through Rough Surfaces" (2007), equation 33; E. Heitz,
/// "Sampling the GGX Distribution of Visible Normals", JCGT 7 (2018).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ggx {
    pub(crate) alpha: f32,
    pub(crate) share: f32,
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

    pub(crate) fn draw(self, wo: Direction, choice: f32, u: f32, v: f32) -> Direction {
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
    pub(crate) fn fitted(material: &Material) -> Self {
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
pub(crate) fn unit(random: &mut SplitMix64) -> f32 {
    (random.next_unit() as f32).min(1.0 - f32::EPSILON)
}

impl Sampler<'_> {
    /// The density of [`Sampler::draw`] at a direction above the surface, 1/sr.
    #[allow(dead_code, reason = "not every example weights densities")]
    pub(crate) fn pdf(&self, material: &Material, wi: Direction, wo: Direction) -> f32 {
        match self {
            Self::Own(_) => material.pdf(wi, wo),
            Self::Cosine => wi[2] / std::f32::consts::PI,
            Self::Ggx(ggx) => ggx.density(wi, wo),
        }
    }

    /// A direction and `f cos / pdf`.
    pub(crate) fn draw(
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
pub(crate) struct Frame([Direction; 3]);

impl Frame {
    pub(crate) fn new(n: Direction) -> Self {
        let e = normalize(if n[0].abs() < 0.5 { [0.0, -n[2], n[1]] } else { [-n[2], 0.0, n[0]] });
        let f = [n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0]];
        Self([e, f, n])
    }

    pub(crate) fn local(&self, w: Direction) -> Direction {
        self.0.map(|axis| dot(axis, w))
    }

    pub(crate) fn world(&self, w: Direction) -> Direction {
        std::array::from_fn(|k| (0..3).map(|axis| w[axis] * self.0[axis][k]).sum())
    }
}
