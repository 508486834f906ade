//! Directions in a table, without values.

use std::path::Path;

use crate::base::error::Result;
use crate::brdf::angles::HalfDiff;
use crate::formats::measured::input::Input;
use crate::formats::measured::options::{ReadOptions, Zenith};
use crate::formats::measured::text::angles::{Angles, Place};
use crate::formats::measured::text::number::Marks;
use crate::formats::measured::text::samples::{LIMIT_BYTES, NAME, row_of_angles, zenith_of};
use crate::formats::measured::text::table::Table;
use crate::formats::read::read_bytes;

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

/// Reads directions; columns of values are ignored. The format is that of
/// [`read_samples_csv`](crate::formats::read_samples_csv).
///
/// # Errors
/// The same as for [`read_samples_csv`](crate::formats::read_samples_csv), and for a direction at the horizon.
pub fn read_directions_csv(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Directions> {
    let path = path.as_ref();
    let bytes = read_bytes(path, NAME, LIMIT_BYTES)?;
    parse(&Input { format: NAME, path, bytes: &bytes, options })
}

/// Reads directions from the content of a file that `name` stands for in messages.
///
/// # Errors
/// Those of [`read_directions_csv`], but for reading.
pub fn parse_directions_csv(
    bytes: &[u8],
    name: impl AsRef<Path>,
    options: &ReadOptions,
) -> Result<Directions> {
    parse(&Input { format: NAME, path: name.as_ref(), bytes, options })
}

fn parse(input: &Input<'_>) -> Result<Directions> {
    let text = input.text()?;
    let table = Table::new(input, &text)?;
    let header = &table.header;
    let (zenith, _) = zenith_of(input, &table)?;
    let mut angles = Angles::find(input, header, zenith, &[])?;
    let indices: Vec<usize> = angles
        .places
        .iter()
        .filter_map(|place| if let Place::Column(index) = place { Some(*index) } else { None })
        .collect();
    let texts = |of: &[String]| -> Vec<String> {
        indices.iter().map(|&index| of.get(index).cloned().unwrap_or_default()).collect()
    };
    let mut directions = Directions { columns: texts(&header.names), ..Directions::default() };
    let mut marks = Marks::default();
    let (mut lines, mut rows) = (Vec::new(), Vec::new());
    table.each(input, |line, fields| {
        let found = row_of_angles(input, header, &angles, &mut marks, fields, line)?;
        angles.observe(found);
        lines.push(line);
        rows.push(found);
        directions.rows.push(texts(fields));
        Ok(())
    })?;
    if let Some((expected, found)) = marks.doubt() {
        return Err(input.wrong(expected, found));
    }
    if zenith == Zenith::Theta && input.options.zenith.is_none() {
        angles.settle_zenith(input, header, &mut rows)?;
    }
    let unit = angles.unit(input)?;
    for (line, row) in lines.into_iter().zip(rows) {
        let directed = angles.directions(input, header, unit, row, line)?;
        if !(directed.wi.z.min(directed.wo.z) > 1e-12) {
            return Err(input
                .wrong(format!("both directions above the horizon on line {line}"), "one at or below it"));
        }
        directions.angles.push(directed.half_diff);
    }
    Ok(directions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_keep_their_text() {
        let parse = |text: &str| parse_directions_csv(text.as_bytes(), "x.csv", &ReadOptions::default());
        let text = "name,phi_d_deg,theta_d_deg,theta_h_deg\na,90,1e1,20.0\nb,0,0,0\n";
        let found = parse(text).unwrap();
        assert_eq!(found.columns, ["theta_h_deg", "theta_d_deg", "phi_d_deg"]);
        assert_eq!(found.rows, [["20.0", "1e1", "90"], ["0", "0", "0"]]);
        assert_eq!(found.angles[1], HalfDiff::default());
        assert!((found.angles[0].theta_d.to_degrees() - 10.0).abs() < 1e-12);
        let horizon = parse("theta_i,phi_i,theta_o,phi_o\n10,0,90,0\n").unwrap_err().to_string();
        assert!(horizon.ends_with("on line 2, found one at or below it"), "{horizon}");
        assert!(parse("theta_i;phi_i;theta_o;phi_o\n10,5;0;20;180\n").is_ok());
        assert!(parse("theta_i;phi_i;theta_o;phi_o\n10,5;0;20\n").is_err());
    }
}
