//! Writes files of this format.

use std::io::{self, Write};
use std::path::Path;

use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::brdf::{Brdf, Rgb};
use crate::formats::measured::spectrum::xyz_from_srgb;
use crate::formats::measured::zemax::frame::Frame;
use crate::sample::SampleSet;

/// Angles about the specular direction, in degrees and increasing.
#[derive(Clone, Debug, PartialEq)]
pub struct SpecularGrid {
    /// Angles of incidence, from 0 to under 90.
    pub incidences: Vec<f64>,
    /// Azimuths about the specular direction: 0 is towards the normal. If none is above 180, the values are
    /// those of both sides of the plane of incidence.
    pub azimuths: Vec<f64>,
    /// Angles from the specular direction.
    pub radials: Vec<f64>,
}

/// The BRDF about the specular direction.
#[derive(Clone, Debug, PartialEq)]
pub struct SpecularTable {
    grid: SpecularGrid,
    /// `f` in sr^-1 for each incidence, azimuth and radial, the last running fastest; 0 below the horizon and
    /// where it is not known.
    values: Vec<Rgb>,
    description: String,
}

/// Directions whose cosine is smaller are written as not measured.
const LEAST_COSINE: f64 = 1e-3;

/// Number of steps between neighbours of a grid in sums.
const STEPS: u32 = 8;

/// Samples whose angles differ by less have the same angle, in degrees.
const SAME: f64 = 1e-4;

impl SpecularGrid {
    /// The grid for sources that can be evaluated at any directions: incidence up to 85 degrees and azimuth in
    /// steps of 5 degrees, radial up to 170 degrees in steps of 1 up to 5 degrees, of 2.5 up to 15 and of 5
    /// beyond. `is_bilateral` says whether both sides of the plane of incidence are alike.
    #[must_use]
    pub fn fine(is_bilateral: bool) -> Self {
        let steps = |from: i32, to: i32, step: f64| (from..to).map(move |k| step * f64::from(k));
        Self {
            incidences: steps(0, 18, 5.0).collect(),
            azimuths: steps(0, if is_bilateral { 37 } else { 72 }, 5.0).collect(),
            radials: steps(0, 5, 1.0).chain(steps(2, 6, 2.5)).chain(steps(3, 35, 5.0)).collect(),
        }
    }

    /// Whether the values are those of both sides of the plane of incidence.
    fn is_plane_symmetrical(&self) -> bool {
        self.azimuths.iter().all(|azimuth| (0.0..=180.0).contains(azimuth))
    }
}

