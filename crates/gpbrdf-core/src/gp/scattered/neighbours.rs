//! The order of samples, and the nearest samples of any point in the metric of a kernel.

use rayon::prelude::*;

use crate::base::error::Result;
#[cfg(feature = "fit")]
use crate::base::random::SplitMix64;
use crate::base::simd::vectorized;
use crate::base::watch::Watch;
use crate::kernel::{AxisMetric, Kernel, KernelBody};

/// Number of points whose distances are computed at a time.
const STRIP: usize = 256;

/// Number of points whose neighbours are found before somebody may stop the work.
const STEP: usize = 64;

/// An order of the samples that looks random but depends on nothing except their coordinates and targets, so
/// that results do not depend on the order in which samples were given. `x` has `n` rows of `dimension`
/// coordinates, `y` one column of `n` targets per channel.
#[cfg(feature = "fit")]
pub(super) fn scrambled_order(x: &[f64], dimension: usize, y: &[Vec<f64>]) -> Vec<u32> {
    let bits = |i: usize| {
        let coordinates = x[i * dimension..(i + 1) * dimension].iter();
        // Both zeros are one number.
        coordinates.copied().chain(y.iter().map(move |y| y[i])).map(|v| (v + 0.0).to_bits())
    };
    let hash = |i: usize| bits(i).fold(0x5EED, |hash, bits| SplitMix64::new(hash ^ bits).next_u64());
    let mut keys: Vec<(u64, u32)> = (0u32..).zip(0..x.len() / dimension).map(|(k, i)| (hash(i), k)).collect();
    keys.sort_unstable_by(|a, b| {
        let tie = || bits(a.1 as usize).cmp(bits(b.1 as usize));
        a.0.cmp(&b.0).then_with(tie).then(a.1.cmp(&b.1))
    });
    keys.into_iter().map(|(_, i)| i).collect()
}

/// Points in coordinates whose squared Euclidean distance is the scaled distance of a kernel.
#[derive(Clone, Debug)]
pub(super) struct Embedded {
    /// One array per coordinate.
    axes: Vec<Vec<f64>>,
    len: usize,
}

/// The points among which the nearest ones are searched.
#[derive(Clone, Copy, Debug)]
struct Among {
    /// Their number: they are the first ones.
    first: usize,
    /// One that is left out.
    skip: Option<usize>,
    /// Only points at a larger squared distance are taken.
    beyond: f64,
}

impl Among {
    fn first(count: usize) -> Self {
        Self { first: count, skip: None, beyond: f64::NEG_INFINITY }
    }

    #[cfg(feature = "fit")]
    fn all_but(count: usize, skip: usize) -> Self {
        Self { skip: Some(skip), ..Self::first(count) }
    }
}

impl Embedded {
    /// Embeds `n` rows of coordinates. Where a kernel has several length scales along an axis, the shortest
    /// counts.
    pub(super) fn new(x: &[f64], kernel: &Kernel) -> Self {
        let dimension = kernel.dimension();
        let mut axes = Vec::new();
        for (k, (metric, length)) in kernel.metric.iter().zip(length_scales(kernel)).enumerate() {
            let column = || x.iter().skip(k).step_by(dimension);
            match metric {
                AxisMetric::Linear => axes.push(column().map(|x| x / length).collect()),
                // |sin(x - y)| is half the chord between the angles 2 x and 2 y.
                AxisMetric::Chord => {
                    axes.push(column().map(|x| 0.5 * (2.0 * x).cos() / length).collect());
                    axes.push(column().map(|x| 0.5 * (2.0 * x).sin() / length).collect());
                }
            }
        }
        Self { axes, len: x.len() / dimension }
    }

    /// Writes the indices of the `count` points among some that are nearest to point `j` of `other`, nearest first.
    /// Cost: one squared distance per point.
    fn nearest(
        &self,
        Among { first: limit, skip, beyond }: Among,
        (other, j): (&Self, usize),
        count: usize,
        found: &mut Vec<(f64, u32)>,
    ) {
        found.clear();
        if count == 0 {
            return;
        }
        let mut worst = f64::INFINITY;
        let mut d2 = [0.0; STRIP];
        let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        for start in (0..limit).step_by(STRIP) {
            let n = STRIP.min(limit - start);
            let d2 = &mut d2[..n];
            let lowest = vectorized(
                #[inline(always)]
                || {
                    for (k, (axis, to)) in self.axes.iter().zip(&other.axes).enumerate() {
                        let to = to[j];
                        for (d2, x) in d2.iter_mut().zip(&axis[start..start + n]) {
                            let square = (x - to) * (x - to);
                            *d2 = if k == 0 { square } else { *d2 + square };
                        }
                    }
                    d2.iter().fold(f64::INFINITY, |low, &d| if d < low { d } else { low })
                },
            );
            if lowest > worst {
                continue;
            }
            for (offset, &d2) in d2.iter().enumerate() {
                if d2 <= worst && d2 > beyond && Some(start + offset) != skip {
                    found.push((d2, index(start + offset)));
                }
            }
            if found.len() >= 2 * count {
                found.select_nth_unstable_by(count - 1, order);
                found.truncate(count);
                worst = found[count - 1].0;
            }
        }
        found.sort_unstable_by(order);
        found.truncate(count);
    }

    /// The `count` points that are nearest to point `i` among the others that are farther from it than `radius`; among
    /// all others where that is 0. Nearest first.
    #[cfg(feature = "fit")]
    pub(super) fn nearest_outside(&self, i: usize, radius: f64, count: usize) -> Vec<u32> {
        let beyond = if radius > 0.0 { radius * radius } else { f64::NEG_INFINITY };
        let mut found = Vec::new();
        self.nearest(Among { beyond, ..Among::all_but(self.len, i) }, (self, i), count, &mut found);
        found.into_iter().map(|(_, j)| j).collect()
    }

