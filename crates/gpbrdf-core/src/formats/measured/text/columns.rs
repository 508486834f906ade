//! Which angle a column holds, by the names that people give it.

use crate::formats::measured::options::{AngleUnit, Zenith};
use crate::formats::measured::text::name::Name;

/// To which direction an angle belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Incident,
    Outgoing,
    /// `s` is the scattered direction beside an incident one, and that of the sun beside a view.
    S,
}

/// The angle that a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Angle {
    /// From the normal.
    Zenith(Side),
    /// About the normal.
    Azimuth(Side),
    /// The difference of the azimuths of the two directions: 0 where they are on the same side.
    Difference,
    ThetaH,
    ThetaD,
    PhiD,
}

/// A column of angles.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AngleColumn {
    pub(crate) index: usize,
    pub(crate) angle: Angle,
    /// The unit as it is written; empty if the name has none.
    pub(crate) unit: String,
}

const INCIDENT: [&str; 16] = [
    "i",
    "in",
    "inc",
    "incident",
    "incidence",
    "incoming",
    "ingoing",
    "input",
    "l",
    "light",
    "lamp",
    "source",
    "src",
    "sun",
    "solar",
    "illumination",
];
const OUTGOING: [&str; 32] = [
    "o",
    "out",
    "outgoing",
    "output",
    "r",
    "ref",
    "refl",
    "reflected",
    "reflection",
    "sc",
    "scat",
    "scatter",
    "scattered",
    "scattering",
    "v",
    "view",
    "viewing",
    "viewer",
    "e",
    "exit",
    "exiting",
    "emission",
    "emergent",
    "det",
    "detector",
    "sensor",
    "camera",
    "cam",
    "obs",
    "observer",
    "observation",
    "receiver",
];
const DIFFERENCES: [&str; 10] = [
    "dphi",
    "deltaphi",
    "deltaazimuth",
    "relativeazimuth",
    "relazimuth",
    "relaz",
    "azimuthdifference",
    "relativephi",
    "relphi",
    "phirel",
];

/// The angle of a column with this name. `theta` is the angle from the normal unless `zenith` says otherwise.
pub(crate) fn angle(name: &Name, zenith: Zenith) -> Option<Angle> {
    let word = name.word.replace("angleof", "").replace("angle", "");
    match word.as_str() {
        "thetah" | "thetahalf" => return Some(Angle::ThetaH),
        "thetad" => return Some(Angle::ThetaD),
        "phid" => return Some(Angle::PhiD),
        "raa" => return Some(Angle::Difference),
        "aoi" | "incidence" | "incident" | "sza" => return Some(Angle::Zenith(Side::Incident)),
        "saa" => return Some(Angle::Azimuth(Side::Incident)),
        "vza" => return Some(Angle::Zenith(Side::Outgoing)),
        "vaa" => return Some(Angle::Azimuth(Side::Outgoing)),
        word if DIFFERENCES.contains(&word) => return Some(Angle::Difference),
        _ => {}
    }
    let is_theta_zenith = zenith == Zenith::Theta;
    let kinds = [
        ("theta", is_theta_zenith),
        ("zenith", true),
        ("polar", true),
        ("phi", !is_theta_zenith),
        ("azimuthal", false),
        ("azimuth", false),
        ("azim", false),
        ("az", false),
    ];
    kinds.into_iter().find_map(|(kind, is_zenith)| {
        let side = side(word.strip_prefix(kind).or_else(|| word.strip_suffix(kind))?)?;
        Some(if is_zenith { Angle::Zenith(side) } else { Angle::Azimuth(side) })
    })
}

fn side(word: &str) -> Option<Side> {
    match word {
        "s" => Some(Side::S),
        _ if INCIDENT.contains(&word) => Some(Side::Incident),
        _ if OUTGOING.contains(&word) => Some(Side::Outgoing),
        _ => None,
    }
}

/// How many of these names are angles.
pub(crate) fn count_angles(names: &[String]) -> usize {
    names.iter().filter(|name| angle(&Name::new(name), Zenith::Theta).is_some()).count()
}

