//! RGL `.bsdf` files (EPFL material database): isotropic measurements, read and written.
//!
//! Source: J. Dupuy and W. Jakob, "An Adaptive Parameterization for Efficient Material Acquisition and
//! Rendering" (2018). With `theta_m`, `phi_m` the spherical angles of the half vector `h`:
//!
//! ```text
//! u(theta) = sqrt(2 theta / pi)            v(phi) = (phi + pi) / (2 pi)
//! (x, y)   = (u(theta_m), fract(v(phi_m - phi_i)))
//! (s_x, s_y) = inverse of the vndf warp of theta_i at (x, y)
//! f cos(theta_o) = max(0, rgb(s_x, s_y)) ndf(x, y) / (4 sigma(u(theta_i), v(phi_i)))
//! ```
//!
//! All maps are bilinear on grids over the unit square, and linear in `theta_i` between slices. The
//! database's evaluator returns `f cos(theta_o)`; this one divides by the cosine. Spectra are read as linear sRGB
//! under D65.

mod primaries;
mod tabulate;
mod tensor_file;
mod warp;
mod write;

pub use tabulate::RglGrid;
pub use write::{RglColours, write_rgl, write_rgl_to};

use crate::formats::format::{Format, Reader};
use crate::formats::source::Content;
use std::f64::consts::{FRAC_1_PI, PI};
use std::path::Path;

use nalgebra::Vector3;

use crate::base::error::Result;
use crate::brdf::Reciprocal;
use crate::brdf::angles::HORIZON_COSINE;
use crate::brdf::{Brdf, LUMINANCE_WEIGHTS, Rgb};
use crate::formats::measured::spectrum::SpectrumToRgb;
use crate::formats::read::read_bytes;
use crate::formats::rgl::tensor_file::{MAGIC, TensorFile, U8};
use crate::formats::rgl::warp::{Map, Warp, mix, node};

/// Smallest cosine at which measurements are evaluated: closer to the horizon they are extrapolated.
const MIN_MEASURED_COSINE: f64 = 0.02;

/// Reads the measurement as a reciprocal BRDF that is defined up to the horizon.
fn read_reciprocal(path: &Path) -> Result<Content> {
    let inner = read_rgl(path)?;
    let description = inner.description().to_owned();
    let brdf = Box::new(Reciprocal { inner, min_cosine: MIN_MEASURED_COSINE });
    Ok(Content::Function { brdf, description })
}

/// A measurement of the RGL database.
pub(crate) const FORMAT: Format = Format {
    name: "RGL measurement",
    file: "RGL .bsdf",
    recognises: |head| head.bytes.starts_with(MAGIC),
    read: Reader::File(read_reciprocal),
};

/// Relative luminance of linear sRGB.
fn luminance(rgb: Rgb) -> f64 {
    rgb.iter().zip(LUMINANCE_WEIGHTS).map(|(x, weight)| x * weight).sum()
}

/// Limit on the size of a file; every file of the database is smaller, spectral and anisotropic ones
/// included.
const LIMIT_BYTES: u64 = 1 << 30;

/// The maps of an isotropic RGL file. A measurement of the database takes about 1.3 MB, a BRDF tabulated on the
/// default grid about 16 MB.
#[derive(Clone)]
pub struct RglBrdf {
    description: String,
    /// Polar angles of incidence of the slices, radians, increasing.
    theta_i: Vec<f64>,
    /// Normal distribution, `[y][x]`.
    ndf: Map,
    /// Projected area of the microfacets, `[y][x]`.
    sigma: Map,
    /// Whether `rgb` does not include the factor `ndf / (4 sigma)`.
    jacobian: bool,
    warp: Warp,
    /// Resolution of the colour map.
    rgb_height: usize,
    rgb_width: usize,
    /// `[theta_i][y][x][channel]`.
    rgb: Vec<[f32; 3]>,
}

