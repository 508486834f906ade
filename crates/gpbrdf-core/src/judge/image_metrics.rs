//! Comparison of two pictures of the sphere.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::base::error::{Error, Result};
use crate::brdf::Rgb;
use crate::judge::Image;
use crate::judge::ssim::mean_ssim;

/// The value that exposure gives to the 90th percentile of the truth.
const EXPOSED_PERCENTILE: f64 = 0.6;

/// Comparison of the sphere pictures of a truth and of a prediction.
///
/// PSNRs are in dB, and infinite for equal pictures. JSON has no infinity: it is written as the string
/// `"inf"`, which this type, `float("inf")` in Python and Rust's `parse` read back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageMetrics {
    /// [`psnr`] under the environment.
    #[serde(with = "decibel")]
    pub psnr_env: f64,
    /// [`psnr`] under the point light.
    #[serde(with = "decibel")]
    pub psnr_point: f64,
    /// [`ssim`] under the environment.
    pub ssim_env: f64,
    /// The paper's pixel difference under the point light.
    pub pixel_difference: PixelDifference,
}

impl ImageMetrics {
    /// Compares pictures under the environment and under the point light, each given as a pair
    /// `(truth, prediction)`. Each pair is exposed by [`exposure_of`] its truth.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] when two pictures differ in size.
    pub fn new(env: (&Image, &Image), point: (&Image, &Image)) -> Result<Self> {
        let env_exposure = exposure_of(env.0);
        Ok(Self {
            psnr_env: psnr(env.0, env.1, env_exposure)?,
            psnr_point: psnr(point.0, point.1, exposure_of(point.0))?,
            ssim_env: ssim(env.0, env.1, env_exposure)?,
            pixel_difference: PixelDifference::new(point.0, point.1)?,
        })
    }
}

/// Distribution of `|1 - b / a|` over the sphere's pixels and channels with `a > 0`, where `a` is the linear
/// radiance of the truth and `b` that of the prediction.
///
/// Source: the paper, section 5 and figure 5 (e), which finds it below 5 % under a point light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PixelDifference {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// 99th percentile.
    pub percentile_99: f64,
    /// Largest.
    pub max: f64,
    /// Share of values below 0.05, in `[0, 1]`.
    pub share_below_5_percent: f64,
}

impl PixelDifference {
    /// Compares two pictures. Where the truth is black, all values are zero and the share is 1.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] when they differ in size.
    pub fn new(truth: &Image, prediction: &Image) -> Result<Self> {
        same_size(truth, prediction)?;
        let mut values: Vec<f64> =
            pairs(truth, prediction).filter(|&(a, _)| a > 0.0).map(|(a, b)| (1.0 - b / a).abs()).collect();
        if values.is_empty() {
            return Ok(Self { share_below_5_percent: 1.0, ..Self::default() });
        }
        values.sort_unstable_by(f64::total_cmp);
        let count = values.len() as f64;
        Ok(Self {
            mean: values.iter().sum::<f64>() / count,
            median: percentile(&values, 0.5),
            percentile_99: percentile(&values, 0.99),
            max: percentile(&values, 1.0),
            share_below_5_percent: values.iter().filter(|&&x| x < 0.05).count() as f64 / count,
        })
    }
}

/// The difference that is shown in pictures: prediction minus truth, in linear values that are exposed but
/// not clipped, averaged over R, G and B. 1 is the white of the picture. Positive values are drawn red: the
/// prediction is too bright.
#[must_use]
pub fn exposed_difference(prediction: Rgb, truth: Rgb, exposure: f64) -> f64 {
    exposure * (0..3).map(|c| prediction[c] - truth[c]).sum::<f64>() / 3.0
}

/// The exposure of a picture: the factor that brings the 90th percentile over the sphere's pixels and
/// channels to 0.6. The percentile is interpolated linearly between order statistics; the factor is 1 if
/// the percentile is 0.
#[must_use]
pub fn exposure_of(truth: &Image) -> f64 {
    let mut values: Vec<f64> = truth.sphere_pixels().flatten().map(|&x| f64::from(x)).collect();
    values.sort_unstable_by(f64::total_cmp);
    let level = percentile(&values, 0.9);
    if level > 0.0 && level.is_finite() { EXPOSED_PERCENTILE / level } else { 1.0 }
}

