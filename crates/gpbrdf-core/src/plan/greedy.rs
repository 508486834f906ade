//! The greedy choice of the next directions.

use rayon::prelude::*;

use super::belief::{Belief, Places};
use super::candidates::Candidates;
use super::cells::Cells;
use super::device::Geometry;
use crate::base::error::{Error, Result};
use crate::base::linalg::{factorize, product_into_slice, solve_lower, view_slice};
use crate::base::random::golden_ratio_subset;
use crate::base::simd::{add_scaled, dot, dot3, scale_in_place};
use crate::brdf::angles::HalfDiff;
use crate::kernel::RowScratch;

/// The largest number of measured directions that a plan takes into account; of more, as many are taken, spread evenly.
pub const MOST_MEASURED: usize = 2000;

/// The most directions of a plan that goes on until an error is reached.
const MOST_CHOSEN: usize = 1000;

/// Number of columns of a parallel task.
const BLOCK: usize = 32;

/// When a plan ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// With this number of directions.
    Count(usize),
    /// With the expected error, in units of `ln f`.
    Error(f64),
}

/// Directions to measure next.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The directions, the most telling first.
    pub geometries: Vec<Geometry>,
    /// The expected error after none, one, two and all of them: the root of the weighted mean of the variance of
    /// `ln f`, mean of the channels, over the cells.
    pub errors: Vec<f64>,
}

/// Chooses directions among `candidates` one by one. With `C` the covariance given all measurements and choices so far
/// and `s` the noise variance, the next one, `j`, has the largest `sum_i w_i C_ij^2 / (C_jj + s)` over the cells `i`:
/// what it takes from the weighted variance of the cells. With a learned prior variances of highlights count more here
/// than it says itself, though not in [`Plan::errors`]. Cells of highlights count where the belief allows for sharp
/// ones only, and once [`Candidates::FEW`] directions are measured mostly by the energy that its model reflects there.
///
/// Source: A. Krause, A. Singh and C. Guestrin, "Near-Optimal Sensor Placements in Gaussian Processes" (JMLR 9, 2008)
/// for greedy choices; the criterion is that of D. A. Cohn, Z. Ghahramani and M. I. Jordan, "Active Learning with
/// Statistical Models" (JAIR 4, 1996), section 4, with weights.
///
/// Cost: for `c` cells, `m` candidates, `n` measurements and `k` choices `O(n^3 / 3 + n^2 (c + m) + (n + k) c m)`, and
/// `8 c m` bytes. The result does not depend on the number of threads.
///
/// # Errors
/// No candidates or cells, a count above the number of candidates, an error that is not reached, and a covariance of
/// the measurements that is not positive definite.
pub fn plan(
    belief: &Belief,
    measured: &[HalfDiff],
    candidates: &Candidates,
    cells: &Cells,
    goal: Goal,
) -> Result<Plan> {
    if candidates.is_empty() || cells.is_empty() {
        let found = format!("{} and {}", candidates.len(), cells.len());
        return Err(Error::argument("candidates and cells of a plan", "at least one each", found));
    }
    if let Goal::Error(error) = goal
        && !(error > 0.0 && error.is_finite())
    {
        return Err(Error::argument("error of a plan", "a positive number", error));
    }
    let cells = &*cells.of_material(&belief.highlights, measured.len());
    let few = if belief.may_be_sharp() { Candidates::FEW.saturating_sub(measured.len()) } else { usize::MAX };
    let mut found = Plan { geometries: Vec::new(), errors: Vec::new() };
    if few > 0 && !candidates.coarse.is_empty() {
        found.extend(State::new(belief, measured, &candidates.coarse, cells)?, &candidates.coarse, goal, few);
    }
    let is_new = |geometry: &Geometry| !found.geometries.iter().any(|chosen| chosen.is_at(*geometry));
    let others: Vec<Geometry> = candidates.all.iter().copied().filter(is_new).collect();
    let available = found.geometries.len() + others.len();
    if let Goal::Count(count) = goal
        && count > available
    {
        let expected = format!("at most {available}, the directions to choose from");
        return Err(Error::argument("number of directions to plan", expected, count));
    }
    if !found.reaches(goal) {
        let known: Vec<HalfDiff> = measured
            .iter()
            .copied()
            .chain(found.geometries.iter().map(|geometry| geometry.angles()))
            .collect();
        // The error of the state is that of the last one but for rounding.
        found.errors.pop();
        found.extend(State::new(belief, &known, &others, cells)?, &others, goal, usize::MAX);
    }
    match goal {
        Goal::Error(goal) if !found.reaches(Goal::Error(goal)) => {
            let count = found.geometries.len();
            let expected = format!("at least {:.4}, which {count} directions reach", found.errors[count]);
            Err(Error::argument("error of a plan", expected, goal))
        }
        _ => Ok(found),
    }
}

