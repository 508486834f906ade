//! How much light a material reflects at each elevation, and the densities of what it reflects.

use rayon::prelude::*;

use crate::base::simd::{index, vectorized};
use crate::brdf::LUMINANCE_WEIGHTS;
use crate::material::density::{
    COLUMNS, DirectionDensities, ROWS, VIEWS, column_node, row_node, view_between, view_cosine,
};
use crate::material::half_vector::HalfVectorSquare;
use crate::material::lookup::{Cells, interpolate};

/// Number of elevations at which albedos are held.
pub const ALBEDO_VIEWS: usize = 128;

/// Points along the rows and the columns of the square over which an albedo is integrated.
const INTEGRATION_ROWS: usize = 192;
const INTEGRATION_COLUMNS: usize = 64;

/// Points along each side of a cell whose values make those of its nodes.
const CELL_POINTS: usize = 2;

/// Such points along a row of a square.
const ROW_POINTS: usize = (COLUMNS - 1) * CELL_POINTS;

/// The sides of the plane of incidence.
const SIDES: [f32; 2] = [-1.0, 1.0];

/// Rounds in which the factors of an energy-conserving material are found. The last one is followed by a scaling that
/// makes the bound hold whatever is left.
const ROUNDS: usize = 40;

/// Albedos, and the factors that keep them at or below 1 where that is wanted, at [`ALBEDO_VIEWS`] elevations.
#[derive(Clone, Debug)]
pub(crate) struct Reflected {
    albedos: Vec<[f32; 3]>,
    factors: Option<Vec<f32>>,
}

/// The transport between two elevations for each channel: `kernel[k][m]` is the integral of `f cos theta_i` over the
/// incident directions about elevation `m`, seen from elevation `k`, where an incident direction between two
/// elevations is shared by both.
type Transport = Vec<Vec<[f64; 3]>>;

impl Reflected {
    pub(crate) fn new(values: &[[f32; 3]], energy_conserving: bool) -> Self {
        let transport: Transport =
            (0..ALBEDO_VIEWS).into_par_iter().map(|k| from_elevation(values, k)).collect();
        let factors = if energy_conserving { conserving_factors(&transport) } else { None };
        let factor = |k: usize| factors.as_ref().map_or(1.0, |f| f[k]);
        let albedos =
            (0..ALBEDO_VIEWS).map(|k| scaled(&transport[k], &factor).map(|x| narrow(x * factor(k))));
        let albedos = albedos.collect();
        Self { albedos, factors: factors.map(|f| f.into_iter().map(narrow).collect()) }
    }

    pub(crate) fn albedos(&self) -> &[[f32; 3]] {
        &self.albedos
    }

    pub(crate) fn factors(&self) -> Option<&[f32]> {
        self.factors.as_deref()
    }

    /// Albedo at a cosine of `theta_o`.
    #[inline]
    pub(crate) fn albedo(&self, cosine: f32) -> [f32; 3] {
        let (k, t) = view_between(cosine, ALBEDO_VIEWS);
        let (a, b) = (self.albedos[k as usize], self.albedos[k as usize + 1]);
        std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
    }

    /// The value of the table at two cosines, scaled where energy is to be conserved.
    #[inline(always)]
    pub(crate) fn conserve(&self, f: [f32; 3], cosine_i: f32, cosine_o: f32) -> [f32; 3] {
        let Some(factors) = &self.factors else { return f };
        let scale = factor_at(factors, cosine_i) * factor_at(factors, cosine_o);
        f.map(|f| f * scale)
    }
}

/// A factor between elevations.
#[inline]
fn factor_at(factors: &[f32], cosine: f32) -> f32 {
    let (k, t) = view_between(cosine, ALBEDO_VIEWS);
    let (a, b) = (factors[k as usize], factors[k as usize + 1]);
    a + (b - a) * t
}

/// The sum of a row of the transport, each elevation with its factor.
fn scaled(row: &[[f64; 3]], factor: &impl Fn(usize) -> f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (m, reflected) in row.iter().enumerate() {
        (0..3).for_each(|c| sum[c] += reflected[c] * factor(m));
    }
    sum
}

