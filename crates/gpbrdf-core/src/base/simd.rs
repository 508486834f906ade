//! Loops over slices in the widest vector instructions that the processor has, chosen at run time.
//!
//! No fused multiply-add is used, so the results are the same on every processor.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f64x8};

/// Runs `op` compiled for the best instruction set that the processor has. Only code that is inlined into `op`
/// becomes faster, and only if `op` itself is marked `#[inline(always)]`: it is compiled once for each instruction set.
#[inline(always)]
pub(crate) fn vectorized<R>(op: impl FnOnce() -> R) -> R {
    dispatch!(Level::new(), simd => simd.vectorize(op))
}

/// 1.5 * 2^52: adding it rounds a number to an integer, which is then found in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// `ln 2` in two parts. The high part has 32 trailing zero bits, so that `n * LN_2_HIGH` is exact.
const LN_2_HIGH: f64 = f64::from_bits(0x3fe6_2e42_fee0_0000);
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// An index or a count in the 32 bits that vector instructions convert.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "no table here has four billion numbers")]
pub(crate) const fn index(i: usize) -> u32 {
    i as u32
}

/// 1.5 * 2^23: what [`ROUND`] is in single precision.
const ROUND_F32: f32 = 12_582_912.0;

/// The cell of a position in `[0, last + 1]`, one of `0..=last`, and how far into it the position is. A position on the
/// border of two cells may belong to either. NaN belongs to the last one.
///
/// A cast of a floating-point number to an integer saturates, which keeps a loop from vector instructions; this is an
/// addition and a look at the low bits.
#[inline(always)]
pub(crate) fn cell(position: f32, last: u32) -> (u32, f32) {
    let shifted = (position - 0.5) + ROUND_F32;
    let index = shifted.to_bits().wrapping_sub(ROUND_F32.to_bits()).min(last);
    (index, position - index.cast_signed() as f32)
}

/// `2^n` for an integer `n` in -1022..=1023.
#[inline(always)]
fn exp2_integer(n: f64) -> f64 {
    f64::from_bits((n + (ROUND + 1023.0)).to_bits() << 52)
}

/// `exp(x)` without a branch, within 2 units in the last place; 0 below -745.14, infinite above 709.79, NaN
/// for NaN.
///
/// Method: `x = n ln 2 + r` with `|r| <= ln(2) / 2`, a Taylor polynomial of degree 13 in `r`, and a scaling
/// by `2^n` in two steps, so that results below the normal range are rounded only once.
#[inline(always)]
pub(crate) fn exp(x: f64) -> f64 {
    let x = if x < -746.0 { -746.0 } else { x };
    let x = if x > 710.0 { 710.0 } else { x };
    let n = (x * std::f64::consts::LOG2_E + ROUND) - ROUND;
    let r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    let mut p = 1.0 / 6_227_020_800.0;
    p = p * r + 1.0 / 479_001_600.0;
    p = p * r + 1.0 / 39_916_800.0;
    p = p * r + 1.0 / 3_628_800.0;
    p = p * r + 1.0 / 362_880.0;
    p = p * r + 1.0 / 40_320.0;
    p = p * r + 1.0 / 5_040.0;
    p = p * r + 1.0 / 720.0;
    p = p * r + 1.0 / 120.0;
    p = p * r + 1.0 / 24.0;
    p = p * r + 1.0 / 6.0;
    p = p * r + 0.5;
    let e = 1.0 + (r + r * r * p);
    let half = (0.5 * n + ROUND) - ROUND;
    e * exp2_integer(half) * exp2_integer(n - half)
}

/// The largest argument of [`exp_negative`].
pub(crate) const LARGEST_NEGATIVE: f64 = 708.0;

/// The polynomial `q` of degree 9 in `exp(-r) = 1 - r + r^2 q(r)` for `|r| <= ln(2) / 2`, to a relative error of 2e-17,
/// from interpolation at Chebyshev nodes.
const NEGATIVE: [f64; 10] = [
    0.500_000_000_000_000_1,
    -0.166_666_666_666_666_69,
    0.041_666_666_666_624_13,
    -0.008_333_333_333_330_062,
    0.001_388_888_891_721_371_7,
    -0.000_198_412_698_630_536_18,
    2.480_152_129_595_437_6e-5,
    -2.755_726_845_999_706_4e-6,
    2.762_008_844_540_974_6e-7,
    -2.510_038_549_551_032e-8,
];

