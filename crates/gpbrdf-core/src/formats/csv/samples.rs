//! Measured samples and directions as comma-separated values.
//!
//! The first line that is not a comment (`#`) names the columns, in any order. Columns with other names are
//! ignored:
//!
//! - directions: `theta_i, phi_i, theta_o, phi_o` (polar angle and azimuth of light and viewer), or
//!   `theta_h, theta_d, phi_d` (half-difference angles); if a file has both, the former are used;
//! - values in sr^-1, without the cosine: `r, g, b` (linear sRGB), or one grey column `f` or `value`.
//!
//! The unit of an angle is part of its name: `theta_i_deg` or `theta_i [deg]`, `theta_i_rad` or
//! `theta_i [rad]`. A bare `theta_i` is in degrees. All angles of a file must have the same unit.

use crate::formats::format::Format;
use crate::formats::source::Content;
use std::f64::consts::FRAC_PI_2;
use std::io::{self, Write};
use std::path::Path;

use nalgebra::Vector3;

use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::brdf::Rgb;
use crate::brdf::angles::{HalfDiff, direction, fold_phi_d};
use crate::formats::read::read_bytes;
use crate::sample::{Sample, SampleSet};

/// Samples or directions of measurements.
pub(crate) const FORMAT: Format = Format {
    name: "samples CSV",
    file: "samples CSV",
    recognises: |head| head.line.is_some_and(looks_like_samples),
    read: |path| Ok(Content::Samples(Box::new(read_samples_csv(path)?))),
};

/// The largest file that is read.
const LIMIT_BYTES: u64 = 1 << 30;

const LIGHT_VIEWER: &[&str] = &["theta_i", "phi_i", "theta_o", "phi_o"];
const HALF_DIFF: &[&str] = &["theta_h", "theta_d", "phi_d"];

/// Directions read from a file, with their original text, so that a result can repeat it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Directions {
    /// Names of the direction columns as they are in the file, four or three.
    pub columns: Vec<String>,
    /// The text of those columns, one row for each of [`Directions::angles`].
    pub rows: Vec<Vec<String>>,
    /// The half-difference angles of each row.
    pub angles: Vec<HalfDiff>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Unit {
    Degrees,
    Radians,
}

/// Which fields of a record are read, and in which unit.
struct Layout {
    /// [`LIGHT_VIEWER`] or [`HALF_DIFF`].
    names: &'static [&'static str],
    angles: Vec<usize>,
    unit: Unit,
    /// Indices of three columns or of one; empty if only directions are read.
    values: Vec<usize>,
}

/// The angle that a column holds, and its unit if its name says one.
fn angle_column(name: &str) -> Option<(&'static str, Option<Unit>)> {
    let name = name.trim().to_ascii_lowercase();
    LIGHT_VIEWER.iter().chain(HALF_DIFF).find_map(|&base| {
        let unit = name.strip_prefix(base)?;
        let unit = match unit.trim_matches(['_', ' ', '[', ']', '(', ')']) {
            "" if unit.is_empty() => None,
            "deg" | "degree" | "degrees" | "°" => Some(Unit::Degrees),
            "rad" | "radian" | "radians" => Some(Unit::Radians),
            _ => return None,
        };
        Some((base, unit))
    })
}

/// Whether `line` is the header of a samples or directions file, or a row of one that lacks its header.
pub(crate) fn looks_like_samples(line: &str) -> bool {
    let mut fields = line.split(',').map(|field| field.trim().trim_matches('"'));
    fields.clone().any(|field| angle_column(field).is_some())
        || (fields.clone().count() >= 4 && fields.all(|field| field.parse::<f64>().is_ok()))
}

/// One file being read.
struct Source<'a> {
    path: &'a Path,
}

