//! Densities on the unit square, one for each of several outgoing directions, that are evaluated and sampled exactly.
//!
//! Points are evaluated and drawn `N` at a time, in loops that do either arithmetic or reading, but not both: the
//! former become vector instructions, and the latter do not wait for each other.

use super::{albedo, check_finite};
use crate::base::error::Result;
use crate::base::simd::{cell, index};
use crate::brdf::BrdfTable;

/// Number of elevations of the outgoing direction.
pub const VIEWS: usize = 64;
/// Number of nodes along a square's row coordinate.
pub const ROWS: usize = 80;
/// Number of nodes along a square's column coordinate.
pub const COLUMNS: usize = 24;

/// Densities on the unit square at [`VIEWS`] elevations of the outgoing direction, bilinear between [`ROWS`] x
/// [`COLUMNS`] nodes, with what is needed to sample them. Between two elevations the density is a mixture of both.
///
/// Node `(j, i)` of a square is at `y = (j / (ROWS - 1))^4` and `b = 1 - (1 - i / (COLUMNS - 1))^2`; what `y` and `b`
/// mean is told at [`Material`](super::Material). Elevation `k` has `cos theta_o = v (2 - v)` with `v = (1 - k /
/// (VIEWS - 1))^2`: the normal is first, and elevations crowd towards the horizon. All arrays are flat, so they can be
/// handed to a device as they are. Together they take 1.0 MB.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionDensities {
    values: Vec<f32>,
    conditional: Vec<f32>,
    marginal: Vec<f32>,
}

/// The two elevations about each of `N` outgoing directions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Views<const N: usize> {
    first: [u32; N],
    second_weight: [f32; N],
}

impl<const N: usize> Views<N> {
    /// The elevations about these cosines of `theta_o`.
    #[inline(always)]
    pub(crate) fn new(cosines: &[f32; N]) -> Self {
        let mut out = Self { first: [0; N], second_weight: [0.0; N] };
        for k in 0..N {
            (out.first[k], out.second_weight[k]) = view_between(cosines[k], VIEWS);
        }
        out
    }
}

/// Position of an elevation among `nodes` of them that are placed like those of [`DirectionDensities`], from the cosine
/// of `theta_o`: `(nodes - 1) (1 - sqrt(1 - sqrt(1 - cos theta_o)))`.
#[inline(always)]
pub(crate) fn view_position(cosine: f32, nodes: usize) -> f32 {
    let cosine = cosine.clamp(0.0, 1.0);
    // 1 - sqrt(1 - x) without its cancellation.
    let v = cosine / (1.0 + (1.0 - cosine).sqrt());
    (nodes - 1) as f32 * (1.0 - v.sqrt())
}

/// The cosine of elevation `index` of `nodes`: the inverse of [`view_position`]. The last is slightly above the
/// horizon.
pub(crate) fn view_cosine(index: usize, nodes: usize) -> f32 {
    let t = 1.0 - index as f32 / (nodes - 1) as f32;
    let v = t * t;
    (v * (2.0 - v)).max(1e-3)
}

/// The elevations about a cosine of `theta_o`, among `nodes`: the first, and the weight of the one after it.
#[inline(always)]
pub(crate) fn view_between(cosine: f32, nodes: usize) -> (u32, f32) {
    cell(view_position(cosine, nodes), index(nodes) - 2)
}

/// Position of a row node.
#[inline(always)]
pub(crate) fn row_node(j: u32) -> f32 {
    let t = j.cast_signed() as f32 / (ROWS - 1) as f32;
    (t * t) * (t * t)
}

/// Position of a column node.
#[inline(always)]
pub(crate) fn column_node(i: u32) -> f32 {
    let t = 1.0 - i.cast_signed() as f32 / (COLUMNS - 1) as f32;
    1.0 - t * t
}