    /// For every point, its nearest ones among those before it in the order.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled) where the observer stops the work.
    pub(super) fn nearest_before(&self, count: usize, watch: &Watch) -> Result<Neighbours> {
        self.of_all(self, count, watch, Among::first)
    }

    /// For every point, its nearest ones among all others.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled) where the observer stops the work.
    #[cfg(feature = "fit")]
    pub(super) fn nearest_others(&self, count: usize, watch: &Watch) -> Result<Neighbours> {
        self.of_all(self, count, watch, |i| Among::all_but(self.len, i))
    }

    /// For every one of `points`, the nearest of these points.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled) where the observer stops the work.
    pub(super) fn nearest_to(&self, points: &Self, count: usize, watch: &Watch) -> Result<Neighbours> {
        self.of_all(points, count, watch, |_| Among::first(self.len))
    }

    fn of_all(
        &self,
        points: &Self,
        count: usize,
        watch: &Watch,
        among: impl Fn(usize) -> Among + Sync,
    ) -> Result<Neighbours> {
        let steps = watch.steps(points.len / STEP);
        let sets = (0..points.len).into_par_iter().map_init(Vec::new, |found, j| {
            if j % STEP == STEP - 1 {
                steps.take()?;
            }
            self.nearest(among(j), (points, j), count, found);
            Ok(found.iter().map(|&(_, i)| i).collect())
        });
        Ok(Neighbours { sets: sets.collect::<Result<_>>()? })
    }
}

/// A set of samples for each of several points, nearest first.
#[derive(Clone, Debug, Default)]
pub(super) struct Neighbours {
    sets: Vec<Vec<u32>>,
}

impl Neighbours {
    pub(super) fn of(&self, point: usize) -> &[u32] {
        &self.sets[point]
    }

    pub(super) fn len(&self) -> usize {
        self.sets.len()
    }
}

#[expect(clippy::cast_possible_truncation, reason = "fewer samples than 2^32 fit in memory")]
fn index(i: usize) -> u32 {
    i as u32
}

/// The shortest length scale along each axis.
fn length_scales(kernel: &Kernel) -> Vec<f64> {
    let mut lengths = vec![f64::INFINITY; kernel.dimension()];
    for term in &kernel.terms {
        match &term.body {
            KernelBody::Ard { length_scale, .. } => {
                lengths.iter_mut().zip(length_scale).for_each(|(l, &other)| *l = l.min(other));
            }
            KernelBody::Product(axes) => {
                for (l, axis) in lengths.iter_mut().zip(axes) {
                    *l = axis.terms.iter().fold(*l, |l, term| l.min(term.length_scale));
                }
            }
        }
    }
    lengths
}

#[cfg(all(test, feature = "fit"))]
mod tests {
    use super::*;
    use crate::kernel::test_kernels;

    fn points(n: usize) -> Vec<f64> {
        let mut random = SplitMix64::new(3);
        (0..3 * n).map(|_| random.next_unit()).collect()
    }

    #[test]
    fn neighbours_are_those_of_the_sorted_distances() {
        let (x, watch) = (points(700), Watch::default());
        let to = points(20);
        for kernel in test_kernels() {
            let (all, others) = (Embedded::new(&x, &kernel), Embedded::new(&to, &kernel));
            let lengths = length_scales(&kernel);
            let distance = |a: &[f64], b: &[f64]| -> f64 {
                (0..3).map(|k| (kernel.metric[k].distance(a[k], b[k]) / lengths[k]).powi(2)).sum()
            };
            let nearest = |to: &[f64], limit: usize, skip: usize, count: usize| {
                let mut all: Vec<(f64, usize)> = (0..limit)
                    .filter(|&i| i != skip)
                    .map(|i| (distance(&x[3 * i..3 * i + 3], to), i))
                    .collect();
                all.sort_by(|a, b| a.0.total_cmp(&b.0));
                all.truncate(count);
                all
            };
            let same = |found: &[u32], to: &[f64], expected: Vec<(f64, usize)>| {
                assert_eq!(found.len(), expected.len());
                for (&found, (d2, _)) in found.iter().zip(expected) {
                    let found = found as usize;
                    assert!((distance(&x[3 * found..3 * found + 3], to) - d2).abs() < 1e-12);
                }
            };
            let (before, without) =
                (all.nearest_before(9, &watch).unwrap(), all.nearest_others(9, &watch).unwrap());
            let nearby = all.nearest_to(&others, 12, &watch).unwrap();
            for i in [0, 1, 5, 300, 699] {
                let at = &x[3 * i..3 * i + 3];
                same(before.of(i), at, nearest(at, i, usize::MAX, 9));
                same(without.of(i), at, nearest(at, 700, i, 9));
            }
            for j in 0..20 {
                let at = &to[3 * j..3 * j + 3];
                same(nearby.of(j), at, nearest(at, 700, usize::MAX, 12));
            }
        }
    }

    #[test]
    fn the_order_follows_the_samples_and_not_their_places() {
        let x = points(50);
        let y = vec![(0..50).map(f64::from).collect::<Vec<_>>()];
        let order = scrambled_order(&x, 3, &y);
        let reversed: Vec<f64> = x.chunks(3).rev().flatten().copied().collect();
        let back = vec![(0..50).rev().map(f64::from).collect::<Vec<_>>()];
        let again = scrambled_order(&reversed, 3, &back);
        assert_eq!(order, again.iter().map(|i| 49 - i).collect::<Vec<_>>());
        let mut sorted = order;
        sorted.sort_unstable();
        assert_eq!(sorted, (0..50).collect::<Vec<_>>());
    }
}
