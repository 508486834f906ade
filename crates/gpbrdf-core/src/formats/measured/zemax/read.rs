//! Reads files of this format.

use crate::base::error::Result;
use crate::formats::format::{Format, Reader};
use crate::formats::measured::collector::{Collector, Row, Sigma};
use crate::formats::measured::input::{Input, shortened};
use crate::formats::measured::options::ValueKind;
use crate::formats::measured::spectrum::srgb_from_xyz;
use crate::formats::measured::zemax::frame::Frame;
use crate::sample::SampleSet;

/// Measurements about the specular direction.
pub(crate) const FORMAT: Format = Format {
    name: "Zemax measurement",
    file: "Zemax .bsdf",
    recognises: |head| {
        head.text.as_deref().is_some_and(|text| {
            let is_key = |key: &str| text.lines().any(|line| line.trim_start().starts_with(key));
            is_key("ScatterRadial") || (is_key("AngleOfIncidence") && is_key("ScatterAzimuth"))
        })
    },
    read: Reader::Samples(parse),
};

/// The name in messages.
const NAME: &str = "Zemax";

/// Limit on the number of angles in a list.
const MOST_ANGLES: usize = 100_000;

/// The lines that are neither blank nor comments, one after the other.
struct Lines<'a> {
    input: Input<'a>,
    lines: Vec<(u64, &'a str)>,
    next: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self, expected: &str) -> Result<(u64, &'a str)> {
        let found = self.lines.get(self.next).copied();
        self.next += 1;
        found.ok_or_else(|| self.input.wrong(expected, "the end of the file"))
    }

    /// `count` numbers, on one line or on several.
    fn numbers(&mut self, what: &str, count: usize) -> Result<Vec<f64>> {
        let mut numbers = Vec::new();
        while numbers.len() < count {
            let (at, line) = self.next(&format!("{count} angles of {what}"))?;
            for token in line.split_whitespace() {
                numbers.push(self.input.number(token, at)?);
            }
            if numbers.len() > count {
                let expected = format!("{count} angles of {what} up to line {at}");
                return Err(self.input.wrong(expected, numbers.len().to_string()));
            }
        }
        Ok(numbers)
    }
}

/// The angles of a file, in degrees.
struct Header {
    is_plane_symmetrical: bool,
    is_xyz: bool,
    rotations: Vec<f64>,
    incidences: Vec<f64>,
    azimuths: Vec<f64>,
    radials: Vec<f64>,
}