impl Plan {
    /// Whether it ends here; a plan without the error of its beginning does not.
    fn reaches(&self, goal: Goal) -> bool {
        let Some(error) = self.errors.last() else { return false };
        match goal {
            Goal::Count(count) => self.geometries.len() >= count,
            Goal::Error(goal) => *error <= goal,
        }
    }

    /// Chooses the next directions, at most until there are `most` of them, beginning with the error before them.
    fn extend(&mut self, mut state: State<'_>, candidates: &[Geometry], goal: Goal, most: usize) {
        let most = match goal {
            Goal::Count(count) => count.min(most),
            Goal::Error(_) => MOST_CHOSEN.min(most),
        };
        self.errors.push(state.error());
        while self.geometries.len() < most && !self.reaches(goal) {
            let Some(best) = state.best() else { break };
            state.choose(best);
            self.geometries.push(candidates[best]);
            self.errors.push(state.error());
        }
    }
}

/// The expected error after measurements, as in [`Plan::errors`].
///
/// # Errors
/// No cells, and a covariance of the measurements that is not positive definite.
pub fn expected_error(belief: &Belief, measured: &[HalfDiff], cells: &Cells) -> Result<f64> {
    if cells.is_empty() {
        return Err(Error::argument("cells of a plan", "at least one", 0));
    }
    let cells = cells.of_material(&belief.highlights, measured.len());
    Ok(State::new(belief, measured, &[], &cells)?.error())
}

/// The covariance given measurements and choices.
struct State<'a> {
    belief: &'a Belief,
    /// Weights of the cells, times what the variance of each is larger than the process says: in the choice, and in the
    /// expected error.
    weights: Vec<f64>,
    of_error: Vec<f64>,
    places: Places,
    /// Covariance of cells and candidates, one column of cells per candidate.
    covariance: Vec<f64>,
    /// Variances of cells and of candidates.
    of_cells: Vec<f64>,
    of_candidates: Vec<f64>,
    /// For each candidate the numbers whose products with those of another are what is taken from their covariance.
    taken: Vec<Vec<f64>>,
    /// What each candidate takes from the weighted variance, times its own variance with noise.
    scores: Vec<f64>,
    is_chosen: Vec<bool>,
}

impl<'a> State<'a> {
    fn new(
        belief: &'a Belief,
        measured: &[HalfDiff],
        candidates: &[Geometry],
        cells: &'a Cells,
    ) -> Result<Self> {
        let angles: Vec<HalfDiff> = candidates.iter().map(|geometry| geometry.angles()).collect();
        let (places, at_cells) = (belief.places(&angles), belief.places(&cells.angles));
        let mut covariance = belief.covariance(&at_cells, &places);
        let mut of_cells = belief.variances(&at_cells);
        let mut of_candidates = belief.variances(&places);
        let mut taken = vec![Vec::new(); candidates.len()];
        if !measured.is_empty() {
            let known = belief.places(&thinned(measured));
            let n = known.len();
            let mut factor = belief.covariance(&known, &known);
            factor.iter_mut().step_by(n + 1).for_each(|diagonal| *diagonal += belief.noise_variance);
            if !factorize(&mut factor, n) {
                let largest_jitter = belief.noise_variance;
                return Err(Error::NotPositiveDefinite { size: n, largest_jitter });
            }
            let whitened = |places: &Places| {
                let mut columns = belief.covariance(&known, places);
                columns.par_chunks_mut(n * BLOCK).for_each(|columns| solve_lower(&factor, n, columns));
                columns
            };
            let (from_cells, from_candidates) = (whitened(&at_cells), whitened(&places));
            let square = |column: &[f64]| dot(column, column);
            of_cells.iter_mut().zip(from_cells.chunks(n)).for_each(|(v, column)| *v -= square(column));
            of_candidates
                .iter_mut()
                .zip(from_candidates.chunks(n))
                .for_each(|(v, column)| *v -= square(column));
            let left = view_slice(&from_cells, n, cells.len()).transpose();
            let blocks = covariance.par_chunks_mut(cells.len() * BLOCK);
            blocks.zip(from_candidates.par_chunks(n * BLOCK)).for_each(|(out, columns)| {
                let mut part = vec![0.0; out.len()];
                product_into_slice(&mut part, left, view_slice(columns, n, columns.len() / n));
                add_scaled(-1.0, &part, out);
            });
            taken = from_candidates.chunks(n).map(<[f64]>::to_vec).collect();
        }
        let weighted = |factors: Vec<f64>| -> Vec<f64> {
            cells.weights.iter().zip(factors).map(|(w, factor)| w * factor).collect()
        };
        let weights = weighted(belief.emphasis(&cells.angles));
        let of_error = weighted(belief.calibration(&cells.angles));
        let scores =
            covariance.par_chunks(cells.len()).map(|column| dot3(&weights, column, column)).collect();
        let is_chosen = vec![false; candidates.len()];
        Ok(Self {
            belief,
            weights,
            of_error,
            places,
            covariance,
            of_cells,
            of_candidates,
            taken,
            scores,
            is_chosen,
        })
    }

