//! Maps on grids over the unit square, and warps of the square that follow a density.

use crate::base::error::Result;

/// A scalar map on a grid over the unit square.
#[derive(Clone)]
pub(super) struct Map {
    pub(super) height: usize,
    pub(super) width: usize,
    pub(super) values: Vec<f32>,
}

/// The cumulative distribution of visible normals; each slice integrates to 1.
#[derive(Clone)]
pub(super) struct Warp {
    pub(super) height: usize,
    pub(super) width: usize,
    /// Density at a node, and its integral along the row from the start to the node; `[theta_i][y][x]`.
    nodes: Vec<[f32; 2]>,
    /// Integral over all rows up to this one; `[theta_i][y]`.
    rows: Vec<f32>,
}

/// The lower node and the weight of the upper one, at `t` in `[0, 1]` on `n >= 2` nodes.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the nodes; NaN is 0")]
pub(super) fn node(t: f64, n: usize) -> (usize, f64) {
    let x = t.clamp(0.0, 1.0) * (n - 1) as f64;
    let low = (x as usize).min(n - 2);
    (low, x - low as f64)
}

pub(super) fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + t * (b - a)
}

impl Map {
    /// The value at a point of the square, by bilinear interpolation.
    pub(super) fn eval(&self, x: f64, y: f64) -> f64 {
        let (i, a) = node(x, self.width);
        let (j, b) = node(y, self.height);
        let at = |j: usize| {
            let row = j * self.width + i;
            mix(self.values[row].into(), self.values[row + 1].into(), a)
        };
        mix(at(j), at(j + 1), b)
    }
}

impl Warp {
    /// Integrates `vndf`, `[theta_i][y][x]`, by the trapezoid rule with unit spacing. The error is the index
    /// of a slice that is zero everywhere.
    pub(super) fn new(height: usize, width: usize, vndf: &[f32]) -> Result<Self, usize> {
        let mut nodes = Vec::with_capacity(vndf.len());
        let mut rows = Vec::with_capacity(vndf.len() / width);
        let mut row_totals = Vec::with_capacity(height);
        let mut integrals = vec![0.0; height * width];
        for (slice, values) in vndf.chunks_exact(height * width).enumerate() {
            row_totals.clear();
            for (row, integral) in values.chunks_exact(width).zip(integrals.chunks_exact_mut(width)) {
                let mut sum = 0.0;
                for x in 1..width {
                    sum += 0.5 * (f64::from(row[x - 1]) + f64::from(row[x]));
                    integral[x] = sum;
                }
                row_totals.push(sum);
            }
            let total: f64 = row_totals.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).sum();
            if !(total > 0.0) {
                return Err(slice);
            }
            #[expect(clippy::cast_possible_truncation, reason = "f32 is the file's precision")]
            {
                nodes.extend(values.iter().zip(&integrals).map(|(&density, &integral)| {
                    [(f64::from(density) / total) as f32, (integral / total) as f32]
                }));
                let mut sum = 0.0;
                rows.push(0.0);
                for pair in row_totals.windows(2) {
                    sum += 0.5 * (pair[0] + pair[1]);
                    rows.push((sum / total) as f32);
                }
            }
        }
        Ok(Self { height, width, nodes, rows })
    }

    /// The point that is mapped to `(x, y)` by the warp of slices `low` and `high`, blended with the weight
    /// `weight` of `high`.
    pub(super) fn invert(&self, low: usize, high: usize, weight: f64, x: f64, y: f64) -> (f64, f64) {
        let (i, a) = node(x, self.width);
        let (j, b) = node(y, self.height);
        let size = self.height * self.width;
        let row = j * self.width;
        let blend = |index: usize| {
            let [v0, c0] = self.nodes[low * size + index];
            let [v1, c1] = self.nodes[high * size + index];
            [mix(v0.into(), v1.into(), weight), mix(c0.into(), c1.into(), weight)]
        };
        let [v00, c00] = blend(row + i);
        let [v01, _] = blend(row + i + 1);
        let [v10, c10] = blend(row + self.width + i);
        let [v11, _] = blend(row + self.width + i + 1);
        let [_, r0] = blend(row + self.width - 1);
        let [_, r1] = blend(row + 2 * self.width - 1);
        let m =
            mix(self.rows[low * self.height + j].into(), self.rows[high * self.height + j].into(), weight);
        let left = mix(v00, v10, b);
        let right = mix(v01, v11, b);
        let along = a * (left + 0.5 * a * (right - left)) + mix(c00, c10, b);
        let total = mix(r0, r1, b);
        // A row without density is never sampled, so any value will do.
        let s_x = if total > 0.0 { along / total } else { 0.0 };
        let s_y = m + b * (r0 + 0.5 * b * (r1 - r0));
        (s_x, s_y)
    }

    /// The inverse of [`Warp::invert`] at one slice: the point that the warp makes of `(s_x, s_y)`, and the
    /// density there with respect to the area of the unit square.
    pub(super) fn sample(&self, slice: usize, s_x: f64, s_y: f64) -> ([f64; 2], f64) {
        let nodes = &self.nodes[slice * self.height * self.width..][..self.height * self.width];
        let rows = &self.rows[slice * self.height..][..self.height];
        let s_y = s_y * f64::from(rows[self.height - 1]);
        let j = rows.partition_point(|&row| f64::from(row) <= s_y).saturating_sub(1).min(self.height - 2);
        let lower = &nodes[j * self.width..][..self.width];
        let upper = &nodes[(j + 1) * self.width..][..self.width];
        let total = |row: &[[f32; 2]]| f64::from(row[self.width - 1][1]);
        let b = segment(total(lower), total(upper), s_y - f64::from(rows[j]));
        let density = |i: usize| mix(lower[i][0].into(), upper[i][0].into(), b);
        let integral = |i: usize| mix(lower[i][1].into(), upper[i][1].into(), b);
        let along = s_x * integral(self.width - 1);
        // The integrals do not decrease, so that the search by halves finds the last one that is not above.
        let (mut i, mut end) = (0, self.width - 1);
        while end - i > 1 {
            let middle = usize::midpoint(i, end);
            if integral(middle) <= along {
                i = middle;
            } else {
                end = middle;
            }
        }
        let (left, right) = (density(i), density(i + 1));
        let a = segment(left, right, along - integral(i));
        let (x, y) = ((self.width - 1) as f64, (self.height - 1) as f64);
        ([(i as f64 + a) / x, (j as f64 + b) / y], mix(left, right, a) * x * y)
    }

    /// The density at node `(x, y)` of a slice; each slice has the sum 1 by the trapezoid rule with unit
    /// spacing.
    pub(super) fn densities(&self) -> impl Iterator<Item = f32> + '_ {
        self.nodes.iter().map(|node| node[0])
    }
}

