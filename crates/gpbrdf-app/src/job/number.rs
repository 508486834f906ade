//! Numbers for people.

/// Four significant digits.
pub(crate) fn significant(x: f64) -> String {
    if x != 0.0 && !(1e-3..1e5).contains(&x.abs()) {
        return format!("{x:.3e}");
    }
    let digits = if x == 0.0 { 0.0 } else { (3.0 - x.abs().log10().floor()).max(0.0) };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 6")]
    let digits = digits as usize;
    format!("{x:.digits$}")
}
