//! Seeded random numbers and evenly spread orders, the same on every machine and for every number of threads.

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
    fn subsets_are_distinct_and_spread() {
        let mut picked = golden_ratio_subset(1000, 50);
        picked.sort_unstable();
        assert_eq!(picked.len(), 50);
        assert!(picked.windows(2).all(|pair| (3..=60).contains(&(pair[1] - pair[0]))), "{picked:?}");
    }
}
