//! Numbers written for people.

/// A number with `digits` significant digits: 1234 and 0.001234 for four of them. Sizes below 1e-3 or from
/// 1e5 on are written with an exponent, as in 1.234e-5. Zero is "0", infinity is "inf", and NaN is "NaN".
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    let after_the_first = digits.saturating_sub(1);
    if value != 0.0 && !(1e-3..1e5).contains(&value.abs()) {
        return format!("{value:.after_the_first$e}");
    }
    let size = if value == 0.0 { after_the_first as f64 } else { value.abs().log10().floor() };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few digits, at least 0")]
    let decimals = (after_the_first as f64 - size).max(0.0) as usize;
    format!("{value:.decimals$}")
}

/// [`significant`] without trailing zeros: 0.5 and 2e-5, not 0.500 and 2.00e-5.
#[must_use]
pub fn short(value: f64, digits: usize) -> String {
    let text = significant(value, digits);
    let (mantissa, exponent) = text.split_at(text.find('e').unwrap_or(text.len()));
    if mantissa.contains('.') {
        format!("{}{exponent}", mantissa.trim_end_matches('0').trim_end_matches('.'))
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_that_count_are_kept_and_zeros_trimmed() {
        for (value, four, trimmed) in [
            (0.0, "0", "0"),
            (1.0, "1.000", "1"),
            (0.5, "0.5000", "0.5"),
            (1234.56, "1235", "1235"),
            (-12.3, "-12.30", "-12.3"),
            (0.001_234_5, "0.001234", "0.001234"),
            (2e-5, "2.000e-5", "2e-5"),
            (1.23e7, "1.230e7", "1.23e7"),
            (f64::INFINITY, "inf", "inf"),
        ] {
            assert_eq!((significant(value, 4).as_str(), short(value, 4).as_str()), (four, trimmed));
        }
        assert_eq!(
            (short(40.0, 3), short(100.0, 3), short(0.029_96, 3)),
            ("40".into(), "100".into(), "0.03".into())
        );
    }
}