/// How far along a cell, in `[0, 1]`, the integral of the linear density from `a` to `b` is `mass`.
#[inline(always)]
fn invert_linear(a: f32, b: f32, mass: f32) -> f32 {
    let root = (a * a + 2.0 * mass * (b - a)).max(0.0).sqrt();
    (2.0 * mass / (a + root).max(f32::MIN_POSITIVE)).min(1.0)
}

/// The last interval between `M` running sums whose first sum is at most `target`; the first one
/// where none is.
///
/// All sums are compared, several of them in one instruction: a binary search does fewer comparisons, but the
/// processor guesses half of them wrong. The comparison is the sign bit of a difference, which can be added up; the
/// result of a comparison would be taken apart bit by bit.
#[inline(always)]
fn search<const M: usize>(sums: &[f32; M], target: f32) -> u32 {
    let above: u32 = sums.iter().map(|sum| (target - sum).to_bits() >> 31).sum();
    (index(M) - above).saturating_sub(1).min(index(M) - 2)
}

const SQUARE: usize = ROWS * COLUMNS;

impl DirectionDensities {
    /// Densities that are proportional to `values` at the nodes, `VIEWS x ROWS x COLUMNS` of them, none negative. A
    /// square of zeros becomes uniform.
    pub(crate) fn new(mut values: Vec<f32>) -> Self {
        let mut conditional = vec![0.0; values.len()];
        let mut marginal = vec![0.0; VIEWS * ROWS];
        for (k, marginal) in marginal.chunks_exact_mut(ROWS).enumerate() {
            let values = &mut values[k * SQUARE..(k + 1) * SQUARE];
            let conditional = &mut conditional[k * SQUARE..(k + 1) * SQUARE];
            let total = sums(values, conditional, marginal);
            // Not positive, or too small to divide by.
            if total > 1e-30 {
                values.iter_mut().for_each(|value| *value /= total);
            } else {
                values.fill(1.0);
            }
            sums(values, conditional, marginal);
        }
        Self { values, conditional, marginal }
    }

    /// Those of `luminance(f) cos theta_i` of a table, as a [`Material`](super::Material) of it has them that does not
    /// conserve energy. Cells without data are filled from their neighbours.
    ///
    /// Cost: 0.9 million lookups, in parallel.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`](crate::Error::InvalidArgument) for a table with an infinite value.
    pub fn of_table(table: &BrdfTable) -> Result<Self> {
        let table = table.filled();
        check_finite(&table)?;
        Ok(albedo::densities(table.values(), |f, _, _| f))
    }

    /// The densities: `VIEWS` squares of `ROWS` rows of `COLUMNS` nodes each.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Integrals of each row of nodes over the columns, from the first column to each node, in the layout of
    /// [`DirectionDensities::values`]. The last number of a row is the density of the rows' marginal there.
    #[must_use]
    pub fn conditional(&self) -> &[f32] {
        &self.conditional
    }

    /// Integrals of each square over the columns and from the first row to each row: `VIEWS` times `ROWS` numbers from
    /// 0 to 1.
    #[must_use]
    pub fn marginal(&self) -> &[f32] {
        &self.marginal
    }

    /// The densities of the mixtures at points of the square.
    #[inline(always)]
    pub(crate) fn at<const N: usize>(
        &self,
        views: &Views<N>,
        rows: &[f32; N],
        columns: &[f32; N],
    ) -> [f32; N] {
        let (mut starts, mut along_row, mut along_column) = ([0; N], [0.0; N], [0.0; N]);
        for k in 0..N {
            let (j, x) = row_cell(rows[k]);
            let (i, b) = column_cell(columns[k]);
            starts[k] = (views.first[k] * index(ROWS) + j) * index(COLUMNS) + i;
            (along_row[k], along_column[k]) = (x, b);
        }
        let mut corners = [[0.0; N]; 8];
        for k in 0..N {
            let start = starts[k] as usize;
            let near = &self.values[start..start + SQUARE + COLUMNS + 2];
            let offsets = [0, 1, COLUMNS, COLUMNS + 1];
            for (corner, offset) in offsets.into_iter().chain(offsets.map(|o| SQUARE + o)).enumerate() {
                corners[corner][k] = near[offset];
            }
        }
        let mut out = [0.0; N];
        for k in 0..N {
            let of = |first: usize| {
                let [a, b, c, d] = [0, 1, 2, 3].map(|corner| corners[first + corner][k]);
                let (low, high) = (a + (b - a) * along_column[k], c + (d - c) * along_column[k]);
                low + (high - low) * along_row[k]
            };
            let (first, second) = (of(0), of(4));
            out[k] = first + (second - first) * views.second_weight[k];
        }
        out
    }

