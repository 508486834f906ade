//! Seeded damage to the bytes of a file.
#![allow(clippy::cast_possible_truncation, reason = "random bits may be cut")]

use gpbrdf_core::base::SplitMix64;

/// Words that sizes in headers are set to.
const EXTREME: [u64; 8] =
    [0, 1, 0x7FFF_FFFF, 0xFFFF_FFFF, 1 << 32, u64::MAX >> 1, u64::MAX, 0x7FF8_0000_0000_0000];

/// Texts that numbers are replaced by.
const NUMBERS: [&str; 8] =
    ["0", "-1", "1e309", "nan", "99999999999999999999", "4294967296", "2147483647", ""];

/// `count` damaged copies: truncated, with bits flipped, with blocks swapped, removed or repeated, with words or
/// numbers of extreme sizes.
pub(crate) fn copies(bytes: &[u8], head: usize, seed: u64, count: usize) -> impl Iterator<Item = Vec<u8>> {
    let mut random = SplitMix64::new(seed);
    let mut below = move |bound: usize| (random.next_u64() % bound.max(1) as u64) as usize;
    (0..count).map(move |_| {
        let mut copy = bytes.to_vec();
        for _ in 0..=below(3) {
            let reach = if below(4) > 0 { head.min(copy.len()) } else { copy.len() };
            let at = below(reach);
            let end = (at + 1 + below(24)).min(copy.len());
            match below(7) {
                0 => copy.truncate(at),
                1 if at < copy.len() => copy[at] ^= 1 << below(8),
                2 => {
                    let width = [2, 4, 8][below(3)].min(copy.len() - at);
                    let word = EXTREME[below(EXTREME.len())].to_le_bytes();
                    copy[at..at + width].copy_from_slice(&word[..width]);
                }
                3 => {
                    let other = below(copy.len());
                    for (a, b) in (at..end).zip(other..copy.len()) {
                        copy.swap(a, b);
                    }
                }
                4 => {
                    // The next run of digits.
                    let Some(begin) = copy[at..].iter().position(u8::is_ascii_digit).map(|i| at + i) else {
                        continue;
                    };
                    let length = copy[begin..].iter().take_while(|byte| byte.is_ascii_digit()).count();
                    copy.splice(begin..begin + length, NUMBERS[below(NUMBERS.len())].bytes());
                }
                5 => drop(copy.drain(at..end)),
                _ => {
                    let piece = copy[at..end].to_vec();
                    copy.splice(at..at, piece);
                }
            }
        }
        copy
    })
}
