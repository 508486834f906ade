//! Writes files of this format.

use std::f64::consts::{FRAC_PI_2, PI};
use std::io::{self, Write};
use std::path::Path;

use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::brdf::{Rgb, direction};
use crate::formats::rgl::primaries::{COUNT, primaries, wavelengths};
use crate::formats::rgl::tabulate::facet;
use crate::formats::rgl::tensor_file::{self, NewField};
use crate::formats::rgl::warp::Map;
use crate::formats::rgl::{RglBrdf, luminance};

/// How an RGL file holds colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RglColours {
    /// Smooth spectra from 410 to 680 nm, which have the colours in linear sRGB under D65. Spectral variants of
    /// Mitsuba 3 and pbrt-v4 read such files.
    #[default]
    Spectral,
    /// Linear sRGB. RGB variants of Mitsuba 3 read such files.
    Rgb,
}

/// The least density of samples in units of the average one, so that no direction is left out.
const LEAST_LUMINANCE: f64 = 1e-3;

/// Writes an RGL file for other renderers.
///
/// # Errors
/// [`Error::Io`] when the file cannot be written; no part of it is left then.
pub fn write_rgl(path: impl AsRef<Path>, brdf: &RglBrdf, colours: RglColours) -> Result<()> {
    let mut file = AtomicFile::create(path.as_ref())?;
    write_rgl_to(&mut file, brdf, colours).map_err(|source| Error::write(path.as_ref(), source))?;
    file.commit()
}

/// Writes an RGL file to `to`: `rgb` or `spectra` and `wavelengths`, and beside these the fields `description`,
/// `phi_i`, `theta_i`, `ndf`, `sigma`, `vndf`, `luminance` and `jacobian`.
///
/// # Errors
/// Any error of `to`.
pub fn write_rgl_to(to: impl Write, brdf: &RglBrdf, colours: RglColours) -> io::Result<()> {
    let slices = brdf.theta_i.len();
    let (height, width) = (brdf.rgb_height, brdf.rgb_width);
    let grid = |name, map: &Map| NewField::floats(name, &[map.height, map.width], map.values.iter().copied());
    let mut fields = vec![
        NewField::bytes("description", brdf.description.clone().into_bytes()),
        NewField::floats("phi_i", &[1], [0.0]),
        NewField::floats("theta_i", &[slices], brdf.theta_i.iter().map(|&x| single(x))),
        grid("ndf", &brdf.ndf),
        grid("sigma", &brdf.sigma),
        NewField::floats("vndf", &[1, slices, brdf.warp.height, brdf.warp.width], brdf.warp.densities()),
        NewField::floats("luminance", &[1, slices, height, width], brdf.weights()),
        NewField::bytes("jacobian", vec![u8::from(brdf.jacobian)]),
    ];
    match colours {
        RglColours::Rgb => {
            fields.push(brdf.planes("rgb", &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]));
        }
        RglColours::Spectral => {
            let primaries = primaries().ok_or_else(|| io::Error::other("the primaries have no spectra"))?;
            fields.push(NewField::floats("wavelengths", &[COUNT], wavelengths().map(single)));
            fields.push(brdf.planes("spectra", &primaries));
        }
    }
    tensor_file::write(to, &fields)
}

#[expect(clippy::cast_possible_truncation, reason = "f32 is the file's precision")]
fn single(x: f64) -> f32 {
    x as f32
}

impl RglBrdf {
    /// One plane of values for each of `channels`: how much of red, green and blue it holds.
    fn planes(&self, name: &'static str, channels: &[Rgb]) -> NewField {
        let size = self.rgb_height * self.rgb_width;
        let shape = [1, self.theta_i.len(), channels.len(), self.rgb_height, self.rgb_width];
        let values = self
            .rgb
            .chunks_exact(size)
            .flat_map(|slice| channels.iter().map(move |channel| (slice, channel)))
            .flat_map(|(slice, channel)| {
                let part = move |rgb: &[f32; 3]| {
                    rgb.iter().zip(channel).map(|(&x, &share)| f64::from(x) * share).sum()
                };
                slice.iter().map(move |rgb| single(part(rgb)))
            });
        NewField::floats(name, &shape, values)
    }

