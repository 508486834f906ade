//! Robust weights, which keep outliers from dominating a least-squares fit.
//!
//! A lattice with few nodes cannot follow every peak of a table, which leaves residuals with heavy tails. If
//! residuals are squared, the points on such peaks decide where nodes are placed, although the nodes are too
//! few to fit them.

/// Weights of one step of expectation maximisation for residuals that follow Student's t with one degree of
/// freedom, `w / (1 + r^2 / s^2)` (K. Lange, R. Little and J. Taylor, "Robust Statistical Modeling Using the
/// t Distribution", 1989), with `s^2` the median of the squared residuals `r^2`, which are given by
/// `squares`.
///
/// `shown` is the part of each weight that is kept. The remainder is reduced as above and then rescaled so
/// that its total is unchanged.
pub(crate) fn heavy_tailed_weights(weights: &[f64], shown: &[f64], squares: &[f64]) -> Vec<f64> {
    let counted = squares.iter().zip(weights).filter(|(_, weight)| **weight > 0.0);
    let mut sorted: Vec<f64> = counted.map(|(square, _)| *square).collect();
    if sorted.is_empty() {
        return weights.to_vec();
    }
    let middle = sorted.len() / 2;
    let scale = sorted.select_nth_unstable_by(middle, f64::total_cmp).1.max(1e-24);
    let points = weights.iter().zip(shown).zip(squares);
    let reduced: Vec<f64> =
        points.map(|((weight, shown), square)| (weight - shown).max(0.0) / (1.0 + square / scale)).collect();
    let before: f64 = weights.iter().zip(shown).map(|(weight, shown)| weight - shown).sum();
    let after: f64 = reduced.iter().sum();
    let factor = if after > 0.0 { before / after } else { 1.0 };
    reduced.iter().zip(shown).map(|(reduced, shown)| factor * reduced + shown).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_count_for_less_save_where_they_show() {
        let shown = [0.0, 0.0, 0.0, 0.0, 0.4];
        // The median of the squares, the scale, is 4.
        let weights = heavy_tailed_weights(&[1.0; 5], &shown, &[0.0, 1.0, 4.0, 100.0, 400.0]);
        let student = [1.0, 1.0 / 1.25, 0.5, 1.0 / 26.0, 0.6 / 101.0];
        let factor = 4.6 / student.iter().sum::<f64>();
        for (k, (found, student)) in weights.iter().zip(student).enumerate() {
            assert!((found - factor * student - shown[k]).abs() < 1e-14, "{k} {found}");
        }
    }
}