/// The unit of angles that a text names.
pub(crate) fn angle_unit(text: &str) -> Option<AngleUnit> {
    match text.trim().trim_matches(['[', ']', '(', ')', '.']).to_lowercase().as_str() {
        "deg" | "degree" | "degrees" | "°" | "º" => Some(AngleUnit::Degrees),
        "rad" | "radian" | "radians" => Some(AngleUnit::Radians),
        _ => None,
    }
}

/// The columns of angles in a header. `constants` are angles that have no column.
pub(crate) fn angle_columns(
    names: &[String],
    zenith: Zenith,
    constants: &[(Angle, f64)],
) -> Vec<AngleColumn> {
    let mut columns: Vec<AngleColumn> = names
        .iter()
        .enumerate()
        .filter_map(|(index, text)| {
            let name = Name::new(text);
            Some(AngleColumn { index, angle: angle(&name, zenith)?, unit: name.unit })
        })
        .collect();
    let has = |side| {
        let all = columns.iter().map(|column| column.angle).chain(constants.iter().map(|c| c.0));
        all.into_iter().any(|angle| matches!(angle, Angle::Zenith(s) | Angle::Azimuth(s) if s == side))
    };
    let meaning = match (has(Side::Incident), has(Side::Outgoing)) {
        (true, false) => Side::Outgoing,
        (false, true) => Side::Incident,
        _ => Side::S,
    };
    for column in &mut columns {
        match &mut column.angle {
            Angle::Zenith(side) | Angle::Azimuth(side) if *side == Side::S => *side = meaning,
            _ => {}
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Option<Angle> {
        angle(&Name::new(text), Zenith::Theta)
    }

    #[test]
    fn names_of_many_instruments_are_understood() {
        use Side::{Incident, Outgoing};
        for (text, expected) in [
            ("theta_i", Angle::Zenith(Incident)),
            ("ThetaIn", Angle::Zenith(Incident)),
            ("incident zenith angle", Angle::Zenith(Incident)),
            ("Angle of incidence", Angle::Zenith(Incident)),
            ("AOI [°]", Angle::Zenith(Incident)),
            ("incidence", Angle::Zenith(Incident)),
            ("Incidence angle", Angle::Zenith(Incident)),
            ("θ_i", Angle::Zenith(Incident)),
            ("sun_zenith", Angle::Zenith(Incident)),
            ("theta_r", Angle::Zenith(Outgoing)),
            ("theta_o_deg", Angle::Zenith(Outgoing)),
            ("theta_scatter", Angle::Zenith(Outgoing)),
            ("Detector polar angle", Angle::Zenith(Outgoing)),
            ("VZA", Angle::Zenith(Outgoing)),
            ("phi_in (rad)", Angle::Azimuth(Incident)),
            ("az_i", Angle::Azimuth(Incident)),
            ("φ_r", Angle::Azimuth(Outgoing)),
            ("view_azimuth", Angle::Azimuth(Outgoing)),
            ("delta_phi", Angle::Difference),
            ("Δφ", Angle::Difference),
            ("relative azimuth", Angle::Difference),
            ("theta_h", Angle::ThetaH),
            ("phi_d_rad", Angle::PhiD),
        ] {
            assert_eq!(of(text), Some(expected), "{text}");
        }
        for text in ["theta", "phi", "note", "f", "", "thetam", "elevation_i", "theta_x", "index", "(phi_i"] {
            assert_eq!(of(text), None, "{text}");
        }
        assert_eq!(angle(&Name::new("phi_i"), Zenith::Phi), Some(Angle::Zenith(Incident)));
        assert_eq!(angle(&Name::new("azimuth_i"), Zenith::Phi), Some(Angle::Azimuth(Incident)));
    }

    #[test]
    fn s_is_what_the_other_side_leaves() {
        let sides = |header: &str| -> Vec<Angle> {
            let names: Vec<String> = header.split(',').map(str::to_owned).collect();
            angle_columns(&names, Zenith::Theta, &[]).into_iter().map(|column| column.angle).collect()
        };
        assert_eq!(sides("theta_i,theta_s")[1], Angle::Zenith(Side::Outgoing));
        assert_eq!(sides("theta_s,theta_v")[0], Angle::Zenith(Side::Incident));
        assert_eq!(sides("theta_s,phi_s")[0], Angle::Zenith(Side::S));
    }
}