    /// The expected error.
    fn error(&self) -> f64 {
        let variance: f64 = self.of_error.iter().zip(&self.of_cells).map(|(w, v)| w * v.max(0.0)).sum();
        (self.belief.scale * variance).sqrt()
    }

    /// The candidate that takes most from the weighted variance; the first one of several.
    fn best(&self) -> Option<usize> {
        let noise = self.belief.noise_variance;
        let mut best: Option<(usize, f64)> = None;
        for (j, (score, variance)) in self.scores.iter().zip(&self.of_candidates).enumerate() {
            let gain = score / (variance.max(0.0) + noise);
            if !self.is_chosen[j] && best.is_none_or(|(_, most)| gain > most) {
                best = Some((j, gain));
            }
        }
        best.map(|(j, _)| j)
    }

    /// Takes what a measurement of candidate `j` takes from all covariances.
    fn choose(&mut self, j: usize) {
        self.is_chosen[j] = true;
        let cells = self.weights.len();
        let deviation = (self.of_candidates[j].max(0.0) + self.belief.noise_variance).sqrt();
        let step: Vec<f64> =
            self.covariance[j * cells..(j + 1) * cells].iter().map(|c| c / deviation).collect();
        let weights = &self.weights;
        let prior = self.belief.column(&self.places, &self.places, j);
        let own = self.taken[j].clone();
        self.covariance
            .par_chunks_mut(cells)
            .zip(self.scores.par_iter_mut())
            .zip(self.taken.par_iter_mut())
            .zip(self.of_candidates.par_iter_mut())
            .zip(prior.par_iter())
            .for_each(|((((column, score), taken), variance), prior)| {
                let share = (prior - dot(taken, &own)) / deviation;
                taken.push(share);
                *variance -= share * share;
                add_scaled(-share, &step, column);
                *score = dot3(weights, column, column);
            });
        self.of_cells.iter_mut().zip(&step).for_each(|(v, c)| *v -= c * c);
    }
}

/// At most [`MOST_MEASURED`] of the measured directions, spread evenly over them.
fn thinned(measured: &[HalfDiff]) -> Vec<HalfDiff> {
    if measured.len() <= MOST_MEASURED {
        return measured.to_vec();
    }
    let mut kept = golden_ratio_subset(measured.len(), MOST_MEASURED);
    kept.sort_unstable();
    kept.into_iter().map(|i| measured[i]).collect()
}

impl Belief {
    /// Covariances of all of `a` with direction `j` of `b`.
    fn column(&self, a: &Places, b: &Places, j: usize) -> Vec<f64> {
        let mut column = vec![0.0; a.len()];
        let mut scratch = RowScratch::new(self.kernel.dimension());
        self.kernel.row(&a.points, 0..a.len(), &b.points, j, &mut scratch, &mut column);
        if a.count > 0 {
            let row = b.row(j);
            column
                .iter_mut()
                .enumerate()
                .for_each(|(i, value)| *value += self.basis_variance * dot(a.row(i), row));
        }
        column
    }

    /// Covariances of all of `a` with all of `b`, one column per direction of `b`.
    fn covariance(&self, a: &Places, b: &Places) -> Vec<f64> {
        let mut all = vec![0.0; a.len() * b.len()];
        let rows = (a.count > 0).then(|| view_slice(&a.features, a.count, a.len()).transpose());
        all.par_chunks_mut(a.len() * BLOCK).enumerate().for_each_init(
            || (RowScratch::new(self.kernel.dimension()), vec![0.0; a.len()]),
            |(scratch, row), (block, out)| {
                let first = block * BLOCK;
                let count = out.len() / a.len();
                if let Some(rows) = rows {
                    let columns = &b.features[first * b.count..(first + count) * b.count];
                    product_into_slice(out, rows, view_slice(columns, b.count, count));
                    scale_in_place(self.basis_variance, out);
                }
                for (j, column) in out.chunks_mut(a.len()).enumerate() {
                    self.kernel.row(&a.points, 0..a.len(), &b.points, first + j, scratch, row);
                    add_scaled(1.0, row, column);
                }
            },
        );
        all
    }

    /// Variances before anything is measured.
    fn variances(&self, places: &Places) -> Vec<f64> {
        let of_kernel = self.kernel.prior_variance();
        let of_basis = |i: usize| match places.count {
            0 => 0.0,
            _ => self.basis_variance * dot(places.row(i), places.row(i)),
        };
        (0..places.len()).map(|i| of_kernel + of_basis(i)).collect()
    }
}