/// `exp(-s)` for `s` between 0 and [`LARGEST_NEGATIVE`], within 2 units in the last place; NaN for NaN. It takes a
/// third fewer operations than [`exp`].
///
/// Method: `s = r - n ln 2` with `|r| <= ln(2) / 2`, a polynomial in `r`, and a scaling by `2^n`.
#[inline(always)]
pub(crate) fn exp_negative(s: f64) -> f64 {
    // The low bits hold the exponent of 2^n as it is stored.
    const SHIFT: f64 = ROUND + 1023.0;
    let shifted = SHIFT - s * std::f64::consts::LOG2_E;
    let n = shifted - SHIFT;
    let r = (s + n * LN_2_HIGH) + n * LN_2_LOW;
    let mut q = NEGATIVE[9];
    for k in (0..9).rev() {
        q = q * r + NEGATIVE[k];
    }
    let e = 1.0 + (r * r * q - r);
    e * f64::from_bits(shifted.to_bits() << 52)
}

/// Replaces every element by its exponential, to the accuracy of [`exp`].
pub(crate) fn exp_slice(x: &mut [f64]) {
    vectorized(
        #[inline(always)]
        || {
            for v in x.iter_mut() {
                *v = exp(*v);
            }
        },
    );
}

/// Number of partial sums of a reduction. They run side by side, in an order that does not depend on the
/// processor.
const LANES: usize = 8;

/// `sum_i a_i b_i` over slices of the same length.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_chunks, a_rest) = a.as_chunks::<LANES>();
    let (b_chunks, b_rest) = b.as_chunks::<LANES>();
    let lanes = vectorized(
        #[inline(always)]
        || {
            let mut lanes = [0.0; LANES];
            for (a, b) in a_chunks.iter().zip(b_chunks) {
                for l in 0..LANES {
                    lanes[l] += a[l] * b[l];
                }
            }
            lanes
        },
    );
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    lanes.iter().sum::<f64>() + rest
}

/// `sum_i a_i b_i c_i` over slices of the same length.
#[cfg(feature = "fit")]
pub(crate) fn dot3(a: &[f64], b: &[f64], c: &[f64]) -> f64 {
    let (a_chunks, a_rest) = a.as_chunks::<LANES>();
    let (b_chunks, b_rest) = b.as_chunks::<LANES>();
    let (c_chunks, c_rest) = c.as_chunks::<LANES>();
    let lanes = vectorized(
        #[inline(always)]
        || {
            let mut lanes = [0.0; LANES];
            for ((a, b), c) in a_chunks.iter().zip(b_chunks).zip(c_chunks) {
                for l in 0..LANES {
                    lanes[l] += a[l] * b[l] * c[l];
                }
            }
            lanes
        },
    );
    let rest: f64 = a_rest.iter().zip(b_rest).zip(c_rest).map(|((a, b), c)| a * b * c).sum();
    lanes.iter().sum::<f64>() + rest
}

/// Eight numbers, in vector registers whatever surrounds them.
type Lanes<S> = f64x8<S>;

/// For three columns `c`, adds `scale_c row_i` to `sum_ci` and returns `sum_i row_i x_ci`. All columns have the length
/// of `row`.
#[cfg(feature = "fit")]
pub(crate) fn dots_and_updates(
    row: &[f64],
    x: [&[f64]; 3],
    scale: [f64; 3],
    sum: [&mut [f64]; 3],
) -> [f64; 3] {
    #[inline(always)]
    fn lanes<S: Simd>(
        simd: S,
        row: &[[f64; LANES]],
        [x0, x1, x2]: [&[[f64; LANES]]; 3],
        scale: [f64; 3],
        [sum0, sum1, sum2]: [&mut [[f64; LANES]]; 3],
    ) -> [[f64; LANES]; 3] {
        let splat = |value: f64| Lanes::splat(simd, value);
        let (a, b, c) = (splat(scale[0]), splat(scale[1]), splat(scale[2]));
        let (mut dot0, mut dot1, mut dot2) = (splat(0.0), splat(0.0), splat(0.0));
        let sums = sum0.iter_mut().zip(sum1).zip(sum2);
        for (((row, x), (x1, x2)), ((s0, s1), s2)) in row.iter().zip(x0).zip(x1.iter().zip(x2)).zip(sums) {
            let row = Lanes::simd_from(simd, *row);
            dot0 += row * Lanes::simd_from(simd, *x);
            dot1 += row * Lanes::simd_from(simd, *x1);
            dot2 += row * Lanes::simd_from(simd, *x2);
            *s0 = (Lanes::simd_from(simd, *s0) + row * a).into();
            *s1 = (Lanes::simd_from(simd, *s1) + row * b).into();
            *s2 = (Lanes::simd_from(simd, *s2) + row * c).into();
        }
        [dot0.into(), dot1.into(), dot2.into()]
    }

    let (row, rest) = row.as_chunks();
    let (whole, x_rest) = (x.map(|x| x.as_chunks().0), x.map(|x| x.as_chunks::<LANES>().1));
    let [(sum0, rest0), (sum1, rest1), (sum2, rest2)] = sum.map(|sum| sum.as_chunks_mut());
    let lanes =
        dispatch!(Level::new(), simd => lanes(simd, row, whole, scale, [&mut *sum0, &mut *sum1, &mut *sum2]));
    for (sum, scale) in [rest0, rest1, rest2].into_iter().zip(scale) {
        sum.iter_mut().zip(rest).for_each(|(sum, row)| *sum += row * scale);
    }
    with_rest(lanes, rest, x_rest)
}