impl SpecularTable {
    /// Evaluates a BRDF at the angles of a grid.
    #[must_use]
    pub fn measure(brdf: &dyn Brdf, grid: SpecularGrid, description: String) -> Self {
        let mut values = Vec::new();
        for incidence in &grid.incidences {
            let frame = Frame::new(incidence.to_radians());
            for azimuth in &grid.azimuths {
                for radial in &grid.radials {
                    let wo = frame.direction(radial.to_radians(), azimuth.to_radians());
                    values.push(if wo.z < LEAST_COSINE {
                        [0.0; 3]
                    } else {
                        let value = brdf.eval(&frame.wi, &wo);
                        value.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 })
                    });
                }
            }
        }
        Self { grid, values, description }
    }

    /// Takes samples that lie on a grid of incidence, azimuth and radial angles. The azimuth of the light does
    /// not matter.
    ///
    /// # Errors
    /// [`Error::Unsuitable`] if they fill less than half of the grid of all their angles.
    pub fn from_samples(samples: &SampleSet) -> Result<Self> {
        let places: Vec<[f64; 3]> = samples
            .iter()
            .map(|sample| {
                let theta = sample.wi.x.hypot(sample.wi.y).atan2(sample.wi.z);
                let (sin, cos) = if theta > 0.0 { (sample.wi.y, sample.wi.x) } else { (0.0, 1.0) };
                let scale = 1.0 / sin.hypot(cos);
                let (x, y) = (sample.wo.x, sample.wo.y);
                let turned = nalgebra::Vector3::new(
                    (x * cos + y * sin) * scale,
                    (y * cos - x * sin) * scale,
                    sample.wo.z,
                );
                let (radial, azimuth) = Frame::new(theta).angles(&turned);
                let azimuth = azimuth.to_degrees();
                let azimuth = if azimuth < -SAME { azimuth + 360.0 } else { azimuth.max(0.0) };
                [theta.to_degrees(), azimuth, radial.to_degrees()]
            })
            .collect();
        let is_specular = |place: &[f64; 3]| place[2] < SAME;
        let grid = SpecularGrid {
            incidences: distinct(places.iter().map(|place| place[0])),
            azimuths: distinct(places.iter().filter(|place| !is_specular(place)).map(|place| place[1])),
            radials: distinct(places.iter().map(|place| place[2])),
        };
        let unsuitable = Error::Unsuitable {
            what: samples.origin.source.clone(),
            expected: "samples on a grid of angles of incidence and angles about the specular direction",
            found: "scattered samples; fit them and convert the model",
        };
        let cells = [grid.incidences.len(), grid.azimuths.len(), grid.radials.len()];
        let above = |[i, a, r]: [usize; 3]| {
            let frame = Frame::new(grid.incidences[i].to_radians());
            frame.direction(grid.radials[r].to_radians(), grid.azimuths[a].to_radians()).z > 1e-9
        };
        let count = cells.iter().try_fold(1usize, |product, &n| product.checked_mul(n));
        let Some(count) = count.filter(|&count| count > 0 && count / 32 <= samples.len()) else {
            return Err(unsuitable);
        };
        let mut values = vec![[0.0; 3]; count];
        let index = |[i, a, r]: [usize; 3]| (i * cells[1] + a) * cells[2] + r;
        let mut filled = 0;
        for (place, value) in places.iter().zip(&samples.values) {
            let i = nearest(&grid.incidences, place[0]);
            let r = nearest(&grid.radials, place[2]);
            let azimuths = if is_specular(place) {
                0..cells[1]
            } else {
                let a = nearest(&grid.azimuths, place[1]);
                a..a + 1
            };
            for a in azimuths {
                values[index([i, a, r])] = *value;
                filled += 1;
            }
        }
        let expected = (0..count)
            .filter(|k| above([k / (cells[1] * cells[2]), k / cells[2] % cells[1], k % cells[2]]))
            .count();
        if 2 * filled < expected {
            return Err(unsuitable);
        }
        Ok(Self { grid, values, description: samples.description.clone() })
    }

    /// The total integrated scatter `integral f cos(theta_o) domega` of one channel at an angle of incidence.
    /// Between radial angles `f` is linear, and up to the horizon it is constant.
    fn total(&self, incidence: usize, channel: &dyn Fn(&Rgb) -> f64) -> f64 {
        let SpecularGrid { incidences, azimuths, radials } = &self.grid;
        let frame = Frame::new(incidences[incidence].to_radians());
        let mut total = 0.0;
        let mut covered = 0.0;
        for (a, azimuth) in azimuths.iter().enumerate() {
            let cosine = |radial: f64| frame.direction(radial, azimuth.to_radians()).z;
            let mut ring = 0.0;
            for r in 1..radials.len() {
                let (from, to) = (radials[r - 1].to_radians(), radials[r].to_radians());
                let row = (incidence * azimuths.len() + a) * radials.len();
                let [mut inner, mut outer] = [r - 1, r].map(|r| channel(&self.values[row + r]));
                if cosine(to) < LEAST_COSINE {
                    outer = inner;
                } else if cosine(from) < LEAST_COSINE {
                    inner = outer;
                }
                for step in 0..STEPS {
                    let part = (f64::from(step) + 0.5) / f64::from(STEPS);
                    let radial = from + part * (to - from);
                    let value = inner + part * (outer - inner);
                    ring += value * cosine(radial).max(0.0) * radial.sin() * (to - from) / f64::from(STEPS);
                }
            }
            // Without symmetry, the last azimuth is followed by the first.
            let around = |next: f64| if self.grid.is_plane_symmetrical() { *azimuth } else { next };
            let before = a.checked_sub(1).map(|b| azimuths[b]);
            let before = before.unwrap_or_else(|| around(azimuths[azimuths.len() - 1] - 360.0));
            let after = azimuths.get(a + 1).copied().unwrap_or_else(|| around(azimuths[0] + 360.0));
            let width = 0.5 * (after - before);
            total += ring * width;
            covered += width;
        }
        if covered > 0.0 { total * 2.0 * std::f64::consts::PI / covered } else { 0.0 }
    }
}

/// The distinct angles among many, increasing.
fn distinct(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut angles: Vec<f64> = angles.collect();
    angles.sort_by(f64::total_cmp);
    let mut found: Vec<f64> = Vec::new();
    for angle in angles {
        if found.last().is_none_or(|last| angle - last > SAME) {
            found.push((angle * 1e6).round() / 1e6);
        }
    }
    found
}

/// The index of the angle that is nearest.
fn nearest(angles: &[f64], angle: f64) -> usize {
    let above = angles.partition_point(|&a| a < angle);
    match (above.checked_sub(1), angles.get(above)) {
        (Some(below), Some(next)) if angle - angles[below] <= next - angle => below,
        (Some(below), None) => below,
        _ => above,
    }
}

/// Writes a table: one block of values for a grey one, else one for each of CIE X, Y and Z.
///
/// # Errors
/// [`Error::Io`] when the file cannot be written; no part of it is left then.
pub fn write_zemax(path: impl AsRef<Path>, table: &SpecularTable) -> Result<()> {
    let mut file = AtomicFile::create(path.as_ref())?;
    write_zemax_to(&mut file, table).map_err(|source| Error::write(path.as_ref(), source))?;
    file.commit()
}

