//! Measurements in the text format of ALTA, a library for the analysis of BRDFs.
//!
//! Lines that start with `#` and a key say what the columns are: `#PARAM_IN` names the parametrisation of the
//! directions, `#PARAM_OUT` what the values are (the BRDF by default), `#DIM` counts coordinates and values, and
//! `#VS` the numbers of confidence intervals behind them. Angles are in radians. Source: ALTA, core/params.h and
//! core/params.cpp (Inria and CNRS).

use std::f64::consts::PI;

use nalgebra::Vector3;

use crate::base::error::Result;
use crate::brdf::angles::{HalfDiff, direction};
use crate::formats::format::{Format, Reader};
use crate::formats::measured::collector::{Collector, Row, Sigma};
use crate::formats::measured::input::{Input, shortened};
use crate::formats::measured::options::ValueKind;
use crate::formats::measured::spectrum::srgb_from_xyz;
use crate::sample::SampleSet;

/// Samples as ALTA writes them.
pub(crate) const FORMAT: Format = Format {
    name: "ALTA measurement",
    file: "ALTA text",
    recognises: |head| {
        let is_key = |line: &str| key(line).is_some_and(|(key, _)| key == "PARAM_IN" || key == "DIM");
        let before_rows = |line: &&str| line.trim().is_empty() || line.starts_with('#');
        head.text.as_deref().is_some_and(|text| text.lines().take_while(before_rows).any(is_key))
    },
    read: Reader::Samples(parse),
};

/// The name in messages.
const NAME: &str = "ALTA";

/// The parametrisations that give two directions.
const PARAMETRISATIONS: [(&str, usize, Parametrisation); 8] = [
    ("ISOTROPIC_TL_TV_PROJ_DPHI", 3, projected),
    ("ISOTROPIC_TV_TL_DPHI", 3, |x| (direction(x[1], x[2]), direction(x[0], 0.0))),
    ("SPHERICAL_TL_PL_TV_PV", 4, |x| (direction(x[0], x[1]), direction(x[2], x[3]))),
    ("RUSIN_TH_TD_PD", 3, |x| half(x[0], x[1], x[2])),
    ("RUSIN_TH_PH_TD_PD", 4, |x| half(x[0], x[2], x[3])),
    ("RETRO_TL_TVL_PROJ_DPHI", 3, retro),
    ("SCHLICK_TL_TK_PROJ_DPHI", 3, back),
    ("CARTESIAN", 6, |x| {
        (Vector3::new(x[3], x[4], x[5]).normalize(), Vector3::new(x[0], x[1], x[2]).normalize())
    }),
];

/// From the coordinates of a row to `wi` and `wo`.
type Parametrisation = fn(&[f64]) -> (Vector3<f64>, Vector3<f64>);

/// The polar coordinates of a point, of which the distance from the origin is an angle.
fn polar(x: f64, y: f64) -> (f64, f64) {
    (x.hypot(y), y.atan2(x))
}

/// `theta_l, theta_v cos(dphi), theta_v sin(dphi)`.
fn projected(x: &[f64]) -> (Vector3<f64>, Vector3<f64>) {
    let (theta, phi) = polar(x[1], x[2]);
    (direction(x[0], 0.0), direction(theta, phi))
}

/// Half-difference angles about the view.
fn half(theta_h: f64, theta_d: f64, phi_d: f64) -> (Vector3<f64>, Vector3<f64>) {
    let (wo, wi) = HalfDiff { theta_h, theta_d, phi_d }.to_directions();
    (wi, wo)
}

/// `theta_l`, and the view by its angle from the light and its azimuth about the light, which is 0 towards the
/// normal.
fn retro(x: &[f64]) -> (Vector3<f64>, Vector3<f64>) {
    let wi = direction(x[0], 0.0);
    let (theta, phi) = polar(x[1], x[2]);
    let up = Vector3::new(-x[0].cos(), 0.0, x[0].sin());
    (wi, theta.cos() * wi + theta.sin() * (phi.cos() * up + phi.sin() * Vector3::y()))
}

/// `theta_l`, and the back vector between the view and the mirrored light in polar coordinates.
fn back(x: &[f64]) -> (Vector3<f64>, Vector3<f64>) {
    let wi = direction(x[0], 0.0);
    let mirrored = direction(x[0], PI);
    let (theta, phi) = polar(x[1], x[2]);
    let middle = direction(theta, phi);
    (wi, 2.0 * mirrored.dot(&middle) * middle - mirrored)
}

/// What the values are.
#[derive(Clone, Copy, PartialEq)]
enum Output {
    Brdf,
    Cosine,
    Xyz,
}

/// A key and what follows it, if a line is a header of the format.
fn key(line: &str) -> Option<(&str, &str)> {
    let line = line.strip_prefix('#')?.trim_end();
    let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let is_key = !key.is_empty() && key.chars().all(|c| c.is_ascii_uppercase() || c == '_');
    is_key.then(|| (key, rest.trim()))
}

