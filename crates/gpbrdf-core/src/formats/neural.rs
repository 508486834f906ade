//! Tables of Neural BRDF weights.

use std::io::Read;
use std::path::Path;

use crate::base::error::{Error, Result};
use crate::brdf::analytic::{NEURAL_FLOATS, NeuralBrdf};
use crate::formats::read::read_bytes;

const FORMAT: &str = "Neural BRDF";

/// Limit on the size of a file; it holds more than a thousand materials.
const MAX_BYTES: u64 = 1 << 24;

/// How much of a file tells whether it is such a table.
const HEAD_BYTES: u64 = 4096;

/// The columns after `material`, in the order of [`NeuralBrdf::new`].
fn columns() -> Vec<String> {
    let matrix = |name: &'static str, rows: usize, columns: usize| {
        (0..rows).flat_map(move |i| (0..columns).map(move |j| format!("{name}_{i}_{j}")))
    };
    let offsets = |name: &'static str, count: usize| (0..count).map(move |j| format!("{name}_{j}"));
    matrix("w1", 6, 21)
        .chain(offsets("b1", 21))
        .chain(matrix("w2", 21, 21))
        .chain(offsets("b2", 21))
        .chain(matrix("w3", 21, 3))
        .chain(offsets("b3", 3))
        .collect()
}

/// Whether a file starts like a table of Neural BRDF weights. A file that cannot be read does not.
#[must_use]
pub fn is_neural_csv(path: impl AsRef<Path>) -> bool {
    let mut head = Vec::new();
    let start = std::fs::File::open(path).and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head));
    start.is_ok()
        && String::from_utf8_lossy(&head).lines().next().is_some_and(|line| {
            let mut names = line.split(',').map(str::trim);
            names.any(|name| name == "material") && names.any(|name| name == "w1_0_0")
        })
}

/// Reads a CSV file of Neural BRDF fits with one row per material. The column `material` and the 675 columns
/// `w1_0_0` to `b3_2` are found by their names. Returns names and networks in the order of the rows.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read; [`Error::Format`] when a column is missing, a value is not a
/// finite number, or there is no row.
pub fn read_neural_csv(path: impl AsRef<Path>) -> Result<Vec<(String, NeuralBrdf)>> {
    let path = path.as_ref();
    let bytes = read_bytes(path, FORMAT, MAX_BYTES)?;
    let bad = |expected: String, found: String| Error::Format {
        format: FORMAT,
        path: path.to_owned(),
        expected,
        found,
    };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes.as_slice());
    let header = reader.headers().map_err(|e| bad("a header line".into(), e.to_string()))?.clone();
    let place = |name: &str| {
        let found = header.iter().position(|column| column == name);
        found.ok_or_else(|| bad(format!("a column {name}"), format!("{} columns without it", header.len())))
    };
    let material = place("material")?;
    let places = columns().iter().map(|name| place(name)).collect::<Result<Vec<_>>>()?;
    let mut fits = Vec::new();
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(|e| bad("rows as long as the header".into(), e.to_string()))?;
        let mut weights = Vec::with_capacity(NEURAL_FLOATS);
        for &place in &places {
            let text = record.get(place).unwrap_or("");
            let value = text.parse::<f64>().ok().filter(|x| x.is_finite());
            let said = || bad("finite numbers".into(), format!("\"{text}\" in row {}", row + 1));
            weights.push(value.ok_or_else(said)?);
        }
        let name = record.get(material).unwrap_or("").to_owned();
        fits.push((name, NeuralBrdf::new(weights)?));
    }
    if fits.is_empty() {
        return Err(bad("at least one row of weights".into(), "none".into()));
    }
    Ok(fits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Brdf;
    use crate::formats::source::Source;
    use crate::test_data::data_dir;

    #[test]
    fn columns_are_found_by_name_and_bad_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("n.csv");
        let names = columns();
        let values: Vec<String> = (0..names.len()).map(|i| format!("{}", i as f64 / 1000.0)).collect();
        std::fs::write(&path, format!("{},material\n{},x\n", names.join(","), values.join(","))).unwrap();
        let fits = read_neural_csv(&path).unwrap();
        let expected = NeuralBrdf::new((0..names.len()).map(|i| i as f64 / 1000.0).collect()).unwrap();
        assert_eq!(fits, [("x".to_owned(), expected)]);
        for (text, said) in [
            ("material,w1_0_0\nx,1\n".to_owned(), "a column w1_0_1"),
            (format!("material,{}\n", names.join(",")), "at least one row"),
            (format!("material,{}\nx,nan{}\n", names.join(","), ",0".repeat(674)), "\"nan\" in row 1"),
            (format!("material,{}\nx,1\n", names.join(",")), "rows as long as the header"),
        ] {
            std::fs::write(&path, text).unwrap();
            let message = read_neural_csv(&path).unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
        }
        assert!(read_neural_csv(folder.path().join("absent.csv")).is_err());
    }

    #[test]
    fn published_fits_are_near_their_measurements() {
        let Some(dir) = data_dir() else { return };
        let fits = read_neural_csv(dir.join("rgl/nbrdf_weights.csv")).unwrap();
        let fit = &fits.iter().find(|(name, _)| name.starts_with("paper_blue")).unwrap().1;
        let source = Source::open(dir.join("rgl/paper_blue_rgb.bsdf")).unwrap();
        let truth = source.brdf().unwrap();
        for theta_h in [0.1, 0.4, 0.8] {
            let angles = crate::HalfDiff { theta_h, theta_d: 0.3, phi_d: 1.5 };
            let (a, b) = (fit.eval_half_diff(angles), truth.eval_half_diff(angles));
            (0..3).for_each(|c| assert!((a[c] / b[c]).ln().abs() < 0.3, "{a:?} {b:?}"));
        }
    }
}