/// Factors `s` of at most 1 with `s_k sum_m kernel_km s_m <= 1` in every channel; `None` where all are 1.
///
/// Where the largest albedo of a channel, `B_k = sum_m kernel_km s_m`, is too large, `s_k` goes to the geometric mean
/// of itself and `1 / B_k`, as in the scaling of matrices by R. Sinkhorn and P. Knopp (1967); at the fixed point the
/// albedo there is exactly 1.
fn conserving_factors(transport: &Transport) -> Option<Vec<f64>> {
    let mut factors = vec![1.0; ALBEDO_VIEWS];
    let largest = |factors: &[f64], k: usize| {
        let sums = scaled(&transport[k], &|m| factors[m]);
        sums.into_iter().fold(0.0, f64::max)
    };
    if (0..ALBEDO_VIEWS).all(|k| largest(&factors, k) <= 1.0) {
        return None;
    }
    for _ in 0..ROUNDS {
        factors = (0..ALBEDO_VIEWS)
            .map(|k| (factors[k] * (1.0 / largest(&factors, k).max(f64::MIN_POSITIVE)).min(1.0)).sqrt())
            .collect();
    }
    let excess = (0..ALBEDO_VIEWS).map(|k| factors[k] * largest(&factors, k)).fold(1.0, f64::max);
    factors.iter_mut().for_each(|factor| *factor /= excess.sqrt());
    Some(factors)
}

/// A row of the transport, by the midpoint rule on the square of half vectors, whose rows are spaced like the nodes of
/// densities.
fn from_elevation(values: &[[f32; 3]], k: usize) -> Vec<[f64; 3]> {
    let wo = outgoing(view_cosine(k, ALBEDO_VIEWS));
    let square = HalfVectorSquare::new(wo);
    let columns = std::array::from_fn(|i| (i as f32 + 0.5) / INTEGRATION_COLUMNS as f32);
    let mut sums = vec![[0.0; 3]; ALBEDO_VIEWS];
    vectorized(
        #[inline(always)]
        || {
            for j in 0..INTEGRATION_ROWS {
                // y = t^4, so dy = 4 t^3 dt.
                let t = (j as f32 + 0.5) / INTEGRATION_ROWS as f32;
                let (row, width) = (t * t * (t * t), 4.0 * t * t * t / INTEGRATION_ROWS as f32);
                let sides: [Reflections<INTEGRATION_COLUMNS>; 2] =
                    SIDES.map(|side| Reflections::new(values, &square, wo, row, &columns, side));
                for i in 0..INTEGRATION_COLUMNS {
                    for (f, cosine, per_steradian) in sides.iter().filter_map(|side| side.at(i)) {
                        // Half of the square belongs to either side.
                        let area = INTEGRATION_COLUMNS as f32 * per_steradian;
                        let weight = f64::from(0.5 * width * cosine / area);
                        let (m, t) = view_between(cosine, ALBEDO_VIEWS);
                        for (m, share) in [(m, 1.0 - f64::from(t)), (m + 1, f64::from(t))] {
                            (0..3).for_each(|c| sums[m as usize][c] += share * weight * f64::from(f[c]));
                        }
                    }
                }
            }
        },
    );
    sums
}

/// What is reflected at `N` points of one row of the square.
struct Reflections<const N: usize> {
    f: [[f32; 3]; N],
    /// `cos theta_i`; not positive where rounding leaves the direction at or below the horizon.
    cosine: [f32; N],
    /// What turns densities on the square into densities over solid angle.
    per_steradian: [f32; N],
}

