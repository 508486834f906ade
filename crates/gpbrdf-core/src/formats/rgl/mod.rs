//! RGL `.bsdf` measurements (EPFL material database), isotropic RGB files only.
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
//! database's evaluator returns `f cos(theta_o)`; this one divides by the cosine.

mod tensor_file;

use crate::formats::format::{Format, Reader};
use crate::formats::source::Content;
use std::f64::consts::{FRAC_1_PI, PI};
use std::path::Path;

use nalgebra::Vector3;

use crate::base::error::Result;
use crate::brdf::Reciprocal;
use crate::brdf::angles::HORIZON_COSINE;
use crate::brdf::{Brdf, Rgb};
use crate::formats::read::read_bytes;
use crate::formats::rgl::tensor_file::{TensorFile, U8};

/// Bytes at the start of an RGL file.
const MAGIC: &[u8] = b"tensor_file\0";

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

/// Limit on the size of a file; every file of the database is smaller, spectral and anisotropic ones
/// included.
const LIMIT_BYTES: u64 = 1 << 30;

/// An isotropic RGB measurement of the RGL database. It takes about 1.3 MB.
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

/// A scalar map on a grid over the unit square.
#[derive(Clone)]
struct Map {
    height: usize,
    width: usize,
    values: Vec<f32>,
}

/// The cumulative distribution of visible normals; each slice integrates to 1.
#[derive(Clone)]
struct Warp {
    height: usize,
    width: usize,
    /// Density at a node, and its integral along the row from the start to the node; `[theta_i][y][x]`.
    nodes: Vec<[f32; 2]>,
    /// Integral over all rows up to this one; `[theta_i][y]`.
    rows: Vec<f32>,
}

/// The lower node and the weight of the upper one, at `t` in `[0, 1]` on `n >= 2` nodes.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the nodes; NaN is 0")]
fn node(t: f64, n: usize) -> (usize, f64) {
    let x = t.clamp(0.0, 1.0) * (n - 1) as f64;
    let low = (x as usize).min(n - 2);
    (low, x - low as f64)
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + t * (b - a)
}

impl Map {
    fn eval(&self, x: f64, y: f64) -> f64 {
        let (i, a) = node(x, self.width);
        let (j, b) = node(y, self.height);
        let at = |j: usize| {
            let row = j * self.width + i;
            mix(self.values[row].into(), self.values[row + 1].into(), a)
        };
        mix(at(j), at(j + 1), b)
    }
}

impl Warp {
    /// Integrates `vndf`, `[theta_i][y][x]`, by the trapezoid rule with unit spacing. The error is the index
    /// of a slice that is zero everywhere.
    fn new(height: usize, width: usize, vndf: &[f32]) -> Result<Self, usize> {
        let mut nodes = Vec::with_capacity(vndf.len());
        let mut rows = Vec::with_capacity(vndf.len() / width);
        let mut row_totals = Vec::with_capacity(height);
        let mut integrals = vec![0.0; height * width];
        for (slice, values) in vndf.chunks_exact(height * width).enumerate() {
            row_totals.clear();
            for (row, integral) in values.chunks_exact(width).zip(integrals.chunks_exact_mut(width)) {
                let mut sum = 0.0;
                for x in 1..width {
                    sum += 0.5 * (f64::from(row[x - 1]) + f64::from(row[x]));
                    integral[x] = sum;
                }
                row_totals.push(sum);
            }
            let total: f64 = row_totals.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).sum();
            if !(total > 0.0) {
                return Err(slice);
            }
            #[expect(clippy::cast_possible_truncation, reason = "f32 is the file's precision")]
            {
                nodes.extend(values.iter().zip(&integrals).map(|(&density, &integral)| {
                    [(f64::from(density) / total) as f32, (integral / total) as f32]
                }));
                let mut sum = 0.0;
                rows.push(0.0);
                for pair in row_totals.windows(2) {
                    sum += 0.5 * (pair[0] + pair[1]);
                    rows.push((sum / total) as f32);
                }
            }
        }
        Ok(Self { height, width, nodes, rows })
    }

    /// The point that is mapped to `(x, y)` by the warp of slices `low` and `high`, blended with the weight
    /// `weight` of `high`.
    fn invert(&self, low: usize, high: usize, weight: f64, x: f64, y: f64) -> (f64, f64) {
        let (i, a) = node(x, self.width);
        let (j, b) = node(y, self.height);
        let size = self.height * self.width;
        let row = j * self.width;
        let blend = |index: usize| {
            let [v0, c0] = self.nodes[low * size + index];
            let [v1, c1] = self.nodes[high * size + index];
            [mix(v0.into(), v1.into(), weight), mix(c0.into(), c1.into(), weight)]
        };
        let [v00, c00] = blend(row + i);
        let [v01, _] = blend(row + i + 1);
        let [v10, c10] = blend(row + self.width + i);
        let [v11, _] = blend(row + self.width + i + 1);
        let [_, r0] = blend(row + self.width - 1);
        let [_, r1] = blend(row + 2 * self.width - 1);
        let m =
            mix(self.rows[low * self.height + j].into(), self.rows[high * self.height + j].into(), weight);
        let left = mix(v00, v10, b);
        let right = mix(v01, v11, b);
        let along = a * (left + 0.5 * a * (right - left)) + mix(c00, c10, b);
        let total = mix(r0, r1, b);
        // A row without density is never sampled, so any value will do.
        let s_x = if total > 0.0 { along / total } else { 0.0 };
        let s_y = m + b * (r0 + 0.5 * b * (r1 - r0));
        (s_x, s_y)
    }
}