/// `sum_i row_i x_ci` for three columns `c` of the length of `row`.
pub(crate) fn dots(row: &[f64], x: [&[f64]; 3]) -> [f64; 3] {
    #[inline(always)]
    fn lanes<S: Simd>(
        simd: S,
        row: &[[f64; LANES]],
        [x0, x1, x2]: [&[[f64; LANES]]; 3],
    ) -> [[f64; LANES]; 3] {
        let zero = Lanes::splat(simd, 0.0);
        let (mut dot0, mut dot1, mut dot2) = (zero, zero, zero);
        for (((row, x0), x1), x2) in row.iter().zip(x0).zip(x1).zip(x2) {
            let row = Lanes::simd_from(simd, *row);
            dot0 += row * Lanes::simd_from(simd, *x0);
            dot1 += row * Lanes::simd_from(simd, *x1);
            dot2 += row * Lanes::simd_from(simd, *x2);
        }
        [dot0.into(), dot1.into(), dot2.into()]
    }

    let (row, rest) = row.as_chunks();
    let (whole, x_rest) = (x.map(|x| x.as_chunks().0), x.map(|x| x.as_chunks::<LANES>().1));
    let lanes = dispatch!(Level::new(), simd => lanes(simd, row, whole));
    with_rest(lanes, rest, x_rest)
}

/// The sums over lanes, together with the products of what fills no more lanes.
fn with_rest(lanes: [[f64; LANES]; 3], row: &[f64], x: [&[f64]; 3]) -> [f64; 3] {
    std::array::from_fn(|c| {
        let rest: f64 = row.iter().zip(x[c]).map(|(row, x)| row * x).sum();
        lanes[c].iter().sum::<f64>() + rest
    })
}

/// `out_i += a x_i`.
pub(crate) fn add_scaled(a: f64, x: &[f64], out: &mut [f64]) {
    vectorized(
        #[inline(always)]
        || {
            for (o, x) in out.iter_mut().zip(x) {
                *o += a * x;
            }
        },
    );
}

/// `x_i = a x_i`.
pub(crate) fn scale_in_place(a: f64, x: &mut [f64]) {
    vectorized(
        #[inline(always)]
        || {
            for x in x.iter_mut() {
                *x *= a;
            }
        },
    );
}

/// `out_i = a x_i`.
pub(crate) fn scale_into(a: f64, x: &[f64], out: &mut [f64]) {
    vectorized(
        #[inline(always)]
        || {
            for (o, x) in out.iter_mut().zip(x) {
                *o = a * x;
            }
        },
    );
}