/// Like [`write_zemax`], but writes to any writer.
///
/// # Errors
/// Any error of `to`.
pub fn write_zemax_to(mut to: impl Write, table: &SpecularTable) -> io::Result<()> {
    let grid = &table.grid;
    let is_grey = table.values.iter().all(|[r, g, b]| r == g && g == b);
    for line in table.description.lines() {
        writeln!(to, "# {line}")?;
    }
    let symmetry = if grid.is_plane_symmetrical() { "PlaneSymmetrical" } else { "Asymmetrical" };
    writeln!(to, "Source  Measured\nSymmetry  {symmetry}")?;
    writeln!(to, "SpectralContent  {}", if is_grey { "Monochrome" } else { "XYZ" })?;
    writeln!(to, "ScatterType  BRDF\nSampleRotation  1\n0")?;
    for (key, angles) in [
        ("AngleOfIncidence", &grid.incidences),
        ("ScatterAzimuth", &grid.azimuths),
        ("ScatterRadial", &grid.radials),
    ] {
        let listed: Vec<String> = angles.iter().map(f64::to_string).collect();
        writeln!(to, "{key}  {}\n{}", angles.len(), listed.join("\t"))?;
    }
    writeln!(to)?;
    if is_grey {
        block(&mut to, table, "Monochrome", &|value| value[0])?;
    } else {
        for (k, name) in ["TristimulusX", "TristimulusY", "TristimulusZ"].into_iter().enumerate() {
            block(&mut to, table, name, &|value| xyz_from_srgb(*value)[k])?;
        }
    }
    to.flush()
}

/// Writes the values of one channel.
fn block(
    to: &mut impl Write,
    table: &SpecularTable,
    name: &str,
    channel: &dyn Fn(&Rgb) -> f64,
) -> io::Result<()> {
    writeln!(to, "{name}\nDataBegin")?;
    let (azimuths, radials) = (table.grid.azimuths.len(), table.grid.radials.len());
    for (incidence, rows) in table.values.chunks(azimuths * radials).enumerate() {
        writeln!(to, "TIS {:.6}", table.total(incidence, channel))?;
        for row in rows.chunks(radials) {
            let listed: Vec<String> = row.iter().map(|value| format!("{:e}", channel(value))).collect();
            writeln!(to, "{}", listed.join("\t"))?;
        }
    }
    writeln!(to, "DataEnd")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::measured::zemax::read;
    use crate::formats::measured::{Input, ReadOptions};
    use crate::formats::source::Source;
    use crate::test_data::data_dir;

    fn again(table: &SpecularTable) -> SampleSet {
        let mut bytes = Vec::new();
        write_zemax_to(&mut bytes, table).unwrap();
        let options = ReadOptions::default();
        read::parse(Input { format: "Zemax", path: Path::new("x"), bytes: &bytes, options: &options })
            .unwrap()
    }

    #[test]
    fn functions_are_read_back() {
        for name in ["red-plastic", "lambert"] {
            let source = Source::built_in(name).unwrap();
            let brdf = source.brdf().unwrap();
            for is_bilateral in [true, false] {
                let grid = SpecularGrid::fine(is_bilateral);
                let table = SpecularTable::measure(brdf, grid, "a\nb".to_owned());
                let found = again(&table);
                assert_eq!(found.description, "a\nb");
                assert!(found.len() > 10_000, "{}", found.len());
                for (angles, value) in found.angles.iter().zip(&found.values) {
                    let expected = brdf.eval_half_diff(*angles);
                    for c in 0..3 {
                        let error = (value[c] - expected[c]).abs();
                        assert!(error < 1e-5 * (1.0 + expected[c]), "{value:?} {expected:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_total_of_a_perfect_diffuser_is_one() {
        struct White;
        impl Brdf for White {
            fn eval(&self, _: &nalgebra::Vector3<f64>, _: &nalgebra::Vector3<f64>) -> Rgb {
                [std::f64::consts::FRAC_1_PI; 3]
            }
        }
        for is_bilateral in [true, false] {
            let table = SpecularTable::measure(&White, SpecularGrid::fine(is_bilateral), String::new());
            for incidence in 0..18 {
                let total = table.total(incidence, &|value| value[0]);
                assert!((total - 1.0).abs() < 5e-4, "{incidence}: {total}");
            }
        }
    }

    #[test]
    fn measured_grids_are_read_back_and_scattered_samples_refused() {
        let Some(data) = data_dir() else { return };
        let samples = |name: &str| {
            let source = Source::open(data.join(name)).unwrap();
            source.samples().unwrap().clone()
        };
        let measured = samples("gonio/zemax_plane.bsdf");
        let found = again(&SpecularTable::from_samples(&measured).unwrap());
        assert_eq!((found.len(), &found.values), (measured.len(), &measured.values));
        for (a, b) in found.iter().zip(measured.iter()) {
            assert!((a.wi - b.wi).norm() < 1e-7 && (a.wo - b.wo).norm() < 1e-7);
        }
        assert!(SpecularTable::from_samples(&samples("cornell/cayman.brdf")).is_err());
    }
}
