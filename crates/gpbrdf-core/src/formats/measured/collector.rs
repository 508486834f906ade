//! From rows of any format to a set of samples: what is accepted, left out and converted.

use nalgebra::Vector3;

use crate::base::error::Result;
use crate::brdf::Rgb;
use crate::formats::measured::input::Input;
use crate::formats::measured::lines::Lines;
use crate::formats::measured::options::ValueKind;
use crate::sample::{Sample, SampleSet};

/// A negative value is taken as the noise of a dark signal down to this share of the largest value, but not
/// beyond the median.
const DARK_SHARE: f64 = 1e-3;
/// Or down to this share of the largest value, where the median is smaller: detectors do not resolve it.
const LEAST_SHARE: f64 = 1e-5;
/// Or down to this number of its own standard deviations.
const DARK_SIGMAS: f64 = 5.0;

/// A direction whose height is smaller is at the horizon, where a BRDF cannot be measured.
const HORIZON: f64 = 1e-12;
/// How far angles that are rounded may be below the horizon and still be at it.
const ROUNDING: f64 = 1e-5;

/// How uncertain a value is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sigma {
    /// The source does not say it.
    Unknown,
    /// The standard deviation of each channel in the unit of the value.
    Absolute(Rgb),
    /// The standard deviation as a share of the value.
    Relative(f64),
}

/// One row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) line: u64,
    pub(crate) wi: Vector3<f64>,
    pub(crate) wo: Vector3<f64>,
    /// In the unit of the file.
    pub(crate) value: Rgb,
    pub(crate) sigma: Sigma,
}

/// Collects rows.
#[derive(Debug)]
pub(crate) struct Collector<'a> {
    input: Input<'a>,
    kind: ValueKind,
    set: SampleSet,
    horizon: Lines,
    /// Negative numbers as they are in the file: line, number, standard deviation.
    negative: Vec<(u64, f64, f64)>,
    /// All positive numbers.
    positive: Vec<f64>,
    notices: Vec<String>,
}

impl<'a> Collector<'a> {
    /// Values are of the kind that the options say, else of the given one.
    pub(crate) fn new(input: Input<'a>, kind: ValueKind) -> Self {
        Self {
            kind: input.options.values.unwrap_or(kind),
            input,
            set: SampleSet::default(),
            horizon: Lines::default(),
            negative: Vec::new(),
            positive: Vec::new(),
            notices: Vec::new(),
        }
    }

    /// Adds something that the user should know.
    pub(crate) fn notice(&mut self, text: String) {
        self.notices.push(text);
    }