    /// The density of samples on top of the warp's, `[theta_i][y][x]`, up to a factor per slice: the luminance of
    /// `f cos(theta_o)` over the density of `wo` by the warp alone.
    ///
    /// The warp has the density `p` on the unit square of `m`. One unit of its area is `2 pi^2 x sin(theta_m)` of
    /// solid angle of `m`, and that is `4 wi . m` times as much of `wo`.
    fn weights(&self) -> Vec<f32> {
        let size = self.rgb_height * self.rgb_width;
        let mut weights = Vec::with_capacity(self.rgb.len());
        for (slice, (colours, &theta_i)) in self.rgb.chunks_exact(size).zip(&self.theta_i).enumerate() {
            let wi = direction(theta_i, 0.0);
            let sigma = self.sigma.eval((theta_i / FRAC_PI_2).sqrt(), 0.5);
            let mut values: Vec<f64> = Vec::with_capacity(size);
            for (k, rgb) in colours.iter().enumerate() {
                let s_x = (k % self.rgb_width) as f64 / (self.rgb_width - 1) as f64;
                let s_y = (k / self.rgb_width) as f64 / (self.rgb_height - 1) as f64;
                let ([x, y], density) = self.warp.sample(slice, s_x, s_y);
                let m = facet(x, y);
                let factor = if self.jacobian { self.ndf.eval(x, y) / (4.0 * sigma) } else { 1.0 };
                let solid_angle = 2.0 * PI * PI * x * m.x.hypot(m.y) * 4.0 * wi.dot(&m).max(0.0);
                let value = luminance(rgb.map(f64::from)).max(0.0) * factor * solid_angle / density;
                values.push(if value.is_finite() { value } else { 0.0 });
            }
            let mean = values.iter().sum::<f64>() / size as f64;
            let scale = if mean > 0.0 { 1.0 / mean } else { 0.0 };
            weights.extend(values.into_iter().map(|value| single((value * scale).max(LEAST_LUMINANCE))));
        }
        weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Brdf;
    use crate::formats::rgl::RglGrid;
    use crate::formats::rgl::tensor_file::{TensorFile, U8};
    use crate::formats::rgl::warp::Warp;
    use crate::formats::{Content, Source};
    use nalgebra::Vector3;

    fn table() -> RglBrdf {
        let source = Source::built_in("red-plastic").unwrap();
        RglBrdf::tabulate(source.brdf().unwrap(), RglGrid { incidences: 9, resolution: 16 }, "Red").unwrap()
    }

    fn file(brdf: &RglBrdf, colours: RglColours) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_rgl_to(&mut bytes, brdf, colours).unwrap();
        bytes
    }

    fn compare(a: &RglBrdf, b: &RglBrdf, tolerance: f64) {
        for k in 0..2000 {
            let t = f64::from(k) / 2000.0;
            let wi = direction(1.5 * (7.0 * t).fract(), 40.0 * t);
            let wo = direction(1.5 * (31.0 * t).fract(), 11.0 * t);
            let (a, b): (Rgb, Rgb) = (a.eval(&wi, &wo), b.eval(&wi, &wo));
            let scale = a.iter().copied().fold(1e-6, f64::max);
            assert!((0..3).all(|c| (a[c] - b[c]).abs() < tolerance * scale), "{a:?} {b:?}");
        }
    }

