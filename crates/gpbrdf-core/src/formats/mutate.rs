//! Seeded damage to the bytes of a file, for tests that no reader panics.
#![allow(clippy::cast_possible_truncation, reason = "random bits may be cut")]

use crate::base::random::SplitMix64;

/// Random integers of the sizes that [`mutations`] needs.
pub(crate) struct Random(SplitMix64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// 32 random bits.
    pub(crate) fn bits32(&mut self) -> u32 {
        self.next() as u32
    }

    /// A number below `bound`, or 0 where that is 0.
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound.max(1) as u64) as usize
    }
}

/// `count` damaged copies of `bytes`. The damage is changed bytes, mostly among the first `head`; words set
/// to extreme values; truncations; and removed or repeated pieces.
pub(crate) fn mutations(bytes: &[u8], head: usize, seed: u64, count: usize) -> impl Iterator<Item = Vec<u8>> {
    let mut random = Random::new(seed);
    (0..count).map(move |_| {
        let mut copy = bytes.to_vec();
        for _ in 0..=random.below(3) {
            let reach = if random.below(4) > 0 { head.min(copy.len()) } else { copy.len() };
            let at = random.below(reach);
            match random.below(6) {
                0 | 1 if !copy.is_empty() => copy[at] = random.next() as u8,
                2 if !copy.is_empty() => copy[at] ^= 1 << random.below(8),
                3 => {
                    let word = [0, u64::MAX, u64::MAX >> 1, 1 << 32, 0x7FF8 << 48][random.below(5)];
                    let width = [1, 2, 4, 8][random.below(4)].min(copy.len() - at);
                    copy[at..at + width].copy_from_slice(&word.to_le_bytes()[..width]);
                }
                4 => copy.truncate(at),
                _ => {
                    let end = (at + random.below(16)).min(copy.len());
                    let piece = copy[at..end].to_vec();
                    if random.below(2) == 0 {
                        copy.drain(at..end);
                    } else {
                        copy.splice(at..at, piece);
                    }
                }
            }
        }
        copy
    })
}