/// Reads the header up to the line that names the first block of values.
fn header(lines: &mut Lines<'_>) -> Result<Header> {
    let input = lines.input;
    let (mut symmetry, mut spectral, mut scatter) = (None, None, None);
    let (mut rotations, mut incidences, mut azimuths, mut radials) = (None, None, None, None);
    loop {
        let (at, line) = lines.next("the header and the line DataBegin")?;
        let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let value = value.trim();
        let list = match key {
            "Symmetry" => {
                symmetry = match value.to_lowercase().as_str() {
                    "planesymmetrical" => Some(true),
                    "asymmetrical" | "asymmetrical4d" => Some(false),
                    _ => {
                        let expected =
                            format!("PlaneSymmetrical, Asymmetrical or Asymmetrical4D on line {at}");
                        return Err(input.wrong(expected, shortened(value)));
                    }
                };
                continue;
            }
            "SpectralContent" => {
                spectral = match value {
                    "Monochrome" => Some(false),
                    "XYZ" => Some(true),
                    _ => return Err(input.wrong(format!("Monochrome or XYZ on line {at}"), shortened(value))),
                };
                continue;
            }
            "ScatterType" => {
                if value != "BRDF" {
                    let expected = format!("reflected light, ScatterType BRDF, on line {at}");
                    return Err(input.wrong(expected, shortened(value)));
                }
                scatter = Some(());
                continue;
            }
            "SampleRotation" => &mut rotations,
            "AngleOfIncidence" => &mut incidences,
            "ScatterAzimuth" => &mut azimuths,
            "ScatterRadial" => &mut radials,
            "Monochrome" | "TristimulusX" | "TristimulusY" | "TristimulusZ" => {
                lines.next -= 1;
                break;
            }
            _ => continue,
        };
        let count = value.parse::<usize>().ok().filter(|count| (1..=MOST_ANGLES).contains(count));
        let count = count.ok_or_else(|| {
            input.wrong(
                format!("a number of angles after {key} on line {at}"),
                format!("\"{}\"", shortened(value)),
            )
        })?;
        if list.replace(lines.numbers(key, count)?).is_some() {
            return Err(input.wrong(format!("one list {key}"), format!("another one on line {at}")));
        }
    }
    let missing = |key: &str| input.wrong(format!("a line {key} before the values"), "none");
    scatter.ok_or_else(|| missing("ScatterType"))?;
    let header = Header {
        is_plane_symmetrical: symmetry.ok_or_else(|| missing("Symmetry"))?,
        is_xyz: spectral.ok_or_else(|| missing("SpectralContent"))?,
        rotations: rotations.unwrap_or_else(|| vec![0.0]),
        incidences: incidences.ok_or_else(|| missing("AngleOfIncidence"))?,
        azimuths: azimuths.ok_or_else(|| missing("ScatterAzimuth"))?,
        radials: radials.ok_or_else(|| missing("ScatterRadial"))?,
    };
    let most_azimuth = if header.is_plane_symmetrical { 180.0 } else { 360.0 };
    for (key, angles, least, most) in [
        ("SampleRotation", &header.rotations, -360.0, 360.0),
        ("AngleOfIncidence", &header.incidences, 0.0, 90.0),
        (
            "ScatterAzimuth",
            &header.azimuths,
            if header.is_plane_symmetrical { 0.0 } else { -360.0 },
            most_azimuth,
        ),
        ("ScatterRadial", &header.radials, 0.0, 180.0),
    ] {
        if let Some(found) = angles.iter().find(|angle| !(least..=most).contains(*angle)) {
            return Err(input.wrong(format!("{key} from {least} to {most} degrees"), found.to_string()));
        }
        if let Some(pair) = angles.windows(2).find(|pair| !(pair[0] < pair[1])) {
            let expected = format!("increasing angles of {key}");
            return Err(input.wrong(expected, format!("{} after {}", pair[1], pair[0])));
        }
    }
    Ok(header)
}

/// One block of values, for one colour: rows of radials with their lines.
fn block(lines: &mut Lines<'_>, header: &Header) -> Result<Vec<(u64, Vec<f64>)>> {
    let input = lines.input;
    let (at, begin) = lines.next("a line DataBegin")?;
    if begin.trim() != "DataBegin" {
        return Err(input.wrong(format!("DataBegin on line {at}"), format!("\"{}\"", shortened(begin))));
    }
    let mut rows = Vec::new();
    for _ in 0..header.rotations.len() * header.incidences.len() {
        let (at, line) = lines.next("values for every angle of incidence")?;
        let total = line.trim().strip_prefix("TIS").map(str::trim);
        match total {
            Some(total) => {
                input.number(total, at)?;
            }
            None => lines.next -= 1,
        }
        for _ in 0..header.azimuths.len() {
            let (at, line) = lines.next("values for every azimuth")?;
            let mut row = Vec::with_capacity(header.radials.len());
            for token in line.split_whitespace() {
                row.push(input.number(token, at)?);
            }
            if row.len() != header.radials.len() {
                let expected =
                    format!("{} values, one for each ScatterRadial, on line {at}", header.radials.len());
                return Err(input.wrong(expected, row.len().to_string()));
            }
            rows.push((at, row));
        }
    }
    let (at, end) = lines.next("a line DataEnd")?;
    if end.trim() != "DataEnd" {
        return Err(input.wrong(format!("DataEnd on line {at}"), format!("\"{}\"", shortened(end))));
    }
    Ok(rows)
}

