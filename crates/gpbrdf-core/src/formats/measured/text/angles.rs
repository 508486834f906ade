//! From the angles of a row to two directions.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;

use crate::base::error::Result;
use crate::brdf::angles::{HalfDiff, direction, fold_phi_d};
use crate::formats::measured::input::{Input, shortened};
use crate::formats::measured::options::{AngleUnit, Zenith};
use crate::formats::measured::text::columns::{Angle, AngleColumn, Side, angle_columns, angle_unit};
use crate::formats::measured::text::table::Header;
use crate::formats::measured::unit::{Evidence, ROUNDING};

/// Which angles give the directions, in the order in which they are used.
const LIGHT_VIEWER: [Angle; 4] = [
    Angle::Zenith(Side::Incident),
    Angle::Azimuth(Side::Incident),
    Angle::Zenith(Side::Outgoing),
    Angle::Azimuth(Side::Outgoing),
];
const DIFFERENCE: [Angle; 3] =
    [Angle::Zenith(Side::Incident), Angle::Zenith(Side::Outgoing), Angle::Difference];
const HALF_DIFF: [Angle; 3] = [Angle::ThetaH, Angle::ThetaD, Angle::PhiD];

/// The names of [`LIGHT_VIEWER`] and [`HALF_DIFF`] in messages.
const LIGHT_VIEWER_NAMES: [&str; 4] = ["theta_i", "phi_i", "theta_o", "phi_o"];
const HALF_DIFF_NAMES: [&str; 3] = ["theta_h", "theta_d", "phi_d"];

/// Where one of the angles is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    /// In a column.
    Column(usize),
    /// The same in all rows.
    Constant(f64),
}

/// The angles that give the directions of a table.
#[derive(Clone, Debug)]
pub(crate) struct Angles {
    angles: &'static [Angle],
    pub(crate) places: Vec<Place>,
    /// The unit, where names, a row of units or the options say it.
    unit: Option<AngleUnit>,
    pub(crate) evidence: Evidence,
}