/// The `t` in `[0, 1]` up to which a density that goes from `left` at 0 to `right` at 1 has the integral
/// `mass`.
fn segment(left: f64, right: f64, mass: f64) -> f64 {
    let mass = mass.max(0.0);
    let root = (left * left + 2.0 * mass * (right - left)).max(0.0).sqrt();
    // This form of the solution has no difference of close numbers. Without density any t will do.
    if left + root > 0.0 { (2.0 * mass / (left + root)).min(1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::mutate::Random;

    /// A forward warp, found by bisection on the integrals of the blended density, undoes `invert`.
    #[test]
    fn warp_is_the_cumulative_distribution() {
        let mut random = Random::new(11);
        let (height, width) = (5, 4);
        let vndf: Vec<f32> = (0..2 * height * width).map(|_| 0.1 + random.below(100) as f32).collect();
        let warp = Warp::new(height, width, &vndf).unwrap();
        let weight = 0.3;
        let normalised: Vec<f64> = (0..height * width)
            .map(|k| {
                let mass = |slice: usize| -> f64 {
                    let at = |y: usize, x: usize| f64::from(vndf[(slice * height + y) * width + x]);
                    let cells = (0..height - 1).flat_map(|y| (0..width - 1).map(move |x| (y, x)));
                    cells
                        .map(|(y, x)| 0.25 * (at(y, x) + at(y + 1, x) + at(y, x + 1) + at(y + 1, x + 1)))
                        .sum()
                };
                mix(f64::from(vndf[k]) / mass(0), f64::from(vndf[height * width + k]) / mass(1), weight)
            })
            .collect();
        let density = |x: f64, y: f64| {
            let ((i, a), (j, b)) = (node(x, width), node(y, height));
            let row = |j: usize| mix(normalised[j * width + i], normalised[j * width + i + 1], a);
            mix(row(j), row(j + 1), b)
        };
        // The integral is taken by the midpoint rule in the cells of a fine grid.
        let steps = 3 * 400;
        let integral = |to: f64, f: &dyn Fn(f64) -> f64| -> f64 {
            let h = to / f64::from(steps);
            (0..steps).map(|k| f((f64::from(k) + 0.5) * h) * h).sum()
        };
        for (x, y) in [(0.2, 0.7), (0.9, 0.1), (0.5, 0.5), (1.0, 0.33)] {
            let (s_x, s_y) = warp.invert(0, 1, weight, x, y);
            let scale = (width - 1) as f64;
            let expected_x = integral(x, &|t| density(t, y)) / integral(1.0, &|t| density(t, y));
            let expected_y =
                integral(y, &|t| integral(1.0, &|s| density(s, t)) * scale * (height - 1) as f64);
            assert!((s_x - expected_x).abs() < 1e-5, "{s_x} {expected_x}");
            assert!((s_y - expected_y).abs() < 1e-5, "{s_y} {expected_y}");
        }
    }

    #[test]
    fn sampling_undoes_inversion() {
        let mut random = Random::new(5);
        let (height, width) = (6, 9);
        let vndf: Vec<f32> = (0..2 * height * width).map(|_| random.below(50) as f32).collect();
        let warp = Warp::new(height, width, &vndf).unwrap();
        let mut mass = 0.0;
        let steps = 200;
        for k in 0..steps * steps {
            let s = [k % steps, k / steps].map(|k| (k as f64 + 0.5) / steps as f64);
            let ([x, y], density) = warp.sample(1, s[0], s[1]);
            let back = warp.invert(1, 1, 0.0, x, y);
            assert!((back.0 - s[0]).abs() < 1e-6 && (back.1 - s[1]).abs() < 1e-6, "{s:?} {back:?}");
            // The mean of 1 / density over the samples is the area of the square.
            mass += 1.0 / density;
        }
        assert!((mass / (steps * steps) as f64 - 1.0).abs() < 0.01, "{mass}");
        assert_eq!(warp.sample(0, 0.0, 0.0).0, [0.0, 0.0]);
        let corner = warp.sample(0, 1.0, 1.0).0;
        assert!(corner.iter().all(|x| (x - 1.0).abs() < 1e-3), "{corner:?}");
    }
}