    /// The rows and the columns of points drawn from the mixtures by two numbers each that are uniform on `[0, 1)`. The
    /// first one also chooses the elevation.
    #[inline(always)]
    pub(crate) fn draw<const N: usize>(
        &self,
        views: &Views<N>,
        u: &[f32; N],
        v: &[f32; N],
    ) -> ([f32; N], [f32; N]) {
        let (mut squares, mut share) = ([0; N], [0.0; N]);
        for k in 0..N {
            let weight = views.second_weight[k];
            let (second, rest) = (u[k] < weight, (u[k] - weight) / (1.0 - weight).max(f32::MIN_POSITIVE));
            squares[k] = views.first[k] + u32::from(second);
            share[k] = if second { u[k] / weight } else { rest };
        }
        let marginals = self.marginal.as_chunks::<ROWS>().0;
        let values = self.values.as_chunks::<COLUMNS>().0;
        let conditionals = self.conditional.as_chunks::<COLUMNS>().0;
        // The cell of rows, the mass from its start, and the densities of rows at its start and end.
        let (mut j, mut mass, mut ends) = ([0; N], [0.0; N], [[0.0; N]; 2]);
        for k in 0..N {
            let marginal = &marginals[squares[k] as usize];
            let target = share[k] * marginal[ROWS - 1];
            j[k] = search(marginal, target);
            mass[k] = target - marginal[j[k] as usize];
            let row = squares[k] as usize * ROWS + j[k] as usize;
            (ends[0][k], ends[1][k]) = (conditionals[row][COLUMNS - 1], conditionals[row + 1][COLUMNS - 1]);
        }
        let (mut rows, mut along, mut targets) = ([0.0; N], [0.0; N], [0.0; N]);
        for k in 0..N {
            let (bottom, height) = (row_node(j[k]), row_node(j[k] + 1) - row_node(j[k]));
            along[k] = invert_linear(ends[0][k], ends[1][k], mass[k] / height);
            rows[k] = bottom + height * along[k];
            targets[k] = v[k] * (ends[0][k] + (ends[1][k] - ends[0][k]) * along[k]);
        }
        // The cell of columns, the mass from its start, and the densities at its start and end.
        let mut i = [0; N];
        for k in 0..N {
            let row = squares[k] as usize * ROWS + j[k] as usize;
            let (low, high) = (&conditionals[row], &conditionals[row + 1]);
            let mut sums = [0.0; COLUMNS];
            for i in 0..COLUMNS {
                sums[i] = low[i] + (high[i] - low[i]) * along[k];
            }
            i[k] = search(&sums, targets[k]);
            let first = i[k] as usize;
            mass[k] = targets[k] - sums[first];
            let (low, high) = (&values[row], &values[row + 1]);
            for end in 0..2 {
                let (low, high) = (low[first + end], high[first + end]);
                ends[end][k] = low + (high - low) * along[k];
            }
        }
        let mut columns = [0.0; N];
        for k in 0..N {
            let (start, width) = (column_node(i[k]), column_node(i[k] + 1) - column_node(i[k]));
            columns[k] = start + width * invert_linear(ends[0][k], ends[1][k], mass[k] / width);
        }
        (rows, columns)
    }
}