impl Angles {
    /// Finds the angles in a header. `constants` are angles that are the same in all rows.
    pub(crate) fn find(
        input: &Input<'_>,
        header: &Header,
        zenith: Zenith,
        constants: &[(Angle, f64)],
    ) -> Result<Self> {
        let columns = angle_columns(&header.names, zenith, constants);
        for (k, column) in columns.iter().enumerate() {
            if columns[..k].iter().any(|other| other.angle == column.angle) {
                return Err(input.wrong(format!("one column `{}`", name(column.angle)), header.listed()));
            }
        }
        if columns.iter().any(|c| matches!(c.angle, Angle::Zenith(Side::S) | Angle::Azimuth(Side::S))) {
            let expected = "columns whose names say which direction is incident, as in `theta_i`";
            return Err(input.wrong(expected, header.listed()));
        }
        if let Some(name) = header.names.iter().find(|name| name.to_lowercase().contains("elevation")) {
            return Err(input.wrong(
                "angles from the normal, called `theta` or `zenith`",
                format!("the column `{}`, which may be measured from the surface", shortened(name)),
            ));
        }
        let place = |angle: Angle| {
            let column = columns.iter().find(|column| column.angle == angle);
            let constant = constants.iter().find(|constant| constant.0 == angle);
            column.map(|c| Place::Column(c.index)).or_else(|| constant.map(|c| Place::Constant(c.1)))
        };
        let have = |angles: &[Angle]| angles.iter().filter(|&&angle| place(angle).is_some()).count();
        let angles: &'static [Angle] = if have(&LIGHT_VIEWER) == 4 {
            &LIGHT_VIEWER
        } else if have(&DIFFERENCE) == 3 {
            &DIFFERENCE
        } else if have(&HALF_DIFF) == 3 {
            &HALF_DIFF
        } else {
            return Err(missing(input, header, &columns, have(&LIGHT_VIEWER), have(&HALF_DIFF)));
        };
        let places: Vec<Place> = angles.iter().filter_map(|&angle| place(angle)).collect();
        let used: Vec<&AngleColumn> =
            columns.iter().filter(|column| angles.contains(&column.angle)).collect();
        let unit = unit(input, header, &used)?;
        Ok(Self { angles, places, unit, evidence: Evidence::default() })
    }

    /// Takes in the angles of a row, in the order of [`Angles::places`], as evidence of their unit.
    pub(crate) fn observe(&mut self, row: [f64; 4]) {
        if self.unit.is_some() {
            return;
        }
        for (&angle, value) in self.angles.iter().zip(row) {
            if is_azimuth(angle) { self.evidence.azimuth(value) } else { self.evidence.zenith(value) }
        }
    }

    /// Whether names, a row of units or the options say the unit.
    pub(crate) fn unit_is_said(&self) -> bool {
        self.unit.is_some()
    }

    /// The unit of all angles.
    pub(crate) fn unit(&self, input: &Input<'_>) -> Result<AngleUnit> {
        self.unit.map_or_else(|| self.evidence.unit(input, true), Ok)
    }

    /// The directions of a row, with its angles in the order of [`Angles::places`].
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format) for an angle out of its range.
    pub(crate) fn directions(
        &self,
        input: &Input<'_>,
        header: &Header,
        unit: AngleUnit,
        row: [f64; 4],
        line: u64,
    ) -> Result<Directed> {
        let mut angles = [0.0; 4];
        for (k, &angle) in self.angles.iter().enumerate() {
            angles[k] = unit.to_radians(row[k]);
            let (fits, degrees) = if is_azimuth(angle) {
                (angles[k].abs() <= 2.0 * PI + ROUNDING, "from -360 to 360 degrees")
            } else if self.angles == HALF_DIFF {
                ((0.0..=FRAC_PI_2).contains(&angles[k]), "from 0 to 90 degrees")
            } else {
                (angles[k].abs() <= FRAC_PI_2 + 1e-5, "from -90 to 90 degrees (above the horizon)")
            };
            if !fits {
                let place = match self.places[k] {
                    Place::Column(index) => format!("in column `{}`", header.name(index)),
                    Place::Constant(_) => format!("for {}", name(angle)),
                };
                return Err(input.wrong(
                    format!("an angle {degrees} {place} on line {line}"),
                    format!("{} {}{}", row[k], unit.name(), self.hint(header, k)),
                ));
            }
        }
        if self.angles == HALF_DIFF {
            let [theta_h, theta_d, phi_d, _] = angles;
            let half_diff = HalfDiff { theta_h, theta_d, phi_d: fold_phi_d(phi_d) };
            let (wi, wo) = half_diff.to_directions();
            return Ok(Directed { wi, wo, half_diff });
        }
        let [theta_i, phi_i, theta_o, phi_o] =
            if self.angles == DIFFERENCE { [angles[0], 0.0, angles[1], angles[2]] } else { angles };
        let (wi, wo) = (direction(theta_i, phi_i), direction(theta_o, phi_o));
        Ok(Directed { wi, wo, half_diff: HalfDiff::from_directions(&wi, &wo) })
    }

    /// Takes the `phi` of all rows as the angles from the normal if nothing else is possible: a `theta` of more
    /// than half a turn is no angle from the normal in transmission either, and each `phi` is one.
    ///
    /// # Errors
    /// Those of [`Angles::find`].
    pub(crate) fn settle_zenith(
        &mut self,
        input: &Input<'_>,
        header: &Header,
        rows: &mut [[f64; 4]],
    ) -> Result<bool> {
        if self.angles != LIGHT_VIEWER {
            return Ok(false);
        }
        let unit = self.unit(input)?;
        let most = |columns: [usize; 2]| {
            let all = rows.iter().flat_map(|row| columns.map(|k| unit.to_radians(row[k]).abs()));
            all.fold(0.0, f64::max)
        };
        if most([0, 2]) <= PI + ROUNDING || most([1, 3]) > FRAC_PI_2 + ROUNDING {
            return Ok(false);
        }
        let mut swapped = Self::find(input, header, Zenith::Phi, &[])?;
        let columns = |angles: &Self, order: [usize; 4]| {
            order.map(
                |k| if let Some(Place::Column(index)) = angles.places.get(k) { Some(*index) } else { None },
            )
        };
        if columns(&swapped, [0, 1, 2, 3]) != columns(self, [1, 0, 3, 2]) {
            return Ok(false);
        }
        for row in rows {
            *row = [row[1], row[0], row[3], row[2]];
            swapped.observe(*row);
        }
        *self = swapped;
        Ok(true)
    }

    /// What may be wrong with an angle from the normal that is too large.
    fn hint(&self, header: &Header, k: usize) -> &'static str {
        let is_theta =
            |place| matches!(place, Place::Column(i) if header.names[i].to_lowercase().starts_with("theta"));
        if self.angles == HALF_DIFF || is_azimuth(self.angles[k]) || !is_theta(self.places[k]) {
            ""
        } else {
            "; if `phi` is the angle from the normal, say --zenith phi"
        }
    }
}

