//! Numbers as people and programs write them.

/// The decimal marks that the numbers of a file have.
#[derive(Debug, Default)]
pub(crate) struct Marks {
    /// The first number with a decimal comma, and its line.
    comma: Option<(String, u64)>,
    /// The first number with a decimal point, and its line.
    point: Option<(String, u64)>,
    /// Whether a comma is certain to be a decimal mark and not to part thousands.
    certain: bool,
}

impl Marks {
    /// The finite number that a field is. Where commas part the columns, no field has one.
    ///
    /// Accepted are a decimal point, a decimal comma, the minus sign of typography and the exponents of
    /// Fortran (`1.5D-3`). Signs that part thousands are not.
    pub(crate) fn parse(&mut self, field: &str, line: u64, bounded: bool) -> Option<f64> {
        let plain;
        let mut text = field;
        if text.contains(['\u{2212}', 'd', 'D', ',']) {
            plain = text.replace('\u{2212}', "-").replace(['d', 'D'], "e");
            text = &plain;
        }
        let with_point;
        let decimal = text.contains('.');
        if let Some((whole, part)) = text.split_once(',') {
            if decimal || part.contains(',') {
                return None;
            }
            with_point = format!("{whole}.{part}");
            let value = finite(&with_point)?;
            if self.comma.is_none() {
                self.comma = Some((field.to_owned(), line));
            }
            let digits = whole.trim_start_matches(['-', '+']);
            let could_part = part.len() == 3 && (1..=3).contains(&digits.len()) && !digits.starts_with('0');
            self.certain |= bounded || !could_part;
            return Some(value);
        }
        let value = finite(text)?;
        if decimal && self.point.is_none() {
            self.point = Some((field.to_owned(), line));
        }
        Some(value)
    }

    /// Why the numbers that were parsed are not certain: what was expected and what was found.
    pub(crate) fn doubt(&self) -> Option<(String, String)> {
        let (comma, at) = self.comma.as_ref()?;
        if let Some((point, line)) = &self.point {
            let found = format!("`{comma}` on line {at} and `{point}` on line {line}");
            return Some(("one decimal mark in all numbers".to_owned(), found));
        }
        (!self.certain).then(|| {
            let expected = "numbers whose commas are certain to be decimal marks".to_owned();
            (expected, format!("`{comma}` on line {at}, whose comma may part thousands"))
        })
    }
}

/// Whether a field is a number in any notation, also one that is not finite.
pub(crate) fn is_number(field: &str) -> bool {
    field.parse::<f64>().is_ok() || Marks::default().parse(field, 0, true).is_some()
}

fn finite(text: &str) -> Option<f64> {
    text.parse::<f64>().ok().filter(|value| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notations_are_understood() {
        let mut marks = Marks::default();
        let mut parse = |text: &str| marks.parse(text, 1, false);
        assert_eq!(parse("1.5"), Some(1.5));
        assert_eq!(parse("+1.5e-3"), Some(0.0015));
        assert_eq!(parse("1.5D-03"), Some(0.0015));
        assert_eq!(parse("\u{2212}2"), Some(-2.0));
        assert_eq!(parse(".5"), Some(0.5));
        for bad in ["", "1.234,5", "1,234,567", "1 000", "nan", "inf", "-", "x", "5 %", "d", "1'000"] {
            assert_eq!(parse(bad), None, "{bad}");
        }
        assert_eq!(marks.doubt(), None);
    }

    #[test]
    fn doubtful_commas_are_found() {
        let doubt = |fields: &[(&str, bool)]| {
            let mut marks = Marks::default();
            for &(field, bounded) in fields {
                assert!(marks.parse(field, 7, bounded).is_some(), "{field}");
            }
            marks.doubt().map(|(_, found)| found)
        };
        assert_eq!(doubt(&[("1,25", false), ("3", false)]), None);
        assert_eq!(doubt(&[("10,000", true), ("1,237", false)]), None);
        assert_eq!(doubt(&[("0,125", false)]), None);
        let found = doubt(&[("10", true), ("1,237", false)]).unwrap();
        assert_eq!(found, "`1,237` on line 7, whose comma may part thousands");
        let found = doubt(&[("1,25", false), ("2.5", false)]).unwrap();
        assert_eq!(found, "`1,25` on line 7 and `2.5` on line 7");
    }
}