/// Peak signal-to-noise ratio in dB: `-10 log10 mean (a - b)^2` over the sphere's pixels and channels, where
/// `a` and `b` are linear RGB times `exposure`, clipped to `[0, 1]`. Infinite for equal pictures.
///
/// # Errors
/// [`Error::InvalidArgument`] when the pictures differ in size.
pub fn psnr(truth: &Image, prediction: &Image, exposure: f64) -> Result<f64> {
    same_size(truth, prediction)?;
    let (mut sum, mut count) = (0.0, 0usize);
    for (a, b) in pairs(truth, prediction) {
        let gap = clip(a * exposure) - clip(b * exposure);
        sum += gap * gap;
        count += 1;
    }
    if sum == 0.0 {
        return Ok(f64::INFINITY);
    }
    Ok(-10.0 * (sum / count as f64).log10())
}

/// Mean structural similarity over the sphere's pixels, averaged over R, G and B. It compares the pictures as
/// shown: times `exposure`, clipped to `[0, 1]`, raised to 1/2.2, and black outside of the sphere.
///
/// Source: Wang et al. 2004, 11 x 11 Gaussian window of standard deviation 1.5.
///
/// # Errors
/// [`Error::InvalidArgument`] when the pictures differ in size.
pub fn ssim(truth: &Image, prediction: &Image, exposure: f64) -> Result<f64> {
    same_size(truth, prediction)?;
    let plane = |image: &Image, c: usize| -> Vec<f64> {
        let shown = |x: f32| clip(f64::from(x) * exposure).powf(1.0 / 2.2);
        image
            .raster()
            .pixels()
            .iter()
            .zip(image.mask())
            .map(|(p, &m)| if m { shown(p[c]) } else { 0.0 })
            .collect()
    };
    let sum: f64 = (0..3)
        .map(|c| mean_ssim(&plane(truth, c), &plane(prediction, c), truth.mask(), truth.raster().width()))
        .sum();
    Ok(sum / 3.0)
}

/// The value below which a share `p` of `sorted` is, linear between order statistics; 0 for an empty slice.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "p is in [0, 1]")]
pub(crate) fn percentile(sorted: &[f64], p: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let at = p.clamp(0.0, 1.0) * last as f64;
    let low = (at as usize).min(last);
    let high = (low + 1).min(last);
    let t = at - low as f64;
    // Not computed as a + t (b - a), which is NaN between infinities.
    if t == 0.0 { sorted[low] } else { (1.0 - t) * sorted[low] + t * sorted[high] }
}

/// Clips to `[0, 1]`; NaN stays NaN.
fn clip(x: f64) -> f64 {
    x.clamp(0.0, 1.0)
}

/// The channels of the sphere's pixels, as pairs of both pictures.
fn pairs<'a>(a: &'a Image, b: &'a Image) -> impl Iterator<Item = (f64, f64)> + 'a {
    let both = a.raster().pixels().iter().zip(b.raster().pixels()).zip(a.mask());
    both.filter(|(_, inside)| **inside)
        .flat_map(|((a, b), _)| (0..3).map(move |c| (f64::from(a[c]), f64::from(b[c]))))
}

fn same_size(a: &Image, b: &Image) -> Result<()> {
    let (a, b) = (a.raster(), b.raster());
    if (a.width(), a.height()) == (b.width(), b.height()) {
        return Ok(());
    }
    let expected = format!("{} x {} pixels like the truth", a.width(), a.height());
    Err(Error::argument("predicted image", expected, format!("{} x {}", b.width(), b.height())))
}

