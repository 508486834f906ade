//! Densities on the unit square, one for each of several outgoing directions, that are evaluated and sampled exactly.

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

/// One or two elevations and the weight of the second.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    first: usize,
    second_weight: f32,
}

/// The cell that holds a position of `[0, nodes - 1]`, and how far into it the position is.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a position is small and not negative"
)]
fn cell(position: f32, nodes: usize) -> (usize, f32) {
    let low = (position as u32 as usize).min(nodes - 2);
    (low, (position - low as f32).clamp(0.0, 1.0))
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
pub(crate) fn view_between(cosine: f32, nodes: usize) -> (usize, f32) {
    cell(view_position(cosine, nodes), nodes)
}

/// Position of a row node.
pub(crate) fn row_node(j: usize) -> f32 {
    let t = j as f32 / (ROWS - 1) as f32;
    (t * t) * (t * t)
}

/// Position of a column node.
pub(crate) fn column_node(i: usize) -> f32 {
    let t = 1.0 - i as f32 / (COLUMNS - 1) as f32;
    1.0 - t * t
}

/// How far along a cell, in `[0, 1]`, the integral of the linear density from `a` to `b` is `mass`.
#[inline(always)]
fn invert_linear(a: f32, b: f32, mass: f32) -> f32 {
    let root = (a * a + 2.0 * mass * (b - a)).max(0.0).sqrt();
    (2.0 * mass / (a + root).max(f32::MIN_POSITIVE)).min(1.0)
}

/// The last index of `0..count` whose running sum is at most `target`; 0 where none is.
#[inline(always)]
fn search(count: usize, target: f32, sum: impl Fn(usize) -> f32) -> usize {
    let (mut low, mut high) = (0, count);
    while high - low > 1 {
        let middle = usize::midpoint(low, high);
        if sum(middle) <= target { low = middle } else { high = middle }
    }
    low
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

    /// The mixture at an outgoing direction with this cosine.
    #[inline(always)]
    pub(crate) fn view(cosine: f32) -> View {
        let (first, second_weight) = view_between(cosine, VIEWS);
        View { first, second_weight }
    }

    /// The density at a point of the square.
    #[inline(always)]
    pub(crate) fn at(&self, view: View, row: f32, column: f32) -> f32 {
        let (j, x) = row_cell(row);
        let (i, b) = column_cell(column);
        let of = |k: usize| {
            let start = (k * ROWS + j) * COLUMNS + i;
            let square = &self.values[start..start + COLUMNS + 2];
            let low = square[0] + (square[1] - square[0]) * b;
            let high = square[COLUMNS] + (square[COLUMNS + 1] - square[COLUMNS]) * b;
            low + (high - low) * x
        };
        let first = of(view.first);
        first + (of(view.first + 1) - first) * view.second_weight
    }

    /// A point `(row, column)` drawn from the mixture by two numbers that are uniform on `[0, 1)`. The first one also
    /// chooses the elevation.
    #[inline(always)]
    pub(crate) fn draw(&self, view: View, u: f32, v: f32) -> (f32, f32) {
        let weight = view.second_weight;
        let (k, u) = if u < weight {
            (view.first + 1, u / weight)
        } else {
            (view.first, (u - weight) / (1.0 - weight).max(f32::MIN_POSITIVE))
        };
        let marginal = &self.marginal[k * ROWS..(k + 1) * ROWS];
        let values = &self.values[k * SQUARE..(k + 1) * SQUARE];
        let conditional = &self.conditional[k * SQUARE..(k + 1) * SQUARE];
        let target = u * marginal[ROWS - 1];
        let j = search(ROWS - 1, target, |j| marginal[j]);
        let (low, high) = (j * COLUMNS, (j + 1) * COLUMNS);
        let (bottom, top) = (row_node(j), row_node(j + 1));
        let (density_low, density_high) = (conditional[high - 1], conditional[high + COLUMNS - 1]);
        let x = invert_linear(density_low, density_high, (target - marginal[j]) / (top - bottom));
        let between = |a: f32, b: f32| a + (b - a) * x;
        let target = v * between(density_low, density_high);
        let below = |i: usize| between(conditional[low + i], conditional[high + i]);
        let i = search(COLUMNS - 1, target, below);
        let left = between(values[low + i], values[high + i]);
        let right = between(values[low + i + 1], values[high + i + 1]);
        let (start, end) = (column_node(i), column_node(i + 1));
        let along = invert_linear(left, right, (target - below(i)) / (end - start));
        (bottom + (top - bottom) * x, start + (end - start) * along)
    }
}

/// The cell of rows that holds a row coordinate, and how far into it that is.
#[inline(always)]
fn row_cell(row: f32) -> (usize, f32) {
    let (j, _) = cell(row.sqrt().sqrt() * (ROWS - 1) as f32, ROWS);
    let (low, high) = (row_node(j), row_node(j + 1));
    (j, ((row - low) / (high - low)).clamp(0.0, 1.0))
}

/// The cell of columns that holds a column coordinate, and how far into it that is.
#[inline(always)]
fn column_cell(column: f32) -> (usize, f32) {
    let (i, _) = cell((1.0 - (1.0 - column).sqrt()) * (COLUMNS - 1) as f32, COLUMNS);
    let (start, end) = (column_node(i), column_node(i + 1));
    (i, ((column - start) / (end - start)).clamp(0.0, 1.0))
}

/// The running integrals of a square's rows and of the whole square, by the trapezoidal rule, which is exact for them.
fn sums(values: &[f32], conditional: &mut [f32], marginal: &mut [f32]) -> f32 {
    for (values, conditional) in values.chunks_exact(COLUMNS).zip(conditional.chunks_exact_mut(COLUMNS)) {
        let mut sum = 0.0;
        conditional[0] = 0.0;
        for i in 1..COLUMNS {
            let width = f64::from(column_node(i) - column_node(i - 1));
            sum += 0.5 * width * (f64::from(values[i - 1]) + f64::from(values[i]));
            conditional[i] = narrow(sum);
        }
    }
    let density = |j: usize| f64::from(conditional[j * COLUMNS + COLUMNS - 1]);
    let mut sum = 0.0;
    marginal[0] = 0.0;
    for j in 1..ROWS {
        sum += 0.5 * f64::from(row_node(j) - row_node(j - 1)) * (density(j - 1) + density(j));
        marginal[j] = narrow(sum);
    }
    narrow(sum)
}

#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of the densities")]
fn narrow(x: f64) -> f32 {
    x as f32
}
