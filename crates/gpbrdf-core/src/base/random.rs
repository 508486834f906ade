//! Seeded random numbers and evenly spread orders, the same on every machine and for every number of threads.
//! Normal deviates take a logarithm and a cosine, whose last bit is up to the machine's mathematical library.

use std::f64::consts::TAU;

/// `SplitMix64` (G. L. Steele, D. Lea and C. H. Flood, "Fast Splittable Pseudorandom Number Generators",
/// OOPSLA 2014).
#[derive(Clone, Debug)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// A generator whose whole sequence is determined by `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The generator of one of several independent sequences of a seed: it starts at the first output of the
    /// generator whose seed is `seed` with bits flipped as `index` says, so that a sequence stays the same
    /// however many numbers the others take.
    #[must_use]
    pub fn stream(seed: u64, index: u64) -> Self {
        Self(Self(seed ^ index.wrapping_mul(0xD1B5_4A32_D192_ED03)).next_u64())
    }

    /// The next 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// The next number, uniform on `[0, 1)`.
    pub fn next_unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (0.5f64).powi(53)
    }

    /// The next standard normal deviate: `sqrt(-2 ln u) cos(2 pi v)` with `u` uniform on `(0, 1]` and `v` on
    /// `[0, 1)` (G. E. P. Box and M. E. Muller, "A Note on the Generation of Random Normal Deviates", Annals
    /// of Mathematical Statistics 29, 1958, page 610). The sine of the same pair is not used, so that every
    /// deviate takes two numbers of the sequence. None is larger than 8.6.
    pub fn next_normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.next_unit()).ln()).sqrt();
        radius * (TAU * self.next_unit()).cos()
    }

    /// Moves `count` items, drawn without replacement, to the front: the first steps of a Fisher-Yates
    /// shuffle. All items are shuffled if `count` exceeds their number.
    pub fn draw_to_front<T>(&mut self, items: &mut [T], count: usize) {
        for i in 0..count.min(items.len()) {
            let left = (items.len() - i) as u64;
            #[expect(clippy::cast_possible_truncation, reason = "below the number of items")]
            let j = i + (self.next_u64() % left) as usize;
            items.swap(i, j);
        }
    }
}

/// `count` of the indices `0..n`, spread evenly over them: those whose product with the golden ratio has the
/// smallest fractional part, in the order of that part. Every prefix of the result is spread evenly, too.
#[must_use]
pub fn golden_ratio_subset(n: usize, count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    let fraction = |i: usize| (i as f64 * 0.618_033_988_749_894_9).fract();
    order.sort_by(|&a, &b| fraction(a).total_cmp(&fraction(b)));
    order.truncate(count);
    order
}

/// Point `i` of an additive recurrence that fills the unit cube evenly: `frac(1/2 + i g^-k)` for `k = 1, 2, 3`, where
/// `g^4 = g + 1`. Source: M. Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences" (2018).
#[must_use]
pub fn quasi_random(i: usize) -> [f64; 3] {
    const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_900_4];
    STEPS.map(|step| (0.5 + step * i as f64).fract())
}

/// Point `i` of an additive recurrence from `start` that fills the unit square evenly: `frac(start + i g^-k)` for
/// `k = 1, 2`, where `g^3 = g + 1`. Source: that of [`quasi_random`].
#[must_use]
pub fn quasi_random_pair(start: [f64; 2], i: usize) -> [f64; 2] {
    const STEPS: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3];
    std::array::from_fn(|k| (start[k] + STEPS[k] * i as f64).fract())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_the_published_one() {
        // The first outputs of the reference implementation for the seed 1234567.
        let mut random = SplitMix64::new(1_234_567);
        let found: Vec<u64> = (0..3).map(|_| random.next_u64()).collect();
        assert_eq!(found, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]);
    }

    #[test]
    fn normal_deviates_have_the_moments_of_the_normal_distribution() {
        const COUNT: usize = 200_000;
        let mut random = SplitMix64::new(11);
        let deviates: Vec<f64> = (0..COUNT).map(|_| random.next_normal()).collect();
        let moment = |power| deviates.iter().map(|g| g.powi(power)).sum::<f64>() / COUNT as f64;
        // Each bound is five standard deviations of the moment: sqrt((E g^2p - (E g^p)^2) / COUNT).
        for (power, expected, variance) in
            [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0), (6, 15.0, 10_170.0)]
        {
            let bound = 5.0 * f64::sqrt(variance / COUNT as f64);
            assert!((moment(power) - expected).abs() < bound, "moment {power}: {}", moment(power));
        }
        let within = |limit: f64| deviates.iter().filter(|g| g.abs() < limit).count() as f64 / COUNT as f64;
        assert!((within(1.0) - 0.682_689).abs() < 0.005 && (within(1.96) - 0.950_004).abs() < 0.003);
        let following = deviates.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / COUNT as f64;
        assert!(following.abs() < 5.0 / (COUNT as f64).sqrt(), "correlation {following}");
    }

    #[test]
    fn streams_of_a_seed_differ_and_repeat() {
        let first = |seed, index| SplitMix64::stream(seed, index).next_u64();
        let mut found: Vec<u64> =
            (0..20).flat_map(|seed| (0..5).map(move |index| first(seed, index))).collect();
        assert_eq!(found[7], first(1, 2));
        found.sort_unstable();
        found.dedup();
        assert_eq!(found.len(), 100);
    }

    #[test]
    fn drawn_items_are_distinct_and_any_item_is_as_likely() {
        let mut random = SplitMix64::new(5);
        let mut hits = [0; 10];
        for _ in 0..10_000 {
            let mut items: Vec<usize> = (0..10).collect();
            random.draw_to_front(&mut items, 3);
            items[..3].iter().for_each(|&item| hits[item] += 1);
            items.sort_unstable();
            assert!(items.iter().copied().eq(0..10));
        }
        assert!(hits.iter().all(|hit| (2800..3200).contains(hit)), "{hits:?}");
        random.draw_to_front(&mut [1, 2], 9);
    }

    #[test]
    fn subsets_are_distinct_and_spread() {
        let mut picked = golden_ratio_subset(1000, 50);
        picked.sort_unstable();
        assert_eq!(picked.len(), 50);
        assert!(picked.windows(2).all(|pair| (3..=60).contains(&(pair[1] - pair[0]))), "{picked:?}");
    }
}