/// The form of a number in JSON: the number, or its name as a string where JSON has none: `"inf"`, `"-inf"`,
/// `"NaN"`.
pub(crate) mod decibel {
    use super::{Deserialize, Deserializer, Serializer};

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for this signature")]
    pub(crate) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if value.is_finite() {
            serializer.serialize_f64(*value)
        } else {
            serializer.serialize_str(&value.to_string())
        }
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Number {
            Value(f64),
            Name(String),
        }
        match Number::deserialize(deserializer)? {
            Number::Value(value) => Ok(value),
            Number::Name(name) => name.parse().map_err(serde::de::Error::custom),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::raster::Raster;

    /// A disc that is `size` pixels wide.
    fn picture(size: usize, f: impl Fn(usize) -> [f32; 3]) -> Image {
        let mask = (0..size * size)
            .map(|i| {
                let c = |i: usize| (i as f64 + 0.5) / size as f64 * 2.0 - 1.0;
                c(i % size).hypot(c(i / size)) < 1.0
            })
            .collect();
        Image::new(Raster::from_fn(size, size, |x, y| f(y * size + x)), mask).unwrap()
    }

    #[test]
    fn known_noise_has_its_psnr_and_clipping_hides_highlights() {
        let a = picture(40, |_| [0.5; 3]);
        let b = picture(40, |i| if i % 2 == 0 { [0.51; 3] } else { [0.49; 3] });
        // Mean square 1e-4 within f32: 40 dB. At exposure 1/2 the error halves: 6.02 dB more.
        assert!((psnr(&a, &b, 1.0).unwrap() - 40.0).abs() < 1e-4);
        assert!((psnr(&a, &b, 0.5).unwrap() - 40.0 - 20.0 * 2.0f64.log10()).abs() < 1e-4);
        assert_eq!(psnr(&a, &b, 4.0).unwrap(), f64::INFINITY);
        // Pixels outside of the mask are not compared.
        let c = picture(40, |i| if i == 0 { [9.0; 3] } else { [0.5; 3] });
        assert_eq!(psnr(&a, &c, 1.0).unwrap(), f64::INFINITY);
        assert!(psnr(&a, &picture(41, |_| [0.0; 3]), 1.0).is_err());
        let nan = picture(40, |_| [f32::NAN; 3]);
        assert!(psnr(&a, &nan, 1.0).unwrap().is_nan());
    }

    #[test]
    fn exposure_brings_the_ninetieth_percentile_to_six_tenths() {
        let image = picture(60, |i| [(i % 101) as f32, (i % 37) as f32 * 3.0, (i * i % 53) as f32]);
        let exposure = exposure_of(&image);
        let values: Vec<f64> = image.sphere_pixels().flatten().map(|&x| f64::from(x) * exposure).collect();
        let below = values.iter().filter(|&&x| x <= 0.6 + 1e-9).count() as f64 / values.len() as f64;
        assert!((below - 0.9).abs() < 0.02, "{below}");
        assert_eq!(exposure_of(&picture(10, |_| [0.0; 3])), 1.0);
        assert_eq!(percentile(&[1.0, 2.0, 4.0], 0.75), 3.0);
    }

    #[test]
    fn ssim_is_one_for_equal_pictures_and_falls_with_noise() {
        let a = picture(48, |i| [(i % 48) as f32 / 48.0, 0.4, 0.9]);
        assert!((ssim(&a, &a, 1.0).unwrap() - 1.0).abs() < 1e-12);
        let noisy = |amount: f32| {
            let mut i = 0;
            let raster = a.raster().map(|p| {
                i += 1;
                p.map(|x| x + amount * ((i as f32 * 0.618_034).fract() - 0.5))
            });
            Image::new(raster, a.mask().to_vec()).unwrap()
        };
        let (little, much) = (ssim(&a, &noisy(0.02), 1.0).unwrap(), ssim(&a, &noisy(0.3), 1.0).unwrap());
        assert!(1.0 > little && little > 0.9 && little > much + 0.1, "{little} {much}");
    }

    #[test]
    fn pixel_difference_summarises_ratios() {
        let a = picture(40, |i| if i % 5 == 0 { [0.0; 3] } else { [2.0; 3] });
        let b = picture(40, |i| if i % 2 == 0 { [2.02, 2.0, 2.2] } else { [1.98, 2.0, 1.8] });
        let found = PixelDifference::new(&a, &b).unwrap();
        assert!((found.mean - 0.11 / 3.0).abs() < 1e-6, "{found:?}");
        assert!((found.median - 0.01).abs() < 1e-6 && (found.max - 0.1).abs() < 1e-6);
        assert!((found.percentile_99 - 0.1).abs() < 1e-6);
        assert!((found.share_below_5_percent - 2.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn infinity_survives_json() {
        let image = picture(20, |i| [i as f32; 3]);
        let metrics = ImageMetrics::new((&image, &image), (&image, &image)).unwrap();
        let json = serde_json::to_string(&metrics).unwrap();
        assert!(json.contains("\"psnr_env\":\"inf\""), "{json}");
        assert_eq!(serde_json::from_str::<ImageMetrics>(&json).unwrap(), metrics);
    }
}