impl Source<'_> {
    fn wrong(&self, expected: impl Into<String>, found: impl Into<String>) -> Error {
        Error::Format {
            format: "samples CSV",
            path: self.path.to_owned(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    fn layout(&self, header: &csv::StringRecord, line: u64, with_values: bool) -> Result<Layout> {
        let listed = || {
            let names: Vec<_> = header.iter().map(|name| format!("`{}`", shortened(name))).collect();
            format!("the columns {} on line {line}", names.join(", "))
        };
        let mut columns = Vec::new();
        for (index, name) in header.iter().enumerate() {
            if let Some((base, unit)) = angle_column(name) {
                if columns.iter().any(|&(other, _, _)| other == base) {
                    return Err(self.wrong(format!("one column `{base}`"), listed()));
                }
                columns.push((base, index, unit.unwrap_or(Unit::Degrees)));
            }
        }
        let place = |name: &str| columns.iter().find(|(base, _, _)| *base == name);
        let have = |names: &[&str]| names.iter().filter(|name| place(name).is_some()).count();
        let names = if have(LIGHT_VIEWER) == LIGHT_VIEWER.len() {
            LIGHT_VIEWER
        } else if have(HALF_DIFF) == HALF_DIFF.len() {
            HALF_DIFF
        } else if have(LIGHT_VIEWER) + have(HALF_DIFF) == 0 {
            return Err(self.wrong(
                "a header with the columns theta_i, phi_i, theta_o, phi_o or theta_h, theta_d, phi_d",
                listed(),
            ));
        } else {
            let nearest = if have(LIGHT_VIEWER) >= have(HALF_DIFF) { LIGHT_VIEWER } else { HALF_DIFF };
            let missing: Vec<_> =
                nearest.iter().filter(|name| place(name).is_none()).map(|name| format!("`{name}`")).collect();
            return Err(self.wrong(format!("also the column {}", missing.join(", ")), listed()));
        };
        let chosen: Vec<_> = names.iter().filter_map(|name| place(name)).collect();
        let unit = chosen[0].2;
        if let Some(other) = chosen.iter().find(|(_, _, found)| *found != unit) {
            return Err(self.wrong(
                "one unit for all angles",
                format!(
                    "`{}` in {} and `{}` in {}",
                    &header[chosen[0].1],
                    unit.name(),
                    &header[other.1],
                    other.2.name()
                ),
            ));
        }
        let value = |name: &str| header.iter().position(|column| column.eq_ignore_ascii_case(name));
        let rgb: Vec<_> = ["r", "g", "b"].iter().filter_map(|name| value(name)).collect();
        let values = if !with_values {
            Vec::new()
        } else if rgb.len() == 3 {
            rgb
        } else if let Some(grey) = value("f").or_else(|| value("value")) {
            vec![grey]
        } else {
            return Err(self.wrong("value columns `r`, `g`, `b`, or `f`", listed()));
        };
        Ok(Layout { names, angles: chosen.iter().map(|column| column.1).collect(), unit, values })
    }

    /// Parses one number of a record.
    fn number(&self, record: &csv::StringRecord, header: &csv::StringRecord, index: usize) -> Result<f64> {
        let field = record.get(index);
        match field.and_then(|field| field.parse::<f64>().ok()).filter(|value| value.is_finite()) {
            Some(value) => Ok(value),
            None => Err(self.wrong(
                format!("a finite number {}", place(record, header, index)),
                match field {
                    None => format!("only {} columns", record.len()),
                    Some("") => "nothing".to_owned(),
                    Some(text) => format!("\"{}\"", shortened(text)),
                },
            )),
        }
    }

    /// Parses the directions of a record.
    fn directions(
        &self,
        record: &csv::StringRecord,
        header: &csv::StringRecord,
        layout: &Layout,
    ) -> Result<(Vector3<f64>, Vector3<f64>, HalfDiff)> {
        let mut angles = [0.0; 4];
        for ((angle, &index), name) in angles.iter_mut().zip(&layout.angles).zip(layout.names) {
            let found = self.number(record, header, index)?;
            *angle = layout.unit.to_radians(found);
            let (fits, degrees) = if name.starts_with("phi") {
                (angle.abs() <= 2.0 * std::f64::consts::PI + 1e-9, "from -360 to 360")
            } else if layout.names == HALF_DIFF {
                ((0.0..=FRAC_PI_2).contains(angle), "from 0 to 90")
            } else {
                ((0.0..FRAC_PI_2).contains(angle), "from 0 to under 90 (above the horizon)")
            };
            if !fits {
                return Err(self.wrong(
                    format!("an angle of {degrees} degrees {}", place(record, header, index)),
                    format!("{found} {}", layout.unit.name()),
                ));
            }
        }
        if layout.names == HALF_DIFF {
            let [theta_h, theta_d, phi_d, _] = angles;
            let half_diff = HalfDiff { theta_h, theta_d, phi_d: fold_phi_d(phi_d) };
            if !half_diff.is_above_horizon() {
                return Err(self.wrong(
                    format!("both directions above the horizon on line {}", line_of(record)),
                    "one at or below it",
                ));
            }
            let (wi, wo) = half_diff.to_directions();
            Ok((wi, wo, half_diff))
        } else {
            let [theta_i, phi_i, theta_o, phi_o] = angles;
            let (wi, wo) = (direction(theta_i, phi_i), direction(theta_o, phi_o));
            Ok((wi, wo, HalfDiff::from_directions(&wi, &wo)))
        }
    }

    fn value(&self, record: &csv::StringRecord, header: &csv::StringRecord, layout: &Layout) -> Result<Rgb> {
        let mut value = [0.0; 3];
        for (channel, &index) in value.iter_mut().zip(layout.values.iter().cycle()) {
            let found = self.number(record, header, index)?;
            if found < 0.0 {
                return Err(self.wrong(
                    format!("a value of at least 0 {}", place(record, header, index)),
                    found.to_string(),
                ));
            }
            if found > f64::from(f32::MAX) {
                return Err(self.wrong(
                    format!("a value within the range of f32 {}", place(record, header, index)),
                    format!("{found:e}"),
                ));
            }
            *channel = found;
        }
        Ok(value)
    }

    /// Calls `row` with every record of the file.
    fn read(
        &self,
        bytes: &[u8],
        with_values: bool,
        mut row: impl FnMut(&csv::StringRecord, &csv::StringRecord, &Layout) -> Result<()>,
    ) -> Result<()> {
        let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
        if bytes.is_empty() {
            return Err(self.wrong("a header line", "an empty file"));
        }
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .flexible(true)
            .has_headers(false)
            .from_reader(bytes);
        let mut header: Option<(csv::StringRecord, Layout)> = None;
        let mut record = csv::StringRecord::new();
        let mut rows = 0;
        while reader
            .read_record(&mut record)
            .map_err(|error| self.wrong("UTF-8 text in comma-separated columns", error.to_string()))?
        {
            // This is a blank line, or a comment at the very end.
            if record.len() == 1 && record[0].is_empty() {
                continue;
            }
            match &header {
                None => {
                    let layout = self.layout(&record, line_of(&record), with_values)?;
                    header = Some((record.clone(), layout));
                }
                Some((names, layout)) => {
                    row(&record, names, layout)?;
                    rows += 1;
                }
            }
        }
        if header.is_none() {
            return Err(self.wrong("a header line", "nothing but comments"));
        }
        if rows == 0 {
            return Err(self.wrong("at least one row", "a header only"));
        }
        Ok(())
    }
}

impl Unit {
    fn name(self) -> &'static str {
        match self {
            Self::Degrees => "degrees",
            Self::Radians => "radians",
        }
    }

    fn to_radians(self, angle: f64) -> f64 {
        match self {
            Self::Degrees => angle.to_radians(),
            Self::Radians => angle,
        }
    }
}

fn line_of(record: &csv::StringRecord) -> u64 {
    record.position().map_or(0, csv::Position::line)
}

fn place(record: &csv::StringRecord, header: &csv::StringRecord, index: usize) -> String {
    format!("in column `{}` on line {}", shortened(header.get(index).unwrap_or("")), line_of(record))
}

/// At most 40 characters of a field, for error messages.
fn shortened(text: &str) -> String {
    let mut start: String = text.chars().filter(|c| !c.is_control()).take(40).collect();
    if start.len() < text.len() {
        start.push_str("...");
    }
    start
}

/// Reads measured samples. Comment lines before the header become their description.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read; [`Error::Format`], which names line and column, when a column
/// is missing, a number is not finite, a value is negative or too large for f32, an angle is out of range or
/// a direction is below the horizon, and when the file has no rows.
pub fn read_samples_csv(path: impl AsRef<Path>) -> Result<SampleSet> {
    let path = path.as_ref();
    parse_samples(&read_bytes(path, "samples CSV", LIMIT_BYTES)?, path)
}

fn parse_samples(bytes: &[u8], path: &Path) -> Result<SampleSet> {
    let source = Source { path };
    let mut samples = Vec::new();
    source.read(bytes, true, |record, header, layout| {
        let (wi, wo, _) = source.directions(record, header, layout)?;
        samples.push(Sample { wi, wo, value: source.value(record, header, layout)? });
        Ok(())
    })?;
    let text = String::from_utf8_lossy(bytes);
    let comments: Vec<_> = text
        .trim_start_matches('\u{FEFF}')
        .lines()
        .map_while(|line| line.strip_prefix('#'))
        .map(str::trim)
        .collect();
    Ok(SampleSet { description: comments.join("\n"), ..samples.into_iter().collect() })
}

/// Reads directions; columns of values are ignored.
///
/// # Errors
/// The same as for [`read_samples_csv`].
pub fn read_directions_csv(path: impl AsRef<Path>) -> Result<Directions> {
    let path = path.as_ref();
    parse_directions(&read_bytes(path, "samples CSV", LIMIT_BYTES)?, path)
}

fn parse_directions(bytes: &[u8], path: &Path) -> Result<Directions> {
    let source = Source { path };
    let mut directions = Directions::default();
    source.read(bytes, false, |record, header, layout| {
        let (_, _, angles) = source.directions(record, header, layout)?;
        let texts = |of: &csv::StringRecord| -> Vec<String> {
            layout.angles.iter().map(|&index| of.get(index).unwrap_or("").to_owned()).collect()
        };
        if directions.columns.is_empty() {
            directions.columns = texts(header);
        }
        directions.rows.push(texts(record));
        directions.angles.push(angles);
        Ok(())
    })?;
    Ok(directions)
}

/// Writes samples with the columns `theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg, r, g, b`. When they are
/// read back, values are equal to the bit and directions to rounding.
///
/// # Errors
/// [`Error::Io`] when the file cannot be written; no part of it is left then.
pub fn write_samples_csv(path: impl AsRef<Path>, samples: &SampleSet) -> Result<()> {
    let mut file = AtomicFile::create(path.as_ref())?;
    write_samples_csv_to(&mut file, samples).map_err(|source| Error::write(path.as_ref(), source))?;
    file.commit()
}

/// Like [`write_samples_csv`], but writes to any writer.
///
/// # Errors
/// Any error of `to`.
pub fn write_samples_csv_to(mut to: impl Write, samples: &SampleSet) -> io::Result<()> {
    for line in samples.description.lines() {
        writeln!(to, "# {line}")?;
    }
    writeln!(to, "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b")?;
    for Sample { wi, wo, value } in samples.iter() {
        for w in [wi, wo] {
            let theta = w.x.hypot(w.y).atan2(w.z).to_degrees();
            write!(to, "{theta},{},", w.y.atan2(w.x).to_degrees())?;
        }
        writeln!(to, "{},{},{}", value[0], value[1], value[2])?;
    }
    to.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::mutate::{Random, mutations};

    fn parse(text: &str) -> Result<SampleSet> {
        parse_samples(text.as_bytes(), Path::new("x.csv"))
    }

    fn error(text: &str) -> String {
        let message = parse(text).unwrap_err().to_string();
        message.strip_prefix("samples CSV file \"x.csv\": expected ").unwrap().to_owned()
    }

    #[test]
    fn units_orders_comments_and_marks_are_understood() {
        let expected = direction(30f64.to_radians(), 45f64.to_radians());
        let texts = [
            "theta_i,phi_i,theta_o,phi_o,r,g,b\n30,45,10,0,1,2,3\n",
            "\u{FEFF}# a note\n\n b , g , r , phi_o , theta_o , phi_i , Theta_I , note\n3,2,1,0,10,45,30,x\n# end",
            "theta_i_deg,phi_i [deg],theta_o (degrees),phi_o_deg,r,g,b\r\n30,45,10,0,1,2,3\r\n",
            "theta_i_rad,phi_i [rad],theta_o_rad,phi_o_rad,R,G,B\n\
             0.5235987755982988,0.7853981633974483,0.17453292519943295,0,1,2,3",
            "theta_h,theta_i,phi_i,theta_o,phi_o,theta_d,phi_d,r,g,b\n9,30,45,10,0,9,9,1,2,3",
        ];
        for text in texts {
            let found = parse(text).unwrap();
            assert_eq!(found.len(), 1, "{text}");
            let sample = found.iter().next().unwrap();
            assert!((sample.wi - expected).norm() < 1e-15, "{text}");
            assert!((sample.wo - direction(10f64.to_radians(), 0.0)).norm() < 1e-15, "{text}");
            assert_eq!(sample.value, [1.0, 2.0, 3.0], "{text}");
        }
        assert_eq!(parse(texts[1]).unwrap().description, "a note");
    }

    #[test]
    fn half_difference_and_grey_columns_are_understood() {
        let found = parse("f,theta_h,theta_d,phi_d\n0.25,20,30,200\n").unwrap();
        assert_eq!(found.values[0], [0.25; 3]);
        let angles = found.angles[0];
        assert!((angles.theta_h.to_degrees() - 20.0).abs() < 1e-12);
        assert!((angles.theta_d.to_degrees() - 30.0).abs() < 1e-12);
        assert!((angles.phi_d.to_degrees() - 20.0).abs() < 1e-12);
        assert!(parse("value,theta_h_rad,theta_d_rad,phi_d_rad\n1,1,0.1,1\n").is_ok());
    }

    #[test]
    fn mistakes_are_named_with_line_and_column() {
        let header = "theta_i,phi_i,theta_o,phi_o,r,g,b\n";
        let row = |text: &str| error(&format!("# note\n{header}1,2,3,4,5,6,7\n{text}\n"));
        assert_eq!(row("1,2,3,4,5,x,7"), "a finite number in column `g` on line 4, found \"x\"");
        assert_eq!(row("1,2,3,4,5,NaN,7"), "a finite number in column `g` on line 4, found \"NaN\"");
        assert_eq!(row("1,,3,4,5,6,7"), "a finite number in column `phi_i` on line 4, found nothing");
        assert_eq!(row("1,2,3"), "a finite number in column `phi_o` on line 4, found only 3 columns");
        assert_eq!(
            row("1,2,3,4,5,6,7e38"),
            "a value within the range of f32 in column `b` on line 4, found 7e38"
        );
        assert_eq!(row("1,2,3,4,-5,6,7"), "a value of at least 0 in column `r` on line 4, found -5");
        assert_eq!(
            row("1,2,95,4,5,6,7"),
            "an angle of from 0 to under 90 (above the horizon) degrees in column `theta_o` on line 4, \
             found 95 degrees"
        );
        assert!(row("1,2,90,4,5,6,7").ends_with("found 90 degrees"));
        assert!(row("1,400,3,4,5,6,7").contains("column `phi_i` on line 4, found 400 degrees"));
        assert_eq!(
            error("theta_h,theta_d,phi_d,f\n60,60,0,1\n"),
            "both directions above the horizon on line 2, found one at or below it"
        );
        assert_eq!(
            error("theta_i,phi_i,theta_o,r,g,b\n1,2,3,4,5,6\n"),
            "also the column `phi_o`, found the columns `theta_i`, `phi_i`, `theta_o`, `r`, `g`, `b` on line 1"
        );
        assert!(
            error("theta_h,theta_d,phi_d,r,g\n").starts_with("value columns `r`, `g`, `b`, or `f`, found")
        );
        assert!(error("theta_h,theta_h,theta_d,phi_d,f\n").starts_with("one column `theta_h`, found"));
        assert_eq!(
            error("theta_h,theta_d_rad,phi_d,f\n1,1,1,1\n"),
            "one unit for all angles, found `theta_h` in degrees and `theta_d_rad` in radians"
        );
        assert!(error("1,2,3,4,5,6,7\n").starts_with("a header with the columns theta_i"));
        assert_eq!(error(""), "a header line, found an empty file");
        assert_eq!(error("# a\n"), "a header line, found nothing but comments");
        assert_eq!(error(header), "at least one row, found a header only");
    }

    #[test]
    fn samples_round_trip() {
        let mut random = Random::new(2);
        let mut unit = || random.next() as f64 / u64::MAX as f64;
        let samples: SampleSet = (0..500)
            .map(|_| Sample {
                wi: direction(1.57 * unit(), 7.0 * unit()),
                wo: direction(1.57 * unit(), 7.0 * unit()),
                value: [unit() * 1e3, unit() * 1e-9, 0.0],
            })
            .collect();
        let written = SampleSet { description: "two\nlines".to_owned(), ..samples };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.csv");
        write_samples_csv(&path, &written).unwrap();
        let read = read_samples_csv(&path).unwrap();
        assert_eq!(read.description, written.description);
        assert_eq!(read.len(), written.len());
        for (a, b) in read.iter().zip(written.iter()) {
            assert_eq!(a.value, b.value);
            assert!((a.wi - b.wi).norm() < 1e-14 && (a.wo - b.wo).norm() < 1e-14);
        }
        assert_eq!(crate::formats::recognise(&path).unwrap(), &FORMAT);
    }

    #[test]
    fn directions_keep_their_text() {
        let text = "name,phi_d_deg,theta_d_deg,theta_h_deg\na,90,1e1,20.0\nb,0,0,0\n";
        let found = parse_directions(text.as_bytes(), Path::new("x.csv")).unwrap();
        assert_eq!(found.columns, ["theta_h_deg", "theta_d_deg", "phi_d_deg"]);
        assert_eq!(found.rows, [["20.0", "1e1", "90"], ["0", "0", "0"]]);
        assert_eq!(found.angles[1], HalfDiff::default());
        assert!((found.angles[0].theta_d.to_degrees() - 10.0).abs() < 1e-12);
        assert!(parse(text).is_err(), "no values");
    }

    #[test]
    fn damaged_files_never_panic() {
        let text = "# note\n\"theta_i\",phi_i,theta_o,phi_o,r,g,b\n30,45,10,0,1,2,3\n1,2,3,4,5,6,7\n";
        let mut survivors = 0;
        for bytes in mutations(text.as_bytes(), text.len(), 9, 20_000) {
            if let Ok(samples) = parse_samples(&bytes, Path::new("x")) {
                survivors += 1;
                assert!(samples.iter().all(|s| s.wi.z > 0.0 && s.value.iter().all(|v| *v >= 0.0)));
            }
            let _ = parse_directions(&bytes, Path::new("x"));
        }
        assert!(survivors > 100, "{survivors}");
    }
}
