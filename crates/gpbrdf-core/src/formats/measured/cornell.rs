//! Cornell `.brdf` measurements: scattered samples with spectra, as text.
//!
//! The file holds the number of wavelengths, the wavelengths in nm, then one line per sample:
//! `theta_i phi_i theta_s phi_s` in radians and `f` in sr^-1 at each wavelength. `#` starts a comment.
//! Source: the Light Measurement Laboratory of Cornell University's Program of Computer Graphics.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use crate::base::error::Result;
use crate::brdf::angles::direction;
use crate::formats::format::{Format, Reader};
use crate::formats::measured::collector::{Collector, Row, Sigma};
use crate::formats::measured::input::Input;
use crate::formats::measured::options::{ReadOptions, ValueKind};
use crate::formats::measured::spectrum::{SpectrumToRgb, sparse};
use crate::formats::read::read_bytes;
use crate::sample::SampleSet;

/// Scattered measurements with spectra, as in the Cornell database.
pub(crate) const FORMAT: Format = Format {
    name: "Cornell measurement",
    file: "Cornell .brdf",
    recognises: |head| {
        head.line().is_some_and(|line| line.split_whitespace().all(|token| token.parse::<f64>().is_ok()))
    },
    read: Reader::Samples(parse),
};

/// The name in messages.
const NAME: &str = "Cornell";
/// The largest file that is read.
const LIMIT_BYTES: u64 = 1 << 28;
/// Limit on the number of wavelengths, which no instrument reaches.
const MAX_WAVELENGTHS: usize = 10_000;

/// Reads a Cornell `.brdf` file. Spectra are converted to linear sRGB for the CIE 1931 2-degree observer
/// under D65; out-of-gamut channels are set to 0.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) when the file cannot be read; [`Error::Format`](crate::Error::Format), which
/// names the line, when it is not of this format, a number is not finite or a direction is below the horizon.
pub fn read_cornell(path: impl AsRef<Path>) -> Result<SampleSet> {
    let path = path.as_ref();
    let bytes = read_bytes(path, NAME, LIMIT_BYTES)?;
    parse(Input { format: NAME, path, bytes: &bytes, options: &ReadOptions::default() })
}

