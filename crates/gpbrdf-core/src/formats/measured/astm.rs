//! Measurements with a header as in ASTM E1392: keys with their values, one of which, `VARS`, names the columns.
//!
//! Angles that are the same in all rows may be keys, for example `THETA_I 45`. The rest is a table like any
//! other. Source: ASTM E1392-96(2002), and files of Cornell University in that format.

use crate::base::error::Result;
use crate::formats::format::{Format, Reader};
use crate::formats::measured::input::{Input, shortened};
use crate::formats::measured::options::Zenith;
use crate::formats::measured::text::columns::{Angle, Side, angle};
use crate::formats::measured::text::comment::comment;
use crate::formats::measured::text::name::Name;
use crate::formats::measured::text::samples::samples;
use crate::formats::measured::text::table::Table;
use crate::sample::SampleSet;

/// Samples with the header of ASTM E1392.
pub(crate) const FORMAT: Format = Format {
    name: "ASTM E1392 measurement",
    file: "ASTM E1392",
    recognises: |head| {
        head.text.as_deref().is_some_and(|text| text.lines().take(500).any(|line| variables(line).is_some()))
    },
    read: Reader::Samples(parse),
};

/// The name in messages.
const NAME: &str = "ASTM E1392";

/// The names of the columns, if a line holds them.
fn variables(line: &str) -> Option<&str> {
    let (key, names) = split(line)?;
    (key.eq_ignore_ascii_case("VARS") && !names.is_empty()).then_some(names)
}

/// A key and its value.
fn split(line: &str) -> Option<(&str, &str)> {
    let (key, value) = line.trim().split_once([' ', '\t', ',', '=', ':'])?;
    Some((key, value.trim_matches([' ', '\t', ',', '=', ':'])))
}

fn parse(input: Input<'_>) -> Result<SampleSet> {
    let input = Input { format: NAME, ..input };
    let text = input.text()?;
    let (mut header, mut points) = (None, None);
    let mut constants: Vec<(Angle, f64)> = Vec::new();
    let (mut rows, mut comments) = (Vec::new(), Vec::new());
    for (line, at) in text.lines().zip(1u64..) {
        let starts_with_number =
            line.trim_start().starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
        if line.trim().is_empty() {
        } else if let Some(text) = comment(line) {
            comments.push((at, text));
        } else if header.is_some() && starts_with_number || !rows.is_empty() {
            rows.push((at, line));
        } else if let Some(names) = variables(line) {
            header = Some((at, names));
        } else if let Some((key, value)) = split(line) {
            if key.eq_ignore_ascii_case("NUM_POINTS") {
                let count = value.parse::<usize>().ok();
                let wrong = || input.wrong(format!("a number of points on line {at}"), shortened(value));
                points = Some((count.ok_or_else(wrong)?, at));
            } else if let Some(name) = angle(&Name::new(key), input.options.zenith.unwrap_or(Zenith::Theta)) {
                constants.push((with_side(name), input.number(value, at)?));
            } else {
                comments.push((at, line.trim()));
            }
        }
    }
    let header = header.ok_or_else(|| input.wrong("a line VARS", "none"))?;
    if let Some((count, at)) = points.filter(|&(count, _)| count != rows.len()) {
        return Err(input.wrong(format!("{count} rows, as line {at} says"), rows.len().to_string()));
    }
    let table = Table::with_header(&input, header, rows, comments)?;
    samples(input, &table, &constants, true)
}

/// `s` is the scattered direction in this format.
fn with_side(angle: Angle) -> Angle {
    match angle {
        Angle::Zenith(Side::S) => Angle::Zenith(Side::Outgoing),
        Angle::Azimuth(Side::S) => Angle::Azimuth(Side::Outgoing),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::brdf::angles::direction;
    use crate::formats::measured::{AngleUnit, ReadOptions};
    use crate::formats::mutate::mutations;

    fn read(text: &[u8], options: &ReadOptions) -> Result<SampleSet, String> {
        parse(Input { format: NAME, path: Path::new("x"), bytes: text, options }).map_err(|e| e.to_string())
    }

    const SMALL: &str = "FORM 1\nSAMPLE red paint\nNUM_POINTS 2\nVARS theta_i,phi_i,theta_s,phi_s,R,G,B\n\
        0.5,0.0,0.25,3.141593,0.3,0.2,0.1\n0.5,0.0,0.5,3.141593,0.6,0.4,0.2\n";

    #[test]
    fn columns_are_those_of_the_header() {
        let found = read(SMALL.as_bytes(), &ReadOptions::default()).unwrap();
        assert_eq!((found.len(), found.values[0], found.lines[1]), (2, [0.3, 0.2, 0.1], 6));
        assert!((found.directions[1][1] - direction(0.5, std::f64::consts::PI)).norm() < 1e-6);
        assert_eq!(found.description, "FORM 1\nSAMPLE red paint");
        let spectral = SMALL.replace("R,G,B", "450nm,550nm,650nm");
        let found = read(spectral.as_bytes(), &ReadOptions::default()).unwrap();
        assert!(found.values[0][2] > found.values[0][0], "{:?}", found.values);
        let xyz = SMALL.replace("R,G,B", "X,Y,Z");
        assert!(read(xyz.as_bytes(), &ReadOptions::default()).unwrap().values[0][0] > 0.5);
    }

    #[test]
    fn angles_may_be_keys_and_their_unit_must_be_certain() {
        let text = "THETA_I 45\nPHI_I 0\nVARS theta_s,phi_s,BRDF\n10.5,180,0.5\n45.5,180,2\n";
        let found = read(text.as_bytes(), &ReadOptions::default()).unwrap();
        assert!((found.directions[0][0] - direction(45f64.to_radians(), 0.0)).norm() < 1e-12);
        let text = "VARS theta_i,phi_i,theta_s,phi_s,BRDF\n0.5,0,0.25,0.5,0.3\n";
        assert!(read(text.as_bytes(), &ReadOptions::default()).unwrap_err().contains("--angles"));
        let radians = ReadOptions { angles: Some(AngleUnit::Radians), ..ReadOptions::default() };
        assert!((read(text.as_bytes(), &radians).unwrap().directions[0][0].z - 0.5f64.cos()).abs() < 1e-15);
        let short = SMALL.replace("NUM_POINTS 2", "NUM_POINTS 3");
        let error = read(short.as_bytes(), &ReadOptions::default()).unwrap_err();
        assert!(error.ends_with("expected 3 rows, as line 3 says, found 2"), "{error}");
    }

    #[test]
    fn damaged_files_never_panic() {
        let mut survivors = 0;
        for bytes in mutations(SMALL.as_bytes(), SMALL.len(), 5, 10_000) {
            survivors += usize::from(read(&bytes, &ReadOptions::default()).is_ok());
        }
        assert!(survivors > 100, "{survivors}");
    }
}
