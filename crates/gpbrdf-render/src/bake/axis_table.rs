//! Functions of one coordinate as piecewise cubics.

use gpbrdf_core::SeparableForm;

use super::narrow;

/// Largest error of a cubic, as a share of the largest value of its function.
const TOLERANCE: f64 = 4e-6;
/// Largest error of the residual deviation, as a share of the prior one.
const DEVIATION_TOLERANCE: f64 = 2e-5;
/// Most cubics between two breaks.
const MOST_PIECES: usize = 64;
/// Where each cubic interpolates.
const NODES: [f64; 4] = [0.0, 0.25, 0.75, 1.0];
/// Where it is checked.
const CHECKS: [f64; 3] = [0.1, 0.5, 0.9];

/// All functions of the second axis of a process, and its residual deviation, over `[0, 1]`.
///
/// Between nodes they are smooth, at nodes they may have kinks; so the intervals end at the nodes, and each is cut into as
/// many pieces as the tolerances ask for. A kernel of smoothness `nu` goes like `s^(2 nu)` at a distance `s` from a node and
/// the deviation, the root of the residual variance, like `s^nu` (at most `s`), which no polynomial in `s` follows. Pieces
/// and cubics are therefore even in `q` with `s = 2 q^2` in the first half of an interval and `1 - s = 2 (1 - q)^2` in the
/// second: `q^(4 nu)` and `q^(2 nu)`.
#[derive(Clone, Debug)]
pub(super) struct AxisTable {
    /// Ends of the intervals, ascending.
    pub(super) breaks: Vec<f32>,
    /// Cubics in each interval, an even number.
    pub(super) pieces: usize,
    /// `[interval][piece][function, then the residual deviation]`: the coefficients of 1, x, x^2, x^3 over a piece's
    /// `[0, 1]` in `q`.
    pub(super) cubics: Vec<[f32; 4]>,
    /// Prior variance, the same everywhere.
    pub(super) prior: f64,
}

impl AxisTable {
    /// Tabulates the second axis, whose nodes stand at `nodes`.
    pub(super) fn new(form: &SeparableForm<'_>, nodes: &[f64]) -> Self {
        let mut breaks: Vec<f64> = nodes.iter().copied().filter(|x| (1e-6..1.0 - 1e-6).contains(x)).collect();
        breaks.extend([0.0, 1.0]);
        breaks.sort_by(f64::total_cmp);
        breaks.dedup_by(|b, a| *b - *a < 1e-6);
        let mut pieces = 4;
        loop {
            let points = |at: &[f64]| -> Vec<f64> {
                let mut out = Vec::with_capacity(at.len() * pieces * breaks.len());
                for ends in breaks.windows(2) {
                    for piece in 0..pieces {
                        let share = |x: f64| graded((piece as f64 + x) / pieces as f64);
                        out.extend(at.iter().map(|&x| ends[0] + (ends[1] - ends[0]) * share(x)));
                    }
                }
                out
            };
            let functions = |at: &[f64]| {
                let basis = form.basis(1, &points(at));
                let rows = basis.values.chunks(form.shape()[1]).zip(&basis.residual);
                let rows: Vec<Vec<f64>> = rows
                    .map(|(row, residual)| row.iter().copied().chain([residual.sqrt()]).collect())
                    .collect();
                (rows, basis.prior)
            };
            let (values, prior) = functions(&NODES);
            let prior = prior.first().copied().unwrap_or(0.0);
            let cubics: Vec<Vec<[f64; 4]>> = values
                .chunks(NODES.len())
                .map(|rows| (0..rows[0].len()).map(|f| cubic([0, 1, 2, 3].map(|n| rows[n][f]))).collect())
                .collect();
            let (checks, _) = functions(&CHECKS);
            let deviation = form.shape()[1];
            let mut largest = vec![0.0f64; deviation + 1];
            let mut error = largest.clone();
            for (cubics, rows) in cubics.iter().zip(checks.chunks(CHECKS.len())) {
                for (row, x) in rows.iter().zip(CHECKS) {
                    for (f, value) in row.iter().enumerate() {
                        let [a, b, c, d] = cubics[f];
                        let found = a + x * (b + x * (c + x * d));
                        largest[f] = largest[f].max(value.abs());
                        error[f] = error[f].max((found - value).abs());
                    }
                }
            }
            let good =
                error[..deviation].iter().zip(&largest).all(|(error, largest)| *error <= TOLERANCE * largest)
                    && error[deviation] <= DEVIATION_TOLERANCE * prior.sqrt();
            if good || pieces >= MOST_PIECES {
                return Self {
                    breaks: breaks.into_iter().map(narrow).collect(),
                    pieces,
                    cubics: cubics.into_iter().flatten().map(|cubic| cubic.map(narrow)).collect(),
                    prior,
                };
            }
            pieces *= 2;
        }
    }
}

/// The place in an interval, `s`, of the graded coordinate `q`; both in `[0, 1]`.
fn graded(q: f64) -> f64 {
    if q < 0.5 { 2.0 * q * q } else { 1.0 - 2.0 * (1.0 - q) * (1.0 - q) }
}

/// The coefficients of the cubic through `values` at [`NODES`], by divided differences.
fn cubic(values: [f64; 4]) -> [f64; 4] {
    let mut d = values;
    for order in 1..4 {
        for k in (order..4).rev() {
            d[k] = (d[k] - d[k - 1]) / (NODES[k] - NODES[k - order]);
        }
    }
    // Newton's form to powers: multiply out from the highest factor down.
    let mut powers = [d[3], 0.0, 0.0, 0.0];
    for k in (0..3).rev() {
        for n in (1..4).rev() {
            powers[n] = powers[n - 1] - NODES[k] * powers[n];
        }
        powers[0] = d[k] - NODES[k] * powers[0];
    }
    powers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn graded_places_ascend_from_end_to_end() {
        let places: Vec<f64> = (0..=64).map(|k| graded(f64::from(k) / 64.0)).collect();
        assert!(places.windows(2).all(|ends| ends[0] < ends[1]), "{places:?}");
        assert_eq!([places[0], places[32], places[64]], [0.0, 0.5, 1.0]);
    }

    #[test]
    fn cubics_are_reproduced() {
        let f = |x: f64| 2.0 - x + 3.0 * x * x - 0.5 * x * x * x;
        let found = cubic(NODES.map(f));
        for (found, expected) in found.into_iter().zip([2.0, -1.0, 3.0, -0.5]) {
            assert!((found - expected).abs() < 1e-13, "{found} {expected}");
        }
    }
}
