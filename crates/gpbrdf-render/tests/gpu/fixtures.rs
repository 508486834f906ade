//! Materials and lights of pictures.

use gpbrdf_core::{BrdfTable, Environment, HalfDiff, Rgb};
use gpbrdf_render::{BrdfTexture, Context, Light, Precision};

pub(crate) fn glossy(a: HalfDiff) -> Rgb {
    let fresnel = 0.05 + 0.95 * (1.0 - a.theta_d.cos()).powi(5);
    let lobe = 12.0 * fresnel * a.theta_h.cos().powi(120);
    [0.16 + lobe, 0.03 + lobe, 0.02 + lobe]
}

pub(crate) fn rippled(a: HalfDiff) -> Rgb {
    let ripple = 1.0 + 0.06 * (9.0 * a.theta_h).sin() * (7.0 * a.theta_d).cos();
    glossy(a).map(|x| x * ripple)
}

pub(crate) fn upload(context: &Context, table: &BrdfTable) -> BrdfTexture {
    BrdfTexture::upload(context, table, None, Precision::Single).unwrap()
}

pub(crate) fn studio() -> Light {
    Light::Environment((&Environment::studio()).into())
}