/// `out_i *= x_i`.
pub(crate) fn multiply(x: &[f64], out: &mut [f64]) {
    vectorized(
        #[inline(always)]
        || {
            for (o, x) in out.iter_mut().zip(x) {
                *o *= x;
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_slice_is_within_two_units_in_the_last_place() {
        let inputs: Vec<f64> = (0..=400_000).map(|i| -708.0 + 1417.0 * f64::from(i) / 400_000.0).collect();
        let near_zero = (-60..=0).flat_map(|e| [2f64.powi(e), -2f64.powi(e), 0.7 * 2f64.powi(e)]);
        let inputs: Vec<f64> = inputs.into_iter().chain(near_zero).collect();
        let mut values = inputs.clone();
        exp_slice(&mut values);
        for (x, value) in inputs.iter().zip(values) {
            let ulps = value.to_bits().abs_diff(x.exp().to_bits());
            assert!(ulps <= 2, "exp({x}): {value:e}, {ulps} units in the last place");
        }
    }

    #[test]
    fn exponentials_of_negative_numbers_are_within_two_units_in_the_last_place() {
        let inputs = (0..=400_000).map(|i| LARGEST_NEGATIVE * f64::from(i) / 400_000.0);
        for s in inputs.chain((-60..=0).flat_map(|e| [2f64.powi(e), 0.7 * 2f64.powi(e)])) {
            let ulps = exp_negative(s).to_bits().abs_diff((-s).exp().to_bits());
            assert!(ulps <= 2, "exp(-{s}): {:e}, {ulps} units in the last place", exp_negative(s));
        }
        assert_eq!(exp_negative(0.0), 1.0);
        assert!(exp_negative(f64::NAN).is_nan() && exp_negative(f64::from_bits(u64::MAX)).is_nan());
    }

    #[test]
    fn cells_hold_their_positions() {
        for i in 0..=7 * 64u16 {
            let position = f32::from(i) / 64.0;
            let (index, along) = cell(position, 6);
            assert!(index <= 6 && (0.0..=1.0).contains(&along), "{position}: {index} {along}");
            assert_eq!(index as f32 + along, position);
        }
        for position in [f32::NAN, f32::INFINITY, 8.0] {
            assert_eq!(cell(position, 6).0, 6);
        }
        assert_eq!(cell(f32::MIN_POSITIVE, 6), (0, f32::MIN_POSITIVE));
    }

    #[test]
    fn sums_of_several_columns_match_plain_ones() {
        for n in [0u32, 3, 8, 29] {
            let column = |c: u32| -> Vec<f64> { (0..n).map(|i| f64::from((i * i + c) % 7)).collect() };
            let (row, x) = (column(9), [column(0), column(1), column(2)]);
            let x = x.each_ref().map(Vec::as_slice);
            let plain = x.map(|x| row.iter().zip(x).map(|(a, b)| a * b).sum::<f64>());
            assert_eq!(dots(&row, x), plain);
            #[cfg(feature = "fit")]
            {
                let mut sums = [column(3), column(4), column(5)];
                let parts = sums.each_mut().map(Vec::as_mut_slice);
                assert_eq!(dots_and_updates(&row, x, [1.0, 2.0, 3.0], parts), plain);
                for (c, sum) in (3..).zip(&sums) {
                    let expected = column(c).into_iter().zip(&row).map(|(s, r)| s + f64::from(c - 2) * r);
                    assert_eq!(*sum, expected.collect::<Vec<_>>());
                }
            }
        }
    }

    #[test]
    fn exp_slice_at_the_ends_of_the_range() {
        let inputs =
            [0.0, -0.0, f64::NEG_INFINITY, -1e300, -746.0, -745.2, 709.78, 709.79, 1e300, f64::INFINITY];
        let mut values = inputs;
        exp_slice(&mut values);
        assert_eq!(values[..2], [1.0, 1.0]);
        assert_eq!(values[2..6], [0.0; 4]);
        assert!((values[6] / 709.78f64.exp() - 1.0).abs() < 1e-15);
        assert_eq!(values[7..], [f64::INFINITY; 3]);
        for x in [-745.0f64, -740.0, -720.0, -709.0] {
            let mut value = [x];
            exp_slice(&mut value);
            assert!(value[0].to_bits().abs_diff(x.exp().to_bits()) <= 2, "{x}: {:e} {:e}", value[0], x.exp());
        }
        let mut nan = [f64::NAN];
        exp_slice(&mut nan);
        assert!(nan[0].is_nan());
    }

    #[test]
    fn dot_products_match_plain_sums() {
        for n in [0u32, 1, 7, 8, 9, 61] {
            let a: Vec<f64> = (0..n).map(|i| f64::from(i) - 3.0).collect();
            let b: Vec<f64> = (0..n).map(|i| f64::from(i * i) + 1.0).collect();
            let plain: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            assert_eq!(dot(&a, &b), plain);
            #[cfg(feature = "fit")]
            assert_eq!(dot3(&a, &a, &b), a.iter().zip(&b).map(|(a, b)| a * a * b).sum::<f64>());
        }
    }
}
