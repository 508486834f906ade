//! Functions of one coordinate as piecewise cubics.

use gpbrdf_core::gp::SeparableForm;
use rayon::prelude::*;

use crate::gpu_types::narrow;

/// Largest error of a cubic, as a share of the largest value of its function.
const TOLERANCE: f64 = 4e-6;
/// Largest error of the residual deviation, as a share of the prior one.
const DEVIATION_TOLERANCE: f64 = 2e-5;
/// The numbers of pieces between two breaks, both even: the first that is tried, and the largest.
const FEWEST_PIECES: usize = 4;
const MOST_PIECES: usize = 64;
/// The places of a piece where its cubic interpolates.
const NODES: [f64; 4] = [0.0, 0.25, 0.75, 1.0];
/// The places of a piece where its cubic is checked.
const CHECKS: [f64; 3] = [0.1, 0.5, 0.9];

/// All functions of the second axis of a process, and its residual deviation, over `[0, 1]`.
///
/// The functions are smooth between nodes and may have kinks at nodes. Intervals therefore end at the nodes,
/// and each interval is cut into as many pieces as the tolerances require.
///
/// At a small distance `s` from a node, a kernel of smoothness `nu` behaves like `s^(2 nu)` and the
/// deviation, the root of the residual variance, like `s^nu`, but at most like `s`. No polynomial in `s`
/// follows such a power. Pieces are therefore equally long, and cubics are polynomials, in a graded
/// coordinate `q`: `s = 2 q^2` in the first half of an interval and `1 - s = 2 (1 - q)^2` in the second half.
/// There the powers become `q^(4 nu)` and `q^(2 nu)`.
#[derive(Clone, Debug)]
pub(super) struct AxisTable {
    /// Ends of the intervals, ascending.
    pub(super) breaks: Vec<f32>,
    /// Pieces of each interval, an even number.
    pub(super) pieces: usize,
    /// `[interval][piece][function, then the residual deviation]`: the coefficients of 1, x, x^2, x^3, where
    /// x is the place in the piece, from 0 to 1 and linear in `q`.
    pub(super) cubics: Vec<[f32; 4]>,
    /// Prior variance, which is the same everywhere.
    pub(super) prior: f64,
}

impl AxisTable {
    /// Tabulates the functions of the second axis, whose nodes are at `nodes`, with about as few pieces as the
    /// tolerances allow.
    pub(super) fn new(form: &SeparableForm<'_>, nodes: &[f64]) -> Self {
        let breaks = breaks(nodes);
        let mut pieces = FEWEST_PIECES;
        loop {
            let fit = Fit::new(form, &breaks, pieces);
            let excess = fit.excess();
            if excess <= 1.0 || pieces >= MOST_PIECES {
                return Self {
                    breaks: breaks.into_iter().map(narrow).collect(),
                    pieces,
                    cubics: fit.cubics,
                    prior: fit.prior,
                };
            }
            pieces = more_pieces(pieces, excess);
        }
    }
}

/// The number of pieces for which the largest error, which is larger than allowed by the factor `excess`, is expected
/// to be small enough: that of a cubic falls with the fourth power.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 1 and the largest number"
)]
fn more_pieces(pieces: usize, excess: f64) -> usize {
    let wanted = 1.05 * pieces as f64 * excess.powf(0.25);
    let half = (0.5 * wanted.min(MOST_PIECES as f64)).ceil() as usize;
    (2 * half).clamp(pieces + 2, MOST_PIECES)
}

/// The ends of intervals: 0, the nodes between, and 1.
fn breaks(nodes: &[f64]) -> Vec<f64> {
    let mut breaks: Vec<f64> = nodes.iter().copied().filter(|x| (1e-6..1.0 - 1e-6).contains(x)).collect();
    breaks.extend([0.0, 1.0]);
    breaks.sort_by(f64::total_cmp);
    breaks.dedup_by(|b, a| *b - *a < 1e-6);
    breaks
}