/// The directions of a row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Directed {
    pub(crate) wi: Vector3<f64>,
    pub(crate) wo: Vector3<f64>,
    pub(crate) half_diff: HalfDiff,
}

fn is_azimuth(angle: Angle) -> bool {
    matches!(angle, Angle::Azimuth(_) | Angle::Difference | Angle::PhiD)
}

/// The name of an angle in messages.
fn name(angle: Angle) -> &'static str {
    match angle {
        Angle::Zenith(Side::Incident) => "theta_i",
        Angle::Azimuth(Side::Incident) => "phi_i",
        Angle::Zenith(Side::Outgoing) => "theta_o",
        Angle::Azimuth(Side::Outgoing) => "phi_o",
        Angle::Zenith(Side::S) => "theta_s",
        Angle::Azimuth(Side::S) => "phi_s",
        Angle::Difference => "delta_phi",
        Angle::ThetaH => "theta_h",
        Angle::ThetaD => "theta_d",
        Angle::PhiD => "phi_d",
    }
}

/// The error for a header without the angles that give two directions.
fn missing(
    input: &Input<'_>,
    header: &Header,
    columns: &[AngleColumn],
    of_light: usize,
    of_half: usize,
) -> crate::Error {
    if of_light + of_half == 0 {
        return input.wrong(
            "a header with the columns theta_i, phi_i, theta_o, phi_o or theta_h, theta_d, phi_d",
            header.listed(),
        );
    }
    let missing: Vec<String> = if of_light >= of_half {
        let all = LIGHT_VIEWER.iter().zip(LIGHT_VIEWER_NAMES);
        all.filter(|(angle, _)| !columns.iter().any(|c| c.angle == **angle))
            .map(|(_, n)| format!("`{n}`"))
            .collect()
    } else {
        let all = HALF_DIFF.iter().zip(HALF_DIFF_NAMES);
        all.filter(|(angle, _)| !columns.iter().any(|c| c.angle == **angle))
            .map(|(_, n)| format!("`{n}`"))
            .collect()
    };
    input.wrong(format!("also the column {}", missing.join(", ")), header.listed())
}

/// The one unit of the columns, as far as they, the row of units or the options say it.
fn unit(input: &Input<'_>, header: &Header, used: &[&AngleColumn]) -> Result<Option<AngleUnit>> {
    let mut units = Vec::new();
    for column in used {
        let text = if column.unit.is_empty() { header.unit(column.index) } else { &column.unit };
        let unit = if text.is_empty() {
            None
        } else {
            let known = angle_unit(text).ok_or_else(|| {
                input.wrong(
                    format!("the unit deg or rad in column `{}`", header.name(column.index)),
                    format!("`{}`", shortened(text)),
                )
            })?;
            Some(known)
        };
        units.push((column.index, unit));
    }
    let said: Vec<_> = units.iter().filter_map(|&(index, unit)| Some((index, unit?))).collect();
    let Some(&(first, unit)) = said.first() else { return Ok(input.options.angles) };
    let bare = units.iter().find(|(_, unit)| unit.is_none()).map(|&(index, _)| (index, AngleUnit::Degrees));
    if let Some((other, found)) = said.iter().copied().chain(bare).find(|&(_, found)| found != unit) {
        let (index, other_unit) = if first < other { (first, unit) } else { (other, found) };
        let (last, last_unit) = if first < other { (other, found) } else { (first, unit) };
        return Err(input.wrong(
            "one unit for all angles",
            format!(
                "`{}` in {} and `{}` in {}",
                header.name(index),
                other_unit.name(),
                header.name(last),
                last_unit.name()
            ),
        ));
    }
    Ok(Some(input.options.angles.unwrap_or(unit)))
}