/// The cell of rows that holds a row coordinate, and how far into it that is.
#[inline(always)]
fn row_cell(row: f32) -> (u32, f32) {
    let (j, _) = cell(row.sqrt().sqrt() * (ROWS - 1) as f32, index(ROWS) - 2);
    let (low, high) = (row_node(j), row_node(j + 1));
    (j, ((row - low) / (high - low)).clamp(0.0, 1.0))
}

/// The cell of columns that holds a column coordinate, and how far into it that is.
#[inline(always)]
fn column_cell(column: f32) -> (u32, f32) {
    let (i, _) = cell((1.0 - (1.0 - column).sqrt()) * (COLUMNS - 1) as f32, index(COLUMNS) - 2);
    let (start, end) = (column_node(i), column_node(i + 1));
    (i, ((column - start) / (end - start)).clamp(0.0, 1.0))
}

/// The running integrals of a square's rows and of the whole square, by the trapezoidal rule, which is exact for them.
fn sums(values: &[f32], conditional: &mut [f32], marginal: &mut [f32]) -> f32 {
    for (values, conditional) in values.chunks_exact(COLUMNS).zip(conditional.chunks_exact_mut(COLUMNS)) {
        let mut sum = 0.0;
        conditional[0] = 0.0;
        for i in 1..COLUMNS {
            let width = f64::from(column_node(index(i)) - column_node(index(i) - 1));
            sum += 0.5 * width * (f64::from(values[i - 1]) + f64::from(values[i]));
            conditional[i] = narrow(sum);
        }
    }
    let density = |j: usize| f64::from(conditional[j * COLUMNS + COLUMNS - 1]);
    let mut sum = 0.0;
    marginal[0] = 0.0;
    for j in 1..ROWS {
        let height = f64::from(row_node(index(j)) - row_node(index(j) - 1));
        sum += 0.5 * height * (density(j - 1) + density(j));
        marginal[j] = narrow(sum);
    }
    narrow(sum)
}

#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of the densities")]
fn narrow(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_hold_their_targets() {
        // Nothing is drawn from the flat parts: of equal sums, the last one starts the interval.
        let sums: [f32; 24] = std::array::from_fn(|i| (i / 3 * 3) as f32);
        for i in 0..=4 * 21u16 {
            let target = f32::from(i) / 4.0;
            let found = search(&sums, target) as usize;
            let expected = sums.iter().rposition(|sum| *sum <= target).map_or(0, |last| last.min(22));
            assert_eq!(found, expected, "{target}");
        }
        assert_eq!((search(&sums, -1.0), search(&sums, 99.0)), (0, 22));
        assert!(search(&sums, f32::NAN) <= 22);
    }

    #[test]
    fn points_are_drawn_where_the_density_is() {
        // A random density at every node, so that all cells and both elevations differ.
        let mut random = crate::base::SplitMix64::new(4);
        let values = (0..VIEWS * SQUARE).map(|_| narrow(0.2 + random.next_unit())).collect();
        let densities = DirectionDensities::new(values);
        let views = Views::new(&[0.37; 64]);
        let mut areas = [[0.0; 8]; 8];
        let rounds = 2000;
        for _ in 0..rounds {
            let [u, v] = [(); 2].map(|()| std::array::from_fn(|_| narrow(random.next_unit())));
            let (rows, columns) = densities.draw(&views, &u, &v);
            let found = densities.at(&views, &rows, &columns);
            for k in 0..64 {
                let [j, i] = [rows[k], columns[k]].map(|x| cell(8.0 * x, 7).0 as usize);
                areas[j][i] += 1.0 / f64::from(found[k]);
            }
        }
        // The mean of 1 / density over the draws that fall into a part of the square is the area of that part.
        for area in areas.as_flattened() {
            let area = area / f64::from(64 * rounds);
            assert!((64.0 * area - 1.0).abs() < 0.12, "{area}");
        }
    }
}