pub(super) fn parse(input: Input<'_>) -> Result<SampleSet> {
    let input = Input { format: NAME, ..input };
    let text = input.text()?;
    let content = text.lines().zip(1u64..).map(|(line, at)| (at, line.trim()));
    let content = content.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).collect();
    let mut lines = Lines { input, lines: content, next: 0 };
    let header = header(&mut lines)?;
    let names: &[&str] =
        if header.is_xyz { &["TristimulusX", "TristimulusY", "TristimulusZ"] } else { &["Monochrome"] };
    let mut blocks = Vec::new();
    for name in names {
        let (at, found) = lines.next(&format!("a line {name}"))?;
        if found != *name {
            return Err(input.wrong(format!("{name} on line {at}"), format!("\"{}\"", shortened(found))));
        }
        blocks.push(block(&mut lines, &header)?);
    }
    if let Some((at, line)) = lines.lines.get(lines.next) {
        return Err(input.wrong("nothing after the values", format!("\"{}\" on line {at}", shortened(line))));
    }
    let mut samples = Collector::new(input, ValueKind::Brdf);
    if header.is_xyz {
        samples.notice("the colours X, Y and Z are taken as relative to the white of D65".to_owned());
    }
    if header.rotations.len() > 1 {
        let count = header.rotations.len();
        samples
            .notice(format!("the sample was turned to {count} angles; the material is taken as isotropic"));
    }
    let mut unmeasured = 0;
    let mut raw = [0.0; 3];
    for (index, &(line, _)) in blocks[0].iter().enumerate() {
        let (outer, azimuth) = (index / header.azimuths.len(), index % header.azimuths.len());
        let frame = Frame::new(header.incidences[outer % header.incidences.len()].to_radians());
        for (k, radial) in header.radials.iter().enumerate() {
            let wo = frame.direction(radial.to_radians(), header.azimuths[azimuth].to_radians());
            if wo.z < 1e-9 {
                continue;
            }
            for (value, block) in raw.iter_mut().zip(&blocks) {
                *value = block[index].1[k];
            }
            let raw = &raw[..blocks.len()];
            if raw.iter().all(|value| *value == 0.0) {
                unmeasured += 1;
                continue;
            }
            // The first azimuth of the block has the specular direction already, and 0 degrees is 360.
            let first = index - azimuth;
            let is_repeated = |other: usize| blocks.iter().zip(raw).all(|(b, value)| b[other].1[k] == *value);
            let turns = azimuth > 0 && (header.azimuths[azimuth] - header.azimuths[0] - 360.0).abs() < 1e-9;
            if azimuth > 0 && (*radial == 0.0 || turns) && is_repeated(first) {
                continue;
            }
            let value = if header.is_xyz { srgb_from_xyz([raw[0], raw[1], raw[2]]) } else { [raw[0]; 3] };
            samples.push(Row { line, wi: frame.wi, wo, value, sigma: Sigma::Unknown }, raw)?;
        }
    }
    if unmeasured > 0 {
        samples.notice(format!(
            "{unmeasured} values above the horizon are 0, which stands for directions that were not measured; \
             they are left out"
        ));
    }
    let comments: Vec<&str> =
        text.lines().filter_map(|line| line.trim().strip_prefix('#')).map(str::trim).collect();
    samples.finish(comments.join("\n").trim().to_owned())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::brdf::angles::direction;
    use crate::formats::measured::ReadOptions;
    use crate::formats::mutate::mutations;
    use crate::test_data::data_dir;

    const SMALL: &str = "# Vinyl\nSource  Measured\nSymmetry PlaneSymmetrical\nSpectralContent Monochrome\n\
        ScatterType BRDF\nSampleRotation 1\n0\nAngleOfIncidence 2\n10 30\nScatterAzimuth 3\n0 90 180\n\
        ScatterRadial 3\n0 30 70\n\nMonochrome\nDataBegin\nTIS 0.5\n1 2 3\n1 4 5\n1 6 0\nTIS 0.6\n7 8 9\n\
        7 10 11\n7 12 0\nDataEnd\n";

    fn read(text: &[u8]) -> Result<SampleSet, String> {
        parse(Input { format: NAME, path: Path::new("x"), bytes: text, options: &ReadOptions::default() })
            .map_err(|error| error.to_string().rsplit_once("expected ").unwrap().1.to_owned())
    }

    #[test]
    fn values_are_about_the_specular_direction() {
        let found = read(SMALL.as_bytes()).unwrap();
        // Nine values each, less the repeated specular ones; one is 0, and one below the horizon.
        assert_eq!(found.len(), 12);
        assert_eq!(found.description, "Vinyl");
        let at = |value: f64| {
            let index = found.values.iter().position(|v| v[1] == value).unwrap();
            (found.directions[index], found.lines[index])
        };
        let near = |found: ([nalgebra::Vector3<f64>; 2], u64), wi: f64, wo: (f64, f64), line: u64| {
            let [theta_o, phi_o] = [wo.0, wo.1].map(f64::to_radians);
            assert!((found.0[0] - direction(wi.to_radians(), 0.0)).norm() < 1e-12);
            assert!((found.0[1] - direction(theta_o, phi_o)).norm() < 1e-12, "{found:?}");
            assert_eq!(found.1, line);
        };
        near(at(1.0), 10.0, (10.0, 180.0), 18);
        near(at(2.0), 10.0, (20.0, 0.0), 18);
        near(at(6.0), 10.0, (40.0, 180.0), 20);
        near(at(8.0), 30.0, (0.0, 0.0), 22);
        near(at(9.0), 30.0, (40.0, 0.0), 22);
        assert!(found.notices[0].starts_with("1 values above the horizon are 0"), "{:?}", found.notices);
    }

    #[test]
    fn colours_and_turned_samples_are_understood() {
        let block = SMALL.split_once("Monochrome\nDataBegin").unwrap().1;
        let header = SMALL.split_once("\n\n").unwrap().0.replace("Monochrome", "XYZ");
        let text = ["X", "Y", "Z"].map(|c| format!("Tristimulus{c}\nDataBegin{block}")).concat();
        let found = read(format!("{header}\n\n{text}").as_bytes()).unwrap();
        // X = Y = Z = 1 is nearly white: more red than the white of D65.
        assert!(
            found.values[0][0] > 1.1 && (found.values[0][1] - 0.95).abs() < 0.01,
            "{:?}",
            found.values[0]
        );
        assert!(found.notices[0].contains("D65"));
        let turned = SMALL.replace("SampleRotation 1\n0", "SampleRotation 2\n0 90");
        let data = block.trim_start().trim_end_matches("DataEnd\n");
        let turned = turned.replace("DataEnd", &format!("{data}DataEnd"));
        let found = read(turned.as_bytes()).unwrap();
        assert_eq!(found.len(), 24);
        assert!(found.notices[0].contains("turned to 2 angles"));
    }

    #[test]
    fn what_cannot_be_read_is_refused_by_name() {
        let error = |from: &str, to: &str| read(SMALL.replace(from, to).as_bytes()).unwrap_err();
        assert_eq!(error("BRDF", "BTDF"), "reflected light, ScatterType BRDF, on line 5, found BTDF");
        assert!(error("PlaneSymmetrical", "Odd").ends_with("on line 3, found Odd"));
        assert_eq!(error("1 4 5", "1 4"), "3 values, one for each ScatterRadial, on line 19, found 2");
        assert_eq!(error("1 4 5", "1 4 x"), "a finite number on line 19, found \"x\"");
        assert_eq!(error("TIS 0.6", "7 8 9"), "DataEnd on line 24, found \"7 12 0\"");
        assert_eq!(error("10 30\n", "30 10\n"), "increasing angles of AngleOfIncidence, found 10 after 30");
        assert_eq!(error("DataEnd", ""), "a line DataEnd, found the end of the file");
        assert_eq!(error("0 90 180", "0 90 180 270"), "3 angles of ScatterAzimuth up to line 11, found 4");
    }

    #[test]
    fn damaged_files_never_panic() {
        let mut survivors = 0;
        for bytes in mutations(SMALL.as_bytes(), SMALL.len(), 7, 20_000) {
            survivors += usize::from(read(&bytes).is_ok());
        }
        assert!(survivors > 100, "{survivors}");
    }

    /// Radial angles are about the specular direction if the instrument's limit, 84 degrees from the normal, is
    /// the same for every angle of incidence.
    #[test]
    fn measured_vinyl_ends_at_the_same_angle_everywhere() {
        let Some(data) = data_dir() else { return };
        let bytes = std::fs::read(data.join("gonio/zemax_plane.bsdf")).unwrap();
        let found = read(&bytes).unwrap();
        assert!(found.description.starts_with("Data Generated by Radiant"), "{}", found.description);
        let mut widest = std::collections::BTreeMap::new();
        for sample in found.iter() {
            let incidence = sample.wi.z.acos().to_degrees().round();
            let angle = widest.entry(incidence.to_bits()).or_insert(0.0f64);
            *angle = angle.max(sample.wo.z.acos().to_degrees());
        }
        assert_eq!(widest.len(), 13);
        assert!(widest.values().all(|angle| (83.0..85.5).contains(angle)), "{widest:?}");
        assert_eq!((found.values[0], found.lines[0]), ([6.375e-2; 3], 19));
    }
}