    #[test]
    fn files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let brdf = table();
        for (colours, tolerance) in [(RglColours::Rgb, 2e-5), (RglColours::Spectral, 1e-4)] {
            let path = folder.path().join("x.bsdf");
            write_rgl(&path, &brdf, colours).unwrap();
            let read = crate::formats::read_rgl(&path).unwrap();
            assert_eq!(read.description(), "Red");
            compare(&brdf, &read, tolerance);
            let source = Source::open(&path).unwrap();
            assert!(matches!(source.content, Content::Function { .. }));
            assert_eq!(source.description, "Red");
        }
        assert!(write_rgl(folder.path(), &brdf, RglColours::Rgb).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    /// The shapes that Mitsuba 3 and pbrt-v4 ask for.
    #[test]
    fn files_have_the_fields_that_renderers_read() {
        let (brdf, path) = (table(), Path::new("x.bsdf"));
        for (colours, name, channels) in
            [(RglColours::Rgb, "rgb", 3), (RglColours::Spectral, "spectra", COUNT)]
        {
            let bytes = file(&brdf, colours);
            let file = TensorFile::parse(&bytes, path).unwrap();
            assert_eq!(file.field("description", U8, 1).unwrap().bytes, b"Red");
            assert_eq!(file.field("jacobian", U8, 1).unwrap().bytes, [1]);
            assert_eq!(file.floats("phi_i", 1).unwrap(), (vec![1], vec![0.0]));
            assert_eq!(file.floats("theta_i", 1).unwrap().0, [9]);
            assert_eq!(file.floats("ndf", 2).unwrap().0, [2, 256]);
            assert_eq!(file.floats("sigma", 2).unwrap().0, [2, 256]);
            assert_eq!(file.floats("vndf", 4).unwrap().0, [1, 9, 64, 128]);
            let (shape, values) = file.floats("luminance", 4).unwrap();
            assert_eq!(shape, [1, 9, 16, 16]);
            assert!(values.iter().all(|x| *x > 0.0));
            let (shape, values) = file.floats(name, 5).unwrap();
            assert_eq!(shape, [1, 9, channels, 16, 16]);
            assert!(values.iter().all(|x| *x >= 0.0) && values.iter().any(|x| *x > 0.5));
            let wavelengths = file.get("wavelengths").map(|field| field.shape.clone());
            assert_eq!(wavelengths, (colours == RglColours::Spectral).then(|| vec![channels]));
            // Renderers address arrays in place.
            for name in ["theta_i", "ndf", "sigma", "vndf", "luminance", name] {
                let field = file.get(name).unwrap();
                assert_eq!((field.bytes.as_ptr() as usize - bytes.as_ptr() as usize) % 4, 0, "{name}");
            }
        }
    }

    /// Samples by both warps have the density of the luminance of `f cos(theta_o)`: the average of `f cos / pdf`
    /// over them is the albedo, and its parts do not vary much.
    #[test]
    fn samples_follow_the_reflected_light() {
        let brdf = table();
        let bytes = file(&brdf, RglColours::Rgb);
        let parsed = TensorFile::parse(&bytes, Path::new("x.bsdf")).unwrap();
        let (_, weights) = parsed.floats("luminance", 4).unwrap();
        let luminance_warp = Warp::new(16, 16, &weights).unwrap();
        for slice in 0..6 {
            let theta_i = brdf.theta_i[slice];
            let wi = direction(theta_i, 0.0);
            let (mut sum, mut squares, steps) = (0.0, 0.0, 100);
            for k in 0..steps * steps {
                let t = [k % steps, k / steps].map(|k| (f64::from(k) + 0.5) / f64::from(steps));
                let ([s_x, s_y], weight) = luminance_warp.sample(slice, t[0], t[1]);
                let ([x, y], density) = brdf.warp.sample(slice, s_x, s_y);
                let m = facet(x, y);
                let wo: Vector3<f64> = 2.0 * m.dot(&wi) * m - wi;
                let pdf = weight * density / (8.0 * PI * PI * x * m.x.hypot(m.y) * m.dot(&wi));
                let part = if wo.z > 0.0 { luminance(brdf.eval(&wi, &wo)) * wo.z / pdf } else { 0.0 };
                sum += part;
                squares += part * part;
            }
            let count = f64::from(steps * steps);
            let (mean, deviation) = (sum / count, (squares / count - (sum / count).powi(2)).max(0.0).sqrt());
            let mut albedo = 0.0;
            for k in 0..90 * 180 {
                let (cos, phi) = ((f64::from(k % 90) + 0.5) / 90.0, (f64::from(k / 90) + 0.5) * PI / 90.0);
                albedo +=
                    luminance(brdf.eval(&wi, &direction(f64::acos(cos), phi))) * cos * 2.0 * PI / 16_200.0;
            }
            assert!((mean / albedo - 1.0).abs() < 0.02, "{slice}: {mean} {albedo}");
            assert!(deviation < 0.5 * mean, "{slice}: {mean} {deviation}");
        }
    }

    #[test]
    fn a_black_material_has_samples() {
        let black = crate::brdf::analytic::Lambert { albedo: [0.0; 3] };
        let brdf = RglBrdf::tabulate(&black, RglGrid { incidences: 3, resolution: 4 }, "").unwrap();
        let bytes = file(&brdf, RglColours::Spectral);
        let file = TensorFile::parse(&bytes, Path::new("x.bsdf")).unwrap();
        assert!(file.floats("luminance", 4).unwrap().1.iter().all(|x| *x > 0.0));
    }
}