impl RglBrdf {
    /// What the file says about its material.
    #[must_use]
    pub fn description(&self) -> &str {
        &self.description
    }

    fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let file = TensorFile::parse(bytes, path)?;
        if file.get("rgb").is_none() && file.get("spectra").is_some() {
            return Err(file.wrong(
                "an RGB measurement (field `rgb`)",
                "a spectral one (field `spectra`); the database has the RGB variant as `*_rgb.bsdf`",
            ));
        }
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

        let (shape, planes) = file.floats("rgb", 5)?;
        sized("rgb", &shape, &[1, slices, 3, 0, 0])?;
        let (rgb_height, rgb_width) = (shape[3], shape[4]);
        let size = rgb_height * rgb_width;
        let rgb = planes
            .chunks_exact(3 * size)
            .flat_map(|slice| (0..size).map(|k| [slice[k], slice[size + k], slice[2 * size + k]]))
            .collect();

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

/// Reads an RGL `.bsdf` file with an isotropic RGB measurement.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) when the file cannot be read; [`Error::Format`](crate::Error::Format) when
/// it is damaged, spectral or anisotropic, or lacks a field.
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

    /// A forward warp, found by bisection on the integrals of the blended density, undoes `invert`.
    #[test]
    fn warp_is_the_cumulative_distribution() {
        let mut random = Random::new(11);
        let (height, width) = (5, 4);
        let vndf: Vec<f32> = (0..2 * height * width).map(|_| 0.1 + random.below(100) as f32).collect();
        let warp = Warp::new(height, width, &vndf).unwrap();
        let weight = 0.3;
        let normalised: Vec<f64> = (0..height * width)
            .map(|k| {
                let mass = |slice: usize| -> f64 {
                    let at = |y: usize, x: usize| f64::from(vndf[(slice * height + y) * width + x]);
                    let cells = (0..height - 1).flat_map(|y| (0..width - 1).map(move |x| (y, x)));
                    cells
                        .map(|(y, x)| 0.25 * (at(y, x) + at(y + 1, x) + at(y, x + 1) + at(y + 1, x + 1)))
                        .sum()
                };
                mix(f64::from(vndf[k]) / mass(0), f64::from(vndf[height * width + k]) / mass(1), weight)
            })
            .collect();
        let density = |x: f64, y: f64| {
            let ((i, a), (j, b)) = (node(x, width), node(y, height));
            let row = |j: usize| mix(normalised[j * width + i], normalised[j * width + i + 1], a);
            mix(row(j), row(j + 1), b)
        };
        // The integral is taken by the midpoint rule in the cells of a fine grid.
        let steps = 3 * 400;
        let integral = |to: f64, f: &dyn Fn(f64) -> f64| -> f64 {
            let h = to / f64::from(steps);
            (0..steps).map(|k| f((f64::from(k) + 0.5) * h) * h).sum()
        };
        for (x, y) in [(0.2, 0.7), (0.9, 0.1), (0.5, 0.5), (1.0, 0.33)] {
            let (s_x, s_y) = warp.invert(0, 1, weight, x, y);
            let scale = (width - 1) as f64;
            let expected_x = integral(x, &|t| density(t, y)) / integral(1.0, &|t| density(t, y));
            let expected_y =
                integral(y, &|t| integral(1.0, &|s| density(s, t)) * scale * (height - 1) as f64);
            assert!((s_x - expected_x).abs() < 1e-5, "{s_x} {expected_x}");
            assert!((s_y - expected_y).abs() < 1e-5, "{s_y} {expected_y}");
        }
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
        let spectral = Maker::new().without("rgb").with("spectra", F32, vec![1], constant(0.0, 1));
        assert!(spectral.error().contains("found a spectral one"), "{}", spectral.error());
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