impl RglBrdf {
    /// What the file says about its material.
    #[must_use]
    pub fn description(&self) -> &str {
        &self.description
    }

    fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let file = TensorFile::parse(bytes, path)?;
        let description =
            String::from_utf8_lossy(file.field("description", U8, 1)?.bytes).trim_matches('\0').to_owned();

        let (_, phi_i) = file.floats("phi_i", 1)?;
        if phi_i.len() > 1 {
            return Err(file.wrong(
                "an isotropic measurement (one `phi_i`)",
                format!("an anisotropic one ({} azimuths), which is not supported", phi_i.len()),
            ));
        }
        let (_, theta_i) = file.floats("theta_i", 1)?;
        if theta_i.is_empty() || theta_i.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(file.wrong("increasing angles in field `theta_i`", format!("{theta_i:?}")));
        }
        let slices = theta_i.len();
        let sized = |name: &str, found: &[usize], expected: &[usize]| {
            // A zero in `expected` allows any size of at least 2.
            let fits = |(&have, &want): (&usize, &usize)| if want == 0 { have >= 2 } else { have == want };
            if found.iter().zip(expected).all(fits) {
                return Ok(());
            }
            let shape = format!("{expected:?}").replace('0', "at least 2");
            Err(file.wrong(format!("shape {shape} in field `{name}`"), format!("{found:?}")))
        };
        let positive = |name: &str, values: &[f32]| match values.iter().position(|&value| value < 0.0) {
            None => Ok(()),
            Some(index) => Err(file.wrong(
                format!("no negative number in field `{name}`"),
                format!("{} at index {index}", values[index]),
            )),
        };
        let map = |name: &str| {
            let (shape, values) = file.floats(name, 2)?;
            sized(name, &shape, &[0, 0])?;
            positive(name, &values)?;
            Ok(Map { height: shape[0], width: shape[1], values })
        };
        let ndf = map("ndf")?;
        let sigma = map("sigma")?;

        let (shape, vndf) = file.floats("vndf", 4)?;
        sized("vndf", &shape, &[1, slices, 0, 0])?;
        positive("vndf", &vndf)?;
        let warp = Warp::new(shape[2], shape[3], &vndf).map_err(|slice| {
            file.wrong("a positive sum of each slice of field `vndf`", format!("zero in slice {slice}"))
        })?;

        let (rgb_height, rgb_width, rgb);
        if file.get("rgb").is_none() && file.get("spectra").is_some() {
            let (_, wavelengths) = file.floats("wavelengths", 1)?;
            let nm: Vec<f64> = wavelengths.iter().map(|&nm| nm.into()).collect();
            let map = SpectrumToRgb::new(&nm).ok_or_else(|| {
                file.wrong("increasing wavelengths within 380 to 780 nm", format!("{wavelengths:?}"))
            })?;
            let (shape, planes) = file.floats("spectra", 5)?;
            sized("spectra", &shape, &[1, slices, nm.len(), 0, 0])?;
            (rgb_height, rgb_width) = (shape[3], shape[4]);
            let size = rgb_height * rgb_width;
            let spectrum = |slice: &[f32], k: usize| -> [f32; 3] {
                #[expect(clippy::cast_possible_truncation, reason = "f32 is the file's precision")]
                map.rgb(slice.iter().skip(k).step_by(size).map(|&x| x.into())).map(|x| x as f32)
            };
            rgb = planes
                .chunks_exact(nm.len() * size)
                .flat_map(|slice| (0..size).map(move |k| (slice, k)))
                .map(|(slice, k)| spectrum(slice, k))
                .collect();
        } else {
            let (shape, planes) = file.floats("rgb", 5)?;
            sized("rgb", &shape, &[1, slices, 3, 0, 0])?;
            (rgb_height, rgb_width) = (shape[3], shape[4]);
            let size = rgb_height * rgb_width;
            rgb = planes
                .chunks_exact(3 * size)
                .flat_map(|slice| (0..size).map(|k| [slice[k], slice[size + k], slice[2 * size + k]]))
                .collect();
        }

        let jacobian = match file.get("jacobian") {
            Some(_) => file.field("jacobian", U8, 1)?.bytes.first() != Some(&0),
            None => true,
        };
        let theta_i = theta_i.into_iter().map(f64::from).collect();
        Ok(Self { description, theta_i, ndf, sigma, jacobian, warp, rgb_height, rgb_width, rgb })
    }

    /// `f cos(theta_o)`, sr^-1, of two directions above the horizon.
    fn eval_with_cosine(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        let h = wi + wo;
        let horizontal_i = (wi.x * wi.x + wi.y * wi.y).sqrt();
        let horizontal_m = (h.x * h.x + h.y * h.y).sqrt();
        let theta_i = horizontal_i.atan2(wi.z);
        let theta_m = horizontal_m.atan2(h.z);
        let phi_i = wi.y.atan2(wi.x);
        // This is phi_m - phi_i. It is set to zero where the half vector or wi equals the normal to rounding.
        let relative = if horizontal_i.min(horizontal_m) <= 1e-15 {
            0.0
        } else {
            (wi.x * h.y - wi.y * h.x).atan2(wi.x * h.x + wi.y * h.y)
        };
        let u = |theta: f64| (2.0 * FRAC_1_PI * theta).sqrt();
        let v = |phi: f64| (phi + PI) * (0.5 * FRAC_1_PI);
        let (x, y) = (u(theta_m), v(relative).fract());

        let low = self.theta_i.partition_point(|&t| t <= theta_i).saturating_sub(1);
        let high = (low + 1).min(self.theta_i.len() - 1);
        let span = self.theta_i[high] - self.theta_i[low];
        let weight = if span > 0.0 { ((theta_i - self.theta_i[low]) / span).clamp(0.0, 1.0) } else { 0.0 };

        let (s_x, s_y) = self.warp.invert(low, high, weight, x, y);
        let factor = if self.jacobian {
            let sigma = self.sigma.eval(u(theta_i), v(phi_i));
            if sigma > 0.0 { self.ndf.eval(x, y) / (4.0 * sigma) } else { 0.0 }
        } else {
            1.0
        };
        // A NaN, which comes from directions that hold one, becomes 0, too.
        self.colour(low, high, weight, s_x, s_y).map(|value| (value * factor).max(0.0))
    }

    /// The colour map, blended between two slices.
    fn colour(&self, low: usize, high: usize, weight: f64, x: f64, y: f64) -> Rgb {
        let (i, a) = node(x, self.rgb_width);
        let (j, b) = node(y, self.rgb_height);
        let mut sum = [0.0; 3];
        for (slice, part) in [(low, 1.0 - weight), (high, weight)] {
            for (j, row_part) in [(j, part * (1.0 - b)), (j + 1, part * b)] {
                let at = (slice * self.rgb_height + j) * self.rgb_width + i;
                let (left, right) = (self.rgb[at], self.rgb[at + 1]);
                for c in 0..3 {
                    sum[c] += row_part * mix(left[c].into(), right[c].into(), a);
                }
            }
        }
        sum
    }
}