fn parse(input: Input<'_>) -> Result<SampleSet> {
    let input = Input { format: NAME, ..input };
    let wrong = |expected: String, found: String| input.wrong(expected, found);
    if input.bytes.is_empty() {
        return Err(wrong("the number of wavelengths".to_owned(), "an empty file".to_owned()));
    }
    let text = input.text()?;
    // The lines that have content, numbered from 1.
    let mut lines = text
        .lines()
        .zip(1..)
        .map(|(line, number): (&str, u64)| (line.split('#').next().unwrap_or("").trim(), number))
        .filter(|(line, _)| !line.is_empty());
    let number = |token: &str, line: u64| {
        token.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| {
            let shown: String = token.chars().take(40).collect();
            wrong(format!("a finite number on line {line}"), format!("\"{shown}\""))
        })
    };

    let Some((line, at)) = lines.next() else {
        return Err(wrong("the number of wavelengths".to_owned(), "nothing but comments".to_owned()));
    };
    let count = line.parse::<usize>().ok().filter(|count| (1..=MAX_WAVELENGTHS).contains(count));
    let Some(count) = count else {
        let shown: String = line.chars().take(40).collect();
        return Err(wrong(format!("a number of wavelengths on line {at}"), format!("\"{shown}\"")));
    };
    let mut wavelengths = Vec::with_capacity(count);
    while wavelengths.len() < count {
        let Some((line, at)) = lines.next() else {
            return Err(wrong(format!("{count} wavelengths"), wavelengths.len().to_string()));
        };
        for token in line.split_whitespace() {
            wavelengths.push(number(token, at)?);
        }
        if wavelengths.len() > count {
            return Err(wrong(format!("{count} wavelengths up to line {at}"), wavelengths.len().to_string()));
        }
    }
    let Some(to_rgb) = SpectrumToRgb::new(&wavelengths) else {
        return Err(wrong(
            "increasing wavelengths that reach into 380 to 780 nm".to_owned(),
            format!("{} to {}", wavelengths[0], wavelengths[count - 1]),
        ));
    };

    let mut samples = Collector::new(input, ValueKind::Brdf);
    if let Some(notice) = sparse(&wavelengths) {
        samples.notice(notice);
    }
    let mut rows = 0;
    let mut row = Vec::with_capacity(4 + count);
    for (line, at) in lines {
        row.clear();
        for token in line.split_whitespace() {
            row.push(number(token, at)?);
        }
        let Some(([theta_i, phi_i, theta_s, phi_s], spectrum)) =
            row.split_first_chunk::<4>().filter(|(_, spectrum)| spectrum.len() == count)
        else {
            return Err(wrong(
                format!("4 angles and {count} values on line {at}"),
                format!("{} numbers", row.len()),
            ));
        };
        for (name, theta) in [("theta_i", *theta_i), ("theta_s", *theta_s)] {
            if !(0.0..=FRAC_PI_2 + 1e-5).contains(&theta) {
                return Err(wrong(
                    format!("{name} from 0 to pi/2 (above the horizon) on line {at}"),
                    theta.to_string(),
                ));
            }
        }
        for (name, phi) in [("phi_i", *phi_i), ("phi_s", *phi_s)] {
            // The files round angles to six digits, so a full turn can be exceeded slightly.
            if phi.abs() > 2.0 * PI + 1e-3 {
                return Err(wrong(format!("{name} from -2 pi to 2 pi on line {at}"), phi.to_string()));
            }
        }
        rows += 1;
        let row = Row {
            line: at,
            wi: direction(*theta_i, *phi_i),
            wo: direction(*theta_s, *phi_s),
            value: to_rgb.rgb(spectrum.iter().copied()),
            sigma: Sigma::Unknown,
        };
        samples.push(row, spectrum)?;
    }
    if rows == 0 {
        return Err(wrong("at least one sample".to_owned(), "wavelengths only".to_owned()));
    }
    let comments: Vec<_> = text
        .lines()
        .map_while(|line| line.trim().strip_prefix('#'))
        .map(str::trim)
        .filter(|comment| !comment.is_empty() && !comment.starts_with("num wls"))
        .collect();
    samples.finish(comments.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::mutate::mutations;
    use crate::test_data::data_dir;

    const SMALL: &str = "# Grey\n\n# num wls\n3\n# wls\n400 550\n700 # nm\n# rows\n\
        0.5 0.0 0.25 -2.5 0.2 0.2 0.2\n0.1 0 0.2 1 0.3 0.3 0.3\n";

    fn parse(bytes: &[u8], path: &Path) -> Result<SampleSet> {
        super::parse(Input { format: NAME, path, bytes, options: &ReadOptions::default() })
    }

    fn error(text: &str) -> String {
        let message = parse(text.as_bytes(), Path::new("x.brdf")).unwrap_err().to_string();
        message.strip_prefix("Cornell file \"x.brdf\": expected ").unwrap().to_owned()
    }

    #[test]
    fn grey_samples_are_grey() {
        let found = parse(SMALL.as_bytes(), Path::new("x")).unwrap();
        assert_eq!(found.len(), 2);
        assert_eq!(found.description, "Grey");
        assert_eq!(found.lines, [9, 10]);
        assert!(found.notices[0].contains("3 wavelengths from 400 to 700 nm"), "{:?}", found.notices);
        assert!(found.values[0].iter().all(|value| (value - 0.2).abs() < 1e-6));
        assert!((found.directions[0][1] - direction(0.25, -2.5)).norm() < 1e-15);
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        assert_eq!(error(""), "the number of wavelengths, found an empty file");
        assert_eq!(error("# a\n"), "the number of wavelengths, found nothing but comments");
        assert_eq!(error("x\n"), "a number of wavelengths on line 1, found \"x\"");
        assert_eq!(error("99999999999\n"), "a number of wavelengths on line 1, found \"99999999999\"");
        assert_eq!(error("3\n400 500\n"), "3 wavelengths, found 2");
        assert_eq!(error("2\n400 500 600\n"), "2 wavelengths up to line 2, found 3");
        assert_eq!(
            error("2\n500 400\n"),
            "increasing wavelengths that reach into 380 to 780 nm, found 500 to 400"
        );
        assert_eq!(error("2\n400 500\n"), "at least one sample, found wavelengths only");
        let row = |text: &str| error(&format!("2\n400 500\n{text}\n"));
        assert_eq!(row("0 0 0 0 1"), "4 angles and 2 values on line 3, found 5 numbers");
        assert_eq!(row("0 0 0 0 1 nan"), "a finite number on line 3, found \"nan\"");
        assert_eq!(row("0 0 1.6 0 1 1"), "theta_s from 0 to pi/2 (above the horizon) on line 3, found 1.6");
        assert_eq!(row("0 90 0 0 1 1"), "phi_i from -2 pi to 2 pi on line 3, found 90");
    }

    #[test]
    fn damaged_files_never_panic() {
        let mut survivors = 0;
        for bytes in mutations(SMALL.as_bytes(), SMALL.len(), 4, 20_000) {
            survivors += usize::from(parse(&bytes, Path::new("x")).is_ok());
        }
        assert!(survivors > 100, "{survivors}");
    }

    #[test]
    fn measured_paints_have_their_colours() {
        let Some(data) = data_dir() else { return };
        let median = |name: &str| -> [f64; 3] {
            let found = read_cornell(data.join("cornell").join(name)).unwrap();
            assert_eq!(found.len(), 1439, "{name}");
            let tilted: Vec<_> = (1..=8).map(|k| f64::from(10 * k).to_radians().cos()).collect();
            for sample in found.iter() {
                assert!(sample.value.iter().all(|v| v.is_finite() && *v >= 0.0));
                assert!(tilted.iter().any(|cos| (cos - sample.wi.z).abs() < 1e-5), "{}", sample.wi);
            }
            std::array::from_fn(|c| {
                let mut values: Vec<_> = found.values.iter().map(|v| v[c]).collect();
                values.sort_by(f64::total_cmp);
                values[values.len() / 2]
            })
        };
        let [r, g, b] = median("garnet_red.brdf");
        assert!(r > 2.0 * g && r > 2.0 * b, "garnet {r} {g} {b}");
        let [r, g, b] = median("acryl_blue.brdf");
        assert!(b > 2.0 * g && b > 2.0 * r, "blue {r} {g} {b}");
        let [r, g, b] = median("cayman.brdf");
        eprintln!("cayman {r} {g} {b}");
        assert!(r.max(g).max(b) < 1.0, "cayman {r} {g} {b}");
    }
}