    /// Adds a row. `raw` are its numbers as they are in the file, of which `value` is made.
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format) for a direction below the horizon or a value beyond f32.
    pub(crate) fn push(&mut self, row: Row, raw: &[f64]) -> Result<()> {
        let Row { line, wi, wo, value, sigma } = row;
        let height = wi.z.min(wo.z);
        if height < -ROUNDING {
            return Err(self
                .input
                .wrong(format!("both directions above the horizon on line {line}"), "one below it"));
        }
        let sigma = match sigma {
            Sigma::Unknown => None,
            Sigma::Absolute(sigma) => Some(sigma),
            Sigma::Relative(share) => Some(value.map(|value| share * value.abs())),
        };
        if height <= HORIZON {
            self.horizon.push(line);
            return Ok(());
        }
        let raw_sigma = sigma.map_or(0.0, |sigma| sigma.into_iter().fold(0.0, f64::max));
        for &number in raw {
            if number < 0.0 {
                self.negative.push((line, number, raw_sigma));
            } else if number > 0.0 {
                self.positive.push(number);
            }
        }
        let scale = self.kind.to_brdf(wo.z);
        let value = value.map(|value| value * scale);
        let sigma = sigma.map(|sigma| sigma.map(|sigma| sigma * scale));
        let beyond = |x: &f64| !(x.abs() <= f64::from(f32::MAX));
        if let Some(found) = value.iter().chain(sigma.as_ref().into_iter().flatten()).find(|x| beyond(x)) {
            return Err(self
                .input
                .wrong(format!("a BRDF within the range of f32 on line {line}"), format!("{found:e}")));
        }
        self.set.push(Sample { wi, wo, value });
        self.set.lines.push(line);
        self.set.sigma.extend(sigma);
        Ok(())
    }

    /// The samples.
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format) if there are none, if some lack a standard deviation that others
    /// have, or if a negative value is too large to be noise.
    pub(crate) fn finish(mut self, description: String) -> Result<SampleSet> {
        self.check_negative()?;
        if self.horizon.count > 0 {
            let one = self.horizon.count == 1;
            self.notices.push(format!(
                "{} row{} {} a direction at the horizon, where no BRDF can be measured ({}); {} left out",
                self.horizon.count,
                if one { "" } else { "s" },
                if one { "has" } else { "have" },
                self.horizon.named(),
                if one { "it is" } else { "they are" },
            ));
        }
        if self.set.is_empty() {
            let found = if self.horizon.count > 0 { "rows at the horizon only" } else { "none" };
            return Err(self.input.wrong("at least one sample above the horizon", found));
        }
        if !self.set.sigma.is_empty() && self.set.sigma.len() != self.set.len() {
            return Err(self
                .input
                .wrong("a standard deviation in every row or in none", "some rows without"));
        }
        Ok(SampleSet { description, notices: self.notices, ..self.set })
    }

    /// Refuses negative values that are no noise, and says which ones are kept.
    fn check_negative(&mut self) -> Result<()> {
        if self.negative.is_empty() {
            return Ok(());
        }
        self.positive.sort_by(f64::total_cmp);
        let largest = self.positive.last().copied().unwrap_or(0.0);
        let median = self.positive.get(self.positive.len() / 2).copied().unwrap_or(0.0);
        let dark = (DARK_SHARE * largest).min(median.max(LEAST_SHARE * largest));
        let mut lines = Lines::default();
        let mut smallest = 0.0f64;
        for &(line, number, sigma) in &self.negative {
            let limit = -dark.max(DARK_SIGMAS * sigma);
            if number < limit {
                return Err(self.input.wrong(
                    format!(
                        "values of at least {limit} (noise of a dark signal) on line {line}, as {largest} is \
                         the largest"
                    ),
                    number.to_string(),
                ));
            }
            lines.push(line);
            smallest = smallest.min(number);
        }
        let one = lines.count == 1;
        self.notices.push(format!(
            "{} value{} negative, down to {smallest} ({}); {} kept as noise of a dark signal",
            lines.count,
            if one { " is" } else { "s are" },
            lines.named(),
            if one { "it is" } else { "they are" },
        ));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::brdf::angles::direction;
    use crate::formats::measured::ReadOptions;

    fn collect(options: ReadOptions, rows: &[(f64, f64, Sigma)]) -> Result<SampleSet, String> {
        let input = Input { format: "test", path: Path::new("x"), bytes: b"", options: &options };
        let mut collector = Collector::new(input, ValueKind::Brdf);
        for (line, &(theta, value, sigma)) in (1..).zip(rows) {
            let row =
                Row { line, wi: direction(0.1, 0.0), wo: direction(theta, 1.0), value: [value; 3], sigma };
            collector.push(row, &[value]).map_err(|e| e.to_string())?;
        }
        collector.finish(String::new()).map_err(|e| e.to_string())
    }

    #[test]
    fn values_of_every_kind_become_the_brdf() {
        let rows = [(1.0, 2.0, Sigma::Absolute([0.5; 3])), (0.5, 4.0, Sigma::Absolute([1.0; 3]))];
        for (kind, scale) in [
            (ValueKind::Brdf, [1.0, 1.0]),
            (ValueKind::Cosine, [1.0 / 1f64.cos(), 1.0 / 0.5f64.cos()]),
            (ValueKind::Factor, [std::f64::consts::FRAC_1_PI; 2]),
        ] {
            let options = ReadOptions { values: Some(kind), ..ReadOptions::default() };
            let found = collect(options, &rows).unwrap();
            for i in 0..2 {
                assert!((found.values[i][1] - rows[i].1 * scale[i]).abs() < 1e-12, "{kind:?}");
                assert!((found.sigma[i][2] - 0.25 * rows[i].1 * scale[i]).abs() < 1e-12, "{kind:?}");
            }
            assert_eq!((found.lines.as_slice(), found.notices.len()), (&[1, 2][..], 0));
        }
        let found = collect(ReadOptions::default(), &[(0.1, 5.0, Sigma::Relative(0.02))]).unwrap();
        assert!((found.sigma[0][0] - 0.1).abs() < 1e-15);
    }

    #[test]
    fn noise_is_kept_and_large_negative_values_are_refused() {
        let rows = |dark: f64, sigma| [(0.1, 10.0, sigma), (0.2, dark, sigma), (0.3, 1.0, sigma)];
        let found = collect(ReadOptions::default(), &rows(-0.009, Sigma::Unknown)).unwrap();
        assert_eq!(found.values[1], [-0.009; 3]);
        let said = "1 value is negative, down to -0.009 (line 2); it is kept as noise of a dark signal";
        assert_eq!(found.notices, [said]);
        let found = collect(ReadOptions::default(), &rows(-0.02, Sigma::Unknown)).unwrap_err();
        assert!(
            found.contains("at least -0.01 (noise of a dark signal) on line 2") && found.contains("-0.02")
        );
        assert!(collect(ReadOptions::default(), &rows(-0.02, Sigma::Absolute([0.005; 3]))).is_ok());
        // One bright peak says little about the noise of dark values.
        let peak = |dark: f64| {
            let rows = [(0.1, 1e5), (0.2, 0.02), (0.3, 0.01), (0.4, dark)];
            collect(ReadOptions::default(), &rows.map(|(theta, value)| (theta, value, Sigma::Unknown)))
        };
        assert!(peak(-0.5).is_ok() && peak(-50.0).is_err());
    }

    #[test]
    fn rows_at_the_horizon_are_left_out() {
        let at = std::f64::consts::FRAC_PI_2;
        let found = collect(ReadOptions::default(), &[(at, 1.0, Sigma::Unknown), (0.3, 2.0, Sigma::Unknown)])
            .unwrap();
        assert_eq!((found.len(), found.lines[0], found.values[0]), (1, 2, [2.0; 3]));
        assert!(found.notices[0].starts_with("1 row has a direction at the horizon"), "{:?}", found.notices);
        assert!(collect(ReadOptions::default(), &[(at, 1.0, Sigma::Unknown)]).is_err());
        let below = collect(ReadOptions::default(), &[(at + 0.01, 1.0, Sigma::Unknown)]).unwrap_err();
        assert!(below.ends_with("on line 1, found one below it"), "{below}");
    }
}
