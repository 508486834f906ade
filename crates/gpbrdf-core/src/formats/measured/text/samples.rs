//! Measured samples in a table.
//!
//! The header names the columns, in any order; it is the first line that names angles, or a comment before the
//! rows. Columns with other names are ignored:
//!
//! - directions: `theta_i, phi_i, theta_o, phi_o` (angle from the normal and azimuth of light and viewer, either
//!   signed), `theta_i, theta_o, delta_phi`, or `theta_h, theta_d, phi_d` (half-difference angles), also by
//!   other names that are usual; if a file has several, the former are used;
//! - values in sr^-1, without the cosine: `r, g, b` (linear sRGB), one grey column `f` or `value`, one column
//!   for each wavelength, or a column `wavelength` beside one value;
//! - standard deviations, if there are any: `sigma` or `sigma_r, sigma_g, sigma_b` in the unit of the values,
//!   or `sigma_rel`.
//!
//! The unit of an angle is part of its name, as in `theta_i_deg`, `theta_i [rad]`, or in a row below the names.
//! A bare `theta_i` is in degrees; where all angles could as well be radians, the file is refused. All angles of
//! a file must have the same unit.

use std::path::Path;

use crate::base::error::Result;
use crate::formats::format::{Format, Reader};
use crate::formats::measured::collector::{Collector, Row};
use crate::formats::measured::input::{Input, shortened};
use crate::formats::measured::options::{AngleUnit, ReadOptions, Zenith};
use crate::formats::measured::text::angles::{Angles, Place};
use crate::formats::measured::text::colours::Colours;
use crate::formats::measured::text::columns::Angle;
use crate::formats::measured::text::comment::{comment, said, zenith};
use crate::formats::measured::text::number::Marks;
use crate::formats::measured::text::table::{Header, Table, count_in, is_header_or_row};
use crate::formats::measured::text::values::{unused_uncertainty, value_columns};
use crate::formats::read::read_bytes;
use crate::sample::SampleSet;

/// Samples or directions of measurements.
pub(crate) const FORMAT: Format = Format {
    name: "samples CSV",
    file: "samples CSV",
    recognises: |head| head.text.as_deref().is_some_and(looks_like_samples),
    read: Reader::Samples(parse),
};

/// The name in messages.
pub(crate) const NAME: &str = "samples CSV";
/// The largest file that is read.
pub(crate) const LIMIT_BYTES: u64 = 1 << 30;

/// What users are told where `phi` is taken as the zenith angle.
const PHI_IS_ZENITH: &str = "`phi` is taken as the angle from the normal and `theta` as the azimuth";

/// Whether a text is a table of samples or directions: its first line that is no comment, or one soon after,
/// names an angle or is a row of a table that lacks its header.
fn looks_like_samples(text: &str) -> bool {
    let content = text.lines().filter(|line| comment(line).is_none() && !line.trim().is_empty());
    let mut content = content.take(50).peekable();
    if content
        .peek()
        .is_some_and(|line| line.split_whitespace().count() == 1 && line.trim().parse::<f64>().is_ok())
    {
        // This is a Cornell file, which starts with a number of wavelengths.
        return false;
    }
    content.next().is_some_and(is_header_or_row) || content.any(|line| count_in(line) >= 2)
}

/// Reads measured samples. Comment lines before the header become their description.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) when the file cannot be read; [`Error::Format`](crate::Error::Format), which
/// names line and column, when a column is missing, a number is not finite, a value is too negative for noise or
/// too large for f32, an angle is out of range or a direction is below the horizon, when the meaning of a column
/// is not certain, and when the file has no rows.
pub fn read_samples_csv(path: impl AsRef<Path>) -> Result<SampleSet> {
    let path = path.as_ref();
    let bytes = read_bytes(path, NAME, LIMIT_BYTES)?;
    parse(Input { format: NAME, path, bytes: &bytes, options: &ReadOptions::default() })
}

fn parse(input: Input<'_>) -> Result<SampleSet> {
    let input = Input { format: NAME, ..input };
    let text = input.text()?;
    let table = Table::new(&input, &text)?;
    samples(input, &table, &[], false)
}

/// The name of the angle from the normal: by the options, else by the comments, else `theta`. Also what to tell
/// the user.
pub(crate) fn zenith_of(input: &Input<'_>, table: &Table<'_>) -> Result<(Zenith, Option<String>)> {
    if let Some(zenith) = input.options.zenith {
        return Ok((zenith, None));
    }
    match zenith(table.comments.iter().copied()) {
        Ok(None | Some((Zenith::Theta, _))) => Ok((Zenith::Theta, None)),
        Ok(Some((Zenith::Phi, line))) => {
            let said = format!("{PHI_IS_ZENITH}, as line {line} says");
            Ok((Zenith::Phi, Some(said)))
        }
        Err([first, second]) => Err(input.wrong(
            "comments that agree about which angle is the zenith angle, or the option --zenith",
            format!("lines {first} and {second}, which do not"),
        )),
    }
}