/// Cubics for a number of pieces, and how far they are off.
struct Fit {
    /// `[interval][piece][function, then the residual deviation]`.
    cubics: Vec<[f32; 4]>,
    prior: f64,
    /// The largest value of each function, then that of the residual deviation, at the points of [`CHECKS`].
    largest: Vec<f64>,
    /// The largest errors there.
    error: Vec<f64>,
}

impl Fit {
    fn new(form: &SeparableForm<'_>, breaks: &[f64], pieces: usize) -> Self {
        let at = [&NODES[..], &CHECKS].concat();
        let basis = form.basis(1, &points(breaks, pieces, &at));
        let count = form.shape()[1];
        // What is known of some pieces: their cubics, the largest values and the largest errors.
        let of_pieces = |values: &[f64], residual: &[f64], cubics: &mut [[f32; 4]]| {
            let (mut largest, mut error) = (vec![0.0f64; count + 1], vec![0.0f64; count + 1]);
            let pieces = values.chunks(count * at.len()).zip(residual.chunks(at.len()));
            for ((values, residual), cubics) in pieces.zip(cubics.chunks_mut(count + 1)) {
                for (f, out) in cubics.iter_mut().enumerate() {
                    let value = |k: usize| if f < count { values[k * count + f] } else { residual[k].sqrt() };
                    let [a, b, c, d] = cubic([0, 1, 2, 3].map(value));
                    for (k, x) in (NODES.len()..).zip(CHECKS) {
                        let value = value(k);
                        largest[f] = largest[f].max(value.abs());
                        error[f] = error[f].max((a + x * (b + x * (c + x * d)) - value).abs());
                    }
                    *out = [a, b, c, d].map(narrow);
                }
            }
            [largest, error]
        };
        let mut cubics = vec![[0.0; 4]; (count + 1) * pieces * (breaks.len() - 1)];
        let intervals = (basis.values.par_chunks(count * at.len() * pieces))
            .zip(basis.residual.par_chunks(at.len() * pieces))
            .zip(cubics.par_chunks_mut((count + 1) * pieces));
        let larger = |a: &mut Vec<f64>, b: Vec<f64>| a.iter_mut().zip(b).for_each(|(a, b)| *a = a.max(b));
        let nothing = || [vec![0.0; count + 1], vec![0.0; count + 1]];
        let [largest, error] = intervals
            .map(|((values, residual), cubics)| of_pieces(values, residual, cubics))
            .reduce(nothing, |[mut largest, mut error], [other_largest, other_error]| {
                larger(&mut largest, other_largest);
                larger(&mut error, other_error);
                [largest, error]
            });
        Self { cubics, prior: basis.prior.first().copied().unwrap_or(0.0), largest, error }
    }

    /// The largest error relative to what is allowed.
    fn excess(&self) -> f64 {
        let Some((deviation, errors)) = self.error.split_last() else { return 0.0 };
        let of_functions = errors.iter().zip(&self.largest).filter(|(error, _)| **error > 0.0);
        of_functions
            .map(|(error, largest)| error / (TOLERANCE * largest))
            .fold(deviation / (DEVIATION_TOLERANCE * self.prior.sqrt()), f64::max)
    }
}

/// The points at the places `at` of all pieces of all intervals.
fn points(breaks: &[f64], pieces: usize, at: &[f64]) -> Vec<f64> {
    let mut points = Vec::with_capacity(at.len() * pieces * breaks.len());
    for ends in breaks.windows(2) {
        for piece in 0..pieces {
            let share = |x: f64| graded((piece as f64 + x) / pieces as f64);
            points.extend(at.iter().map(|&x| ends[0] + (ends[1] - ends[0]) * share(x)));
        }
    }
    points
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
    fn more_pieces_are_an_even_number_up_to_the_largest() {
        // 16 times the error allowed takes twice as many, and 5 % for safety.
        assert_eq!(more_pieces(4, 16.0), 10);
        assert_eq!(more_pieces(10, 1.001), 12);
        assert_eq!(more_pieces(62, 1e9), MOST_PIECES);
        assert_eq!(more_pieces(4, f64::INFINITY), MOST_PIECES);
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