impl Brdf for RglBrdf {
    /// `f(wi, wo)`. As measured, it obeys reciprocity only up to noise; wrap it in [`Reciprocal`] where that
    /// matters. It is finite for all directions; a `cos(theta_o)` below 1e-6 is replaced by 1e-6.
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        // This condition is also true for NaN, for which the result is zero.
        if !(wi.z > 0.0 && wo.z > 0.0) {
            return [0.0; 3];
        }
        let scale = 1.0 / wo.z.max(HORIZON_COSINE);
        self.eval_with_cosine(wi, wo).map(|value| value * scale)
    }
}

impl std::fmt::Debug for RglBrdf {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RglBrdf")
            .field("description", &self.description)
            .field("theta_i", &self.theta_i)
            .finish_non_exhaustive()
    }
}

/// Reads an RGL `.bsdf` file of an isotropic material. Spectra become linear sRGB under D65, out-of-gamut
/// (negative) channels 0.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) when the file cannot be read; [`Error::Format`](crate::Error::Format) when
/// it is damaged or anisotropic, or lacks a field.
pub fn read_rgl(path: impl AsRef<Path>) -> Result<RglBrdf> {
    let path = path.as_ref();
    RglBrdf::parse(&read_bytes(path, "RGL", LIMIT_BYTES)?, path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::angles::direction;
    use crate::formats::mutate::{Random, mutations};
    use crate::formats::rgl::tensor_file::F32;
    use crate::test_data::data_dir;

    /// A small file with constant maps, so that `f` is known.
    struct Maker {
        fields: Vec<(&'static str, u8, Vec<u64>, Vec<u8>)>,
    }

    fn f32s(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
        values.into_iter().flat_map(f32::to_le_bytes).collect()
    }

    fn constant(value: f32, count: usize) -> Vec<u8> {
        f32s(std::iter::repeat_n(value, count))
    }

    impl Maker {
        fn new() -> Self {
            let rgb = [0.5, 1.0, -2.0].map(|value| constant(value, 4)).concat().repeat(2);
            Self {
                fields: vec![
                    ("description", U8, vec![5], b"Plain".to_vec()),
                    ("phi_i", F32, vec![1], f32s([0.0])),
                    ("theta_i", F32, vec![2], f32s([0.0, 1.5])),
                    ("sigma", F32, vec![2, 2], constant(0.5, 4)),
                    ("ndf", F32, vec![2, 2], constant(3.0, 4)),
                    ("vndf", F32, vec![1, 2, 3, 3], constant(7.0, 18)),
                    ("rgb", F32, vec![1, 2, 3, 2, 2], rgb),
                    ("jacobian", U8, vec![1], vec![1]),
                ],
            }
        }

        fn with(mut self, name: &'static str, dtype: u8, shape: Vec<u64>, bytes: Vec<u8>) -> Self {
            self.fields.retain(|field| field.0 != name);
            self.fields.push((name, dtype, shape, bytes));
            self
        }

        fn without(mut self, name: &str) -> Self {
            self.fields.retain(|field| field.0 != name);
            self
        }

        fn bytes(&self) -> Vec<u8> {
            let header: usize =
                18 + self.fields.iter().map(|f| 13 + f.0.len() + 8 * f.2.len()).sum::<usize>();
            let mut offset = header as u64;
            let mut bytes = b"tensor_file\0\x01\0".to_vec();
            bytes.extend(u32::try_from(self.fields.len()).unwrap().to_le_bytes());
            for (name, dtype, shape, payload) in &self.fields {
                bytes.extend(u16::try_from(name.len()).unwrap().to_le_bytes());
                bytes.extend(name.as_bytes());
                bytes.extend(u16::try_from(shape.len()).unwrap().to_le_bytes());
                bytes.push(*dtype);
                bytes.extend(offset.to_le_bytes());
                bytes.extend(shape.iter().flat_map(|length| length.to_le_bytes()));
                offset += payload.len() as u64;
            }
            assert_eq!(bytes.len(), header);
            for field in &self.fields {
                bytes.extend(&field.3);
            }
            bytes
        }

        fn error(&self) -> String {
            parse(&self.bytes()).unwrap_err().to_string()
        }
    }

    fn parse(bytes: &[u8]) -> Result<RglBrdf> {
        RglBrdf::parse(bytes, Path::new("x.bsdf"))
    }

    #[test]
    fn constant_maps_give_a_constant_over_the_cosine() {
        let brdf = parse(&Maker::new().bytes()).unwrap();
        assert_eq!(brdf.description(), "Plain");
        let mut random = Random::new(3);
        for _ in 0..1000 {
            let [a, b, c, d] = std::array::from_fn(|_| random.below(1000) as f64 / 1000.0);
            let (wi, wo) = (direction(1.55 * a, 7.0 * b), direction(1.55 * c, 7.0 * d));
            let found = brdf.eval(&wi, &wo);
            for (found, expected) in found.iter().zip([0.75, 1.5, 0.0]) {
                assert!((found * wo.z - expected).abs() < 1e-12, "{found}");
            }
        }
        let plain = parse(&Maker::new().with("jacobian", U8, vec![1], vec![0]).bytes()).unwrap();
        assert_eq!(plain.eval(&Vector3::z(), &Vector3::z()), [0.5, 1.0, 0.0]);
    }

    /// A flat spectrum is grey, and one of long waves is red.
    #[test]
    fn spectra_become_linear_srgb() {
        let spectral = |low: f32, high: f32| {
            let planes = [constant(low, 4), constant(high, 4)].concat().repeat(2);
            let maker = Maker::new().without("rgb").with("spectra", F32, vec![1, 2, 2, 2, 2], planes);
            let maker = maker.with("wavelengths", F32, vec![2], f32s([570.0, 610.0]));
            parse(&maker.bytes()).unwrap().eval(&Vector3::z(), &Vector3::z())
        };
        let grey = spectral(0.5, 0.5);
        assert!(grey.iter().all(|x| (x - 0.75).abs() < 1e-6), "{grey:?}");
        let red = spectral(0.0, 0.5);
        assert!(red[0] > 4.0 * red[1] && red[2] < 1e-2, "{red:?}");
    }

    #[test]
    fn reference_values_are_met() {
        let Some(data) = data_dir() else { return };
        let mut reader = csv::Reader::from_path(data.join("rgl/reference_values.csv")).unwrap();
        let mut loaded: Option<(String, RglBrdf)> = None;
        let (mut files, mut rows, mut worst) = (0, 0, 0.0f64);
        for record in reader.records() {
            let record = record.unwrap();
            if loaded.as_ref().is_none_or(|(name, _)| *name != record[0]) {
                let brdf = read_rgl(data.join(format!("rgl/{}.bsdf", &record[0]))).unwrap();
                assert!(!brdf.description().is_empty());
                loaded = Some((record[0].to_owned(), brdf));
                files += 1;
            }
            let number = |k: usize| record[k].parse::<f64>().unwrap();
            let wi = direction(number(1), number(2));
            let wo = direction(number(3), number(4));
            let brdf = &loaded.as_ref().unwrap().1;
            let with_cosine = brdf.eval_with_cosine(&wi, &wo);
            let value = brdf.eval(&wi, &wo);
            for c in 0..3 {
                for (found, expected) in [(with_cosine[c], number(5 + c)), (value[c], number(8 + c))] {
                    let error = (found - expected).abs() / expected.abs().max(1e-6);
                    assert!(error < 1e-4, "{record:?}: {found} {expected}");
                    worst = worst.max(error);
                }
            }
            rows += 1;
        }
        assert_eq!((files, rows), (17, 17 * 48));
        eprintln!("worst relative error {worst:e}");
    }

    #[test]
    fn degenerate_directions_are_finite_and_the_horizon_is_black() {
        let Some(data) = data_dir() else { return };
        let brdf = read_rgl(data.join("rgl/chm_mint_rgb.bsdf")).unwrap();
        let n = Vector3::z();
        let edge = direction(std::f64::consts::FRAC_PI_2 - 1e-12, 0.3);
        let tilted = direction(0.9, 2.0);
        let mirror = direction(0.9, 2.0 + PI);
        let directions = [n, edge, tilted, mirror, direction(1e-9, 1.0), direction(1.57, 2.0 + PI)];
        for wi in &directions {
            for wo in &directions {
                let value = brdf.eval(wi, wo);
                assert!(value.iter().all(|x| x.is_finite() && *x >= 0.0), "{wi} {wo} {value:?}");
            }
        }
        for below in [Vector3::x(), -n, direction(1.8, 0.0), Vector3::repeat(f64::NAN)] {
            assert_eq!(brdf.eval(&below, &n), [0.0; 3]);
            assert_eq!(brdf.eval(&n, &below), [0.0; 3]);
        }
        // Only the azimuth between the two directions matters.
        let turned = (direction(0.5, 3.0), direction(1.1, 4.0));
        let base = brdf.eval(&direction(0.5, 0.0), &direction(1.1, 1.0));
        let found = brdf.eval(&turned.0, &turned.1);
        assert!((0..3).all(|c| (found[c] / base[c] - 1.0).abs() < 1e-5), "{found:?} {base:?}");
    }

    #[test]
    fn unfit_files_are_named() {
        let spectral =
            Maker::new().without("rgb").with("spectra", F32, vec![1, 2, 1, 2, 2], constant(0.0, 8));
        assert!(spectral.error().contains("expected a field `wavelengths`"), "{}", spectral.error());
        let infrared = spectral.with("wavelengths", F32, vec![1], f32s([900.0]));
        assert!(
            infrared.error().contains("wavelengths within 380 to 780 nm, found [900.0]"),
            "{}",
            infrared.error()
        );
        assert!(Maker::new().without("rgb").error().contains("expected a field `rgb`"));
        let anisotropic = Maker::new().with("phi_i", F32, vec![3], constant(0.0, 3));
        assert!(anisotropic.error().contains("anisotropic one (3 azimuths), which is not supported"));
        assert!(Maker::new().without("sigma").error().contains("expected a field `sigma`, found only"));
        let wrong = Maker::new().with("ndf", F32, vec![1, 4], constant(1.0, 4));
        assert!(
            wrong.error().contains("shape [at least 2, at least 2] in field `ndf`, found [1, 4]"),
            "{}",
            wrong.error()
        );
        let wrong = Maker::new().with("vndf", F32, vec![1, 2, 3, 3], constant(0.0, 18));
        assert!(wrong.error().contains("zero in slice 0"));
        let wrong = Maker::new().with("sigma", F32, vec![2, 2], f32s([1.0, 1.0, f32::NAN, 1.0]));
        assert!(wrong.error().contains("1 that are not, the first at index 2"), "{}", wrong.error());
        let wrong = Maker::new().with("sigma", U8, vec![2, 2], vec![1; 4]);
        assert!(wrong.error().contains("found u8 with shape [2, 2]"));
        let wrong = Maker::new().with("theta_i", F32, vec![2], f32s([1.0, 1.0]));
        assert!(wrong.error().contains("increasing angles"));
        let wrong = Maker::new().with("rgb", F32, vec![u64::MAX, 2, 3, 2, 2], vec![]);
        assert!(wrong.error().contains("`rgb` within the"), "{}", wrong.error());
        assert!(parse(&[]).unwrap_err().to_string().contains("an empty file"));
        assert!(parse(b"tensor_file\0\x02\0").unwrap_err().to_string().contains("version 2.0"));
    }

    #[test]
    fn damaged_files_never_panic() {
        let good = Maker::new().bytes();
        let header = good.len() - 300;
        let mut survivors = 0;
        for bytes in mutations(&good, header, 5, 20_000) {
            if let Ok(brdf) = parse(&bytes) {
                let value = brdf.eval(&direction(0.4, 0.1), &direction(0.9, 3.0));
                assert!(value.iter().all(|x| x.is_finite() && *x >= 0.0), "{value:?}");
                survivors += 1;
            }
        }
        assert!(survivors > 100 && survivors < 19_000, "{survivors}");
        for length in 0..good.len() {
            assert!(parse(&good[..length]).is_err());
        }
    }
}