/// The samples of a table. `constants` are angles that are the same in all rows.
pub(crate) fn samples(
    input: Input<'_>,
    table: &Table<'_>,
    constants: &[(Angle, f64)],
    allow_xyz: bool,
) -> Result<SampleSet> {
    let header = &table.header;
    let (zenith, notice) = zenith_of(&input, table)?;
    let mut angles = Angles::find(&input, header, zenith, constants)?;
    let of_angles: Vec<usize> = angles
        .places
        .iter()
        .filter_map(|place| if let Place::Column(index) = place { Some(*index) } else { None })
        .collect();
    let columns = value_columns(&input, header, &of_angles, allow_xyz)?;
    let indices = columns.indices();
    let mut collector = Collector::new(input, columns.kind);
    let unused = unused_uncertainty(header, &columns);
    notice.into_iter().chain(unused).for_each(|notice| collector.notice(notice));

    let mut marks = Marks::default();
    let mut lines = Vec::new();
    let mut row_angles: Vec<[f64; 4]> = Vec::new();
    let mut numbers: Vec<f64> = Vec::new();
    table.each(&input, |line, fields| {
        let found = row_of_angles(&input, header, &angles, &mut marks, fields, line)?;
        angles.observe(found);
        for &index in &indices {
            let number = number(&input, header, &mut marks, fields, index, line, false)?;
            if number.abs() > f64::from(f32::MAX) {
                return Err(input.wrong(
                    format!(
                        "a value within the range of f32 in column `{}` on line {line}",
                        header.name(index)
                    ),
                    format!("{number:e}"),
                ));
            }
            numbers.push(number);
        }
        row_angles.push(found);
        lines.push(line);
        Ok(())
    })?;
    if let Some((expected, found)) = marks.doubt() {
        return Err(input.wrong(expected, found));
    }
    if zenith == Zenith::Theta
        && input.options.zenith.is_none()
        && constants.is_empty()
        && angles.settle_zenith(&input, header, &mut row_angles)?
    {
        collector.notice(format!(
            "{PHI_IS_ZENITH}, as no `theta` beyond 180 degrees can be measured from the normal"
        ));
    }
    let unit = angles.unit(&input)?;
    if unit == AngleUnit::Radians && !angles.unit_is_said() {
        collector.notice("angles are taken as radians, as azimuths are multiples of pi/2".to_owned());
    }
    let mut colours = Colours::new(&input, &columns, header, &numbers, &mut collector)?;
    for (i, &line) in lines.iter().enumerate() {
        let directed = angles.directions(&input, header, unit, row_angles[i], line)?;
        let of_row = &numbers[i * indices.len()..(i + 1) * indices.len()];
        if let Some((value, raw, sigma)) = colours.add(&input, of_row, row_angles[i], line)? {
            let row = Row { line, wi: directed.wi, wo: directed.wo, value, sigma };
            collector.push(row, &raw)?;
        }
    }
    colours.check_complete(&input)?;
    // What the comments say about the names is not true of the samples' own angles.
    let kept = |text: &&str| zenith == Zenith::Theta || said(text).is_none();
    let description: Vec<&str> = table.comments.iter().map(|(_, text)| *text).filter(kept).collect();
    collector.finish(description.join("\n").trim().to_owned())
}

/// The angles of a row, in the order of [`Angles::places`].
pub(crate) fn row_of_angles(
    input: &Input<'_>,
    header: &Header,
    angles: &Angles,
    marks: &mut Marks,
    fields: &[String],
    line: u64,
) -> Result<[f64; 4]> {
    let mut found = [0.0; 4];
    for (angle, place) in found.iter_mut().zip(&angles.places) {
        *angle = match *place {
            Place::Column(index) => number(input, header, marks, fields, index, line, true)?,
            Place::Constant(value) => value,
        };
    }
    Ok(found)
}

/// Parses one number of a row. `bounded` says that it cannot be a thousand or more.
fn number(
    input: &Input<'_>,
    header: &Header,
    marks: &mut Marks,
    fields: &[String],
    index: usize,
    line: u64,
    bounded: bool,
) -> Result<f64> {
    let field = fields.get(index).map(String::as_str);
    field.and_then(|field| marks.parse(field, line, bounded)).ok_or_else(|| {
        input.wrong(
            format!("a finite number in column `{}` on line {line}", header.name(index)),
            match field {
                None => format!("only {} columns", fields.len()),
                Some("") => "nothing".to_owned(),
                Some(text) => format!("\"{}\"", shortened(text)),
            },
        )
    })
}

#[cfg(test)]
mod tests;