impl<const N: usize> Reflections<N> {
    #[inline(always)]
    fn new(
        values: &[[f32; 3]],
        square: &HalfVectorSquare,
        wo: [f32; 3],
        row: f32,
        columns: &[f32; N],
        side: f32,
    ) -> Self {
        let (mut wi, mut per_steradian) = ([[0.0; N]; 3], [0.0; N]);
        for k in 0..N {
            let (direction, density) = square.direction(row, columns[k], side);
            (wi[0][k], wi[1][k], wi[2][k]) = (direction[0], direction[1], direction[2]);
            per_steradian[k] = density;
        }
        let f = interpolate(values, &Cells::new(&wi, &wo.map(|x| [x; N])));
        Self { f, cosine: wi[2], per_steradian }
    }

    /// `f`, the cosine and the factor of densities at a point above the horizon.
    #[inline(always)]
    fn at(&self, k: usize) -> Option<([f32; 3], f32, f32)> {
        (self.cosine[k] > 0.0).then_some((self.f[k], self.cosine[k], self.per_steradian[k]))
    }
}

/// The outgoing direction with this cosine, above the x axis.
fn outgoing(cosine: f32) -> [f32; 3] {
    [(1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine]
}

/// The densities from which directions are drawn: at each node the mean of `luminance(f) cos theta_i` per unit of the
/// square over the cells about it, weighted by the node's bilinear function, from both sides of the plane of incidence.
///
/// `scaled` is what becomes of a value of the table at the cosines of `theta_i` and `theta_o`.
pub(crate) fn densities(
    values: &[[f32; 3]],
    scaled: impl Fn([f32; 3], f32, f32) -> [f32; 3] + Sync,
) -> DirectionDensities {
    let squares: Vec<Vec<f32>> = (0..VIEWS).into_par_iter().map(|k| square_at(values, &scaled, k)).collect();
    DirectionDensities::new(squares.concat())
}

/// The values of one square of [`densities`], up to a factor.
fn square_at(values: &[[f32; 3]], scaled: &impl Fn([f32; 3], f32, f32) -> [f32; 3], k: usize) -> Vec<f32> {
    let wo = outgoing(view_cosine(k, VIEWS));
    let square = HalfVectorSquare::new(wo);
    let luminance = |f: [f32; 3]| -> f64 { (0..3).map(|c| LUMINANCE_WEIGHTS[c] * f64::from(f[c])).sum() };
    let (mut sums, mut weights) = (vec![0.0; ROWS * COLUMNS], vec![0.0; ROWS * COLUMNS]);
    // The cell of a point, and how far into it the point is.
    let place =
        |point: usize| (point / CELL_POINTS, ((point % CELL_POINTS) as f32 + 0.5) / CELL_POINTS as f32);
    let between = |start: f32, end: f32, along: f32| start + (end - start) * along;
    let columns = std::array::from_fn(|point| {
        let (i, b) = place(point);
        between(column_node(index(i)), column_node(index(i) + 1), b)
    });
    vectorized(
        #[inline(always)]
        || {
            for along in 0..(ROWS - 1) * CELL_POINTS {
                let (j, x) = place(along);
                let row = between(row_node(index(j)), row_node(index(j) + 1), x);
                let sides: [Reflections<ROW_POINTS>; 2] =
                    SIDES.map(|side| Reflections::new(values, &square, wo, row, &columns, side));
                for across in 0..ROW_POINTS {
                    let (i, b) = place(across);
                    let mut value = 0.0;
                    for (f, cosine, per_steradian) in sides.iter().filter_map(|side| side.at(across)) {
                        value += luminance(scaled(f, cosine, wo[2])) * f64::from(cosine / per_steradian);
                    }
                    for (node, weight) in [
                        (j * COLUMNS + i, (1.0 - x) * (1.0 - b)),
                        (j * COLUMNS + i + 1, (1.0 - x) * b),
                        ((j + 1) * COLUMNS + i, x * (1.0 - b)),
                        ((j + 1) * COLUMNS + i + 1, x * b),
                    ] {
                        sums[node] += f64::from(weight) * value;
                        weights[node] += f64::from(weight);
                    }
                }
            }
        },
    );
    sums.iter().zip(&weights).map(|(sum, weight)| narrow(sum / weight)).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of a material")]
fn narrow(x: f64) -> f32 {
    x as f32
}