fn parse(input: Input<'_>) -> Result<SampleSet> {
    let input = Input { format: NAME, ..input };
    let text = input.text()?;
    let (mut parametrisation, mut output) = (None, Output::Brdf);
    let (mut dimensions, mut intervals) = (None, 0);
    let mut description = Vec::new();
    for (line, at) in text.lines().zip(1u64..) {
        let Some((key, rest)) = key(line) else { continue };
        match key {
            "PARAM_IN" => {
                let found = PARAMETRISATIONS.iter().find(|known| known.0 == rest).ok_or_else(|| {
                    let names = PARAMETRISATIONS.map(|known| known.0).join(", ");
                    input.wrong(format!("one of the parametrisations {names} on line {at}"), shortened(rest))
                })?;
                parametrisation = Some(found);
            }
            "PARAM_OUT" => {
                output = match rest {
                    "INV_STERADIAN" | "RGB_COLOR" => Output::Brdf,
                    "INV_STERADIAN_COSINE_FACTOR" => Output::Cosine,
                    "XYZ_COLOR" => Output::Xyz,
                    _ => {
                        let known = "INV_STERADIAN, INV_STERADIAN_COSINE_FACTOR, RGB_COLOR or XYZ_COLOR";
                        return Err(
                            input.wrong(format!("values that are {known} on line {at}"), shortened(rest))
                        );
                    }
                };
            }
            "DIM" => {
                let counts: Vec<usize> = rest.split_whitespace().filter_map(|n| n.parse().ok()).collect();
                let found = <[usize; 2]>::try_from(counts.as_slice()).ok();
                dimensions = Some(found.ok_or_else(|| {
                    input.wrong(format!("two numbers after #DIM on line {at}"), shortened(rest))
                })?);
            }
            "VS" => {
                let counts = rest.split_whitespace().map(|n| n.parse::<usize>().ok().filter(|n| *n <= 2));
                let counts: Option<Vec<usize>> = counts.collect();
                let counts = counts.ok_or_else(|| {
                    input.wrong(format!("numbers from 0 to 2 after #VS on line {at}"), shortened(rest))
                })?;
                intervals = counts.iter().sum();
            }
            _ => description.push(rest.trim_matches('"')),
        }
    }
    let &(name, coordinates, directions) =
        parametrisation.ok_or_else(|| input.wrong("a line #PARAM_IN", "none"))?;
    let [inputs, outputs] = dimensions.unwrap_or([coordinates, if output == Output::Xyz { 3 } else { 1 }]);
    if inputs != coordinates || !matches!((outputs, output), (3, _) | (1, Output::Brdf | Output::Cosine)) {
        return Err(input.wrong(
            format!("#DIM {coordinates} 1 or #DIM {coordinates} 3 for {name}"),
            format!("#DIM {inputs} {outputs}"),
        ));
    }
    let kind = if output == Output::Cosine { ValueKind::Cosine } else { ValueKind::Brdf };
    let mut samples = Collector::new(input, kind);
    if intervals > 0 {
        samples.notice(
            "the confidence intervals of the file are left out, as it does not say how sure they are"
                .to_owned(),
        );
    }
    let count = inputs + outputs + intervals;
    let mut row = Vec::new();
    for (line, at) in text.lines().zip(1u64..) {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        row.clear();
        for token in line.split_whitespace() {
            row.push(input.number(token, at)?);
        }
        if row.len() != count {
            let expected = format!("{inputs} coordinates and {} values on line {at}", count - inputs);
            return Err(input.wrong(expected, format!("{} numbers", row.len())));
        }
        let (wi, wo) = directions(&row[..inputs]);
        if !(wi.norm() < 2.0 && wo.norm() < 2.0) {
            return Err(input.wrong(format!("two directions on line {at}"), "a vector without length"));
        }
        let raw = &row[inputs..inputs + outputs];
        let value = match (output, raw) {
            (Output::Xyz, &[x, y, z]) => srgb_from_xyz([x, y, z]),
            (_, &[r, g, b]) => [r, g, b],
            _ => [raw[0]; 3],
        };
        samples.push(Row { line: at, wi, wo, value, sigma: Sigma::Unknown }, raw)?;
    }
    description.retain(|text| !text.is_empty());
    samples.finish(description.join(", "))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::formats::measured::ReadOptions;
    use crate::formats::mutate::mutations;
    use crate::test_data::data_dir;

    fn read(text: &[u8]) -> Result<SampleSet, String> {
        parse(Input { format: NAME, path: Path::new("x"), bytes: text, options: &ReadOptions::default() })
            .map_err(|error| error.to_string())
    }

    fn row(parametrisation: &str, coordinates: &str) -> [Vector3<f64>; 2] {
        let found = read(format!("#PARAM_IN {parametrisation}\n{coordinates} 0.5\n").as_bytes()).unwrap();
        assert_eq!(found.values, [[0.5; 3]]);
        found.directions[0]
    }

    #[test]
    fn parametrisations_give_their_directions() {
        let same = |a: [Vector3<f64>; 2], b: [Vector3<f64>; 2]| {
            assert!((a[0] - b[0]).norm() < 1e-12 && (a[1] - b[1]).norm() < 1e-12, "{a:?} {b:?}");
        };
        let expected = [direction(0.3, 0.0), direction(0.5, 2.0)];
        same(
            row("ISOTROPIC_TL_TV_PROJ_DPHI", &format!("0.3 {} {}", 0.5 * 2f64.cos(), 0.5 * 2f64.sin())),
            expected,
        );
        same(row("SPHERICAL_TL_PL_TV_PV", "0.3 0 0.5 2"), expected);
        same(row("ISOTROPIC_TV_TL_DPHI", "0.5 0.3 -2"), [direction(0.3, -2.0), direction(0.5, 0.0)]);
        let (i, o) = (expected[0], expected[1]);
        same(row("CARTESIAN", &format!("{} {} {} {} {} {}", o.x, o.y, o.z, i.x, i.y, i.z)), expected);
        // The view in the direction of the light.
        same(row("RETRO_TL_TVL_PROJ_DPHI", "0.3 0 0"), [i, i]);
        // 0.1 from the light towards the normal.
        same(row("RETRO_TL_TVL_PROJ_DPHI", "0.3 0.1 0"), [i, direction(0.2, 0.0)]);
        // The back vector is the normal: the view is the mirrored mirror of the light.
        same(row("SCHLICK_TL_TK_PROJ_DPHI", "0.3 0 0"), [i, i]);
        let angles = HalfDiff { theta_h: 0.2, theta_d: 0.4, phi_d: 1.0 };
        let found = row("RUSIN_TH_TD_PD", "0.2 0.4 1");
        let again = HalfDiff::from_directions(&found[1], &found[0]);
        assert!((again.theta_h - angles.theta_h).abs() + (again.phi_d - angles.phi_d).abs() < 1e-12);
    }

    #[test]
    fn values_are_what_the_header_says() {
        let read = |header: &str, row: &str| {
            read(format!("#PARAM_IN SPHERICAL_TL_PL_TV_PV\n{header}\n{row}\n").as_bytes())
        };
        let found = read("#PARAM_OUT INV_STERADIAN_COSINE_FACTOR", "0.1 0 1 0 0.25").unwrap();
        assert!((found.values[0][0] - 0.25 / 1f64.cos()).abs() < 1e-15);
        let found = read("#DIM 4 3\n#SAMPLE \"Tape\"", "0.1 0 1 0 1 2 3").unwrap();
        assert_eq!((found.values[0], found.description.as_str()), ([1.0, 2.0, 3.0], "Tape"));
        let found = read("#DIM 4 1\n#VS 2", "0.1 0 1 0 1 0.9 1.1").unwrap();
        assert_eq!((found.values[0][0], found.notices.len()), (1.0, 1));
        assert!(read("#PARAM_OUT ENERGY", "0.1 0 1 0 1").unwrap_err().ends_with("on line 2, found ENERGY"));
        let error = read("", "0.1 0 1 0 1 2").unwrap_err();
        assert!(error.ends_with("expected 4 coordinates and 1 values on line 3, found 6 numbers"), "{error}");
        let error = super::tests::read(b"#PARAM_IN STARK_3D\n1 2 3 4\n").unwrap_err();
        assert!(error.ends_with("on line 1, found STARK_3D"), "{error}");
    }

    #[test]
    fn damaged_files_never_panic() {
        let text = "#DIM 3 1\n#VS 0\n#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n0.3 0.4 0.5 0.25\n0.2 -0.5 0.1 3\n";
        let mut survivors = 0;
        for bytes in mutations(text.as_bytes(), text.len(), 3, 20_000) {
            survivors += usize::from(read(&bytes).is_ok());
        }
        assert!(survivors > 100, "{survivors}");
    }

    /// The tape throws light back to where it comes from.
    #[test]
    fn a_measured_tape_is_brightest_towards_the_light() {
        let Some(data) = data_dir() else { return };
        let bytes = std::fs::read(data.join("gonio/retro-gray-tape.dat")).unwrap();
        let found = read(&bytes).unwrap();
        assert!(found.description.starts_with("Gray Tape, retro-reflection"), "{}", found.description);
        let largest =
            (0..found.len()).max_by(|&a, &b| found.values[a][0].total_cmp(&found.values[b][0])).unwrap();
        assert!((found.values[largest][0] - 72.456_805_929_914).abs() < 1e-9);
        assert!((found.directions[largest][0] - found.directions[largest][1]).norm() < 1e-9);
        assert!((found.directions[largest][0].z.acos() - 15f64.to_radians()).abs() < 1e-9);
        assert!(found.notices[0].contains("at the horizon"), "{:?}", found.notices);
    }
}
